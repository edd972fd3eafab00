"""The frictionless gap-space problem: y = W p + y_free, y >= 0, p >= 0, y p = 0.

A linear complementarity problem with a symmetric positive definite W, solved by block principal
pivoting: the primal-dual active set method (all infeasible gaps change sides at once) while it
makes progress, single pivots by largest index when it does not, which is finite for every
P-matrix. The tableau (principal pivot transform of W on the closed set) is carried from step to step:
a gap that changes sides costs one rank-one update, a step in which none does costs one
matrix-vector product over the closed gaps, and nothing is ever refactored.

References
----------
Judice, Pires, Computers Oper. Res. 21 (1994) 587: block principal pivoting.
Tsatsomeros, Linear Algebra Appl. 307 (2000) 151: principal pivot transforms.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from romdam.joints.problem import GapMemory

Floats = NDArray[np.float64]

_PATIENCE = 3  # block pivots without progress before single pivots take over (Judice and Pires)
_MAX_PIVOTS_PER_GAP = 50
_REFRESH = 256  # pivots after which the tableau is made anew, to stop round-off from piling up


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _pivot(tableau: Floats, closed: NDArray[np.bool_], k: int) -> None:
    """Move gap k to the other side: the principal pivot transform on k, in place."""
    n = len(closed)
    inverse = 1.0 / tableau[k, k]
    for j in range(n):
        tableau[k, j] *= -inverse
    tableau[k, k] = inverse
    for i in range(n):
        if i != k:
            factor = tableau[i, k]
            for j in range(n):
                tableau[i, j] += factor * tableau[k, j]
            tableau[i, k] = factor * inverse
    closed[k] = not closed[k]


@njit(cache=True)
def _rebuild(W: Floats, memory: GapMemory) -> None:
    """Make the tableau anew from W for the closed set as it is."""
    wanted = memory.closed.copy()
    memory.tableau[:] = W
    memory.closed[:] = False
    for k in range(len(wanted)):
        if wanted[k]:
            _pivot(memory.tableau, memory.closed, k)
    memory.counts[0] = 0


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _evaluate(tableau: Floats, closed: NDArray[np.bool_], y_free: Floats, out: Floats) -> None:
    """Force of the closed gaps and opening of the open ones, in one vector.

    Rows serve as columns: the tableau is symmetric within, antisymmetric between the two sides.
    """
    n = len(closed)
    out[:] = 0.0
    for a in range(n):
        if closed[a]:
            g = y_free[a]
            for j in range(n):
                out[j] += tableau[a, j] * g
    for j in range(n):
        out[j] = -out[j] if closed[j] else out[j] + y_free[j]


@njit(cache=True)
def _infeasible(closed: NDArray[np.bool_], out: Floats, slack: tuple[float, float]) -> tuple[int, int]:
    """How many gaps are on the wrong side, and the largest index among them."""
    count, last = 0, -1
    for i in range(len(closed)):
        if out[i] < -(slack[0] if closed[i] else slack[1]):
            count += 1
            last = i
    return count, last


@njit(cache=True)
def _slack(W: Floats, y_free: Floats) -> tuple[float, float]:
    """Round-off allowances for a force and an opening."""
    size, flexibility = 0.0, 0.0
    for i in range(len(y_free)):
        size = max(size, abs(y_free[i]))
        flexibility = max(flexibility, W[i, i])
    return 1e-13 * size / flexibility, 1e-14 * size


@njit(cache=True)
def _residual(W: Floats, memory: GapMemory, y_free: Floats, out: Floats) -> float:
    """Largest |W p + y_free| over the closed gaps, relative to the largest |y_free|."""
    worst, size = 0.0, 1e-300
    for i in range(len(out)):
        size = max(size, abs(y_free[i]))
        if memory.closed[i]:
            r = y_free[i]
            for j in range(len(out)):
                if memory.closed[j]:
                    r += W[i, j] * out[j]
            worst = max(worst, abs(r))
    return worst / size


@njit(cache=True)
def _pivot_until_feasible(W: Floats, memory: GapMemory, y_free: Floats, out: Floats) -> int:
    """Change sides until no gap is infeasible; pivots made, or -1 if the limit was reached."""
    closed, tableau = memory.closed, memory.tableau
    slack = _slack(W, y_free)
    best, patience, pivots = len(closed) + 1, _PATIENCE, 0
    while pivots <= _MAX_PIVOTS_PER_GAP * len(closed):
        _evaluate(tableau, closed, y_free, out)
        count, last = _infeasible(closed, out, slack)
        if count == 0:
            return pivots
        if count < best:
            best, patience = count, _PATIENCE
        else:
            patience -= 1
        if patience > 0:
            for i in range(len(closed)):
                if out[i] < -(slack[0] if closed[i] else slack[1]):
                    _pivot(tableau, closed, i)
            pivots += count
        else:
            _pivot(tableau, closed, last)
            pivots += 1
    return -1


@njit(cache=True)
def solve_unilateral(
    W: Floats, memory: GapMemory, y_free: Floats, y: Floats, tolerance: float
) -> float:
    """Solve for the joint force; p goes to memory.force and W p + y_free to y.

    Parameters
    ----------
    W : (n, n), see `romdam.joints.problem`
    memory : its closed set and tableau are the warm start
    y_free : (n,) [m]
    y : (n,) result [m]
    tolerance : allowed relative residual of the closed gaps

    Returns
    -------
    float, the relative residual reached; above `tolerance` (or inf) means no convergence
    """
    out = y
    pivots = _pivot_until_feasible(W, memory, y_free, out)
    memory.counts[0] += max(pivots, 0)
    residual = 0.0 if pivots == 0 else _residual(W, memory, y_free, out)
    if pivots < 0 or residual > 1e-2 * tolerance or memory.counts[0] > _REFRESH:
        _rebuild(W, memory)
        pivots = _pivot_until_feasible(W, memory, y_free, out)
        if pivots < 0:
            return np.inf
        residual = _residual(W, memory, y_free, out)
    memory.counts[1] += pivots
    memory.counts[2] = max(memory.counts[2], pivots)
    for i in range(len(out)):
        memory.force[i] = max(out[i], 0.0) if memory.closed[i] else 0.0
        y[i] = 0.0 if memory.closed[i] else out[i]
    return residual
