"""Nastran bulk data: grid points and solid and shell elements, in small, large and free fields.

Read here and not by meshio 5.3, which takes continuation lines for entries where their first field is blank,
knows neither INCLUDE nor GRDSET nor CORD2*, and passes over large-field elements and a file that was cut.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np

from romdam.core.errors import MeshError, quote
from romdam.core.files import check_file, file_text
from romdam.core.scene import Floats, Ints
from romdam.geometry.elements import CELLS, ELEMENT_OF_CELL
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.data import (
    EVERYTHING,
    LARGEST,
    Frame,
    MeshFile,
    by_value,
    cannot_be_read,
    checked_mesh,
    missing_ids,
)

_ON_AXIS = 1e-8  # of a point's distance from the origin: nearer to the z axis it is on it
_DEEPEST = 10  # of files that include each other
_KINDS = {  # entry -> number of nodes -> what it holds
    name: {cell.nodes: cell for cell in CELLS.values() if name in cell.nastran}
    for name in dict.fromkeys(name for cell in CELLS.values() for name in cell.nastran)
}
_SHELL_NODES = {name: nodes for name, sizes in _KINDS.items() for nodes in sizes if sizes[nodes].dim == 2}
_SYSTEMS = ("CORD2R", "CORD2C", "CORD2S")
_READ = ("GRID", "GRDSET", "ENDDATA", "INCLUDE", *_KINDS, *_SYSTEMS)
# The entries of Nastran (432 in pyNastran 1.4, and those of the Quick Reference Guide) whose names
# differ by a letter from one that is read.
_ALIKE = {
    "CHEXA1", "CHEXA2", "CORD1C", "CORD1R", "CORD1S", "CORD3R", "CQUAD", "CQUAD1", "CQUAD2", "CQUADX",
    "CQUADX4", "CQUADX8", "CTRIA1", "CTRIA2", "CTRIAX", "CTRIAX6", "EGRID", "GRIDA", "GRIDB", "GRIDF",
    "GRIDG", "GRIDS", "OGRDSET",
}  # fmt: skip
_ELEMENT = re.compile(r"C(?!ORD|ONV)[A-Z0-9]+|RBE?\w+|PLOTEL")
_INCLUDE = re.compile(r"""\s*INCLUDE\s*(?:'([^']+)'|"([^"]+)"|([^'"]+))\s*""", re.IGNORECASE)
_REAL = re.compile(r"^([+-]?(?:\d+\.?\d*|\.\d+))(?:[ED]([+-]?\d+)|([+-]\d+))?$")


@dataclass(frozen=True)
class _Line:
    """A line with its fields: the name, the data fields (8 or 4) and the marker of the continuation."""

    where: str
    name: str
    fields: list[str]
    marker: str


@dataclass
class _Entry:
    """An entry with the data fields of all its lines."""

    where: str
    name: str
    fields: list[str]
    marker: str

    def whole(self, k: int, default: int | None = None) -> int:
        """Field k from 1 on as a whole number."""
        word = self.fields[k - 1] if k <= len(self.fields) else ""
        if word.isdigit() and word.isascii() and len(word) < 19:
            return int(word)
        if not word and default is not None:
            return default
        if not re.fullmatch(r"[+-]?\d{1,18}", word):
            raise ValueError(
                f"{self.where}: field {k + 1} of {self.name} is {quote(word)}, expected a whole number"
            )
        return int(word)

    def real(self, k: int) -> float:
        """Field k as a number; 0 where it is blank."""
        word = (self.fields[k - 1] if k <= len(self.fields) else "").upper()
        match = _REAL.match(word)
        if word and match is None:
            raise ValueError(
                f"{self.where}: field {k + 1} of {self.name} is {quote(word)}, expected a number"
            )
        return float(f"{match[1]}e{match[2] or match[3] or 0}") if match else 0.0

    @property
    def given(self) -> int:
        """Number of the last field that is not blank."""
        last = len(self.fields)
        while last and not self.fields[last - 1]:
            last -= 1
        return last


@dataclass
class _Deck:
    """Content read so far."""

    tags: list[int] = field(default_factory=list)
    points: list[tuple[float, float, float]] = field(default_factory=list)
    system: list[int | None] = field(default_factory=list)  # of every grid point; None takes GRDSET's
    moves: list[int | None] = field(default_factory=list)  # system of its displacement; None as above
    default: int = 0
    default_moves: int = 0
    systems: dict[int, tuple[str, int, Floats]] = field(default_factory=dict)  # kind, reference, A B C
    rows: dict[str, list[list[int]]] = field(default_factory=dict)  # cell -> number, property, nodes
    others: Counter[str] = field(default_factory=Counter)  # elements that are not read
    unread: dict[tuple[int, int], str] = field(default_factory=dict)  # dimension, property -> what is wrong
    blank: int = 0  # grid points with a blank coordinate
    ended: bool = False
    after: int = 0  # lines after ENDDATA

    def read(self, entry: _Entry) -> None:
        """Read one entry."""
        name = entry.name
        if name == "GRID":
            self.read_grid(entry)
        elif name in _KINDS:
            self.read_element(entry)
        elif name == "GRDSET":
            self.default, self.default_moves = entry.whole(2, 0), self.system_of_motion(entry) or 0
        elif name in _SYSTEMS:
            corners = np.array([entry.real(k) for k in range(3, 12)]).reshape(3, 3)
            system = (name, entry.whole(2, 0), corners)
            kind, reference, before = self.systems.setdefault(entry.whole(1), system)
            if (kind, reference) != system[:2] or (before != corners).any():
                raise ValueError(f"{entry.where}: coordinate system {entry.whole(1)} is given twice")
        elif name == "ENDDATA":
            self.ended = True
        elif meant := _meant(name):
            raise ValueError(f"{entry.where}: {name} is not known; is {meant} meant?")
        elif _ELEMENT.fullmatch(name):
            self.others[name] += 1

    def read_grid(self, entry: _Entry) -> None:
        """Read GRID."""
        cut = len(entry.fields) == 4 and entry.marker
        if cut or len(entry.fields) > 8:
            what = "lacks its continuation line" if cut else "has lines of another entry"
            raise ValueError(f"{entry.where}: GRID {entry.fields[0]} {what}")
        self.tags.append(entry.whole(1))
        self.points.append((entry.real(3), entry.real(4), entry.real(5)))
        self.system.append(entry.whole(2) if entry.fields[1:2] > [""] else None)
        self.moves.append(self.system_of_motion(entry))
        self.blank += not all(entry.fields[2:5]) or len(entry.fields) < 5

    @staticmethod
    def system_of_motion(entry: _Entry) -> int | None:
        """Field CD; None where it is blank, -1 (a fluid's) where it is no number: meshes need none."""
        word = "".join(entry.fields[5:6])
        return int(word) if re.fullmatch(r"\d{1,18}", word) else -1 if word else None

    def read_element(self, entry: _Entry) -> None:
        """Read a solid or a shell."""
        sizes = _KINDS[entry.name]
        most, shell = max(sizes), _SHELL_NODES.get(entry.name)
        corners = ELEMENT_OF_CELL[sizes[most].name].corners
        count = shell or entry.given - 2
        if corners < count < most and not entry.marker.strip():  # else a line is awaited and missing
            count = most  # middle nodes may be left out, the last ones too
        last = 2 + count
        entry.fields += [""] * (last - len(entry.fields))
        more = shell in (3, 4) and any(entry.fields[8:9])  # which is blank in the second line of these
        if count not in sizes or more or not all(entry.fields[: 2 + corners]):
            dim = next(iter(sizes.values())).dim
            self.unread.setdefault(
                (dim, entry.whole(2, 0)),
                f"{entry.where}: {entry.name} {entry.fields[0]} has "
                f"{sum(map(bool, entry.fields[2:]))} nodes, expected {' or '.join(map(str, sizes))}; a "
                "continuation line is missing or another's",
            )
            return
        row = [
            entry.whole(1),
            entry.whole(2, 0),
            *(entry.whole(k, 0) for k in range(3, last + 1)),
        ]
        self.rows.setdefault(sizes[count].name, []).append(row)

    def in_basic(self) -> Floats:
        """The grid points in the basic coordinate system."""
        points = np.array(self.points, dtype=float).reshape(-1, 3)
        systems = np.array([self.default if s is None else s for s in self.system], dtype=np.int64)
        for system in np.unique(systems[systems != 0]):
            points[systems == system] = self.to_basic(points[systems == system], int(system), ())
        return points

    def frames(self, points: Floats) -> dict[int, Frame]:
        """Number of each grid point that has a displacement coordinate system -> its axes.

        Parameters
        ----------
        points : of all grid points, in the basic system
        """
        frames = {}
        for tag, moves, point in zip(self.tags, self.moves, points, strict=True):
            system = self.default_moves if moves is None else moves
            if system:
                frames[tag] = Frame(system)
                with suppress(ValueError):  # not given: nothing but matrices asks for it
                    frames[tag] = Frame(system, self.axes_at(point, system))
        return frames

    def axes_at(self, point: Floats, system: int) -> Floats:
        """Axes (3, 3) along which a grid point moves in a coordinate system, one a row, in the basic system.

        Those of r, theta and z, or of r, theta (from z) and phi, at the point; on the z axis of a cylindrical
        or spherical system, where they are none, those of the rectangular system with its points A, B, C.
        """
        kind, origin, axes = self.defined(system, ())
        x, y, z = axes @ (point - origin)
        across = float(np.hypot(x, y))
        if kind == "CORD2R" or across <= _ON_AXIS * max(1.0, float(np.abs(point - origin).max())):
            return axes
        cos, sin = x / across, y / across
        if kind == "CORD2C":
            return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ axes
        r = float(np.hypot(across, z))
        up, out = z / r, across / r  # cosine and sine of theta
        at_point = [[out * cos, out * sin, up], [up * cos, up * sin, -out], [-sin, cos, 0.0]]
        return np.array(at_point) @ axes

    def defined(self, system: int, above: tuple[int, ...]) -> tuple[str, Floats, Floats]:
        """Kind, origin (3,) and rectangular axes (3, 3), one a row, of a coordinate system, in the basic one.

        It is given by its origin A, a point B on its z axis and a point C in its x-z plane.
        """
        if system not in self.systems or system in above:
            what = "refers to itself" if system in above else "is not given as CORD2R, CORD2C or CORD2S"
            raise ValueError(f"coordinate system {system} {what}; export with basic coordinates")
        kind, reference, corners = self.systems[system]
        A, B, C = self.to_basic(corners, reference, (*above, system))
        with np.errstate(invalid="ignore", divide="ignore"):
            k = (B - A) / np.linalg.norm(B - A)
            j = np.cross(k, C - A)
            j = j / np.linalg.norm(j)
        if not np.isfinite([k, j]).all():
            raise ValueError(f"the three points of coordinate system {system} lie on a line")
        return kind, A, np.stack([np.cross(j, k), j, k])

    def to_basic(self, points: Floats, system: int, above: tuple[int, ...]) -> Floats:
        """Points of a system in the basic one.

        Coordinates are x, y, z, cylindrical (r, theta, z) or spherical (r, theta from z, phi) in degrees.
        """
        if system == 0:
            return points
        kind, origin, axes = self.defined(system, above)
        if kind != "CORD2R":
            r, theta, third = points.T
            along, across = r * np.cos(np.radians(theta)), r * np.sin(np.radians(theta))
            if kind == "CORD2C":
                points = np.stack([along, across, third], axis=1)
            else:
                phi = np.radians(third)
                points = np.stack([across * np.cos(phi), across * np.sin(phi), along], axis=1)
        return origin + points @ axes


def read_grid_points(path: Path) -> tuple[Ints, Floats, dict[int, Frame]]:
    """Read the grid points of bulk data that need not be a whole model, such as a punch file.

    Returns
    -------
    numbers (n,); positions (n, 3) in the basic system; displacement axes of those that have some

    Raises
    ------
    MeshError, ValueError
        for lines that are no entries, and for coordinate systems of positions that are not given.
    """
    deck = _Deck()
    for entry in _entries(_lines(path, (), str(path))):
        if not deck.ended and entry.name in ("GRID", "GRDSET", "ENDDATA", *_SYSTEMS):
            deck.read(entry)
    points = deck.in_basic()
    return np.array(deck.tags, dtype=np.int64), points, deck.frames(points)


def read_nastran(path: Path, location: str) -> MeshFile:
    """Read a bulk data file and what it includes; groups are the properties.

    Raises
    ------
    MeshError
        for lines that are no entries, an end in a line, files that include each other.
    """
    location = f"{location}: {path}"
    deck = _Deck()
    try:
        for entry in _entries(_lines(path, (), location)):
            if deck.ended:
                deck.after += 1
            else:
                deck.read(entry)
        if not deck.ended and not file_text(path).endswith("\n"):
            raise ValueError("it ends in a line without ENDDATA: it was cut, or the line is to be added")
        points = deck.in_basic()
        frames = deck.frames(points)
    except ValueError as error:
        raise cannot_be_read(location, "nastran", str(error)) from None
    cells, properties = [], []
    for kind, rows in deck.rows.items():
        table = np.array(rows, dtype=np.int64)
        cells.append(Cells(kind, CELLS[kind].in_vtk_order(table[:, 2:], "nastran"), table[:, 0]))
        properties.append(table[:, 1])
    mesh = checked_mesh(np.array(deck.tags, dtype=np.int64), points, cells, location)
    groups = by_value(properties)
    groups.pop("0", None)  # elements without a property
    remarks = [*mesh.remarks]
    if deck.others:
        listed = ", ".join(f"{count} {name}" for name, count in sorted(deck.others.items()))
        remarks.append(f"elements that are neither solids nor shells are left out ({listed})")
    if deck.blank:
        remarks.append(f"{deck.blank} grid points leave a coordinate blank, which is read as 0")
    if not deck.ended:
        remarks.append("it has no ENDDATA; it is read to its last line")
    if deck.after:
        remarks.append(f"{deck.after} entries after ENDDATA are left out")
    remarks += deck.unread.values()
    unsound = {
        label: what for (dim, p), what in deck.unread.items() if dim == 3 for label in (EVERYTHING, str(p))
    }
    return replace(
        mesh,
        groups=groups,
        remarks=(*remarks, *missing_ids(cells)),
        unsound=unsound,
        unsound_faces={str(p): what for (dim, p), what in deck.unread.items() if dim == 2},
        frames=frames,
    )


def _lines(path: Path, above: tuple[Path, ...], location: str) -> Iterator[_Line]:
    """Lines of a file and of those that it includes, without comments and what stands before BEGIN BULK."""
    check_file(path, LARGEST, MeshError)
    here = path.resolve()
    if here in above or len(above) >= _DEEPEST:
        what = "includes itself" if here in above else f"is included {_DEEPEST} files deep, the limit"
        raise ValueError(f"{path} {what}")
    lines = file_text(path).split("\n")
    resume = 0
    begin = next((k for k, line in enumerate(lines) if line.strip().upper().startswith("BEGIN")), -1)
    for k, line in enumerate(lines):
        text = line.partition("$")[0].expandtabs(8).rstrip()
        where = f"line {k + 1}" if not above else f"{path.name} line {k + 1}"
        if not text or k == begin or k < resume:
            continue
        if text.lstrip()[:7].upper() == "INCLUDE":
            resume = k + 1
            while text[-1] not in "'\"" and re.search("['\"]", text) and resume < len(lines):
                text += lines[resume].strip()  # a name may go on in the next line, up to its closing quote
                resume += 1
            match = _INCLUDE.fullmatch(text)
            if match is None:
                raise ValueError(f"{where}: {quote(text)} names no file between quotes")
            included = path.parent / next(group for group in match.groups() if group)
            if not included.is_file():
                raise ValueError(f"{where}: the included file {included} does not exist")
            yield from _lines(included, (*above, here), location)
        elif k > begin:
            yield _fields(text, where)
        elif text.upper().startswith(("GRID", *_KINDS)):
            raise ValueError(f"{where}: {quote(text)} stands before BEGIN BULK")


def _fields(text: str, where: str) -> _Line:
    """Cut a line into its fields."""
    free = "," in text
    words = [word.strip() for word in text.split(",")] if free else [text[:8].strip()]
    wide = words[0].endswith("*") or words[0].startswith("*")
    count, width = (4, 16) if wide else (8, 8)
    if free:
        if any(words[2 + count :]) and (words[0].upper() in _READ or words[0][:1] in "+*"):
            raise ValueError(f"{where}: {quote(text)} has {len(words)} fields, limit {2 + count}")
        words += [""] * (2 + count - len(words))
    else:
        words += [text[8 + width * k : 8 + width * (k + 1)].strip() for k in range(count)] + [
            text[72:80].rstrip()
        ]
    name = words[0] if words[0].startswith(("*", "+")) else words[0].rstrip("*_ ").upper()  # meshio: CHEXA_
    return _Line(where, name, words[1 : 1 + count], words[1 + count])


def _entries(lines: Iterator[_Line]) -> Iterator[_Entry]:
    """Entries with their continuation lines, which follow them or are found by their markers."""
    entry, waiting, stray = None, list[_Entry](), dict[str, tuple[_Line, _Entry | None]]()
    unsettled = False  # whether a line below the entry may be its own or another's
    above = ""  # name of the entry that lines of "=" repeat
    for line in lines:
        if line.name and line.name[0] not in "+*":
            if line.name[0] != "=":
                above = line.name
            elif above in _READ:
                raise ValueError(
                    f"{line.where} repeats {above} by '=', which is not followed; write every entry out"
                )
            if entry is not None and not _marker(entry.marker) and not unsettled:
                yield entry
            elif entry is not None:  # a line with its marker may stand elsewhere
                waiting.append(entry)
            unsettled = False
            if line.name == "ENDDATA":
                yield from _continued(waiting, stray)
                waiting, stray = [], {}
            entry = _Entry(line.where, line.name, list(line.fields), line.marker)
            continue
        marker, awaited = _marker(line.name), "" if entry is None else _marker(entry.marker)
        if entry is not None and (marker in ("", awaited) or (not awaited and marker in stray)):
            entry.fields += line.fields
            entry.marker = line.marker
        elif not marker:
            raise ValueError(f"{line.where} continues nothing")
        elif marker in stray:
            raise ValueError(
                f"{line.where} and {stray[marker][0].where} both continue {quote(line.name)}; give every "
                "continuation a marker of its own"
            )
        else:
            stray[marker], unsettled = (line, entry), True
    yield from _continued([*waiting, *([] if entry is None else [entry])], stray)


def _continued(entries: list[_Entry], stray: dict[str, tuple[_Line, _Entry | None]]) -> Iterator[_Entry]:
    """Entries with the lines that their markers await; `stray` holds those, and the entries above them."""
    for entry in entries:
        while (found := stray.pop(_marker(entry.marker), None)) is not None:
            entry.fields += found[0].fields
            entry.marker = found[0].marker
    for line, above in stray.values():
        if above is None:
            raise ValueError(f"{line.where} continues nothing: no entry awaits {quote(line.name)}")
        if _marker(above.marker) in ("", _marker(line.name)):  # an entry that names no marker
            above.fields += line.fields
            above.marker = line.marker
        elif above.name in _READ:
            raise ValueError(
                f"{line.where} continues {quote(line.name)}, which no entry awaits; {quote(above.marker)} of "
                f"{above.name} in {above.where} is awaited"
            )
    yield from entries


def _marker(field: str) -> str:
    """A continuation's marker, whatever its first column."""
    return field[1:].lstrip()


@cache
def _meant(name: str) -> str:
    """The entry that a name differs from by a letter; empty where there is none."""
    for known in () if name in _ALIKE else _READ:
        if len(name) == len(known) and sum(a != b for a, b in zip(name, known, strict=True)) == 1:
            return known
        long, short = sorted((name, known), key=len, reverse=True)
        if len(long) == len(short) + 1 and any(long[:k] + long[k + 1 :] == short for k in range(len(long))):
            return known
    return ""
