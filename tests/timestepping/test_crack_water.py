"""Water that enters a gap as it opens: an oscillator by hand, the ledger, and a crack at rest."""

from dataclasses import replace

import numpy as np
import pytest
from hand_systems import gap_law, modal_twin, sparse_system
from simulating import simulated

from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.crack_water import CrackWater
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.system import LawRows
from romdam.timestepping import equilibrium
from romdam.timestepping.equilibrium import static_equilibrium

M, K = 1000.0, 1e6  # kg, N/m
OMEGA = np.sqrt(K / M)
PRESSED, WATER, RATE = 1000.0, 500.0, 60000.0  # N: on the wall at rest, of the water; N/s, what lifts off
OPENS = PRESSED / RATE
INTEGRATORS = ["modal", "adaptive", "generalized_alpha"]


def filled(law, excess):
    """The gaps with water that enters as they open, of these forces."""
    water = np.broadcast_to(np.asarray(excess, dtype=float), (len(law),))
    return replace(law, laws=(LawRows(source_of(CrackWater), water[:, None], water > 0.0, shear=False),))


def on_a_wall(integrator, force=-PRESSED, **law):
    system = sparse_system(
        [[M]], [[K]], [[1.0]], filled(gap_law(1, **law), WATER), force=[force], load=[M], C=[[0.0]]
    )
    return system if integrator == "generalized_alpha" else modal_twin(system)


def lifted(t):
    """M u'' + K u = RATE (t - OPENS) + WATER from the opening on."""
    s = np.maximum(t - OPENS, 0.0)
    return (WATER * (1.0 - np.cos(OMEGA * s)) + RATE * (s - np.sin(OMEGA * s) / OMEGA)) / K


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_mass_lifted_off_a_wall_gets_a_step_of_pressure(integrator):
    """The step in which the gap opens has the pressure whole: an error of first order, 1e-3 at 1 ms."""
    off = []
    for dt in (1e-3, 0.25e-3):
        t = np.arange(round(0.1 / dt) + 1) * dt
        ground = np.stack([-RATE / M * t, 0.0 * t, 0.0 * t])
        history = simulated(on_a_wall(integrator), ground, dt, integrator)
        off.append(np.abs(history.disp[:, 0] - lifted(t)).max() / lifted(t).max())
        assert np.array_equal(history.water[:, 0] > 0.0, history.jump[:, 0, 0] > 0.0)
        assert (history.traction[t > OPENS + dt] == 0.0).all()
        assert np.abs(history.energy["residual"]).max() < 1e-12 * np.ptp(history.energy["input"])
        late = np.flatnonzero(t > OPENS + dt)[:-1]
        if integrator == "generalized_alpha":
            continue  # its accelerations ring after a step of force
        work = RATE * t[late] - PRESSED + WATER - K * history.disp[late, 0]
        assert history.acc[late, 0] == pytest.approx(work / M, rel=0.05, abs=0.05)
    assert off[0] < 1.5e-3 and off[1] < 0.35 * off[0]


@pytest.mark.parametrize("K_n", [1e8, np.inf])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_pressure_goes_as_the_gap_closes_and_the_ledger_stays_shut(integrator, K_n):
    """Opening and closing under a record; without friction nothing slides, and contact only takes."""
    dt, rng = 1e-3, np.random.default_rng(7)
    ground = np.zeros((3, 3000))
    ground[0] = np.convolve(rng.normal(size=3000), np.ones(20) / 4.0, mode="same")
    history = simulated(on_a_wall(integrator, K_n=K_n), ground, dt, integrator)
    opened = history.water[:, 0] > 0.0
    assert np.diff(opened.astype(int)).clip(0).sum() > 2  # openings; how many hangs on the last bit
    closed = (history.state[:-1, 0] > 0) & (history.state[1:, 0] > 0)
    if integrator != "adaptive":  # whose own steps between the rows may open a gap and close it
        assert (history.water[1:, 0][closed] == 0.0).all()
    energy, exchanged = history.energy, np.ptp(history.energy["input"])
    assert np.abs(energy["residual"]).max() < 1e-10 * exchanged
    assert np.abs(energy["friction"]).max() == 0.0
    if integrator != "generalized_alpha":
        assert np.diff(energy["contact"]).min() > -1e-9 * exchanged


def test_friction_sees_the_contact_alone():
    """A block on a table, pressed by 20 kN: with 6 kN of water in an open gap beside it the closed one slides
    at mu times what is left to it."""
    B = np.zeros((6, 3))
    B[0], B[1], B[2], B[3] = [0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]
    law = filled(gap_law(2, K_n=1e9, K_s=5e8, mu=0.5, gap=np.array([0.0, 1e-3])), [6e3, 6e3])
    shaken = 1.5 * np.sin(np.linspace(0.0, 20.0, 2001))
    system = sparse_system(
        2000.0 * np.eye(3), np.diag([1e4, 1e4, 0.0]), B, law, force=[0.0, 0.0, -20e3], floating=True
    )
    system = replace(system, load=np.diag([2000.0, 2000.0, 2000.0]))
    ground = np.stack([4.0 * shaken, 0.0 * shaken, 0.0 * shaken])
    history = simulated(modal_twin(system), ground, 0.001, "modal")
    assert history.water[:, 0].max() == 0.0 and (history.water[:, 1] == 6e3).all()
    assert history.traction[:, 0, 0] == pytest.approx(14e3, rel=1e-6)
    slides = history.state[:, 0] == 2
    assert slides.sum() > 50
    assert np.abs(history.traction[slides, 0, 1]) == pytest.approx(7e3, rel=1e-6)
    assert np.abs(history.energy["residual"]).max() < 1e-10 * np.ptp(history.energy["input"])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_an_open_gap_stays_at_rest(integrator):
    """The static state has the water of its own gaps, and nothing moves from it."""
    system = on_a_wall(integrator, force=100.0)
    q, gaps = static_equilibrium(system, 1e-10)
    assert (system.observe @ q)[0] == pytest.approx((100.0 + WATER) / K)
    assert gaps.water[0] == WATER and gaps.acting[0, 0] == WATER
    history = simulated(system, np.zeros((3, 50)), 1e-3, integrator)
    assert np.ptp(history.disp) < 1e-12 * (100.0 + WATER) / K


def test_water_is_whole_where_rigid_gaps_determine_each_other():
    """Two columns on a table, rigid in three planes, and beside them a body on springs that water moves."""
    table, between = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    B = np.zeros((12, 9))
    B[:3, :3] = B[3:6, 3:6] = table
    B[6:9, :3], B[6:9, 3:6], B[9:, 6:] = -between, between, np.eye(3)
    law = filled(gap_law(4, K_n=np.inf, K_s=np.inf, mu=0.5), [0.0, 0.0, 0.0, WATER])
    stiffness = np.diag([0.0] * 6 + [K] * 3)
    force = [1e3, 0.0, -1e4, 0.0, 0.0, -1e4, 100.0, 0.0, 0.0]
    system = modal_twin(sparse_system(1000.0 * np.eye(9), stiffness, B, law, force=force, floating=True))
    assert equilibrium.ProximalStep.factored(system, equilibrium.rest_shift(system)).compliance > 0.0
    q, gaps = static_equilibrium(system, 1e-10)
    assert gaps.water[3] == WATER
    assert gaps.jump[3, 0] == pytest.approx((100.0 + WATER) / K, rel=1e-9)
    assert (system.B @ q).reshape(4, 3)[3] == pytest.approx(gaps.jump[3], abs=1e-12)


def test_conserving_knows_no_water_in_cracks():
    with pytest.raises(ConfigError, match=r"conserving knows no loads.joint_water.crack; use adaptive"):
        simulated(on_a_wall("modal"), np.zeros((3, 5)), 1e-3, "conserving")


def test_a_crack_that_finds_no_state_is_told(monkeypatch):
    monkeypatch.setattr(equilibrium, "_keeps_water", lambda *_: False)
    monkeypatch.setattr(equilibrium, "_MAX_ITERATIONS", 3)
    with pytest.raises(ConvergenceError, match="gaps still open and close with the water that enters them"):
        static_equilibrium(on_a_wall("modal"), 1e-10)
