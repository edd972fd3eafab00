"""Patterns of block names, such as `dam.*`: where they may stand, and what then stands there."""

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


def is_pattern(name: str) -> bool:
    """Tell whether a name stands for all blocks that are like it; no block's name holds these characters."""
    return "*" in name or "?" in name


def patterns_in(config: object) -> tuple[str, ...]:
    """Keys of a configuration at which a pattern of blocks stands."""
    entries = (
        f"{where}[{k}].block"
        for path in _ENTRIES
        for where, entries in _lists(config, path)
        for k, entry in enumerate(entries)
        if is_pattern(entry.block)
    )
    names = (
        f"{where}[{k}]"
        for path in _NAMES
        for where, names in _lists(config, path)
        for k, name in enumerate(names)
        if is_pattern(name)
    )
    return (*entries, *names)


def with_matching_blocks(raw: dict[str, Any], blocks: Sequence[str], take: Take, source: str) -> None:
    """Put the blocks that are like each pattern in its place, in a mapping of a configuration.

    The first block takes the place of the pattern, and the others follow behind the list, so that numbers of
    entries stay those of the file.

    Parameters
    ----------
    blocks : names of all
    take : of a block's name and an entry with a face, the entry of that block; None without such a face
    source : of the configuration, for messages

    Raises
    ------
    ConfigError
        for a pattern that no block is like.
    """
    for path in _ENTRIES:
        for where, entries in _lists(raw, path):
            for k, entry in enumerate(list(entries)):
                if not is_pattern(entry["block"]):
                    continue
                alike = _alike(entry["block"], blocks, f"{source}: {where}[{k}].block")
                taken = [each for name in alike if (each := take(name, entry)) is not None]
                entries[k], *others = taken or [entry | {"block": alike[0]}]
                entries += others
    for path in _NAMES:
        for where, names in _lists(raw, path):
            wanted = [
                alike
                for k, name in enumerate(names)
                for alike in (_alike(name, blocks, f"{source}: {where}[{k}]") if is_pattern(name) else [name])
            ]
            names[:] = dict.fromkeys(wanted)


def _alike(pattern: str, blocks: Sequence[str], key: str) -> list[str]:
    alike = [name for name in blocks if fnmatch.fnmatchcase(name, pattern)]
    if not alike:
        raise ConfigError(f"{key}: no block is like {quote(pattern)}; blocks are {listed(blocks)}")
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
