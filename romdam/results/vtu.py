"""Meshes with fields as VTK's .vtu, for ParaView: arrays in base64, compressed with zlib.

References
----------
VTK User's Guide, "XML File Formats". A compressed array is coded in two pieces: a header of the number of
blocks, the size of a block, that of a last one which is not full, and the compressed sizes; then the blocks.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.files import replacing
from romdam.geometry.elements import Element
from romdam.geometry.meshes.kinds import kinds_of

_TYPES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}  # of numpy, little-endian


@dataclass(frozen=True)
class Grid:
    """Meshes of blocks in one, with fields.

    Attributes
    ----------
    points : (n, 3)
    cells : element, and nodes (k, nodes of the element) of its cells
    block : (cells,) number of each cell's block
    point_data : name -> (n,) or (n, components)
    """

    points: Floats
    cells: list[tuple[Element, Ints]]
    block: Ints
    point_data: dict[str, Floats] = field(default_factory=dict)


def mesh_of(blocks: Iterable[tuple[Floats, str, Ints]]) -> Grid:
    """Meshes of blocks (points, element, cells), one after another."""
    points: list[Floats] = []
    cells: list[tuple[Element, Ints]] = []
    number: list[Ints] = []
    first = 0
    for k, (at, element, cell_nodes) in enumerate(blocks):
        points.append(at)
        for kind, _, nodes in kinds_of(element, cell_nodes):
            cells.append((kind, nodes + first))
            number.append(np.full(len(nodes), k))
        first += len(at)
    return Grid(np.concatenate(points), cells, np.concatenate(number))


def write_vtu(grid: Grid, blocks: Iterable[str], path: Path) -> Path:
    """Write a grid; field data has the number of every block under its name."""
    nodes = [cell_nodes for _, cell_nodes in grid.cells]
    sizes = [np.full(len(cell_nodes), kind.cell.nodes) for kind, cell_nodes in grid.cells]
    types = [np.full(len(cell_nodes), kind.cell.vtk, dtype="<u1") for kind, cell_nodes in grid.cells]
    numbers = "".join(
        f'<DataArray type="Int32" Name={quoteattr(name)} NumberOfTuples="1" format="ascii">{k}</DataArray>\n'
        for k, name in enumerate(blocks)
    )
    text = (
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
        f"<FieldData>\n{numbers}</FieldData>\n"
        f'<Piece NumberOfPoints="{len(grid.points)}" NumberOfCells="{len(grid.block)}">\n'
        f"<Points>\n{_array('Points', grid.points.astype('<f8'))}</Points>\n<Cells>\n"
        + _array("connectivity", np.concatenate([n.ravel() for n in nodes]).astype("<i8"))
        + _array("offsets", np.cumsum(np.concatenate(sizes)).astype("<i8"))
        + _array("types", np.concatenate(types))
        + f"</Cells>\n<CellData>\n{_array('block', grid.block.astype('<i4'))}</CellData>\n<PointData>\n"
        + "".join(_array(name, np.asarray(values, "<f8")) for name, values in grid.point_data.items())
        + "</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
    )
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
    return path


def _array(name: str, values: Floats | Ints) -> str:
    """A DataArray of values (n,) or (n, components)."""
    raw = np.ascontiguousarray(values).tobytes()
    packed = zlib.compress(raw)
    header = np.array([1, len(raw), 0, len(packed)], dtype="<u8").tobytes()
    components = "" if values.ndim == 1 else f'NumberOfComponents="{values.shape[1]}" '
    return (
        f'<DataArray type="{_TYPES[values.dtype.str[1:]]}" Name={quoteattr(name)} '
        f'{components}format="binary">'
        f"{base64.b64encode(header).decode()}{base64.b64encode(packed).decode()}</DataArray>\n"
    )
