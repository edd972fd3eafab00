"""Lowest eigenpairs by locally optimal block preconditioned conjugate gradients, to a relative residual.

A mode counts as found when |K x - omega^2 M x| is at most 1e-7 of omega^2 |M x|, the forces of its own
inertia, which for M-orthonormal modes of one block run from 1e4 (1.7 Hz) to 1e7 (60 Hz). SciPy's `lobpcg`
compares the bare residual with one number for all modes, has to be told how many there are, and holds twice
the memory, which is what multigrid is taken to save. Given the same guards (vectors beside those wanted,
without which the last modes creep), preconditioner, check of residuals and probe, and started again every 10
iterations, it takes 0.8 to 1.2 times our CPU time; started again every 20, four times as much on one mesh of
two (`tests/benchmarks/bench_lobpcg.py`).

References
----------
Knyazev, SIAM J. Sci. Comput. 23 (2001) 517; Stathopoulos, Wu, SIAM J. Sci. Comput. 23 (2002) 2165 (SVQB).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import spmatrix

from romdam.core.arrays import Floats
from romdam.core.errors import ReductionError
from romdam.linalg.dense import orthonormalising

Apply = Callable[[Floats], Floats]

RESIDUAL = 1e-7  # of a mode found, relative to its inertia forces
_FIRST = 16  # modes looked for at first below a frequency
_GUARDS = 8  # beside them; they join when fewer than half are left
_MOST = 200  # iterations; 15 to 40 are usual
_DEPENDENT = 1e-12  # Gram eigenvalue of a dependent direction of the search space
_LEAST = 1e-6  # of the largest omega^2: residuals of slower modes are relative to that
_NEAR = 1e-2  # residual of the modes next to those below a limit
_BELOW = 1e-6  # relative, by which a mode that was missed lies below the highest
_WIDTH = 16  # columns of a product at a time
_ROWS = 65_536  # of a product at a time


@dataclass(frozen=True)
class Pencil:
    """K x = omega^2 M x and an approximate inverse of K (or of K less a shift times M).

    `probe` iterations of random vectors look for a mode that was missed: 10 for one cycle of multigrid, where
    4 find every one with an exact inverse.
    """

    K: spmatrix
    M: spmatrix
    inverse: Apply
    probe: int = 10


@dataclass(frozen=True)
class Wanted:
    """So many modes, or all up to a limit [1/s2]."""

    count: int | None
    limit: float = np.inf

    def among(self, omega2: Floats) -> int:
        """Number of the ascending values that are wanted."""
        if self.count is not None:
            return min(self.count, len(omega2))
        return int(np.searchsorted(omega2, self.limit, side="right"))


def block_modes(pencil: Pencil, wanted: Wanted) -> tuple[Floats, Floats]:
    """Lowest modes, and a probe for one that was missed.

    Returns
    -------
    omega2 : (k,) ascending [1/s2]
    modes : (n, k), M-orthonormal

    Raises
    ------
    ReductionError
        where the residuals do not fall to the tolerance.
    """
    size = pencil.K.shape[0]
    random = np.random.default_rng(0)
    width = (_FIRST if wanted.count is None else wanted.count) + _GUARDS
    omega2, X = _ritz(pencil, independent(pencil.M, random.standard_normal((size, min(width, size)))))
    while True:
        omega2, X = _iterate(pencil, (omega2, X), wanted, random)
        count = wanted.among(omega2)
        if missed(pencil, (omega2[:count], X[:, :count]), wanted, random) is None:
            return omega2[:count], X[:, :count]
        X = np.hstack([X, random.standard_normal((size, _GUARDS))])
        omega2, X = _ritz(pencil, independent(pencil.M, X))


def missed(
    pencil: Pencil, modes: tuple[Floats, Floats], wanted: Wanted, random: np.random.Generator | None = None
) -> float | None:
    """Look for a mode that was missed among the lowest: its omega^2, or None.

    Random vectors, kept orthogonal to the modes found, are driven to their lowest Ritz values. Those lie
    above the true ones, so that a value among the wanted proves a mode missed; none there is evidence (a
    missed mode would have to be nearly orthogonal to eight random vectors), not the proof that Sylvester's
    inertia is.
    """
    omega2, X = modes
    random = random or np.random.default_rng(1)
    spare = pencil.K.shape[0] - X.shape[1]
    if spare <= 0 or not len(omega2):
        return None
    limit = wanted.limit if wanted.count is None else float(omega2[-1]) * (1.0 - _BELOW)
    low, Y = _ritz(
        pencil, _orthogonalised(pencil.M, X, random.standard_normal((len(X), min(_GUARDS, spare))))
    )
    P = np.zeros((len(X), 0))
    for _ in range(pencil.probe):
        if low[0] <= limit:
            return float(low[0])
        R = pencil.K @ Y - (pencil.M @ Y) * low
        D = _orthogonalised(pencil.M, np.hstack([X, Y]), np.hstack([pencil.inverse(R), P]))
        low, Y, P = _combine(pencil, low, Y, D)
    return None


def _iterate(
    pencil: Pencil, start: tuple[Floats, Floats], wanted: Wanted, random: np.random.Generator
) -> tuple[Floats, Floats]:
    """Iterate until the wanted of the vectors are modes; converged ones are locked, guards join as needed."""
    omega2, X = start
    P = np.zeros_like(X)
    for _ in range(_MOST):
        MX = pencil.M @ X
        R = pencil.K @ X - MX * omega2
        inertia = np.maximum(np.abs(omega2), _LEAST * np.abs(omega2[-1])) * np.linalg.norm(MX, axis=0)
        open_ = np.linalg.norm(R, axis=0) > RESIDUAL * inertia
        count = wanted.among(omega2)
        if count + _GUARDS // 2 > X.shape[1] and X.shape[1] < X.shape[0]:
            fresh = random.standard_normal((len(X), min(max(count // 2, _GUARDS), len(X) - X.shape[1])))
            omega2, X = _ritz(pencil, np.hstack([X, _orthogonalised(pencil.M, X, fresh)]))
            P = np.zeros_like(X)
            continue
        # below a limit the first guards have to be near modes too, so that none of them can still join
        near = slice(count, count + 2)
        guarded = wanted.count is not None or np.linalg.norm(R[:, near], axis=0) <= _NEAR * inertia[near]
        if not open_[:count].any() and np.all(guarded):
            return omega2, X
        R = R[:, open_]  # here and below: no block of vectors is kept longer than it is needed
        R = pencil.inverse(R)
        D = np.hstack([R, P[:, open_]])
        del R
        D = _orthogonalised(pencil.M, X, D, MX)
        del MX
        omega2, X, P = _combine(pencil, omega2, X, D)
    raise ReductionError(
        f"LOBPCG: {_MOST} iterations on {pencil.K.shape[0]} unknowns leave {int(open_[:count].sum())} of "
        f"{count} modes above a relative residual of {RESIDUAL:g}; use another `model.solver`, or fewer modes"
    )


def _combine(pencil: Pencil, omega2: Floats, X: Floats, D: Floats) -> tuple[Floats, Floats, Floats]:
    """Ritz pairs of [X, D], M-orthonormal, X diagonal in K; and the part of D in them."""
    size = X.shape[1]
    A = np.empty((size + D.shape[1],) * 2)
    A[:size, :size] = np.diag(omega2)
    A[:size, size:], A[size:, size:] = _forms((X, D), pencil.K, D)
    A[size:, :size] = A[:size, size:].T
    low, C = eigh(0.5 * (A + A.T), subset_by_index=(0, size - 1))
    P = D @ C[size:]
    return low, X @ C[:size] + P, P


def _ritz(pencil: Pencil, X: Floats) -> tuple[Floats, Floats]:
    """Ritz pairs of M-orthonormal vectors."""
    A = X.T @ (pencil.K @ X)
    omega2, V = eigh(0.5 * (A + A.T))
    return omega2, X @ V


def _orthogonalised(M: spmatrix, X: Floats, D: Floats, MX: Floats | None = None) -> Floats:
    """D made M-orthonormal, in place, and orthogonal to the M-orthonormal X; see `independent`."""
    MX = M @ X if MX is None else MX
    for _ in range(2):
        for first in range(0, D.shape[1], _WIDTH):
            some = slice(first, first + _WIDTH)
            D[:, some] -= X @ (MX.T @ D[:, some])
        D = independent(M, D)
    return D


def _forms(left: tuple[Floats, ...], A: spmatrix, D: Floats) -> list[Floats]:
    """L^T A D for each L, some columns of A D at a time."""
    products = [np.empty((L.shape[1], D.shape[1])) for L in left]
    for first in range(0, D.shape[1], _WIDTH):
        some = slice(first, first + _WIDTH)
        AD = A @ D[:, some]
        for total, L in zip(products, left, strict=True):
            total[:, some] = L.T @ AD
    return products


def independent(M: spmatrix, D: Floats) -> Floats:
    """M-orthonormal vectors that span D's, in D's place; directions that depend on others are dropped."""
    (gram,) = _forms((D,), M, D)
    mix = orthonormalising(gram, _DEPENDENT)
    for first in range(0, len(D), _ROWS):
        rows = slice(first, first + _ROWS)
        D[rows, : mix.shape[1]] = D[rows] @ mix
    return D[:, : mix.shape[1]]
