"""Bonds that soften in marches and at rest: snap-back, the energy ledger, several gaps, other integrators."""

import numpy as np
import pytest
from further_laws import with_laws
from hand_systems import assert_ledger, gap_law, modal_twin, run, sparse_system, still

F, G = 50.0, 0.01  # N, J: through at 0.4 mm


def bar(masses=5, stiffness=2e4, fracture=(F, G, 0.0, 0.0), force=0.0, K_n=1e6):
    """A bar of 1 kg, bonded to a wall on its left, on a weak spring on its right; the ground shakes along x.

    Pulled by 50 N the bar stores F^2 / 2 k: 0.06 J per spring, 25 times G_f in all of them.
    """
    k = np.full(masses - 1, stiffness)
    K = np.diag(np.append(k, 100.0)) + np.diag(np.append(0.0, k)) - np.diag(k, 1) - np.diag(k, -1)
    K[-1, -1] = (k[-1] if masses > 1 else 0.0) + 100.0
    B = np.zeros((1, masses))
    B[0, 0] = 1.0
    share = np.full(masses, 1.0 / masses)
    pull = np.zeros(masses)
    pull[-1] = force
    law = with_laws(gap_law(1, K_n=K_n), fracture=[fracture])
    return sparse_system(np.diag(share), K, B, law, load=share, force=pull)


@pytest.mark.parametrize("K_n", [1e6, np.inf])
@pytest.mark.parametrize("dt", [1e-3, 1e-4, 1e-5])
def test_a_bar_that_stores_more_than_the_crack_takes_snaps_back(dt, K_n):
    """Pulled by a ramp of 100 N in 0.5 s: what the bar has beyond G_f goes into motion, at every step."""
    acc = -np.linspace(0.0, 100.0, round(0.5 / dt) + 1)
    h = run(modal_twin(bar(K_n=K_n)), acc, dt, integrator="modal")
    assert_ledger(h, 1e-10)
    assert h.jump[-1, 0, 0] > 1e-3 and h.traction[-1, 0, 0] == 0.0
    assert h.energy["friction"][-1] == pytest.approx(G, rel=1e-3)
    assert h.dissipated_energy[-1, 0] == pytest.approx(G, rel=1e-3)
    assert -h.traction[:, 0, 0].min() == pytest.approx(F, rel=0.03)
    moved = h.energy["kinetic"][-1] + h.energy["strain"][-1] + h.energy["contact"][-1] + G
    assert h.energy["input"][-1] == pytest.approx(moved, rel=1e-8)


@pytest.mark.parametrize("integrator", ["modal", "adaptive", "generalized_alpha"])
def test_integrators_agree_on_the_energy(integrator):
    system = bar()
    system = system if integrator == "generalized_alpha" else modal_twin(system)
    h = run(system, -np.linspace(0.0, 100.0, 5001), 1e-4, integrator=integrator)
    assert h.dissipated_energy[-1, 0] == pytest.approx(G, rel=1e-3)
    if integrator != "generalized_alpha":
        assert_ledger(h, 1e-10)


def test_a_load_at_rest_softens_the_joint_to_its_equilibrium():
    """K u + T(u) = f on a spring stiffer than the curve falls: u and what is left in closed form.

    K 3e5 N/m beside the rigid joint; T = 50 - 1.25e5 u; f = 80 N: u = 30 / 1.75e5, T = 28.6 N.
    """
    law = with_laws(gap_law(1), fracture=[(F, G, 0.0, 0.0)])
    system = modal_twin(sparse_system([[1.0]], [[3e5]], [[1.0]], law, force=[80.0], load=[1.0]))
    h = run(system, still(0.01, 1e-4), 1e-4, integrator="modal", initial_state="static")
    u = 30.0 / 1.75e5
    assert h.jump[0, 0, 0] == pytest.approx(u, rel=1e-9)
    assert -h.traction[0, 0, 0] == pytest.approx(50.0 - 1.25e5 * u, rel=1e-9)
    assert np.ptp(h.jump[:, 0, 0]) <= 1e-9 * u  # stays at rest
    assert h.energy["joint_stored"][0] == pytest.approx(0.5 * (50.0 - 1.25e5 * u) * u, rel=1e-9)
    assert h.energy["friction"][-1] <= 1e-9 * G


def test_shear_under_compression_takes_its_energy_and_rubs_on():
    """1 kg pressed by 10 N, mu 0.5, c 20 N, G_II 0.02 J: work in the gap is G_II + mu p times the slip."""
    law = with_laws(gap_law(1, K_n=1e6, K_s=1e6, mu=0.5), fracture=[(5.0, G, 20.0, 0.02)])
    M, K = np.eye(3), np.diag([0.0, 10.0, 10.0])
    system = sparse_system(M, K, np.eye(3), law, force=[-10.0, 0, 0], load=[0, 1.0, 0], floating=True)
    h = run(
        modal_twin(system), -np.linspace(0.0, 60.0, 6001), 1e-4, initial_state="static", integrator="modal"
    )
    assert_ledger(h, 1e-10)
    slip = abs(h.jump[-1, 0, 1]) - 5.0 / 1e6
    assert slip > 0.05
    assert np.abs(h.traction[-1, 0]) == pytest.approx([10.0, 5.0, 0.0], rel=1e-6, abs=1e-9)
    assert np.abs(h.traction[:, 0, 1]).max() == pytest.approx(25.0, rel=0.01)
    assert h.energy["friction"][-1] - 5.0 * slip == pytest.approx(0.02, rel=5e-3)


@pytest.mark.parametrize(("gaps", "off"), [(4, 0.02), (8, 0.006), (32, 0.003)])
def test_moment_against_angle_and_energy_are_those_of_any_number_of_gaps(gaps, off):
    """A stiff bar turns about its lower end against gaps over its height of 1 m, f 1000 N/m, y_c 1 mm.

    By integration over the height: M(a) = int z f (1 - a z / y_c)+ dz, and likewise the energy.
    """
    f, y_c, K, angle = 1000.0, 1e-3, 4e6, 3e-3
    z = (np.arange(gaps) + 0.5) / gaps
    fracture = [(f / gaps, 0.5 * f / gaps * y_c, 0.0, 0.0)] * gaps
    law = with_laws(gap_law(gaps, K_n=1e9 / gaps), fracture=fracture)
    system = sparse_system([[1.0]], [[K]], z[:, None], law, load=[1.0], C=[[2e3]])
    h = run(modal_twin(system), -np.linspace(0.0, K * angle, 4001), 1e-3, integrator="modal")
    assert_ledger(h, 1e-10)
    a = h.jump[:, -1, 0] / z[-1]
    s = np.linspace(0.0, 1.0, 4001)
    softening = np.flatnonzero(a > 2e-5)[::50]
    left = np.maximum(1.0 - np.outer(a[softening], s) / y_c, 0.0)
    taken = np.trapezoid(0.5 * f * y_c * (1.0 - left**2), s, axis=1)
    stored = np.trapezoid(0.5 * f * left * np.outer(a[softening], s), s, axis=1)
    energy = h.dissipated_energy[softening].sum(axis=1) + h.energy["joint_stored"][softening]
    assert np.abs(energy - taken).max() <= off * 0.5 * f * y_c
    assert energy[-1] - h.energy["joint_stored"][softening][-1] == pytest.approx(
        taken[-1] - stored[-1], rel=off
    )
    moment = -h.traction[softening][..., 0] @ z
    assert np.abs(moment - np.trapezoid(s * f * left, s, axis=1)).max() <= off * 0.5 * f
