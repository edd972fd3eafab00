"""The hot loop: every mode propagated exactly, every gap implicit at the step's end.

Over one step the joint force p is constant and equal to its value at the step's end (DESIGN,
section 2; higher orders of the contact force blow up). Per step the work is three products, G q,
the gap-space solve and G^T p, beside the modes' own few flops.

The error of this scheme is made where contact changes: a gap that closes within a step is pushed over
the whole of it. So a step in which the closed set, or a joint force, changes much is accepted at the
finest level only; steps are cut by `RATIO` and grow again when contact has rested. They sit on a grid below
the base step, so the propagators and flexibilities of every level exist before the march. One level is the
fixed-step scheme. On the two-cantilever model the finest step sets the error (0.4 % at 0.000625 s, as for a
fixed step of that size) at a third of the steps and of the cost.

Strongly damped modes are not states. They answer the joint force as a flexibility R that relaxes with their
common time tau = c/k (stiffness-proportional damping gives beta to all): tau s' + s = p, u_r = R s.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from romdam.dynamics.arrays import RATIO, Control, Levels, ModalModel, ModalState, Track
from romdam.dynamics.propagator import Propagator
from romdam.joints.problem import GapMemory, GapProblem, Strength
from romdam.joints.step import commit_gaps, solve_gaps

Floats = NDArray[np.float64]

_MEAN_ITERATIONS = 50  # of the discrete gradient in a step that changes the closed set
_CALM = 1  # accepted steps without a change of the closed set before a longer one is tried


class Scratch(NamedTuple):
    """Vectors of the loop: modal forces, free displacement, joint force on the modes, gap vectors.

    `ends` (2, N) holds the added jumps at both ends of a base step, `shift` (N,) those at the step's end;
    both are empty where none are added.
    """

    f_0: Floats
    f_1: Floats
    f_end: Floats
    q_free: Floats
    r: Floats
    w: Floats
    y: Floats
    old_force: Floats
    ends: Floats
    shift: Floats


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def gap_jumps(model: ModalModel, q: Floats, w: Floats) -> None:
    """w = G q, block by block."""
    w[:] = 0.0
    for t in range(len(model.tiles)):
        r0, r1, c0, c1, start = model.tiles[t]
        width = c1 - c0
        part = q[c0:c1]
        for r in range(r0, r1):
            row = model.values[start + (r - r0) * width : start + (r - r0 + 1) * width]
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
        part = r[c0:c1]
        for g in range(r0, r1):
            force = p[g]
            if force != 0.0:
                row = model.values[start + (g - r0) * width : start + (g - r0 + 1) * width]
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
def _advance(step: Propagator, state: ModalState, x: Scratch) -> tuple[float, float, float]:
    """Move the modes to the step's end; work of external and joint force, and damping loss, in the step."""
    work, joint, loss = 0.0, 0.0, 0.0
    rate = 1.0 / step.dt
    moment, D = step.moment, step.loss
    for j in range(len(state.q)):
        q, v, f, f_1, r = state.q[j], state.v[j], state.f[j], x.f_1[j], x.r[j]
        F, s = f + r, (f_1 - f) * rate
        q_1 = x.q_free[j] + step.q_p[j] * r
        v_1 = step.v_q[j] * q + step.v_v[j] * v + step.v_0[j] * f + step.v_1[j] * f_1 + step.v_p[j] * r
        work += f * (q_1 - q) + s * (
            moment[0, j] * q + moment[1, j] * v + moment[2, j] * F + moment[3, j] * s
        )
        joint += r * (q_1 - q)
        loss += q * (D[0, j] * q + D[1, j] * v + D[2, j] * F + D[3, j] * s)
        loss += v * (D[4, j] * v + D[5, j] * F + D[6, j] * s)
        loss += F * (D[7, j] * F + D[8, j] * s) + D[9, j] * s * s
        state.q[j], state.v[j], state.f[j] = q_1, v_1, f_1
    return work, joint, loss


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _relax(
    model: ModalModel, state: ModalState, decay: float, p: Floats, goal: Floats
) -> tuple[float, float]:
    """Relax the residual flexibility towards a joint force; the force's work on it, and what it loses."""
    s, u_r, N = state.s, state.u_r, len(p)
    work, loss, size = 0.0, 0.0, 0.0
    for i in range(N):
        size = max(size, abs(s[i]), abs(p[i]))
    if size == 0.0:
        return 0.0, 0.0
    goal[:] = 0.0
    for i in range(N):
        f = p[i]
        if f != 0.0:
            row = model.R[i]
            for j in range(N):
                goal[j] += row[j] * f
    for i in range(N):
        new = decay * u_r[i] + (1.0 - decay) * goal[i]
        if model.conserving:
            work += 0.5 * (p[i] * new - s[i] * u_r[i])
        else:
            work += p[i] * (new - u_r[i])
            loss += 0.5 * (1.0 - decay * decay) * (p[i] - s[i]) * (goal[i] - u_r[i])
        u_r[i] = new
    size = 0.0
    for i in range(N):
        s[i] = decay * s[i] + (1.0 - decay) * p[i]
        size = max(size, abs(s[i]))
    if size < 1e-30:
        s[:] = 0.0
        u_r[:] = 0.0
    return work, loss


@njit(cache=True)
def _peak(track: Track, state: ModalState, time: float) -> None:
    for i in range(len(state.jump)):
        if state.jump[i, 0] > track.peaks[0, i]:
            track.peaks[0, i] = state.jump[i, 0]
            track.peaks[1, i] = time
        track.peaks[2, i] = max(track.peaks[2, i], state.force[i, 0])
        if state.jump.shape[1] == 3:
            slip = np.hypot(state.jump[i, 1], state.jump[i, 2])
            track.peaks[3, i] = max(track.peaks[3, i], slip)


@njit(cache=True)
def record_row(track: Track, state: ModalState, row: int) -> None:
    """Copy the state into a row of the track, and begin a new impulse."""
    track.q[row], track.v[row], track.s[row] = state.q, state.v, state.s
    track.jump[row], track.force[row], track.state[row] = state.jump, state.force, state.state
    track.impulse[row] = state.impulse
    state.impulse[:] = 0.0
    track.works[row], track.stored[row] = state.works, state.stored[0]


@njit(cache=True)
def _level(levels: Levels, l: int) -> tuple[Propagator, GapProblem, GapMemory]:
    """Views of one level."""
    s, p, m = levels.step, levels.problem, levels.memory
    step = Propagator(
        s.dt[l], s.q_q[l], s.q_v[l], s.v_q[l], s.v_v[l], s.q_0[l], s.q_1[l], s.v_0[l], s.v_1[l],
        s.q_p[l], s.v_p[l], s.moment[l], s.loss[l],
    )  # fmt: skip
    strength = Strength(
        p.strength.tension, p.strength.cohesion, p.strength.mu_static, p.strength.key, p.strength.dash[l]
    )
    problem = GapProblem(p.W[l], p.Z[l], p.lift[l], p.tension, p.compliance[l], p.mu, p.gap, strength)
    memory = GapMemory(
        m.force, m.anchor, m.active[l], m.inverse[l], m.order[l], m.counts[l], m.work,
        m.limits, m.weak, m.trial, m.overlap, m.worst,
    )  # fmt: skip
    return step, problem, memory


@njit(cache=True)
def _impulse(problem: GapProblem, memory: GapMemory, old_force: Floats, dt: float) -> float:
    """Largest gap velocity that the change of its normal force over the step stands for."""
    n = len(problem.gap)
    d = len(memory.force) // max(n, 1)
    worst = 0.0
    for i in range(n):
        b = d * i
        flexibility = problem.W[b, b] - problem.compliance[b]
        worst = max(worst, flexibility * abs(memory.force[b] - old_force[b]))
    return worst / dt


@njit(cache=True)
def _try_step(
    model: ModalModel, levels: Levels, control: Control, state: ModalState, x: Scratch, finest: bool
) -> tuple[bool, float]:
    """Solve one step of the present level to x.f_1; whether to accept it, and its gap residual."""
    l = state.level[0]
    step, problem, memory = _level(levels, l)
    _free_motion(step, state, x.f_1, x.q_free)
    gap_jumps(model, x.q_free, x.w)
    if len(model.R):
        for i in range(len(x.w)):
            x.w[i] += levels.decay[l] * state.u_r[i]
    for i in range(len(x.shift)):
        x.w[i] += x.shift[i]
    x.old_force[:] = memory.force
    residual = solve_gaps(problem, memory, state.closed, x.w, x.y, (control.tolerance, not finest))
    if not residual <= control.tolerance:
        memory.force[:] = x.old_force
        return False, residual
    if finest or _impulse(problem, memory, x.old_force, step.dt) <= control.impulse:
        return True, residual
    memory.force[:] = x.old_force
    return False, residual


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _add_product(A: Floats, p: Floats, scale: float, out: Floats) -> None:
    """out += scale A p for a symmetric A, skipping unloaded directions."""
    for i in range(len(p)):
        f = scale * p[i]
        if f != 0.0:
            row = A[i]
            for j in range(len(out)):
                out[j] += row[j] * f


@njit(cache=True)
def _elastic(model: ModalModel, problem: GapProblem, p_c: Floats, p: Floats, g: Floats) -> float:
    """Energy of the residual flexibility and of the gaps' springs."""
    d = len(p) // max(len(problem.gap), 1)
    energy = 0.0
    for i in range(len(p)):
        energy += 0.5 * problem.compliance[i] * p_c[i] ** 2
        if len(model.R) and p[i] != 0.0:
            row = model.R[i]
            for j in range(len(p)):
                energy += 0.5 * p[i] * row[j] * p[j]
    for i in range(len(problem.gap)):
        energy += 0.5 * problem.tension[i] * g[d * i] ** 2
    return energy


@njit(cache=True)
def _end_force(
    problem: GapProblem, memory: GapMemory, closed: NDArray[np.bool_], y: Floats, p: Floats, g: Floats
) -> bool:
    """Whole joint force and opening at the step's end; whether the closed set changed."""
    d = len(p) // max(len(problem.gap), 1)
    changed = False
    for i in range(len(p)):
        g[i] = y[i] - problem.compliance[i] * memory.force[i]
        p[i] = memory.force[i]
        if i % d == 0:
            p[i] -= problem.tension[i // d] * g[i]
            changed = changed or (memory.force[i] > 0.0) != closed[i // d]
    return changed


@njit(cache=True)
def _correction(missing: float, moved: Floats) -> Floats:
    """The force along the change of the jump that does the missing work."""
    size = moved @ moved
    return -(missing / size) * moved if size > 0.0 else np.zeros(len(moved))


@njit(cache=True)
def _try_conserving(
    model: ModalModel, levels: Levels, control: Control, state: ModalState, x: Scratch
) -> tuple[bool, float]:
    """Solve a step in which the joint force acts with a mean that does the work the gaps store.

    The mean is (p_0 + p_1) / 2, which is exact while the closed set stands still, and a multiple of the
    change of the states' jump on the loaded gaps where it does not (a discrete gradient).
    """
    step, problem, memory = _level(levels, 0)
    half, p_0 = levels.half[0], state.force.ravel()
    _free_motion(step, state, x.f_1, x.q_free)
    gap_jumps(model, x.q_free, x.w)
    before = _elastic(model, problem, memory.force, p_0, state.jump.ravel())
    correction, p_1, g_1 = np.zeros_like(p_0), np.zeros_like(p_0), np.zeros_like(p_0)
    x.old_force[:] = memory.force
    residual, w_1 = 0.0, x.w.copy()
    for _ in range(_MEAN_ITERATIONS):
        w = x.w.copy()
        for i in range(len(x.shift)):
            w[i] += x.shift[i]
        _add_product(half, p_0 + 2.0 * correction, 1.0, w)
        memory.force[:] = x.old_force
        residual = solve_gaps(problem, memory, state.closed, w, x.y, (control.tolerance, False))
        if not residual <= control.tolerance:
            memory.force[:] = x.old_force
            return False, residual
        changed = _end_force(problem, memory, state.closed, x.y, p_1, g_1)
        state.mean[:] = 0.5 * (p_0 + p_1) + correction
        w_1[:] = x.w
        _add_product(half, state.mean, 2.0, w_1)
        if not changed or len(p_0) > len(problem.gap):
            break
        moved = (w_1 - state.w) * ((p_0 != 0.0) | (p_1 != 0.0))
        missing = _elastic(model, problem, memory.force, p_1, g_1) - before + (0.5 * (p_0 + p_1)) @ moved
        new = _correction(missing, moved)
        if np.abs(new - correction).max() <= 1e-12 * np.abs(state.mean).max():
            break
        correction = new
    state.w[:] = w_1
    return True, residual


@njit(cache=True)
def _accept(model: ModalModel, levels: Levels, state: ModalState, x: Scratch) -> bool:
    """Commit a solved step: gaps, modes, residual flexibility, works; whether the closed set changed."""
    l = state.level[0]
    step, problem, memory = _level(levels, l)
    stored, friction = commit_gaps(problem, memory, x.y, state.jump, state.force, state.state)
    changed = False
    for i in range(len(state.closed)):
        closed = state.state[i] > 0
        changed = changed or closed != state.closed[i]
        state.closed[i] = closed
    p = state.force.ravel()
    if not model.conserving:
        state.mean[:] = p
    modal_force(model, state.mean, x.r)
    work, joint, loss = _advance(step, state, x)
    if len(model.R):
        joint_r, loss_r = _relax(model, state, levels.decay[l], p, x.w)
        joint += joint_r
        loss += loss_r
    state.works[0] += work
    state.works[1] += loss
    state.works[2] += joint
    state.works[3] += friction
    d = state.impulse.shape[1]
    for i in range(len(state.mean)):
        state.impulse[i // d, i % d] += step.dt * state.mean[i]
    state.stored[0] = stored
    return changed


@njit(cache=True)
def _base_step(
    model: ModalModel,
    levels: Levels,
    control: Control,
    state: ModalState,
    x: Scratch,
    track: Track,
    start: float,
) -> bool:
    """March over one base step from x.f_0 to x.f_end by steps of the levels' grid; False if it cannot."""
    finest = len(levels.decay) - 1
    calm, at, whole = 0, 0, RATIO**finest
    while at < whole:
        l = state.level[0]
        size = RATIO ** (finest - l)
        share = (at + size) / whole
        for j in range(len(x.f_1)):
            x.f_1[j] = x.f_0[j] + share * (x.f_end[j] - x.f_0[j])
        for i in range(len(x.shift)):
            x.shift[i] = x.ends[0, i] + share * (x.ends[1, i] - x.ends[0, i])
        if model.conserving:
            good, residual = _try_conserving(model, levels, control, state, x)
        else:
            good, residual = _try_step(model, levels, control, state, x, l == finest)
        if not good:
            state.counts[1] += 1
            if l == finest:
                state.counts[2] = residual
                return False
            state.level[0] = l + 1
            continue
        changed = _accept(model, levels, state, x)
        at += size
        state.counts[0] += 1
        state.counts[2] = max(state.counts[2], residual)
        _peak(track, state, start + levels.step.dt[0] * at / whole)
        calm = 0 if changed else calm + 1
        if l > 0 and calm >= _CALM and at % (RATIO * size) == 0:
            state.level[0] = l - 1
            calm = 0
    return True


@njit(cache=True)
def march(
    model: ModalModel,
    levels: Levels,
    control: Control,
    state: ModalState,
    ground: tuple[Floats, int, int],
    track: Track,
) -> int:
    """March from one base step to another.

    Parameters
    ----------
    model, levels, control : the modes, the step sizes, and when a step is fine enough
    state : changed in place
    ground : ((components, nt) ground acceleration at every base step [m/s2], first step, last step)
    track : receives rows and peaks

    Returns
    -------
    int, the last base step taken; short of the one asked for when the gap-space problem did not
        converge at the finest level (state.counts[2] then holds its residual)
    """
    acc, first, last = ground
    m, N, shifted = len(model.k), len(levels.memory.force), len(model.shift) > 0
    x = Scratch(
        np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m),
        np.empty(N), np.empty(N), np.empty(N), np.empty((2, N)), np.empty(N if shifted else 0),
    )  # fmt: skip
    _external(model, acc[:, first], x.f_end)
    for n in range(first, last):
        x.f_0[:] = x.f_end
        _external(model, acc[:, n + 1], x.f_end)
        if shifted:
            x.ends[:] = model.shift[n : n + 2]
        if not _base_step(model, levels, control, state, x, track, n * levels.step.dt[0]):
            return n
        if (n + 1) % track.stride == 0:
            record_row(track, state, (n + 1) // track.stride)
    return last
