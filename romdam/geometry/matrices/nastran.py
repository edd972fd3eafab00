"""Nastran's matrices: OUTPUT4 (.op4), and DMIG in punch files (.pch), read by pyYeti.

EXTSEOUT writes the matrices of an external superelement into an .op4 file, and EXTRN, which has the node and
direction of every row in the matrices' order, and the grid points with their coordinate systems into .pch and
.asm files.

Not by pyNastran 1.4, which needs numpy 1. pyYeti 1.4 holds a DMIG as a dense table.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array

from romdam.core.errors import MeshError, quote
from romdam.geometry.matrices.data import INTERNAL, Entries, MatrixUnknowns, meant, motion_of
from romdam.geometry.matrices.frames import with_frames
from romdam.geometry.meshes.formats.nastran import read_grid_points

_DAMAGE = (  # that pyYeti raises of a file that is not what its ending says
    ValueError, KeyError, IndexError, TypeError, AttributeError, RuntimeError, EOFError, OSError,
    OverflowError, MemoryError, StopIteration, struct.error,
)  # fmt: skip


def read_nastran(path: Path, key: str, location: str) -> Entries:
    """Read a matrix by its name, or that of a key: the only one in the file, or only one K..., M... or B...

    Parameters
    ----------
    key : `stiffness`, `mass`, `damping`, or a name in the file, small or capital letters alike

    Raises
    ------
    MeshError
        without pyYeti, where the file is damaged, or which matrix is meant cannot be told.
    """
    pyyeti = _pyyeti(location)
    try:
        if path.suffix.lower() == ".op4":
            matrices: dict[str, Any] = pyyeti.op4.read(str(path), sparse=True)
        else:
            matrices = pyyeti.bulk.rddmig(str(path), square=True)
    except _DAMAGE as error:
        raise MeshError(f"{location}: cannot be read ({quote(str(error))}); write it anew") from error
    matrix = matrices[meant(matrices, key, location)]
    if not hasattr(matrix, "index"):
        entries = coo_array(matrix)
        if entries.shape[0] != entries.shape[1]:
            raise MeshError(f"{location}: is not square, {entries.shape[0]} by {entries.shape[1]}")
        return Entries(entries.row, entries.col, entries.data.astype(float), entries.shape[0])

    # a DMIG is a table whose rows and columns are named by node and direction
    if matrix.columns.nlevels != 2:
        raise MeshError(
            f"{location}: is a rectangular DMIG of {matrix.shape[1]} columns, expected a square one"
        )
    ends = [np.array([*side.tolist()], dtype=np.int64) for side in (matrix.index, matrix.columns)]
    labels, number = np.unique(np.concatenate(ends), axis=0, return_inverse=True)
    row, column = np.split(number.ravel(), [len(ends[0])])
    entries = coo_array(matrix.to_numpy(dtype=float))
    labels[:, 1] = motion_of(labels[:, 1], location)
    return Entries(row[entries.row], column[entries.col], entries.data, labels=labels)


def read_external(path: Path, location: str) -> MatrixUnknowns:
    """Read the rows of an external superelement's matrices from EXTRN, and positions and axes from GRID.

    Raises
    ------
    MeshError
        without pyYeti, without EXTRN, and for coordinate systems that the file does not give.
    """
    pyyeti = _pyyeti(location)
    try:
        rows = np.asarray(pyyeti.bulk.rdextrn(str(path), expand=True), dtype=np.int64).reshape(-1, 2)
    except _DAMAGE as error:
        raise MeshError(f"{location}: has no EXTRN that can be read ({quote(str(error))})") from error
    try:
        number, points, frames = read_grid_points(path)
    except (ValueError, MeshError) as error:
        raise MeshError(f"{location}: its GRID cannot be read ({quote(str(error))})") from None
    motion, position = motion_of(rows[:, 1], location), np.full((len(rows), 3), np.nan)
    at = {tag: k for k, tag in enumerate(number.tolist())}
    for k in np.flatnonzero(motion != INTERNAL).tolist():
        if (grid := at.get(int(rows[k, 0]))) is not None:
            position[k] = points[grid]
    return with_frames(MatrixUnknowns(rows[:, 0], motion, position), frames, location)


def _pyyeti(location: str) -> Any:
    """The package of pyYeti that reads Nastran's files."""
    try:
        with np.printoptions():  # pyYeti sets numpy to print as version 1.13 did
            from pyyeti import nastran
    except ImportError:
        raise MeshError(
            f"{location}: needs pyYeti for Nastran's files; pip install 'romdam[nastran]'"
        ) from None
    return nastran
