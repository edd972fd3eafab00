"""Further joint laws within a step: the limits of the gap forces, the loss of strength, the memory.

**Loss of strength.** A step is solved with the present limits as if they were ductile. A gap that has
exceeded a strength (a bond opens or slides, static friction is overcome, the opening exceeds the depth of a
key) loses it (`release`), and the step is solved again until no gap loses any more. The loss enters the
history of the gap when the step is accepted (`commit_laws`).

**Limits that depend on the step.** A limit may depend on slip, slip rate, normal force and opening of the
step itself. The step is solved with fixed limits, which are then corrected until they agree with the solution
(`follow_step`). Newton corrects the shears of all sliding gaps, and the tensions of all that open against
one, together. With X these forces, L their limits at the present slips and openings, and L' the slopes of L
with these, a change dX changes slips and openings by -A dX, with A the part of W along these forces, and

    X + dX = L - L' A dX.

A gap that more tension would close takes what closes it and no more, and that is what the others answer.
Forces of other gaps are taken as fixed, or, if that does not converge soon, as what keeps them closed and
stuck. If a limit falls faster than the gaps can unload, the step has several solutions, and Newton might find
an unstable one. There L' is set to zero: this fixed-point iteration converges to the next stable solution.

The functions take p_c, the unilateral part of the normal force, see `romdam.contact.problem`.
"""

from __future__ import annotations

import math

import numpy as np

from romdam.contact.components import NORMAL, SHEAR_J, SHEAR_K
from romdam.contact.cone import shear_limits, slides
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.compiled import FAILED, GAVE_UP, call, call_limit, law_at
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
from romdam.contact.problem import COMMIT, LIMIT, RELEASE, GapMemory, GapProblem, Laws, Limits
from romdam.contact.solvers.newton import add_row, on_resultant
from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.errors import ConvergenceError
from romdam.core.jit import ARRAYS, copy, njit
from romdam.core.system import OPEN, SLIP

WITH_OPENING, WITH_SLIP = range(2)  # columns of the slopes of limits
STORED_ENERGY, DISSIPATED_ENERGY = range(2)  # columns of `Laws.energy`
_NEARBY = 1e-4  # of the expected slip: distance of the finite difference for the slope of a limit
_CLOSE = 1e-6  # of the crack's opening, or of what it is expected to become: the same for an opening
_REGULAR = 1e-12  # of the diagonal: gaps that determine each other share their force
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
            outcome = call_limit(laws.functions.limit[k], laws.parameters[k, i], history[k, i], step, limit)
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
    law, name = law_at(laws.functions.limit[k]), ("limit", "release", "commit")[int(failure.function)]
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
                outcome = call(
                    laws.functions.release[k], laws.parameters[k, i], memory.trial[k, i], memory.step[i]
                )
                loses = loses or outcome == GAVE_UP
                if outcome == FAILED:
                    memory.failure.law, memory.failure.function, memory.failure.gap = k + 1, RELEASE, i
        count += int(loses)
    return count


@njit(cache=True, inline="always")
def _bounds(memory: GapMemory, i: int, p: float) -> tuple[float, float]:
    """Compute the limits of the shear of gap i along j and k [N]."""
    return shear_limits(memory.limits, i, max(p, 0.0))


@njit(**ARRAYS)
def follow_step(
    laws: Laws | None,
    problem: GapProblem,
    memory: GapMemory,
    tolerance: float,
    share: float,
    coupled: bool,
    cautious: bool,
) -> float:
    """Correct the limits that depend on the step, from the solution in `memory.step`.

    If the limits of that solution differ from those with which it was computed by more than the tolerance,
    Newton's limits are set, see the module. Otherwise those with which it was computed stay.

    Parameters
    ----------
    tolerance : change of a limit, relative to the largest force, that counts as none
    share : fraction of Newton's correction that is applied; below 1 it ends cycles
    coupled : whether the forces of closed and of sticking gaps answer a change of the limits
    cautious : whether falling limits are followed only, and not anticipated: slower, without Newton's cycles

    Returns
    -------
    float, the largest change of a limit, relative to the largest force
    """
    if laws is None or not laws.follows_step.any():
        return 0.0
    n, limits, force = len(problem.gap), memory.limits, memory.force
    d = len(force) // max(n, 1)
    used = Limits(limits.cohesion.copy(), limits.mu.copy(), limits.tension.copy())
    # the limits that Newton corrects: of gap `of`, its tension (NORMAL) or its shear (SHEAR_J), the force X
    # along `heading`, L - X, and the slope of L with the opening and the slip of the gap
    of, kind = np.empty(2 * n, dtype=np.int64), np.empty(2 * n, dtype=np.int64)
    X, missing, slope, heading = np.empty(2 * n), np.empty(2 * n), np.zeros((2 * n, 2)), np.zeros((2 * n, d))
    closes = np.full(2 * n, np.inf)  # opening of what a tension pulls beyond its spring [m]
    tensions, corrected = 0, np.zeros((n, d), dtype=np.bool_)
    count, worst, largest, nearby = 0, 0.0, 1e-300, np.empty(STEP_ENTRIES)
    for i in range(n):
        b, follows = d * i, False
        for k in range(len(laws.on)):
            follows = follows or (laws.follows_step[k] and laws.on[k, i])
        p = force[b] + limits.tension[i]
        largest = max(largest, abs(p), abs(force[b]))
        if not follows:
            continue
        step, water = memory.step[i], memory.water[i]
        if not _set_limits_of(laws, problem.whole, memory, i, step):
            return 0.0
        tension = limits.tension[i]
        worst, largest = max(worst, abs(memory.water[i] - water)), max(largest, abs(water))
        pulled = step[PULLED] > 0.0 and (tension > 0.0 or used.tension[i] > 0.0)
        bound, T, slip, shears = 0.0, 0.0, 0.0, False
        if d == 3:
            used_j, used_k = shear_limits(used, i, max(p, 0.0))
            bound_j, bound_k = _bounds(memory, i, p)
            bound, T = min(bound_j, bound_k), math.hypot(force[b + SHEAR_J], force[b + SHEAR_K])
            slip = math.hypot(step[SLIP_J], step[SLIP_K])
            # not if it is open, unlimited, or stuck with the old limit and with the new one
            shears = math.isfinite(bound) and T > 0.0 and (slip > 0.0 or bound < T)
            if T == 0.0 and max(used_j, used_k) == 0.0 and math.isfinite(bound):  # it had no limit to reach
                worst = max(worst, bound)
            if shears and not on_resultant(limits, i):  # of two limits the new ones are taken without Newton
                shears = False
                for new, old in ((bound_j, used_j), (bound_k, used_k)):
                    if math.isfinite(new) or math.isfinite(old):
                        worst = max(worst, abs(new - old))
        first, crack = count, step[OPENING] + problem.compliance[b] * force[b]
        # it opens against its tension; or does not yet, with more tension than it can hold now
        if pulled or force[b] < -tension:
            of[count], kind[count], X[count] = i, NORMAL, used.tension[i] if pulled else -force[b]
            missing[count], heading[count, NORMAL] = tension - X[count], -1.0
            corrected[i, NORMAL] = True
            closes[count] = max(crack, 0.0) if pulled else np.inf
            count, tensions = count + 1, tensions + 1
        if shears:
            of[count], kind[count], X[count], missing[count] = i, SHEAR_J, T, bound - T
            heading[count, SHEAR_J], heading[count, SHEAR_K] = force[b + SHEAR_J] / T, force[b + SHEAR_K] / T
            corrected[i, SHEAR_J], corrected[i, SHEAR_K] = True, True
            count += 1
        for a in range(first, count):  # slopes with the opening, and with the slip
            along_slip = kind[a] == SHEAR_J
            A = _along(problem.W, i, i, heading[a], heading[a])
            move = _NEARBY * max(A * abs(missing[a]), slip)
            copy(step, nearby)
            if along_slip:
                for entry in (SLIP_J, SLIP_K):
                    nearby[entry] = -(slip + move) * heading[a, entry - SLIP_J + SHEAR_J]
                nearby[RATE] = (slip + move) * laws.per_second.item()
            else:
                move = _CLOSE * max(A * abs(missing[a]), crack)
                nearby[OPENING] += move
            if not _set_limits_of(laws, problem.whole, memory, i, nearby):
                return 0.0
            for c in range(first, count):
                new, at = limits.tension[i], tension
                if kind[c] == SHEAR_J:
                    new, at = min(_bounds(memory, i, p)), bound
                slope[c, WITH_SLIP if along_slip else WITH_OPENING] = (new - at) / move if move > 0.0 else 0.0
            # a steep secant makes much of round-off
            rise = 0.0 if along_slip else max(slope[a, WITH_OPENING], 0.0)
            worst = max(worst, abs(missing[a]) / (1.0 + rise * A))
        if first < count:
            _set_limits_of(laws, problem.whole, memory, i, step)
    if worst <= tolerance * largest:
        for i in range(n):
            limits.tension[i] = used.tension[i]
            limits.cohesion[i], limits.mu[i] = used.cohesion[i], used.mu[i]
        return worst / largest
    A = np.empty((count, count))
    for a in range(count):
        for c in range(count):
            A[a, c] = _along(problem.W, of[a], of[c], heading[a], heading[c])
    if coupled and tensions > 0:
        _answer_of_others(problem.W, memory, d, of[:count], heading[:count], corrected, A)
    change = _newton(
        slope[:count], A, of[:count], kind[:count], missing[:count], closes[:count], tensions > 0, cautious
    )
    for a in range(count):
        i = of[a]
        new = max(X[a] + share * change[a], 0.0)
        if kind[a] == NORMAL:
            limits.tension[i] = new
            continue
        p = max(force[d * i] + used.tension[i], 0.0)
        for b in range(2):
            if new < limits.cohesion[i, b] or p == 0.0:
                limits.cohesion[i, b], limits.mu[i, b] = new, 0.0
            else:
                limits.mu[i, b] = (new - limits.cohesion[i, b]) / p
    return worst / largest


@njit(cache=True)
def _newton(
    slope: Floats,
    A: Floats,
    of: Ints,
    kind: Ints,
    missing: Floats,
    closes: Floats,
    pulled: bool,
    cautious: bool,
) -> Floats:
    """Solve (I + L' A) dX = L - X; falling slopes are left out if the gaps cannot unload as fast.

    What more tension would close takes only what closes it, which is what others answer; its limit is L.

    Parameters
    ----------
    slope : (m, 2) of each limit with the opening and the slip of its gap [N/m]
    A : (m, m) jumps per force along the corrected forces [m/N]
    closes : (m,) crack of a gap that a tension pulls, infinite of others [m]
    pulled : whether tensions are among the limits: then the solution is stable if all pivots are positive
    cautious : whether falling slopes are left out in any case
    """
    count = len(missing)
    rows = np.zeros((count, count))
    for a in range(count):
        for c in range(count):
            if of[c] == of[a]:
                rows[a] += slope[a, WITH_SLIP if kind[c] == SHEAR_J else WITH_OPENING] * A[c]
    stable = not cautious
    if pulled and stable:
        left = rows + np.eye(count)
        for a in range(count):
            stable = stable and left[a, a] > 0.0
            for c in range(a + 1, count if stable else 0):
                left[c, a:] -= left[c, a] / left[a, a] * left[a, a:]
    system = np.eye(count)
    for a in range(count):
        rise = slope[a, WITH_SLIP if kind[a] == SHEAR_J else WITH_OPENING]
        if rise >= 0.0 or (stable if pulled or cautious else np.abs(rows[a]).sum() <= _STEEPEST):
            system[a] += rows[a]
    wanted, closed = missing.copy(), np.zeros(count, dtype=np.bool_)
    while True:
        change = np.linalg.solve(system, wanted)
        new = ~closed & (change > 0.0) & (A @ change > closes)
        if not new.any():
            return np.where(closed, missing, change)
        for a in range(count):
            if new[a]:
                closed[a], wanted[a], system[a] = True, closes[a] / A[a, a], A[a] / A[a, a]


@njit(cache=True)
def _answer_of_others(
    W: Floats, memory: GapMemory, d: int, of: Ints, heading: Floats, corrected: Bools, A: Floats
) -> None:
    """Take from A the jumps that closed and sticking gaps hold back, as far as they keep closed and stuck."""
    force, limits, n, m = memory.force, memory.limits, len(corrected), len(of)
    holds, number = np.empty(d * n, dtype=np.int64), 0
    for i in range(n):
        p = force[d * i] + limits.tension[i]
        for e in range(d):
            stuck = p > 0.0 if e == NORMAL else memory.step[i, SLIDING] == 0.0 and force[d * i + e] != 0.0
            if stuck and not corrected[i, e]:
                holds[number] = d * i + e
                number += 1
    if number == 0:
        return
    inner, across = np.empty((number, number)), np.empty((number, m))
    for a in range(number):
        for c in range(number):
            inner[a, c] = W[holds[a], holds[c]]
        inner[a, a] *= 1.0 + _REGULAR
        for c in range(m):
            across[a, c] = 0.0
            for e in range(d):
                across[a, c] += W[holds[a], d * of[c] + e] * heading[c, e]
    A -= across.T @ np.linalg.solve(inner, across)


@njit(cache=True, inline="always")
def _along(W: Floats, i: int, k: int, heading_i: Floats, heading_k: Floats) -> float:
    """Compute an entry of A: displacement of gap i along its heading per force of gap k along its [m/N]."""
    total, d = 0.0, 3 if len(heading_i) == 3 else 1
    for a in range(d):
        for c in range(d):
            if heading_i[a] != 0.0 and heading_k[c] != 0.0:
                total += heading_i[a] * W[d * i + a, d * k + c] * heading_k[c]
    return total


@njit(cache=True)
def law_energies(laws: Laws, memory: GapMemory, i: int) -> tuple[float, float]:
    """Energies of gap i that its laws keep in their memory: stored, and dissipated since the start [J]."""
    stored, dissipated = 0.0, 0.0
    for k in range(len(laws.on)):
        if laws.on[k, i] and laws.energy[k, STORED_ENERGY] >= 0:
            stored += memory.history[k, i, laws.energy[k, STORED_ENERGY]]
        if laws.on[k, i] and laws.energy[k, DISSIPATED_ENERGY] >= 0:
            dissipated += memory.history[k, i, laws.energy[k, DISSIPATED_ENERGY]]
    return stored, dissipated


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
    step[OPENING], step[NORMAL_FORCE] = opening, force
    if state != OPEN:  # an open gap slides as the solution had it: one that a bond pulls may have a limit
        step[SLIDING] = 1.0 if state == SLIP else 0.0
    if step[SLIDING] == 0.0:
        step[SLIP_J], step[SLIP_K], step[RATE] = 0.0, 0.0, 0.0
    for k in range(len(laws.on)):
        history, trial = memory.history[k, i], memory.trial[k, i]
        for entry in range(len(history)):
            has_lost = has_lost or (laws.strength[k] and history[entry] != trial[entry])
            history[entry] = trial[entry]
        if laws.on[k, i]:
            outcome = call(laws.functions.commit[k], laws.parameters[k, i], history, step)
            if outcome == FAILED:
                memory.failure.law, memory.failure.function, memory.failure.gap = k + 1, COMMIT, i
    return has_lost
