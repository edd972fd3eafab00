"""Lowest eigenpairs of K x = omega^2 M x from the inverse of K - s M, sixteen right-hand sides at a time.

Block Lanczos on D M with D = (K - s M)^-1 on the unknowns that have mass: an unknown without any follows from
the others, and on a dam on light rock those with mass are few. One vector at a time reads the factors for
every solution; sixteen at once read them once. Every vector is kept M-orthogonal to all before it, so that
no mode comes twice, and the last solution takes the modes to all unknowns.

References
----------
Grimes, Lewis, Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228 (shifted block Lanczos).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, spmatrix

from romdam.core.arrays import Floats
from romdam.core.errors import ReductionError
from romdam.linalg.conjugate import WIDTH
from romdam.linalg.lobpcg import Wanted, independent

Apply = Callable[[Floats], Floats]

RESIDUAL = 1e-7  # of a mode found: |D M x - mu x| relative to mu, in the norm of M
_NEAR = 1e-2  # the same of the modes next to them
_BESIDE = 2  # so many of those
_BELOW = 1e-6  # relative, by which the omega^2 of a mode that was missed lies below the highest
_GROWTH = 1.125  # of the space between two looks at its content
_NONE = (
    1e-12  # length of a new direction, relative to T's largest diagonal entry, below which it is round-off
)
_ROWS = 65_536
_PROBE, _PROBE_WIDTH = 5, 8  # steps and random vectors that look for a missed mode
_WIDEST = 64


@dataclass(frozen=True)
class _Ritz:
    """Content of a Krylov space: values of 1 / (omega^2 - s) descending, vectors, their errors."""

    mu: Floats
    vectors: Floats
    error: Floats
    blocks: list[Floats]

    def first(self, count: int) -> Floats:
        """The first vectors, over the unknowns with mass."""
        rows = np.cumsum([0, *(block.shape[1] for block in self.blocks)])
        return np.asarray(
            sum(b @ self.vectors[k : k + b.shape[1], :count] for b, k in zip(self.blocks, rows, strict=False))
        )


def krylov_modes(
    M: csr_matrix, wanted: Wanted, inverse: Apply, shift: float, beyond: float = 1.0
) -> tuple[tuple[int, int], Callable[[int, int], Floats]]:
    """Lowest modes, and a second space of random vectors beside them that looks for one that was missed.

    Parameters
    ----------
    M : (n, n) sparse, symmetric; a zero on the diagonal is an unknown without mass
    inverse : of K - shift M, for (n, k)
    shift : [1/s2], below the lowest omega^2
    beyond : what the Krylov space holds of further modes comes too, up to so many times the highest frequency

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
    moving = np.flatnonzero(M.diagonal() > 0.0)
    if not len(moving):
        return (0, 0), lambda first, last: np.zeros((M.shape[0], last - first))
    own = csr_matrix(M[moving][:, moving]) if len(moving) < M.shape[0] else M

    def lifted(forces: Floats) -> Floats:
        right = np.zeros((M.shape[0], forces.shape[1]))
        right[moving] = forces
        return inverse(right)

    def on_moving(forces: Floats) -> Floats:
        return np.asarray(np.take(lifted(forces), moving, axis=0))

    width, limit = WIDTH, 1.0 / (wanted.limit - shift)
    while width <= _WIDEST:
        start = np.random.default_rng(width).standard_normal((len(moving), min(width, len(moving))))
        for ritz in _grown(own, on_moving, start):
            count = _among(ritz.mu, wanted, limit)
            if _converged(ritz, count, len(moving)):
                break
        highest = limit if wanted.count is None else float(ritz.mu[count - 1])
        more = max(count, int((ritz.mu >= highest / beyond**2).sum()))
        X, mu = ritz.first(more), ritz.mu[:more]
        lowest = limit if wanted.count is None else highest * (1.0 + _BELOW)
        if not _missed(own, on_moving, X[:, :count], lowest):
            return (count, more), partial(_columns, lifted, (own @ X) / mu)
        width *= 2
    raise ReductionError(
        f"Lanczos on {M.shape[0]} unknowns misses modes from {_WIDEST} random vectors; use another "
        "`model.solver`, or fewer modes"
    )


def _columns(lifted: Apply, forces: Floats, first: int, last: int) -> Floats:
    return lifted(forces[:, first:last])


def _among(mu: Floats, wanted: Wanted, limit: float) -> int:
    return min(wanted.count, len(mu)) if wanted.count is not None else int((mu >= limit).sum())


def _converged(ritz: _Ritz, count: int, size: int) -> bool:
    """True where the first `count` are modes, and the next ones so near that none can join them."""
    if len(ritz.mu) == size:
        return True
    near = ritz.error[count : count + _BESIDE]
    return len(near) == _BESIDE and bool((ritz.error[:count] <= RESIDUAL).all() and (near <= _NEAR).all())


def _grown(
    own: csr_matrix, flexibility: Apply, start: Floats, against: Floats | None = None
) -> Iterator[_Ritz]:
    """The Krylov space of D M, grown block by block; within what is M-orthogonal to `against`.

    A new block has parts in the two before it, by the symmetry of D; those are taken out first, then what
    round-off has left of any. The dense eigenproblem is solved each time the space has grown by an eighth: at
    every block it would cost more than the solutions.
    """
    blocks = [] if against is None else [against]
    fixed, T, due, images = len(blocks), np.zeros((0, 0)), 0.0, list[Floats]()
    V = _independent(own, _apart(own, blocks, _apart(own, blocks, start)))
    while V.shape[1]:
        blocks.append(V)
        images = [*images[-1:], own @ V]
        W = flexibility(images[-1])
        parts = [image.T @ W for image in images]  # W has round-off alone of the blocks before those
        for block, part in zip(blocks[-len(images) :], parts, strict=True):
            W -= block @ part
        T = np.pad(T, ((0, V.shape[1]),) * 2)
        edge = np.vstack(parts)
        T[-len(edge) :, -V.shape[1] :] = edge
        T[-V.shape[1] :, -len(edge) :] = edge.T
        W = _apart(own, blocks, W)
        gram = W.T @ (own @ W)
        ended = np.sqrt(gram.diagonal().max()) <= _NONE * T.diagonal().max()
        if ended or len(T) >= due:
            mu, S = eigh(0.5 * (T + T.T))
            last, due = S[-V.shape[1] :], _GROWTH * len(T)
            error = np.sqrt(np.maximum((last * (gram @ last)).sum(axis=0), 0.0)) / np.abs(mu)
            yield _Ritz(mu[::-1], S[:, ::-1], error[::-1], blocks[fixed:])
        if ended:
            return
        V = _independent(own, W)


def _apart(own: csr_matrix, blocks: list[Floats], W: Floats) -> Floats:
    """W less its part in the blocks, in place."""
    MW = own @ W
    for block in blocks:
        W -= block @ (block.T @ MW)
    return W


def _independent(own: csr_matrix, W: Floats) -> Floats:
    """M-orthonormal vectors that span W's."""
    return independent(own, independent(own, W))


def _missed(own: csr_matrix, flexibility: Apply, X: Floats, lowest: float) -> bool:
    """True where random vectors beside the modes X lead to one of them; Ritz values are never too large."""
    spare = len(X) - X.shape[1]
    if not spare or not X.shape[1]:
        return False
    start = np.random.default_rng(1).standard_normal((len(X), min(_PROBE_WIDTH, spare)))
    return any(ritz.mu[0] > lowest for ritz in islice(_grown(own, flexibility, start, X), _PROBE))


def ritz_vectors(K: spmatrix, M: spmatrix, X: Floats) -> tuple[Floats, Floats]:
    """Values and M-orthonormal vectors of K x = omega^2 M x in the span of X, in X's place."""
    energy, mass = (np.hstack([X.T @ (A @ X[:, s]) for s in _slices(X.shape[1], WIDTH)]) for A in (K, M))
    omega2, C = eigh(0.5 * (energy + energy.T), 0.5 * (mass + mass.T))
    for rows in _slices(len(X), _ROWS):
        X[rows] = X[rows] @ C
    return omega2, X


def _slices(count: int, size: int) -> list[slice]:
    return [slice(k, min(k + size, count)) for k in range(0, count, size)]
