"""Semismooth Newton for the gap-space problem with friction, where Gauss-Seidel sweeps do not contract.

The natural map x = p - rho y, projected onto the friction cone, is equal to p exactly at a solution. It also
tells the state of each gap: open where x_n is negative, sticking where x lies inside the cone, sliding where
it lies outside. For given states the problem is a system of equations, y = 0 in the directions that are free
to carry force, and each Newton step solves it.

The unknowns follow from the states. A sticking gap has its three force components. A sliding gap has its
normal force, which carries the shear (c + mu p_n) e with it. If friction limits the resultant (equal
coefficients in both directions) the direction e may turn, and the turn is an unknown too. So the matrix is W
in these directions; only mu makes it unsymmetric.

References
----------
Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353: natural map and semismooth Newton.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from romdam.contact.components import ALONG_J, ALONG_K, NORMAL, SHEAR_J, SHEAR_K
from romdam.contact.cone import project_shear, shear_limit, shear_limits
from romdam.contact.problem import GapMemory, Limits
from romdam.core.arrays import Bools, Floats
from romdam.core.jit import copy, njit

_ITERATIONS = 30  # of semismooth Newton; limit
_REGULAR = 1e-14  # of the diagonal: gaps that determine each other (a singular H) share their force
_LEAST_LIMIT = 1e-12  # of the force that closes a gap's residual: least limit that its turn is divided by


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def add_row(row: Floats, factor: float, y: Floats) -> None:
    """y += factor row."""
    for j in range(len(y)):
        y[j] += factor * row[j]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _add_dense(W: Floats, p: Floats, y: Floats) -> None:
    """y += W p, from the lower triangle of the symmetric W, four rows in one pass."""
    first = len(p) % 4
    for i in range(first):
        for j in range(first):
            y[i] += W[i, j] * p[j]
    for i in range(first, len(p), 4):
        row_0, row_1, row_2, row_3 = W[i], W[i + 1], W[i + 2], W[i + 3]
        p_0, p_1, p_2, p_3 = p[i], p[i + 1], p[i + 2], p[i + 3]
        y_0, y_1, y_2, y_3 = 0.0, 0.0, 0.0, 0.0
        for j in range(i):
            y_0 += row_0[j] * p[j]
            y_1 += row_1[j] * p[j]
            y_2 += row_2[j] * p[j]
            y_3 += row_3[j] * p[j]
            y[j] += row_0[j] * p_0 + row_1[j] * p_1 + row_2[j] * p_2 + row_3[j] * p_3
        y[i] += y_0
        y[i + 1] += y_1
        y[i + 2] += y_2
        y[i + 3] += y_3
        for r in range(i, i + 4):
            for j in range(i, i + 4):
                y[r] += W[r, j] * p[j]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def add_gap(rows: Floats, p: Floats, y: Floats) -> None:
    """y += rows^T p, the three rows of a gap in one pass."""
    a, b, c = rows[NORMAL], rows[SHEAR_J], rows[SHEAR_K]
    f, g, h = p[NORMAL], p[SHEAR_J], p[SHEAR_K]
    for j in range(len(y)):
        y[j] += f * a[j] + g * b[j] + h * c[j]


@njit(cache=True)
def add_product(W: Floats, p: Floats, y: Floats) -> None:
    """y += W p, W symmetric; where few gaps are loaded, the others are skipped."""
    loaded = 0
    for a in range(0, len(p), 3):
        loaded += int(p[a] != 0.0 or p[a + SHEAR_J] != 0.0 or p[a + SHEAR_K] != 0.0)
    if 6 * loaded > len(p):
        _add_dense(W, p, y)
        return
    for a in range(0, len(p), 3):
        if p[a] != 0.0 or p[a + SHEAR_J] != 0.0 or p[a + SHEAR_K] != 0.0:
            add_gap(W[a : a + 3], p[a : a + 3], y)


@njit(cache=True)
def response(W: Floats, p: Floats, y_free: Floats, y: Floats) -> None:
    """y = W p + y_free."""
    copy(y_free, y)
    add_product(W, p, y)


@njit(cache=True)
def _natural(
    W: Floats, limits: Limits, p: Floats, y: Floats, i: int
) -> tuple[float, float, float, float, float]:
    """Natural map of gap i: (x_n, x_j, x_k, limit_j, limit_k), not yet projected."""
    b = 3 * i
    x_n = p[b] - y[b] / W[b, b]
    scale = 1.0 / max(W[b + SHEAR_J, b + SHEAR_J], W[b + SHEAR_K, b + SHEAR_K])
    limit_j, limit_k = shear_limits(limits, i, max(x_n, 0.0))
    return (
        x_n,
        p[b + SHEAR_J] - scale * y[b + SHEAR_J],
        p[b + SHEAR_K] - scale * y[b + SHEAR_K],
        limit_j,
        limit_k,
    )


@njit(cache=True)
def _change(W: Floats, limits: Limits, p: Floats, y: Floats, i: int) -> float:
    """Largest change of a force of gap i by its natural map; inf where it is not finite."""
    x_n, x_j, x_k, limit_j, limit_k = _natural(W, limits, p, y, i)
    b = 3 * i
    t_j, t_k = 0.0, 0.0
    if limit_j > 0.0 or limit_k > 0.0:
        t_j, t_k, _ = project_shear(x_j, x_k, limit_j, limit_k)
    change = max(abs(max(x_n, 0.0) - p[b]), abs(t_j - p[b + SHEAR_J]), abs(t_k - p[b + SHEAR_K]))
    return change if math.isfinite(x_n + change) else np.inf


@njit(cache=True)
def natural_residuals(W: Floats, limits: Limits, p: Floats, y: Floats) -> tuple[float, float]:
    """Largest change of a force by its natural map, relative to the largest force or what would close a gap,
    and to the largest force alone.
    """
    worst, closing, opening = 0.0, 1e-300, 0.0
    for i in range(len(limits.mu)):
        b = 3 * i
        opening = max(opening, abs(y[b]) / W[b, b])
        size = max(abs(p[b]), abs(p[b + SHEAR_J]), abs(p[b + SHEAR_K]))
        if (
            size == 0.0
            and y[b] >= 0.0
            and limits.cohesion[i, ALONG_J] == 0.0
            and limits.cohesion[i, ALONG_K] == 0.0
        ):
            continue  # an open gap
        worst = max(worst, _change(W, limits, p, y, i))
        closing = max(closing, size)
    return (worst / max(closing, opening), worst / closing) if math.isfinite(worst) else (np.inf, np.inf)


@njit(cache=True)
def natural_residual(W: Floats, limits: Limits, p: Floats, y: Floats) -> float:
    """Largest change of a force by its natural map, relative to the largest force."""
    residual, _ = natural_residuals(W, limits, p, y)
    return residual


@njit(cache=True)
def worst_gap(W: Floats, limits: Limits, p: Floats, y: Floats) -> int:
    """The gap whose force its natural map changes most."""
    worst, at = -1.0, 0
    for i in range(len(limits.mu)):
        change = _change(W, limits, p, y, i)
        if change > worst:
            worst, at = change, i
    return at


@njit(cache=True)
def on_resultant(limits: Limits, i: int) -> bool:
    """Tell whether gap i bounds the resultant shear (a disc) and not each direction (a rectangle)."""
    return (
        limits.mu[i, ALONG_J] == limits.mu[i, ALONG_K]
        and limits.cohesion[i, ALONG_J] == limits.cohesion[i, ALONG_K]
    )


@njit(cache=True)
def _classify(W: Floats, limits: Limits, p: Floats, y: Floats, heading: Floats, free: Bools) -> int:
    """States from the natural map; how many unknowns there are.

    heading (n, 2) is the direction of a sliding gap's shear (signs on the rectangle), zero where it sticks.
    free (n, 3): normal force unknown, shear along j and k unknown. A gap sliding on the resultant keeps
    free[i, SHEAR_J] for the turn of its direction; free[i, SHEAR_K] is False there.
    """
    unknowns = 0
    for i in range(len(limits.mu)):
        x_n, x_j, x_k, limit_j, limit_k = _natural(W, limits, p, y, i)
        stick_j, stick_k = abs(x_j) <= limit_j and limit_j > 0.0, abs(x_k) <= limit_k and limit_k > 0.0
        heading[i, ALONG_J], heading[i, ALONG_K] = 0.0, 0.0
        if on_resultant(limits, i):
            size = math.hypot(x_j, x_k)
            stick_j = limit_j > 0.0
            stick_k = stick_j and size <= limit_j
            if stick_j and not stick_k:
                heading[i, ALONG_J], heading[i, ALONG_K] = x_j / size, x_k / size
        else:
            if not stick_j and limit_j > 0.0:
                heading[i, ALONG_J] = math.copysign(1.0, x_j)
            if not stick_k and limit_k > 0.0:
                heading[i, ALONG_K] = math.copysign(1.0, x_k)
        free[i, NORMAL], free[i, SHEAR_J], free[i, SHEAR_K] = x_n > 0.0, stick_j, stick_k
        unknowns += int(x_n > 0.0) + int(stick_j) + int(stick_k)
    return unknowns


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _jacobian(W: Floats, rows: Floats, columns: Floats, index: NDArray[np.int64], J: Floats) -> None:
    """J = rows^T W columns over the unknowns."""
    m = len(index)
    for a in range(m):
        ia = 3 * index[a]
        for b in range(m):
            ib = 3 * index[b]
            total = 0.0
            for r in range(3):
                if rows[a, r] != 0.0:
                    total += rows[a, r] * (
                        W[ia + r, ib] * columns[b, NORMAL]
                        + W[ia + r, ib + SHEAR_J] * columns[b, SHEAR_J]
                        + W[ia + r, ib + SHEAR_K] * columns[b, SHEAR_K]
                    )
            J[a, b] = total


@njit(cache=True)
def _update(
    W: Floats,
    limits: Limits,
    heading: Floats,
    free: Bools,
    unknowns: int,
    p: Floats,
    y_free: Floats,
    y: Floats,
) -> bool:
    """One Newton step for the states of `_classify`; p is replaced; False where the step is not finite."""
    # unknown directions of force (columns) and equation directions of y (rows), and their gaps
    columns, rows = np.zeros((unknowns, 3)), np.zeros((unknowns, 3))
    index, m = np.empty(unknowns, dtype=np.int64), 0
    for i in range(len(free)):
        if free[i, NORMAL]:
            columns[m, NORMAL] = rows[m, NORMAL] = 1.0
            columns[m, SHEAR_J] = limits.mu[i, ALONG_J] * heading[i, ALONG_J]
            columns[m, SHEAR_K] = limits.mu[i, ALONG_K] * heading[i, ALONG_K]
            index[m] = i
            m += 1
        turns = on_resultant(limits, i) and not free[i, SHEAR_K]
        for axis in (SHEAR_J, SHEAR_K):
            if free[i, axis]:
                along_j, along_k = (1.0, 0.0) if axis == SHEAR_J else (0.0, 1.0)
                if turns:
                    along_j, along_k = -heading[i, ALONG_K], heading[i, ALONG_J]
                columns[m, SHEAR_J] = rows[m, SHEAR_J] = along_j
                columns[m, SHEAR_K] = rows[m, SHEAR_K] = along_k
                index[m] = i
                m += 1
    for i in range(len(free)):  # forces that are no unknowns are what the states make of them
        b = 3 * i
        p[b] = max(p[b], 0.0) if free[i, NORMAL] else 0.0
        turns = on_resultant(limits, i) and not free[i, SHEAR_K]
        for axis in range(2):
            if (turns and axis == 0) or not free[i, 1 + axis]:
                p[b + SHEAR_J + axis] = 0.0
                if heading[i, axis] != 0.0:  # a gap without heading may have an infinite limit
                    limit = shear_limit(limits.cohesion[i, axis], limits.mu[i, axis], p[b])
                    p[b + SHEAR_J + axis] = heading[i, axis] * limit
    response(W, p, y_free, y)
    J, right = np.empty((unknowns, unknowns)), np.empty(unknowns)
    _jacobian(W, rows, columns, index, J)
    for a in range(unknowns):
        i, b = index[a], 3 * index[a]
        right[a] = -(
            rows[a, NORMAL] * y[b] + rows[a, SHEAR_J] * y[b + SHEAR_J] + rows[a, SHEAR_K] * y[b + SHEAR_K]
        )
        J[a, a] += _REGULAR * W[b, b]
        if rows[a, NORMAL] == 0.0 and on_resultant(limits, i) and not free[i, SHEAR_K]:
            along = heading[i, ALONG_J] * y[b + SHEAR_J] + heading[i, ALONG_K] * y[b + SHEAR_K]
            limit = shear_limits(limits, i, p[b])[ALONG_J]
            J[a, a] += max(-along, 0.0) / max(limit, _LEAST_LIMIT * abs(right[a]) / W[b, b] + 1e-300)
    for a in range(unknowns):
        finite = math.isfinite(right[a])
        for b in range(unknowns):
            finite = finite and math.isfinite(J[a, b])
        if not finite:
            return False
    step = np.linalg.solve(J, right)
    for a in range(unknowns):
        b = 3 * index[a]
        for r in range(3):
            p[b + r] += columns[a, r] * step[a]
    return True


@njit(cache=True)
def newton(
    W: Floats, limits: Limits, memory: GapMemory, y_free: Floats, y: Floats, tolerance: float
) -> float:
    """Iterate from memory.force; y must be its response; the natural residual reached."""
    n, p, counts = len(limits.mu), memory.force, memory.solver.sweeps.counts
    heading, free = np.zeros((n, 2)), np.zeros((n, 3), dtype=np.bool_)
    residual = natural_residual(W, limits, p, y)
    for iteration in range(_ITERATIONS):
        unknowns = _classify(W, limits, p, y, heading, free)
        good = _update(W, limits, heading, free, unknowns, p, y_free, y)
        counts.iterations += 1
        counts.most_iterations = max(counts.most_iterations, iteration + 1)
        response(W, p, y_free, y)
        residual = natural_residual(W, limits, p, y)
        if not good or residual <= tolerance:
            break
    return residual
