"""Waves at an angle: the field of layers against printed reflections of a half-space, and boxes of rock."""

from pathlib import Path

import numpy as np
import pytest
from simulating import simulated

from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import FreeField, Material
from romdam.effects.full_order import assemble_full
from romdam.fem.inclined import InclinedField, directions
from romdam.postprocess.incidence import surface_factors
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

ROCK = Material(E=20e9, nu=0.25, rho=2600.0)
C_P = np.sqrt(20e9 * (1 - 0.25) / ((1 + 0.25) * (1 - 0.5)) / 2600.0)
C_S = np.sqrt(20e9 / 2.5 / 2600.0)
OMEGA = 2 * np.pi * np.array([1.0, 4.0, 9.0])


def half_space(p, wave, x, z, omega):
    """Displacement along and up of a unit incident wave and its reflections (Aki and Richards, 5.26 to 5.31).

    Their depth is -z; P moves along its ray, SV down where it moves ahead on the way up.
    """
    a, b = np.sqrt(1 / C_P**2 - p**2), np.sqrt(1 / C_S**2 - p**2)  # cos i / alpha, cos j / beta
    s = 1 / C_S**2 - 2 * p**2
    D = s**2 + 4 * p**2 * a * b
    sin_i, cos_i, sin_j, cos_j = p * C_P, a * C_P, p * C_S, b * C_S
    depth = -z
    up_p, down_p = np.exp(1j * omega * (a * depth)), np.exp(-1j * omega * (a * depth))
    up_s, down_s = np.exp(1j * omega * (b * depth)), np.exp(-1j * omega * (b * depth))
    if wave == "p":
        PP, PS = (-(s**2) + 4 * p**2 * a * b) / D, 4 * (C_P / C_S) * p * a * s / D
        along = sin_i * up_p + PP * sin_i * down_p + PS * cos_j * down_s
        down = -cos_i * up_p + PP * cos_i * down_p - PS * sin_j * down_s
    else:
        SS, SP = (s**2 - 4 * p**2 * a * b) / D, 4 * (C_S / C_P) * p * b * s / D
        along = cos_j * up_s + SS * cos_j * down_s + SP * sin_i * down_p
        down = sin_j * up_s - SS * sin_j * down_s + SP * cos_i * down_p
    phase = np.exp(-1j * omega * p * x)
    return along * phase, -down * phase


def layers(p, azimuth=0.0, origin=(0.0, 0.0), materials=(ROCK, ROCK, ROCK)):
    levels = np.linspace(0.0, -90.0, len(materials) + 1)
    slowness = p * np.cos(azimuth), p * np.sin(azimuth)
    return FreeField(levels, materials, 1, frozenset(), slowness, origin)


POINTS = np.array([[0.0, 0.0, 0.0], [30.0, 10.0, -15.0], [-50.0, 40.0, -60.0], [80.0, -20.0, -90.0]])


@pytest.mark.parametrize("azimuth", [0.0, 0.7])
@pytest.mark.parametrize(("wave", "degrees"), [("sv", 10), ("sv", 25), ("sv", 34), ("p", 15), ("p", 60)])
def test_surface_of_one_wave_has_that_wave_and_its_reflections_below(wave, degrees, azimuth):
    """Displacement at depth, away from the origin, to 1e-9 of the printed reflections: no other comes up."""
    p = np.sin(np.radians(degrees)) / (C_S if wave == "sv" else C_P)
    field = layers(p, azimuth, origin=(7.0, -3.0))
    ahead, across, _ = directions(field)
    along, up = np.array([half_space(p, wave, 0.0, 0.0, w) for w in OMEGA]).T
    surface = np.outer(ahead, along) + np.outer([0, 0, 1.0], up)
    found = InclinedField.of_surface(field, OMEGA, surface, (0.0, 0.0)).displacement(POINTS)
    for point, moved in zip(POINTS, found, strict=True):
        late = (point - [7.0, -3.0, 0.0]) @ ahead
        exact = np.array([half_space(p, wave, late, point[2], w) for w in OMEGA]).T
        size = np.abs(exact).max()
        np.testing.assert_allclose(ahead @ moved, exact[0], atol=1e-9 * size)
        np.testing.assert_allclose(moved[2], exact[1], atol=1e-9 * size)
        np.testing.assert_allclose(across @ moved, 0.0, atol=1e-9 * size)


def test_sh_at_an_angle_doubles_at_the_surface():
    """cos(omega b z) e^(-i omega p x) below a unit surface, b its vertical slowness."""
    p = 0.5 / C_S
    field = layers(p)
    surface = np.zeros((3, 3), complex)
    surface[1] = 1.0
    found = InclinedField.of_surface(field, OMEGA, surface, (0.0, 0.0)).displacement(POINTS)
    b = np.sqrt(1 / C_S**2 - p**2)
    exact = np.cos(OMEGA * b * POINTS[:, 2:]) * np.exp(-1j * OMEGA * p * POINTS[:, :1])
    np.testing.assert_allclose(found[:, 1], exact, atol=1e-10)
    np.testing.assert_allclose(found[:, [0, 2]], 0.0, atol=1e-12)


def test_tractions_are_those_of_the_strains():
    """Three layers of unlike stiffness and damping: stress by differences of the displacement, to 1e-6."""
    soft = Material(E=8e9, nu=0.3, rho=2400.0, damping=(0.4, 2e-3))
    field = layers(0.4 / C_P, 0.5, materials=(soft, ROCK, soft))
    surface = np.array([[1.0, 0.5j, 0.2], [0.3, 1.0, 0.0], [-0.5, 0.2, 1.0j]])
    damping = 0.4, 5e-4
    waves = InclinedField.of_surface(field, OMEGA, surface, damping)
    points = np.array([[10.0, 5.0, -14.0], [-20.0, 7.0, -45.0], [3.0, 40.0, -75.0]])
    normals = np.array([[0.0, 0.0, -2.0], [1.0, 2.0, 0.0], [0.5, -1.0, 0.0]])
    found = waves.traction(points, normals, waves.layer_at(points[:, 2]))
    h = 1e-2
    for k, point in enumerate(points):
        material = (soft, ROCK, soft)[k]
        gradient = np.zeros((3, 3, len(OMEGA)), complex)  # component, axis
        for axis in range(3):
            step = h * np.eye(3)[axis]
            ahead, behind = waves.displacement(np.stack([point + step, point - step]))
            gradient[:, axis] = (ahead - behind) / (2 * h)
        loss = 1 + 1j * (material.damping or damping)[1] * OMEGA
        E, nu = material.E, material.nu
        lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)) * loss, E / (2 * (1 + nu)) * loss
        stress = mu * (gradient + gradient.swapaxes(0, 1))
        stress += lam * np.einsum("kkf->f", gradient) * np.eye(3)[:, :, None]
        exact = np.einsum("ijf,j->if", stress, normals[k])
        np.testing.assert_allclose(found[k], exact, atol=1e-6 * np.abs(exact).max())
    # across levels displacement and level tractions go on, and the surface carries none
    for level, above, below in ((-30.0, 0, 1), (-60.0, 1, 2)):
        at = np.array([[5.0, 6.0, level]])
        up = np.array([[0.0, 0.0, 1.0]])
        first, second = (waves.traction(at, up, np.array([which])) for which in (above, below))
        np.testing.assert_allclose(first, second, atol=1e-9 * np.abs(first).max())
        first, second = (waves.displacement(at, np.array([which])) for which in (above, below))
        np.testing.assert_allclose(first, second, atol=1e-10)
    top = waves.traction(np.array([[9.0, 2.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]), np.array([0]))
    assert np.abs(top).max() < 1e-9 * np.abs(found).max()


DT = 0.004
SIDES = ["xmin", "xmax", "ymin", "ymax"]


def rock(angle=None, wave="s", axis=(1, 0, 0), edge=10.0, element="hex8", **more):
    """A box of rock of 120 by 40 by 60 m, and nodes on its surface and below."""
    asked = {"angle": angle, "wave": wave, "axis": list(axis)} | more
    ground = {"input": "free_field", "viscous": [{"block": "rock", "faces": ["zmin", *SIDES]}]}
    ground |= {} if angle is None else {"incidence": asked}
    of_box = {"origin": [0, 0, -60], "size": [120, 40, 60], "element_size": edge, "element": element}
    return {
        "materials": {"rock": {"E": 20e9, "nu": 0.25, "rho": 2600.0}},
        "blocks": {"rock": {"material": "rock", "weight": False, "box": of_box}},
        "ground": ground,
        "records": [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}],
        "model": {"order": "full"},
        "transient": {"finest_step": DT},
        "outputs": {
            "nodes": {
                "middle": {"block": "rock", "at": [60, 20, 0]},
                "ahead": {"block": "rock", "at": [110, 20, 0]},
                "behind": {"block": "rock", "at": [20, 0, -30]},
                "deep": {"block": "rock", "at": [80, 20, -60]},
            }
        },
    }


AT = np.array([[60, 20, 0], [110, 20, 0], [20, 0, -30], [80, 20, -60]], float)


def pulse(late=0.3, frequency=5.0, count=250):
    """A wavelet whose velocity and displacement end at zero."""
    t = np.arange(count) * DT - late
    x = (np.pi * frequency * t) ** 2
    return (1 - 2 * x) * np.exp(-x)


def shaken(system, acc):
    history = simulated(system, acc, DT, integrator="generalized_alpha", initial_state="undeformed")
    return history, history.acc.reshape(len(history.time), -1, 3) + acc.T[:, None]


def of_wave(acc, p, wave, axis, points, origin):
    """Total acceleration (nt, points, 3) where an incident wave has the acceleration `acc` at the origin."""
    size = 8 * len(acc)
    omega = 2 * np.pi * np.fft.rfftfreq(size, DT)
    spectrum = np.fft.rfft(acc, size)
    out = np.zeros((len(acc), len(points), 3))
    for k, point in enumerate(points):
        motion = half_space(p, wave, (point - origin) @ axis, point[2], omega)
        along, up = (np.fft.irfft(spectrum * each, size)[: len(acc)] for each in motion)
        out[:, k] = np.outer(along, axis)
        out[:, k, 2] = up
    return out


@pytest.mark.parametrize(
    ("degrees", "wave", "azimuth", "element"),
    [
        pytest.param(20, "s", 0.0, "hex8", marks=pytest.mark.slow),
        pytest.param(30, "s", 0.6, "hex8", marks=pytest.mark.slow),
        pytest.param(40, "p", 0.0, "hex8", marks=pytest.mark.slow),
        (25, "s", 0.0, "hex20"),
    ],
)
def test_box_of_rock_moves_as_the_half_space(degrees, wave, azimuth, element):
    """One SV or P wave by Aki and Richards: acceleration on the surface and below within 1 % of its peak."""
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    raw = rock(degrees, wave, axis, 5.0 if element == "hex8" else 10.0, element)
    scene = build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")
    p = np.sin(np.radians(degrees)) / (C_S if wave == "s" else C_P)
    assert np.hypot(*scene.find(FreeField).slowness) == pytest.approx(p)
    of = "sv" if wave == "s" else "p"
    origin = np.array([60.0, 20.0, 0.0])
    exact = of_wave(pulse(), p, of, axis, AT, origin)
    record = exact[:, 0].T  # what the surface does at the origin
    history, total = shaken(assemble_full(scene, DampingConfig()), record)
    size = np.abs(exact).max()
    assert np.abs(total - exact).max() < 1e-2 * size
    late = of_wave(pulse(), 0.0, of, axis, AT, origin)
    assert np.abs(late - exact).max() > 0.2 * size
    assert history.stats["ledger_imbalance"] < 1e-10


def test_reduced_rock_moves_as_its_mesh():
    """With few modes, whose basis answers the field's slow motions: to 5 %, with more to 1 % of the peak."""
    scene = build_scene(parse_config(rock(20, edge=10.0), "s.yaml"), Path(), "s.yaml")
    record = of_wave(pulse(), np.sin(np.radians(20)) / C_S, "sv", np.eye(3)[0], AT[:1], AT[0])[:, 0].T
    damping = DampingConfig.model_validate({"rayleigh": {"frequencies": [2.0, 12.0], "ratio": 0.03}})
    _, full = shaken(assemble_full(scene, damping), record)
    for modes, limit in ((10, 5e-2), (150, 1e-2)):
        system = reduce_scene(scene, ModeChoice(count=modes), damping).system
        history, total = shaken(system, record)
        assert history.stats["ledger_imbalance"] < 1e-10
        assert np.abs(total - full).max() < limit * np.abs(record).max()


@pytest.mark.parametrize("axis", [0, *(pytest.param(axis, marks=pytest.mark.slow) for axis in (1, 2))])
def test_small_angles_come_to_waves_that_come_straight_up(axis):
    """Of any component, damped by mass and stiffness: what a hundredth of a degree changes is small."""
    record = np.zeros((3, 250))
    record[axis] = pulse()
    damping = DampingConfig.model_validate({"rayleigh": {"frequencies": [2.0, 12.0], "ratio": 0.05}})
    found = []
    for angle in (None, 0.01, 15.0):
        scene = build_scene(parse_config(rock(angle), "s.yaml"), Path(), "s.yaml")
        found.append(shaken(assemble_full(scene, damping), record)[1])
    straight, nearly, inclined = (values[-250:] for values in found)
    assert np.abs(nearly - straight).max() < 1e-2
    assert np.abs(inclined - straight).max() > 5e-2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"angle": 36}, r"incidence.angle: 36 degrees of S waves .* graze: limit 34.46 degrees"),
        ({"angle": 20, "axis": [1, 0, 0.2]}, r"`axis` is a level direction"),
        ({"angle": 89.9, "wave": "p"}, r"incidence.angle: 89.9 degrees of P waves .* limit 78.52"),
        ({"angle": 0}, r"incidence.angle must be greater than 0"),
    ],
)
def test_angles_that_cannot_be_are_refused(changes, message):
    """34.46: 0.98 c_s / c_p of a Poisson's ratio of 0.25, whose ratio of speeds is the root of 3."""
    with pytest.raises(ConfigError, match=message):
        build_scene(parse_config(rock(**changes), "s.yaml"), Path(), "s.yaml")


def test_uniform_input_layers_of_unlike_drag_and_solved_water_are_refused():
    raw = rock(20)
    raw["ground"]["input"] = "uniform"
    with pytest.raises(ConfigError, match=r"`incidence` is that of `input: free_field`"):
        parse_config(raw, "s.yaml")
    raw = rock(20)
    raw["water"] = {"model": "incompressible", "level": 5, "faces": [{"block": "rock", "face": "zmax"}]}
    with pytest.raises(ConfigError, match=r"ground.incidence: floor and banks of a solved reservoir"):
        parse_config(raw, "s.yaml")
    raw = rock(20)
    raw["materials"]["low"] = raw["materials"]["rock"] | {"damping": {"alpha": 0.5, "beta": 1e-3}}
    upper = dict(raw["blocks"]["rock"]["box"], origin=[0, 0, -30], size=[120, 40, 30])
    lower = dict(raw["blocks"]["rock"]["box"], size=[120, 40, 30])
    raw["blocks"] = {
        "rock": raw["blocks"]["rock"] | {"box": upper},
        "low": {"material": "low", "weight": False, "box": lower},
    }
    raw["ties"] = {"level": {"between": ["rock", "low"]}}
    sides = {"block": "rock", "faces": SIDES}
    raw["ground"]["viscous"] = [sides, {"block": "low", "faces": ["zmin", *SIDES]}]
    raw["outputs"] = {}
    scene = build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")
    with pytest.raises(ConfigError, match=r"ground.incidence: layers of the rock have alpha of 0 to 0.5 1/s"):
        assemble_full(scene, DampingConfig())


@pytest.mark.parametrize("degrees", [0.01, 10, 25, 34])
def test_surface_factors_are_those_of_the_printed_reflections(degrees):
    """Of SV and P of one slowness; straight up 2 and 0; at 30 degrees in a Poisson's solid by hand."""
    p = np.sin(np.radians(degrees)) / C_S
    for wave, found in zip(("sv", "p"), surface_factors(ROCK, p), strict=True):
        along, up = half_space(p, wave, 0.0, 0.0, 1.0)
        np.testing.assert_allclose(found, [along.real, up.real], atol=1e-12)
    if degrees == 0.01:
        np.testing.assert_allclose(surface_factors(ROCK, p), [[2, 0], [0, 2]], atol=2e-3)
    # c_s = 1: p = 1/2, b = sqrt(3)/2, a = sqrt(1/3 - 1/4), twist 1/2: D = 1/4 + a b = 1/2
    hand = surface_factors(Material(E=2.5, nu=0.25, rho=1.0), 0.5)
    np.testing.assert_allclose(hand[0], [np.sqrt(3.0), -1.0], rtol=1e-12)
    np.testing.assert_allclose(hand[1], [np.sqrt(3.0), 1.0], rtol=1e-12)


@pytest.mark.parametrize("order", [pytest.param("full", marks=pytest.mark.slow), "reduced"])
def test_layers_of_unlike_stiffness_and_damping_move_as_the_field(order):
    """Two layers, all three components at once: within 2 % of the sum of waves at four places."""
    raw = rock(18, axis=(0.8, 0.6, 0.0), edge=10.0, element="hex20")
    raw["materials"]["soft"] = {"E": 9e9, "nu": 0.3, "rho": 2300.0, "damping": {"alpha": 0.0, "beta": 2e-3}}
    whole = raw["blocks"]["rock"]["box"]
    raw["blocks"] = {
        "rock": {"material": "rock", "weight": False, "box": whole | {"size": [120, 40, 40]}},
        "top": {
            "material": "soft",
            "weight": False,
            "box": whole | {"origin": [0, 0, -20], "size": [120, 40, 20]},
        },
    }
    raw["ties"] = {"level": {"between": ["rock", "top"]}}
    raw["ground"]["viscous"].append({"block": "top", "faces": SIDES})
    for node in ("middle", "ahead"):
        raw["outputs"]["nodes"][node]["block"] = "top"
    scene = build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")
    damping = DampingConfig.model_validate({"rayleigh": {"alpha": 0.0, "beta": 5e-4}})
    late = [0.3, 0.34, 0.28]
    record = np.array([size * pulse(t, 4.0) for size, t in zip((1.0, 0.6, 0.4), late, strict=True)])
    size = 8 * record.shape[1]
    omega = 2 * np.pi * np.fft.rfftfreq(size, DT)
    spectrum = np.fft.rfft(record, size)
    surface = -spectrum[:, 1:] / omega[1:] ** 2
    moved = InclinedField.of_surface(scene.find(FreeField), omega[1:], surface, (0.0, 5e-4)).displacement(AT)
    lines = np.concatenate([np.zeros((4, 3, 1)), -(omega[1:] ** 2) * moved], axis=2)
    exact = np.fft.irfft(lines, size)[..., : record.shape[1]].transpose(2, 0, 1)
    if order == "full":
        system = assemble_full(scene, damping)
    else:
        system = reduce_scene(scene, ModeChoice(count=150), damping).system
    history, total = shaken(system, record)
    assert np.abs(total - exact).max() < 2e-2 * np.abs(exact).max()
    assert history.stats["ledger_imbalance"] < 1e-10
