"""Added mass and compressible water of one or two unknowns, worked out on paper."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array

from romdam.config.sections.job import BoxConfig
from romdam.core.scene import Material, Sound, WetFace
from romdam.effects.added_mass import AddedMass, added_mass_matrix, wet_modes
from romdam.effects.channel import impedance_network, radiating_end
from romdam.effects.compressible_water import Waves, reduced_waves
from romdam.fem.water.body import WaterSection
from romdam.fem.water.coupling import yielding_of_rock
from romdam.geometry.boxes import box_block
from romdam.scene.mortar.surface import MortarSurface


def test_wet_mode_of_one_unknown():
    """k = 3 and B = 2 with F = 5: a mass of 1 + 2 5 2 = 21."""
    water = AddedMass({}, np.array([[5.0]]), np.zeros((1, 3)))
    omega2, V = wet_modes(np.array([3.0]), np.array([[2.0]]), water)
    assert omega2 == pytest.approx([1 / 7]) and abs(V[0, 0]) == pytest.approx(21**-0.5)
    B = csr_matrix(np.array([[2.0, 0.0, 3.0]]))
    expected = 5.0 * np.array([[4, 0, 6], [0, 0, 0], [6, 0, 9]])
    np.testing.assert_allclose(added_mass_matrix(water, B).toarray(), expected)
    np.testing.assert_allclose(
        added_mass_matrix(AddedMass({}, None, np.zeros((1, 3))), B).toarray(), expected / 5.0
    )


@pytest.mark.parametrize("stiff", [1e3, 5e15])
def test_wet_modes_keep_the_digits_of_the_softest_beside_stiff_ones(stiff):
    """k = 0, 40 and one 1e14 times as much: the stiff one is a support for the others, or a root by hand."""
    b, F = np.array([3.0, 2.0, 1.0]), 5.0
    water = AddedMass({}, np.array([[F]]), np.zeros((1, 3)))
    m = np.eye(3) + F * np.outer(b, b)
    # two unknowns: the lower root of det(K - omega^2 M) = 0 without a difference of large numbers
    omega2, V = wet_modes(np.array([40.0, stiff]), b[None, 1:], water)
    first, half, last = (
        m[1, 1] * m[2, 2] - m[1, 2] ** 2,
        0.5 * (40.0 * m[2, 2] + stiff * m[1, 1]),
        40.0 * stiff,
    )
    low = last / (half + np.sqrt(half**2 - first * last))
    assert omega2[0] == pytest.approx(low, rel=1e-13) and omega2[1] == pytest.approx(
        last / first / low, rel=0.2
    )
    # a load on the stiff unknown moves it by 1 / stiff, whatever becomes of its frequency
    assert V[1] @ (V[1] / omega2) == pytest.approx(1.0 / stiff, rel=1e-12)
    omega2, V = wet_modes(np.array([stiff, 0.0, 40.0]), np.roll(b, 1)[None], water)
    assert omega2[0] == 0.0 and abs(V[[0, 2], 0]).max() < 1e-12 * abs(V[1, 0])
    if stiff > 1e12:
        wet = m[:2, :2]
        assert omega2[1] == pytest.approx(40.0 * wet[0, 0] / np.linalg.det(wet), rel=1e-12)


def test_wet_modes_of_many_unknowns_do_not_depend_on_their_order():
    """Of springs over 14 decades the lowest is 1 over the largest eigenvalue of k^-1/2 M k^-1/2."""
    random = np.random.default_rng(3)
    k, B = 10.0 ** random.uniform(1.5, 15.7, 60), random.normal(size=(5, 60))
    water = AddedMass({}, None, np.zeros((1, 3)))
    scaled = B / np.sqrt(k)
    lowest = 1.0 / np.linalg.eigvalsh(np.diag(1.0 / k) + scaled.T @ scaled)[-3:][::-1]
    for order in (np.arange(60), np.argsort(k), random.permutation(60)):
        assert wet_modes(k[order], B[:, order], water)[0][:3] == pytest.approx(lowest, rel=1e-11)


def test_waves_of_a_channel_with_one_section_mode():
    """H = 2, G = 1/2: phi = sqrt 2, wave number 2. Floor 0.3, flux (1, 3, 0), c = 1400 m/s, q = 1e-4.

    On rock of which int dl / (rho_r c_p) is 1e-8 the floor takes 1000 times that more:
    y'' + c^2 (q 0.3 + rho 1e-8) phi^2 y' + c^2 4 y = rho c^2 phi (1, 3, 0) v.
    """
    H, G, floor, rock = (csr_matrix([[value]]) for value in (2.0, 0.5, 0.3, 1e-8))
    section = WaterSection(H, G, floor, np.array([[1.0, 3.0, 0.0]]), rock)
    end = radiating_end(section, Sound(1400.0, 0.8, 1e4), 1e-4, 1000.0)
    np.testing.assert_allclose(end.drive.k, [4 * 1400.0**2], rtol=1e-12)
    np.testing.assert_allclose(end.drive.c, [[1400.0**2 * (1e-4 * 0.3 + 1000.0 * 1e-8) * 2.0]], rtol=1e-12)
    sign = np.sign(end.drive.velocity[0, 0])
    np.testing.assert_allclose(
        sign * end.drive.velocity, 1000 * 1400.0**2 * 2**0.5 * np.array([[1, 3, 0]]), rtol=1e-12
    )
    # G phi = phi / 2: amplitude a = p / sqrt 2; its spring is Z's times the wave number
    _, _, network = impedance_network()
    assert end.K[0, 0] == pytest.approx(0.5 * 2.0 * network[0, 0])
    assert end.C[0, 0] == pytest.approx(0.5 / 1400.0)  # the network's first mass is zero


def test_rock_gives_way_by_its_impedance_where_a_wall_lies_on_it():
    """rho c_p = sqrt(2500 (lam + 2 mu)), of E 24 GPa and nu 0.2 sqrt(2500 x 26.667e9) = 8.1650e6 kg/(m2 s).

    Of four floors of the water one lies on rock with mass, one half, one on rock without, one on none.
    """
    config = BoxConfig(origin=(0, 0, -1), size=(3, 1, 1), element_size=(1, 1, 1), element="hex8")
    rock = box_block("rock", config, Material(E=24e9, nu=0.2, rho=2500.0), "s.yaml: blocks.rock.box")
    config = BoxConfig(origin=(4, 0, -1), size=(2, 1, 1), element_size=(1, 1, 1), element="hex8")
    light = box_block("light", config, Material(E=24e9, nu=0.2, rho=0.0), "s.yaml: blocks.light.box")
    corners = [[x + dx, dy, 0.0] for x in (0.0, 2.0, 4.0, 6.0) for dx, dy in ((0, 0), (0, 1), (2, 1), (2, 0))]
    walls = MortarSurface("water", np.array(corners), np.arange(16).reshape(4, 4))
    wet = [WetFace("rock", rock.faces["zmax"]), WetFace("light", light.faces["zmax"])]
    yields = yielding_of_rock(walls, wet, {"rock": rock, "light": light})
    np.testing.assert_allclose(yields, np.array([1.0, 0.5, 0.0, 0.0]) / 8.16496580927726e6, rtol=1e-12)


def test_what_a_reservoirs_modes_leave_to_its_flexibility():
    """Of 10 and 30 Hz one is below 20 Hz: the rest is the flexibility of the other alone."""
    omega2 = (2 * np.pi * np.array([10.0, 30.0])) ** 2
    none = csr_matrix((2, 2))
    waves = Waves(
        csr_matrix(np.eye(2)), none, csr_matrix(diags_array(omega2)), csr_matrix(np.eye(2)), {},
        np.zeros((2, 3)), None,
    )  # fmt: skip
    found = reduced_waves(waves, 20.0)
    np.testing.assert_allclose(found.waves.K.diagonal(), omega2[:1], rtol=1e-9)
    np.testing.assert_allclose(found.rest, np.diag([0.0, 1.0 / omega2[1]]), atol=1e-9 / omega2[1])
