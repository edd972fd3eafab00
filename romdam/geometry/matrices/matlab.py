"""Matrices of MATLAB: files of `save`, up to version 7 and as HDF5 (`-v7.3`)."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.sparse import coo_array, csc_array

from romdam.core.arrays import Floats
from romdam.core.errors import MeshError, quote
from romdam.core.sealed import reading_foreign
from romdam.geometry.matrices.data import Entries, meant

_DAMAGE = (
    ValueError, KeyError, IndexError, TypeError, AttributeError, NotImplementedError, EOFError, OSError,
    OverflowError, MemoryError, struct.error, zlib.error,
)  # fmt: skip
_HDF5 = b"\x89HDF"  # behind a head of 512 bytes that MATLAB writes


def read_matlab(path: Path, key: str, location: str) -> Entries:
    """Read a matrix by its name, or that of a key: the only one in the file, or only one K..., M... or B...

    Raises
    ------
    MeshError, ResultError
        where the file is damaged, which matrix is meant cannot be told, or it is not square.
    """
    matrices = _matrices(path, location)
    matrix = coo_array(matrices[meant(matrices, key, location)])
    if matrix.shape[0] != matrix.shape[1]:
        raise MeshError(f"{location}: {key} is not square, {matrix.shape[0]} by {matrix.shape[1]}")
    return Entries(matrix.row, matrix.col, matrix.data.astype(float), matrix.shape[0])


def read_matlab_columns(path: Path, key: str, location: str) -> Floats:
    """Read columns of numbers (n, k)."""
    matrices = _matrices(path, location)
    columns = matrices[meant(matrices, key, location)]
    return np.asarray(coo_array(columns).toarray(), dtype=float)


def _matrices(path: Path, location: str) -> dict[str, Any]:
    """Every matrix of a file, sparse or dense, by name."""
    with path.open("rb") as file:
        head = file.read(520)
    if _HDF5 in (head[:4], head[512:516]):
        with reading_foreign(path) as file:
            values = {name: _of_hdf5(item) for name, item in file.items() if not name.startswith("#")}
    else:
        from scipy.io import loadmat
        from scipy.io.matlab import MatReadError

        try:
            values = {n: v for n, v in loadmat(str(path)).items() if not n.startswith("__")}
        except (MatReadError, *_DAMAGE) as error:
            raise MeshError(f"{location}: cannot be read ({quote(str(error))}); write it anew") from error
    return {name: value for name, value in values.items() if _is_matrix(value)}


def _is_matrix(value: Any) -> bool:
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    return kind in "fiu" and getattr(value, "ndim", 0) == 2


def _of_hdf5(item: h5py.Group | h5py.Dataset) -> Any:
    """A variable of version 7.3: dense ones transposed, sparse ones by columns; None for others."""
    if isinstance(item, h5py.Dataset):
        return np.asarray(item[()]).T
    if "MATLAB_sparse" not in item.attrs:
        return None
    rows, starts = int(item.attrs["MATLAB_sparse"]), np.asarray(item["jc"][()], dtype=np.int64)
    if "ir" not in item:  # without entries
        return csc_array((rows, len(starts) - 1))
    indices = np.asarray(item["ir"][()], dtype=np.int64)
    matrix = csc_array((np.asarray(item["data"][()]), indices, starts), shape=(rows, len(starts) - 1))
    matrix.check_format()
    return matrix
