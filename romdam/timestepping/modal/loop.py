"""The hot loop: every mode propagated exactly, every gap implicit at the step's end.

Over one step the joint force p is constant; it follows the gaps' springs at a point within the step
(`romdam.contact.problem`) and rigid gaps at its end. Higher orders of the contact force blow up (DESIGN,
section 2). Per step the work is three products, G q, the gap-space solve and G^T p, beside the modes' own few
flops.

The error of this scheme is made where contact changes: a gap that closes within a step is pushed over
the whole of it. So a step in which the closed set, or a joint force, changes much is accepted at the
finest level only; steps are cut, level by level, and grow again when contact has rested. They sit on a grid
below the base step, so the propagators and flexibilities of every level exist before the march. One level is
the fixed-step scheme. On the two-cantilever model the finest step sets the error (0.3 % at 0.000625 s, as for
a fixed step of that size) at a third of the steps and of the cost.

Strongly damped modes are not states. They answer the joint force as a flexibility R that relaxes with their
common time tau = c/k (stiffness-proportional damping gives beta to all): tau s' + s = p, u_r = R s.

Many runs march together: in every round each takes its own next step, at its own time and level, exactly the
step it would take alone; only the products with G and R are made for all at once.
"""

from __future__ import annotations

import numpy as np

from romdam.contact.problem import GapMemory, GapProblem, Limits, Strength
from romdam.contact.step import commit_gaps, solve_gaps
from romdam.core.arrays import Floats
from romdam.core.jit import ARRAYS, VIEWS, copy, njit
from romdam.timestepping.modal.arrays import Levels, ModalModel, ModalState, Runs, Track, Work
from romdam.timestepping.modal.kernels import (
    advance,
    external_force,
    free_motion,
    gap_jumps,
    modal_forces,
    relax,
    residual_jumps,
)
from romdam.timestepping.modal.massless_boundary import try_conserving
from romdam.timestepping.modal.propagator import Propagator

_CALM = 1  # accepted steps without a change of the closed set before a longer one is tried


@njit(cache=True, inline="always")
def _state_of(x: ModalState, run: int) -> ModalState:
    """Views of one run's state."""
    return ModalState(
        x.q[run], x.v[run], x.f[run], x.s[run], x.u_r[run], x.jump[run], x.force[run], x.mean[run], x.w[run],
        x.state[run], x.closed[run], x.impulse[run], x.works[run], x.stored[run], x.counts[run], x.peaks[run],
    )  # fmt: skip


@njit(cache=True, inline="always")
def _step_of(levels: Levels, runs: Runs, run: int) -> Propagator:
    """Views of the step coefficients at a run's level."""
    s, i, l = levels.step, runs.variant[0, run], runs.clock[run, 2]
    return Propagator(
        s.dt[i, l], s.q_q[i, l], s.q_v[i, l], s.v_q[i, l], s.v_v[i, l], s.q_0[i, l], s.q_1[i, l],
        s.v_0[i, l], s.v_1[i, l], s.q_p[i, l], s.v_p[i, l], s.moment[i, l], s.loss[i, l],
    )  # fmt: skip


@njit(cache=True, inline="always")
def _gaps_of(levels: Levels, runs: Runs, run: int) -> tuple[GapProblem, GapMemory]:
    """Views of the gap-space problem at a run's level."""
    p, m, i, l = levels.problem, runs.memory, runs.variant[1, run], runs.clock[run, 2]
    x = p.strength
    strength = Strength(x.tension[i], x.cohesion[i], x.mu_static[i], x.key[i], x.dash[i, l])
    problem = GapProblem(
        p.W[i, l],
        p.Z[i, l],
        p.lift[i, l],
        p.tension[i],
        p.compliance[i, l],
        p.lag[i, l],
        p.own[i, l],
        p.mu[i],
        p.gap[i],
        strength,
        p.frictional,
    )
    limits = Limits(m.limits.cohesion[run], m.limits.mu[run], m.limits.tension[run])
    memory = GapMemory(
        m.force[run], m.anchor[run], m.active[run, l], m.inverse[run, l], m.order[run, l], m.counts[run, l],
        m.known[run, l], m.work, limits, m.weak[run], m.trial[run], m.spring[run], m.worst[run],
    )  # fmt: skip
    return problem, memory


@njit(cache=True)
def _peak(state: ModalState, time: float) -> None:
    peaks = state.peaks
    for i in range(len(state.jump)):
        if state.jump[i, 0] > peaks[0, i]:
            peaks[0, i] = state.jump[i, 0]
            peaks[1, i] = time
        peaks[2, i] = max(peaks[2, i], state.force[i, 0])
        if state.jump.shape[1] == 3:
            slip = np.sqrt(state.jump[i, 1] ** 2 + state.jump[i, 2] ** 2)
            peaks[3, i] = max(peaks[3, i], slip)


@njit(**ARRAYS)
def _record(track: Track, state: ModalState, row: int) -> None:
    """Copy the state into a row of the track, and begin a new impulse."""
    copy(state.q, track.q[row])
    copy(state.v, track.v[row])
    copy(state.s, track.s[row])
    copy(state.jump.ravel(), track.jump[row].ravel())
    copy(state.force.ravel(), track.force[row].ravel())
    copy(state.state, track.state[row])
    copy(state.impulse.ravel(), track.impulse[row].ravel())
    copy(state.works, track.works[row])
    state.impulse[:] = 0.0
    track.stored[row] = state.stored[0]


@njit(cache=True, inline="always")
def _impulse(problem: GapProblem, memory: GapMemory, old_force: Floats, dt: float) -> float:
    """Largest gap velocity that the change of its normal force over the step stands for."""
    n = len(problem.gap)
    d = len(memory.force) // max(n, 1)
    worst = 0.0
    for i in range(n):
        b = d * i
        worst = max(worst, problem.own[b] * abs(memory.force[b] - old_force[b]))
    return worst / dt


@njit(**ARRAYS)
def _open_base_step(model: ModalModel, runs: Runs, work: Work, run: int) -> None:
    """Bring the external force, and the added jumps, of both ends of a run's next base step."""
    n = runs.clock[run, 0]
    copy(work.f_end[run], work.f_0[run])
    external_force(model, runs.acc[:, runs.samples[run] + n + 1], work.f_end[run])
    if len(model.shift):
        copy(model.shift[n], work.ends[run, 0])
        copy(model.shift[n + 1], work.ends[run, 1])
    runs.clock[run, 1], runs.clock[run, 3] = 0, 0


@njit(cache=True, inline="always")
def _head_for(levels: Levels, runs: Runs, states: ModalState, work: Work, run: int) -> None:
    """Free motion of a run over its next step, to work.f_1 and work.q_free."""
    share = _reach(levels, runs, run)
    f_0, f_end, f_1 = work.f_0[run], work.f_end[run], work.f_1[run]
    for j in range(len(f_1)):
        f_1[j] = f_0[j] + share * (f_end[j] - f_0[j])
    free_motion(_step_of(levels, runs, run), _state_of(states, run), f_1, work.q_free[run])


@njit(cache=True, inline="always")
def _reach(levels: Levels, runs: Runs, run: int) -> float:
    """Where a run's next step ends within its base step, from 0 to 1."""
    return (runs.clock[run, 1] + levels.size[runs.clock[run, 2]]) / levels.size[0]


@njit(cache=True, inline="always")
def _try_step(
    model: ModalModel,
    levels: Levels,
    runs: Runs,
    state: ModalState,
    work: Work,
    run: int,
    tolerance: float,
) -> tuple[bool, float]:
    """Solve a run's next step; whether to accept it, and its gap residual."""
    l, finest = runs.clock[run, 2], levels.decay.shape[1] - 1
    problem, memory = _gaps_of(levels, runs, run)
    w, y, shift, old_force = work.w[run], work.y[run], work.shift[run], work.old_force[run]
    share, ends, variant = _reach(levels, runs, run), work.ends[run], runs.variant[0, run]
    for i in range(len(shift)):
        shift[i] = ends[0, i] + share * (ends[1, i] - ends[0, i])
    copy(memory.force, old_force)
    control = (tolerance, l < finest)
    if model.conserving is not None:
        half = levels.half[variant, l]
        residual = try_conserving(
            model.conserving, model, half, (problem, memory), state, (w, shift, y), control
        )
    else:
        if len(model.R):
            for i in range(len(w)):
                w[i] += levels.decay[variant, l] * state.u_r[i]
        for i in range(len(shift)):
            w[i] += shift[i]
        residual = solve_gaps(problem, memory, state.closed, w, y, control)
    good = residual <= tolerance
    if good and l < finest:
        good = _impulse(problem, memory, old_force, levels.step.dt[variant, l]) <= runs.impulse[run]
    if not good:
        copy(old_force, memory.force)
    return good, residual


@njit(cache=True, inline="always")
def _accept(model: ModalModel, levels: Levels, runs: Runs, state: ModalState, work: Work, run: int) -> None:
    """Commit the gaps of a solved step."""
    problem, memory = _gaps_of(levels, runs, run)
    stored, friction = commit_gaps(problem, memory, work.y[run], state.jump, state.force, state.state)
    changed, d = False, state.force.shape[1]
    for i in range(len(state.closed)):
        closed = memory.force[d * i] > -memory.limits.tension[i]
        changed = changed or closed != state.closed[i]
        state.closed[i] = closed
    if model.conserving is None:
        for b in range(len(state.mean)):
            state.mean[b] = memory.force[b]
        for i in range(len(problem.tension)):
            state.mean[d * i] -= problem.tension[i] * state.jump[i, 0]
    runs.clock[run, 3] = 0 if changed else runs.clock[run, 3] + 1
    state.works[3] += friction
    state.stored[0] = stored


@njit(cache=True, inline="always")
def _refuse(runs: Runs, state: ModalState, run: int, finest: int, residual: float) -> None:
    """Go a level down; at the finest the run has failed."""
    state.counts[1] += 1
    if runs.clock[run, 2] == finest:
        state.counts[2] = residual
        runs.failed[run] = True
    else:
        runs.clock[run, 2] += 1


@njit(cache=True, inline="always")
def _move(model: ModalModel, levels: Levels, runs: Runs, state: ModalState, work: Work, run: int) -> None:
    """Modes, residual flexibility, works and peaks of a run at the end of its accepted step."""
    step, l, variant = _step_of(levels, runs, run), runs.clock[run, 2], runs.variant[0, run]
    d, dt = state.impulse.shape[1], step.dt
    input_, joint, loss = advance(step, state, (work.f_1[run], work.r[run]), work.q_free[run])
    if len(model.R):
        joint_r, loss_r = relax(model, state, levels.decay[variant, l], work.w[run])
        joint += joint_r
        loss += loss_r
    state.works[0] += input_
    state.works[1] += loss
    state.works[2] += joint
    for i in range(len(state.impulse)):
        for a in range(d):
            state.impulse[i, a] += dt * state.mean[d * i + a]
    _peak(state, levels.step.dt[variant, 0] * (runs.clock[run, 0] + _reach(levels, runs, run)))


@njit(cache=True, inline="always")
def _tick(
    model: ModalModel, levels: Levels, runs: Runs, state: ModalState, work: Work, track: Track, run: int
) -> None:
    """Move a run's clock over its accepted step; write a row, choose the next level, open a base step."""
    clock, size = runs.clock[run], levels.size
    clock[1] += size[clock[2]]
    state.counts[0] += 1
    if clock[2] > 0 and clock[3] >= _CALM and clock[1] % size[clock[2] - 1] == 0:
        clock[2] -= 1
        clock[3] = 0
    if clock[1] < size[0]:
        return
    clock[0] += 1
    if clock[0] % track.stride == 0:
        _record(track, state, runs.rows[run] + clock[0] // track.stride)
    if clock[0] < runs.last[run]:
        _open_base_step(model, runs, work, run)


@njit(cache=True, inline="always")
def _under_way(runs: Runs, work: Work) -> int:
    """Put the runs that are neither done nor failed to work.underway; how many they are."""
    count = 0
    for run in range(len(runs.last)):
        if runs.clock[run, 0] < runs.last[run] and not runs.failed[run]:
            work.underway[count] = run
            count += 1
    return count


@njit(cache=True, inline="always")
def _round(
    model: ModalModel,
    levels: Levels,
    runs: Runs,
    states: ModalState,
    work: Work,
    track: Track,
    tolerance: float,
) -> None:
    """One step of every run under way."""
    rows, finest, accepted = work.underway[: _under_way(runs, work)], levels.decay.shape[1] - 1, 0
    for a in range(len(rows)):
        _head_for(levels, runs, states, work, rows[a])
    gap_jumps(model, rows, work.q_free, work.w)
    for a in range(len(rows)):
        run = rows[a]
        state = _state_of(states, run)
        good, residual = _try_step(model, levels, runs, state, work, run, tolerance)
        if not good:
            _refuse(runs, state, run, finest, residual)
            continue
        state.counts[2] = max(state.counts[2], residual)
        _accept(model, levels, runs, state, work, run)
        work.accepted[accepted] = run
        accepted += 1
    moved = work.accepted[:accepted]
    modal_forces(model, moved, states.mean, work.r)
    if len(model.R):
        acted = states.force.reshape(states.mean.shape) if model.conserving is not None else states.mean
        residual_jumps(model.R, moved, acted, work.w)
    for a in range(accepted):
        state = _state_of(states, moved[a])
        _move(model, levels, runs, state, work, moved[a])
        _tick(model, levels, runs, state, work, track, moved[a])


@njit(**VIEWS)
def march(
    model: ModalModel,
    levels: Levels,
    runs: Runs,
    states: ModalState,
    work: Work,
    track: Track,
    control: tuple[float, int],
) -> int:
    """March all runs by a number of steps, whatever the size of each.

    Parameters
    ----------
    model, levels : what the runs share, and the step sizes
    runs, states, work : changed in place
    track : receives the rows
    control : (tolerance of the gap-space problem, steps)

    Returns
    -------
    int, how many runs are still under way; a run that failed (`runs.failed`) is not, and the third of its
        counts holds the residual at the finest level
    """
    tolerance, steps = control
    for _ in range(steps):
        _round(model, levels, runs, states, work, track, tolerance)
    return _under_way(runs, work)
