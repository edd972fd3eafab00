"""The gap-space problem with friction, solved by nonsmooth Gauss-Seidel sweeps as long as they contract.

    y = W p + y_free;   y_n >= 0, p_n >= 0, y_n p_n = 0;   |t| <= c + mu p_n, y_t against t on the limit

A sweep visits the gaps in turn, moves the force of each as if the others were fixed, and projects it onto the
friction cone. Over a step that resolves the contact W is well conditioned, because inertia and not the
structure responds to a force within the step. Then ten sweeps or so suffice, and no states have to be
guessed, no matrix factored and no line searched.

The cost of a sweep is the time to read W from memory. Three measures reduce it. W is gathered on the gaps
that may carry force, and gaps are added to it as they close. It is kept in single precision: the sweeps move
the force away from one whose response is known exactly, and begin anew from there every four digits. Contacts
that have stuck for a long time are eliminated (`condensation`).

Where the sweeps do not contract, a step that can still be cut is given up, because its parts cost less than
Newton on the whole. Otherwise (statics, rigid joints of stiff blocks) Newton takes over (`newton`), and if
that fails the slower methods of `continuation` do.

References
----------
Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235: nonsmooth Gauss-Seidel.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from romdam.contact.components import ALONG_J, ALONG_K, NORMAL, SHEAR_J, SHEAR_K
from romdam.contact.cone import project_shear, shear_limits
from romdam.contact.problem import GapMemory, GapProblem, Limits
from romdam.contact.solvers.condensation import multiply, note_sticking, release_all, release_sliding
from romdam.contact.solvers.continuation import continue_from_no_friction
from romdam.contact.solvers.newton import natural_residuals, response, worst_gap
from romdam.contact.solvers.state import PUT_BACK, START, SWEPT, FrictionalState
from romdam.core.arrays import Floats, Singles
from romdam.core.jit import ARRAYS, copy, njit

_SWEEPS = 64  # about the cost of one dense Newton iteration
_WINDOW = 4  # sweeps between two looks at the contraction
_GAIN = 0.3  # the change of the force must fall to this over a window, or Newton is the shorter way
_SINGLE = 1e-4  # of the force's move, where sweeps in single precision begin anew from the exact response
_STALLED = 0.1  # of the residual before: single precision does not hold the condensed contacts
_TIGHTER = 0.1  # of the tolerance: what sweeps converge to
_IDLE = 0.25  # gathered gaps without force per gap with
_FEW = 0.25  # of all gaps, below which a product over the gathered ones alone is cheaper than over all
_SPENT, _CONVERGED, _SLOW, _CHANGED = 0, 1, 2, 3  # how a row of sweeps ends


@njit(cache=True)
def _wanted(limits: Limits, p: Floats, y: Floats, i: int) -> bool:
    """Tell whether gap i may carry force: it does, or overlaps, or has a shear limit without compression."""
    n = 3 * i + NORMAL
    return p[n] > 0.0 or y[n] < 0.0 or limits.cohesion[i, ALONG_J] > 0.0 or limits.cohesion[i, ALONG_K] > 0.0


@njit(cache=True)
def _gather(W: Floats, limits: Limits, solver: FrictionalState, p: Floats, y: Floats) -> int:
    """Bring W on the gaps that may carry force to the block of the sweeps; how many gaps it has.

    Gaps are added as they come. Those that no longer may carry force stay, until they are too many.
    """
    sweeps, sticking = solver.sweeps, solver.sticking
    order, gathered, counts = sweeps.order, sweeps.gathered, sweeps.counts
    condensed, wanted, idle = sticking.condensed, 0, 0
    for i in range(len(gathered)):
        if not condensed[i] and _wanted(limits, p, y, i):
            wanted += 1
        else:
            idle += int(gathered[i])
    if idle > _IDLE * wanted:
        counts.gathered = 0
        gathered[:] = False
    for i in range(len(gathered)):
        if not gathered[i] and not condensed[i] and _wanted(limits, p, y, i):
            order[counts.gathered] = i
            counts.gathered += 1
            gathered[i] = True
            if sticking.counts.number > 0:
                _add_gap(sticking.pivot, order[: counts.gathered], sweeps.block)
            else:
                _add_gap(W, order[: counts.gathered], sweeps.block)
    return counts.gathered


@njit(cache=True)
def _add_gap(W: Floats | Singles, order: NDArray[np.int64], block: Singles) -> None:
    """Bring the last gap's rows and columns of W, or of the condensed contacts' pivot, to the block."""
    last, i = 3 * (len(order) - 1), 3 * order[-1]
    for b in range(len(order)):
        k = 3 * order[b]
        for r in range(3):
            for c in range(3):
                block[last + r, 3 * b + c] = block[3 * b + c, last + r] = W[i + r, k + c]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _sweep(
    A: Singles,
    limits: Limits,
    order: NDArray[np.int64],
    p: Floats,
    y: Floats,
    x: Floats,
    y_moved: Singles,
) -> tuple[float, float]:
    """One projected Gauss-Seidel sweep over the gathered gaps.

    A gap whose force stays reads no row of A, and the sums of one that moves do not wait for each other: a
    sweep over the 94 gaps of configs/arch_dam.yaml takes 0.72 of the time that three products a gap take.

    Parameters
    ----------
    p, y : force and response of all gaps, from which the force has moved
    x, y_moved : (3 gathered,) force, and A times how far it has moved; changed in place

    Returns
    -------
    (change, share) : the largest change of a force, relative to the largest force and to the largest move
    """
    worst, size, far = 0.0, 1e-300, 1e-300
    for a in range(len(order)):
        b, g, i = 3 * a, 3 * order[a], order[a]
        n, j, k = b + NORMAL, b + SHEAR_J, b + SHEAR_K
        row_n, row_j, row_k = A[n], A[j], A[k]
        p_n = max(x[n] - (y_moved[n] + y[g + NORMAL]) / row_n[n], 0.0)
        y_j = y_moved[j] + y[g + SHEAR_J] + row_j[n] * (p_n - x[n])
        y_k = y_moved[k] + y[g + SHEAR_K] + row_k[n] * (p_n - x[n])
        limit_j, limit_k = shear_limits(limits, i, p_n)
        scale = 1.0 / max(row_j[j], row_k[k])  # one for both, or the disc would turn the shear
        t_j, t_k, _ = project_shear(x[j] - scale * y_j, x[k] - scale * y_k, limit_j, limit_k)
        size = max(size, p_n, abs(t_j), abs(t_k))
        far = max(far, abs(p_n - p[g + NORMAL]), abs(t_j - p[g + SHEAR_J]), abs(t_k - p[g + SHEAR_K]))
        change = max(abs(p_n - x[n]), abs(t_j - x[j]), abs(t_k - x[k]))
        if change == 0.0:
            continue
        worst = max(worst, change)
        d_n, d_j, d_k = np.float32(p_n - x[n]), np.float32(t_j - x[j]), np.float32(t_k - x[k])
        x[n], x[j], x[k] = p_n, t_j, t_k
        for c in range(len(y_moved)):
            y_moved[c] += d_n * row_n[c] + d_j * row_j[c] + d_k * row_k[c]
    return worst / size, worst / far


@njit(cache=True)
def _move(
    W: Floats,
    limits: Limits,
    solver: FrictionalState,
    p: Floats,
    start: Floats,
    y: Floats,
    done: int,
    change: float,
    goal: float,
    kept: NDArray[np.bool_],
) -> tuple[int, float, int]:
    """Move the force by sweeps from one whose response is known, as far as single precision goes.

    Parameters
    ----------
    p : the force, changed in place
    start, y : the same before, and its response
    done : sweeps done so far
    change : the last sweep's change, relative to the largest force
    goal : change that counts as converged
    kept : (n,) gaps closed before, where a step that opens or closes a gap is to be given up, else empty

    Returns
    -------
    (fate, change, sweeps) : SPENT, CONVERGED, SLOW or CHANGED; the last sweep's change; sweeps done
    """
    sweeps, sticking = solver.sweeps, solver.sticking
    count, rest = _gather(W, limits, solver, p, y), sweeps.scratch[PUT_BACK]
    order, x = sweeps.order[:count], sweeps.scratch[SWEPT, : 3 * count]
    y_moved = np.zeros(3 * count, dtype=np.float32)
    for b in range(3 * count):
        x[b] = p[3 * order[b // 3] + b % 3]
    z = np.zeros(
        len(y), dtype=np.float32
    )  # what puts the condensed gaps back, for the response of the others
    copy(y, rest)
    if sticking.counts.number > 0:
        for b in range(len(y)):
            if sticking.condensed[b // 3]:
                z[b] = -y[b]
        multiply(sticking.pivot, sweeps.gathered, z, rest)
    before, fate = np.inf, _SPENT
    while done < _SWEEPS:
        last = change
        change, share = _sweep(sweeps.block, limits, order, start, rest, x, y_moved)
        done += 1
        if done % _WINDOW == 0:
            fate = _SPENT if change <= _GAIN * before else _SLOW
            before = change
            for a in range(count if len(kept) else 0):
                if (x[3 * a + NORMAL] > 0.0) != kept[order[a]]:
                    return _CHANGED, change, done
        if change * change <= 0.5 * goal * (last - change):  # what all further sweeps would change
            fate = _CONVERGED
        if fate != _SPENT or share <= _SINGLE:
            break
    for b in range(3 * count):
        k = 3 * order[b // 3] + b % 3
        p[k], z[k] = x[b], x[b] - start[k]
    if sticking.counts.number > 0:
        multiply(sticking.pivot, sticking.condensed, z, p)
        release_sliding(limits, solver, p)
    return fate, change, done


@njit(cache=True)
def _sweeps(
    W: Floats,
    limits: Limits,
    memory: GapMemory,
    y_free: Floats,
    y: Floats,
    tolerance: float,
    kept: NDArray[np.bool_],
) -> float:
    """Sweep until the force converges, on gaps that are added as they close; natural residual of the forces.

    It is inf where they contract slowly and where a gap opens or closes that must not.

    Parameters
    ----------
    y : response of the force at hand, changed in place [m]
    tolerance : allowed natural residual, relative to the largest force
    kept : as in `_move`
    """
    p, solver = memory.force, memory.solver
    sweeps, sticking = solver.sweeps, solver.sticking
    goal, start, counts, few = (
        _TIGHTER * tolerance,
        sweeps.scratch[START],
        sweeps.counts,
        _FEW * len(limits.mu),
    )
    good, done, change, residual = False, 0, 1.0, np.inf
    while done < _SWEEPS:
        copy(p, start)
        condensed, last = sticking.counts.number, residual
        fate, change, done = _move(W, limits, solver, p, start, y, done, change, goal, kept)
        if fate == _CHANGED:
            return np.inf
        if fate == _SPENT and done < _SWEEPS and condensed == 0 and counts.gathered < few:
            # the gathered gaps carry all force: response at them alone, that of the others stays as it is
            order = sweeps.order[: counts.gathered]
            for a in range(len(order)):
                n, j, k = 3 * order[a] + NORMAL, 3 * order[a] + SHEAR_J, 3 * order[a] + SHEAR_K
                row_n, row_j, row_k = W[n], W[j], W[k]
                y_n, y_j, y_k = y_free[n], y_free[j], y_free[k]
                for b in range(len(order)):
                    for c in range(3 * order[b], 3 * order[b] + 3):
                        y_n += row_n[c] * p[c]
                        y_j += row_j[c] * p[c]
                        y_k += row_k[c] * p[c]
                y[n], y[j], y[k] = y_n, y_j, y_k
            continue
        response(W, p, y_free, y)
        _, residual = natural_residuals(W, limits, p, y)
        good = fate == _CONVERGED and residual <= goal
        if good or fate == _SLOW or not math.isfinite(residual):
            break
        if condensed > 0 and condensed == sticking.counts.number and residual > _STALLED * last:
            release_all(solver)
    counts.iterations += done
    counts.most_iterations = max(counts.most_iterations, done)
    return residual if good else np.inf


@njit(**ARRAYS)
def solve_frictional(
    problem: GapProblem,
    memory: GapMemory,
    closed: NDArray[np.bool_],
    y_free: Floats,
    y: Floats,
    tolerance: float,
    steady: bool,
) -> float:
    """Solve for the joint force; p goes to memory.force and W p + y_free to y.

    Parameters
    ----------
    problem, memory : see `romdam.contact.problem`; the memory's force is the warm start
    closed : (n,) gaps closed at the step's start
    y_free : (3 n,) [m]
    y : (3 n,) result [m]
    tolerance : allowed change of a force by its natural map, relative to the largest force
    steady : whether a step that opens or closes a gap is to be given up

    Returns
    -------
    float, the relative residual reached; above the tolerance means no convergence, inf a step given up
    """
    W, limits, p, solver = problem.W, memory.limits, memory.force, memory.solver
    kept = closed if steady else closed[:0]
    for i in range(len(limits.mu)):
        if not _wanted(limits, p, y_free, i):
            p[3 * i + SHEAR_J], p[3 * i + SHEAR_K] = 0.0, 0.0
    if solver.sticking.counts.number > 0:
        release_sliding(limits, solver, p)
    sweeps = solver.sweeps
    known = sweeps.counts.known  # is the force still that of the last solution, whose W p is kept?
    for b in range(len(p)):
        known = known and p[b] == sweeps.force[b]
    if known:
        for b in range(len(p)):
            y[b] = sweeps.product[b] + y_free[b]
    else:
        response(W, p, y_free, y)
    residual = _sweeps(W, limits, memory, y_free, y, tolerance, kept)
    if len(kept) and not residual <= tolerance:
        return np.inf
    if not residual <= tolerance:
        sweeps.counts.newton_steps += 1
        residual = continue_from_no_friction(W, limits, memory, y_free, y, tolerance)
    if residual <= tolerance:
        for b in range(len(p)):
            sweeps.force[b], sweeps.product[b] = p[b], y[b] - y_free[b]
        sweeps.counts.known = True
        note_sticking(W, limits, solver, p)
    else:
        memory.failure.gap = worst_gap(W, limits, p, y)
    for i in range(len(kept)):
        if (p[3 * i + NORMAL] > 0.0) != kept[i]:
            return np.inf
    return residual
