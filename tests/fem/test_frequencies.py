"""Natural frequencies against NAFEMS FV32 and FV52, the Rayleigh-Lamb equation and waves in a cube.

FV52 (NAFEMS R0015, Selected benchmarks for natural frequency analysis, 1987): solid square plate on lines.
A line support under a solid has no limit in three dimensions: refined meshes sink below the
reference without end (hex20 4x4x1 44.80, 8x8x2 43.72, 12x12x2 43.46 Hz; tet10 6x6x1 45.02, 8x8x2 44.10 Hz),
so the bending modes are compared on meshes like NAFEMS' own, with the figures of another code on the same
mesh, the membrane modes also with their closed form, and convergence is shown on the hard-supported plate,
whose bending modes are Lamb waves (Graff, Wave motion in elastic solids, 1975, section 8.1), and on a cube.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.sparse.linalg import eigsh

from romdam.config.sections.job import BoxConfig
from romdam.core.scene import Material
from romdam.fem.assembly import assemble
from romdam.geometry.boxes import box_block
from romdam.geometry.elements import SOLIDS

PLATE = Material(E=200e9, nu=0.3, rho=8000.0)
NAFEMS = [44.762, 110.52, 110.52, 169.08, 193.93, 206.64, 206.64]  # their finite elements
CLOSED = np.array([45.897, 109.44, 109.44, 167.89, 193.59, 206.19, 206.19])
OPTISTRUCT = [0.9760, 1.0101, 1.0101, 1.0072, 1.0017, 1.0022, 1.0022]  # of CLOSED: HEXA20 in its manual


def frequencies(element, size, divisions, held, material, count, around):
    """Lowest frequencies above `around` [Hz]; `held` maps points to (n, 3) fixed components."""
    lengths = tuple(s / n for s, n in zip(size, divisions, strict=True))
    config = BoxConfig(origin=(0, 0, 0), size=size, element_size=lengths, element=element)
    return lowest(box_block("b", config, material, "s.yaml: blocks.b.box"), held, count, around)


def lowest(block, held, count, around):
    K, M = assemble(block)
    free = np.flatnonzero(~held(block.points).ravel())
    K, M = K[free][:, free].tocsc(), M[free][:, free].tocsc()
    omega2 = eigsh(K, count, M, sigma=(2 * np.pi * around) ** 2 * np.sign(around), v0=np.ones(len(free)))[0]
    return np.sqrt(np.abs(np.sort(omega2))) / (2 * np.pi)


def on_lines(points):
    held = np.zeros(points.shape, dtype=bool)
    rim = (np.isin(points[:, 0], (0, 10))) | np.isin(points[:, 1], (0, 10))
    held[:, 2] = rim & (points[:, 2] == 0)
    return held


def hard_sides(points):
    """Sides held along themselves, free along their normal."""
    x, y = np.isin(points[:, 0], (0, 10)), np.isin(points[:, 1], (0, 10))
    return np.c_[y, x, x | y]


def rayleigh_lamb(k, thickness, material):
    """Lowest antisymmetric root [Hz] of the Rayleigh-Lamb equation at wave number k [1/m]."""
    mu = material.E / 2 / (1 + material.nu)
    lam = 2 * mu * material.nu / (1 - 2 * material.nu)
    c_l, c_t = np.sqrt((lam + 2 * mu) / material.rho), np.sqrt(mu / material.rho)

    def residual(omega):
        p, q = np.sqrt(k**2 - (omega / c_l) ** 2), np.sqrt(k**2 - (omega / c_t) ** 2)
        ratio = np.tanh(q * thickness / 2) / np.tanh(p * thickness / 2)
        return ratio - (k**2 + q**2) ** 2 / (4 * p * q * k**2)

    D = material.E * thickness**3 / 12 / (1 - material.nu**2)
    thin = k**2 * np.sqrt(D / material.rho / thickness)
    return brentq(residual, 0.7 * thin, thin) / (2 * np.pi)


FV52 = {
    "hex8": ((16, 16, 4), 0.03),
    "hex20": ((4, 4, 1), 0.001),
    "hex27": ((4, 4, 1), 0.02),
    "tet10": ((6, 6, 1), 0.01),
}


@pytest.mark.parametrize("element", FV52)
def test_fv52_on_meshes_like_that_of_nafems(element):
    divisions, limit = FV52[element]
    found = frequencies(element, (10.0, 10.0, 1.0), divisions, on_lines, PLATE, 10, -10.0)
    assert np.abs(found[:3]).max() < 1e-2  # in-plane rigid motion
    assert np.abs(found[3:] / NAFEMS - 1).max() < limit
    if element == "hex20":
        assert np.abs(found[3:] / CLOSED - OPTISTRUCT).max() < 1e-4


@pytest.mark.parametrize(
    ("element", "divisions"),
    [("hex8", (12, 12, 3)), ("hex20", (8, 8, 2)), ("hex27", (8, 8, 2)), ("tet10", (6, 6, 1))],
)
def test_fv52_membrane_modes_reach_their_closed_form(element, divisions):
    found = frequencies(element, (10.0, 10.0, 1.0), divisions, on_lines, PLATE, 14, -10.0)
    for closed in (193.59, 206.19):
        assert (
            np.abs(found / closed - 1).min()
            < {"hex8": 1e-2, "hex20": 5e-4, "hex27": 5e-4, "tet10": 1e-3}[element]
        )


FV32 = [44.623, 130.03, 162.70, 246.05, 379.90, 391.44]  # Hz, its membrane


@pytest.mark.parametrize(
    ("element", "limit"), [("hex8", 0.04), ("hex20", 5e-5), ("hex27", 1e-4), ("tet10", 1e-3)]
)
def test_fv32_tapered_cantilever(element, limit):
    """A membrane 10 m long, 5 m deep at its foot, 1 m at its end: half of its thickness, free to thin."""
    config = BoxConfig(
        origin=(0, -2.5, 0), size=(10, 5, 0.025), element_size=(0.625, 0.625, 0.025), element=element
    )
    box = box_block("b", config, PLATE, "s.yaml: blocks.b.box")
    x, y, z = box.points.T
    tapered = replace(box, points=np.c_[x, y * (1 - 0.08 * x), z])
    computed = lowest(tapered, lambda p: np.c_[p[:, 0] == 0, p[:, 0] == 0, p[:, 2] == 0], 6, 0.0)
    assert np.abs(computed / FV32 - 1).max() < limit


LADDERS = {  # divisions, and how far from exact the finest may be
    "hex8": ([(8, 8, 2), (16, 16, 4)], 0.05),
    "hex20": ([(4, 4, 1), (8, 8, 2)], 0.001),
    "hex27": ([(4, 4, 1), (8, 8, 2)], 0.001),
    "tet10": ([(4, 4, 1), (8, 8, 2)], 0.01),
}


@pytest.mark.parametrize("element", LADDERS)
def test_hard_supported_plate_converges_to_lamb_waves(element):
    ladder, limit = LADDERS[element]
    exact = np.array([rayleigh_lamb(np.pi / 10 * np.sqrt(n), 1.0, PLATE) for n in (2, 5, 5)])
    errors = [
        frequencies(element, (10.0, 10.0, 1.0), divisions, hard_sides, PLATE, 3, 30.0) / exact - 1
        for divisions in ladder
    ]
    assert (errors[1] > 0).all()  # consistent mass and full integration bound from above
    assert errors[1][0] < limit
    assert (errors[1] < errors[0] / 3).all()


def test_rayleigh_lamb_equation():
    """Srinivas et al., J. Sound Vib. 12 (1970): omega h sqrt(rho / mu) = 0.0931 at h/a = 0.1, nu = 0.3."""
    mu = PLATE.E / 2.6
    root = 2 * np.pi * rayleigh_lamb(np.pi / 10 * np.sqrt(2), 1.0, PLATE) * np.sqrt(PLATE.rho / mu)
    assert root == pytest.approx(0.0931, abs=5e-5)


CUBE = Material(E=1.0, nu=0.25, rho=1.0)
CUBE_CASES = [
    ("hex8", (4, 8), 2, 0.1),
    ("hex20", (2, 4), 4, 0.2),
    ("hex27", (2, 4), 4, 0.2),
    ("tet4", (4, 8), 2, 0.1),
    ("tet10", (2, 4), 4, 0.7),
    ("wedge6", (4, 8), 2, 0.1),
    ("wedge15", (2, 4), 4, 0.2),
    ("pyramid5", (4, 8), 2, 0.1),
    ("pyramid13", (2, 4), 4, 0.2),
    pytest.param("hex20", (4, 8), 4, 0.1, marks=pytest.mark.slow),
    pytest.param("hex27", (4, 8), 4, 0.1, marks=pytest.mark.slow),
    pytest.param("tet10", (4, 8), 4, 0.3, marks=pytest.mark.slow),
]


def test_every_element_converges():
    assert {case[0] for case in CUBE_CASES if isinstance(case[0], str)} == set(SOLIDS)


@pytest.mark.parametrize(("element", "sizes", "order", "slack"), CUBE_CASES)
def test_order_of_convergence_on_a_cube(element, sizes, order, slack):
    """Faces slide freely: u = (sin pi x cos pi y, -cos pi x sin pi y, 0), omega = pi sqrt(2 mu / rho).

    Frequencies converge with twice the degree of the shape functions; Kuhn's tet10 get there slowly.
    """
    exact = np.sqrt(2 * CUBE.E / 2.5 / CUBE.rho) / 2

    def held(points):
        return (np.abs(points) < 1e-9) | (np.abs(points - 1) < 1e-9)

    errors = [
        frequencies(element, (1.0, 1.0, 1.0), (n, n, n), held, CUBE, 3, 0.95 * exact)[0] / exact - 1
        for n in sizes
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=slack)
