"""The hot loop: every mode propagated exactly, every gap implicit at the step's end.

Over one step the joint force p is constant and equal to its value at the step's end (DESIGN,
section 2; higher orders of the contact force blow up). Per step the work is three products, G q,
the gap-space solve and G^T p, beside the modes' own few flops.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from romdam.dynamics.propagator import Propagator
from romdam.joints.problem import GapMemory, GapProblem
from romdam.joints.step import commit_gaps, solve_gaps

Floats = NDArray[np.float64]


class ModalModel(NamedTuple):
    """A diagonal system in arrays for the loop.

    Attributes
    ----------
    k, c : (m,) modal stiffness [1/s2] and damping [1/s]
    static : (m,) static force [N/sqrt(kg)]
    load : (components, m) inertia force per unit ground acceleration, negative sign included
    tiles : (nt, 5) row start and end, column start and end of each non-zero block of G, offset of its values
    values : G's blocks, row-major, one after another
    """

    k: Floats
    c: Floats
    static: Floats
    load: Floats
    tiles: NDArray[np.int64]
    values: Floats


class ModalState(NamedTuple):
    """State at the last accepted step; changed in place.

    Attributes
    ----------
    q, v : (m,) modal displacement and velocity
    f : (m,) external modal force
    jump, force : (n, d) of the gaps
    state : (n,) of the gaps
    works : (4,) see `romdam.dynamics.energy.ACCUMULATED` [J]
    stored : (1,) energy in the gaps [J]
    """

    q: Floats
    v: Floats
    f: Floats
    jump: Floats
    force: Floats
    state: NDArray[np.uint8]
    works: Floats
    stored: Floats


class Track(NamedTuple):
    """What is written: one row per kept step; peaks see every step.

    Attributes
    ----------
    stride : steps per row
    q, v : (rows, m)
    jump, force : (rows, n, d)
    state : (rows, n)
    works : (rows, 4)
    stored : (rows,)
    peaks : (4, n) largest opening, its step, largest compression, largest slip
    """

    stride: int
    q: Floats
    v: Floats
    jump: Floats
    force: Floats
    state: NDArray[np.uint8]
    works: Floats
    stored: Floats
    peaks: Floats


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def gap_jumps(model: ModalModel, q: Floats, w: Floats) -> None:
    """w = G q, block by block."""
    w[:] = 0.0
    for t in range(len(model.tiles)):
        r0, r1, c0, c1, start = model.tiles[t]
        width = c1 - c0
        for r in range(r0, r1):
            row = model.values[start + (r - r0) * width : start + (r - r0 + 1) * width]
            part = q[c0:c1]
            total = 0.0
            for j in range(width):
                total += row[j] * part[j]
            w[r] += total


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def modal_force(model: ModalModel, p: Floats, r: Floats) -> None:
    """r = G^T p, skipping unloaded gap directions."""
    r[:] = 0.0
    for t in range(len(model.tiles)):
        r0, r1, c0, c1, start = model.tiles[t]
        width = c1 - c0
        for g in range(r0, r1):
            force = p[g]
            if force != 0.0:
                row = model.values[start + (g - r0) * width : start + (g - r0 + 1) * width]
                part = r[c0:c1]
                for j in range(width):
                    part[j] += row[j] * force


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _external(model: ModalModel, acc: Floats, f: Floats) -> None:
    """External modal force at one instant."""
    f[:] = model.static
    for a in range(len(acc)):
        for j in range(len(f)):
            f[j] += model.load[a, j] * acc[a]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _free_motion(step: Propagator, state: ModalState, f_1: Floats, q_free: Floats) -> None:
    """Displacement at the step's end without joint force."""
    for j in range(len(q_free)):
        q_free[j] = (
            step.q_q[j] * state.q[j]
            + step.q_v[j] * state.v[j]
            + step.q_0[j] * state.f[j]
            + step.q_1[j] * f_1[j]
        )


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _advance(step: Propagator, state: ModalState, f_1: Floats, q_free: Floats, r: Floats) -> tuple[float, float]:
    """Move the modes to the step's end; work of the external force and damping loss in the step."""
    work, loss = 0.0, 0.0
    rate = 1.0 / step.dt
    moment, D = step.moment, step.loss
    for j in range(len(q_free)):
        q, v, f = state.q[j], state.v[j], state.f[j]
        F, s = f + r[j], (f_1[j] - f) * rate
        q_1 = q_free[j] + step.q_p[j] * r[j]
        v_1 = step.v_q[j] * q + step.v_v[j] * v + step.v_0[j] * f + step.v_1[j] * f_1[j] + step.v_p[j] * r[j]
        work += f * (q_1 - q) + s * (moment[0, j] * q + moment[1, j] * v + moment[2, j] * F + moment[3, j] * s)
        loss += q * (D[0, j] * q + D[1, j] * v + D[2, j] * F + D[3, j] * s)
        loss += v * (D[4, j] * v + D[5, j] * F + D[6, j] * s)
        loss += F * (D[7, j] * F + D[8, j] * s) + D[9, j] * s * s
        state.q[j], state.v[j], state.f[j] = q_1, v_1, f_1[j]
    return work, loss


@njit(cache=True)
def _joint_work(old: Floats, jump: Floats, force: Floats) -> float:
    """Work of the joint force on the blocks in the step: constant force times change of the jump."""
    work = 0.0
    for i in range(len(jump)):
        for a in range(jump.shape[1]):
            work += force[i, a] * (jump[i, a] - old[i, a])
    return work


@njit(cache=True)
def _peak(track: Track, state: ModalState, step: int) -> None:
    for i in range(len(state.jump)):
        if state.jump[i, 0] > track.peaks[0, i]:
            track.peaks[0, i] = state.jump[i, 0]
            track.peaks[1, i] = step
        track.peaks[2, i] = max(track.peaks[2, i], state.force[i, 0])
        if state.jump.shape[1] == 3:
            slip = np.hypot(state.jump[i, 1], state.jump[i, 2])
            track.peaks[3, i] = max(track.peaks[3, i], slip)


@njit(cache=True)
def record_row(track: Track, state: ModalState, row: int) -> None:
    """Copy the state into a row of the track."""
    track.q[row], track.v[row] = state.q, state.v
    track.jump[row], track.force[row], track.state[row] = state.jump, state.force, state.state
    track.works[row], track.stored[row] = state.works, state.stored[0]


@njit(cache=True)
def march(
    model: ModalModel,
    step: Propagator,
    gaps: tuple[GapProblem, GapMemory, float],
    state: ModalState,
    ground: tuple[Floats, int, int],
    track: Track,
) -> tuple[int, float]:
    """March from one step to another.

    Parameters
    ----------
    model, step : the modes and their exact step
    gaps : the gap-space problem, its memory, and the tolerance of its solution
    state : changed in place
    ground : ((components, nt) ground acceleration at every step [m/s2], first step, last step)
    track : receives rows and peaks

    Returns
    -------
    (step, residual) : the last step taken and the largest gap residual; short of the last step
        asked for when the gap-space problem of the next step did not converge
    """
    problem, memory, tolerance = gaps
    acc, first, last = ground
    m, N = len(model.k), len(memory.force)
    f_1, q_free, r = np.empty(m), np.empty(m), np.empty(m)
    w, y = np.empty(N), np.empty(N)
    old = np.empty_like(state.jump)
    worst = 0.0
    for n in range(first, last):
        _external(model, acc[:, n + 1], f_1)
        _free_motion(step, state, f_1, q_free)
        gap_jumps(model, q_free, w)
        residual = solve_gaps(problem, memory, w, y, tolerance)
        if not residual <= tolerance:
            return n, residual
        worst = max(worst, residual)
        old[:] = state.jump
        stored, friction = commit_gaps(problem, memory, y, state.jump, state.force, state.state)
        modal_force(model, state.force.ravel(), r)
        work, loss = _advance(step, state, f_1, q_free, r)
        state.works[0] += work
        state.works[1] += loss
        state.works[2] += _joint_work(old, state.jump, state.force)
        state.works[3] += friction
        state.stored[0] = stored
        _peak(track, state, n + 1)
        if (n + 1) % track.stride == 0:
            record_row(track, state, (n + 1) // track.stride)
    return last, worst
