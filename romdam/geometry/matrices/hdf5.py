"""Matrices, vectors and unknowns in HDF5: the layout that `romdam export --to matrices` writes.

A matrix is a group with `data`, `indices` and `indptr` (rows compressed, as SciPy has them), or a dense
dataset. `unknowns` is a group with `node`, `direction` (x, y, z, rx, ry, rz, internal) and `position`.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from scipy.sparse import coo_array, csr_array, csr_matrix

from romdam.core.arrays import Floats
from romdam.core.errors import MeshError
from romdam.core.sealed import reading
from romdam.geometry.matrices.data import DIRECTIONS, Entries, MatrixUnknowns


def read_hdf5(path: Path, key: str, location: str) -> Entries:
    """Read the matrix of a key.

    Raises
    ------
    MeshError, ResultError
        where the file has none of that name, it is not square, or the file is damaged.
    """
    with reading(path) as file:
        item = _item(file, key, location)
        if isinstance(item, h5py.Dataset):
            matrix = coo_array(np.atleast_2d(np.asarray(item[()], dtype=float)))
        else:
            data, indices, indptr = (np.asarray(item[name][()]) for name in ("data", "indices", "indptr"))
            size = len(indptr) - 1
            symmetric = csr_array((data.astype(float), indices, indptr), shape=(size, size))
            symmetric.check_format()
            matrix = coo_array(symmetric)
    if matrix.shape[0] != matrix.shape[1]:
        raise MeshError(f"{location}: {key} is not square, {matrix.shape[0]} by {matrix.shape[1]}")
    return Entries(matrix.row, matrix.col, matrix.data, matrix.shape[0])


def read_columns(path: Path, key: str, location: str) -> Floats:
    """Read columns of numbers (n, k)."""
    with reading(path) as file:
        values = np.asarray(_item(file, key, location)[()], dtype=float)
    return values.reshape(len(values), -1)


def read_unknowns(path: Path, location: str) -> MatrixUnknowns:
    """Read the unknowns."""
    with reading(path) as file:
        item = _item(file, "unknowns", location)
        node = np.asarray(item["node"][()], dtype=np.int64)
        words = [str(word) for word in item["direction"].asstr()[()]]
        position = np.asarray(item["position"][()], dtype=float)
    wrong = [word for word in words if word not in DIRECTIONS]
    if wrong or not len(node) == len(words) == len(position) or position.shape[1:] != (3,):
        raise MeshError(
            f"{location}: unknowns has {len(node)} nodes, {len(words)} directions ({len(wrong)} of them none "
            f"of {', '.join(DIRECTIONS)}) and positions {position.shape}; they must be as many, three "
            "numbers each"
        )
    return MatrixUnknowns(
        node, np.array([DIRECTIONS.index(word) for word in words], dtype=np.int64), position
    )


def _item(file: h5py.File, key: str, location: str) -> h5py.Group | h5py.Dataset:
    if key not in file:
        raise MeshError(f"{location}: has no {key!r}; it has {', '.join(sorted(file)) or 'nothing'}")
    return file[key]


def write_matrix(file: h5py.File, key: str, matrix: csr_matrix) -> None:
    """Write a matrix, rows compressed."""
    group = file.create_group(key)
    for name in ("data", "indices", "indptr"):
        group[name] = getattr(matrix, name)
    group.attrs["shape"] = matrix.shape


def write_unknowns(file: h5py.File, unknowns: MatrixUnknowns) -> None:
    """Write the unknowns."""
    group = file.create_group("unknowns")
    group["node"], group["position"] = unknowns.node, unknowns.position
    group["direction"] = [DIRECTIONS[k] for k in unknowns.motion]
