"""The modal time loop, function by function in Python: numbers by hand or by quadrature."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from romdam.contact.problem import gap_memory, gap_problem
from romdam.core.system import OPEN, STICK, GapLaw
from romdam.timestepping.modal import kernels, loop, massless_boundary
from romdam.timestepping.modal.propagator import modal_propagator


def test_supports_carry_jumps_along_a_cubic():
    """a = 3 - 8 t / 0.5 from 3 to -5, u' = 2, u = 0.25 at the start: after 0.3 s by the integrals by hand."""
    motion = np.zeros((6, 4))
    motion[0, 1:3], motion[2, 1], motion[4, 1] = (3.0, -5.0), 2.0, 0.25
    motion[1, 1:3], motion[3, 1], motion[5, 1] = (1.0, 1.0), -1.0, 0.5
    t = 0.3
    first = 0.25 + 2.0 * t + 0.5 * 3.0 * t**2 - 16.0 * t**3 / 6.0
    second = 0.5 - t + 0.5 * t**2
    jump, carried = np.array([7.0, -7.0]), np.array([[2.0, 3.0], [-1.0, 4.0]])
    kernels.add_carried.py_func(carried, motion, 1, t / 0.5, 0.5, jump)
    assert jump == pytest.approx([7.0 + 2.0 * first + 3.0 * second, -7.0 - first + 4.0 * second], rel=1e-14)


def test_forces_and_jumps_of_an_instant():
    model = SimpleNamespace(
        static=np.array([1.0, -2.0]),
        load=np.array([[3.0, 5.0], [-7.0, 11.0]]),
        shift=np.array([[0.1, 0.2], [0.3, 0.5]]),
        ground_jump=np.array([[1.0, 2.0], [4.0, -8.0]]),
    )
    acc, f, jump = np.array([0.5, 0.25]), np.zeros(2), np.zeros(2)
    kernels.external_force.py_func(model, acc, f)
    assert f == pytest.approx([1.0 + 1.5 - 1.75, -2.0 + 2.5 + 2.75])
    kernels.added_jumps.py_func(model, 1, acc, jump)
    assert jump == pytest.approx([0.3 + 0.5 + 1.0, 0.5 + 1.0 - 2.0])


def relaxing(R, s, p, tau, t):
    """s and R s a time later."""
    decay = np.exp(-t / tau)
    now = p + (s - p) * decay
    return now, R @ now


def test_what_relaxes_takes_the_work_of_its_dashpot():
    """tau s' + s = p: u_r = R s, work p . (change of u_r), loss int (p - s) . u_r' dt by quadrature."""
    R = np.array([[3.0, 1.0], [1.0, 2.0]])
    s, p, tau, h = np.array([0.4, -0.2]), np.array([1.5, 0.7]), 0.03, 0.02
    state = SimpleNamespace(
        recorded=SimpleNamespace(s=s.copy(), gaps=SimpleNamespace(traction=np.zeros((2, 1)))),
        u_r=R @ s,
        mean=p,
    )
    model = SimpleNamespace(conserving=None, R=R)
    work, loss = kernels.relax.py_func(model, state, np.exp(-h / tau), R @ p)
    end, moved = relaxing(R, s, p, tau, h)
    t = np.linspace(0.0, h, 4001)
    rate = np.stack([(p - relaxing(R, s, p, tau, x)[0]) / tau for x in t])  # s'
    power = np.einsum("ti,ij,tj->t", tau * rate, R, rate)
    assert state.recorded.s == pytest.approx(end, rel=1e-12) and state.u_r == pytest.approx(moved, rel=1e-12)
    assert work == pytest.approx(p @ (moved - R @ s), rel=1e-12)
    assert loss == pytest.approx(np.trapezoid(power, t), rel=1e-6)
    stored = 0.5 * (end @ R @ end - s @ R @ s)
    assert work - loss == pytest.approx(stored, rel=1e-12)


def test_what_answers_at_once_stores_the_work_of_its_force():
    """Without damping u_r = R p at both ends: the work is the change of p R p / 2, without loss.

    R = [[3, 1], [1, 2]]: at (1.5, 0.7) it is (6.75 + 2.1 + 0.98) / 2 = 4.915, at (0.4, -0.2) 0.2.
    """
    R, s, p = np.array([[3.0, 1.0], [1.0, 2.0]]), np.array([0.4, -0.2]), np.array([1.5, 0.7])
    gaps = SimpleNamespace(traction=p.reshape(2, 1))
    state = SimpleNamespace(recorded=SimpleNamespace(s=s.copy(), gaps=gaps), u_r=R @ s, mean=0.5 * (s + p))
    model = SimpleNamespace(conserving=True, R=R)
    assert kernels.relax.py_func(model, state, 0.0, R @ p) == pytest.approx((4.915 - 0.2, 0.0), rel=1e-13)
    assert state.recorded.s == pytest.approx(p) and state.u_r == pytest.approx([5.2, 2.9])


def test_energy_of_a_boundary_without_mass():
    """Springs of 1/4 and 1/2 m/N pressed by 8 and 6 N: 8 + 9; R of (2, 3) 14; tensions 5 (0.2^2) / 2, 0.1."""
    problem = SimpleNamespace(
        compliance=np.array([0.25, 0.0, 0.0, 0.5, 0.0, 0.0]), gap=np.zeros(2), tension=np.array([5.0, 0.2])
    )
    R = np.zeros((6, 6))
    R[np.ix_([0, 4], [0, 4])] = [[1.0, 0.5], [0.5, 2.0]]
    pressed, p, opened = np.array([8.0, 0, 0, 6, 0, 0]), np.zeros(6), np.array([0.2, 9, 9, 1.0, 9, 9])
    p[0], p[4] = 2.0, 3.0  # (4 + 6 + 18) / 2
    energy = massless_boundary._elastic.py_func(SimpleNamespace(R=R), problem, pressed, p, opened)
    assert energy == pytest.approx(8.0 + 9.0 + 14.0 + 0.1 + 0.1, rel=1e-13)


def test_the_mean_force_of_a_step_that_slides_does_the_work_of_spring_and_friction(monkeypatch):
    """A gap that is pressed more and slides, on states and on a boundary without mass: an energy ledger.

    The mean force loses to the states what springs gain, 1/2 c p^2 and p R p, and what friction takes, the
    shear times the slip.
    """
    monkeypatch.setattr(massless_boundary, "_elastic", massless_boundary._elastic.py_func)
    law = GapLaw(np.array([4e6]), np.zeros(1), np.array([1e6]), np.array([[0.3, 0.3]]), np.zeros(1), {})
    half = 1e-7 * np.array([[4.0, 1.0, 0.5], [1.0, 6.0, 0.7], [0.5, 0.7, 5.0]])
    R = 1e-7 * np.array([[2.0, 0.3, 0.1], [0.3, 3.0, 0.2], [0.1, 0.2, 2.5]])
    problem = gap_problem(half + R, law)
    memory, y = gap_memory(problem), np.zeros(3)
    p_0, w_0 = np.array([1500.0, -200.0, 100.0]), np.array([1e-3, 2e-3, -1e-3])
    c = problem.compliance
    memory.force[:] = p_0
    memory.limits.mu[:] = 0.3
    state = SimpleNamespace(
        recorded=SimpleNamespace(
            gaps=SimpleNamespace(traction=p_0.reshape(1, 3).copy(), jump=(w_0 + R @ p_0).reshape(1, 3))
        ),
        closed=np.array([True]),
        mean=np.zeros(3),
        w=w_0.copy(),
    )
    w_free = np.array([-2.5e-3, 3.5e-3, -2.5e-3])
    residual = massless_boundary.try_conserving.py_func(
        True, SimpleNamespace(R=R), half, problem, memory, state, w_free, np.zeros(0), y, 1e-10, False
    )
    p_1 = memory.force
    assert residual <= 1e-10 and np.hypot(*p_1[1:]) == pytest.approx(0.3 * p_1[0], rel=1e-6)
    slip = y[1:] - memory.accumulated_slip[0]  # what the shear springs do not take
    slid = -(p_1[1:] @ slip)
    assert slid > 0.1
    stored = [0.5 * (c @ p**2 + p @ R @ p) for p in (p_0, p_1)]
    np.testing.assert_allclose(state.w, w_free + 2.0 * half @ state.mean, rtol=1e-12)
    assert -(state.mean @ (state.w - w_0)) == pytest.approx(stored[1] - stored[0] + slid, rel=1e-9)


def test_a_step_within_a_base_step_has_its_share_of_the_added_jumps(monkeypatch):
    """3 of 8 parts of a base step are done and one of 2 follows: 5/8 from (1, -2, 4) to (3, 2, -4)."""
    found = []
    for name in ("_reach", "add_carried"):
        monkeypatch.setattr(loop, name, getattr(loop, name).py_func)
    monkeypatch.setattr(loop, "_gaps_of", lambda *_: (SimpleNamespace(), SimpleNamespace(force=np.zeros(3))))
    monkeypatch.setattr(
        loop, "solve_gaps", lambda problem, memory, closed, w, *_: found.append(w.copy()) or 1
    )
    levels = SimpleNamespace(size=np.array([8, 2]), step=SimpleNamespace(dt=np.array([[0.8, 0.2]])))
    clock = SimpleNamespace(level=1, evolving=0, fine_steps=3, base_steps=0)
    runs = SimpleNamespace(clock=[clock], variant=[SimpleNamespace(step=0)], samples=[0], supports=None)
    work = SimpleNamespace(
        w=np.array([[10.0, 20.0, 30.0]]),
        y=np.zeros((1, 3)),
        shift=np.zeros((1, 3)),
        old_force=np.zeros((1, 3)),
        start_shift=np.array([[1.0, -2.0, 4.0]]),
        end_shift=np.array([[3.0, 2.0, -4.0]]),
    )
    model = SimpleNamespace(carried=np.zeros((0, 0)), conserving=None, R=np.zeros((0, 0)))
    state = SimpleNamespace(closed=np.ones(1, dtype=bool))
    assert loop._try_step.py_func(model, levels, runs, state, work, 0, 1e-8) == (False, 1)
    assert found[0] == pytest.approx([10 + 2.25, 20 + 0.5, 30 - 1.0])


def test_nodes_move_by_states_and_by_the_forces_that_act_at_once():
    """(2, -1) (3, 5) + (0.5, 4) (7, -0.25) = 1 + 2.5, and (0, 1) (3, 5) + (-2, 8) (7, -0.25) = -11."""
    recorded = SimpleNamespace(q=np.array([3.0, 5.0]), s=np.array([7.0, -0.25]))
    buffer = SimpleNamespace(
        by_states=np.array([[2.0, -1.0], [0.0, 1.0]]),
        by_forces=np.array([[0.5, 4.0], [-2.0, 8.0]]),
        node_disp=np.zeros((3, 2)),
    )
    loop._keep_nodes.py_func(recorded, buffer, 1)
    np.testing.assert_allclose(buffer.node_disp, [[0.0, 0.0], [3.5, -11.0], [0.0, 0.0]])


def test_works_of_a_step_are_those_of_its_motion():
    """Unlike modes under a load from f to f_1 and a constant joint force, against another integration."""
    omega, xi, h = np.array([0.0, 9.0, 40.0]), np.array([0.0, 0.07, 1.3]), 0.05
    k, c = omega**2, 2.0 * xi * omega
    q, v = np.array([0.3, -0.2, 0.1]), np.array([1.0, 2.0, -4.0])
    f, f_1, r = np.array([2.0, -3.0, 30.0]), np.array([-1.0, 5.0, 80.0]), np.array([0.5, 7.0, -60.0])
    step = modal_propagator(k, c, h)
    state = SimpleNamespace(recorded=SimpleNamespace(q=q.copy(), v=v.copy()), f=f.copy())
    q_free = np.zeros(3)
    kernels.free_motion.py_func(step, state, f_1, q_free)
    work, joint, loss = kernels.advance.py_func(step, state, f_1, r, q_free)

    def rates(t, y):
        position, speed = y[:3], y[3:6]
        load = f + (f_1 - f) * t / h
        acc = load + r - c * speed - k * position
        return np.concatenate([speed, acc, [load @ speed, r @ speed, c @ speed**2]])

    end = solve_ivp(rates, (0.0, h), np.concatenate([q, v, np.zeros(3)]), rtol=1e-12, atol=1e-14).y[:, -1]
    assert state.recorded.q == pytest.approx(end[:3], rel=1e-9) and state.recorded.v == pytest.approx(
        end[3:6], rel=1e-9
    )
    assert (work, joint, loss) == pytest.approx(tuple(end[6:]), rel=1e-9)
    assert state.f == pytest.approx(f_1)


def test_a_gap_that_turns_back_is_seen_from_its_last_rates(monkeypatch):
    """2 m/s in the last 0.3 s, 1 now over 0.1: at the end 1 + (1 - 2) 0.1 / 0.4 = 0.75, the same way.

    7 before: 1 - 6 / 4 = -0.5, back at 0.5 m/s, which is let pass up to that speed.
    """
    monkeypatch.setattr(loop, "_slides", lambda memory, i: i == 1)
    y = np.array([0.0, 9.0, 9.0, 0.0, 0.06, 0.08])  # of gap 1 (0.6, 0.8) m/s

    def goes_on(rates, most):
        every = np.array([[-99.0, 99.0], rates])
        return loop._slides_on.py_func(None, every, 0.3, 0.1, y, most)

    assert goes_on((1.2, 1.6), 0.0)
    assert not goes_on((4.2, 5.6), 0.49) and goes_on((4.2, 5.6), 0.51)


def test_shear_that_changes_moves_no_closed_gap_far(monkeypatch):
    """Forces change by (0, 3, 4) at gap 0, with W = 2 and a spring of 0.5: it moves by 1.5 times 5."""
    problem = SimpleNamespace(compliance=np.full(6, 0.5), W=2.0 * np.eye(6))
    memory = SimpleNamespace(
        force=np.array([1.0, 3.0, 4.0, 0.0, 0.0, 0.0]), limits=SimpleNamespace(tension=np.zeros(2))
    )
    state = SimpleNamespace(
        closed=np.array([True, False]),
        recorded=SimpleNamespace(gaps=SimpleNamespace(state=np.array([STICK, OPEN]))),
    )
    old = np.zeros(6)

    def steadily(most):
        return loop._shears_steadily.py_func(problem, memory, state, old, np.zeros(6), np.zeros(6), most)

    assert steadily(7.51) and not steadily(7.49)
    problem.compliance = np.zeros(6)  # rigid: it counts where it slides
    monkeypatch.setattr(loop, "_slides", lambda memory, i: False)
    assert steadily(0.0)
    monkeypatch.setattr(loop, "_slides", lambda memory, i: True)
    assert not steadily(9.99) and steadily(10.01)


def test_an_accepted_step_hands_on_rates_means_and_what_changed(monkeypatch):
    """Tension of 5 N/m times an opening of 0.2 m is taken off the unilateral force, water of 7 N comes on."""
    gaps = SimpleNamespace(jump=np.array([[0.2, 0.0, 0.0], [-0.1, 0.0, 0.0]]))
    problem = SimpleNamespace(tension=np.array([5.0, 11.0]), tension_transform=np.ones(1))
    memory = SimpleNamespace(
        force=np.array([0.0, 1.0, 2.0, 30.0, 4.0, 5.0]),
        limits=SimpleNamespace(tension=np.array([0.0, 2.0])),
        history=np.array([[[1.0], [2.0]]]),
        trial=np.array([[[1.0], [2.0]]]),
        water=np.array([0.0, 7.0]),
    )
    clock = SimpleNamespace(level=1, evolving=9, last_step=0.0, calm_steps=4)
    runs = SimpleNamespace(clock=[clock], variant=[SimpleNamespace(step=0)])
    levels = SimpleNamespace(step=SimpleNamespace(dt=np.array([[0.1, 0.05]])))
    energies = SimpleNamespace(friction=1.0, stored=9.0, input=2.0, joint_work=3.0)
    state = SimpleNamespace(
        recorded=SimpleNamespace(gaps=gaps, energies=energies),
        closed=np.array([False, True]),
        slip_rate=np.zeros((2, 2)),
        mean=np.zeros(6),
    )
    work = SimpleNamespace(y=np.array([[0.0, 0.01, -0.02, 0.0, 0.03, 0.04]]))
    monkeypatch.setattr(loop, "_gaps_of", lambda levels, runs, run: (problem, memory))
    monkeypatch.setattr(loop, "commit_gaps", lambda *_: (8.0, 0.25, 0.125))
    model = SimpleNamespace(conserving=None)
    loop._accept.py_func(model, levels, runs, state, work, 0)
    assert state.mean == pytest.approx([-1.0, 1.0, 2.0, 30.0 + 1.1 + 7.0, 4.0, 5.0])
    assert state.slip_rate == pytest.approx(np.array([[0.2, -0.4], [0.6, 0.8]]))
    assert (clock.calm_steps, clock.evolving, clock.last_step) == (5, 0, 0.05)
    assert (energies.friction, energies.stored, energies.input, energies.joint_work) == (
        1.25,
        8.0,
        2.125,
        2.875,
    )
    memory.force[3], memory.trial[0, 1, 0] = -2.5, 3.0  # pulled beyond its tension of 2
    loop._accept.py_func(model, levels, runs, state, work, 0)
    assert not state.closed.any() and (clock.calm_steps, clock.evolving) == (0, 1)


def test_an_accepted_step_moves_means_peaks_and_the_clock(monkeypatch):
    """A quarter of the base step of 0.2 s, rows of three base steps: a mean of 0.05 / 0.6 of the force."""
    monkeypatch.setattr(loop, "advance", lambda *_: (10.0, 20.0, 30.0))
    monkeypatch.setattr(loop, "relax", lambda *_: (0.5, 0.25))
    monkeypatch.setattr(loop, "at", lambda values, place: SimpleNamespace(dt=values.dt[place]))
    monkeypatch.setattr(loop, "_reach", lambda levels, runs, run: 0.75)
    monkeypatch.setattr(loop, "raise_peaks", loop.raise_peaks.py_func)
    monkeypatch.setattr(loop, "_may_go_up", loop._may_go_up.py_func)
    clock = SimpleNamespace(level=2, fine_steps=2, base_steps=5, calm_steps=1)
    runs = SimpleNamespace(clock=[clock], variant=[SimpleNamespace(step=0)], last=[9], rows=[0])
    levels = SimpleNamespace(
        size=np.array([4, 2, 1]),
        step=SimpleNamespace(dt=np.array([[0.2, 0.1, 0.05]])),
        decay=np.zeros((1, 3)),
    )
    peaks = [SimpleNamespace(opening=0.1, opening_time=0.0, compression=2.0, slip=0.4) for _ in range(2)]
    gaps = SimpleNamespace(
        jump=np.array([[0.2, 0.3, 0.4], [0.05, 0.1, 0.2]]),
        traction=np.array([[1.0, 0.0, 0.0], [5.0, 0.0, 0.0]]),
        mean_traction=np.ones((2, 3)),
    )
    energies = SimpleNamespace(input=1.0, damping=2.0, joint_work=3.0)
    state = SimpleNamespace(
        recorded=SimpleNamespace(gaps=gaps, energies=energies),
        peaks=peaks,
        mean=np.array([12.0, 0.0, 6.0, 0.0, 0.0, 0.0]),
        tries=SimpleNamespace(accepted=0),
        refusals=[SimpleNamespace(refused=16, passed=0) for _ in range(3)],
    )
    shift, last = np.array([[0.3, 0, 0, 0, 0, 0]]), np.array([[0.1, 0, 0, 0, 0, 0]])
    work = SimpleNamespace(
        f_1=np.zeros((1, 1)),
        r=np.zeros((1, 1)),
        q_free=np.zeros((1, 1)),
        w=np.zeros((1, 6)),
        shift=shift,
        last_shift=last,
    )
    buffer, model = SimpleNamespace(stride=3, node_disp=np.zeros((0, 3))), SimpleNamespace(R=np.eye(6))
    loop._move.py_func(model, levels, runs, state, work, buffer, 0)
    carried = 12.0 * 0.2
    assert (energies.input, energies.damping) == pytest.approx((1.0 + 10.0 - carried, 2.0 + 30.0 + 0.25))
    assert energies.joint_work == pytest.approx(3.0 + 20.0 + 0.5 + carried) and last[0, 0] == 0.3
    assert gaps.mean_traction[0] == pytest.approx([2.0, 1.0, 1.5]) and gaps.mean_traction[1] == pytest.approx(
        1.0
    )
    assert (peaks[0].opening, peaks[0].compression) == (0.2, 2.0) and peaks[0].slip == pytest.approx(0.5)
    assert peaks[0].opening_time == pytest.approx(0.2 * 5.75)
    assert (peaks[1].opening, peaks[1].opening_time, peaks[1].compression, peaks[1].slip) == (
        0.1,
        0.0,
        5.0,
        0.4,
    )
    # 3 of 4 are no whole number of the steps of 2, so the level stays
    assert (clock.fine_steps, clock.level, clock.base_steps) == (3, 2, 5)
    monkeypatch.setattr(loop, "_open_base_step", lambda *_: None)
    rows = []
    monkeypatch.setattr(loop, "put", lambda rows_, row, recorded: rows.append(row))
    buffer.rows = None
    loop._move.py_func(model, levels, runs, state, work, buffer, 0)
    assert (clock.base_steps, clock.level, clock.calm_steps, rows) == (6, 1, 0, [2])
    assert not gaps.mean_traction.any()


def test_a_level_that_is_refused_in_a_row_is_tried_less_often():
    """Every time up to 16 refusals; then at every 2nd, 4th, 8th and 16th time, and no more rarely."""
    for refused, waits in ((0, 1), (16, 1), (17, 2), (18, 4), (19, 8), (20, 16), (21, 16), (5000, 16)):
        level = SimpleNamespace(refused=refused, passed=0)
        times = next(k for k in range(1, 100) if loop._may_go_up.py_func(level))
        assert times == waits and level.passed == waits
