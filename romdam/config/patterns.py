"""Patterns of names of blocks and joints, such as `dam.*`: where they may stand, and what they stand for."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from romdam.core.errors import ConfigError, listed, quote

Path = tuple[str, ...]  # keys that lead to a list; EVERY for each entry of a list or mapping
Take = Callable[[str, Any], Any]
EVERY = "*"

# entries with a `block` and a face, or faces, of it
_ENTRIES: tuple[Path, ...] = (
    ("supports",),
    ("ground", "viscous"),
    ("loads", "pressure"),
    ("loads", "hydrostatic", EVERY, "faces"),
    ("loads", "ice", EVERY, "faces"),
    ("loads", "silt", EVERY, "faces"),
    ("water", "faces"),
    ("water", "rock"),
    ("outputs", "stress", "faces"),
)
# names of blocks
_NAMES: tuple[Path, ...] = (
    ("ground", "rock"),
    ("loads", "temperature", EVERY, "blocks"),
    ("construction", EVERY, "pour"),
    ("construction", EVERY, "temperature", EVERY, "blocks"),
    ("outputs", "stress", "blocks"),
    ("outputs", "stress", "sections", EVERY, "blocks"),
)
# names of joints
_JOINTS: tuple[Path, ...] = (
    ("loads", "joint_water", EVERY, "joints"),
    ("construction", EVERY, "grout", EVERY, "joints"),
    ("post_earthquake", "joints"),
)


def is_pattern(name: str) -> bool:
    """Tell whether a name stands for all that are like it; no block's or joint's name holds these letters."""
    return "*" in name or "?" in name


def patterns_in(config: object) -> tuple[str, ...]:
    """Keys of a configuration at which a pattern of blocks or joints stands."""
    entries = (
        f"{where}[{k}].block"
        for path in _ENTRIES
        for where, entries in _lists(config, path)
        for k, entry in enumerate(entries)
        if is_pattern(entry.block)
    )
    names = (
        f"{where}[{k}]"
        for path in (*_NAMES, *_JOINTS)
        for where, names in _lists(config, path)
        for k, name in enumerate(names)
        if is_pattern(name)
    )
    return (*entries, *names)


def with_matching_names(
    raw: dict[str, Any], blocks: Sequence[str], joints: Sequence[str], take: Take, source: str
) -> None:
    """Put the blocks and joints that are like each pattern in its place, in a mapping of a configuration.

    Of entries with a face the first block takes the place of the pattern, and the others follow behind the
    list, so that numbers of entries stay those of the file.

    Parameters
    ----------
    blocks, joints : names of all
    take : of a block's name and an entry with a face, the entry of that block; None without such a face
    source : of the configuration, for messages

    Raises
    ------
    ConfigError
        for a pattern that no block, or no joint, is like.
    """
    for path in _ENTRIES:
        for where, entries in _lists(raw, path):
            for k, entry in enumerate(list(entries)):
                if not is_pattern(entry["block"]):
                    continue
                alike = _alike(entry["block"], "block", blocks, f"{source}: {where}[{k}].block")
                taken = [each for name in alike if (each := take(name, entry)) is not None]
                entries[k], *others = taken or [entry | {"block": alike[0]}]
                entries += others
    for paths, kind, every in ((_NAMES, "block", blocks), (_JOINTS, "joint", joints)):
        for path in paths:
            for where, names in _lists(raw, path):
                wanted = [
                    alike
                    for k, name in enumerate(names)
                    for alike in (
                        _alike(name, kind, every, f"{source}: {where}[{k}]") if is_pattern(name) else [name]
                    )
                ]
                names[:] = dict.fromkeys(wanted)


def _alike(pattern: str, kind: str, every: Sequence[str], key: str) -> list[str]:
    alike = [name for name in every if fnmatch.fnmatchcase(name, pattern)]
    if not alike:
        raise ConfigError(f"{key}: no {kind} is like {quote(pattern)}; {kind}s are {listed(every)}")
    return alike


def _lists(section: Any, path: Path, where: str = "") -> Iterator[tuple[str, Any]]:
    """The lists at the end of a path, each with its key; of a mapping or of models."""
    if section is None or isinstance(section, str):
        return
    if not path:
        yield where, section
        return
    key, *rest = path
    if key != EVERY:
        inner = section.get(key) if isinstance(section, Mapping) else getattr(section, key, None)
        yield from _lists(inner, tuple(rest), f"{where}.{key}".removeprefix("."))
    elif isinstance(section, Mapping):
        for name, inner in section.items():
            yield from _lists(inner, tuple(rest), f"{where}.{name}")
    else:
        for k, inner in enumerate(section):
            yield from _lists(inner, tuple(rest), f"{where}[{k}]")
