"""Nastran's matrices: OUTPUT4 (.op4), and DMIG in punch files (.pch), read by pyYeti.

Not by pyNastran 1.4, which needs numpy 1. pyYeti 1.4 holds a DMIG as a dense table.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array

from romdam.core.errors import MeshError, listed, quote
from romdam.geometry.matrices.data import Entries, motion_of

_LETTER = {"stiffness": "K", "mass": "M", "damping": "B"}
_DAMAGE = (  # that pyYeti raises of a file that is not what its ending says
    ValueError, KeyError, IndexError, TypeError, AttributeError, RuntimeError, EOFError, OSError,
    OverflowError, MemoryError, StopIteration, struct.error,
)  # fmt: skip


def read_nastran(path: Path, key: str, location: str) -> Entries:
    """Read the matrix of a key: the only one in the file, or the only one named K..., M... or B...

    Raises
    ------
    MeshError
        without pyYeti, where the file is damaged, or which matrix is meant cannot be told.
    """
    try:
        with np.printoptions():  # pyYeti sets numpy to print as version 1.13 did
            from pyyeti.nastran import bulk, op4
    except ImportError:
        raise MeshError(
            f"{location}: needs pyYeti for Nastran's files; pip install 'romdam[nastran]'"
        ) from None
    try:
        if path.suffix.lower() == ".op4":
            matrices: dict[str, Any] = op4.read(str(path), sparse=True)
        else:
            matrices = bulk.rddmig(str(path), square=True)
    except _DAMAGE as error:
        raise MeshError(f"{location}: cannot be read ({quote(str(error))}); write it anew") from error
    fitting = [name for name in matrices if len(matrices) == 1 or name.upper().startswith(_LETTER[key])]
    if len(fitting) != 1:
        raise MeshError(
            f"{location}: has the matrices {listed(matrices)}, of which {len(fitting)} begin with "
            f"{_LETTER[key]}, expected one; write one matrix into a file of its own"
        )
    matrix = matrices[fitting[0]]
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
