"""Matrices and their unknowns as they stand in files, checked one by one."""

from __future__ import annotations

import logging
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_matrix, diags_array

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import MeshError, listed, quote

log = logging.getLogger(__name__)

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz", "internal")
INTERNAL = 6
_SYMMETRY = 1e-6  # of entries across the diagonal, relative to the largest: text of 8 digits has 1e-8


@dataclass(frozen=True)
class Entries:
    """Entries of a square matrix.

    Attributes
    ----------
    row, column : (k,) numbers; from 0 where `size` or `labels` are there, else from 0 or 1
    value : (k,)
    size : number of rows, where the file states it
    labels : (m, 2) node and motion of every row, where the file names them
    """

    row: Ints
    column: Ints
    value: Floats
    size: int | None = None
    labels: Ints | None = None


@dataclass(frozen=True)
class MatrixUnknowns:
    """Unknowns of the rows of the matrices.

    Attributes
    ----------
    node : (n,) number
    motion : (n,) 0, 1, 2 displacement along x, y, z; 3, 4, 5 rotation about them; 6 anything else
    position : (n, 3) of the node [m]; NaN where the file has none
    axes : (n, 3) unit vectors that motions are along, or about, in x, y, z, where `motion` counts axes of the
        node's own; None where all are x, y, z
    """

    node: Ints
    motion: Ints
    position: Floats
    axes: Floats | None = None

    def __len__(self) -> int:
        return len(self.node)

    @property
    def labels(self) -> Ints:
        """(n, 2) node and motion."""
        return np.stack([self.node, self.motion], axis=1)

    def name(self, k: int) -> str:
        """An unknown, for messages."""
        return f"node {self.node[k]}, {DIRECTIONS[self.motion[k]]}"


_LETTER = {"stiffness": "K", "mass": "M", "damping": "B"}  # that a matrix's name begins with


def meant(names: Collection[str], key: str, location: str) -> str:
    """The name in a file that a key means: its own, or the only one, or the only K..., M... or B...

    Parameters
    ----------
    key : `stiffness`, `mass`, `damping`, or a name in the file, small or capital letters alike

    Raises
    ------
    MeshError
        where none or several can be meant.
    """
    letter = _LETTER.get(key, "")
    fitting = [
        name
        for name in names
        if name.upper() == key.upper() or (letter and (len(names) == 1 or name.upper().startswith(letter)))
    ]
    if len(fitting) != 1:
        what = f"begin with {letter}" if letter else f"are {quote(key)}"
        raise MeshError(
            f"{location}: has the matrices {listed(names)}, of which {len(fitting)} {what}, expected one; "
            "give `names`, such as {stiffness: KXX}"
        )
    return fitting[0]


def motion_of(number: Ints, location: str) -> Ints:
    """Motions of directions as finite-element programs number them: 1 to 6, and 0 for a scalar unknown.

    Raises
    ------
    MeshError
        for others, such as pressures and temperatures.
    """
    wrong = np.flatnonzero((number < 0) | (number > 6))
    if len(wrong):
        raise MeshError(
            f"{location}: direction {number[wrong[0]]} of {len(wrong)} unknowns, expected 1 to 6 "
            "(displacements and rotations) or 0 (others); leave pressures and temperatures out of the "
            "matrices"
        )
    return np.where(number == 0, INTERNAL, number - 1)


def from_labels(labels: Ints) -> MatrixUnknowns:
    """The unknowns that a matrix names itself."""
    return MatrixUnknowns(labels[:, 0], labels[:, 1], np.full((len(labels), 3), np.nan))


def sparse(entries: Entries, unknowns: MatrixUnknowns, first: int, location: str) -> csr_matrix:
    """The symmetric matrix of some entries over the unknowns.

    Parameters
    ----------
    first : number of the first row, where entries have neither size nor labels

    Raises
    ------
    MeshError
        for another size, entries that are no numbers or occur twice, and where it is not symmetric.
    """
    row, column = _over(entries, unknowns, first, location)
    n = len(unknowns)
    bad = np.count_nonzero(~np.isfinite(entries.value))
    if bad:
        raise MeshError(
            f"{location}: {bad} of {len(entries.value)} entries are no finite numbers; write it anew"
        )
    matrix = csr_matrix(coo_array((entries.value, (row, column)), shape=(n, n)))
    twice = len(row) - matrix.nnz
    if twice:
        raise MeshError(f"{location}: {twice} of {len(row)} entries are given twice, limit 0; add them first")
    above, below = (int(np.count_nonzero(side)) for side in (row < column, row > column))
    if bool(above) != bool(below):
        log.info("%s: only one triangle is stored, %d entries; the other is the same", location, matrix.nnz)
        matrix = csr_matrix(matrix + matrix.T - diags_array(matrix.diagonal()))
    largest = abs(matrix).max() if matrix.nnz else 0.0
    if largest == 0.0:
        raise MeshError(
            f"{location}: all of its {matrix.nnz} entries are zero; give the matrix of this block"
        )
    off = float(abs(matrix - matrix.T).max() / largest)
    if off > _SYMMETRY:
        raise MeshError(
            f"{location}: is not symmetric, entries across the diagonal differ by {off:.3g} of the largest, "
            f"limit {_SYMMETRY:g}; matrices of friction, flow or follower loads cannot be used"
        )
    return csr_matrix(0.5 * (matrix + matrix.T))


def _over(entries: Entries, unknowns: MatrixUnknowns, first: int, location: str) -> tuple[Ints, Ints]:
    """Rows and columns as numbers of the unknowns."""
    if entries.labels is not None:
        number = {tuple(label): k for k, label in enumerate(unknowns.labels.tolist())}
        index = np.array([number.get(tuple(label), -1) for label in entries.labels.tolist()], dtype=np.int64)
        lost = np.flatnonzero(index < 0)
        if len(lost):
            node, motion = entries.labels[lost[0]]
            raise MeshError(
                f"{location}: {len(lost)} of its {len(index)} rows are none of the unknowns, the first is "
                f"node {node}, {DIRECTIONS[motion]}; give matrices and unknowns of the same model"
            )
        return index[entries.row], index[entries.column]
    n, low, high = len(unknowns), 0 if entries.size is not None else first, entries.size
    both = np.concatenate([entries.row, entries.column])
    if high is None:
        high = int(both.max(initial=low - 1)) + 1 - low
        fits = high <= n
    else:
        fits = high == n
    if len(both) and (not fits or both.min() < low or both.max() >= low + high):
        raise MeshError(
            f"{location}: its rows are {both.min()} to {both.max()} of {high}, and there are {n} unknowns, "
            f"numbered from {low}; the file of unknowns must be that of this matrix"
        )
    return entries.row - low, entries.column - low
