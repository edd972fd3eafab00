"""The gap-space problem without friction, solved by block principal pivoting.

    y = W p + y_free,   y >= 0,   p >= 0,   y p = 0

This is a linear complementarity problem (LCP) with a symmetric positive definite matrix W, the Delassus
operator. Each gap is either closed (y = 0, p >= 0) or open (p = 0, y >= 0). For a guess of the closed set the
forces follow from linear equations; gaps with a tensile force or a negative opening are on the wrong side.
All of them change sides at once (a primal-dual active set method) as long as their number falls. Where it
does not, the last of them changes alone, which ends after finitely many changes for every P-matrix.

The inverse of W on the closed gaps is carried from step to step. A gap that closes borders it, and one that
opens deflates it, so a change costs O(closed^2), and a step without changes costs one product. A full
principal pivot transform would update all n^2 entries instead.

With more than half of the gaps closed the dual problem is smaller: p = Z y - Z y_free, with Z = W^-1 computed
once, is the same problem with force and opening exchanged, and its active set is the open gaps. An impact
that runs along a joint thus never carries more than n/2 gaps.

References
----------
Judice, Pires, Computers Oper. Res. 21 (1994) 587: block principal pivoting.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from romdam.contact.solvers.state import (
    CLOSED_SET,
    OPEN_SET,
    SET_FORCE,
    SET_RIGHT,
    SOLUTION,
    PivotingState,
)
from romdam.core.arrays import Floats, Record, at
from romdam.core.jit import copy, njit

_PATIENCE = 3  # block changes without progress before single changes take over (Judice and Pires)
_MOST_CHANGES_PER_GAP = 50  # changes before a step fails; limit
_TINY = 1e-300  # [m] least divisor of residuals
_DEPENDENT = 1e-14  # of a gap's own flexibility: less is left of it where other closed gaps determine it
_NO_FORCE = 1e-13  # of the largest free opening: round-off of a force times the largest W
_NO_OPENING = 1e-14  # of the largest free opening: round-off of an opening
_LOST = 1e-2  # of the tolerance: with a residual above it the inverse is made anew
_REFRESH = 2000  # changes after which the inverse is made anew, to stop round-off from piling up


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _minus_product(A: Floats, x: Floats, n: int, y: Floats) -> None:
    """y = -A x on the first n rows and columns; four rows at a time keep the processor busy."""
    i = 0
    while i + 4 <= n:
        a, b, c, d = A[i], A[i + 1], A[i + 2], A[i + 3]
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
        for j in range(n):
            s0 -= a[j] * x[j]
            s1 -= b[j] * x[j]
            s2 -= c[j] * x[j]
            s3 -= d[j] * x[j]
        y[i], y[i + 1], y[i + 2], y[i + 3] = s0, s1, s2, s3
        i += 4
    while i < n:
        row, total = A[i], 0.0
        for j in range(n):
            total -= row[j] * x[j]
        y[i] = total
        i += 1


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _border(W: Floats, set_: PivotingState, k: int) -> None:
    """Close gap k: border the inverse by its row and column."""
    inverse, order, n = set_.inverse, set_.order, set_.counts.number
    b, column = set_.scratch[SET_FORCE], set_.scratch[SET_RIGHT]
    for i in range(n):
        column[i] = W[k, order[i]]
    schur = W[k, k]
    _minus_product(inverse, column, n, b)
    for i in range(n):
        schur += column[i] * b[i]
    scale = 1.0 / max(schur, _DEPENDENT * W[k, k])  # a gap that the others determine already carries no more
    for i in range(n):
        row, factor = inverse[i], b[i] * scale
        for j in range(n):
            row[j] += factor * b[j]
        inverse[i, n] = factor
        inverse[n, i] = factor
    inverse[n, n] = scale
    order[n] = k
    set_.counts.number = n + 1
    set_.active[k] = True


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _deflate(set_: PivotingState, k: int) -> None:
    """Open gap k: take its row and column out of the inverse; the last gap takes its place."""
    inverse, order, n = set_.inverse, set_.order, set_.counts.number
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
    tail = inverse[last]
    for i in range(last):
        row, factor = inverse[i], tail[i] * scale
        for j in range(last):
            row[j] -= factor * tail[j]
    set_.counts.number = last
    set_.active[k] = False


@njit(cache=True)
def _adopt(W: Floats, set_: PivotingState, anew: bool) -> None:
    """Start from the wanted set in place of the present one, by the cheaper of changes and a fresh inverse.

    Parameters
    ----------
    anew : whether the inverse is to be made anew in any case
    """
    active, wanted = set_.active, set_.wanted
    changes, size = 0, 0
    for k in range(len(wanted)):
        changes += active[k] ^ wanted[k]
        size += wanted[k]
    if changes == 0 and not anew:
        return
    if anew or 3 * changes > size:
        set_.counts.number, set_.counts.updates = 0, 0
        active[:] = False
        for k in range(len(wanted)):
            if wanted[k]:
                _border(W, set_, k)
        return
    for k in range(len(wanted)):
        if active[k] and not wanted[k]:
            _deflate(set_, k)
    for k in range(len(wanted)):
        if wanted[k] and not active[k]:
            _border(W, set_, k)
    set_.counts.updates += changes


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"}, forceinline=True)
def _evaluate(W: Floats, set_: PivotingState, y_free: Floats, out: Floats) -> float:
    """Force of the closed gaps and opening of the open ones, in one vector.

    Returns
    -------
    float, the largest opening that the forces leave at a closed gap, which is round-off [m]
    """
    inverse, order, n = set_.inverse, set_.order, set_.counts.number
    force, right = set_.scratch[SET_FORCE], set_.scratch[SET_RIGHT]
    for i in range(n):
        right[i] = y_free[order[i]]
    _minus_product(inverse, right, n, force)
    copy(y_free, out)
    a = 0
    while a + 4 <= n:
        f0, f1, f2, f3 = force[a], force[a + 1], force[a + 2], force[a + 3]
        r0, r1, r2, r3 = W[order[a]], W[order[a + 1]], W[order[a + 2]], W[order[a + 3]]
        for j in range(len(out)):
            out[j] += r0[j] * f0 + r1[j] * f1 + r2[j] * f2 + r3[j] * f3
        a += 4
    while a < n:
        f, row = force[a], W[order[a]]
        for j in range(len(out)):
            out[j] += row[j] * f
        a += 1
    left = 0.0
    for a in range(n):
        left = max(left, abs(out[order[a]]))
        out[order[a]] = force[a]
    return left


@njit(cache=True, forceinline=True)
def _is_infeasible(
    set_: PivotingState, out: Floats, least_force: float, least_opening: float, i: int
) -> bool:
    """Tell whether gap i is on the wrong side: pulled, or overlapping."""
    return out[i] < -(least_force if set_.active[i] else least_opening)


@njit(cache=True)
def _change_until_feasible(
    W: Floats, set_: PivotingState, y_free: Floats, out: Floats, most: int, share: float
) -> tuple[int, float]:
    """Change sides until no gap is infeasible.

    Parameters
    ----------
    most : most changes
    share : share of the largest free opening that is round-off of an opening, or of what one gap's force
        moves, where that is more than usual

    Returns
    -------
    (changes, residual) : made, or -1 where more than `most` would be needed; the largest residual of a closed
        gap relative to the largest |y_free|
    """
    active, wanted, size = set_.active, set_.wanted, 0.0
    for i in range(len(y_free)):
        size = max(size, abs(y_free[i]))
    least_force = max(_NO_FORCE, share) * size / set_.counts.largest
    least_opening = max(_NO_OPENING, share) * size
    best, patience, changes = len(active) + 1, _PATIENCE, 0
    while True:
        left = _evaluate(W, set_, y_free, out)
        count, last = 0, -1
        for i in range(len(out)):
            if out[i] < 0.0 and _is_infeasible(set_, out, least_force, least_opening, i):
                count += 1
                last = i
        if count == 0:
            return changes, left / max(size, _TINY)
        if changes >= most:
            return -1, np.inf
        if count < best:
            best, patience = count, _PATIENCE
        else:
            patience -= 1
        if patience <= 0:
            if active[last]:
                _deflate(set_, last)
            else:
                _border(W, set_, last)
            changes += 1
            continue
        for i in range(len(active)):
            wanted[i] = active[i] != _is_infeasible(set_, out, least_force, least_opening, i)
        _adopt(W, set_, False)
        changes += count


@njit(cache=True)
def solve_unilateral(
    W: Floats,
    Z: Floats,
    force: Floats,
    failure: Record,
    solver: PivotingState,
    closed: NDArray[np.bool_],
    y_free: Floats,
    y: Floats,
    tolerance: float,
    steady: bool,
) -> float:
    """Solve for the joint force p, and W p + y_free.

    Parameters
    ----------
    W, Z : of `romdam.contact.problem.GapProblem` [m/N], [N/m]
    force : (n,) receives p [N]
    failure, solver : of `romdam.contact.problem.GapMemory`, changed in place
    closed : (n,) closed gaps to start from
    y_free : (n,) [m]
    y : (n,) result [m]
    tolerance : allowed relative residual on the active gaps
    steady : whether to give up at the first change

    Returns
    -------
    float, the relative residual reached; above the tolerance (or inf) means no convergence
    """
    n, size = len(closed), 0
    for i in range(n):
        size += closed[i]
    dual = 2 * size > n and len(Z) > 0
    set_, A, known = at(solver, OPEN_SET if dual else CLOSED_SET), W, y_free
    if dual:
        A, known = Z, y
        _minus_product(A, y_free, n, y)
    if set_.counts.largest == 0.0:
        for i in range(n):
            set_.counts.largest = max(set_.counts.largest, A[i, i])
    for i in range(n):
        set_.wanted[i] = closed[i] != dual
    _adopt(A, set_, False)
    out, most = set_.scratch[SOLUTION], 0 if steady else _MOST_CHANGES_PER_GAP * n
    changes, residual = _change_until_feasible(A, set_, known, out, most, 0.0)
    if steady and changes < 0:
        return np.inf
    if changes < 0 or residual > _LOST * tolerance or set_.counts.updates > _REFRESH:
        copy(set_.active, set_.wanted)
        _adopt(A, set_, True)
        changes, residual = _change_until_feasible(A, set_, known, out, most, 0.0)
    if changes < 0:  # forces of gaps that determine each other lose more digits: all are within the tolerance
        changes, residual = _change_until_feasible(A, set_, known, out, most, tolerance / n)
    if not residual <= tolerance:
        failure.gap = out.argmin()
        return residual
    set_.counts.iterations += changes
    set_.counts.most_iterations = max(set_.counts.most_iterations, changes)
    for i in range(n):
        loaded = set_.active[i] != dual
        force[i] = max(out[i], 0.0) if loaded else 0.0
        y[i] = 0.0 if loaded else out[i]
    return residual
