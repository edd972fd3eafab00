"""The ways in which a basis exists: in memory, in a file, and as a product that is not formed.

A basis of a million unknowns is a file that is mapped. Turned into other coordinates it would have to stand
in memory, 8 bytes for every unknown and coordinate, so that only the rows in use are turned. Modes made of
Ritz vectors are kept as these and a mix, for to form them over all nodes costs more than the static answers
of a large interface. A finer basis that contains another is kept as what it has besides.
"""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, Ints
from romdam.core.basis import Basis, BlockBasis, Rows
from romdam.linalg.dense import product


@dataclass(frozen=True)
class Dense:
    """A basis in memory: array (n, m)."""

    array: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """DOFs and vectors."""
        n, m = self.array.shape
        return n, m

    @property
    def nbytes(self) -> int:
        """Size in bytes."""
        return self.array.nbytes

    def rows(self, which: Rows = slice(None)) -> Floats:
        """Some rows (k, m)."""
        return self.array[which]

    def apply(self, q: Floats) -> Floats:
        """Displacement of coordinates."""
        return np.asarray(self.array @ q)

    def project(self, force: Floats) -> Floats:
        """Force on the coordinates."""
        return np.asarray(self.array.T @ force)

    def under(self, operator: csr_matrix) -> Floats:
        """An operator on every vector."""
        return np.asarray(operator @ self.array)


class Mapped(Dense):
    """A basis in one piece of a file, of which only the rows in use are read, and stand in memory."""

    @classmethod
    def of(cls, path: str | Path, offset: int, shape: tuple[int, int]) -> Mapped:
        """The float64 numbers (n, m) that begin at a byte of a file."""
        return cls(np.memmap(path, dtype=np.float64, mode="r", offset=offset, shape=shape))

    def rows(self, which: Rows = slice(None)) -> Floats:
        """Some rows (k, m)."""
        self._let_go()
        return super().rows(which)

    def apply(self, q: Floats) -> Floats:
        """Displacement of coordinates."""
        return self._after(super().apply(q))

    def project(self, force: Floats) -> Floats:
        """Force on the coordinates."""
        return self._after(super().project(force))

    def under(self, operator: csr_matrix) -> Floats:
        """An operator on every vector."""
        return self._after(super().under(operator))

    def _after(self, result: Floats) -> Floats:
        self._let_go()
        return result

    def _let_go(self) -> None:
        """Give back the memory of what was read; whoever reads it again finds it in the file."""
        pages = self.array.base
        if isinstance(pages, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):  # not on Windows
            pages.madvise(mmap.MADV_DONTNEED)


@dataclass(frozen=True)
class Product:
    """Combinations of the vectors of another basis: left @ mix.

    Attributes
    ----------
    left : of k vectors
    mix : (k, m)
    """

    left: Basis
    mix: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """DOFs and vectors."""
        return self.left.shape[0], self.mix.shape[1]

    @property
    def nbytes(self) -> int:
        """Size in bytes if it were formed."""
        return 8 * self.shape[0] * self.shape[1]

    def rows(self, which: Rows = slice(None)) -> Floats:
        """Some rows (k, m)."""
        return product(self.left.rows(which), self.mix)

    def apply(self, q: Floats) -> Floats:
        """Displacement of coordinates."""
        return self.left.apply(self.mix @ q)

    def project(self, force: Floats) -> Floats:
        """Force on the coordinates."""
        return np.asarray(self.mix.T @ self.left.project(force))

    def under(self, operator: csr_matrix) -> Floats:
        """An operator on every vector."""
        return product(self.left.under(operator), self.mix)


@dataclass(frozen=True)
class Turn:
    """New coordinates in place of old ones: old[mixed] = mix @ new[:c], old[kept] = new[places].

    Attributes
    ----------
    mixed, mix : (w,) and (w, c)
    kept, places : (k,) each; old coordinates are mixed or kept
    size : number of new coordinates
    """

    mixed: Ints
    mix: Floats
    kept: Ints
    places: Ints
    size: int

    def rows(self, old: Floats) -> Floats:
        """An operator (r, w + k) on the old coordinates as one on the new ones, (r, size)."""
        new = np.zeros((len(old), self.size))
        new[:, : self.mix.shape[1]] = old[:, self.mixed] @ self.mix
        new[:, self.places] = old[:, self.kept]
        return new

    def new(self, old: Floats) -> Floats:
        """New coordinates (size, j) of old ones, where `mix` is square."""
        new = np.empty((self.size, *old.shape[1:]))
        new[: len(self.mix)] = np.linalg.solve(self.mix, old[self.mixed])
        new[self.places] = old[self.kept]
        return new

    def old(self, new: Floats) -> Floats:
        """Old coordinates of new ones, (size,) or (size, j)."""
        old = np.zeros((len(self.mixed) + len(self.kept), *new.shape[1:]))
        old[self.mixed] = self.mix @ new[: self.mix.shape[1]]
        old[self.kept] = new[self.places]
        return old


@dataclass(frozen=True)
class Lazy:
    """Another basis in new coordinates, its rows made as they are asked for."""

    left: Basis
    turn: Turn

    @property
    def shape(self) -> tuple[int, int]:
        """DOFs and vectors."""
        return self.left.shape[0], self.turn.size

    @property
    def nbytes(self) -> int:
        """Size in bytes if it were formed."""
        return 8 * self.shape[0] * self.shape[1]

    def rows(self, which: Rows = slice(None)) -> Floats:
        """Some rows (k, m)."""
        return self.turn.rows(self.left.rows(which))

    def apply(self, q: Floats) -> Floats:
        """Displacement of coordinates."""
        return self.left.apply(self.turn.old(q))

    def project(self, force: Floats) -> Floats:
        """Force on the coordinates."""
        old = self.left.project(force)
        new = self.turn.rows(old[None] if old.ndim == 1 else old.T)
        return np.asarray(new[0] if old.ndim == 1 else new.T)

    def under(self, operator: csr_matrix) -> Floats:
        """An operator on every vector, turned where it has fewer rows."""
        if operator.shape[0] > self.shape[0]:
            return np.asarray(operator @ self.rows())
        return self.turn.rows(self.left.under(operator))


@dataclass(frozen=True)
class Scaled:
    """Another basis, each of whose vectors has a factor.

    Attributes
    ----------
    left : the other
    factors : (m,)
    """

    left: Basis
    factors: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """DOFs and vectors."""
        return self.left.shape

    @property
    def nbytes(self) -> int:
        """Size in bytes if it were formed."""
        return self.left.nbytes

    def rows(self, which: Rows = slice(None)) -> Floats:
        """Some rows (k, m)."""
        return self.left.rows(which) * self.factors

    def apply(self, q: Floats) -> Floats:
        """Displacement of coordinates."""
        return self.left.apply((self.factors * q.T).T)

    def project(self, force: Floats) -> Floats:
        """Force on the coordinates."""
        return np.asarray((self.factors * self.left.project(force).T).T)

    def under(self, operator: csr_matrix) -> Floats:
        """An operator on every vector."""
        return self.left.under(operator) * self.factors


@dataclass(frozen=True)
class Augmented:
    """[inner, more] mix: a finer basis that contains the one of a block.

    Attributes
    ----------
    inner : the block's basis of k modes
    more : (n, r) vectors beside them
    mix : (k + r, m) the modes in terms of both
    """

    inner: BlockBasis
    more: Floats
    mix: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """DOFs and vectors."""
        return len(self.more), self.mix.shape[1]

    @property
    def nbytes(self) -> int:
        """Size in bytes if it were formed."""
        return 8 * self.shape[0] * self.shape[1]

    @property
    def within(self) -> Floats:
        """(m, k) modes of the inner basis in terms of these.

        Vectors without mass are eliminated first, which leaves a problem of the size of the others.
        """
        k, modes, massive = len(self.inner.omega2), self._modes, self.mix.shape[1] - self.inner.massless
        others = np.r_[:modes, k : len(self.mix)]
        within, wanted = np.zeros((self.mix.shape[1], k)), np.zeros((len(others), k))
        wanted[:modes, :modes] = np.eye(modes)
        if self.inner.massless:
            Y, S = self._change
            back = np.linalg.inv(np.eye(len(S)) + S) - np.eye(len(S))
            of_others = self.mix[others, massive:]
            within[massive:, modes:] = np.eye(len(Y)) + (Y @ back) @ Y.T
            wanted[:, modes:] = -of_others - ((of_others @ Y) @ back) @ Y.T
        Q, R = np.linalg.qr(self.mix[others, :massive])
        within[:massive] = np.linalg.solve(R, Q.T @ wanted)
        return within

    @property
    def _modes(self) -> int:
        return len(self.inner.omega2) - self.inner.massless

    @cached_property
    def _change(self) -> tuple[Floats, Floats]:
        """Y (rest, p), of orthonormal columns, and S (p, p): vectors without mass among each other.

        In terms of those of the inner basis they are 1 + Y S Y^T, for they differ by what they have of the
        few other vectors (`methods.flexible_rest.with_more_without_mass`); no mode is made of them.
        """
        k, modes, massive = len(self.inner.omega2), self._modes, self.mix.shape[1] - self.inner.massless
        others = np.r_[:modes, k : len(self.mix)]
        Y, _ = np.linalg.qr(self.mix[others, massive:].T)
        return Y, Y.T @ (self.mix[modes:k, massive:] @ Y) - np.eye(Y.shape[1])

    def _from_inner(self, values: Floats) -> Floats:
        """Rows (r, k) on the inner basis's modes as rows (r, m) on these."""
        if not self.inner.massless:
            return np.asarray(values @ self._upper)
        modes, massive = self._modes, self.mix.shape[1] - self.inner.massless
        (Y, S), rest = self._change, values[:, modes:]
        rows = values[:, :modes] @ self.mix[:modes]
        rows[:, massive:] += rest
        rows[:, massive:] += ((rest @ Y) @ S) @ Y.T
        return np.asarray(rows)

    @property
    def _upper(self) -> Floats:
        return self.mix[: len(self.inner.omega2)]

    @property
    def _lower(self) -> Floats:
        return self.mix[len(self.inner.omega2) :]

    def rows(self, which: Rows = slice(None)) -> Floats:
        """Some rows (k, m)."""
        return self._from_inner(self.inner.vectors.rows(which)) + self.more[which] @ self._lower

    def apply(self, q: Floats) -> Floats:
        """Displacement of coordinates."""
        return np.asarray(self.inner.vectors.apply(self._upper @ q) + self.more @ (self._lower @ q))

    def project(self, force: Floats) -> Floats:
        """Force on the coordinates."""
        inner = self.inner.vectors.project(force)
        return np.asarray(self._upper.T @ inner + self._lower.T @ (self.more.T @ force))

    def under(self, operator: csr_matrix, of_inner: Floats | None = None) -> Floats:
        """An operator on every vector, made of that on the inner basis, if it is given."""
        if of_inner is None:
            of_inner = self.inner.vectors.under(operator)
        return self._from_inner(of_inner) + (operator @ self.more) @ self._lower


def factored(basis: Basis) -> tuple[Basis, Floats] | None:
    """Vectors and the mix that makes a basis of them, where it is kept so; None where it is not."""
    if isinstance(basis, Product):
        return basis.left, basis.mix
    if isinstance(basis, Lazy) and (inner := factored(basis.left)) is not None:
        return inner[0], basis.turn.rows(inner[1])
    if isinstance(basis, Scaled) and (inner := factored(basis.left)) is not None:
        return inner[0], inner[1] * basis.factors
    return None


def over_coordinates(
    operators: Mapping[str, csr_matrix],
    basis: Mapping[str, BlockBasis],
    size: int,
    on_bases: dict[str, tuple[Basis, Floats]] | None = None,
) -> Floats:
    """Operators (k, n) of blocks as one (k, size) over the coordinates; each is made where it has rows.

    Parameters
    ----------
    on_bases : block name -> a basis and the operator on it, of which that on a basis which contains it is
        made; gains those of these bases
    """
    total = np.zeros((next(iter(operators.values())).shape[0], size))
    for name, operator in operators.items():
        rows = np.flatnonzero(operator.getnnz(axis=1))
        vectors, known = basis[name].vectors, (on_bases or {}).get(name)
        if isinstance(vectors, Augmented) and known is not None and vectors.inner.vectors is known[0]:
            of_block = vectors.under(operator[rows], known[1])
        else:
            of_block = vectors.under(operator[rows])
        if on_bases is not None and not isinstance(vectors, Augmented):
            on_bases[name] = vectors, of_block
        total[rows, basis[name].columns] += of_block
    return total
