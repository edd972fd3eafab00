"""Reader of STL files, binary or text: triangulated surfaces that cut blocks; they have no volume."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from romdam.core.errors import MeshError
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.data import MeshFile, checked_mesh, numbers_of

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
    # the number of triangles gives the length of a binary file, whose header may begin with "solid" too
    count = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
    try:
        if len(data) == _HEADER + count * _RECORD.itemsize:
            corners = np.frombuffer(data, _RECORD, offset=_HEADER)["corners"].reshape(-1, 3).astype(float)
        else:
            vertices, facets = _VERTEX.findall(data), len(re.findall(rb"^\s*endfacet\b", data, re.M))
            if not data.lstrip().startswith(b"solid") or len(vertices) != 3 * facets:
                raise ValueError(
                    f"it has {len(vertices)} corners and {facets} triangles, and not the length of a binary "
                    "file"
                )
            words = [word for vertex in vertices for word in vertex]
            corners = numbers_of(words, "its corners").reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"{location} cannot be read as an STL file ({error}); export it anew") from None
    number = np.arange(len(corners))
    cells = Cells("triangle", number.reshape(-1, 3), np.arange(len(corners) // 3))
    return checked_mesh(number, corners, [cells], location)
