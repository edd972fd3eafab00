"""Laws beyond stiffness and friction in marches whose answers are known."""

import numpy as np
import pytest
from further_laws import with_laws
from hand_systems import assert_ledger, gap_law, modal_twin, run, sparse_system, still


def _bar_system(law, force=None):
    """Mass 1 kg on a spring of 1e4 N/m, tied by one gap to a wall: jump = u; the ground shakes along x."""
    return modal_twin(sparse_system([[1.0]], [[1e4]], [[1.0]], law, C=[[20.0]], load=[1.0], force=force))


def test_sdnd106_static_and_dynamic_friction():
    """Two masses of 5 kg, spring 1e4 N/m, 10 kN on the first, mu 0.3 and 0.2, 3000 N on the second for 0.2 s.

    First slip 0.03512 s, re-stick 0.31492 s and four displacements (code_aster V5.03.106). The first mass is
    pressed on a rigid floor; unknowns are its height, x1 and x2.
    """
    dt = 2e-5
    law = with_laws(gap_law(1, mu=0.2), friction_static=[[0.3, 0.3]])
    M, K = np.diag([5.0, 5.0, 5.0]), np.array([[0, 0, 0], [0, 1e4, -1e4], [0, -1e4, 1e4]], dtype=float)
    B = [[1, 0, 0], [0, 1, 0], [0, 0, 0]]
    system = modal_twin(
        sparse_system(M, K, B, law, force=[-1e4, 0.0, 0.0], load=[0.0, 0.0, -1.0], floating=True)
    )
    push = still(0.34, dt)
    push[: round(0.2 / dt)] = 3000.0
    h = run(system, push, dt, integrator="modal")
    x1, x2 = h.disp[:, 1], h.disp[:, 2]

    def at(t):
        return round(t / dt)

    assert x2[at(0.02)] == pytest.approx(0.11221, rel=1e-3)
    assert x1[at(0.15)] == pytest.approx(1.35332, rel=1e-3)
    assert x2[at(0.15)] == pytest.approx(1.80751, rel=1e-3)
    assert x2[at(0.339965)] == pytest.approx(3.96813, rel=1e-3)
    moving = np.flatnonzero(h.state[:, 0] == 2)
    assert h.time[moving[0]] == pytest.approx(0.03512, rel=1e-3)
    assert h.time[moving[-1]] == pytest.approx(0.31492, rel=1e-3)
    assert_ledger(h)


def test_a_bond_breaks_at_its_strength_and_not_before():
    """A push grows by 1 N per ms against K_n 1e6 beside 1e4 N/m: the bond holds 100/101 of it, up to 50 N."""
    law = with_laws(gap_law(1, K_n=1e6), tensile_strength=[50.0])
    h = run(_bar_system(law), -np.linspace(0.0, 100.0, 100001), 1e-6)
    force = h.traction[:, 0, 0]
    broken = np.flatnonzero(h.state[:, 0] == 0)[1]  # the first row is the undeformed start
    assert force.min() == pytest.approx(-50.0, rel=1e-3)
    assert h.time[broken] == pytest.approx(0.0505, rel=0.02)  # the ramp rings by 1 N
    assert (force[broken:] >= 0.0).all()
    assert h.energy["friction"][-1] == pytest.approx(0.5 * 50.0**2 / 1e6, rel=0.02)
    assert_ledger(h)


@pytest.mark.parametrize("strength", [0.0, 0.4e3, 1e3])
def test_a_stronger_bond_holds(strength):
    """50 N/kg to both sides: the bond that holds stays stiff in tension, the broken one opens by 5 mm."""
    law = with_laws(gap_law(1, K_n=1e6), tensile_strength=[strength])
    h = run(_bar_system(law), -np.linspace(0.0, 500.0, 20001), 1e-5)
    assert (h.jump[-1, 0, 0] > 1e-2) == (strength < 500.0)
    assert_ledger(h)


def _slider(**laws):
    """A mass of 1 kg pressed by 10 N on a floor, tangentially on a weak spring, shaken along x."""
    law = with_laws(gap_law(1, K_n=1e6, K_s=1e6, mu=0.5), **laws)
    M, K = np.eye(3), np.diag([0.0, 10.0, 10.0])
    return modal_twin(
        sparse_system(M, K, np.eye(3), law, force=[-10.0, 0, 0], load=[0, 1.0, 0], floating=True)
    )


def test_cohesion_holds_and_is_lost_at_the_first_slip():
    """mu N = 5 N, c = 20 N: slip begins above 25 N and goes on at 5 N."""
    h = run(_slider(cohesion=[20.0]), -np.linspace(0.0, 60.0, 60001), 1e-5, initial_state="static")
    t = np.abs(h.traction[:, 0, 1])
    slips = np.flatnonzero(h.state[:, 0] == 2)
    assert t.max() == pytest.approx(25.0, rel=0.02)
    assert t[slips] == pytest.approx(5.0 * np.ones(len(slips)), rel=0.05)
    assert_ledger(h)


@pytest.mark.parametrize(("axis", "holds"), [([1.0, 0.0], True), ([0.0, 1.0], False)])
def test_a_key_holds_in_its_direction_closed_and_open(axis, holds):
    """Lifted by 1 mm below a depth of 0.1 m; 50 N along j, no friction acts there. K_s 1e6 beside 10 N/m."""
    law = with_laws(gap_law(1, K_n=1e6, K_s=1e6, mu=0.5), shear_key=[[0.1, *axis]])
    M, K = np.eye(3), np.diag([1e3, 10.0, 10.0])
    C = np.diag([60.0, 6.0, 6.0])
    system = modal_twin(sparse_system(M, K, np.eye(3), law, C=C, force=[1.0, 0, 0], load=[0, 1.0, 0]))
    h = run(system, -50.0 * np.minimum(np.linspace(0, 10, 20001), 1.0), 1e-4, initial_state="static")
    assert (h.jump[:, 0, 0] > 0.5e-3).all()
    assert (np.abs(h.jump[-1, 0, 1]) < 1e-3) == holds
    if holds:
        assert abs(h.traction[-1, 0, 1]) == pytest.approx(50.0, rel=1e-2)
    assert_ledger(h)


def test_a_key_lets_go_above_its_depth():
    law = with_laws(gap_law(1, K_n=1e6, K_s=1e6, mu=0.5), shear_key=[[0.01, 1.0, 1.0]])
    M, K, C = np.eye(3), np.diag([1e3, 10.0, 10.0]), np.diag([60.0, 6.0, 6.0])
    system = modal_twin(sparse_system(M, K, np.eye(3), law, C=C, load=[1.0, 1.0, 0]))
    h = run(system, -50.0 * np.minimum(np.linspace(0, 4, 8001), 1.0), 1e-4)
    out = np.flatnonzero(h.jump[:, 0, 0] > 0.01)
    assert len(out)
    assert (h.traction[out, 0, 1] == 0.0).all()
    before = h.jump[:, 0, 0] < 0.01
    assert np.abs(h.jump[before, 0, 1]).max() < 1e-3
    assert_ledger(h)


@pytest.mark.parametrize("xi", [0.05, 0.2, 0.5])
def test_restitution_of_a_viscous_contact(xi):
    """Mass against spring and dashpot, v = 1 m/s: it leaves where k x + c x' = 0 and no tension acts.

    x = v/w_d exp(-xi w t) sin w_d t; the force is zero at w_d t = atan2(2 xi s, 2 xi^2 - 1), with
    s = sqrt(1 - xi^2), hence the velocity there (Schwager, Poeschel, Granular Matter 9 (2007) 465).
    """
    k, w = 1e6, 1e3
    s = np.sqrt(1.0 - xi**2)
    t = np.arctan2(2 * xi * s, 2 * xi**2 - 1.0) / (w * s)
    v = np.exp(-xi * w * t) * (np.cos(w * s * t) - xi / s * np.sin(w * s * t))
    law = with_laws(gap_law(1, K_n=k), viscosity=[2 * xi * w])
    system = modal_twin(sparse_system([[1.0]], [[0.0]], [[1.0]], law, load=[1.0], floating=True))
    dt = 1e-7
    acc = still(0.006, dt)
    acc[: round(1e-4 / dt)] = 1e4
    h = run(system, acc, dt, integrator="modal", stride=100)
    assert h.vel[-1, 0] == pytest.approx(-v, rel=0.03)
    assert_ledger(h)


def _pressed(law):
    """A mass of 1 kg pressed by 10 N on a floor, free along it."""
    static = {"force": [-10.0, 0, 0], "load": [0, 1.0, 0], "floating": True}
    return sparse_system(np.eye(3), np.zeros((3, 3)), np.eye(3), law, **static)


def _speed_of_a_sliding_mass(t, push, mu_s, mu_d, v_c):
    """v' = A - B exp(-v / v_c) from rest, A = push - 10 mu_d, B = 10 (mu_s - mu_d)."""
    A, B = push - 10.0 * mu_d, 10.0 * (mu_s - mu_d)
    return v_c * np.log(B / A + (1.0 - B / A) * np.exp(A * t / v_c))


@pytest.mark.parametrize(("mu_s", "mu_d"), [(0.6, 0.4), (0.3, 0.5)], ids=["falls", "rises"])
def test_friction_that_changes_with_speed(mu_s, mu_d):
    """1 kg on a floor, 10 N down and 7 N along: the speed in closed form, the error of second order."""
    push, v_c, errors = 7.0, 0.5, []
    law = with_laws(gap_law(1, K_n=1e6), velocity=(mu_s, mu_d, v_c))
    system = modal_twin(_pressed(law))
    for dt in (2e-3, 1e-3):
        h = run(system, -push * np.ones(round(1.0 / dt) + 1), dt, initial_state="static")
        v = _speed_of_a_sliding_mass(h.time, push, mu_s, mu_d, v_c)
        errors.append(np.abs(h.vel[:, 1] - v).max() / v.max())
        assert_ledger(h)
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.3)


def test_friction_that_falls_with_speed_holds_up_to_the_static_limit():
    """Pushed slowly harder, the mass sticks up to mu_s N = 6 N, then slides at mu_d N."""
    law = with_laws(gap_law(1, K_n=1e6), velocity=(0.6, 0.4, 1e-3))
    system = modal_twin(_pressed(law))
    h = run(system, -np.linspace(0.0, 7.0, 7001), 1e-4, initial_state="static")
    shear = np.abs(h.traction[:, 0, 1])
    assert shear.max() == pytest.approx(6.0, rel=1e-3)
    assert shear[-1] == pytest.approx(4.0, rel=1e-3)
    assert_ledger(h)
