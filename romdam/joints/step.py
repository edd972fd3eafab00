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
from romdam.joints.weakening import bonded_tension, opening, set_limits, settle, slides, weaken

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
    if not math.isfinite(w_free.sum()):  # comparisons with NaN are False: it would pass for converged
        return np.inf
    n = len(problem.gap)
    if n == 0:
        return 0.0
    d = len(w_free) // n
    for i in range(n):
        w_free[d * i] += problem.gap[i]
    if len(problem.lift):
        w_free[:] = problem.lift @ w_free
    for i in range(n if d == 3 else 0):
        w_free[3 * i + 1] -= memory.anchor[i, 0]
        w_free[3 * i + 2] -= memory.anchor[i, 1]
    if len(memory.trial) == 0:
        return _solve(problem, memory, closed, w_free, y, control)
    return _solve_weakening(problem, memory, closed, w_free, y, control)


@njit(cache=True)
def _solve(
    problem: GapProblem,
    memory: GapMemory,
    closed: NDArray[np.bool_],
    y_free: Floats,
    y: Floats,
    control: tuple[float, bool],
) -> float:
    """Solve for the present limits."""
    tolerance, steady = control
    n = len(problem.gap)
    if len(y) == n:
        return solve_unilateral(problem, memory, closed, y_free, y, control)
    residual = solve_frictional(problem.W, memory.limits, memory, y_free, y, tolerance)
    if steady and residual <= tolerance:
        for i in range(n):
            if (memory.force[3 * i] > 0.0) != closed[i]:
                return np.inf
    return residual


@njit(cache=True)
def _solve_weakening(
    problem: GapProblem,
    memory: GapMemory,
    closed: NDArray[np.bool_],
    y_free: Floats,
    y: Floats,
    control: tuple[float, bool],
) -> float:
    """Solve, and again with what the gaps have left, until none of them is weakened."""
    n = len(problem.gap)
    d = max(1, len(y) // max(n, 1))
    memory.trial[:] = memory.weak
    tension, shifted = np.zeros(n), np.empty(len(y))
    for i in range(n):
        y_free[d * i] -= problem.strength.dash[i] * memory.overlap[i]
    while True:
        set_limits(problem, memory)
        shifted[:] = y_free
        for i in range(n):
            tension[i] = bonded_tension(problem, memory, i)
            memory.force[d * i] = max(memory.force[d * i] + tension[i], 0.0)
            if tension[i] > 0.0:
                shifted -= tension[i] * problem.W[d * i]
        residual = _solve(problem, memory, closed, shifted, y, control)
        for i in range(n):
            memory.force[d * i] -= tension[i]
        if not residual <= control[0] or weaken(problem, memory, y) == 0:
            return residual
        if control[1]:
            return np.inf


@njit(cache=True)
def _energy(problem: GapProblem, i: int, jump: Floats, force: Floats) -> float:
    """Energy in the springs of one gap [J]; force is the whole joint force."""
    d = len(jump)
    p_c, k = force[0] + problem.tension[i] * jump[0], problem.compliance[d * i]
    energy = 0.5 * problem.tension[i] * jump[0] ** 2
    if len(problem.strength.dash) and problem.strength.dash[i] > 0.0:
        energy += 0.5 * (1.0 - problem.strength.dash[i]) / k * min(jump[0], 0.0) ** 2
    else:
        energy += 0.5 * k * p_c**2
    for a in range(1, d):
        energy += 0.5 * problem.compliance[d * i + a] * force[a] ** 2
    return energy


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
    (stored, lost) : energy stored in the gaps now, and taken in the step by sliding; in gaps that lost
        strength or have a dashpot, all that their force did not do as work [J]
    """
    n = len(problem.gap)
    d = len(y) // max(n, 1)
    stored, lost, strong = 0.0, 0.0, len(memory.weak) > 0
    old = np.empty(d)
    for i in range(n):
        b = d * i
        p_c, before = memory.force[b], 0.0
        if strong:
            before = _energy(problem, i, jump[i], force[i])
            old[:] = jump[i]
        jump[i, 0] = opening(problem, memory, y, i, d)
        force[i, 0] = p_c - problem.tension[i] * jump[i, 0]
        slid, p = 0.0, p_c + bonded_tension(problem, memory, i)
        for a in range(1, d):
            t, y_t = memory.force[b + a], y[b + a]
            jump[i, a] = y_t + memory.anchor[i, a - 1] - problem.compliance[b + a] * t
            force[i, a] = t
            slid -= t * y_t
            memory.anchor[i, a - 1] += y_t
        state[i] = STICK if p > 0.0 else OPEN
        if d == 3 and p > 0.0 and slides(memory.limits, i, p, force[i, 1], force[i, 2]):
            state[i] = SLIP
        after = _energy(problem, i, jump[i], force[i])
        if strong and (settle(problem, memory, i, state[i], jump[i, 0]) or problem.strength.dash[i] > 0.0):
            slid = before - after
            for a in range(d):
                slid -= force[i, a] * (jump[i, a] - old[a])
        stored += after
        lost += slid
    return stored, lost
