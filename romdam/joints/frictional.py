"""The gap-space problem with Coulomb friction: semismooth Newton on the closed gaps.

Newton works in the coordinates that the states leave free: a sticking gap has its three force
components; a sliding one its normal force, which drags the shear mu p_n e along, and (equal
coefficients: friction on the resultant) the turn of the direction e. The equations are y = 0 in the
same directions, so the matrix is W on the closed gaps, unsymmetric by mu alone. States come from the
natural map p = projection(p - rho y). If Newton does not settle, projected Gauss-Seidel sweeps bring
it near and it starts again.

References
----------
Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353: natural map and semismooth Newton.
Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235: nonsmooth Gauss-Seidel.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from romdam.joints.laws import project_shear
from romdam.joints.problem import GapMemory

Floats = NDArray[np.float64]

_NEWTON = 30  # iterations before a Gauss-Seidel round
_SWEEPS = 200  # Gauss-Seidel sweeps in a round
_ROUNDS = 8


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _response(W: Floats, p: Floats, y_free: Floats, y: Floats) -> None:
    """y = W p + y_free, skipping unloaded components (W is symmetric: rows serve as columns)."""
    y[:] = y_free
    for a in range(len(p)):
        f = p[a]
        if f != 0.0:
            for j in range(len(y)):
                y[j] += W[a, j] * f


@njit(cache=True)
def _natural(W: Floats, mu: Floats, p: Floats, y: Floats, i: int) -> tuple[float, float, float, float, float]:
    """Natural map of gap i: (p_n, x_j, x_k, limit_j, limit_k), the shear not yet projected."""
    b = 3 * i
    x_n = p[b] - y[b] / W[b, b]
    scale = 1.0 / max(W[b + 1, b + 1], W[b + 2, b + 2])
    p_n = max(x_n, 0.0)
    return x_n, p[b + 1] - scale * y[b + 1], p[b + 2] - scale * y[b + 2], mu[i, 0] * p_n, mu[i, 1] * p_n


@njit(cache=True)
def _natural_residual(W: Floats, mu: Floats, p: Floats, y: Floats) -> float:
    """Largest change of a force by its natural map, relative to the largest force."""
    worst, size = 0.0, 1e-300
    for i in range(len(mu)):
        x_n, x_j, x_k, limit_j, limit_k = _natural(W, mu, p, y, i)
        t_j, t_k, _ = project_shear(x_j, x_k, limit_j, limit_k)
        b = 3 * i
        change = max(abs(max(x_n, 0.0) - p[b]), abs(t_j - p[b + 1]), abs(t_k - p[b + 2]))
        worst = max(worst, change)
        size = max(size, abs(p[b]), abs(p[b + 1]), abs(p[b + 2]), abs(y[b]) / W[b, b])
    return worst / size


@njit(cache=True)
def _classify(
    W: Floats, mu: Floats, p: Floats, y: Floats, drag: Floats, free: NDArray[np.bool_]
) -> tuple[int, int]:
    """States from the natural map: drag (n, 2) is shear per normal force, free (n, 3) the unknowns.

    free[i, 0] closed, free[i, 1:] the tangential directions that are unknown. A sliding gap with equal
    coefficients drags along e and keeps free[i, 1] for the turn of e; free[i, 2] is False there.
    Returns how many gaps changed their state and how many unknowns there are.
    """
    changed, unknowns = 0, 0
    for i in range(len(mu)):
        x_n, x_j, x_k, limit_j, limit_k = _natural(W, mu, p, y, i)
        closed, stick_j, stick_k = x_n > 0.0, False, False
        drag[i, 0], drag[i, 1] = 0.0, 0.0
        if closed:
            if mu[i, 0] == mu[i, 1]:
                size = math.hypot(x_j, x_k)
                if size <= limit_j:
                    stick_j, stick_k = True, True
                else:
                    stick_j = mu[i, 0] > 0.0
                    drag[i, 0], drag[i, 1] = mu[i, 0] * x_j / size, mu[i, 0] * x_k / size
            else:
                stick_j, stick_k = abs(x_j) <= limit_j, abs(x_k) <= limit_k
                drag[i, 0] = 0.0 if stick_j else math.copysign(mu[i, 0], x_j)
                drag[i, 1] = 0.0 if stick_k else math.copysign(mu[i, 1], x_k)
        if free[i, 0] != closed or free[i, 1] != stick_j or free[i, 2] != stick_k:
            changed += 1
        free[i, 0], free[i, 1], free[i, 2] = closed, stick_j, stick_k
        unknowns += int(closed) + int(stick_j) + int(stick_k)
    return changed, unknowns


@njit(cache=True)
def _directions(
    mu: Floats, drag: Floats, free: NDArray[np.bool_], columns: Floats, rows: Floats, index: NDArray[np.int64]
) -> None:
    """Unknown directions of force (columns) and equation directions of y (rows), (m, 3) each."""
    m = 0
    for i in range(len(mu)):
        if not free[i, 0]:
            continue
        columns[m] = (1.0, drag[i, 0], drag[i, 1])
        rows[m] = (1.0, 0.0, 0.0)
        index[m] = i
        m += 1
        turns = mu[i, 0] == mu[i, 1] and free[i, 1] and not free[i, 2]
        for axis in (1, 2):
            if free[i, axis]:
                direction = (0.0, 1.0, 0.0) if axis == 1 else (0.0, 0.0, 1.0)
                if turns:
                    size = math.hypot(drag[i, 0], drag[i, 1])
                    direction = (0.0, -drag[i, 1] / size, drag[i, 0] / size)
                columns[m] = direction
                rows[m] = direction
                index[m] = i
                m += 1


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
                        W[ia + r, ib] * columns[b, 0]
                        + W[ia + r, ib + 1] * columns[b, 1]
                        + W[ia + r, ib + 2] * columns[b, 2]
                    )
            J[a, b] = total


@njit(cache=True)
def _newton_update(
    W: Floats, mu: Floats, p: Floats, y: Floats, drag: Floats, free: NDArray[np.bool_], unknowns: int
) -> None:
    """One Newton step for the states at hand; p is replaced."""
    columns, rows = np.empty((unknowns, 3)), np.empty((unknowns, 3))
    index = np.empty(unknowns, dtype=np.int64)
    _directions(mu, drag, free, columns, rows, index)
    # a sliding gap's shear is slaved to its normal force before the equations are evaluated
    for i in range(len(mu)):
        b = 3 * i
        if not free[i, 0]:
            p[b], p[b + 1], p[b + 2] = 0.0, 0.0, 0.0
        else:
            p[b] = max(p[b], 0.0)
            turns = mu[i, 0] == mu[i, 1] and not free[i, 2]
            if turns or not free[i, 1]:
                p[b + 1] = drag[i, 0] * p[b]
            if not free[i, 2]:
                p[b + 2] = drag[i, 1] * p[b]
    trial = np.empty_like(y)
    _response(W, p, y, trial)  # here y is the free response; see solve_frictional
    J = np.empty((unknowns, unknowns))
    _jacobian(W, rows, columns, index, J)
    right = np.empty(unknowns)
    for a in range(unknowns):
        b = 3 * index[a]
        right[a] = -(rows[a, 0] * trial[b] + rows[a, 1] * trial[b + 1] + rows[a, 2] * trial[b + 2])
        i = index[a]
        if rows[a, 0] == 0.0 and mu[i, 0] == mu[i, 1] and not free[i, 2]:
            along = (drag[i, 0] * trial[b + 1] + drag[i, 1] * trial[b + 2]) / mu[i, 0]
            J[a, a] += max(-along, 0.0) / max(mu[i, 0] * p[b], 1e-12 * abs(right[a]) / W[b, b] + 1e-300)
    step = np.linalg.solve(J, right)
    for a in range(unknowns):
        b = 3 * index[a]
        for r in range(3):
            p[b + r] += columns[a, r] * step[a]


@njit(cache=True)
def _sweep(W: Floats, mu: Floats, y_free: Floats, p: Floats) -> None:
    """One projected Gauss-Seidel sweep over the gaps."""
    N = len(p)
    for i in range(len(mu)):
        b = 3 * i
        for d in range(3):
            total = y_free[b + d]
            for j in range(N):
                total += W[b + d, j] * p[j]
            if d == 0:
                p[b] = max(p[b] - total / W[b, b], 0.0)
            else:
                p[b + d] -= total / W[b + d, b + d]
        t_j, t_k, _ = project_shear(p[b + 1], p[b + 2], mu[i, 0] * p[b], mu[i, 1] * p[b])
        p[b + 1], p[b + 2] = t_j, t_k


@njit(cache=True)
def solve_frictional(
    problem_W: Floats, mu: Floats, memory: GapMemory, y_free: Floats, y: Floats, tolerance: float
) -> float:
    """Solve for the joint force; p goes to memory.force and W p + y_free to y.

    Parameters
    ----------
    problem_W : (3 n, 3 n), see `romdam.joints.problem`
    mu : (n, 2)
    memory : its force is the warm start
    y_free : (3 n,) [m]
    y : (3 n,) result [m]
    tolerance : allowed change of a force by its natural map, relative to the largest force

    Returns
    -------
    float, the relative residual reached; above `tolerance` means no convergence
    """
    W, p, n = problem_W, memory.force, len(mu)
    drag, free = np.zeros((n, 2)), np.zeros((n, 3), dtype=np.bool_)
    residual, iterations = np.inf, 0
    for _ in range(_ROUNDS):
        for _ in range(_NEWTON):
            _response(W, p, y_free, y)
            residual = _natural_residual(W, mu, p, y)
            if residual <= tolerance:
                break
            unknowns = _classify(W, mu, p, y, drag, free)[1]
            _newton_update(W, mu, p, y_free, drag, free, unknowns)
            iterations += 1
        if residual <= tolerance:
            break
        for i in range(len(p)):
            if not math.isfinite(p[i]):
                p[i] = 0.0
        for _ in range(_SWEEPS):
            _sweep(W, mu, y_free, p)
    memory.counts[0, 2] += iterations
    memory.counts[0, 3] = max(memory.counts[0, 3], iterations)
    return residual
