"""The vectors that a reduced block's displacement is a sum of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, Ints

Rows = slice | Ints


class Basis(Protocol):
    """Vectors (n, m) of which only what is asked for is read or made; see `romdam.reduction.basis`."""

    @property
    def shape(self) -> tuple[int, int]:
        """DOFs and vectors."""

    @property
    def nbytes(self) -> int:
        """Size in bytes if it stood in memory."""

    def rows(self, which: Rows = slice(None)) -> Floats:
        """Some rows (k, m)."""

    def apply(self, q: Floats) -> Floats:
        """Displacement (n,) or (n, k) of coordinates (m,) or (m, k)."""

    def project(self, force: Floats) -> Floats:
        """Force (m,) or (m, k) on the coordinates, of one on the DOFs (n,) or (n, k)."""

    def under(self, operator: csr_matrix) -> Floats:
        """An operator (k, n) on every vector, (k, m)."""


@dataclass(frozen=True)
class BlockBasis:
    """A reduced block; its displacement is u = vectors.apply(q[columns]).

    Attributes
    ----------
    vectors : (3 n, m) open-joint modes, of a modal mass of 1 kg, zero at supports
    columns : the block's slice of q
    omega2 : (m,) ascending [1/s2]
    participation : (m, 3) vectors^T M r for unit translations r along x, y, z [kg]
    report : numbers on the reduction, plain JSON values
    massless : how many of the last vectors have no mass, and answer by their stiffness at once
    """

    vectors: Basis
    columns: slice
    omega2: Floats
    participation: Floats
    report: dict[str, object]
    massless: int = 0
