"""Conjugate gradients for many right-hand sides at once, under an approximate inverse.

The matrix and the approximate inverse are read once for all columns of a block; a column that has converged
leaves the others.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import ReductionError

TOLERANCE = 1e-10  # of a column's residual, relative to its right-hand side
WIDTH = 16  # columns at a time: wider ones gain little and take memory
_ROWS = 2048  # of a product at a time
MOST = 400  # iterations; 30 to 60 are usual with one cycle of multigrid, 3 with factors in single precision


class Operator(Protocol):
    """A matrix as far as it is multiplied with (n, k)."""

    def __matmul__(self, right: Floats, /) -> Floats: ...


def conjugate_gradients(
    A: Operator,
    R: Floats,
    inverse: Callable[[Floats], Floats],
    name: str,
    tolerance: float = TOLERANCE,
) -> Floats:
    """Solve A X = R, until no column's residual is above so much of its right-hand side.

    Parameters
    ----------
    A : (n, n), symmetric positive definite
    R : (n, k)
    inverse : symmetric positive definite too, for (n, k)
    name : of the solver, for the message

    Raises
    ------
    ReductionError
        where the residuals do not fall so far.
    """
    limit = tolerance * np.linalg.norm(R, axis=0)
    open_ = np.flatnonzero(limit > 0.0)
    solution = np.zeros_like(R)
    if not len(open_):
        return solution
    R = np.ascontiguousarray(R[:, open_])
    X, P = np.zeros_like(R), inverse(R)
    energy = dots(R, P)
    pieces = [slice(k, k + _ROWS) for k in range(0, len(R), _ROWS)]  # stay in the cache between operations
    for _ in range(MOST):
        Q = A @ P
        step = energy / dots(P, Q)
        for rows in pieces:
            X[rows] += step * P[rows]
            R[rows] -= step * Q[rows]
        del Q
        done = np.sqrt(dots(R, R)) <= limit[open_]
        if done.any():
            if done.all() and len(open_) == solution.shape[1]:
                return X
            solution[:, open_[done]] = X[:, done]
            if done.all():
                return solution
            open_, energy = open_[~done], energy[~done]
            X, R, P = (np.ascontiguousarray(a[:, ~done]) for a in (X, R, P))
        Z = inverse(R)
        before, energy = energy, dots(R, Z)
        for rows in pieces:
            P[rows] = P[rows] * (energy / before) + Z[rows]
    left = float((np.linalg.norm(R, axis=0) / limit[open_]).max() * tolerance)
    raise ReductionError(
        f"{name}: {MOST} iterations on {len(R)} unknowns leave {left:.2g} of the right-hand side, "
        f"limit {tolerance:g}; use another `model.solver`"
    )


def dots(a: Floats, b: Floats) -> Floats:
    """Scalar products of the columns of two (n, k), (k,)."""
    return np.asarray(np.einsum("ij,ij->j", a, b))
