"""One implicit step of all gaps: free jumps in, joint forces out, history committed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from romdam.contact.cone import OPEN, SLIP, STICK, project_shear, slides
from romdam.contact.problem import GapMemory, GapProblem, Laws
from romdam.contact.softening import begin_step, bond_forces, commit_laws, release, set_limits
from romdam.contact.solvers.gauss_seidel import solve_frictional
from romdam.contact.solvers.pivoting import solve_unilateral
from romdam.core.arrays import Floats
from romdam.core.jit import ARRAYS, copy, njit


@njit(**ARRAYS)
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
    problem, memory : see `romdam.contact.problem`; memory.force receives p_c
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
        copy(problem.lift @ w_free, w_free)
    for i in range(n if d == 3 else 0):
        w_free[3 * i + 1] -= memory.anchor[i, 0]
        w_free[3 * i + 2] -= memory.anchor[i, 1]
    for b in range(len(w_free)):
        w_free[b] += problem.lag[b] * memory.spring[b]
    begin_step(problem.laws, memory, w_free)
    while True:  # once, unless gaps lose strength
        set_limits(problem.laws, problem.whole, memory)
        bond_forces(problem.laws, problem, memory, w_free, 1.0)
        residual = _solve(problem.frictional, problem, memory, closed, w_free, y, control)
        bond_forces(problem.laws, problem, memory, w_free, -1.0)
        if not residual <= control[0] or release(problem.laws, problem, memory, y) == 0:
            return residual
        if control[1]:
            return np.inf


@njit(cache=True)
def _solve(
    frictional: bool | None,
    problem: GapProblem,
    memory: GapMemory,
    closed: NDArray[np.bool_],
    y_free: Floats,
    y: Floats,
    control: tuple[float, bool],
) -> float:
    """Solve for the present limits."""
    tolerance, steady = control
    if frictional is None:
        found = solve_unilateral(problem, memory, closed, y_free, y, control)
        if not found <= tolerance:
            memory.worst[0] = memory.work[2].argmin()
    else:
        kept = closed if steady else closed[:0]
        found = solve_frictional(problem.W, memory.limits, memory, y_free, y, (tolerance, kept))
    return found


@njit(cache=True)
def _energies(problem: GapProblem, dash: Floats, jump: Floats, force: Floats) -> Floats:
    """Energy in the springs of every gap, where some have strength [J]; force is the whole joint force."""
    n, d = jump.shape
    energy = np.zeros(n)
    for i in range(n):
        p_c, k = force[i, 0] + problem.tension[i] * jump[i, 0], problem.compliance[d * i]
        energy[i] = 0.5 * problem.tension[i] * jump[i, 0] ** 2 + 0.5 * k * p_c**2
        if dash[i] > 0.0:  # the dashpot's share of the force is no energy
            energy[i] += 0.5 * (1.0 - dash[i]) / k * min(jump[i, 0], 0.0) ** 2 - 0.5 * k * p_c**2
        for a in range(1, d):
            energy[i] += 0.5 * problem.compliance[d * i + a] * force[i, a] ** 2
    return energy


@njit(**ARRAYS)
def commit_gaps(
    problem: GapProblem,
    memory: GapMemory,
    y: Floats,
    jump: Floats,
    force: Floats,
    state: NDArray[np.uint8],
) -> tuple[float, float]:
    """Accept a step: jumps, whole joint forces and states at its end from the solution; move the anchors.

    The anchor of a gap moves by y_t, whatever its state: nothing while it sticks, the slip while it
    slides, and to the present jump while it is open. Where forces follow the springs within the step, it
    moves as far as leaves a deformation within the limit.

    Parameters
    ----------
    jump : (n, d) receives opening (with the initial gap) and slip [m]
    force : (n, d) receives compression and shear on side J at the step's end [N]
    state : (n,) receives OPEN, STICK or SLIP

    Returns
    -------
    (stored, lost) : energy stored in the gaps now, and taken in the step by sliding; in gaps that lost
        strength or have a dashpot, all that their force did not do as work [J]
    """
    return _commit(problem.laws, problem, memory, y, (jump, force, state))


@njit(cache=True)
def _commit(
    laws: Laws | None,
    problem: GapProblem,
    memory: GapMemory,
    y: Floats,
    gaps: tuple[Floats, Floats, NDArray[np.uint8]],
) -> tuple[float, float]:
    jump, force, state = gaps
    if laws is None:
        return _move(problem, memory, y, jump, force, state)
    n = len(problem.gap)
    before, old = _energies(problem, laws.dash, jump, force), jump.copy()
    for i in range(n):
        y[len(y) // n * i] += laws.dash[i] * memory.spring[len(y) // n * i]
    lost = _move(problem, memory, y, jump, force, state)[1]
    after = _energies(problem, laws.dash, jump, force)
    for i in range(n):
        p, slid, slip = memory.force[len(y) // n * i] + memory.limits.tension[i], 0.0, (0.0, 0.0)
        state[i] = OPEN if p <= 0.0 else max(state[i], STICK)
        for a in range(1, jump.shape[1]):
            slid -= force[i, a] * y[3 * i + a]
        if len(y) == 3 * n:
            slip = (y[3 * i + 1], y[3 * i + 2])
        if commit_laws(laws, memory, i, jump[i, 0], state[i] == SLIP, slip) or laws.dash[i] > 0.0:
            lost += before[i] - after[i] - slid - (force[i] * (jump[i] - old[i])).sum()
    return after.sum(), lost


@njit(cache=True)
def _move(
    problem: GapProblem,
    memory: GapMemory,
    y: Floats,
    jump: Floats,
    force: Floats,
    state: NDArray[np.uint8],
) -> tuple[float, float]:
    """Jumps, forces, states, springs and anchors; energy in the springs, and taken by sliding."""
    n = len(problem.gap)
    d = len(y) // max(n, 1)
    stored, lost = 0.0, 0.0
    for i in range(n):
        b = d * i
        p_c, lag, compliance = memory.force[b], problem.lag[b], problem.compliance[b]
        jump[i, 0] = y[b] - compliance * p_c - lag * memory.spring[b]
        memory.spring[b] = min(jump[i, 0], 0.0)
        if lag > 0.0:
            compliance /= 1.0 + lag
            p_c = -memory.spring[b] / compliance
        force[i, 0] = p_c - problem.tension[i] * jump[i, 0]
        stored += 0.5 * compliance * p_c**2 + 0.5 * problem.tension[i] * jump[i, 0] ** 2
        state[i] = STICK if p_c > 0.0 else OPEN
        if d == 3:
            p = min(p_c, memory.force[b]) + memory.limits.tension[i]
            limit_j = memory.limits.cohesion[i, 0] + memory.limits.mu[i, 0] * p
            limit_k = memory.limits.cohesion[i, 1] + memory.limits.mu[i, 1] * p
            held, slid = _shear(problem, memory, (y, jump, force), (limit_j, limit_k), i)
            stored += held
            lost += slid
            if p > 0.0 and slides(limit_j, limit_k, force[i, 1], force[i, 2]):
                state[i] = SLIP
    return stored, lost


@njit(cache=True, inline="always")
def _shear(
    problem: GapProblem,
    memory: GapMemory,
    vectors: tuple[Floats, Floats, Floats],
    limits: tuple[float, float],
    i: int,
) -> tuple[float, float]:
    """Slip, shear, springs and anchor of gap i; energy in its shear springs, and taken by sliding."""
    y, jump, force = vectors
    stored, slid, taken, lag = 0.0, 0.0, 0.0, problem.lag[3 * i + 1]
    compliance = problem.compliance[3 * i + 1] / (1.0 + lag)
    for a in range(2):
        b = 3 * i + 1 + a
        t, anchor, old = memory.force[b], memory.anchor[i, a], jump[i, 1 + a]
        jump[i, 1 + a] = y[b] + anchor - problem.compliance[b] * t - lag * memory.spring[b]
        force[i, 1 + a] = t
        if lag > 0.0:
            force[i, 1 + a] = (anchor - jump[i, 1 + a]) / compliance
            taken += 0.5 * memory.spring[b] ** 2 / compliance - t * (jump[i, 1 + a] - old)
    if lag > 0.0:
        force[i, 1], force[i, 2], _ = project_shear(force[i, 1], force[i, 2], limits[0], limits[1])
    for a in range(2):
        b = 3 * i + 1 + a
        strain = -compliance * force[i, 1 + a]
        moved = y[b] if lag == 0.0 else jump[i, 1 + a] - strain - memory.anchor[i, a]
        memory.spring[b] = strain
        memory.anchor[i, a] += moved
        stored += 0.5 * compliance * force[i, 1 + a] ** 2
        slid -= memory.force[b] * moved
    return stored, slid if lag == 0.0 else min(max(slid, 0.0), taken - stored)
