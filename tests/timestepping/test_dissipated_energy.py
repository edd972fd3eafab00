"""Energy that every gap dissipates: work of friction in closed form, and the ledger's by every integrator."""

import dataclasses

import numpy as np
import pytest
from further_laws import with_laws
from hand_systems import gap_law, ground, modal_twin, run, sparse_system
from simulating import prepared_for, steps_for

from romdam.core.integrators import INTEGRATORS
from romdam.error.estimate import start_at
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import history_of, simulate

MASS, WEIGHT, MU = (
    np.array([1.0, 2.0, 1.0, 2.0]),
    np.array([10.0, 30.0, 10.0, 30.0]),
    np.array([0.1, 0.2] * 2),
)


def blocks(which=(0, 1), mirrored=False, law=None, spring=0.0):
    """Blocks on a shaken floor, free along it, with unknowns (up, along, across) each and a gap each.

    The gap of a mirrored block has its axis j the other way round.
    """
    which = list(which)
    n = len(which)
    law = gap_law(n) if law is None else law
    law = dataclasses.replace(law, mu=np.repeat(MU[which], 2).reshape(n, 2))
    B = np.eye(3 * n)
    if mirrored:
        B[1 + 3 * (n // 2) :: 3] *= -1.0
    up, along = np.tile([1.0, 0.0, 0.0], n), np.tile([0.0, 1.0, 0.0], n)
    mass = np.repeat(MASS[which], 3)
    system = sparse_system(
        np.diag(mass),
        np.diag(spring * mass * (1.0 - up)),
        B,
        law,
        force=-np.repeat(WEIGHT[which], 3) * up,
        load=mass * along,
        floating=True,
    )
    return dataclasses.replace(system, diagonal=False)


def march(system, acc, dt, integrator, **options):
    system = system if integrator == "generalized_alpha" else modal_twin(system)
    return run(system, acc, dt, integrator=integrator, initial_state="static", **options)


RIGID = ["modal", "adaptive", "generalized_alpha"]  # conserving has no rigid gaps on massive boundaries


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_block_that_slides_steadily_takes_mu_N_times_its_slip(integrator):
    """A floor at 5 m/s2: blocks of mu g 1 and 3 m/s2 fall back by (5 - mu g) t^2 / 2, against 1 and 6 N.

    On a shear stiffness K_s the first mu N / K_s of it are no slip.
    """
    limit, fall = np.array([1.0, 6.0]), np.array([4.0, 2.0])
    dt = 1e-3 if integrator in RIGID else 5e-4
    K_s = np.inf if integrator in RIGID else 4e7  # reached at once
    law = gap_law(2, K_n=np.inf if integrator in RIGID else 1e6, K_s=K_s)
    h = march(blocks(law=law), 5.0 * np.ones(round(1.0 / dt) + 1), dt, integrator)
    slip = np.abs(h.jump[100:, :, 1]) - limit / K_s
    assert h.dissipated_energy[100:] == pytest.approx(limit * slip, rel=1e-9 if integrator in RIGID else 1e-5)
    assert h.dissipated_energy[-1] == pytest.approx(limit * fall / 2.0, rel=2e-3)
    assert h.dissipated_energy.sum(axis=1) == pytest.approx(h.energy["friction"], rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("integrator", RIGID)
def test_what_slides_to_and_fro_is_added_up(integrator):
    """Rows at every step, none cut: within each the block slides one way only."""
    t, options = np.arange(4001) * 1e-3, {"cuts": ()} if integrator == "adaptive" else {}
    h = march(blocks(), 5.0 * np.sin(2 * np.pi * t), 1e-3, integrator, **options)
    moved = np.diff(h.jump[:, :, 1], axis=0)
    assert moved.min() < -1e-5 and moved.max() > 1e-5
    accumulated = np.abs(moved).cumsum(axis=0)
    limit = MU[:2] * WEIGHT[:2]
    assert h.dissipated_energy[1:] == pytest.approx(limit * accumulated, rel=1e-9, abs=1e-12)
    assert (accumulated[-1] > 3.0 * np.abs(h.jump[-1, :, 1])).all()


def shaking(seconds=3.0, dt=0.005):
    t = np.arange(round(seconds / dt) + 1) * dt
    return 6.0 * np.sin(7.0 * t) + np.random.default_rng(0).standard_normal(len(t))


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_ledger_s_friction_is_the_sum_over_the_gaps(integrator):
    """Soft gaps that slide, stick, and unload, each by itself."""
    system = blocks(law=gap_law(2, K_n=1e5, K_s=2e4), spring=20.0)
    h = march(system, shaking(), 0.005, integrator, stride=4)
    energy = h.dissipated_energy
    assert set(np.unique(h.state[1:])) == {1, 2}
    assert (energy[0] == 0.0).all() and (energy[-1] > 1.0).all() and np.diff(energy, axis=0).min() >= -1e-9
    assert energy.sum(axis=1) == pytest.approx(h.energy["friction"], rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("integrator", ["modal", "adaptive", "generalized_alpha"])
def test_bonds_that_break_and_dashpots_are_booked_where_they_are(integrator):
    """The first gap has a bond that breaks, the second a dashpot, the third neither."""
    law = with_laws(
        gap_law(3, K_n=1e5, K_s=2e4), cohesion=[5.0, 0.0, 0.0], tensile_strength=[1.0, 0.0, 0.0],
        viscosity=[0.0, 500.0, 0.0],
    )  # fmt: skip
    system = blocks((0, 1, 2), law=law, spring=20.0)
    M = np.repeat(MASS[:3], 3)
    lifted = system.load.copy()
    lifted[:, 0] += 0.3 * M * np.tile([1.0, 0.0, 0.0], 3)  # shaken upwards too: the dashpot works
    h = march(dataclasses.replace(system, load=lifted), shaking(), 0.005, integrator)
    energy = h.dissipated_energy
    assert h.bonded[0, 0] and not h.bonded[-1, 0]
    assert (energy[-1] > 0.1).all()
    size = np.abs(energy).max()
    assert energy.sum(axis=1) == pytest.approx(h.energy["friction"], rel=1e-12, abs=1e-12 * size)
    without = march(
        dataclasses.replace(system, load=lifted, law=dataclasses.replace(system.law, viscosity=np.zeros(3))),
        shaking(), 0.005, integrator,
    )  # fmt: skip
    others = [0, 2]  # blocks by themselves: one is nothing to the others, but steps are cut elsewhere
    close = 0.02 if integrator == "adaptive" else 1e-6
    assert energy[:, others] == pytest.approx(without.dissipated_energy[:, others], rel=close, abs=1e-6)
    assert abs(energy[-1, 1] - without.dissipated_energy[-1, 1]) > 1e-3


def test_a_broken_bond_s_energy_is_in_its_gap():
    """A push grows by 1 N per ms against K_n 1e6: one bond breaks at 50 N, the other at 1 kN holds."""
    law = with_laws(gap_law(2, K_n=1e6), tensile_strength=[50.0, 1e3])
    system = sparse_system(np.eye(2), 1e4 * np.eye(2), np.eye(2), law, C=20.0 * np.eye(2), load=[1.0, 1.0])
    h = run(modal_twin(system), -np.linspace(0.0, 100.0, 100001), 1e-6, stride=100)
    assert h.dissipated_energy[-1] == pytest.approx([0.5 * 50.0**2 / 1e6, 0.0], rel=0.02, abs=1e-15)


def test_both_halves_of_a_model_that_mirrors_itself():
    """Four blocks, two of them mirrored, are integrated as two; each half dissipates what it does alone."""
    law = gap_law(4, K_n=1e5, K_s=2e4)
    half = dataclasses.replace(gap_law(2, K_n=1e5, K_s=2e4))
    whole = march(blocks((0, 1, 2, 3), True, law, 20.0), shaking(), 0.005, "adaptive")
    each = march(blocks((0, 1, 2, 3), True, law, 20.0), shaking(), 0.005, "adaptive", merge_contacts=False)
    alone = march(blocks((0, 1), False, half, 20.0), shaking(), 0.005, "adaptive", merge_contacts=False)
    assert (whole.stats["integrated_gaps"], each.stats["integrated_gaps"]) == (2, 4)
    energy = whole.dissipated_energy
    assert energy[-1].min() > 1.0
    assert energy[:, :2] == pytest.approx(energy[:, 2:], rel=1e-12)
    assert energy == pytest.approx(each.dissipated_energy, rel=1e-7, abs=1e-9)
    assert energy[:, :2] == pytest.approx(alone.dissipated_energy, rel=1e-7, abs=1e-9)
    assert energy.sum(axis=1) == pytest.approx(whole.energy["friction"], rel=1e-12, abs=1e-14)
    assert whole.strength == pytest.approx(each.strength, rel=1e-7, abs=1e-7)
    assert whole.jump[..., 1].max() > 1e-3
    assert whole.jump[:, 2:, 1] == pytest.approx(-whole.jump[:, :2, 1], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("integrator", ["modal", "adaptive", "conserving"])
def test_runs_that_march_together_have_the_bits_of_lone_ones(integrator):
    system = modal_twin(blocks(law=gap_law(2, K_n=1e5, K_s=2e4), spring=20.0))
    prepared, settings = prepared_for(system, integrator), Settings(steps_for(integrator, 0.005, 2))
    grounds = [ground(factor * shaking(seconds)) for factor, seconds in ((1.0, 2.0), (0.5, 3.0), (2.0, 1.0))]
    together = [history_of(one) for one in simulate(prepared, grounds, settings)]
    for one, motion in zip(together, grounds, strict=True):
        alone = history_of(simulate(prepared, [motion], settings)[0])
        assert one.dissipated_energy[-1].min() > 0.0
        assert np.array_equal(one.dissipated_energy, alone.dissipated_energy)
        assert np.array_equal(one.mean_traction, alone.mean_traction)


@pytest.mark.parametrize("integrator", ["modal", "conserving"])
def test_a_run_that_goes_on_from_a_row_dissipates_the_rest(integrator):
    system = modal_twin(blocks(law=gap_law(2, K_n=1e5, K_s=2e4), spring=20.0))
    system, row = dataclasses.replace(system, reduced=True), 237
    whole = run(system, shaking(), 0.005, integrator=integrator, tolerance=1e-10)
    start = start_at(whole, system.law, row, whole.jump[row])
    rest = run(system, shaking()[row:], 0.005, integrator=integrator, start=start, tolerance=1e-10)
    left = whole.dissipated_energy[row:] - whole.dissipated_energy[row]
    assert left[-1].min() > 1.0
    assert rest.dissipated_energy == pytest.approx(left, rel=1e-9, abs=1e-9 * left[-1].max())
