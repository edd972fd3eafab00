"""Names that keys and words of a configuration had before; they are read for one release, with a warning.

A row leaves with the release after the one that brought it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from romdam.core.errors import ConfigError, quote

# path -> the key's name now; "*" stands for any name in a mapping and any entry of a list
KEYS = {
    "transient.dt": "finest_step",
    "outputs.every": "output_interval",
    "suite.keep.every": "output_interval",
    "model.corrections": "residual_vectors",
    "study.corrections": "residual_vectors",
    "study.dt": "finest_steps",
    "study.reference_dt": "reference_step",
}
# path -> word -> the word now
WORDS = {"loads.initial_state": {"from_start": "undeformed"}}


def with_present_names(raw: object, source: str) -> tuple[object, tuple[str, ...]]:
    """Give a raw configuration the names that keys and words have now.

    Parameters
    ----------
    raw : as YAML or JSON gives it; left as it is
    source : names it in errors

    Returns
    -------
    (configuration, warnings) : a warning for each old name, which tells the present one

    Raises
    ------
    ConfigError
        where a key is given by both its names.
    """
    remarks: list[str] = []
    for path, new in KEYS.items():
        *section, old = path.split(".")
        raw = _at(raw, section, _renaming(old, new, source, remarks))
    for path, words in WORDS.items():
        raw = _at(raw, path.split("."), _rewording(words, remarks))
    return raw, tuple(remarks)


def _renaming(old: str, new: str, source: str, remarks: list[str]) -> Callable[[Any, str], Any]:
    def rename(section: Any, location: str) -> Any:
        if not isinstance(section, dict) or old not in section:
            return section
        if new in section:
            raise ConfigError(
                f"{source}: {location}{old} is the name that {location}{new} had before, and both are given "
                f"({quote(section[old])} and {quote(section[new])}); remove {location}{old}"
            )
        remarks.append(
            f"{location}{old} is called {location}{new} now; the old name is read in this release only"
        )
        return {new if key == old else key: value for key, value in section.items()}

    return rename


def _rewording(words: dict[str, str], remarks: list[str]) -> Callable[[Any, str], Any]:
    def reword(value: Any, location: str) -> Any:
        if not isinstance(value, str) or value not in words:
            return value
        key = location.removesuffix(".")
        remarks.append(
            f"{key}: {value} is called {words[value]} now; the old word is read in this release only"
        )
        return words[value]

    return reword


def _at(tree: Any, path: list[str], change: Callable[[Any, str], Any], location: str = "") -> Any:
    """The tree with every value at a path changed; `change` gets the value and where it stands."""
    if not path:
        return change(tree, location)
    first, *rest = path
    if isinstance(tree, dict):
        keys = list(tree) if first == "*" else [key for key in (first,) if key in tree]
        return tree | {key: _at(tree[key], rest, change, f"{location}{key}.") for key in keys}
    if isinstance(tree, list) and first == "*":
        return [
            _at(member, rest, change, f"{location.removesuffix('.')}[{i}].") for i, member in enumerate(tree)
        ]
    return tree
