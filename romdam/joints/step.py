"""One implicit step of all gaps: free jumps in, joint forces out, history committed."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from romdam.joints.frictional import solve_frictional
from romdam.joints.laws import OPEN, SLIP, STICK
from romdam.joints.problem import GapMemory, GapProblem
from romdam.joints.unilateral import solve_unilateral

Floats = NDArray[np.float64]


@njit(cache=True)
def solve_gaps(
    problem: GapProblem,
    memory: GapMemory,
    closed: NDArray[np.bool_],
    w_free: Floats,
    y: Floats,
    control: tuple[float, bool],
) -> float:
    """Solve the gap-space problem of one step; the history is not moved.

    Parameters
    ----------
    problem, memory : see `romdam.joints.problem`; memory.force receives p_c
    closed : (n,) gaps that were closed at the step's start, the warm start
    w_free : (N,) jumps for no joint force, without the initial gap; overwritten [m]
    y : (N,) receives the problem's residual displacements [m]
    control : (relative tolerance, whether to give up as soon as a gap opens or closes)

    Returns
    -------
    float, the relative residual reached; above the tolerance means no convergence, inf that a gap
    opened or closed in a step that must not have it
    """
    tolerance, steady = control
    if not math.isfinite(w_free.sum()):  # comparisons with NaN are False: it would pass for converged
        return np.inf
    n = len(problem.gap)
    d = len(w_free) // max(n, 1)
    for i in range(n):
        w_free[d * i] += problem.gap[i]
    if len(problem.lift):
        w_free[:] = problem.lift @ w_free
    if d == 1:
        return solve_unilateral(problem, memory, closed, w_free, y, control)
    for i in range(n):
        w_free[3 * i + 1] -= memory.anchor[i, 0]
        w_free[3 * i + 2] -= memory.anchor[i, 1]
    residual = solve_frictional(problem.W, memory.limits, memory, w_free, y, tolerance)
    if steady and residual <= tolerance:
        for i in range(n):
            if (memory.force[3 * i] > 0.0) != closed[i]:
                return np.inf
    return residual


@njit(cache=True)
def commit_gaps(
    problem: GapProblem,
    memory: GapMemory,
    y: Floats,
    jump: Floats,
    force: Floats,
    state: NDArray[np.uint8],
) -> tuple[float, float]:
    """Accept a step: jumps, whole joint forces and states from the solution; move the anchors.

    The anchor of a gap moves by y_t, whatever its state: nothing while it sticks, the slip while it
    slides, and to the present jump while it is open.

    Parameters
    ----------
    jump : (n, d) receives opening (with the initial gap) and slip [m]
    force : (n, d) receives compression and shear on side J [N]
    state : (n,) receives OPEN, STICK or SLIP

    Returns
    -------
    (stored, friction) : energy stored in the gaps now and dissipated by sliding in the step [J]
    """
    n = len(problem.gap)
    d = len(y) // max(n, 1)
    stored, friction = 0.0, 0.0
    for i in range(n):
        b = d * i
        p_c = memory.force[b]
        jump[i, 0] = y[b] - problem.compliance[b] * p_c
        force[i, 0] = p_c - problem.tension[i] * jump[i, 0]
        stored += 0.5 * problem.compliance[b] * p_c**2 + 0.5 * problem.tension[i] * jump[i, 0] ** 2
        state[i] = STICK if p_c > 0.0 else OPEN
        slid = 0.0
        for a in range(1, d):
            t, y_t = memory.force[b + a], y[b + a]
            jump[i, a] = y_t + memory.anchor[i, a - 1] - problem.compliance[b + a] * t
            force[i, a] = t
            stored += 0.5 * problem.compliance[b + a] * t**2
            slid -= t * y_t
            memory.anchor[i, a - 1] += y_t
        if d == 3 and p_c > 0.0:
            friction += slid
            if _slides(problem.mu[i], p_c, memory.force[b + 1], memory.force[b + 2]):
                state[i] = SLIP
    return stored, friction


@njit(cache=True)
def _slides(mu: Floats, p_n: float, t_j: float, t_k: float) -> bool:
    """Whether a shear is on its friction limit (to round-off); never without friction."""
    limit_j, limit_k = (1.0 - 1e-9) * mu[0] * p_n, (1.0 - 1e-9) * mu[1] * p_n
    if mu[0] == mu[1]:
        return limit_j > 0.0 and t_j**2 + t_k**2 >= limit_j**2
    return (limit_j > 0.0 and abs(t_j) >= limit_j) or (limit_k > 0.0 and abs(t_k) >= limit_k)
