"""Elastic constants, loads, springs and damping of a block of 2 x 3 x 5 m, worked out on paper."""

from types import SimpleNamespace

import numpy as np
import pytest
from scene_builders import box

from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.scene import Absorbing, Block, Material, StaticLoads
from romdam.fem.absorbing import boundary_dashpots, boundary_springs
from romdam.fem.balance import balance_at_rest
from romdam.fem.column import wave_moduli
from romdam.fem.damping import modal_coefficients, rayleigh_coefficients, rigid_drag
from romdam.fem.loads import thermal_force
from romdam.fem.material import lame
from romdam.fem.stress import stress_operator, thermal_stress
from romdam.scene.ground.viscous import _distance
from romdam.scene.temperature import slab_weights

# lambda = 24 0.25 / (1.25 0.5) = 9.6 and mu = 24 / 2.5 = 9.6 GPa; other numbers where lambda is not mu
CONCRETE = Material(24e9, 0.25, 2400.0, expansion=2e-5)
ROCK = Material(26e9, 0.3, 2500.0)  # 15 and 10 GPa
CORNERS = np.array([[x, y, z] for z in (0.0, 5.0) for x, y in ((0, 0), (2, 0), (2, 3), (0, 3))])


def block(material, absorbing=()):
    return Block("b", "hex8", CORNERS, np.arange(8)[None], material, {}, absorbing=absorbing)


def test_elastic_constants():
    assert lame(CONCRETE) == pytest.approx((9.6e9, 9.6e9)) and lame(ROCK) == pytest.approx((15e9, 10e9))
    np.testing.assert_allclose(wave_moduli(ROCK), [10e9, 10e9, 35e9])


def test_stress_of_linear_displacement():
    """u = A x with strains 1, 2, -1 and shears 3, 5, 7: 15 2 + 2 10 e along, 10 times the sum across."""
    A = np.array([[1.0, 2, 3], [1, 2, 4], [4, 1, -1]])
    found = stress_operator(block(ROCK), np.array([1, 6])) @ (CORNERS @ A.T).ravel()
    expected = 1e9 * np.array([30 + 20, 30 + 40, 30 - 20, 10 * 3, 10 * 5, 10 * 7])
    np.testing.assert_allclose(found.reshape(2, 6), [expected, expected], rtol=1e-9)


def test_held_back_expansion():
    """5 K less: strain 1e-4 is wanted; (3 15 + 2 10) GPa 1e-4 = 6.5 MPa, and so E alpha / (1 - 2 nu)."""
    warm = Material(26e9, 0.3, 2500.0, expansion=2e-5)
    sites = SimpleNamespace(blocks={"b": SimpleNamespace(nodes=np.arange(2))})
    loads = StaticLoads(warmed={"b": -5.0})
    scene = SimpleNamespace(stress=sites, blocks={"b": block(warm)}, loads=loads)
    np.testing.assert_allclose(thermal_stress(scene)["b"], [[6.5e6, 6.5e6, 6.5e6, 0, 0, 0]] * 2, rtol=1e-12)
    force = thermal_force(block(warm), -5.0)
    np.testing.assert_allclose(force[4:].sum(axis=0), [0, 0, -6.5e6 * 6.0], atol=1e-3)  # of the top, 6 m2
    np.testing.assert_allclose(force[[1, 2, 5, 6]].sum(axis=0), [-6.5e6 * 15.0, 0, 0], atol=1e-3)


def test_springs_and_dashpots_of_a_foot():
    """6 m2, 4 m from the dam: 4/3 and 2/3 G / R; sqrt(2500 35e9) and sqrt(2500 10e9) = 5e6 for each m2."""
    foot = (Absorbing(np.array([[0, 3, 2, 1]]), 4.0),)
    along, across = np.tile([0.0, 0, 1], 8), np.tile([0.6, 0.8, 0], 8)
    K, C = boundary_springs(block(ROCK, foot)), boundary_dashpots(block(ROCK, foot))
    assert along @ K @ along == pytest.approx(4 / 3 * 10e9 / 4 * 6)
    assert across @ K @ across == pytest.approx(2 / 3 * 10e9 / 4 * 6)
    assert along @ C @ along == pytest.approx(6 * (2500 * 35e9) ** 0.5)
    assert across @ C @ across == pytest.approx(6 * 5e6)


def test_damping_of_modes():
    """Ratios are ranked by frequency: of 0, 2, 3 and 10 rad/s; the last holds for all higher ones."""
    omega2 = np.array([9.0, 0.0, 4.0, 100.0])
    ratios = DampingConfig(modal=(0.02, 0.03, 0.05))
    np.testing.assert_allclose(modal_coefficients(ratios, omega2), [0.3, 0, 0.12, 1.0], rtol=1e-12)
    # of 2 and 6 rad/s: alpha = 2 0.05 12 / 8, beta = 2 0.05 / 8
    rayleigh = RayleighConfig(frequencies=(1.0 / np.pi, 3.0 / np.pi), ratio=0.05)
    assert rayleigh_coefficients(rayleigh) == pytest.approx((0.15, 0.0125))
    found = modal_coefficients(DampingConfig(rayleigh=rayleigh), omega2)
    np.testing.assert_allclose(found, [0.15 + 9 * 0.0125, 0, 0.2, 1.4], rtol=1e-12)


def test_drag_on_a_rigid_motion():
    """Masses 1, 2 and 1 with alpha = 3: C = 3 M, and C - D D^T does not act on (1, 1, 1)."""
    C, R = np.diag([3.0, 6.0, 3.0]), np.full((3, 1), 0.5)
    D = rigid_drag(C @ R, R)
    np.testing.assert_allclose(D @ D.T, np.outer([3, 6, 3], [3, 6, 3]) / 12, rtol=1e-12)
    np.testing.assert_allclose((C - D @ D.T) @ R, 0.0, atol=1e-14)


def test_springs_of_viscous_faces_follow_from_their_mean_distance():
    """4 m2 that are 5 m in front of the foot, and 2 m2 that are 3 m below it: (4 5 + 2 3) / 6 m."""
    points = np.array(
        [[7, 0, 0], [7, 2, 0], [7, 2, 2], [7, 0, 2], [4, 0, -3], [4, 2, -3], [5, 2, -3], [5, 0, -3]], float
    )
    facets = np.array([[0, 1, 2, 3], [4, 5, 6, 7]])
    assert _distance(points, facets, np.array([2.0, 1.0, 0.0]), "here") == pytest.approx(26.0 / 6.0)


@pytest.mark.parametrize("through", ["equivalent", "harmonic"])
@pytest.mark.parametrize("thickness", [1e-6, 1e-3])
def test_a_thin_slab_is_straight_between_its_faces(through, thickness):
    """Within round-off of no thickness, and of some: 3/4 of the upstream face's temperature at a quarter."""
    upstream, downstream = slab_weights(np.array([0.25]), np.array([thickness]), 3.2e7, 1e-6, through)
    assert upstream[0] == pytest.approx(0.75, abs=1e-6) and downstream[0] == pytest.approx(0.25, abs=1e-6)


@pytest.mark.parametrize("dam", [{"b"}, {"a", "b"}])
def test_weights_balance_about_the_middle_of_the_dam(dam, make):
    """W x arm of two blocks that stand apart, about the middle of the box around the dam's."""
    raw = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400}},
        "blocks": {"a": box([0, 0, 0], [2, 1, 3], 1.0), "b": box([5, 0.5, 0], [1, 1, 5], 1.0)},
        "supports": [{"block": name, "face": "zmin"} for name in "ab"],
        "loads": {"gravity": [0, 0, -9.7]},
    }
    found = balance_at_rest(make(raw), np.zeros((0, 1)), np.zeros(0), dam, np.zeros(0))
    W = {"a": 2400 * 6 * 9.7, "b": 2400 * 5 * 9.7}
    middle = {"a": np.array([1, 0.5, 1.5]), "b": np.array([5.5, 1.0, 2.5])}
    about = np.array([3.0, 0.75, 2.5]) if len(dam) == 2 else middle["b"]
    moment = sum(np.cross(middle[name] - about, [0.0, 0.0, -W[name]]) for name in dam)
    assert found.about[0] == pytest.approx(about)
    expected = [0.0, 0.0, -sum(W[name] for name in dam), *moment]
    assert found.loads[0] == pytest.approx(expected, rel=1e-9, abs=1e-6)
    assert found.supports[0] == pytest.approx(np.negative(expected), rel=1e-9, abs=1e-6)
