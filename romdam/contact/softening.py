"""Further joint laws within a step: the limits of the gap forces, the loss of strength, the memory.

**Loss of strength.** A step is solved with the present limits as if they were ductile. A gap that has
exceeded a strength (a bond opens or slides, static friction is overcome, the opening exceeds the depth of a
key) loses it (`release`), and the step is solved again until no gap loses any more. The loss enters the
history of the gap when the step is accepted (`commit_laws`).

**Limits that depend on the step.** A limit may depend on slip, slip rate, normal force and opening of the
step itself. The step is solved with fixed limits, which are then corrected until they agree with the solution
(`follow_step`). Newton corrects the shears T of all sliding gaps together. For fixed normal forces and
directions of slip a change dT changes the slips by -A dT, with A the part of W along these directions:

    T + dT = L - L' A dT,

where L is the limit at the present slip, and L' its slope with the slip. If a limit falls faster with the
slip than the gaps can unload, the step has several solutions, and Newton might find an unstable one. There L'
is set to zero: this fixed-point iteration converges to the next stable solution.

The functions take p_c, the unilateral part of the normal force, see `romdam.contact.problem`.
"""

from __future__ import annotations

import math

import numpy as np

from romdam.contact.components import SHEAR_J, SHEAR_K
from romdam.contact.cone import shear_limits, slides
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.compiled import FAILED, GAVE_UP
from romdam.contact.laws.law import (
    COHESION_J,
    DT,
    ENTRIES,
    MU_J,
    NORMAL_FORCE,
    OPENING,
    PULLED,
    RATE,
    SLIDING,
    SLIP_J,
    SLIP_K,
    STEP_ENTRIES,
    TENSION,
    WATER,
)
from romdam.contact.problem import COMMIT, LIMIT, RELEASE, GapMemory, GapProblem, Laws
from romdam.contact.solvers.newton import add_row, on_resultant
from romdam.core.arrays import Floats
from romdam.core.errors import ConvergenceError
from romdam.core.jit import ARRAYS, copy, njit
from romdam.core.system import SLIP

_NEARBY = 1e-4  # of the expected slip: distance of the finite difference for the slope of a limit
_STEEPEST = 0.5  # fall of a limit per fall of the shears that causes it, above which its slope is left out


@njit(cache=True)
def begin_step(laws: Laws | None, memory: GapMemory, w_free: Floats) -> None:
    """Begin the trial memory of a step from the history, and apply the dashpots to the free jumps.

    Parameters
    ----------
    w_free : (N,) jumps without joint force, changed in place; a dashpot acts from the last overlap on [m]
    """
    if laws is None:
        return
    copy(memory.history.reshape(memory.history.size), memory.trial.reshape(memory.trial.size))
    copy(memory.last_step.reshape(memory.last_step.size), memory.step.reshape(memory.step.size))
    for i in range(len(memory.step)):
        memory.step[i, DT] = 1.0 / laws.per_second.item() if laws.per_second.item() > 0.0 else 0.0
    d = len(w_free) // max(len(laws.dashpot_share), 1)
    for i in range(len(laws.dashpot_share)):
        w_free[d * i] -= laws.dashpot_share[i] * memory.spring[d * i]


@njit(cache=True, inline="always")
def put_limit(laws: Laws, history: Floats, i: int, step: Floats, limit: Floats) -> int:
    """Evaluate the limit of the force of gap i by all its laws.

    Parameters
    ----------
    history : (L, n, s) memory of the gaps
    step : (8,) state of the gap in the step, see `romdam.contact.laws.law`
    limit : (6,) receives the entries TENSION to WATER

    Returns
    -------
    int, the number from 1 of a law that fails; 0 if none does
    """
    for entry in range(len(limit)):
        limit[entry] = 0.0
    for k in range(len(laws.on)):
        if laws.on[k, i]:
            outcome = laws.functions.limit[k](laws.parameters[k, i], history[k, i], step, limit)
            if outcome == FAILED:
                return k + 1
    return 0


@njit(cache=True)
def _set_limits_of(laws: Laws, whole: Floats, memory: GapMemory, i: int, step: Floats) -> bool:
    """Set the limits of gap i for its state `step`, in terms of p_c; False if a law fails.

    Parameters
    ----------
    whole : (n,) normal force per p_c of a closed gap
    """
    limit, limits = memory.limit, memory.limits
    failed = put_limit(laws, memory.trial, i, step, limit)
    if failed > 0:
        memory.failure.law, memory.failure.function, memory.failure.gap = failed, LIMIT, i
        return False
    limits.tension[i], memory.water[i] = limit[TENSION] / whole[i], limit[WATER]
    for a in range(2):
        limits.mu[i, a] = max(limit[MU_J + a], 0.0) * whole[i]
        limits.cohesion[i, a] = max(limit[COHESION_J + a] - limits.mu[i, a] * limits.tension[i], 0.0)
    return True


@njit(cache=True)
def set_limits(laws: Laws | None, whole: Floats, memory: GapMemory) -> None:
    """Set the limits of all gaps for their present state `memory.step`, in terms of p_c.

    If a law fails, `memory.failure` names it.
    """
    if laws is None:
        return
    for i in range(len(whole)):
        if not _set_limits_of(laws, whole, memory, i, memory.step[i]):
            return


def put_limits(problem: GapProblem, memory: GapMemory) -> None:
    """Call `set_limits` from Python, unless the problem has no further laws: then nothing is compiled.

    Raises
    ------
    ConvergenceError
        if a law fails.
    """
    if problem.laws is not None:
        set_limits(problem.laws, problem.whole, memory)
        refuse_failed_law(problem, memory)


def refuse_failed_law(problem: GapProblem, memory: GapMemory) -> None:
    """Raise an error if a law has failed in the initial state.

    Raises
    ------
    ConvergenceError
        names the law, the gap and the reason.
    """
    if failed := failed_law(problem.laws, memory, f"gap {int(memory.failure.gap)}"):
        raise ConvergenceError(f"initial state: {failed}")


def failed_law(laws: Laws | None, memory: GapMemory, gap: str) -> str:
    """Write the message about a law that failed: which law, where and why; empty if none failed.

    Parameters
    ----------
    gap : that of `memory.failure`, as the message is to name it
    """
    failure = memory.failure
    if laws is None or failure.law == 0:
        return ""
    k, i = int(failure.law) - 1, int(failure.gap)
    law, name = laws.functions.limit[k].law, ("limit", "release", "commit")[int(failure.function)]
    parameters, trial = laws.parameters[k, i], memory.trial[k, i].copy()
    reason = "raises an exception, or gives NaN,"
    try:  # compiled functions lose the exception: call the function of the law again, in Python
        if name == "limit":
            law.limit(parameters, trial, memory.step[i].copy(), np.zeros(ENTRIES))
    except Exception as error:  # whatever a user's function raises
        reason = f"raises {type(error).__name__} ({error})"
    return (
        f"{name} of law {source_of(law).name} {reason} at {gap}, with parameters {parameters.tolist()} and "
        f"memory {trial.tolist()}; its functions must answer for every state of a gap"
    )


@njit(cache=True)
def bond_forces(
    laws: Laws | None, problem: GapProblem, memory: GapMemory, y_free: Floats, sign: float
) -> None:
    """Shift the problem so that bonds with tensile strength become unilateral (sign 1), or undo it (-1).

    A bond lets p_c fall to -tension. With p_c + tension as the unknown force the limit is zero again, and W
    times the tension is subtracted from the free jumps. Water adds the jumps that its force causes.

    Parameters
    ----------
    y_free : (N,) free jumps, changed in place [m]
    """
    if laws is None:
        return
    for i in range(len(problem.gap)):
        b, tension = len(y_free) // len(problem.gap) * i, memory.limits.tension[i]
        memory.force[b] += sign * tension
        if sign > 0.0:
            memory.force[b] = max(memory.force[b], 0.0)
        if tension > 0.0:
            add_row(problem.W[b], -sign * tension, y_free)
        if memory.water[i] != 0.0:  # moves the gap, but does not act on its spring: without compliance
            add_row(problem.W[b], sign * memory.water[i], y_free)
            y_free[b] -= sign * problem.compliance[b] * memory.water[i]


@njit(cache=True)
def observe_step(laws: Laws | None, problem: GapProblem, memory: GapMemory, y: Floats) -> None:
    """Write the state of every gap in the present solution to `memory.step`, which the laws read.

    Parameters
    ----------
    y : (N,) residual displacements of the solution [m]; its force is `memory.force`
    """
    if laws is None:
        return
    d = len(y) // max(len(problem.gap), 1)
    for i in range(len(problem.gap)):
        b, step = d * i, memory.step[i]
        p, step[SLIDING] = memory.force[b] + memory.limits.tension[i], 0.0
        step[SLIP_J], step[SLIP_K] = 0.0, 0.0
        if d == 3:
            limit_j, limit_k = shear_limits(memory.limits, i, p)
            if slides(limit_j, limit_k, memory.force[b + SHEAR_J], memory.force[b + SHEAR_K]):
                step[SLIDING] = 1.0
                if p > 0.0:
                    step[SLIP_J], step[SLIP_K] = y[b + SHEAR_J], y[b + SHEAR_K]
        step[OPENING] = (
            y[b] - problem.compliance[b] * memory.force[b] + laws.dashpot_share[i] * memory.spring[b]
        )
        step[NORMAL_FORCE] = problem.whole[i] * memory.force[b]
        step[RATE] = math.hypot(step[SLIP_J], step[SLIP_K]) * laws.per_second.item()
        step[PULLED] = 1.0 if p <= 0.0 and y[b] > 0.0 else 0.0


@njit(cache=True)
def release(laws: Laws | None, memory: GapMemory) -> int:
    """Remove the strength that gaps have exceeded in the solution of `memory.step`.

    Returns
    -------
    int, the number of gaps that lose strength
    """
    if laws is None:
        return 0
    count = 0
    for i in range(len(memory.step)):
        loses = False
        for k in range(len(laws.on)):
            if laws.on[k, i]:
                outcome = laws.functions.release[k](laws.parameters[k, i], memory.trial[k, i], memory.step[i])
                loses = loses or outcome == GAVE_UP
                if outcome == FAILED:
                    memory.failure.law, memory.failure.function, memory.failure.gap = k + 1, RELEASE, i
        count += int(loses)
    return count


@njit(cache=True, inline="always")
def _bounds(memory: GapMemory, i: int, p: float) -> tuple[float, float]:
    """Compute the limits of the shear of gap i along j and k, 0 if it is open [N]."""
    return shear_limits(memory.limits, i, p) if p > 0.0 else (0.0, 0.0)


@njit(**ARRAYS)
def follow_step(
    laws: Laws | None, problem: GapProblem, memory: GapMemory, tolerance: float, share: float
) -> float:
    """Correct the limits that depend on the step, from the solution in `memory.step`.

    If the limits of that solution differ from those with which it was computed by more than the tolerance,
    Newton's limits are set, see the module. Otherwise those of the solution are.

    Parameters
    ----------
    tolerance : change of a limit, relative to the largest force, that counts as none
    share : fraction of Newton's correction that is applied; below 1 it ends cycles

    Returns
    -------
    float, the largest change of a limit, relative to the largest force
    """
    if laws is None or not laws.follows_step.any():
        return 0.0
    n, limits, force = len(problem.gap), memory.limits, memory.force
    d = len(force) // max(n, 1)
    sliding, shear = np.empty(n, dtype=np.int64), np.empty(n)  # gaps that Newton corrects, and their |T|
    missing, slope = np.empty(n), np.empty(n)  # L - |T|, and L'
    count, worst, largest, nearby = 0, 0.0, 1e-300, np.empty(STEP_ENTRIES)
    for i in range(n):
        b, follows = d * i, False
        for k in range(len(laws.on)):
            follows = follows or (laws.follows_step[k] and laws.on[k, i])
        p = force[b] + limits.tension[i]
        largest = max(largest, abs(p))
        if not follows:
            continue
        used_j, used_k = _bounds(memory, i, p)
        tension, water = limits.tension[i], memory.water[i]
        if not _set_limits_of(laws, problem.whole, memory, i, memory.step[i]):
            return 0.0
        worst = max(worst, abs(limits.tension[i] - tension), abs(memory.water[i] - water))
        largest = max(largest, abs(water))
        if d == 1:
            continue
        bound_j, bound_k = _bounds(memory, i, p)
        bound, T = min(bound_j, bound_k), math.hypot(force[b + SHEAR_J], force[b + SHEAR_K])
        slip = math.hypot(memory.step[i, SLIP_J], memory.step[i, SLIP_K])
        disc = on_resultant(limits, i)
        if p <= 0.0 or not math.isfinite(bound) or T == 0.0 or (slip == 0.0 and bound >= T):
            continue  # open, unlimited, or stuck with the old limit and with the new one
        if not disc:  # a limit for each direction: the new ones are taken without Newton
            for new, used in ((bound_j, used_j), (bound_k, used_k)):
                if math.isfinite(new) or math.isfinite(used):
                    worst = max(worst, abs(new - used))
            continue
        worst = max(worst, abs(bound - T))
        A = _along(problem.W, force, i, i, T, T)
        move = _NEARBY * max(A * abs(bound - T), slip)
        copy(memory.step[i], nearby)
        for entry in (SLIP_J, SLIP_K):
            nearby[entry] = -(slip + move) * force[b + SHEAR_J + entry - SLIP_J] / T
        nearby[RATE] = (slip + move) * laws.per_second.item()
        if not _set_limits_of(laws, problem.whole, memory, i, nearby):
            return 0.0
        slope[count] = (min(_bounds(memory, i, p)) - bound) / move if move > 0.0 else 0.0
        _set_limits_of(laws, problem.whole, memory, i, memory.step[i])
        sliding[count], shear[count], missing[count] = i, T, bound - T
        count += 1
    if worst <= tolerance * largest:
        return worst / largest
    system = np.eye(count)
    for a in range(count):
        row = np.empty(count)
        for c in range(count):
            row[c] = slope[a] * _along(problem.W, force, sliding[a], sliding[c], shear[a], shear[c])
        if slope[a] >= 0.0 or np.abs(row).sum() <= _STEEPEST:
            system[a] += row
    change = np.linalg.solve(system, missing[:count])
    for a in range(count):
        i = sliding[a]
        p = force[3 * i] + limits.tension[i]
        bound = max(shear[a] + share * change[a], 0.0)
        for b in range(2):
            limits.mu[i, b] = max((bound - limits.cohesion[i, b]) / p, 0.0)
    return worst / largest


@njit(cache=True, inline="always")
def _along(W: Floats, force: Floats, i: int, k: int, shear_i: float, shear_k: float) -> float:
    """Compute an entry of A: displacement of gap i along its shear per shear of gap k [m/N].

    Parameters
    ----------
    shear_i, shear_k : |T| of both gaps, which divide the vectors `force` to directions [N]
    """
    total = 0.0
    for a in (SHEAR_J, SHEAR_K):
        for c in (SHEAR_J, SHEAR_K):
            total += force[3 * i + a] * W[3 * i + a, 3 * k + c] * force[3 * k + c]
    return total / (shear_i * shear_k)


@njit(cache=True)
def commit_laws(laws: Laws, memory: GapMemory, i: int, opening: float, state: int, force: float) -> bool:
    """Move the history of gap i at the end of an accepted step.

    Parameters
    ----------
    opening : at the end of the step [m]
    state : OPEN, STICK or SLIP
    force : normal force, positive in compression [N]

    Returns
    -------
    bool, whether the gap has lost strength in the step
    """
    has_lost, step = False, memory.last_step[i]
    copy(memory.step[i], step)
    step[OPENING], step[NORMAL_FORCE], step[SLIDING] = opening, force, 1.0 if state == SLIP else 0.0
    if state != SLIP:
        step[SLIP_J], step[SLIP_K], step[RATE] = 0.0, 0.0, 0.0
    for k in range(len(laws.on)):
        history, trial = memory.history[k, i], memory.trial[k, i]
        for entry in range(len(history)):
            has_lost = has_lost or (laws.strength[k] and history[entry] != trial[entry])
            history[entry] = trial[entry]
        if laws.on[k, i]:
            outcome = laws.functions.commit[k](laws.parameters[k, i], history, step)
            if outcome == FAILED:
                memory.failure.law, memory.failure.function, memory.failure.gap = k + 1, COMMIT, i
    return has_lost
