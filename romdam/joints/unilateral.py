"""The frictionless gap-space problem: y = W p + y_free, y >= 0, p >= 0, y p = 0.

A linear complementarity problem with a symmetric positive definite W, solved by block principal
pivoting: the primal-dual active set method (all infeasible gaps change sides at once) while it
makes progress, single changes by largest index when it does not, which is finite for every
P-matrix. The inverse of W on the closed gaps is carried from step to step and bordered or deflated
as gaps close and open: a change costs O(closed^2), a step without any costs the product with the
inverse, and nothing is refactored. (A full principal pivot transform does the same with rank-one updates of
all n^2 entries; on the two-cantilever model it cost three times as much per change.)

References
----------
Judice, Pires, Computers Oper. Res. 21 (1994) 587: block principal pivoting.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from romdam.joints.problem import GapMemory

Floats = NDArray[np.float64]

_PATIENCE = 3  # block changes without progress before single changes take over (Judice and Pires)
_MAX_CHANGES_PER_GAP = 50
_REFRESH = 2000  # changes after which the inverse is made anew, to stop round-off from piling up


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _border(W: Floats, memory: GapMemory, k: int) -> None:
    """Close gap k: border the inverse by its row and column."""
    inverse, order, n = memory.inverse, memory.order, memory.counts[0]
    b = memory.work
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += inverse[i, j] * W[k, order[j]]
        b[i] = total
    schur = W[k, k]
    for i in range(n):
        schur -= W[k, order[i]] * b[i]
    scale = 1.0 / max(schur, 1e-14 * W[k, k])  # a gap that the others determine already carries no more
    for i in range(n):
        factor = b[i] * scale
        for j in range(n):
            inverse[i, j] += factor * b[j]
        inverse[i, n] = -factor
        inverse[n, i] = -factor
    inverse[n, n] = scale
    order[n] = k
    memory.counts[0] = n + 1
    memory.closed[k] = True


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _deflate(memory: GapMemory, k: int) -> None:
    """Open gap k: take its row and column out of the inverse; the last gap takes its place."""
    inverse, order, n = memory.inverse, memory.order, memory.counts[0]
    at = 0
    while order[at] != k:
        at += 1
    last = n - 1
    for j in range(n):
        inverse[at, j], inverse[last, j] = inverse[last, j], inverse[at, j]
    for j in range(n):
        inverse[j, at], inverse[j, last] = inverse[j, last], inverse[j, at]
    order[at] = order[last]
    scale = 1.0 / inverse[last, last]
    for i in range(last):
        factor = inverse[i, last] * scale
        for j in range(last):
            inverse[i, j] -= factor * inverse[last, j]
    memory.counts[0] = last
    memory.closed[k] = False


@njit(cache=True)
def _rebuild(W: Floats, memory: GapMemory, wanted: NDArray[np.bool_]) -> None:
    """Make the inverse anew for a closed set."""
    memory.counts[0], memory.counts[1] = 0, 0
    memory.closed[:] = False
    for k in range(len(wanted)):
        if wanted[k]:
            _border(W, memory, k)


@njit(cache=True)
def adopt_closed(W: Floats, memory: GapMemory, wanted: NDArray[np.bool_]) -> None:
    """Start from another closed set than the memory's own, by the cheaper of changes and a rebuild."""
    changes, size = 0, 0
    for k in range(len(wanted)):
        changes += int(memory.closed[k] != wanted[k])
        size += int(wanted[k])
    if 3 * changes > size:
        _rebuild(W, memory, wanted)
        return
    for k in range(len(wanted)):
        if memory.closed[k] and not wanted[k]:
            _deflate(memory, k)
    for k in range(len(wanted)):
        if wanted[k] and not memory.closed[k]:
            _border(W, memory, k)
    memory.counts[1] += changes


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _evaluate(W: Floats, memory: GapMemory, y_free: Floats, out: Floats) -> None:
    """Force of the closed gaps and opening of the open ones, in one vector."""
    inverse, order, n, force = memory.inverse, memory.order, memory.counts[0], memory.work
    for i in range(n):
        total = 0.0
        for j in range(n):
            total -= inverse[i, j] * y_free[order[j]]
        force[i] = total
    out[:] = y_free
    if n < len(out):
        for a in range(n):
            f, k = force[a], order[a]
            for j in range(len(out)):
                out[j] += W[k, j] * f
    for a in range(n):
        out[order[a]] = force[a]


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
    order, n = memory.order, memory.counts[0]
    for i in range(len(out)):
        size = max(size, abs(y_free[i]))
    for a in range(n):
        r = y_free[order[a]]
        for b in range(n):
            r += W[order[a], order[b]] * out[order[b]]
        worst = max(worst, abs(r))
    return worst / size


@njit(cache=True)
def _change(W: Floats, memory: GapMemory, k: int) -> None:
    if memory.closed[k]:
        _deflate(memory, k)
    else:
        _border(W, memory, k)


@njit(cache=True)
def _change_until_feasible(W: Floats, memory: GapMemory, y_free: Floats, out: Floats) -> int:
    """Change sides until no gap is infeasible; changes made, or -1 if the limit was reached."""
    closed = memory.closed
    slack = _slack(W, y_free)
    best, patience, changes = len(closed) + 1, _PATIENCE, 0
    wrong = np.empty(len(closed), dtype=np.bool_)
    while changes <= _MAX_CHANGES_PER_GAP * len(closed):
        _evaluate(W, memory, y_free, out)
        count, last = _infeasible(closed, out, slack)
        if count == 0:
            return changes
        if count < best:
            best, patience = count, _PATIENCE
        else:
            patience -= 1
        if patience <= 0:
            _change(W, memory, last)
            changes += 1
            continue
        for i in range(len(closed)):
            wrong[i] = out[i] < -(slack[0] if closed[i] else slack[1])
        adopt_closed(W, memory, wrong ^ closed)
        changes += count
    return -1


@njit(cache=True)
def solve_unilateral(W: Floats, memory: GapMemory, y_free: Floats, y: Floats, tolerance: float) -> float:
    """Solve for the joint force; p goes to memory.force and W p + y_free to y.

    Parameters
    ----------
    W : (n, n), see `romdam.joints.problem`
    memory : its closed set and inverse are the warm start
    y_free : (n,) [m]
    y : (n,) result [m]
    tolerance : allowed relative residual of the closed gaps

    Returns
    -------
    float, the relative residual reached; above `tolerance` (or inf) means no convergence
    """
    out = y
    changes = _change_until_feasible(W, memory, y_free, out)
    residual = 0.0 if changes == 0 else _residual(W, memory, y_free, out)
    if changes < 0 or residual > 1e-2 * tolerance or memory.counts[1] > _REFRESH:
        _rebuild(W, memory, memory.closed.copy())
        changes = _change_until_feasible(W, memory, y_free, out)
        if changes < 0:
            return np.inf
        residual = _residual(W, memory, y_free, out)
    memory.counts[2] += changes
    memory.counts[3] = max(memory.counts[3], changes)
    for i in range(len(out)):
        memory.force[i] = max(out[i], 0.0) if memory.closed[i] else 0.0
        y[i] = 0.0 if memory.closed[i] else out[i]
    return residual
