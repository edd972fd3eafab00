"""VTK's .vtu: one piece of an unstructured grid; arrays as text, base64 or appended, plain or compressed.

Read here and not by meshio 5.3, which takes the last piece of several, prints what it leaves out, and lets
zlib, base64 and struct raise what they like where a file is damaged.
"""

from __future__ import annotations

import base64
import binascii
import lzma
import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from romdam.core.scene import Ints
from romdam.geometry.elements import CELLS
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.data import LARGEST, MeshFile, by_value, cannot_be_read, checked_mesh, numbers_of

_TYPES = {cell.vtk: cell for cell in CELLS.values() if cell.vtk is not None}
# Lagrange cells and how many nodes they have -> the type with these nodes in this order; longer ones have
# orders of their own.
_LAGRANGE = {(68, 2): 3, (69, 3): 5, (70, 4): 9, (71, 4): 10, (71, 10): 24, (72, 8): 12, (73, 6): 13}
_NUMBERS = {
    f"{sign}{kind}{bits}": f"{code}{bits // 8}"
    for sign, kind, code, all_bits in (
        ("", "Float", "f", (32, 64)), ("", "Int", "i", (8, 16, 32, 64)), ("U", "Int", "u", (8, 16, 32, 64))
    )
    for bits in all_bits
}  # fmt: skip
_COMPRESSORS: dict[str, Callable[[], Any]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lambda: lzma.LZMADecompressor(memlimit=1 << 28),
}
_PREFERRED = ("group", "region", "material", "CellEntityIds", "gmsh:physical", "nastran:ref", "medit:ref")
_MOST = 1000  # values of an array among several that makes groups: what has more numbers the cells


@dataclass(frozen=True)
class _Grid:
    """A file taken apart: its XML, the bytes appended to it and how arrays are coded."""

    root: ElementTree.Element
    appended: bytes
    encoding: str
    order: str
    header: str
    compressor: str | None

    def array(self, tag: ElementTree.Element, rows: int | None, width: int = 1) -> NDArray[Any]:
        """The values of a DataArray, (rows, width) or (rows,); any number of rows if None."""
        kind, name = tag.get("type", ""), tag.get("Name", "array")
        if kind not in _NUMBERS:
            raise ValueError(f"{name} is of type {kind!r}")
        dtype = np.dtype(self.order + _NUMBERS[kind])
        if int(tag.get("NumberOfComponents") or width) != width:
            raise ValueError(f"{name} has {tag.get('NumberOfComponents')} components, expected {width}")
        if tag.get("format") == "ascii":
            values = numbers_of((tag.text or "").split(), name)
            if (dtype.kind != "f" and not (values == np.rint(values)).all()) or "_" in (tag.text or ""):
                raise ValueError(f"{name} holds what is no whole number")
            values = values if dtype.kind == "f" else values.astype(np.int64)
        else:
            raw = self.content(tag, name)
            if len(raw) % dtype.itemsize:
                raise ValueError(f"{name} has {len(raw)} bytes, no multiple of {dtype.itemsize}")
            values = np.frombuffer(raw, dtype)
        if rows is not None and len(values) != rows * width:
            raise ValueError(f"{name} has {len(values)} numbers, expected {rows * width}: the file was cut")
        return values.reshape(-1, width) if width > 1 else values

    def content(self, tag: ElementTree.Element, name: str) -> bytes:
        """Content of a binary or appended array."""
        form = tag.get("format")
        if form == "binary":
            return self.unpacked("".join((tag.text or "").split()).encode(), True)
        if form != "appended" or not re.fullmatch(r"\s*\d{1,15}\s*", tag.get("offset", "")):
            raise ValueError(f"{name} has format {form!r} and offset {tag.get('offset')!r}")
        data = self.appended[int(tag.get("offset", "")) :]
        if self.encoding == "base64":
            return self.unpacked(b"".join(data.split()), True)
        return self.unpacked(data, False)

    def unpacked(self, data: bytes, coded: bool) -> bytes:
        """The first array in `data`: a header that says how long it is, and perhaps compressed blocks."""
        size = np.dtype(self.header).itemsize
        if self.compressor is None:
            length = int(np.frombuffer(_decoded(data, 0, size, coded), self.header)[0])
            # characters of a header that is coded by itself, and then ends with =
            head_size = -(-size // 3) * 4
            if coded and length and data[head_size - 1 : head_size] == b"=":
                return _decoded(data, head_size, length, coded)
            return _decoded(data, 0, size + length, coded)[size:]
        count = int(np.frombuffer(_decoded(data, 0, size, coded), self.header)[0])
        head = _decoded(data, 0, size * (3 + count), coded)
        blocks = np.frombuffer(head, self.header).astype(np.int64)
        at = -(-len(head) // 3) * 4 if coded else len(head)
        packed = _decoded(data, at, int(blocks[3:].sum()), coded)
        full, last = int(blocks[1]), int(blocks[2])
        if blocks.min() < 0 or full * count > LARGEST:
            raise ValueError(
                f"an array says that it holds {count} blocks of {full} bytes, limit {LARGEST:g} bytes"
            )
        sizes = [full] * count
        if count and last:
            sizes[-1] = last
        ends = np.cumsum(blocks[3:])
        contents = []
        for end, n, wanted in zip(ends.tolist(), blocks[3:].tolist(), sizes, strict=True):
            # not one byte more than wanted: it may be a bomb
            content = _COMPRESSORS[self.compressor]().decompress(packed[end - n : end], wanted + 1)
            if len(content) != wanted:
                raise ValueError(f"a compressed block holds {len(content)} bytes, expected {wanted}")
            contents.append(content)
        return b"".join(contents)


def read_vtu(path: Path, location: str) -> MeshFile:
    """Read an unstructured grid; groups are the values of its array of whole numbers over the cells.

    Of several arrays it is the one that is named as groups are; else groups are called by array and value, as
    `attribute:7`.

    Raises
    ------
    MeshError
        for what is damaged or contradicts itself, and several pieces.
    """
    location = f"{location}: {path}"
    try:
        grid = _parse(path.read_bytes())
        pieces = grid.root.findall("UnstructuredGrid/Piece")
        if len(pieces) != 1:
            raise ValueError(f"it has {len(pieces)} pieces, limit 1: merge them, with the nodes between them")
        (piece,) = pieces
        arrays = piece.findall("Points/DataArray")
        if len(arrays) != 1:
            raise ValueError(f"<Points> has {len(arrays)} arrays, expected 1")
        points = grid.array(arrays[0], _count(piece, "NumberOfPoints"), 3).astype(float)
        cells, rows = _cells(grid, piece)
        tables = _groups(grid, piece)
    except (
        ValueError,
        binascii.Error,
        zlib.error,
        lzma.LZMAError,
        EOFError,
        ElementTree.ParseError,
    ) as error:
        raise cannot_be_read(location, "vtu", " ".join(str(error).split()) or type(error).__name__) from None
    mesh = checked_mesh(np.arange(len(points)), points, cells, location)
    groups = {name: by_value([values[r] for r in rows]) for name, values in tables.items()}
    if len(groups) < 2:
        return replace(mesh, groups=next(iter(groups.values()), {}))
    many = [name for name, of_array in groups.items() if len(of_array) > _MOST]
    named = {
        f"{name}:{value}": members
        for name, of_array in groups.items() if name not in many
        for value, members in of_array.items()
    }  # fmt: skip
    remark = (
        f"{len(groups)} arrays of whole numbers stand on its cells, none of them named "
        f"{' or '.join(_PREFERRED[:3])}: groups are called as {next(iter(named), 'none')}"
    )
    if many:
        remark += f"; {', '.join(many)} with more than {_MOST} values each make no groups"
    return replace(mesh, groups=named, remarks=(*mesh.remarks, remark))


def _parse(data: bytes) -> _Grid:
    """Cut raw appended bytes out, which are no XML, and parse the rest."""
    if data.lstrip()[:8] == b"# vtk Da":
        raise ValueError("it is VTK's older format, which ParaView opens and saves as .vtu")
    match = re.search(rb"<AppendedData[^>]*>", data)
    appended = b""
    if match is not None:
        stop = data.rfind(b"</AppendedData>")
        start = data.find(b"_", match.end())
        if stop < 0 or not 0 <= start < stop:
            raise ValueError("its appended data does not begin with _ or has no end: the file was cut")
        appended, data = data[start + 1 : stop], data[: match.end()] + data[stop:]
    root = ElementTree.fromstring(data)
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise ValueError(
            f"it is a {root.tag} of type {root.get('type')}, expected VTKFile of UnstructuredGrid"
        )
    tag = root.find("AppendedData")
    encoding = "" if tag is None else tag.get("encoding", "base64")
    order = {"LittleEndian": "<", "BigEndian": ">"}.get(root.get("byte_order", "LittleEndian"))
    header, compressor = root.get("header_type", "UInt32"), root.get("compressor") or None
    if order is None or header not in ("UInt32", "UInt64") or compressor not in (None, *_COMPRESSORS):
        raise ValueError(
            f"byte_order {root.get('byte_order')}, header_type {header}, compressor {compressor}: not known"
        )
    if encoding not in ("", "raw", "base64"):
        raise ValueError(f"its appended data is encoded as {encoding}, expected raw or base64")
    return _Grid(root, appended, encoding, order, order + _NUMBERS[header], compressor)


def _named(piece: ElementTree.Element, name: str) -> ElementTree.Element:
    arrays = [a for a in piece.findall("Cells/DataArray") if a.get("Name") == name]
    if len(arrays) != 1:
        raise ValueError(f"<Cells> has {len(arrays)} arrays {name}, expected 1")
    return arrays[0]


def _count(piece: ElementTree.Element, name: str) -> int:
    word = piece.get(name, "").strip()
    if not re.fullmatch(r"\d{1,12}", word):
        raise ValueError(f"{name} is {word!r}, expected a whole number")
    return int(word)


def _decoded(data: bytes, at: int, count: int, coded: bool) -> bytes:
    """`count` bytes from position `at`, which are a whole piece of base64 where coded."""
    length = -(-count // 3) * 4 if coded else count
    if count < 0 or at + length > len(data):
        raise ValueError(f"an array of {count} bytes is longer than its data: the file was cut")
    piece = data[at : at + length]
    content = base64.b64decode(piece, validate=True) if coded else piece
    if len(content) < count:
        raise ValueError(f"an array ends {count - len(content)} bytes early: the file was cut")
    return content[:count]


def _cells(grid: _Grid, piece: ElementTree.Element) -> tuple[list[Cells], list[Ints]]:
    """The elements kind by kind, and the rows of the file that each holds."""
    count = _count(piece, "NumberOfCells")
    types = grid.array(_named(piece, "types"), count).astype(np.int64)
    ends = grid.array(_named(piece, "offsets"), count).astype(np.int64)
    nodes = grid.array(_named(piece, "connectivity"), None).astype(np.int64)
    lengths = np.diff(ends, prepend=0)
    for (lagrange, length), plain in _LAGRANGE.items():
        types = np.where((types == lagrange) & (lengths == length), plain, types)
    unknown = np.flatnonzero(~np.isin(types, list(_TYPES)))
    if len(unknown):
        raise ValueError(f"cell {unknown[0]} is of VTK's type {types[unknown[0]]}, which is not known")
    sizes = np.array([_TYPES[t].nodes for t in types.tolist()], dtype=np.int64)
    wrong = np.flatnonzero(lengths != sizes)
    if len(wrong) or (ends[-1] if count else 0) != len(nodes):
        at = wrong[0] if len(wrong) else count - 1
        raise ValueError(
            f"the nodes of cell {at} (VTK type {types[at] if count else 0}) are not as many as offsets say"
        )
    cells, rows = [], []
    for kind in dict.fromkeys(types.tolist()):
        cell_rows = np.flatnonzero(types == kind)
        cell = _TYPES[kind]
        cells.append(
            Cells(cell.name, nodes[ends[cell_rows][:, None] - cell.nodes + np.arange(cell.nodes)], cell_rows)
        )
        rows.append(cell_rows)
    return cells, rows


def _groups(grid: _Grid, piece: ElementTree.Element) -> dict[str, Ints]:
    """Arrays of whole numbers that may hold the groups, by name: one where a name says which."""
    arrays = {
        a.get("Name", ""): a
        for a in piece.findall("CellData/DataArray")
        if "Int" in a.get("type", "") and int(a.get("NumberOfComponents") or 1) == 1
    }
    names = [name for name in arrays if not name.startswith("vtk")]
    chosen = [name for name in _PREFERRED if name in names][:1] or names
    count = _count(piece, "NumberOfCells")
    return {name: grid.array(arrays[name], count).astype(np.int64) for name in chosen}
