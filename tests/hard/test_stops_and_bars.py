"""Beams and bars that meet a stop, with answers known from elsewhere; no case has any damping.

SDNL104 is a case of the Code_Aster validation manuals (V5.02), the bouncing bar is of Doyen, Ern, Piperno,
SIAM J. Sci. Comput. 33 (2011) 223, the hook is problem 6-004 of the SAP2000 verification manual.
"""

import math

import numpy as np
import pytest
from hand_systems import gap_law, modal_twin, pulse, run, sparse_system, still
from soundness import assert_sound

from romdam.core.integrators import INTEGRATORS
from romdam.timestepping.equilibrium import static_equilibrium

MODAL = [name for name in INTEGRATORS if name not in ("generalized_alpha", "conserving")]


def _cantilever(elements=10, L=1.0, R=0.1, E=1e10, rho=1e6, **law):
    """Euler-Bernoulli beam clamped at x = 0 without rotary inertia; the tip's stop is on its lower side.

    Unknowns are deflection and slope of every node but the first.
    """
    h, A, I = L / elements, math.pi * R**2, math.pi * R**4 / 4.0
    K_e = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]])
    K_e = np.vstack([K_e, -K_e[0], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]) * (E * I / h**3)
    M_e = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h]]
    M_e += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    M, K = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        M[at, at] += rho * A * h / 420.0 * np.array(M_e)
        K[at, at] += K_e
    tip = np.zeros(2 * elements)
    tip[-2] = 1.0
    return modal_twin(sparse_system(M[2:, 2:], K[2:, 2:], [tip], gap_law(1, **law), force=-1000.0 * tip))


def _at(history, values, time):
    return float(np.interp(time, history.time, values))


@pytest.mark.parametrize(
    ("integrator", "dt", "rows", "near"),
    [("conserving", 2.5e-5, 0.01, 1e-3), ("adaptive", 5e-6, 0.02, 2e-3), ("modal", 5e-6, 0.02, 2e-3)],
)
def test_sdnl104_cantilever_against_a_stop(integrator, dt, rows, near):
    """Tip step of -1000 N, stop after 1e-4 m with 1e8 N/m; the limits for dt to 0 of the ten elements.

    Peak contact force 2782.7 N, least deflection -1.27827e-4 m, u(0.1315) -1.8397e-6 m, v(0.1566) -4.601e-3
    m/s, kinetic energy(0.16) 0.051440 J. The implicit constant force is of first order and needs the
    smaller step; u(0.1315) is near a zero of u, hence 2 % of it for those (0.03 % of the largest u).
    """
    h = run(_cantilever(K_n=1e8, gap=1e-4), still(0.2, dt), dt, integrator=integrator)
    u, v = h.disp[:, -2], h.vel[:, -2]
    assert h.peaks["compression"][0] == pytest.approx(2782.7, rel=1e-3)
    assert u.min() == pytest.approx(-1.27827e-4, rel=1e-3)
    assert _at(h, u, 0.1315) == pytest.approx(-1.8397e-6, rel=rows)
    assert _at(h, v, 0.1566) == pytest.approx(-4.601e-3, rel=rows)
    assert _at(h, h.energy["kinetic"], 0.16) == pytest.approx(0.051440, rel=near)
    found = assert_sound(gap_law(1, K_n=1e8, gap=1e-4), h)
    assert found["contact_share"] <= (1e-12 if integrator == "conserving" else 2e-3)


def test_sdnl104_reduced_to_a_few_modes_and_the_rest_as_flexibility():
    """A coarse step leaves fewer states to the conserving scheme; peak and depth stay within 0.1 %."""
    h = run(_cantilever(K_n=1e8, gap=1e-4), still(0.2, 1e-4), 1e-4, integrator="conserving")
    assert h.peaks["compression"][0] == pytest.approx(2782.7, rel=1e-3)
    assert h.disp[:, -2].min() == pytest.approx(-1.27827e-4, rel=1e-3)


def _bar(elements, force=0.0, L=10.0, E=900.0, rho=1.0, **law):
    """A loose bar of unit section along x with consistent mass; a wall at its left end."""
    h, n = L / elements, elements + 1
    M, K = np.zeros((2, n, n))
    for e in range(elements):
        at = slice(e, e + 2)
        M[at, at] += rho * h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        K[at, at] += E / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
    left, mass = np.eye(n)[:1], M @ np.ones(n)
    law = gap_law(1, **law)
    return modal_twin(sparse_system(M, K, left, law, force=force * mass, load=mass, floating=True)), law


@pytest.mark.parametrize("stiffness", [{}, {"K_n": 1e7}], ids=["rigid", "stiff"])
def test_bouncing_bar(stiffness):
    """L 10, E 900, rho 1, g 10, dropped by 5: period 16/3 s, contact from 1 to 5/3 and from 11/3 to 13/3 s.

    The pressure in contact is 300 + 300 (t - 1) and no energy is lost.
    300 elements, step 1/300 s; ten bounces.
    """
    dt, drop = 1.0 / 300.0, 500.0
    bar, law = _bar(300, force=-10.0, gap=5.0, **stiffness)
    h = run(bar, still(5 * 16 / 3, dt), dt, integrator="conserving")
    t, p = h.time, h.traction[:, 0, 0]
    edges = t[1:][np.diff((p > 0.0).astype(int)) != 0]
    assert edges[:4] == pytest.approx([1.0, 5 / 3, 11 / 3, 13 / 3], abs=1.001 * dt)
    starts = edges[np.diff(edges, prepend=-1.0) > 1.0]
    assert len(starts) == 10
    tenth = 1.0 + 4 * 16 / 3 + 8 / 3
    assert starts[9] == pytest.approx(tenth, abs=0.15)  # a little earlier with every bounce
    middle = (t > 1.0 + 0.05) & (t < 5 / 3 - 0.05)  # the pressure jumps at both ends
    assert np.abs(p[middle] / (300.0 + 300.0 * (t[middle] - 1.0)) - 1.0).max() <= 0.05
    assert np.abs(h.energy["contact"]).max() <= 1e-3 * drop
    assert_sound(law, h)


@pytest.mark.parametrize("stiffness", [{}, {"K_n": 1e6}], ids=["rigid", "stiff"])
def test_bar_against_a_wall_keeps_its_energy(stiffness):
    """v 2 against a wall: contact lasts 2 L / c = 2/3 s under rho c v = 60, and the bar leaves with v 2."""
    dt, v = 1.0 / 600.0, 2.0
    bar, law = _bar(300, gap=0.5, **stiffness)
    h = run(bar, pulse(-v, 1.4, 6, dt), dt, integrator="conserving")
    t, p = h.time, h.traction[:, 0, 0]
    loaded = t[p > 0.5 * 60.0]
    reached = 0.01 + 0.5 / v
    assert loaded[0] == pytest.approx(reached, abs=3 * dt)
    assert loaded[-1] - loaded[0] == pytest.approx(2.0 / 3.0, abs=4 * dt)
    middle = (t > reached + 0.05) & (t < reached + 2 / 3 - 0.05)
    assert np.abs(p[middle] / 60.0 - 1.0).max() <= 0.05
    assert h.mean_traction[:, 0, 0].sum() * dt == pytest.approx(2 * 10.0 * v, rel=1e-3)
    assert h.energy["kinetic"][-1] + h.energy["strain"][-1] == pytest.approx(0.5 * 10.0 * v**2, rel=1e-6)
    assert_sound(law, h)


def test_sap2000_hook():
    """A rod of 100 in shrinks by 0.065 in and is caught after 0.04 in by a hook of 5000 kip/in.

    0.025 in / (L/EA + 1/K) = 45.886 kip and 0.04918 in, in equilibrium and at rest after a transient.
    """
    inch, kip = 0.0254, 4448.2216
    rod, K_n = 29000.0 * 10.0 / 100.0 * kip / inch, 5000.0 * kip / inch
    law = gap_law(1, K_n=K_n, gap=0.04 * inch)
    system = sparse_system([[1e5]], [[rod]], [[1.0]], law, C=[[1e7]], force=[-rod * 0.065 * inch])
    _, gaps = static_equilibrium(modal_twin(system), 1e-8)
    assert gaps.force[0, 0] / kip == pytest.approx(45.886, rel=1e-5)
    assert (0.04 * inch - gaps.jump[0, 0]) / inch == pytest.approx(0.04918, rel=1e-4)
    for integrator in MODAL:
        h = run(modal_twin(system), still(1.0, 1e-3), 1e-3, integrator=integrator)
        assert h.traction[-1, 0, 0] / kip == pytest.approx(45.886, rel=1e-4)
        assert h.disp[-1, 0] / inch == pytest.approx(-0.04918, rel=1e-4)
        assert_sound(law, h)
