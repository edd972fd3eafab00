"""Further laws of the gaps within a step: what bounds their force, what they lose, what they keep.

The limits of what is left are solved as if they were ductile; a gap that reaches a limit it cannot hold (a
bond opens or slides, static friction is overcome, a key's depth is exceeded) gives it up and the step is
solved again, until none gives up any more. What was lost is committed once per accepted step.
"""

from __future__ import annotations

import numpy as np

from romdam.contact.components import ALONG_J, ALONG_K, SHEAR_J, SHEAR_K
from romdam.contact.cone import slides
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.compiled import FAILED, GAVE_UP
from romdam.contact.laws.law import COHESION_J, ENTRIES, MU_J, TENSION, WATER
from romdam.contact.problem import COMMIT, LIMIT, RELEASE, GapMemory, GapProblem, Laws
from romdam.contact.solvers.newton import add_row
from romdam.core.arrays import Floats
from romdam.core.errors import ConvergenceError
from romdam.core.jit import copy, njit


@njit(cache=True)
def begin_step(laws: Laws | None, memory: GapMemory, w_free: Floats) -> None:
    """Start from what the gaps keep; a dashpot acts from where the gap was."""
    if laws is None:
        return
    copy(memory.history.reshape(memory.history.size), memory.trial.reshape(memory.trial.size))
    d = len(w_free) // max(len(laws.dashpot_share), 1)
    for i in range(len(laws.dashpot_share)):
        w_free[d * i] -= laws.dashpot_share[i] * memory.spring[d * i]


@njit(cache=True, inline="always")
def put_limit(laws: Laws, history: Floats, i: int, limit: Floats) -> int:
    """Put what bounds the force of gap i, which keeps `history`; the number of a law that fails, from 1."""
    for entry in range(len(limit)):
        limit[entry] = 0.0
    for k in range(len(laws.on)):
        if laws.on[k, i] and laws.functions.limit[k](laws.parameters[k, i], history[k, i], limit) == FAILED:
            return k + 1
    return 0


@njit(cache=True)
def set_limits(laws: Laws | None, whole: Floats, memory: GapMemory) -> None:
    """Put what bounds the gaps' force now, in terms of p_c."""
    if laws is None:
        return
    limit, limits = memory.limit, memory.limits
    for i in range(len(whole)):
        failed = put_limit(laws, memory.trial, i, limit)
        if failed > 0:
            memory.failure.law, memory.failure.function, memory.failure.gap = failed, LIMIT, i
            return
        limits.tension[i], memory.water[i] = limit[TENSION] / whole[i], limit[WATER]
        for a in range(2):
            limits.mu[i, a] = max(limit[MU_J + a], 0.0) * whole[i]
            limits.cohesion[i, a] = max(limit[COHESION_J + a] - limits.mu[i, a] * limits.tension[i], 0.0)


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
            law.limit(row, kept, np.zeros(ENTRIES))
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
def release(laws: Laws | None, problem: GapProblem, memory: GapMemory, y: Floats) -> int:
    """Let the gaps give up what they cannot hold in this solution (memory.force is p_c); how many do."""
    if laws is None:
        return 0
    given_up, d = 0, len(y) // max(len(problem.gap), 1)
    for i in range(len(problem.gap)):
        b = d * i
        p, sliding, gives_up = memory.force[b] + memory.limits.tension[i], False, False
        if d == 3:
            limit_j = memory.limits.cohesion[i, ALONG_J] + memory.limits.mu[i, ALONG_J] * p
            limit_k = memory.limits.cohesion[i, ALONG_K] + memory.limits.mu[i, ALONG_K] * p
            sliding = slides(limit_j, limit_k, memory.force[b + SHEAR_J], memory.force[b + SHEAR_K])
        opening = y[b] - problem.compliance[b] * memory.force[b] + laws.dashpot_share[i] * memory.spring[b]
        pulled = p <= 0.0 and y[b] > 0.0
        for k in range(len(laws.on)):
            if laws.on[k, i]:
                came = laws.functions.release[k](
                    laws.parameters[k, i], memory.trial[k, i], opening, pulled, sliding
                )
                gives_up = gives_up or came == GAVE_UP
                if came == FAILED:
                    memory.failure.law, memory.failure.function, memory.failure.gap = k + 1, RELEASE, i
        given_up += int(gives_up)
    return given_up


@njit(cache=True)
def commit_laws(
    laws: Laws, memory: GapMemory, i: int, opening: float, sliding: bool, slip: tuple[float, float]
) -> bool:
    """Move what gap i keeps, in an accepted step with this slip [m]; whether it gave something up in it."""
    given_up, (slip_j, slip_k) = False, slip
    rate_j, rate_k = slip_j * laws.per_second.item(), slip_k * laws.per_second.item()
    for k in range(len(laws.on)):
        kept, trial = memory.history[k, i], memory.trial[k, i]
        for entry in range(len(kept)):
            given_up = given_up or (laws.strength[k] and kept[entry] != trial[entry])
            kept[entry] = trial[entry]
        if laws.on[k, i]:
            came = laws.functions.commit[k](laws.parameters[k, i], kept, opening, sliding, rate_j, rate_k)
            if came == FAILED:
                memory.failure.law, memory.failure.function, memory.failure.gap = k + 1, COMMIT, i
    return given_up
