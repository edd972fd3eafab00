"""Further laws of the gaps within a step: what bounds their force, what they lose, what they keep.

The limits of what is left are solved as if they were ductile; a gap that reaches a limit it cannot hold (a
bond opens or slides, static friction is overcome, a key's depth is exceeded) gives it up and the step is
solved again, until none gives up any more. What was lost is committed once per accepted step.

Limits may follow the slip, the rate of slip, the normal force and the opening of the step itself. Then it is
solved with limits that are held, and with new ones until they agree with the solution (`follow_step`). Newton
finds the shear of all sliding gaps together: with normal forces and directions held, a change of the shears
T moves the slips by -A T, A being W along the directions of sliding, and T + dT = L + L' (-A dT), L the limit
and L' its slope with the slip. Where limits fall faster than the gaps can follow, the step has more than one
solution and Newton's may be the unstable one; there the slope is left out, and limit after limit leads to
the next stable one.
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

_NEARBY = 1e-4  # of the slip to come: how far from it the slope of a limit is taken
_STEEPEST = 0.5  # fall of a limit per fall of the shears that brings it about, above which it is not Newton's


@njit(cache=True)
def begin_step(laws: Laws | None, memory: GapMemory, w_free: Floats) -> None:
    """Start from what the gaps keep; a dashpot acts from where the gap was."""
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
    """Put what bounds the force of gap i, which keeps `history` and is as `step` has it; the number of a law
    that fails, from 1.
    """
    for entry in range(len(limit)):
        limit[entry] = 0.0
    for k in range(len(laws.on)):
        if laws.on[k, i] and _call_limit(laws, k, i, history, step, limit) == FAILED:
            return k + 1
    return 0


@njit(cache=True, inline="always")
def _call_limit(laws: Laws, k: int, i: int, history: Floats, step: Floats, limit: Floats) -> int:
    return laws.functions.limit[k](laws.parameters[k, i], history[k, i], step, limit)


@njit(cache=True)
def _set_limits_of(laws: Laws, whole: Floats, memory: GapMemory, i: int, step: Floats) -> bool:
    """Put what bounds the force of gap i where it is as `step` has it, in terms of p_c; False where a law
    fails.
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
    """Put what bounds the gaps' force now, in terms of p_c."""
    if laws is None:
        return
    for i in range(len(whole)):
        if not _set_limits_of(laws, whole, memory, i, memory.step[i]):
            return


def put_limits(problem: GapProblem, memory: GapMemory) -> None:
    """`set_limits` from Python: nothing is compiled where there are no further laws.

    Raises
    ------
    ConvergenceError
        where a law fails.
    """
    if problem.laws is not None:
        set_limits(problem.laws, problem.whole, memory)
        refuse_failed_law(problem, memory)


def refuse_failed_law(problem: GapProblem, memory: GapMemory) -> None:
    """Raise where a law has failed.

    Raises
    ------
    ConvergenceError
        naming it.
    """
    if failed := failed_law(problem.laws, memory, f"gap {int(memory.failure.gap)}"):
        raise ConvergenceError(f"initial state: {failed}")


def failed_law(laws: Laws | None, memory: GapMemory, place: str) -> str:
    """Say which law failed, where and why; empty where none did.

    Parameters
    ----------
    place : the gap of `memory.failure`, for the message
    """
    failure = memory.failure
    if laws is None or failure.law == 0:
        return ""
    k, i = int(failure.law) - 1, int(failure.gap)
    law, name = laws.functions.limit[k].law, ("limit", "release", "commit")[int(failure.function)]
    row, kept = laws.parameters[k, i], memory.trial[k, i].copy()
    reason = "raises an exception, or gives NaN,"
    try:
        if name == "limit":
            law.limit(row, kept, memory.step[i].copy(), np.zeros(ENTRIES))
    except Exception as error:  # whatever a user's function raises
        reason = f"raises {type(error).__name__} ({error})"
    return (
        f"{name} of law {source_of(law).name} {reason} at {place}, with parameters {row.tolist()} and memory "
        f"{kept.tolist()}; its functions must answer for every state of a gap"
    )


@njit(cache=True)
def bond_forces(
    laws: Laws | None, problem: GapProblem, memory: GapMemory, y_free: Floats, sign: float
) -> None:
    """Count the force from the bonds' tension on, with the water's jumps (sign 1), or undo it (-1)."""
    if laws is None:
        return
    for i in range(len(problem.gap)):
        b, tension = len(y_free) // len(problem.gap) * i, memory.limits.tension[i]
        memory.force[b] += sign * tension
        if sign > 0.0:
            memory.force[b] = max(memory.force[b], 0.0)
        if tension > 0.0:
            add_row(problem.W[b], -sign * tension, y_free)
        if memory.water[i] != 0.0:  # moves the gap, but is not in its spring
            add_row(problem.W[b], sign * memory.water[i], y_free)
            y_free[b] -= sign * problem.compliance[b] * memory.water[i]


@njit(cache=True)
def observe_step(laws: Laws | None, problem: GapProblem, memory: GapMemory, y: Floats) -> None:
    """Note every gap as it is in this solution, for its laws (memory.force is p_c)."""
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
    """Let the gaps give up what they cannot hold in the solution that `memory.step` notes; how many do."""
    if laws is None:
        return 0
    given_up = 0
    for i in range(len(memory.step)):
        gives_up = False
        for k in range(len(laws.on)):
            if laws.on[k, i]:
                came = laws.functions.release[k](laws.parameters[k, i], memory.trial[k, i], memory.step[i])
                gives_up = gives_up or came == GAVE_UP
                if came == FAILED:
                    memory.failure.law, memory.failure.function, memory.failure.gap = k + 1, RELEASE, i
        given_up += int(gives_up)
    return given_up


@njit(cache=True, inline="always")
def _bounds(memory: GapMemory, i: int, p: float) -> tuple[float, float]:
    """Limits of the shear of gap i along j and k; 0 where it is open."""
    return shear_limits(memory.limits, i, p) if p > 0.0 else (0.0, 0.0)


@njit(**ARRAYS)
def follow_step(
    laws: Laws | None, problem: GapProblem, memory: GapMemory, tolerance: float, share: float
) -> float:
    """Put the limits of the solution that `memory.step` notes, or Newton's where it was solved with others.

    Parameters
    ----------
    tolerance : of the change of a limit, below which it was not solved with another
    share : of the change that is put; below 1 it leads out of a cycle

    Returns
    -------
    float, the largest change of a limit, relative to the largest force
    """
    if laws is None or not laws.follows_step.any():
        return 0.0
    n, limits, force = len(problem.gap), memory.limits, memory.force
    d = len(force) // max(n, 1)
    moving, shear = np.empty(n, dtype=np.int64), np.empty(n)
    missing, slope = np.empty(n), np.empty(n)
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
            continue  # open, held, or it sticks with the old limit and with the new one
        if not disc:  # along j and k each: the new limits are taken as they are
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
        rise = (min(_bounds(memory, i, p)) - bound) / move if move > 0.0 else 0.0
        _set_limits_of(laws, problem.whole, memory, i, memory.step[i])
        moving[count], shear[count], missing[count] = i, T, bound - T
        slope[count] = rise
        count += 1
    if worst <= tolerance * largest:
        return worst / largest
    system = np.eye(count)
    for a in range(count):
        row = np.empty(count)
        for c in range(count):
            row[c] = slope[a] * _along(problem.W, force, moving[a], moving[c], shear[a], shear[c])
        if slope[a] >= 0.0 or np.abs(row).sum() <= _STEEPEST:
            system[a] += row
    change = np.linalg.solve(system, missing[:count])
    for a in range(count):
        i = moving[a]
        p = force[3 * i] + limits.tension[i]
        bound = max(shear[a] + share * change[a], 0.0)
        for b in range(2):
            limits.mu[i, b] = max((bound - limits.cohesion[i, b]) / p, 0.0)
    return worst / largest


@njit(cache=True, inline="always")
def _along(W: Floats, force: Floats, i: int, k: int, of_i: float, of_k: float) -> float:
    """Slip of gap i against its shear per shear of gap k against its own, which are of_i and of_k [m/N]."""
    total = 0.0
    for a in (SHEAR_J, SHEAR_K):
        for c in (SHEAR_J, SHEAR_K):
            total += force[3 * i + a] * W[3 * i + a, 3 * k + c] * force[3 * k + c]
    return total / (of_i * of_k)


@njit(cache=True)
def commit_laws(laws: Laws, memory: GapMemory, i: int, opening: float, state: int, force: float) -> bool:
    """Move what gap i keeps, in an accepted step; whether it gave something up in it.

    Parameters
    ----------
    opening, state, force : at the step's end: opening [m], OPEN, STICK or SLIP, normal force [N]
    """
    given_up, step = False, memory.last_step[i]
    copy(memory.step[i], step)
    step[OPENING], step[NORMAL_FORCE], step[SLIDING] = opening, force, 1.0 if state == SLIP else 0.0
    if state != SLIP:
        step[SLIP_J], step[SLIP_K], step[RATE] = 0.0, 0.0, 0.0
    for k in range(len(laws.on)):
        kept, trial = memory.history[k, i], memory.trial[k, i]
        for entry in range(len(kept)):
            given_up = given_up or (laws.strength[k] and kept[entry] != trial[entry])
            kept[entry] = trial[entry]
        if laws.on[k, i]:
            came = laws.functions.commit[k](laws.parameters[k, i], kept, step)
            if came == FAILED:
                memory.failure.law, memory.failure.function, memory.failure.gap = k + 1, COMMIT, i
    return given_up
