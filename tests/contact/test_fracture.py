"""A bond that softens: energy by shape, step and mode, unloading, snap-back, and what is refused."""

import numpy as np
import pytest
from scipy.integrate import quad
from test_law_steps import OneGap

from romdam.config import parse_config
from romdam.contact.laws import Fracture, law
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.fracture import LINEAR, SHAPES, energy_share, strength_share
from romdam.core.errors import ConfigError
from romdam.core.system import OPEN, STICK, GapLaw, LawRows

F, G, C, G_II = 2e6, 150.0, 3e6, 400.0  # Pa, N/m, Pa, N/m on 1 m2


def published(shape, w, f=F, energy=G):
    """Stress of a crack that opens by w [Pa]: Hillerborg's line, an exponential, Petersson's two lines."""
    if shape == "linear":
        return np.interp(w, [0.0, 2.0 * energy / f], [f, 0.0])
    if shape == "exponential":
        return f * np.exp(-f * w / energy)
    return np.interp(w, [0.0, 0.8 * energy / f, 3.6 * energy / f], [f, f / 3.0, 0.0])


def softening_gap(shape="linear", K_n=np.inf, K_s=1e13, mu=0.0, h=1e-13, shear=True):
    joint = {
        "normal_stiffness": "rigid" if np.isinf(K_n) else K_n,
        "fracture": {
            "tensile_strength": F, "energy": G, "cohesion": C if shear else 0.0,
            "shear_energy": G_II if shear else 0.0, "softening": shape,
        },
    }  # fmt: skip
    one = np.ones(1)
    rows = LawRows(source_of(Fracture), np.array([Fracture.row(joint, 1.0)]), one > 0.0, shear)
    law = GapLaw(K_n * one, 0 * one, K_s * one, np.full((1, 2), mu), 0 * one, {}, laws=(rows,))
    return OneGap(law, h)


def led(gap, *jumps):
    """Work of normal force and of shear along a path of free jumps, and what the law says of it [J]."""
    work, lost, spent = np.zeros(2), 0.0, gap.gaps.dissipated_energy[0]
    for jump in np.stack(np.broadcast_arrays(*jumps), axis=1):
        before = gap.jump.copy()
        gap.step(*jump)
        lost += gap.taken
        done = -(gap.force * (gap.jump - before))[0]
        work += done[0], done[1:].sum()
    assert gap.gaps.dissipated_energy[0] - spent == pytest.approx(lost, rel=1e-9, abs=1e-9)
    return (*work, lost)


@pytest.mark.parametrize("steps", [4, 40, 1000])
@pytest.mark.parametrize("K_n", [np.inf, 1e11])
@pytest.mark.parametrize("shape", ["linear", "exponential", "bilinear"])
def test_opening_takes_the_fracture_energy_whatever_the_step(shape, K_n, steps):
    """To 40 G_f / f_t, in 4 steps or 1000; the rest of an exponential curve is exp(-40)."""
    gap = softening_gap(shape, K_n, shear=False, h=1e-12)
    work, _, lost = led(gap, np.linspace(0.0, 40.0 * G / F, steps + 1)[1:])
    assert lost == pytest.approx(G, rel=1e-9)
    assert gap.stored == pytest.approx(0.0, abs=1e-9 * G)
    if np.isinf(K_n):
        assert work == pytest.approx(G, rel=1e-6)


def test_what_an_exponential_curve_lacks_at_its_end_is_below_1e_10():
    """Of strength and of energy exp(-r) is left at damage r; every job's curve is this one, scaled."""
    shape, r = SHAPES.index("exponential"), np.linspace(0.0, 60.0, 60_001)
    left = np.array([[strength_share(shape, x), 1.0 - energy_share(shape, x)] for x in r])
    assert np.abs(left - np.exp(-r)[:, None]).max() < 1.1e-10
    assert left[-1, 0] == 0.0


@pytest.mark.parametrize("shape", ["linear", "exponential", "bilinear"])
def test_a_crack_that_is_wide_open_has_nothing_left_to_lose(shape):
    """Not even 1e-10 of it, which every later step would have to agree on."""
    assert strength_share(SHAPES.index(shape), 23.0) == 0.0
    assert strength_share(SHAPES.index(shape), 22.9) <= 1.2e-10
    length = energy_share(SHAPES.index(shape), 1e3)
    assert energy_share(SHAPES.index(shape), 23.0) == length
    assert quad(lambda r: strength_share(SHAPES.index(shape), r), 0.0, 30.0, points=[0.8 / 3.6, 1.0, 23.0])[
        0
    ] == pytest.approx(length, rel=1e-9)


@pytest.mark.parametrize("shape", ["linear", "exponential", "bilinear"])
def test_force_against_opening_is_the_published_curve(shape):
    """Means of steps lie on the curve at their middle, K_n aside; the law's own area is G_f."""
    gap = softening_gap(shape, 1e11, shear=False, h=1e-13)
    opening, force = [], []
    for w in np.linspace(0.0, 5.0 * G / F, 2001)[1:]:
        before = max(gap.memory.history[-1, 0, 2], 0.0)
        gap.step(w)
        crack = gap.memory.history[-1, 0, 2]
        if before > 0.0:
            opening.append(0.5 * (before + crack))
            force.append(-gap.force[0, 0])
    assert np.abs(np.array(force) - published(shape, np.array(opening))).max() <= 1e-3 * F
    area = quad(lambda w: float(published(shape, w)), 0.0, 60.0 * G / F, limit=400, points=[0.8 * G / F])[0]
    assert area == pytest.approx(G, rel=1e-6)


@pytest.mark.parametrize("steps", [5, 50, 500])
@pytest.mark.parametrize("angle", [0.0, 10.0, 30.0, 60.0, 80.0, 90.0])
def test_shares_of_both_energies_add_up_to_one(angle, steps):
    """G_I / G_f + G_II / G_f^II = 1 on straight paths of opening and slip, friction 0.7 beside them."""
    gap = softening_gap(mu=0.7, K_s=1e15)
    way = np.linspace(0.0, 1e-3, steps)[1:]
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    opened, slid, lost = led(gap, way * c, way * s * 0.6, way * s * 0.8)
    assert opened / G + slid / G_II == pytest.approx(1.0, rel=1e-4)
    assert lost == pytest.approx(opened + slid, rel=1e-4)
    if angle == 0.0:
        assert lost == pytest.approx(G, rel=1e-9)
    if angle == 90.0:
        assert lost == pytest.approx(G_II, rel=1e-9)


def test_slip_under_compression_takes_shear_energy_and_then_rubs():
    """p = 1 MN: the slip of 2 mm works mu p s besides G_f^II, and mu p is left."""
    gap = softening_gap(K_n=1e11, mu=0.7, h=1e-13)
    press = -1e6 * (1e-11 + 1e-13)
    slip = np.linspace(0.0, 2e-3, 401)
    opened, _, lost = led(gap, np.full(401, press), slip, 0.0 * slip)
    assert gap.force[0] == pytest.approx([1e6, -0.7e6, 0.0], rel=1e-9)
    assert lost - 0.7e6 * (2e-3 - 0.7e6 * (1e-13 + 1e-13)) == pytest.approx(G_II, rel=1e-6)
    assert opened == pytest.approx(10.0, rel=1e-6)  # p^2 / K_n of the spring, in one step


def test_a_crack_closes_along_its_secant_and_goes_on_where_it_was():
    """Opened by 50 um of 150, closed, opened again: stress is 2 MPa 2/3 w / 50 um until there."""
    gap = softening_gap(shear=False, h=1e-17)
    led(gap, np.linspace(0.0, 50e-6, 101))
    spent = gap.gaps.dissipated_energy[0]
    assert spent == pytest.approx(0.5 * F * 50e-6, rel=1e-5)  # the triangle between the curve and the secant
    for w in (40e-6, 10e-6, 30e-6):
        force, state = gap.step(w)
        assert -force[0] == pytest.approx(F * 2.0 / 3.0 * w / 50e-6, rel=1e-5) and state == OPEN
        assert gap.stored == pytest.approx(0.5 * -force[0] * w, rel=1e-5)
    force, state = gap.step(-1e-7)
    assert force[0] == pytest.approx(1e10, rel=1e-6) and state == STICK and gap.stored == 0.0
    assert gap.gaps.dissipated_energy[0] == pytest.approx(spent, rel=1e-12)
    led(gap, np.linspace(0.0, 49e-6, 50))
    assert gap.gaps.dissipated_energy[0] == pytest.approx(spent, rel=1e-12)
    led(gap, np.linspace(50e-6, 200e-6, 50))
    assert gap.gaps.dissipated_energy[0] == pytest.approx(G, rel=1e-9)


@pytest.mark.parametrize("h", [5e-11, 1e-10, 1e-9, 1e-8])
def test_a_gap_on_soft_blocks_snaps_back_and_takes_no_more_than_its_energy(h):
    """The blocks give by h f_t = 0.1 to 20 mm, the crack is through at 0.15 mm: all but the first snap."""
    gap = softening_gap(K_n=1e11, shear=False, h=h)
    last = 3e-3 + h * F
    led(gap, np.concatenate([np.linspace(0.0, last, 201)[1:], np.linspace(last, -1e-3, 50)]))
    assert gap.gaps.dissipated_energy[0] == pytest.approx(G, rel=1e-9)
    gap.step(1e-3)
    assert gap.force[0, 0] == 0.0 and gap.jump[0, 0] == pytest.approx(1e-3, rel=1e-12)


def two_blocks(joint):
    box = {"size": [1, 1, 1], "element_size": 1.0}
    return {
        "model": {"order": "full"},
        "transient": {"finest_step": "2.5 ms"},
        "materials": {"concrete": {"E": "30 GPa", "nu": 0.2, "rho": 2400}},
        "blocks": {
            "left": {"material": "concrete", "box": box | {"origin": [0, -1, 0]}},
            "right": {"material": "concrete", "box": box | {"origin": [0, 0, 0]}},
        },
        "supports": [{"block": "left", "face": "ymin"}, {"block": "right", "face": "zmin"}],
        "joints": {"j": {"between": ["left", "right"], "shear_stiffness": "10 GPa/m"} | joint},
        "records": [{"name": "r", "file": "r.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    }


TENSION = {"tensile_strength": "2 MPa", "energy": "150 N/m"}
BOTH = TENSION | {"cohesion": "3 MPa", "shear_energy": "800 N/m"}


@pytest.mark.parametrize(
    ("normal_stiffness", "other", "fracture", "words"),
    [
        ("10 GPa/m", {}, TENSION, ("energy 150 N/m", "200", "raise energy")),
        ("20 GPa/m", {}, TENSION | {"softening": "exponential"}, ("energy 150 N/m", "200", "exponential")),
        ("20 GPa/m", {}, TENSION | {"softening": "bilinear"}, ("energy 150 N/m", "166.7", "bilinear")),
        ("rigid", {}, BOTH | {"shear_energy": 450}, ("shear_energy 450", "450 N/m")),
        ("rigid", {}, TENSION | {"cohesion": "1 MPa"}, ("give both",)),
        (
            "rigid",
            {"friction": 0.7},
            BOTH | {"cohesion": "1.2 MPa"},
            ("1.2e+06", "1.4e+06", "raise cohesion"),
        ),
        ("rigid", {"cohesion": "1 MPa"}, TENSION, ("`cohesion`", "leave one")),
        ("30 GPa/m", {"viscosity": 1e5}, TENSION, ("`viscosity`", "leave one")),
        ("30 GPa/m", {"tension_stiffness": 1e5}, TENSION, ("`tension_stiffness`", "leave one")),
        ({"per_gap": 1e9}, {}, TENSION, ("per area", "1e+09 N/m")),
        ("rigid", {}, TENSION | {"energy": 0.0}, ("energy",)),
        ("rigid", {}, {"energy": 150.0}, ("tensile_strength",)),
        ("rigid", {}, TENSION | {"softening": "cubic"}, ("softening", "bilinear")),
    ],
)
def test_what_is_refused(normal_stiffness, other, fracture, words):
    joint = {"normal_stiffness": normal_stiffness, "fracture": fracture} | other
    with pytest.raises(ConfigError) as refused:
        parse_config(two_blocks(joint), "two.yaml")
    assert all(word in str(refused.value) for word in ("joints.j", "fracture", *words)), str(refused.value)


def test_just_enough_energy_is_accepted():
    joint = {"normal_stiffness": "13.4 GPa/m", "fracture": TENSION}
    parse_config(two_blocks(joint), "two.yaml")


def test_a_step_that_passes_the_widest_opening_has_the_mean_of_secant_and_curve():
    """Damage 0.25 of a line of 100 N over 2 m, widest 0.5 m, from 0.2 to 1.1 m: 0.3 m at 75 N, 0.6 m at 60 N.

    The crack's 0.6 m make a damage of 0.55, the mean of 75 and 45 N: (75 0.3 + 60 0.6) / 0.9 = 65 N. At rest
    the force is that at the end, 45 N.
    """
    parameters = np.array([0.0, 100.0, 2.0, 0.0, 0.0, float(LINEAR)])
    memory, step = np.array([0.25, 0.5, 0.2, 0.0, 0.0]), np.zeros(8)
    step[law.OPENING] = 1.1
    for dt, force in ((0.01, 65.0), (0.0, 45.0)):
        step[law.DT], limit = dt, np.zeros(6)
        Fracture.limit(parameters, memory, step, limit)
        assert limit[law.TENSION] == pytest.approx(force, rel=1e-12)
