"""Meshes of code_aster in its own format (.mail): nodes, elements and groups by name.

No library reads them.

References
----------
code_aster, U3.01.00, Description du fichier de maillage au format ASTER. Uprights come before the top ring
in HEXA20, HEXA27 and PENTA15 (U3.01.00, tables of elements).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from romdam.core.errors import quote
from romdam.core.files import file_text
from romdam.core.scene import Ints
from romdam.geometry.elements import CELLS
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.data import MeshFile, cannot_be_read, checked_mesh, grouped, numbers_of

_CELLS = {cell.aster: cell for cell in CELLS.values() if cell.aster}
_ELEMENT = re.compile(r"(?:POI|SEG|TRIA|QUAD|HEXA|PENTA|PYRAM|TETRA)(\d+)")  # and its number of nodes
_HEADER = re.compile(r"\b(NOM|NOBJ|NB\w+|NUM\w*|AUTEUR|DATE|FORMAT)\s*=\s*((?!\w+\s*=)\S*)", re.IGNORECASE)
_SECTIONS = ("TITRE", "COOR_1D", "COOR_2D", "COOR_3D", "GROUP_MA", "GROUP_NO")


@dataclass
class _Section:
    """Lines between a keyword and FINSF."""

    where: int
    keyword: str
    name: str  # of NOM = ..., of groups
    words: list[str]


@dataclass
class _Names:
    """Numbers from 1 on for names."""

    numbers: dict[str, int] = field(default_factory=dict)

    def new(self, name: str, what: str) -> int:
        """Number of a name that is given once."""
        if name in self.numbers:
            raise ValueError(f"{what} {quote(name)} is given twice")
        return self.numbers.setdefault(name, len(self.numbers) + 1)

    def take_own(self) -> None:
        """Take the names' own numbers, as 12 of N12, where they are different."""
        matches = [re.fullmatch(r"\D*(\d{1,17})", name) for name in self.numbers]
        if all(matches) and len({int(match[1]) for match in matches if match}) == len(matches):
            self.numbers = {
                name: int(match[1]) for name, match in zip(self.numbers, matches, strict=True) if match
            }

    def of(self, names: list[str], what: str) -> Ints:
        """Numbers of known names."""
        lost = [name for name in names if name not in self.numbers]
        if lost:
            raise ValueError(f"{what} names {quote(lost[0])}, which is not given ({len(lost)} such names)")
        return np.array([self.numbers[name] for name in names], dtype=np.int64)


def read_aster(path: Path, location: str) -> MeshFile:
    """Read a .mail file; GROUP_MA and GROUP_NO by name.

    Raises
    ------
    MeshError
        for sections without FINSF, files without FIN, elements that are no names of nodes.
    """
    location = f"{location}: {path}"
    try:
        sections = list(_sections(file_text(path).split("\n")))
        nodes, elements = _Names(), _Names()
        if any(section.keyword == "COOR_2D" for section in sections):
            raise ValueError("COOR_2D: the mesh is of two dimensions")
        numbers: list[str] = []
        for section in sections:
            if section.keyword == "COOR_3D":
                for k in range(0, len(section.words), 4):
                    nodes.new(section.words[k], "node")
                    numbers += section.words[k + 1 : k + 4]
        if len(numbers) != 3 * len(nodes.numbers):
            raise ValueError("COOR_3D ends amid a node, of a name and three coordinates")
        nodes.take_own()
        words = [word.upper().replace("D", "E") for word in numbers]
        points = numbers_of(words, "COOR_3D").reshape(-1, 3)
        cells: list[Cells] = []
        left_out: dict[str, Ints] = {}
        for section in sections:
            if match := _ELEMENT.fullmatch(section.keyword):
                what, size = f"{section.keyword} of line {section.where}", int(match[1])
                rows = [section.words[k : k + 1 + size] for k in range(0, len(section.words), 1 + size)]
                if rows and len(rows[-1]) != 1 + size:
                    raise ValueError(f"{what} ends amid element {quote(rows[-1][0])}, of {size} nodes")
                ids = np.array([elements.new(row[0], "element") for row in rows], dtype=np.int64)
                if (cell := _CELLS.get(section.keyword)) is None:
                    left_out[section.keyword] = np.union1d(left_out.get(section.keyword, ids), ids)
                elif rows:
                    table = nodes.of([name for row in rows for name in row[1:]], what).reshape(len(rows), -1)
                    cells.append(Cells(cell.name, cell.in_vtk_order(table, "aster"), ids))
        mesh = checked_mesh(np.array(list(nodes.numbers.values()), dtype=np.int64), points, cells, location)
        unsound: dict[str, str] = {}
        elements_of, nodes_of = (
            _members(sections, keyword, names, unsound)
            for keyword, names in (("GROUP_MA", elements), ("GROUP_NO", nodes))
        )
    except ValueError as error:
        raise cannot_be_read(location, ".mail", str(error)) from None
    mesh = grouped(mesh, elements_of, nodes_of, left_out)
    remarks = [f"group {name!r}: {reason}; no key may name it" for name, reason in unsound.items()]
    return replace(mesh, remarks=(*mesh.remarks, *remarks), unsound=unsound)


def _sections(lines: list[str]) -> Iterator[_Section]:
    """Sections of a file; FIN ends the last one too, and a second FINSF is nothing."""
    section: _Section | None = None
    for k, line in enumerate(lines):
        text = line.partition("%")[0].strip()
        keyword, _, rest = text.replace("\t", " ").partition(" ")
        keyword = keyword.upper()
        if not text or (section is None and keyword == "FINSF"):
            continue
        if keyword == "FIN":
            if section is not None:
                yield section
            return
        if section is None:
            if keyword not in _SECTIONS and not _ELEMENT.fullmatch(keyword):
                raise ValueError(f"line {k + 1}: {quote(keyword)} is no section of the format")
            section = _Section(k + 1, keyword, "", [])
            text = rest
        elif keyword in _SECTIONS and section.keyword != "TITRE":
            raise ValueError(f"{section.keyword} of line {section.where} has no FINSF: the file was cut")
        if section.keyword == "TITRE":
            ended = "FINSF" in text.upper().split()
        else:
            header = {key.upper(): value for key, value in _HEADER.findall(text)}
            words = _HEADER.sub(" ", text).replace("=", " ").split()
            section.name = section.name or header.get("NOM", "")
            ended = bool(words) and words[-1].upper() == "FINSF"
            section.words.extend(words[:-1] if ended else words)
        if ended:
            yield section
            section = None
    raise ValueError("it does not end with FIN: the file was cut")


def _members(
    sections: list[_Section], keyword: str, names: _Names, unsound: dict[str, str]
) -> dict[str, Ints]:
    """Members of groups by number; `unsound` gains the groups that name what is not given."""
    members_of: dict[str, Ints] = {}
    for section in sections:
        if section.keyword == keyword:
            words = section.words if section.name else section.words[1:]
            name = section.name or (section.words or [""])[0]
            lost = [word for word in words if word not in names.numbers]
            if name in members_of:
                unsound[name] = f"{keyword} is given twice"
            elif lost:
                unsound[name] = (
                    f"{keyword} names {quote(lost[0])}, which is not given ({len(lost)} such names)"
                )
            members_of[name] = names.of([word for word in words if word in names.numbers], keyword)
    return members_of
