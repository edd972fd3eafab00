"""Lowest eigenpairs of K x = omega^2 M x from the inverse of K - s M, several right-hand sides at a time.

Block Lanczos on D M with D = (K - s M)^-1 on the unknowns that have mass: an unknown without any follows from
the others, and on a dam on light rock those with mass are few. Every vector is kept M-orthogonal to all that
were before it, so that no mode comes twice.

Of a large part sixteen at once read the factors once for all of them, and a last solution takes the modes to
all unknowns and rids them of their error. Of some thousand unknowns a space that grows by four takes the
least time, and does not miss one of two modes of the same frequency, as a block of square plan has them. One
vector at a time, which is ARPACK's way, sees the second by its round-off alone, or not at all.

References
----------
Grimes, Lewis, Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228 (shifted block Lanczos).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, spmatrix

from romdam.core.arrays import Floats
from romdam.core.errors import ReductionError
from romdam.linalg.conjugate import WIDTH
from romdam.linalg.dense import orthonormalising
from romdam.linalg.modes.flexibility import Flexibility
from romdam.linalg.modes.lobpcg import Wanted

RESIDUAL = 1e-7  # of a mode found: |D M x - mu x| relative to mu, in the norm of M
_NEAR = 1e-2  # the same of the modes next to them
_NEIGHBOURS = 2  # so many of those
_BELOW = 1e-6  # relative, by which the omega^2 of a mode that was missed lies below the highest
_FIRST_LOOK = 3  # vectors for each mode, in which modes are looked for at first
_GROWTH = 1.125  # of the space between two looks at its content, at most
_DEPENDENT = 1e-12  # eigenvalue of a new block's Gram matrix, relative, below which a direction is dropped
_NARROW, _NARROW_RESIDUAL = 4, 1e-10  # vectors at a time of a space whose Ritz vectors are taken as they are
_SMALLER = 0.5  # of a vector's squared length: less of it is left after too much has been taken away
_PIECE = 2**19  # numbers in one array of vectors, 4 MB
_NONE = (
    1e-12  # length of a new direction, relative to T's largest diagonal entry, below which it is round-off
)
_ROWS = 65_536  # of a product at a time
_PROBE, _PROBE_WIDTH = 5, 8  # steps and random vectors that look for a missed mode
_WIDEST = 64  # most columns to start with


class _Space:
    """M-orthonormal vectors side by side, in pieces of many columns where the vectors are short."""

    def __init__(self, rows: int, width: int) -> None:
        self._width, self._free = max(width, _PIECE // max(rows, 1)), 0
        self._pieces: list[Floats] = []

    @property
    def pieces(self) -> list[Floats]:
        """All vectors."""
        return [*self._pieces[:-1], *(last[:, : self._width - self._free] for last in self._pieces[-1:])]

    def append(self, V: Floats) -> None:
        """Add vectors, no more at a time than the space is wide."""
        if V.shape[1] > self._free:
            self._pieces = [*self.pieces, np.empty((len(V), self._width), order="F")]
            self._free = self._width
        first = self._width - self._free
        self._pieces[-1][:, first : first + V.shape[1]] = V
        self._free -= V.shape[1]

    def combined(self, C: Floats) -> Floats:
        """The vectors times C."""
        ends = np.cumsum([piece.shape[1] for piece in self.pieces])
        return np.asarray(sum(p @ c for p, c in zip(self.pieces, np.split(C, ends[:-1]), strict=True)))


@dataclass(frozen=True)
class _Ritz:
    """Content of a Krylov space: values of 1 / (omega^2 - s) descending, vectors, their errors."""

    mu: Floats
    vectors: Floats
    error: Floats
    space: _Space

    def first(self, count: int) -> Floats:
        """The first vectors, over the unknowns with mass."""
        return self.space.combined(self.vectors[:, :count])


def krylov_modes(
    D: Flexibility, wanted: Wanted, beyond: float = 1.0, further: int = 0
) -> tuple[tuple[int, int], Callable[[int, int], Floats]]:
    """Lowest modes, and a second space of random vectors beside them that looks for one that was missed.

    Parameters
    ----------
    D : of n unknowns
    beyond : what the Krylov space holds of further modes comes too, up to so many times the highest frequency
    further : and at least so many of them, as far as the space goes

    Returns
    -------
    counts : how many modes, and how many vectors with those beyond, which are modes nearly or not at all
    make : make(first, last) gives that many vectors over all unknowns, (n, last - first), a solution for
        each. The modes are their Ritz vectors (see `ritz_vectors`), nearly themselves

    Raises
    ------
    ReductionError
        where modes are still missed from the widest start.
    """
    rigid = D.rigid.shape[1]
    elastic = wanted if wanted.count is None else Wanted(max(wanted.count - rigid, 0))
    if D.size == rigid or elastic.count == 0:
        few = rigid if wanted.count is None else min(wanted.count, rigid)
        if D.size == rigid or not further:
            return (few, few), lambda first, last: D.rigid[:, first:last]
        (_, every), make = krylov_modes(D, Wanted(rigid + further))
        return (few, min(few + further, every)), make
    width, limit = WIDTH, 1.0 / (wanted.limit - D.shift)
    while width <= _WIDEST:
        count, ritz = _searched(D, elastic, limit, width, RESIDUAL)
        highest = limit if wanted.count is None else float(ritz.mu[count - 1])
        more = max(int((ritz.mu >= highest / beyond**2).sum()), min(count + further, len(ritz.mu)))
        X, mu = ritz.first(more), ritz.mu[:more]
        lowest = limit if wanted.count is None else highest * (1.0 + _BELOW)
        if not _missed(D, X[:, :count], lowest):
            break
        width *= 2
    else:
        raise ReductionError(
            f"Lanczos on {D.M.shape[0]} unknowns misses modes from {_WIDEST} random vectors; use another "
            "`model.solver`, or fewer modes"
        )
    forces = (D.mass @ X) / mu

    def vectors(first: int, last: int) -> Floats:
        """Some of the rigid motions and, after them, of the answers to forces."""
        strained = slice(max(first - rigid, 0), max(last - rigid, 0))
        return np.hstack([D.rigid[:, first:last], D.displacement(forces[:, strained])])

    return (rigid + count, rigid + more), vectors


def narrow_modes(D: Flexibility, count: int) -> tuple[Floats, Floats]:
    """Lowest modes of some thousand unknowns: the Ritz vectors of a space that grows by four, to round-off.

    Parameters
    ----------
    count : of modes, no more than unknowns with mass

    Returns
    -------
    omega2 : (count,) ascending [1/s2]
    modes : (n, count), M-orthonormal
    """
    rigid = D.rigid[:, :count]
    elastic = count - rigid.shape[1]
    if not elastic:
        return np.zeros(count), rigid
    _, ritz = _searched(D, Wanted(elastic), 0.0, _NARROW, _NARROW_RESIDUAL)
    mu, X = ritz.mu[:elastic], ritz.first(elastic)
    X = X if D.every else D.displacement((D.mass @ X) / mu)
    return np.append(np.zeros(count - elastic), 1.0 / mu + D.shift), np.hstack([rigid, X])


def _searched(D: Flexibility, wanted: Wanted, limit: float, width: int, residual: float) -> tuple[int, _Ritz]:
    """The space in which the modes that are wanted were found, and their number.

    Between two looks at its content the space grows as the modes' errors fall, by an eighth at most.

    Parameters
    ----------
    limit : least 1 / (omega^2 - shift), where their number is not given
    width : so many vectors at a time
    residual : largest relative residual of a mode
    """
    krylov, size, error = _Krylov(D, D.start(width, width)), 0, 0.0
    due = float(_FIRST_LOOK * (wanted.count or 0))
    while True:
        krylov.grow(due)
        ritz = krylov.content()
        count = int((ritz.mu >= limit).sum()) if wanted.count is None else min(wanted.count, len(ritz.mu))
        # the first are modes, and the next ones so near that none can join them
        near = ritz.error[count : count + _NEIGHBOURS]
        settled = len(near) == _NEIGHBOURS and (near <= _NEAR).all()
        if krylov.ended or (settled and (ritz.error[:count] <= residual).all()):
            return count, ritz
        before, size = (size, error), len(ritz.mu)
        error = float(np.log(max(ritz.error[: count + 1].max(), residual)))
        fall, left = (before[1] - error) / (size - before[0]), error - np.log(residual)
        most = (_GROWTH - 1.0) * size
        due = size + (left / fall if left < fall * most else most)


class _Krylov:
    """The Krylov space of D M, grown block by block; M-orthogonal to rigid motions and to `against`.

    A new block has parts in the two before it, by the symmetry of D; those are taken out first, then what
    round-off has left of any.

    Attributes
    ----------
    ended : whether the space is all there is
    """

    def __init__(self, D: Flexibility, start: Floats, against: Floats | None = None) -> None:
        self.ended, self._D, self._space = False, D, _Space(*start.shape)
        self._fixed = [*D.apart, *([] if against is None else [against])]
        self._edges, self._size, self._largest = list[Floats](), 0, 0.0
        self._most = D.size - sum(vectors.shape[1] for vectors in self._fixed)
        self._blocks, self._images = list[Floats](), list[Floats]()
        self._next = _apart(D.mass, self._fixed, start)

    def grow(self, size: float) -> None:
        """Grow by a block, and on until there are so many vectors, or all."""
        self._step()
        while self._size < size and not self.ended:
            self._step()

    def content(self) -> _Ritz:
        """The Ritz values and vectors; a dense eigenproblem, which costs as much as some blocks."""
        # V^T M D M V is block tridiagonal; each block has brought its last columns
        T, last_row = np.zeros((self._size, self._size)), 0
        for edge in self._edges:
            last_row += edge.shape[1]
            rows, columns = slice(last_row - len(edge), last_row), slice(last_row - edge.shape[1], last_row)
            T[rows, columns] = edge
            T[columns, rows] = edge.T
        mu, S = eigh(0.5 * (T + T.T), driver="evd")
        gram = self._next[1]
        last = S[-len(gram) :]
        error = np.sqrt(np.maximum((last * (gram @ last)).sum(axis=0), 0.0)) / np.abs(mu)
        return _Ritz(mu[::-1], S[:, ::-1], error[::-1], self._space)

    def _step(self) -> None:
        M = self._D.mass
        W, gram = self._next
        V = W @ orthonormalising(gram, _DEPENDENT)
        image = np.asarray(M @ V)
        mix = orthonormalising(V.T @ image, _DEPENDENT)  # once more for what round-off has left
        V, image = V @ mix, image @ mix
        self._space.append(V)
        self._blocks, self._images = [*self._blocks[-1:], V], [*self._images[-1:], image]
        W = self._D @ image
        parts = [each.T @ W for each in self._images]  # W has round-off alone of the blocks before those
        for block, share in zip(self._blocks, parts, strict=True):
            W -= block @ share
        self._edges.append(np.vstack(parts))
        self._size += V.shape[1]
        W, gram = self._next = _apart(M, [*self._fixed, *self._space.pieces], W)
        self._largest = max(self._largest, parts[-1].diagonal().max())
        self.ended = self._size >= self._most or bool(gram.diagonal().max() <= (_NONE * self._largest) ** 2)


def _apart(M: csr_matrix, pieces: list[Floats], W: Floats) -> tuple[Floats, Floats]:
    """W less its part in M-orthonormal vectors, in place, and W^T M W of what is left.

    Where that is the smaller part it has few digits, and is taken apart once more: twice is enough.
    """
    for _ in range(2):
        MW = M @ W
        gram = W.T @ MW
        before = gram.diagonal().copy()
        for piece in pieces:
            share = piece.T @ MW
            W -= piece @ share
            gram -= share.T @ share
        if (gram.diagonal() >= _SMALLER * before).all():
            return W, gram
    return W, W.T @ (M @ W)


def _missed(D: Flexibility, X: Floats, lowest: float) -> bool:
    """True where random vectors beside the modes X lead to one of them; Ritz values are never too large."""
    spare = len(X) - X.shape[1] - D.rigid.shape[1]
    if not spare or not X.shape[1]:
        return False
    krylov = _Krylov(D, D.start(min(_PROBE_WIDTH, spare), 1), X)
    for _ in range(_PROBE):
        krylov.grow(0)
        if krylov.content().mu[0] > lowest:
            return True
        if krylov.ended:
            break
    return False


def ritz_vectors(K: spmatrix, M: spmatrix, X: Floats) -> tuple[Floats, Floats]:
    """Values and M-orthonormal vectors of K x = omega^2 M x in the span of X, in X's place."""
    if not X.shape[1]:
        return np.zeros(0), X
    columns = [slice(k, k + WIDTH) for k in range(0, X.shape[1], WIDTH)]
    energy, mass = (np.hstack([X.T @ (A @ X[:, s]) for s in columns]) for A in (K, M))
    omega2, C = eigh(0.5 * (energy + energy.T), 0.5 * (mass + mass.T))
    for first in range(0, len(X), _ROWS):
        rows = slice(first, first + _ROWS)
        X[rows] = X[rows] @ C
    return omega2, X
