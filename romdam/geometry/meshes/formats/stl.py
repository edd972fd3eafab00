"""Reader of STL files, binary or text: triangulated surfaces that cut blocks; they have no volume."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import MeshError
from romdam.geometry.meshes.data import Cells, MeshFile, checked_mesh, numbers_of

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes before the first triangle
_VERTEX = re.compile(rb"^\s*vertex\s+(\S+)\s+(\S+)\s+(\S+)\s*$", re.M)


def read_stl(path: Path, location: str) -> MeshFile:
    """Read the triangles of a file; no two of them share a corner.

    Raises
    ------
    MeshError
        for a file that is damaged or truncated.
    """
    data, location = path.read_bytes(), f"{location}: {path}"
    try:
        corners = _binary(data) if _is_binary(data) else _text(data)
    except ValueError as error:
        raise MeshError(f"{location} cannot be read as an STL file ({error}); export it anew") from None
    number = np.arange(len(corners))
    cells = Cells("triangle", number.reshape(-1, 3), np.arange(len(corners) // 3))
    return checked_mesh(number, corners, [cells], location)


def _is_binary(data: bytes) -> bool:
    """Tell by the length of the file, which follows from the number of triangles.

    The first bytes do not tell: the header of a binary file may begin with "solid" too.
    """
    count = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
    return len(data) == _HEADER + count * _RECORD.itemsize


def _binary(data: bytes) -> Floats:
    return np.frombuffer(data, _RECORD, offset=_HEADER)["corners"].reshape(-1, 3).astype(float)


def _text(data: bytes) -> Floats:
    vertices, facets = _VERTEX.findall(data), len(re.findall(rb"^\s*endfacet\b", data, re.M))
    if not data.lstrip().startswith(b"solid") or len(vertices) != 3 * facets:
        raise ValueError(
            f"it has {len(vertices)} corners and {facets} triangles, and not the length of a binary file"
        )
    return numbers_of([word for vertex in vertices for word in vertex], "its corners").reshape(-1, 3)
