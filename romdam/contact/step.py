"""One implicit step of all gaps: free jumps in, joint forces out, history committed.

`solve_gaps` finds the force p_c of the problem y = W p_c + y_free of `romdam.contact.problem`, with

    y_free = (I + H D)^-1 (w_free + initial jump) - s + r e_0,

s the accumulated slip, r the theta ratio and e_0 the deformation of the springs at the step's start. The
bounds of the forces are fixed in one solution. It is repeated while bounds follow the step or gaps lose
strength (`romdam.contact.softening`).

`commit_gaps` takes an accepted solution apart. With c the compliance, which has the factor 1 + r in it, the
jumps at the step's end are

    w_n = y_n - c p_c - r e_0,      w_t = y_t + s - c t - r e_0.

Where r = 0 the force at the end is that of the solution, and the slip of the step is y_t. Where r > 0 the
solution's is the force within the step. The force at the end is that of the spring then, (1 + r) / c times
its deformation; in shear it is reduced to its bound, and the rest of the deformation is slip.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from romdam.contact.components import ALONG_J, ALONG_K, NORMAL, SHEAR_J, SHEAR_K
from romdam.contact.cone import project_shear, shear_limits, slides
from romdam.contact.problem import GapMemory, GapProblem, Laws
from romdam.contact.softening import (
    begin_step,
    bond_forces,
    commit_laws,
    follow_step,
    law_energies,
    observe_step,
    release,
    set_limits,
)
from romdam.contact.solvers.gauss_seidel import solve_frictional
from romdam.contact.solvers.pivoting import solve_unilateral
from romdam.contact.solvers.state import FrictionalState, PivotingState
from romdam.core.arrays import PLACE, Floats
from romdam.core.jit import ARRAYS, CALLED, VIEWS, copy, njit
from romdam.core.recorded import GapArrays
from romdam.core.system import OPEN, SLIP, STICK

# of a step whose limits follow it, see `follow_step`
_MOST_LIMITS = 120  # solutions, at most
_LOOSE = 3  # solutions after which the response of closed and sticking gaps counts too
_FEW_LIMITS = 20  # solutions after which corrections are halved, and a larger change of limits counts as none
_CAUTIOUS = 40  # solutions after which no falling limit is anticipated
_LIMIT_CHANGE, _LAST_LIMIT_CHANGE = 1e-11, 1e-3  # of the largest force: change that counts as none, then


@njit(**VIEWS)
def solve_gaps(
    problem: GapProblem,
    memory: GapMemory,
    closed: NDArray[np.bool_],
    w_free: Floats,
    y: Floats,
    tolerance: float,
    steady: bool,
) -> float:
    """Solve the gap-space problem of one step; the history is not moved.

    Parameters
    ----------
    problem, memory : see `romdam.contact.problem`; memory.force receives p_c
    closed : (n,) gaps that were closed at the step's start, the warm start
    w_free : (N,) jumps for no joint force, without the initial gap; overwritten [m]
    y : (N,) receives the problem's residual displacements [m]
    tolerance : allowed relative residual
    steady : whether to give up as soon as a gap opens or closes, or loses strength

    Returns
    -------
    float, the relative residual reached; above the tolerance means no convergence, inf that a step that must
    be steady is not, that a free jump is not finite, or that a law failed
    """
    for b in range(len(w_free)):
        if not math.isfinite(w_free[b]):  # comparisons with NaN are False: it would pass for converged
            return np.inf
    n = len(problem.gap)
    if n == 0:
        return 0.0
    if memory.failure.law > 0:
        return np.inf
    d = len(w_free) // n

    # w_free becomes y_free
    for i in range(n):
        w_free[d * i] += problem.gap[i]
    for i in range(len(problem.slip)):
        w_free[3 * i + SHEAR_J] += problem.slip[i, ALONG_J]
        w_free[3 * i + SHEAR_K] += problem.slip[i, ALONG_K]
    if len(problem.tension_transform):
        _transform(problem.tension_transform, w_free)
    for i in range(n if d == 3 else 0):
        w_free[3 * i + SHEAR_J] -= memory.accumulated_slip[i, ALONG_J]
        w_free[3 * i + SHEAR_K] -= memory.accumulated_slip[i, ALONG_K]
    for b in range(len(w_free)):
        w_free[b] += problem.theta_ratio[b] * memory.spring[b]
    begin_step(problem.laws, memory, w_free)

    for _ in range(memory.trial.size + 1):  # once, unless gaps give something up, each entry once at most
        set_limits(problem.laws, problem.whole, memory)
        if memory.failure.law > 0:
            return np.inf
        for solution in range(_MOST_LIMITS):  # one, unless limits follow the step
            bond_forces(problem.laws, problem, memory, w_free, 1.0)
            residual = _solve(problem, memory, closed, w_free, y, tolerance, steady)
            bond_forces(problem.laws, problem, memory, w_free, -1.0)
            if not residual <= tolerance:
                return residual
            observe_step(problem.laws, problem, memory, y)
            few = solution < _FEW_LIMITS
            enough = max(tolerance, _LIMIT_CHANGE) if few else _LAST_LIMIT_CHANGE
            cautious = solution >= _CAUTIOUS
            share = 1.0 if few or cautious else 0.5
            change = follow_step(problem.laws, problem, memory, enough, share, solution >= _LOOSE, cautious)
            if change <= enough:
                break
        if change > enough:
            return max(change, 2.0 * tolerance)
        if memory.failure.law > 0 or release(problem.laws, memory) == 0:
            return residual if memory.failure.law == 0 else np.inf
        if steady:
            return np.inf
    return np.inf


@njit(**ARRAYS)
def _transform(by: Floats, jumps: Floats) -> None:
    """jumps = by @ jumps, apart because the product makes an array."""
    copy(by @ jumps, jumps)


def _without_friction(
    problem: Any, memory: Any, closed: Any, y_free: Any, y: Any, tolerance: Any, steady: Any
) -> Any:
    """Solve by pivoting, which gets what it reads: each array more to pass is seven words at every step."""
    force, failure, solver = memory.force, memory.failure, memory.solver
    return solve_unilateral(
        problem.W, problem.Z, force, failure, solver, closed, y_free, y, tolerance, steady
    )


def _with_friction(
    problem: Any, memory: Any, closed: Any, y_free: Any, y: Any, tolerance: Any, steady: Any
) -> Any:
    return solve_frictional(problem, memory, closed, y_free, y, tolerance, steady)


_SOLVERS = {PivotingState: _without_friction, FrictionalState: _with_friction}


def _solve(problem: Any, memory: Any, closed: Any, y_free: Any, y: Any, tolerance: Any, steady: Any) -> Any:
    """Solve for the present limits, by the solver whose state the memory holds."""
    return _SOLVERS[type(memory.solver)](problem, memory, closed, y_free, y, tolerance, steady)


@overload(_solve, jit_options=CALLED)
def _compiled_solve(
    problem: Any, memory: Any, closed: Any, y_free: Any, y: Any, tolerance: Any, steady: Any
) -> Any:
    """Compile the solver that the type of the memory asks for, and no other."""
    return _SOLVERS[memory[memory.fields.index("solver")].instance_class]


@njit(cache=True)
def _energies(problem: GapProblem, dashpot_share: Floats, jump: Floats, force: Floats) -> Floats:
    """Energy in the springs of every gap (n,) [J], where gaps have further laws.

    Parameters
    ----------
    dashpot_share : (n,) share of the dashpot in the compression, of which the spring has the rest
    jump, force : (n, d) jumps [m] and whole joint forces, with those of the tension stiffness [N]
    """
    n, d = jump.shape
    energy = np.zeros(n)
    for i in range(n):
        p_c, k = force[i, NORMAL] + problem.tension[i] * jump[i, NORMAL], problem.compliance[d * i]
        energy[i] = 0.5 * problem.tension[i] * jump[i, NORMAL] ** 2 + 0.5 * k * p_c**2
        if dashpot_share[i] > 0.0:  # the dashpot's share of the force is no energy
            energy[i] += (
                0.5 * (1.0 - dashpot_share[i]) / k * min(jump[i, NORMAL], 0.0) ** 2 - 0.5 * k * p_c**2
            )
        for a in range(1, d):
            energy[i] += 0.5 * problem.compliance[d * i + a] * force[i, a] ** 2
    return energy


@njit(**VIEWS, forceinline=True)
def commit_gaps(
    problem: GapProblem, memory: GapMemory, y: Floats, gaps: GapArrays
) -> tuple[float, float, float]:
    """Accept a step: jumps, whole joint forces and states at its end from the solution; the slip is added up.

    The accumulated slip of a gap grows by y_t, whatever its state: nothing while it sticks, the slip while it
    slides, and to the present jump while it is open. Where forces follow the springs within the step, it
    moves as far as leaves a deformation within the limit.

    Parameters
    ----------
    gaps : moved to the step's end, but for `mean_traction`; what a gap dissipates in the step is added to its
        `dissipated_energy`

    Returns
    -------
    (stored, lost, water) : energy stored in the gaps now, and dissipated in the step by all of them; work in
        the step of the water that laws put into gaps [J]
    """
    return _commit(problem.laws, problem, memory, y, gaps)


@njit(cache=True, forceinline=True)
def _commit(
    laws: Laws | None, problem: GapProblem, memory: GapMemory, y: Floats, gaps: GapArrays
) -> tuple[float, float, float]:
    """Choose by the type of `laws`, so that without further laws none of their code is compiled."""
    if laws is not None:
        return _commit_with_laws(laws, problem, memory, y, gaps)
    stored, slid = _move(problem, memory, y, gaps)
    return stored, slid, 0.0


@njit(**ARRAYS)
def _commit_with_laws(
    laws: Laws, problem: GapProblem, memory: GapMemory, y: Floats, gaps: GapArrays
) -> tuple[float, float, float]:
    """Do as `commit_gaps` says, and move the memory of the further laws.

    A gap dissipates what its laws say, besides sliding. Where it has lost strength or has a dashpot, it
    dissipates all that its force did as work on it and that is not stored.
    """
    jump, force, state = gaps.jump, gaps.traction, gaps.state
    n = len(problem.gap)
    before, old = _energies(problem, laws.dashpot_share, jump, force), jump.copy()
    for i in range(n):  # `begin_step` has taken it off the free jumps
        y[len(y) // n * i] += laws.dashpot_share[i] * memory.spring[len(y) // n * i]
    lost = _move(problem, memory, y, gaps)[1]
    after, fed, kept = _energies(problem, laws.dashpot_share, jump, force), 0.0, 0.0
    for i in range(n):
        p, slid = memory.force[len(y) // n * i] + memory.limits.tension[i], 0.0
        state[i] = OPEN if p <= 0.0 else max(state[i], STICK)
        for a in range(1, jump.shape[1]):
            slid -= force[i, a] * y[3 * i + a]  # which `_move` has counted
        stored_before, more = law_energies(laws, memory, i)
        has_lost = commit_laws(laws, memory, i, jump[i, NORMAL], state[i], force[i, NORMAL])
        stored, dissipated = law_energies(laws, memory, i)
        more, kept = dissipated - more, kept + stored
        if has_lost or laws.dashpot_share[i] > 0.0:  # all that the gap's force did not do as work
            given = before[i] - after[i] + stored_before - stored
            more = given - slid - (force[i] * (jump[i] - old[i])).sum()
        lost += more
        gaps.dissipated_energy[i] += more
        gaps.water[i] = memory.water[i]
        fed += memory.water[i] * (jump[i, NORMAL] - old[i, NORMAL])
    return after.sum() + kept, lost, fed


@njit(cache=True, error_model="numpy", forceinline=True)
def _move(problem: GapProblem, memory: GapMemory, y: Floats, gaps: GapArrays) -> tuple[float, float]:
    """Move jumps, forces, states, springs and slip to the step's end by the equations of the module.

    Returns
    -------
    (stored, lost) : energy in the springs at the end, and dissipated by sliding in the step [J]
    """
    jump, force, state, n = gaps.jump, gaps.traction, gaps.state, len(problem.gap)
    d = len(y) // max(n, 1)
    stored, lost = 0.0, 0.0
    for i in range(n):
        b = PLACE(d * i)
        p_c, ratio, compliance = memory.force[b], problem.theta_ratio[b], problem.compliance[b]
        jump[i, NORMAL] = y[b] - compliance * p_c - ratio * memory.spring[b]
        memory.spring[b] = jump[i, NORMAL] if jump[i, NORMAL] < 0.0 else 0.0
        if ratio > 0.0:  # the force at the end is that of the spring
            p_c = 0.0
        if memory.spring[b] < 0.0 and ratio > 0.0:
            compliance /= 1.0 + ratio
            p_c = -memory.spring[b] / compliance
        force[i, NORMAL] = p_c - problem.tension[i] * jump[i, NORMAL]
        stored += 0.5 * compliance * p_c**2 + 0.5 * problem.tension[i] * jump[i, NORMAL] ** 2
        state[i] = STICK if p_c > 0.0 else OPEN
        if d == 3:
            # the shear is bounded by the compression within the step and by that at its end
            p = min(p_c, memory.force[b]) + memory.limits.tension[i]
            limit_j, limit_k = shear_limits(memory.limits, i, p)
            held, slid, taken, ratio = 0.0, 0.0, 0.0, problem.theta_ratio[3 * i + SHEAR_J]
            compliance = problem.compliance[3 * i + SHEAR_J] / (1.0 + ratio)
            for a in range(2):
                c = 3 * i + SHEAR_J + a
                t, rest, old = memory.force[c], memory.accumulated_slip[i, a], jump[i, SHEAR_J + a]
                jump[i, SHEAR_J + a] = y[c] + rest - problem.compliance[c] * t - ratio * memory.spring[c]
                force[i, SHEAR_J + a] = t
                if ratio > 0.0:
                    force[i, SHEAR_J + a] = (rest - jump[i, SHEAR_J + a]) / compliance
                    taken += 0.5 * memory.spring[c] ** 2 / compliance - t * (jump[i, SHEAR_J + a] - old)
            if ratio > 0.0:
                t_j, t_k, _ = project_shear(force[i, SHEAR_J], force[i, SHEAR_K], limit_j, limit_k)
                force[i, SHEAR_J], force[i, SHEAR_K] = t_j, t_k
            # stored energy `held`, and work of sliding `slid`: where r > 0 the latter is at most what the
            # springs had and took up in the step (`taken`) and do not hold
            for a in range(2):
                c = 3 * i + SHEAR_J + a
                strain = -compliance * force[i, SHEAR_J + a]
                moved = (
                    y[c] if ratio == 0.0 else jump[i, SHEAR_J + a] - strain - memory.accumulated_slip[i, a]
                )
                memory.spring[c] = strain
                memory.accumulated_slip[i, a] += moved
                held += 0.5 * compliance * force[i, SHEAR_J + a] ** 2
                slid -= memory.force[c] * moved
            if ratio > 0.0:
                slid = min(max(slid, 0.0), taken - held)
            stored += held
            lost += slid
            gaps.dissipated_energy[i] += slid
            if p > 0.0 and slides(limit_j, limit_k, force[i, SHEAR_J], force[i, SHEAR_K]):
                state[i] = SLIP
    return stored, lost
