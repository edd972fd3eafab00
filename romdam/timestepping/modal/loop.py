"""The time loop: every mode is propagated exactly, and the joint force is solved for at the end of each step.

Over one step the joint force p is constant. It follows the springs of the gaps at a point within the step
(`romdam.contact.problem`), and rigid gaps at its end. A contact force of higher order in time is unstable
(the manual, "Why the force is constant over a step"). A step consists of four operations: the free motion of
the modes, the jumps of the gaps w = G q, the joint force from the gap-space problem, and the forces on the
modes G^T p.

The error of the scheme arises where contact changes, because a gap that closes within a step is pushed over
the whole of it. The loop therefore cuts steps. A step in which the closed set or a joint force changes much
is refused, and the run goes one level down, to the next smaller step; only the finest level accepts such
changes. When contact is calm again, the run goes back up. All steps lie on a grid below the base step, so
that the propagators and flexibilities of every level are computed before the loop begins. With a single level
this is the fixed-step scheme. Where every longer step is refused, as it is while many joints rub, trying them
took up to a third of all steps; a run that was refused again and again therefore tries less often.

Every mode with mass is a state, however strongly it is damped. Unknowns without mass (residual flexibilities,
massless rock) are no states. They respond to the joint force through a flexibility R, with one relaxation
time tau = c/k: tau s' + s = p, u_r = R s.

Many runs are integrated together. Each takes its own next step, at its own time and level, which is exactly
the step that it would take alone; only the products with G and R are made for all runs at once.
"""

from __future__ import annotations

import numpy as np

from romdam.contact.components import ALONG_J, ALONG_K, NORMAL, SHEAR_J, SHEAR_K
from romdam.contact.cone import shear_limits, slides
from romdam.contact.problem import GapMemory, GapProblem
from romdam.contact.step import commit_gaps, solve_gaps
from romdam.core.arrays import PLACE, Floats, Record, at, put
from romdam.core.jit import ARRAYS, VIEWS, copy, njit
from romdam.core.system import STICK
from romdam.timestepping.modal.arrays import (
    BASE,
    Batch,
    HistoryBuffer,
    ModalModel,
    ModalState,
    Recorded,
    StepHierarchy,
    Work,
)
from romdam.timestepping.modal.kernels import (
    add_carried,
    added_jumps,
    advance,
    external_force,
    free_motion,
    gap_jumps,
    modal_forces,
    relax,
    residual_jumps,
)
from romdam.timestepping.modal.massless_boundary import try_conserving
from romdam.timestepping.peaks import raise_peaks

_CALM = 1  # accepted steps without a change of the closed set before a longer one is tried
_PATIENCE = 16  # steps of a level that are refused in a row, before it is tried less often
_RARELY = 4  # it is tried at every 2, 4, ... of the times that it could be, and at least at each 2**_RARELY


@njit(cache=True, inline="always")
def _gaps_of(levels: StepHierarchy, runs: Batch, run: int) -> tuple[GapProblem, GapMemory]:
    """Views of the gap-space problem at a run's level."""
    level, memory_of_run = runs.clock[run].level, at(runs.memory, run)
    memory = GapMemory(
        force=memory_of_run.force,
        accumulated_slip=memory_of_run.accumulated_slip,
        limits=memory_of_run.limits,
        history=memory_of_run.history,
        trial=memory_of_run.trial,
        limit=memory_of_run.limit,
        step=memory_of_run.step,
        last_step=memory_of_run.last_step,
        water=memory_of_run.water,
        spring=memory_of_run.spring,
        failure=memory_of_run.failure,
        solver=at(runs.solver, (run, level)),
    )
    return at(levels.problem, (runs.variant[run].problem, level)), memory


@njit(cache=True)
def _slides(memory: GapMemory, i: int) -> bool:
    """Tell whether the shear of gap i is at its limit."""
    p = memory.force[3 * i + NORMAL] + memory.limits.tension[i]
    limit_j, limit_k = shear_limits(memory.limits, i, p)
    return bool(
        p > 0.0 and slides(limit_j, limit_k, memory.force[3 * i + SHEAR_J], memory.force[3 * i + SHEAR_K])
    )


@njit(cache=True)
def _slides_on(memory: GapMemory, rates: Floats, last_step: float, dt: float, y: Floats, most: float) -> bool:
    """Tell whether every gap that slides over a step still slides the same way at its end.

    A gap that turns back within a step is braked in the wrong sense until its end, which pushes it back too
    fast. The speed at the end is extrapolated from the mean slip rates of this step and the last one.

    Parameters
    ----------
    rates : (n, 2) mean slip rates of the last step [m/s]
    last_step, dt : the last step and this one [s]
    y : (N,) slip over this step, along the shear directions [m]
    most : speed that is let pass [m/s]
    """
    for i in range(len(rates)):
        if not _slides(memory, i):
            continue
        rate_j, rate_k = y[3 * i + SHEAR_J] / dt, y[3 * i + SHEAR_K] / dt
        further = dt / (dt + last_step)
        end_j = rate_j + further * (rate_j - rates[i, ALONG_J])
        end_k = rate_k + further * (rate_k - rates[i, ALONG_K])
        along = end_j * rate_j + end_k * rate_k
        if along < 0.0 and along**2 > most**2 * (rate_j**2 + rate_k**2):
            return False
    return True


@njit(cache=True)
def _shears_steadily(
    problem: GapProblem,
    memory: GapMemory,
    state: ModalState,
    old_force: Floats,
    change: Floats,
    moved: Floats,
    most: float,
) -> bool:
    """Tell whether the change of the shear in closed gaps moves none of them farther than `most`.

    Gaps count that are closed at both ends of the step. Those that begin to slide, stick or turn back within
    it are pushed the wrong way over a part of it; those that stick at steps too long for their springs swing
    from step to step. All of them move a block together, so their changes act at once. Rigid gaps that stick
    throughout do not count: their shear is what holds them, and alternates by more the shorter the step is.

    Parameters
    ----------
    change, moved : (N,) scratch
    """
    n = len(state.closed)
    if len(memory.force) == n:
        return True
    for i in range(n):
        counts = state.closed[i] and memory.force[3 * i + NORMAL] > -memory.limits.tension[i]
        if counts and problem.compliance[3 * i + SHEAR_J] == 0.0 and state.recorded.gaps.state[i] == STICK:
            counts = _slides(memory, i)
        change[3 * i + NORMAL] = 0.0
        for b in range(3 * i + SHEAR_J, 3 * i + SHEAR_K + 1):
            change[b] = memory.force[b] - old_force[b] if counts else 0.0
    for b in range(len(change)):
        moved[b] = -problem.compliance[b] * change[b]
    for b in range(len(change)):
        if change[b] != 0.0:
            row = problem.W[b]  # W is symmetric
            for a in range(len(moved)):
                moved[a] += change[b] * row[a]
    for i in range(n):
        j, k = 3 * i + SHEAR_J, 3 * i + SHEAR_K
        counts = change[j] != 0.0 or change[k] != 0.0
        if counts and not moved[j] ** 2 + moved[k] ** 2 <= most**2:
            return False
    return True


@njit(**ARRAYS)
def _open_base_step(model: ModalModel, runs: Batch, work: Work, run: int) -> None:
    """Bring the external force, and the added jumps, of both ends of a run's next base step."""
    clock = runs.clock[run]
    n = clock.base_steps
    copy(work.f_end[run], work.f_0[run])
    external_force(model, runs.acc[:, runs.samples[run] + n + 1], work.f_end[run])
    copy(work.end_shift[run], work.start_shift[run])
    added_jumps(model, n + 1, runs.acc[:, runs.samples[run] + n + 1], work.end_shift[run])
    clock.fine_steps, clock.calm_steps = 0, 0


@njit(cache=True, inline="always")
def _reach(levels: StepHierarchy, runs: Batch, run: int) -> float:
    """End of a run's next step within its base step, from 0 to 1."""
    return (runs.clock[run].fine_steps + levels.size[runs.clock[run].level]) / levels.size[BASE]


@njit(cache=True, inline="always")
def _may_go_up(refusals: Record) -> bool:
    """Tell whether to try a level again, and count that it could have been; `REFUSALS` of that level."""
    refusals.passed += 1
    return bool(refusals.passed >= 1 << min(max(refusals.refused - _PATIENCE, 0), _RARELY))


@njit(cache=True, inline="always")
def _try_step(
    model: ModalModel,
    levels: StepHierarchy,
    runs: Batch,
    state: ModalState,
    work: Work,
    run: int,
    tolerance: float,
) -> tuple[bool, float]:
    """Solve a run's next step; whether to accept it, and its gap residual."""
    l, finest = runs.clock[run].level, len(levels.size) - 1
    problem, memory = _gaps_of(levels, runs, run)
    w, y, shift, old_force = work.w[run], work.y[run], work.shift[run], work.old_force[run]
    share, start, end = _reach(levels, runs, run), work.start_shift[run], work.end_shift[run]
    variant = runs.variant[run].step
    for i in range(len(shift)):
        shift[i] = start[i] + share * (end[i] - start[i])
    first = runs.samples[run] + runs.clock[run].base_steps
    add_carried(model.carried, runs.supports, first, share, levels.step.dt[variant, BASE], shift)
    if runs.clock[run].evolving and l < finest:
        return False, np.inf
    copy(memory.force, old_force)
    if model.conserving is not None:
        half = levels.half[variant, l]
        residual = try_conserving(
            model.conserving, model, half, problem, memory, state, w, shift, y, tolerance, l < finest
        )
    else:
        if len(model.R):
            for i in range(len(w)):
                w[i] += levels.decay[variant, l] * state.u_r[i]
        for i in range(len(shift)):
            w[i] += shift[i]
        residual = solve_gaps(problem, memory, state.closed, w, y, tolerance, l < finest)
    good = residual <= tolerance
    dt = levels.step.dt[variant, l]
    if good and l < finest:  # the change of no gap's normal force moves its jump far
        n, most = len(problem.gap), runs.impulse[run] * dt
        d = len(memory.force) // max(n, 1)
        for i in range(n):
            b = PLACE(d * i)
            if not problem.self_flexibility[b] * abs(memory.force[b] - old_force[b]) <= most:
                good = False
                break
    if good and l < finest:
        most = runs.shear_impulse[run]
        good = _slides_on(memory, state.slip_rate, runs.clock[run].last_step, dt, y, most)
        good = good and _shears_steadily(problem, memory, state, old_force, w, work.moved[run], most * dt)
    if not good:
        copy(old_force, memory.force)
    return good, residual


@njit(cache=True, inline="always")
def _accept(
    model: ModalModel, levels: StepHierarchy, runs: Batch, state: ModalState, work: Work, run: int
) -> None:
    """Commit the gaps of a solved step."""
    problem, memory = _gaps_of(levels, runs, run)
    gaps, energies = state.recorded.gaps, state.recorded.energies
    stored, friction, fed = commit_gaps(problem, memory, work.y[run], gaps)
    changed, d = False, gaps.jump.shape[1]
    for i in range(len(state.closed)):
        closed = memory.force[PLACE(d * i)] > -memory.limits.tension[i]
        changed = changed or closed != state.closed[i]
        state.closed[i] = closed
    clock, dt = runs.clock[run], levels.step.dt[runs.variant[run].step, runs.clock[run].level]
    for i in range(len(state.slip_rate)):
        for a in range(2):
            state.slip_rate[i, a] = work.y[run, 3 * i + SHEAR_J + a] / dt
    history, trial = memory.history.reshape(memory.history.size), memory.trial.reshape(memory.trial.size)
    clock.evolving = 0
    for entry in range(len(history)):
        if history[entry] != trial[entry]:
            clock.evolving = 1
            changed = True
    clock.last_step = dt
    if model.conserving is None:
        for b in range(len(state.mean)):
            state.mean[b] = memory.force[b]
        for i in range(len(problem.tension) if len(problem.tension_transform) else 0):
            state.mean[PLACE(d * i)] -= problem.tension[i] * gaps.jump[i, NORMAL]
    for i in range(len(memory.water)):
        state.mean[d * i] += memory.water[i]
    runs.clock[run].calm_steps = 0 if changed else runs.clock[run].calm_steps + 1
    energies.friction += friction
    energies.stored = stored
    energies.input += fed
    energies.joint_work -= fed


@njit(cache=True)
def _keep_nodes(recorded: Recorded, buffer: HistoryBuffer, sample: int) -> None:
    """Keep the displacement of the output nodes at a base step."""
    q, s = recorded.q, recorded.s
    for a in range(len(buffer.by_states)):
        disp = 0.0
        for j in range(len(q)):
            disp += buffer.by_states[a, j] * q[j]
        if len(buffer.by_forces):
            for b in range(len(s)):
                disp += buffer.by_forces[a, b] * s[b]
        buffer.node_disp[sample, a] = disp


@njit(cache=True, inline="always")
def _move(
    model: ModalModel,
    levels: StepHierarchy,
    runs: Batch,
    state: ModalState,
    work: Work,
    buffer: HistoryBuffer,
    run: int,
) -> None:
    """Move a run over its accepted step: modes, residual flexibility, works, mean forces, peaks and clock.

    At the end of a base step a row is written, and the next base step is opened.
    """
    clock, size, variant = runs.clock[run], levels.size, runs.variant[run].step
    l = clock.level
    step = at(levels.step, (variant, l))
    dt = step.dt
    input_, joint, loss = advance(step, state, work.f_1[run], work.r[run], work.q_free[run])
    if len(model.R):
        joint_r, loss_r = relax(model, state, levels.decay[variant, l], work.w[run])
        joint += joint_r
        loss += loss_r
    gaps, energies = state.recorded.gaps, state.recorded.energies
    shift, last = work.shift[run], work.last_shift[run]
    for i in range(len(shift)):  # the ground does what work the joint force does on what it moves alone
        carried = state.mean[i] * (shift[i] - last[i])
        joint += carried
        input_ -= carried
        last[i] = shift[i]
    energies.input += input_
    energies.damping += loss
    energies.joint_work += joint
    share = dt / (buffer.stride * levels.step.dt[variant, BASE])  # of the writing interval
    mean = gaps.mean_traction.reshape(gaps.mean_traction.size)
    for b in range(len(mean)):
        mean[b] += share * state.mean[b]
    time = levels.step.dt[variant, BASE] * (clock.base_steps + _reach(levels, runs, run))
    raise_peaks(state.peaks, gaps.jump, gaps.traction, time)
    clock.fine_steps += size[l]
    state.tries.accepted += 1
    if l < len(size) - 1:
        state.refusals[l].refused = 0
        state.refusals[l].passed = 0
    goes_up = l > BASE and clock.calm_steps >= _CALM and clock.fine_steps % size[l - 1] == 0
    if goes_up and _may_go_up(state.refusals[l - 1]):
        clock.level -= 1
        clock.calm_steps = 0
    if clock.fine_steps < size[BASE]:
        return
    clock.base_steps += 1
    if len(buffer.node_disp):
        _keep_nodes(state.recorded, buffer, runs.samples[run] + clock.base_steps)
    if clock.base_steps % buffer.stride == 0:
        row = runs.rows[run] + clock.base_steps // buffer.stride
        put(buffer.rows, row, state.recorded)
        gaps.mean_traction[:] = 0.0
    if clock.base_steps < runs.last[run]:
        _open_base_step(model, runs, work, run)


@njit(cache=True, inline="always")
def _gather_active(runs: Batch, work: Work) -> int:
    """Put the runs that are neither done nor failed to work.active; how many they are."""
    count = 0
    for run in range(len(runs.last)):
        if runs.clock[run].base_steps < runs.last[run] and not runs.failed[run]:
            work.active[count] = run
            count += 1
    return count


@njit(**VIEWS)
def integrate(
    model: ModalModel,
    levels: StepHierarchy,
    runs: Batch,
    states: ModalState,
    work: Work,
    buffer: HistoryBuffer,
    tolerance: float,
    steps: int,
) -> int:
    """Integrate all runs by a number of steps, whatever the size of each.

    Parameters
    ----------
    model, levels : what the runs share, and the step sizes
    runs, states, work : changed in place
    buffer : receives the rows
    tolerance : of the gap-space problem
    steps : of every run, at most

    Returns
    -------
    int, how many runs are still active; a run that failed (`runs.failed`) is not, and its `tries` hold the
        residual at the finest level
    """
    finest = len(levels.size) - 1
    for _ in range(steps):
        rows = work.active[: _gather_active(runs, work)]
        for a in range(len(rows)):  # free motion over the next step
            run = rows[a]
            share, f_0, f_end, f_1 = _reach(levels, runs, run), work.f_0[run], work.f_end[run], work.f_1[run]
            for j in range(len(f_1)):
                f_1[j] = f_0[j] + share * (f_end[j] - f_0[j])
            step = at(levels.step, (runs.variant[run].step, runs.clock[run].level))
            free_motion(step, at(states, run), f_1, work.q_free[run])
        gap_jumps(model.tiles, model.values, rows, work.q_free, work.w)
        accepted = 0
        for a in range(len(rows)):
            run = rows[a]
            state = at(states, run)
            good, residual = _try_step(model, levels, runs, state, work, run, tolerance)
            if good:
                state.tries.residual = max(state.tries.residual, residual)
                _accept(model, levels, runs, state, work, run)
                work.accepted[accepted] = run
                accepted += 1
                continue
            state.tries.refused += 1
            if runs.clock[run].level == finest:
                state.tries.residual = residual
                runs.failed[run] = True
            else:  # a level down
                state.refusals[runs.clock[run].level].refused += 1
                state.refusals[runs.clock[run].level].passed = 0
                runs.clock[run].level += 1
        moved = work.accepted[:accepted]
        modal_forces(model.tiles, model.values, moved, states.mean, work.r)
        if len(model.R):
            ends = states.recorded.gaps.traction.reshape(states.mean.shape)
            acted = ends if model.conserving is not None else states.mean
            residual_jumps(model.R, moved, acted, work.w)
        for a in range(accepted):
            _move(model, levels, runs, at(states, moved[a]), work, buffer, moved[a])
    return _gather_active(runs, work)
