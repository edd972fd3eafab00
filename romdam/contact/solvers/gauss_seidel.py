"""The gap-space problem with friction: Gauss-Seidel while it contracts, Newton where it does not.

    y = W p + y_free;   y_n >= 0, p_n >= 0, y_n p_n = 0;   |t| <= c + mu p_n, y_t against t on the limit

Over a step that resolves the contact W is far from singular (its condition is 5 at 0.0025 s and 2 at
0.000625 s on the two-cantilever model: inertia, not the structure, answers a force within the step), so
projected Gauss-Seidel over the loaded gaps gains a digit per sweep and a half and needs no states, no
factorisation and no line search: a step costs about 10 sweeps of (3 closed)^2 products. They wait for memory,
so W on the loaded gaps is kept in single precision, gaps are added to it as they close, and the sweeps move
the force from one whose exact response is known; every four digits they begin anew from there. Gaps that have
long been stuck are eliminated (`condensation`). Where sweeps do not contract, a step that can be cut is
given up, for its parts are cheaper than Newton on the whole; else (statics, rigid joints of stiff blocks)
Newton takes over (`newton`). Where that fails too, sweeps solve each gap exactly for the forces of the others
(`single_contact`), and at last the solution is followed from no friction, where it is unique, to all of it.

References
----------
Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235: nonsmooth Gauss-Seidel.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from romdam.contact.cone import project_shear
from romdam.contact.problem import GapMemory, Limits
from romdam.contact.solvers.condensation import (
    let_all_go,
    let_go_where_not_stuck,
    multiply,
    note_stuck,
    tableau,
)
from romdam.contact.solvers.newton import (
    add_row,
    natural_residual,
    natural_residuals,
    newton,
    response,
    worst_gap,
)
from romdam.contact.solvers.single_contact import solve_gap
from romdam.core.arrays import Floats, Singles
from romdam.core.jit import copy, njit

_SWEEPS = 64  # about the cost of one dense Newton iteration
_WINDOW = 4  # sweeps between two looks at the contraction
_GAIN = 0.3  # the change of the force must fall to this over a window, or Newton is the shorter way
_SINGLE = 1e-4  # of the force's move, where sweeps in single precision begin anew from the exact response
_STALLED = 0.1  # of the residual before: single precision does not hold the held gaps
_REST = 0.1  # of the tolerance
_IDLE = 0.25  # gathered gaps without force per gap with
_FEW = 0.25  # of all gaps, below which a product over the gathered ones alone is cheaper than over all
_SPENT, _RESTS, _SLOW, _CHANGED = 0, 1, 2, 3  # how a row of sweeps ends
_EXACT_SWEEPS = 200
_FIRST_SHARE, _LONGER, _LEAST_SHARE = 0.1, 1.5, 1e-4  # of the friction, in a continuation


@njit(cache=True)
def _wanted(limits: Limits, p: Floats, y: Floats, i: int) -> bool:
    """Whether gap i may carry force: it does, or it overlaps, or it has a shear limit without compression."""
    return p[3 * i] > 0.0 or y[3 * i] < 0.0 or limits.cohesion[i, 0] > 0.0 or limits.cohesion[i, 1] > 0.0


@njit(cache=True)
def _gather(W: Floats, limits: Limits, memory: GapMemory, p: Floats, y: Floats) -> int:
    """Bring W on the gaps that may carry force to the block of the sweeps; how many gaps it has.

    Gaps are added as they come. Those that no longer may carry force stay, until they are too many.
    """
    order, block, gathered = memory.order[0], _block(memory), memory.active[0]
    held, wanted, idle = memory.active[1], 0, 0
    for i in range(len(gathered)):
        if not held[i] and _wanted(limits, p, y, i):
            wanted += 1
        else:
            idle += int(gathered[i])
    if idle > _IDLE * wanted:
        memory.counts[0, 0] = 0
        gathered[:] = False
    for i in range(len(gathered)):
        if not gathered[i] and not held[i] and _wanted(limits, p, y, i):
            order[memory.counts[0, 0]] = i
            memory.counts[0, 0] += 1
            gathered[i] = True
            if memory.counts[1, 0] > 0:
                _add_gap(tableau(memory), order[: memory.counts[0, 0]], block)
            else:
                _add_gap(W, order[: memory.counts[0, 0]], block)
    return memory.counts[0, 0]


@njit(cache=True, inline="always")
def _block(memory: GapMemory) -> Singles:
    """The block of the sweeps, in single precision."""
    return memory.inverse[0].view(np.float32)


@njit(cache=True)
def _add_gap(W: Floats | Singles, order: NDArray[np.int64], block: Singles) -> None:
    """Bring the last gap's rows and columns of W, or of the held gaps' tableau, to the block."""
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
    start: tuple[Floats, Floats],
    x: Floats,
    moved: Singles,
) -> tuple[float, float]:
    """One projected Gauss-Seidel sweep over the gathered gaps.

    Parameters
    ----------
    start : force and response of all gaps, from which the force has moved
    x, moved : (3 gathered,) force, and how far it has moved; changed in place

    Returns
    -------
    (change, share) : the largest change of a force, relative to the largest force and to the largest move
    """
    p, y = start
    worst, size, far = 0.0, 1e-300, 1e-300
    for a in range(len(order)):
        b, k, i = 3 * a, 3 * order[a], order[a]
        row_n, row_j, row_k = A[b], A[b + 1], A[b + 2]
        sum_n, sum_j, sum_k = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for c in range(len(moved)):
            sum_n += row_n[c] * moved[c]
            sum_j += row_j[c] * moved[c]
            sum_k += row_k[c] * moved[c]
        p_n = max(x[b] - (sum_n + y[k]) / A[b, b], 0.0)
        y_j = sum_j + y[k + 1] + A[b + 1, b] * (p_n - x[b])
        y_k = sum_k + y[k + 2] + A[b + 2, b] * (p_n - x[b])
        limit_j = limits.cohesion[i, 0] + limits.mu[i, 0] * p_n
        limit_k = limits.cohesion[i, 1] + limits.mu[i, 1] * p_n
        scale = 1.0 / max(A[b + 1, b + 1], A[b + 2, b + 2])  # one for both, or the disc would turn the shear
        t_j, t_k, _ = project_shear(x[b + 1] - scale * y_j, x[b + 2] - scale * y_k, limit_j, limit_k)
        worst = max(worst, abs(p_n - x[b]), abs(t_j - x[b + 1]), abs(t_k - x[b + 2]))
        size = max(size, p_n, abs(t_j), abs(t_k))
        x[b], x[b + 1], x[b + 2] = p_n, t_j, t_k
        for r in range(3):
            moved[b + r] = x[b + r] - p[k + r]
            far = max(far, abs(x[b + r] - p[k + r]))
    return worst / size, worst / far


@njit(cache=True)
def _changed(order: NDArray[np.int64], x: Floats, kept: NDArray[np.bool_]) -> bool:
    """Whether a gathered gap is not closed as it was; never without `kept`."""
    if len(kept):
        for a in range(len(x) // 3):
            if (x[3 * a] > 0.0) != kept[order[a]]:
                return True
    return False


@njit(cache=True)
def _release(memory: GapMemory, y: Floats) -> Singles:
    """Response of the gathered gaps with the held ones back in place, to work[2]; what brings them there."""
    z, rest = np.zeros(len(y), dtype=np.float32), memory.work[2]
    copy(y, rest)
    if memory.counts[1, 0] > 0:
        for b in range(len(y)):
            if memory.active[1, b // 3]:
                z[b] = -y[b]
        multiply(tableau(memory), memory, False, z, rest)
    return z


@njit(cache=True)
def _move(
    W: Floats,
    limits: Limits,
    memory: GapMemory,
    start: tuple[Floats, Floats],
    so_far: tuple[int, float],
    control: tuple[float, NDArray[np.bool_]],
) -> tuple[int, float, int]:
    """Move the force by sweeps from one whose response is known, as far as single precision goes.

    Parameters
    ----------
    start : that force and its response
    so_far : sweeps done, and the last one's change
    control : (change that counts as rest, see `solve_frictional`)

    Returns
    -------
    (fate, change, sweeps) : SPENT, RESTS, SLOW or CHANGED; the last sweep's change; sweeps done
    """
    (done, change), (goal, kept), p = so_far, control, memory.force
    count = _gather(W, limits, memory, p, start[1])
    order, x, moved = memory.order[0, :count], memory.work[0, : 3 * count], np.zeros(3 * count, np.float32)
    for b in range(3 * count):
        x[b] = p[3 * order[b // 3] + b % 3]
    z = _release(memory, start[1])
    before, fate = np.inf, _SPENT
    while done < _SWEEPS:
        last = change
        change, share = _sweep(_block(memory), limits, order, (start[0], memory.work[2]), x, moved)
        done += 1
        if done % _WINDOW == 0:
            fate = _SPENT if change <= _GAIN * before else _SLOW
            before = change
            if _changed(order, x, kept):
                return _CHANGED, change, done
        if change * change <= 0.5 * goal * (last - change):  # what all further sweeps would change
            fate = _RESTS
        if fate != _SPENT or share <= _SINGLE:
            break
    for b in range(3 * count):
        k = 3 * order[b // 3] + b % 3
        p[k], z[k] = x[b], moved[b]
    if memory.counts[1, 0] > 0:
        multiply(tableau(memory), memory, True, z, p)
        let_go_where_not_stuck(limits, memory)
    return fate, change, done


@njit(cache=True)
def _respond(W: Floats, memory: GapMemory, y_free: Floats, y: Floats) -> None:
    """Response at the gathered gaps alone, which carry all force; those of the others stay as they are."""
    p, order = memory.force, memory.order[0, : memory.counts[0, 0]]
    for a in range(len(order)):
        i = 3 * order[a]
        row_n, row_j, row_k = W[i], W[i + 1], W[i + 2]
        y_n, y_j, y_k = y_free[i], y_free[i + 1], y_free[i + 2]
        for b in range(len(order)):
            for k in range(3 * order[b], 3 * order[b] + 3):
                y_n += row_n[k] * p[k]
                y_j += row_j[k] * p[k]
                y_k += row_k[k] * p[k]
        y[i], y[i + 1], y[i + 2] = y_n, y_j, y_k


@njit(cache=True)
def _first_response(W: Floats, memory: GapMemory, y_free: Floats, y: Floats) -> None:
    """y = W p + y_free, with W p of the last solution where the force is still that one."""
    p, (known, product) = memory.force, memory.known
    for b in range(len(p)):
        if p[b] != known[b]:
            response(W, p, y_free, y)
            return
    for b in range(len(p)):
        y[b] = product[b] + y_free[b]


@njit(cache=True)
def _remember(memory: GapMemory, y_free: Floats, y: Floats) -> None:
    """Keep W p of a solution, the force and its response."""
    p, (known, product) = memory.force, memory.known
    for b in range(len(p)):
        known[b], product[b] = p[b], y[b] - y_free[b]


@njit(cache=True)
def _sweeps(
    W: Floats,
    limits: Limits,
    memory: GapMemory,
    y_free: Floats,
    y: Floats,
    control: tuple[float, NDArray[np.bool_]],
) -> float:
    """Sweep until the force rests, on a set of gaps that grows as they close; natural residual of the forces.

    It is inf where they contract slowly and where a gap opens or closes that must not.

    Parameters
    ----------
    y, control : response of the force at hand, changed in place [m]; see `solve_frictional`
    """
    goal, p, base = _REST * control[0], memory.force, memory.work[1]
    good, done, change, residual = False, 0, 1.0, np.inf
    while done < _SWEEPS:
        copy(p, base)
        held, last = memory.counts[1, 0], residual
        fate, change, done = _move(W, limits, memory, (base, y), (done, change), (goal, control[1]))
        if fate == _CHANGED:
            return np.inf
        if fate == _SPENT and done < _SWEEPS and held == 0 and memory.counts[0, 0] < _FEW * len(limits.mu):
            _respond(W, memory, y_free, y)
            continue
        response(W, p, y_free, y)
        residual = natural_residuals(W, limits, p, y)[1]
        good = fate == _RESTS and residual <= goal
        if good or fate == _SLOW or not math.isfinite(residual):
            break
        if held > 0 and held == memory.counts[1, 0] and residual > _STALLED * last:
            let_all_go(memory)
    memory.counts[0, 2] += done
    memory.counts[0, 3] = max(memory.counts[0, 3], done)
    return residual if good else np.inf


@njit(cache=True)
def _exact_sweeps(
    W: Floats, limits: Limits, memory: GapMemory, y_free: Floats, y: Floats, tolerance: float
) -> float:
    """Gauss-Seidel over all gaps, each solved exactly; natural residual reached."""
    p, residual = memory.force, np.inf
    new, rest = np.empty(3), np.empty(3)
    for k in range(len(p)):
        if not math.isfinite(p[k]):
            p[k] = 0.0
    response(W, p, y_free, y)
    for sweep in range(_EXACT_SWEEPS):
        for i in range(len(limits.mu)):
            b = 3 * i
            for r in range(3):
                new[r], rest[r] = p[b + r], y[b + r]
                for c in range(3):
                    rest[r] -= W[b + r, b + c] * p[b + c]
            if solve_gap(W[b : b + 3, b : b + 3], rest, limits.cohesion[i], limits.mu[i], new):
                for r in range(3):
                    add_row(W[b + r], new[r] - p[b + r], y)
                    p[b + r] = new[r]
        memory.counts[0, 2] += 1
        if sweep % _WINDOW == _WINDOW - 1:
            response(W, p, y_free, y)
            residual = natural_residual(W, limits, p, y)
            if residual <= tolerance or not math.isfinite(residual):
                break
    return residual


@njit(cache=True, inline="always")
def _rescue(
    W: Floats,
    limits: Limits,
    memory: GapMemory,
    y_free: Floats,
    y: Floats,
    control: tuple[float, NDArray[np.bool_]],
) -> float:
    """Newton, then exact sweeps, and where both fail by parts from no friction to all; residual reached."""
    tolerance, kept = control
    share, part, step = 0.0, 1.0, 2.0 * _FIRST_SHARE
    found = np.zeros_like(y)
    while True:
        mu = part * limits.mu
        eased = Limits(limits.cohesion, mu, limits.tension)
        residual = newton(W, eased, memory, y_free, y, tolerance)
        if not residual <= tolerance:
            residual = _exact_sweeps(W, eased, memory, y_free, y, tolerance)
        good = residual <= tolerance
        if (good and part == 1.0) or len(kept):
            return residual
        if good:
            share, step, found = part, _LONGER * step, memory.force.copy()
        else:
            step *= 0.5
        if step < _LEAST_SHARE:
            return residual
        part = min(share + step, 1.0)
        copy(found, memory.force)
        response(W, found, y_free, y)


@njit(cache=True)
def solve_frictional(
    W: Floats,
    limits: Limits,
    memory: GapMemory,
    y_free: Floats,
    y: Floats,
    control: tuple[float, NDArray[np.bool_]],
) -> float:
    """Solve for the joint force; p goes to memory.force and W p + y_free to y.

    Parameters
    ----------
    W : (3 n, 3 n), see `romdam.contact.problem`
    limits : shear limits of the gaps
    memory : its force is the warm start
    y_free : (3 n,) [m]
    y : (3 n,) result [m]
    control : (tolerance, closed): allowed change of a force by its natural map, relative to the largest
        force; (n,) gaps closed before, where a step that opens or closes one is to be given up, else empty

    Returns
    -------
    float, the relative residual reached; above the tolerance means no convergence, inf a step given up
    """
    tolerance, kept = control
    for i in range(len(limits.mu)):
        if not _wanted(limits, memory.force, y_free, i):
            memory.force[3 * i + 1], memory.force[3 * i + 2] = 0.0, 0.0
    if memory.counts[1, 0] > 0:
        let_go_where_not_stuck(limits, memory)
    _first_response(W, memory, y_free, y)
    residual = _sweeps(W, limits, memory, y_free, y, control)
    if len(kept) and not residual <= tolerance:
        return np.inf
    if not residual <= tolerance:
        memory.counts[0, 1] += 1
        residual = _rescue(W, limits, memory, y_free, y, control)
    if residual <= tolerance:
        _remember(memory, y_free, y)
        note_stuck(W, limits, memory)
    else:
        memory.worst[0] = worst_gap(W, limits, memory.force, y)
    for i in range(len(kept)):
        if (memory.force[3 * i] > 0.0) != kept[i]:
            return np.inf
    return residual
