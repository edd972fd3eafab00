"""Abaqus assemblies as flat meshes: every instance of a part has its numbers, names and position.

References
----------
Abaqus Analysis User's Guide, "Assembly definition": the first line of *INSTANCE is a translation, the second
a rotation by degrees about the axis from one point to another, after the translation.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import quote

Lines = list[list[str]]
Keyword = tuple[str, dict[str, str], Lines]
_SETS = {"NSET": "NSET", "ELSET": "ELSET", "SURFACE": "NAME"}  # keyword -> option that names it
_MADE = {"NODE": "NSET", "ELEMENT": "ELSET"}  # keyword -> option that names a set of what it makes


@dataclass(frozen=True)
class Instance:
    """A part's position in an assembly.

    Attributes
    ----------
    prefix : of its names; empty where it is the only instance
    shift : what its numbers are raised by
    R, t : rotation (3, 3) and translation (3,) of its nodes
    """

    prefix: str
    shift: int
    R: Floats
    t: Floats

    @property
    def moved(self) -> bool:
        """Tell whether its nodes stand elsewhere than its part's."""
        return bool((np.eye(3) != self.R).any() or self.t.any())

    def word(self, word: str) -> str:
        """A number raised, or the name of one of its sets."""
        if re.fullmatch(r"\d{1,17}", word):
            return str(int(word) + self.shift)
        return f"{self.prefix}{word}" if word else word

    def keyword(self, keyword: Keyword) -> Keyword:
        """Keyword of the part as it is in the assembly."""
        name, options, lines = keyword
        label = _SETS.get(name) or _MADE.get(name, "")
        if label in options:
            options = options | {label: f"{self.prefix}{options[label]}"}
        if name == "NODE":
            return name, options, [self._node(line) for line in lines]
        if name == "ELEMENT":
            options = options | ({"INSTANCE": self.prefix[:-1]} if self.prefix else {})
            return name, options, [[self.word(word) for word in line] for line in lines]
        if name in _SETS:
            return name, options, [self.members(name, options, line) for line in lines]
        return keyword

    def members(self, name: str, options: dict[str, str], line: list[str]) -> list[str]:
        """A line of a set: its members, but no step and no side."""
        count = 1 if name == "SURFACE" else 2 if "GENERATE" in options else len(line)
        return [*map(self.word, line[:count]), *line[count:]]

    def _node(self, line: list[str]) -> list[str]:
        number = self.word(line[0])
        if not self.moved:
            return [number, *line[1:]]
        x = np.array([float(word or 0.0) for word in (*line[1:4], "0", "0", "0")[:3]])
        return [number, *(repr(float(value)) for value in self.R @ x + self.t)]


def flat(keywords: Iterator[Keyword], remarks: list[str]) -> Iterator[Keyword]:
    """Keywords of an assembly as those of a mesh without parts; others as they are.

    Where there are several instances, the numbers of each but the first are raised, names get the instance's
    and a dot before them, and its elements are a set of its name.

    Raises
    ------
    ValueError
        for instances of parts that are not given, and moves that are no numbers.
    """
    every = list(keywords)
    count = sum(name == "INSTANCE" for name, *_ in every)
    if not count:
        yield from every
        return
    parts: dict[str, list[Keyword]] = {}
    instances: dict[str, Instance] = {}
    numbers = [line[0] for name, _, lines in every if name in _MADE for line in lines]
    largest = max((int(word) for word in numbers if re.fullmatch(r"\d{1,17}", word)), default=1)
    step = 10 ** len(str(largest))
    keywords_of: list[Keyword] | None = None  # of the part or instance that is being read
    for keyword in every:
        name, options, lines = keyword
        if name == "PART":
            keywords_of = parts.setdefault(options.get("NAME", "").upper(), [])
        elif name == "INSTANCE":
            label = options.get("NAME", "")
            part = options.get("PART", "")
            if part.upper() not in parts:
                raise ValueError(f"*INSTANCE {label} is of part {quote(part)}, which is not given before it")
            keywords_of = [*parts[part.upper()]]
            instances[label.upper()] = _placed(label if count > 1 else "", lines, step * len(instances))
        elif name == "END INSTANCE" and keywords_of is not None and instances:
            yield from map(list(instances.values())[-1].keyword, keywords_of)
            keywords_of = None
        elif name == "END PART":
            keywords_of = None
        elif keywords_of is not None:
            keywords_of.append(keyword)
        else:
            yield _in_assembly(keyword, instances)
    if keywords_of is not None:
        raise ValueError("its last *PART or *INSTANCE has no end: the file was cut")
    if count > 1:
        remarks.append(f"it has {count} instances: numbers of the second are raised by {step}, and so on")


def _placed(name: str, lines: Lines, shift: int) -> Instance:
    try:
        rows = [[float(word or 0.0) for word in line] for line in lines]
        t = np.array((rows[0] if rows else [0.0, 0.0, 0.0]), dtype=float).reshape(3)
        R = np.eye(3)
        if len(rows) > 1:
            a, b, angle = np.array(rows[1][:3]), np.array(rows[1][3:6]), np.radians(rows[1][6])
            # Rodrigues' formula, with K v = axis x v
            K = np.cross(np.eye(3), (b - a) / np.linalg.norm(b - a))
            R = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
            t = R @ (t - a) + a
    except (ValueError, IndexError):
        rows = [[np.nan]]
    if len(rows) > 2 or not np.isfinite([*R.ravel(), *t] if rows != [[np.nan]] else [np.nan]).all():
        raise ValueError(
            f"*INSTANCE {name} has {quote(' / '.join(','.join(line) for line in lines))}, expected a "
            "translation of three numbers and a rotation of seven, two points and degrees"
        )
    return Instance(f"{name}." if name else "", shift, R, t)


def _in_assembly(keyword: Keyword, instances: dict[str, Instance]) -> Keyword:
    """Sets of the assembly, whose members are an instance's by `instance=` or by its name and a dot."""
    name, options, lines = keyword
    if name not in _SETS:
        return keyword
    if (of := options.get("INSTANCE", "").upper()) in instances:
        return name, options, [instances[of].members(name, options, line) for line in lines]

    def qualified(word: str) -> str:
        of, dot, label = word.partition(".")
        return instances[of.upper()].word(label) if dot and of.upper() in instances else word

    return name, options, [[qualified(word) for word in line] for line in lines]
