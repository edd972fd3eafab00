"""Transients with answers known by hand; SDN* are cases of the Code_Aster validation manuals (V5.01, V5.02).

Initial velocities and displacements are made with what the integrators take: a constant force that
shifts the equilibrium of a spring, or a pulse of the base.
"""

import math

import numpy as np
import pytest
from hand_systems import assert_ledger, gap_law, modal_twin, pulse, run, sparse_system, still

from romdam.core.integrators import INTEGRATORS
from romdam.error.metrics import largest_difference

# `conserving` is for scenes without damping, below a step of its own
MODAL = [name for name in INTEGRATORS if name not in ("generalized_alpha", "conserving")]


def _oscillator_on_a_table(**law):
    """Mass 1 with a spring 1e4 along x, loose in y and z, pressed on a table (normal +z) by 10 N."""
    return sparse_system(
        M=np.eye(3),
        K=np.diag([1e4, 0.0, 0.0]),
        B=[[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        law=gap_law(1, mu=0.1, **law),
        force=[1e4 * 8.5e-4, 0.0, -10.0],
        floating=True,
    )


@pytest.mark.parametrize("integrator", MODAL)
@pytest.mark.parametrize("stiffness", [{}, {"K_n": 1e9, "K_s": 1e9}], ids=["rigid", "penalty"])
def test_sdnd100_dry_friction_decay(integrator, stiffness):
    """m 1, k 1e4, mu 0.1, N 10, u0 -8.5e-4 from the spring's rest: 2 mu N / k = 2e-4 lost per half cycle.

    Extrema at n pi / 100: 6.5e-4, -4.5e-4, 2.5e-4, -0.5e-4; there it sticks (k u = 0.5 N < mu N = 1 N).
    """
    per_half = 400
    dt = math.pi / 100 / per_half
    system = modal_twin(_oscillator_on_a_table(**stiffness))
    h = run(system, still(5.5 * per_half * dt, dt), dt, integrator=integrator)
    u = h.disp[:, 0] - 8.5e-4
    extrema = u[per_half * np.arange(1, 5)]
    assert extrema == pytest.approx([6.5e-4, -4.5e-4, 2.5e-4, -0.5e-4], abs=0.85e-6)  # 0.1 % of u0
    late = u[4 * per_half + 10 :]
    assert np.ptp(late) <= 1e-6
    assert h.state[3 * per_half + per_half // 2, 0] == 2
    assert h.state[-1, 0] == 1
    assert h.traction[-1, 0, 0] == pytest.approx(10.0, rel=1e-6)
    # friction work mu N * path (15 + 11 + 7 + 3) 1e-4 m
    assert h.energy["friction"][-1] == pytest.approx(1.0 * 36e-4, rel=2e-3)
    assert_ledger(h)


@pytest.mark.parametrize("integrator", [*MODAL, "generalized_alpha"])
def test_sdnd101_impact_on_a_spring(integrator):
    """m 100, k 1e4, contact stiffness 1e6, v 1 m/s at contact.

    In contact omega = sqrt(1.01e6 / 100): duration pi / omega = 0.03126 s, peak 1e6 / omega = 9950.4 N,
    impulse 2e6 / omega^2 = 198.02 N s; second peak after 0.36105 s. Contact is reached with 1 m/s by
    starting 0.1 m away, at rest, with the spring's rest at the wall: t0 = pi / 20.
    """
    dt, t0 = 2e-5 if integrator in MODAL else 1e-4, math.pi / 20
    near = 100.0 * dt  # the scheme is of first order in contact; 0.1 % is met at 1e-5 s
    system = sparse_system(M=[[100.0]], K=[[1e4]], B=[[-1.0]], law=gap_law(1, K_n=1e6, gap=0.1), force=[1e3])
    system = system if integrator == "generalized_alpha" else modal_twin(system)
    h = run(system, still(0.55, dt), dt, integrator=integrator)
    p = h.traction[:, 0, 0]
    first = h.time < t0 + 0.1
    assert p[first].max() == pytest.approx(9950.4, rel=near)
    assert (p[first] > 0.0).sum() * dt == pytest.approx(0.03126, rel=near)
    assert p[first].sum() * dt == pytest.approx(198.02, rel=near)
    second = np.flatnonzero(~first)[np.argmax(p[~first])]
    assert h.time[second] - t0 == pytest.approx(0.36105, rel=1e-3)
    assert h.time[np.argmax(p > 0.0)] == pytest.approx(t0, abs=2 * dt)
    if integrator in MODAL:
        assert_ledger(h)


@pytest.mark.parametrize("integrator", MODAL)
@pytest.mark.parametrize(
    ("A", "dt", "mean"), [(15.0, 2e-4, 15.2672), (1.5, 2e-4, 0.409062), (1.01, 2.5e-5, 2.26164e-4)]
)
def test_sdnd104_block_on_a_shaken_base(integrator, A, dt, mean):
    """mu g = 1, base A sin(2 pi t), N 10: mean of N |v| over 4 to 12 s.

    A 1.01 barely slides (one part in ten thousand of the base's motion) and needs the smaller step."""
    system = modal_twin(_block_on_base())
    t = np.arange(round(12.0 / dt) + 1) * dt
    h = run(system, A * np.sin(2 * np.pi * t), dt, integrator=integrator, stride=5)
    late = h.time >= 4.0 - 1e-9
    assert np.trapezoid(10.0 * np.abs(h.vel[late, 0]), h.time[late]) / 8.0 == pytest.approx(mean, rel=0.01)
    assert_ledger(h)


def _block_on_base():
    """Mass 1 loose in x, y and z, weight 10 N, mu 0.1, rigid contact."""
    return sparse_system(
        M=np.eye(3),
        K=np.zeros((3, 3)),
        B=[[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        law=gap_law(1, mu=0.1),
        force=[0.0, 0.0, -10.0],
        load=[1.0, 0.0, 0.0],
        floating=True,
    )


@pytest.mark.parametrize("integrator", MODAL)
def test_sdnd104_below_the_limit_nothing_moves(integrator):
    dt = 1e-3
    t = np.arange(12001) * dt
    h = run(modal_twin(_block_on_base()), 0.99 * np.sin(2 * np.pi * t), dt, integrator=integrator)
    # what is left is the constant joint force against the linear base motion: dt^2 a' / 6
    assert np.abs(h.vel[:, 0]).max() <= 1.01 * dt**2 * 0.99 * 2 * np.pi / 6
    assert np.abs(h.disp[:, 0]).max() <= 1e-12
    assert (h.state[1:] == 1).all()
    # the joint carries the base's motion to the block: m a, on side J (the block), within the step
    lag = 0.99 * 2 * np.pi * dt
    assert h.traction[1:, 0, 1] == pytest.approx(0.99 * np.sin(2 * np.pi * t[1:]), abs=lag)


@pytest.mark.parametrize("integrator", MODAL)
def test_steady_sliding_on_a_base_that_accelerates(integrator):
    """a_g = +3, mu g = 1: the block slides backwards, relative acceleration -3 + 1, shear +1 on the block."""
    dt = 1e-3
    h = run(modal_twin(_block_on_base()), 3.0 * np.ones(1001), dt, integrator=integrator)
    assert h.disp[-1, 0] == pytest.approx(-1.0, rel=1e-3)
    assert h.vel[-1, 0] == pytest.approx(-2.0, rel=1e-3)
    assert h.acc[-1, 0] == pytest.approx(-2.0, rel=1e-6)
    assert h.traction[-1, 0] == pytest.approx([10.0, 1.0, 0.0], rel=1e-6, abs=1e-9)
    assert h.energy["friction"][-1] == pytest.approx(1.0, rel=2e-3)  # 1 N over 1 m
    assert h.energy["input"][-1] == pytest.approx(3.0, rel=1e-3)
    # 3 J in: 2 J of motion, 1 J of friction, and nothing left for the contact to take away
    assert h.energy["kinetic"][-1] == pytest.approx(2.0, rel=2e-3)
    assert abs(h.energy["contact"][-1]) <= 5e-3


def _bar(elements, L, E, rho, law):
    """A loose bar along x, linear elements with consistent mass; a wall beyond its right end."""
    h, n = L / elements, elements + 1
    M, K = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        at = np.ix_([e, e + 1], [e, e + 1])
        M[at] += rho * h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        K[at] += E / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
    B = np.zeros((1, n))
    B[0, -1] = -1.0
    return sparse_system(M, K, B, law, load=M @ np.ones(n), floating=True)


@pytest.mark.parametrize("integrator", [*MODAL, "generalized_alpha"])
@pytest.mark.parametrize("K_n", [np.inf, 1e5], ids=["rigid", "stiff"])
def test_bar_against_a_wall(integrator, K_n):
    """L 10, E 900, rho 1, v 2: contact lasts 2 L / c = 2/3 s under rho c v = 60 and turns the bar round."""
    dt, v = 2e-4 if integrator in MODAL else 1e-3, 2.0
    bar = _bar(100, 10.0, 900.0, 1.0, gap_law(1, K_n=K_n, gap=0.5))
    bar = bar if integrator == "generalized_alpha" else modal_twin(bar)
    acc = pulse(v, 1.2, round(0.01 / dt), dt)
    reached = 0.01 + 0.5 / v  # the pulse moves it like v from its middle on
    h = run(bar, acc, dt, integrator=integrator)
    # the undamped end rings in a stiff spring (modal damps it), and the force at an instant in a rigid gap
    # depends on the step where that varies: the mean of neither does
    p = (h.traction if integrator == "modal" else h.mean_traction)[:, 0, 0]
    assert h.time[np.argmax(p > 0.0)] == pytest.approx(reached, abs=2 * dt)
    loaded = h.time[p > 0.05 * 60.0]
    assert loaded[-1] - loaded[0] == pytest.approx(2.0 / 3.0, rel=0.02)
    middle = (h.time > reached + 0.1) & (h.time < reached + 0.6)
    assert p[middle].mean() == pytest.approx(60.0, rel=0.01)
    assert p.sum() * dt == pytest.approx(2 * 10.0 * v, rel=0.03)
    assert h.traction.min() >= 0.0
    if integrator in MODAL:
        assert_ledger(h)
        assert h.energy["input"][-1] == pytest.approx(0.5 * 10.0 * v**2, rel=1e-9)


def _three_masses(law):
    """Three masses in a chain with Rayleigh damping; a wall at the last."""
    M = np.diag([2.0, 3.0, 1.0])
    K = 1e3 * np.array([[5.0, -2.0, 0.0], [-2.0, 4.0, -2.0], [0.0, -2.0, 2.0]])
    return sparse_system(
        M,
        K,
        [[0.0, 0.0, 1.0]][: len(law)],
        law,
        C=0.8 * M + 2e-3 * K,
        force=[1.0, -2.0, 0.5],
        load=np.diag(M),
    )


def _record(dt, duration=2.0):
    """Piecewise linear with corners every 0.02 s."""
    corners = np.random.default_rng(1).standard_normal(101)
    t = np.arange(round(duration / dt) + 1) * dt
    return np.interp(t, 0.02 * np.arange(101), corners)


@pytest.mark.parametrize("integrator", MODAL)
def test_without_contact_the_answer_does_not_depend_on_the_step(integrator):
    system = modal_twin(_three_masses(gap_law(1, gap=10.0)))
    fine = run(system, _record(0.0005), 0.0005, stride=40, integrator=integrator)
    scale = np.abs(fine.disp).max()
    for dt, stride in ((0.02, 1), (0.01, 2), (0.0025, 8)):
        h = run(system, _record(dt), dt, stride=stride, integrator=integrator)
        assert np.abs(h.disp - fine.disp).max() <= 1e-11 * scale
        assert np.abs(h.vel - fine.vel).max() <= 1e-11 * np.abs(fine.vel).max()
        assert np.abs(h.acc - fine.acc).max() <= 1e-10 * np.abs(fine.acc).max()
        assert h.energy["input"] == pytest.approx(fine.energy["input"], rel=1e-9, abs=1e-12)
        assert h.energy["damping"] == pytest.approx(fine.energy["damping"], rel=1e-9, abs=1e-12)
        assert_ledger(h, 1e-12)


def test_generalized_alpha_is_of_second_order_and_tends_to_the_modal_answer():
    system = _three_masses(gap_law(1, gap=10.0))
    exact = run(modal_twin(system), _record(0.02), 0.02)
    errors = []
    steps = (0.002, 0.001, 0.0005)
    for dt in steps:
        h = run(system, _record(dt), dt, stride=round(0.02 / dt))
        errors.append([np.abs(getattr(h, a) - getattr(exact, a)).max() for a in ("disp", "vel")])
    slopes = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slopes == pytest.approx([2.0, 2.0], abs=0.1)
    assert errors[-1][0] <= 2e-3 * np.abs(exact.disp).max()


@pytest.mark.parametrize("rho_inf", [0.5, 0.9])
def test_generalized_alpha_tends_to_the_adaptive_answer_through_contact(rho_inf):
    system = _three_masses(gap_law(1, K_n=1e5, gap=1e-4))
    exact = run(modal_twin(system), _record(2e-6, 0.2), 2e-6, stride=10000, integrator="adaptive")
    assert exact.traction.max() > 1.0
    errors, peaks = [], []
    for dt, stride in ((4e-4, 50), (1e-4, 200), (2.5e-5, 800)):
        h = run(system, _record(dt, 0.2), dt, stride=stride, rho_inf=rho_inf)
        errors.append(largest_difference(h.disp, exact.disp))
        peaks.append(np.abs(h.peaks["compression"] / exact.peaks["compression"] - 1.0).max())
    assert errors[0] <= 2e-3 and errors[1] <= 0.25 * errors[0] and errors[2] <= 0.25 * errors[1]
    assert peaks[2] <= 1e-4


@pytest.mark.parametrize("integrator", [*MODAL, "generalized_alpha"])
def test_no_gap_is_a_linear_run(integrator):
    whole = _three_masses(gap_law(1, gap=10.0))
    bare = _three_masses(gap_law(0))
    if integrator in MODAL:
        whole, bare = modal_twin(whole), modal_twin(bare)
    far, none = (run(s, _record(0.01), 0.01, integrator=integrator) for s in (whole, bare))
    assert np.abs(far.disp - none.disp).max() <= 1e-14
    assert none.jump.shape == (201, 0, 1)


@pytest.mark.parametrize("integrator", [*MODAL, "generalized_alpha"])
@pytest.mark.parametrize("initial_state", ["static", "undeformed"])
def test_records_of_one_and_two_samples(integrator, initial_state):
    system = _three_masses(gap_law(1, K_n=1e5, gap=-1e-4))
    system = modal_twin(system) if integrator in MODAL else system
    one = run(system, np.ones(1), 0.01, integrator=integrator, initial_state=initial_state)
    two = run(system, np.ones(2), 0.01, integrator=integrator, initial_state=initial_state)
    assert len(one.time) == 1 and len(two.time) == 2
    assert np.array_equal(one.disp[0], two.disp[0])
    assert np.isfinite(two.disp).all() and np.isfinite(one.acc).all()


@pytest.mark.parametrize("integrator", MODAL)
@pytest.mark.parametrize("beta", [0.0, 2e-3, 5.0], ids=["undamped", "damped", "overdamped"])
@pytest.mark.parametrize("dt", [1e-4, 0.05])
@pytest.mark.parametrize("K_n", [1e2, 1e5, 1e10, np.inf])
def test_ledger_closes_for_any_step_and_stiffness(integrator, beta, dt, K_n):
    system = _three_masses(gap_law(1, K_n=K_n, gap=1e-4))
    C = 0.1 * system.M.toarray() + beta * system.K.toarray()
    system = modal_twin(sparse_system(system.M.toarray(), system.K.toarray(), [[0, 0, 1]], system.law, C=C))
    system.load[:, 0] = np.ones(3)
    h = run(system, _record(dt) * 5.0, dt, integrator=integrator)
    assert h.traction.max() > 0.0
    assert h.traction.min() >= 0.0
    assert_ledger(h)


@pytest.mark.parametrize("integrator", MODAL)
def test_peaks_see_every_step_and_rows_only_some(integrator):
    system = modal_twin(_three_masses(gap_law(1, K_n=1e5, gap=1e-4)))
    acc = _record(0.001)
    every = run(system, acc, 0.001, integrator=integrator)
    seventh = run(system, acc, 0.001, stride=7, integrator=integrator)
    for name, values in every.peaks.items():
        assert np.array_equal(values, seventh.peaks[name]), name
    assert np.array_equal(every.disp[::7], seventh.disp)
    assert seventh.node_peaks == pytest.approx(every.node_peaks, rel=1e-12)
    peak, when = every.node_peaks
    assert np.array_equal(peak, np.abs(every.disp).max(axis=0))
    assert when == pytest.approx(every.time[np.abs(every.disp).argmax(axis=0)], abs=1e-12)
    assert (peak > np.abs(seventh.disp).max(axis=0)).any() and not len(seventh.base_disp)
    assert every.peaks["opening"][0] == every.jump[:, 0, 0].max()
    assert every.peaks["compression"][0] == every.traction[:, 0, 0].max()
    assert every.peaks["opening_time"][0] == every.time[np.argmax(every.jump[:, 0, 0])]


@pytest.mark.parametrize("integrator", MODAL)
@pytest.mark.parametrize("gap", [-1e-4, 1e-4])
def test_no_energy_is_created_by_what_the_gaps_hold_at_the_start(integrator, gap):
    """A gap that starts pressed in (or, with tension, drawn out) holds 0.5 K gap^2, and no more comes out."""
    law = gap_law(1, K_n=1e5, K_nz=0.0 if gap < 0.0 else 1e4, gap=gap)
    system = modal_twin(sparse_system([[2.0]], [[1e3]], [[1.0]], law))
    h = run(system, still(0.5, 1e-4), 1e-4, integrator=integrator)
    held = 0.5 * (1e5 if gap < 0.0 else 1e4) * gap**2
    assert h.energy["joint_stored"][0] == pytest.approx(held, rel=1e-9)
    total = h.energy["kinetic"] + h.energy["strain"] + h.energy["joint_stored"]
    assert total.max() <= held * (1.0 + 1e-9)
    assert np.diff(h.energy["contact"]).min() >= -1e-9 * held
