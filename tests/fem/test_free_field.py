"""A free field at depth: rock alone returns the record, a dam on level rock moves as by uniform input."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulating import simulated

import romdam
from romdam.config import load_config, parse_config
from romdam.config.sections.ground import GroundConfig
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import FreeField, Material
from romdam.effects.full_order import assemble_full
from romdam.fem.column import layer_motion, respond, shapes, slopes, wave_moduli
from romdam.pipelines.error.study import study
from romdam.pipelines.run import run
from romdam.records.processing.resampling import resample
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.natural_modes import natural_modes
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.scene.ground.free_field import free_field

DATA = Path(__file__).parents[2] / "data" / "records"
MATERIALS = {
    "hard": {"E": 20e9, "nu": 0.25, "rho": 2600.0},
    "soft": {"E": 8e9, "nu": 0.3, "rho": 2400.0},
    "concrete": {"E": 28e9, "nu": 0.2, "rho": 2400.0},
}
SIDES = ["xmin", "xmax", "ymin", "ymax"]
DAMPED = DampingConfig(rayleigh=RayleighConfig(frequencies=(2.0, 15.0), ratio=0.03))
REST = {
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}


def make(raw):
    return build_scene(parse_config(REST | {"materials": MATERIALS} | raw, "s.yaml"), Path(), "s.yaml")


def box(origin, size, material, element="hex8", size_of=20.0):
    sizes = {"origin": origin, "size": size, "element_size": size_of, "element": element}
    return {"material": material, "box": sizes}


def rock(element="hex8", size_of=20.0, upper="soft", **ground):
    """Two layers of rock, 100 m deep, with nodes at the middle and a corner of the top and at the bottom."""
    return {
        "blocks": {
            "low": box([0, 0, 0], [80, 40, 60], "hard", element, size_of),
            "high": box([0, 0, 60], [80, 40, 40], upper, element, size_of),
        },
        "ties": {"layers": {"between": ["low", "high"]}},
        "ground": {
            "input": "free_field",
            "viscous": [{"block": "low", "faces": ["zmin", *SIDES]}, {"block": "high", "faces": SIDES}],
        }
        | ground,
        "outputs": {
            "nodes": {
                "middle": {"block": "high", "at": [40, 20, 100]},
                "corner": {"block": "high", "at": [80, 40, 100]},
                "deep": {"block": "low", "at": [40, 20, 0]},
            }
        },
    }


@pytest.fixture(scope="module")
def northridge():
    """A record along x and y, and half of it up, 8 s at its own 0.01 s (3, nt) [m/s2]."""
    across, along = (
        np.loadtxt(DATA / f"northridge_mul{azimuth}_g_dt0.01.txt").ravel()[:801] * 9.81
        for azimuth in ("009", "279")
    )
    return np.stack([across, along, 0.5 * across])


def shaken(system, acc, dt):
    """History, and the total acceleration of the probes (nt, probes, 3)."""
    history = simulated(system, acc, dt, integrator="generalized_alpha", initial_state="undeformed")
    return history, history.acc.reshape(len(history.time), -1, 3) + acc.T[:, None]


def l2(values, reference):
    return np.linalg.norm(values - reference) / np.linalg.norm(reference)


@pytest.mark.parametrize("damping", [pytest.param(DampingConfig(), marks=pytest.mark.slow), DAMPED])
@pytest.mark.parametrize(("element", "dt"), [("hex8", 0.01), ("hex8", 0.0025), ("hex20", 0.01)])
@pytest.mark.parametrize("upper", ["hard", "soft"])
def test_rock_alone_returns_the_record_at_its_surface(element, dt, damping, upper, northridge):
    """In the middle and at the corner, of shear and pressure waves, at any step: within 2e-4 of its peak."""
    acc = resample(northridge, 0.01, dt)
    history, total = shaken(assemble_full(make(rock(element, upper=upper)), damping), acc, dt)
    assert np.abs(total[:, :2] - acc.T[:, None]).max() < 2e-4 * np.abs(acc).max()
    assert l2(total[:, 2, 0], acc[0]) > 0.3  # the deep node moves otherwise
    assert history.stats["ledger_imbalance"] < 1e-10


def test_reduced_rock_alone_returns_the_record_whatever_the_modes(northridge):
    made = reduce_scene(make(rock()), ModeChoice(count=2), DAMPED).system
    history, total = shaken(made, northridge, 0.01)
    assert not made.diagonal and made.size < 80
    assert np.abs(total[:, :2] - northridge.T[:, None]).max() < 2e-4 * np.abs(northridge).max()
    _, mesh = shaken(assemble_full(make(rock()), DAMPED), northridge, 0.01)
    assert np.abs(total - mesh).max() < 2e-4 * np.abs(northridge).max()
    assert history.stats["ledger_imbalance"] < 1e-10


@pytest.mark.parametrize("order", ["full", "reduced"])
def test_rock_of_two_dampings_returns_the_record_at_its_surface(order, northridge):
    """Layers with damping of their own: within 2e-4 of its peak; the depth moves as their damping is."""
    deep = []
    for own in ((1.5, 4e-4), (0.3, 2e-3)):
        scene = make(rock())
        blocks = {
            name: replace(block, material=replace(block.material, damping=own if name == "low" else None))
            for name, block in scene.blocks.items()
        }
        layers = tuple(
            replace(layer, damping=own if layer.rho == 2600.0 else None)
            for layer in scene.find(FreeField).materials
        )
        scene = replace(scene, blocks=blocks).with_effects(replace(scene.find(FreeField), materials=layers))
        made = assemble_full(scene, DAMPED) if order == "full" else None
        made = made or reduce_scene(scene, ModeChoice(count=2), DAMPED).system
        _, total = shaken(made, northridge, 0.01)
        assert np.abs(total[:, :2] - northridge.T[:, None]).max() < 2e-4 * np.abs(northridge).max()
        deep.append(total[:, 2])
    assert l2(deep[0], deep[1]) > 1e-2


def test_single_block_of_rock_is_reduced_with_its_field(northridge):
    raw = rock() | {"blocks": {"low": box([0, 0, 0], [80, 40, 100], "hard")}, "ties": {}}
    raw["ground"] = {"input": "free_field", "viscous": [{"block": "low", "faces": ["zmin", *SIDES]}]}
    raw["outputs"] = {"nodes": {"middle": {"block": "low", "at": [40, 20, 100]}}}
    _, total = shaken(reduce_scene(make(raw), ModeChoice(count=2), DAMPED).system, northridge, 0.01)
    assert np.abs(total[:, 0] - northridge.T).max() < 2e-4 * np.abs(northridge).max()


def test_record_that_begins_at_once_is_returned_from_its_first_sample_on():
    """The wave is on its way before the record begins."""
    t = np.arange(101) * 0.005
    acc = np.zeros((3, 101))
    acc[0] = np.exp(-((t / 0.1) ** 2)) * np.sin(15.0 * t) ** 2
    _, total = shaken(assemble_full(make(rock(size_of=10.0)), DampingConfig()), acc, 0.005)
    assert np.abs(total[:, :2, 0] - acc[0, :, None]).max() < 1e-4


@pytest.mark.parametrize("axis", [0, 2])
def test_motion_at_depth_is_the_mean_of_the_waves_up_and_down(axis):
    """Undamped: u(z, t) = (u_s(t + z/c) + u_s(t - z/c)) / 2, with elements of 1/30 of the wavelength."""
    raw = rock(size_of=[20.0, 20.0, 5.0], upper="hard")
    dt, modulus = 0.001, wave_moduli(Material(**MATERIALS["hard"]))[axis]
    late = 100.0 / np.sqrt(modulus / 2600.0)
    t = np.arange(701) * dt

    def bump(t):
        return np.exp(-(((t - 0.3) / 0.05) ** 2)) * np.sin(30.0 * (t - 0.3))

    acc = np.zeros((3, len(t)))
    acc[axis] = bump(t)
    _, total = shaken(assemble_full(make(raw), DampingConfig()), acc, dt)
    exact = 0.5 * (bump(t + late) + bump(t - late))
    assert np.abs(total[:, 2, axis] - exact).max() < 0.01
    assert np.abs(np.delete(total[:, 2], axis, axis=1)).max() < 1e-6


@pytest.mark.parametrize("order", [1, 2])
def test_column_of_two_damped_layers_is_the_closed_form(order):
    """u = cos(k z) in the upper layer; below, the waves that keep motion and traction at the interface."""
    hard, soft = (Material(**MATERIALS[name]) for name in ("hard", "soft"))
    alpha, beta = 0.4, 1e-3
    levels = np.concatenate([np.linspace(0.0, -40.0, 81), np.linspace(-40.0, -100.0, 121)[1:]])
    field = FreeField(levels, (soft,) * 80 + (hard,) * 120, order, frozenset())
    omega = 2.0 * np.pi * np.array([0.5, 3.0, 9.0])
    answer = respond(field, 0, (-(omega**2) + 0j, 1j * omega), (alpha, beta))
    z = np.array([-25.0, -40.0, -70.0, -100.0])
    moved = 1.0 + (shapes(field, z) @ answer.motion.T) * -(omega**2)  # of a unit motion of the surface
    # relative to the surface C acts on w alone: rho omega^2 becomes rho (omega^2 - i alpha omega) on w only,
    # so that w = -(1 - cos(k z)) omega^2 / (omega^2 - i alpha omega)
    share = omega**2 / (omega**2 - 1j * alpha * omega)
    k = [
        np.sqrt(m.rho * (omega**2 - 1j * alpha * omega) / (wave_moduli(m)[0] * (1.0 + 1j * beta * omega)))
        for m in (soft, hard)
    ]
    up = np.cos(k[0] * 40.0)
    slope = wave_moduli(soft)[0] * k[0] * np.sin(k[0] * 40.0) / (wave_moduli(hard)[0] * k[1])
    below = [up * np.cos(k[1] * d) - slope * np.sin(k[1] * d) for d in (30.0, 60.0)]
    exact = 1.0 - share * (1.0 - np.array([np.cos(k[0] * 25.0), up, *below]))
    assert np.abs(moved - exact).max() < (3e-4 if order == 1 else 1e-6)


@pytest.mark.slow
def test_field_of_an_irregular_mesh_returns_the_record_within_one_per_cent(northridge):
    """Elements of 20 m bent by up to 3 m: no level of nodes is left but the top and the bottom."""
    raw = {"blocks": {"low": box([0, 0, 0], [80, 80, 80], "hard", "hex20")}}
    raw["ground"] = {"input": "free_field", "viscous": [{"block": "low", "faces": ["zmin", *SIDES]}]}
    raw["outputs"] = {"nodes": {"middle": {"block": "low", "at": [40, 40, 80]}}}
    scene = make(raw)
    block = scene.blocks["low"]
    x, y, z = block.points.T
    bend = 3.0 * np.sin(np.pi * z / 80.0) * np.cos(np.pi * y / 80.0)
    points = np.stack(
        [x + bend * np.sin(np.pi * x / 80.0), y, z + bend * np.cos(2.0 * np.pi * x / 80.0)], axis=1
    )
    blocks = {"low": replace(block, points=points)}
    field = free_field(blocks, frozenset(blocks), GroundConfig(), "s.yaml")
    assert 4 <= len(field.materials) <= 5
    bent = replace(scene, blocks=blocks).with_effects(field)
    _, total = shaken(assemble_full(bent, DAMPED), resample(northridge, 0.01, 0.005), 0.005)
    record = resample(northridge, 0.01, 0.005).T
    assert l2(total[:, 0], record) < 0.002
    assert abs(np.abs(total[:, 0]).max() / np.abs(record).max() - 1.0) < 0.01


@pytest.mark.parametrize(
    ("element", "limit"), [pytest.param("tet10", 0.006, marks=pytest.mark.slow), ("tet4", 0.04)]
)
def test_field_of_tetrahedra_returns_the_record(element, limit, northridge):
    """Their nodes do not carry the column's mass alike; elements of 20 m."""
    acc = resample(northridge, 0.01, 0.005)
    _, total = shaken(assemble_full(make(rock(element)), DAMPED), acc, 0.005)
    assert max(l2(total[:, node], acc.T) for node in (0, 1)) < limit


def dam(stiffness, kind):
    """Two blocks and their joint on level rock: without mass and held, or within viscous faces."""
    free = kind == "massless"
    raw = {
        "materials": MATERIALS | {"hard": {"E": stiffness, "nu": 0.25, "rho": 2600.0}},
        "blocks": {
            "rock": box([-60, -60, -60], [120, 120, 60], "hard") | {"mass": not free},
            "left": box([-20, -20, 0], [20, 40, 60], "concrete"),
            "right": box([0, -20, 0], [20, 40, 60], "concrete"),
        },
        "joints": {"joint": {"between": ["left", "right"], "normal_stiffness": 20e9}},
        "ties": {name: {"between": [name, "rock"]} for name in ("left", "right")},
        "outputs": {"nodes": {"crest": {"block": "left", "at": [0, -20, 60]}}},
    }
    if free:
        return make(raw | {"supports": [{"block": "rock", "face": "zmin"}]})
    viscous = [{"block": "rock", "faces": ["zmin", *SIDES]}]
    return make(raw | {"ground": {"input": kind, "viscous": viscous}})


def motion(system, acc, dt=0.01):
    history = simulated(system, acc, dt, integrator="generalized_alpha", initial_state="undeformed")
    assert history.stats["ledger_imbalance"] < 1e-10
    return history


def test_dam_on_level_rock_moves_as_by_uniform_input(northridge):
    """Relative to the surface's motion the forces of either formulation act on the dam alone."""
    smooth = np.apply_along_axis(np.convolve, 1, northridge, np.hanning(15) / 7.0, "same")
    one, other = (motion(assemble_full(dam(15e9, k), DAMPED), smooth) for k in ("uniform", "free_field"))
    assert l2(other.disp, one.disp) < 1e-4
    assert l2(other.jump, one.jump) < 2e-3
    reduced = motion(reduce_scene(dam(15e9, "free_field"), ModeChoice(count=40), DAMPED).system, smooth)
    assert l2(reduced.disp, other.disp) < 1e-2


@pytest.mark.slow
def test_dam_on_stiff_rock_moves_as_on_rock_without_mass(northridge):
    one, other = (motion(assemble_full(dam(5e12, k), DAMPED), northridge) for k in ("massless", "free_field"))
    assert l2(other.disp, one.disp) < 0.01
    soft = [motion(assemble_full(dam(15e9, k), DAMPED), northridge) for k in ("massless", "free_field")]
    assert l2(soft[1].disp, soft[0].disp) > 0.02


def test_what_elements_cannot_carry_is_left_out_and_said_in_the_history(northridge):
    history, _ = shaken(assemble_full(make(rock(size_of=20.0)), DAMPED), northridge, 0.01)
    left_out, off = history.warnings
    assert "free field: left out of the record's acceleration: x above" in left_out
    assert "waves are shorter there than about three of the rock's elements, or steps" in left_out
    assert "acceleration at depth differs from that of plane waves in continuous layers" in off


def transfer(freq, depth, beta, modulus):
    """Motion at a depth [m] of 20 m of soft on 30 m of hard rock for a unit motion of the surface (nf,)."""
    omega = 2.0 * np.pi * np.maximum(freq, 1e-9)
    moved, traction, top = np.ones(len(freq), dtype=complex), np.zeros(len(freq), dtype=complex), 0.0
    for name, bottom in (("soft", 20.0), ("hard", 50.0)):
        if depth > top:
            G = modulus(DEEP[name]) * (1.0 + 1j * omega * beta)
            k = omega * np.sqrt(DEEP[name]["rho"] / G)
            c, s = np.cos(k * (min(depth, bottom) - top)), np.sin(k * (min(depth, bottom) - top))
            moved, traction = moved * c + traction * s / (G * k), traction * c - moved * G * k * s
        top = bottom
    return moved


DEEP = {
    "soft": {"E": 0.8e9, "nu": 0.3, "rho": 2000.0},
    "hard": {"E": 6e9, "nu": 0.25, "rho": 2400.0},
}
MODULI = {
    0: lambda m: m["E"] / (2.0 * (1.0 + m["nu"])),
    2: lambda m: m["E"] * (1.0 - m["nu"]) / ((1.0 + m["nu"]) * (1.0 - 2.0 * m["nu"])),
}


@pytest.mark.parametrize(
    ("dt", "beta", "step", "said"),
    [
        pytest.param(0.02, 0.7e-3, 0.625e-3, [], marks=pytest.mark.slow),
        pytest.param(0.02, 2e-3, 0.625e-3, [], marks=pytest.mark.slow),
        pytest.param(0.01, 0.7e-3, 0.5e-3, ["left out", "differs"], marks=pytest.mark.slow),
        (0.01, 2e-3, 1.25e-3, ["left out", "differs"]),
    ],
)
def test_motion_at_three_depths_of_damped_layers_is_the_transfer_functions(dt, beta, step, said, tmp_path):
    """Noise up to the Nyquist frequency, 25 and 50 Hz: within 2 % up to there, or up to where it is said."""
    noise = np.random.default_rng(5).standard_normal((2, round(1.2 / dt)))
    record = np.zeros((2, round(2.4 / dt)))
    record[:, round(0.4 / dt) :][:, : noise.shape[1]] = noise * np.hanning(noise.shape[1])
    for name, values in zip("xz", record, strict=True):
        np.savetxt(tmp_path / f"{name}.txt", values)
    sides = {"faces": SIDES, "distance": 50.0}
    raw = {
        "materials": DEEP,
        "blocks": {
            "top": box([0, 0, -20], [5, 5, 20], "soft", "hex20", [5.0, 5.0, 2.5]),
            "bottom": box([0, 0, -50], [5, 5, 30], "hard", "hex20", [5.0, 5.0, 2.5]),
        },
        "ties": {"t": {"between": ["bottom", "top"]}},
        "ground": {
            "input": "free_field",
            "viscous": [{"block": "bottom", "faces": ["zmin"], "distance": 50.0}]
            + [{"block": name} | sides for name in ("bottom", "top")],
        },
        "damping": {"rayleigh": {"alpha": 0, "beta": beta}},
        "records": [
            {"name": "n", "unit": "m/s2", "dt": dt, "components": {k: {"file": f"{k}.txt"} for k in "xz"}}
        ],
        "model": {"order": "full"},
        "transient": {"finest_step": step},
        "outputs": {
            "output_interval": dt,
            "plots": False,
            "nodes": {
                f"z{depth}": {"block": "top" if depth < 21 else "bottom", "at": [5, 5, -depth]}
                for depth in (20, 35, 50)
            },
        },
    }
    result = run(load_config(raw, tmp_path), tmp_path / "o").results[0].dataset
    warnings = json.loads(result.attrs["run_warnings"])
    warnings = [text for text in warnings if not text.startswith("transient.")]  # of the steps
    assert len(warnings) == len(said), warnings
    assert all(word in text for word, text in zip(said, warnings, strict=True))
    total = result.acceleration.to_numpy() + result.ground_acceleration.to_numpy()[:, None]
    count = 4 * len(total)
    freq = np.fft.rfftfreq(count, dt)
    for row, (component, modulus) in enumerate(MODULI.items()):
        limits = re.findall(rf"\b{'xyz'[component]} [^,]*(?:above|below) ([\d.]+) Hz", " ".join(warnings))
        band = freq < min(0.49 / dt, *map(float, limits), np.inf)
        surface = np.fft.rfft(record[row], count)
        for number, depth in enumerate((20, 35, 50)):
            moved = np.fft.rfft(total[:, number, component], count)
            exact = transfer(freq, depth, beta, modulus) * surface
            assert l2(moved[band], exact[band]) < 0.02, (component, depth)


def test_faces_without_a_distance_take_it_from_the_foot():
    scene = dam(15e9, "uniform")
    assert sorted(face.distance for face in scene.blocks["rock"].absorbing) == [60.0] * 5
    assert scene.radiating == {"rock"} and scene.find(FreeField) is None
    assert dam(15e9, "free_field").radiating == frozenset()
    with pytest.raises(ConfigError, match=r"viscous\[0\].faces\[0\]: its springs follow from its distance"):
        make(rock() | {"ground": {"rock": ["low"], "viscous": [{"block": "high", "faces": ["zmax"]}]}})


@pytest.mark.parametrize(
    ("ground", "message"),
    [
        ({"viscous": []}, r"ground.input: free_field is of rock with viscous faces, and there are 0"),
        ({"viscous": [], "input": "uniform", "rock": ["low"]}, r"ground.rock is of rock with viscous faces"),
        ({"viscous": [{"block": "low", "faces": SIDES}]}, r"viscous face at the bottom, and there is none"),
        (
            {
                "viscous": [
                    {"block": "low", "faces": ["zmin"]},
                    {"block": "high", "faces": ["zmax"], "distance": 9},
                ]
            },
            r"vertical, and one level bottom; those that are not vertical reach from 0 to 100 m",
        ),
        ({"viscous": [{"block": "low", "faces": ["zmin"]}]}, None),
        (
            {"viscous": [{"block": "low", "faces": ["zmin", "xmin", {"axis": "z", "at": 0.0}]}]},
            r"ground.viscous\[0\].faces\[2\]: 8 of 8 facets of block 'low' are named by",
        ),
        ({"surface": -1.0}, r"the rock's surface, -1 m, must be above its bottom, 0 m"),
        ({"input": "uniform", "surface": 1.0}, r"ground: `surface` is that of `input: free_field`"),
        ({"rock": ["none"]}, r"ground.rock\[0\]: no 'none' is defined"),
    ],
)
def test_fields_that_cannot_be_are_refused(ground, message):
    if (
        message is None
    ):  # sides that no face names: those of the blocks' boundary, up to where blocks are rock
        assert make(rock(**ground)).find(FreeField).levels[0] == 60.0
        return
    with pytest.raises(ConfigError, match=message):
        make(rock(**ground))


def test_rock_that_differs_along_a_level_is_refused():
    raw = {
        "blocks": {k: box([x, 0, 0], [40, 40, 40], k) for k, x in (("hard", 0), ("soft", 40))},
        "ties": {"t": {"between": ["hard", "soft"]}},
    }
    faces = ["zmin", "ymin", "ymax"]
    raw["ground"] = {
        "input": "free_field",
        "viscous": [{"block": "hard", "faces": faces}, {"block": "soft", "faces": faces}],
    }
    with pytest.raises(ConfigError, match=r"between 40 and 20 m the sides are of 'hard' and of 'soft'"):
        make(raw)


def test_weight_of_rock_on_springs_is_told():
    remarks = "\n".join(make(rock() | {"loads": {"gravity": [0, 0, -9.81]}}).remarks)
    assert remarks.count("gravity lets the rock sink onto the springs of its viscous faces") == 2


@pytest.mark.parametrize("inner", ["hard", "soft"])
def test_inner_rock_may_be_any(inner, northridge):
    """A plug of the same rock, without viscous faces, is rock; a softer one scatters the field."""
    where = {
        "left": ([0, 0, 60], [20, 60, 40]),
        "right": ([40, 0, 60], [20, 60, 40]),
        "front": ([20, 0, 60], [20, 20, 40]),
        "back": ([20, 40, 60], [20, 20, 40]),
    }
    blocks = {name: box(*place, "hard") for name, place in where.items()}
    blocks |= {"low": box([0, 0, 0], [60, 60, 60], "hard"), "plug": box([20, 20, 60], [20, 20, 40], inner)}
    pairs = [("low", name) for name in (*where, "plug")] + [("plug", name) for name in where]
    pairs += [(side, end) for side in ("left", "right") for end in ("front", "back")]
    outer = {"low": ["zmin", *SIDES], "left": ["xmin", "ymin", "ymax"], "right": ["xmax", "ymin", "ymax"]}
    outer |= {"front": ["ymin"], "back": ["ymax"]}
    raw = {
        "blocks": blocks,
        "ties": {f"t{k}": {"between": pair} for k, pair in enumerate(pairs)},
        "ground": {
            "input": "free_field",
            "rock": ["plug"],
            "viscous": [{"block": name, "faces": faces} for name, faces in outer.items()],
        },
        "outputs": {"nodes": {"top": {"block": "plug", "at": [40, 20, 100]}}},
    }
    _, total = shaken(assemble_full(make(raw), DAMPED), northridge, 0.01)
    error = np.abs(total[:, 0] - northridge.T).max() / np.abs(northridge).max()
    assert error < 2e-4 if inner == "hard" else error > 0.02


def test_rock_without_mass_and_modal_damping_are_refused():
    raw = rock()
    raw["blocks"]["low"]["mass"] = False
    with pytest.raises(ConfigError, match=r"viscous\[0\].block: block 'low' has no mass to carry waves"):
        make(raw)
    with pytest.raises(ConfigError, match=r"damping.modal: the free field is found for `rayleigh`"):
        reduce_scene(make(rock()), ModeChoice(count=2), DampingConfig(modal=0.05))


def test_run_says_what_its_displacement_is_relative_to(tmp_path, monkeypatch):
    """From YAML to NetCDF: a node far from the dam has no acceleration but the record's."""
    job = {
        "materials": MATERIALS,
        "blocks": {
            "rock": box([-60, -60, -60], [120, 120, 60], "hard"),
            "left": box([-20, -20, 0], [20, 40, 60], "concrete"),
            "right": box([0, -20, 0], [20, 40, 60], "concrete"),
        },
        "joints": {"joint": {"between": ["left", "right"], "normal_stiffness": 20e9}},
        "ties": {name: {"between": [name, "rock"]} for name in ("left", "right")},
        "ground": {"input": "free_field", "viscous": [{"block": "rock", "faces": ["zmin", *SIDES]}]},
        "damping": {"rayleigh": {"frequencies": [2, 15], "ratio": 0.05}},
        "outputs": {"nodes": {"far": {"block": "rock", "at": [60, 60, 0]}}, "plots": False},
        "records": [
            {
                "file": str(DATA / "northridge_mul009_g_dt0.01.txt"),
                "unit": "g",
                "dt": 0.01,
                "components": {"y": 1},
            }
        ],
        "model": {"modes": 10},
        "transient": {"finest_step": 0.01, "duration": 6.0},
    }
    (tmp_path / "s.yaml").write_text(json.dumps(job))
    (path,) = run(load_config(tmp_path / "s.yaml"), tmp_path).paths
    with romdam.open_result(path).dataset as data:
        assert data.attrs["base"].startswith("the motion of the level rock surface")
        assert data.attrs["integrator"] == "generalized_alpha"
        assert len(data.time) == 601
        far = np.abs(data.acceleration.sel(node="far")).max() / np.abs(data.ground_acceleration).max()
        assert 1e-4 < far < 0.1  # what the dam sends there
        assert np.abs(data.energy_residual).max() < 1e-9 * data.energy_input.max()

    def costly(*_):
        raise AssertionError("refused too late")

    for stage in ("study.load_motions", "study.scene_of"):
        monkeypatch.setattr(f"romdam.pipelines.error.{stage}", costly)
    with pytest.raises(
        ConfigError, match=r"ground.viscous: a study .* dashpots .* hold the rock by supports"
    ):
        study(load_config(tmp_path / "s.yaml"), tmp_path)


def test_natural_modes_do_not_know_how_the_rock_is_shaken():
    """They are of the mesh on its springs, with a free field or without."""
    field, uniform = make(rock()), make(rock(input="uniform"))
    assert field.find(FreeField) is not None and uniform.find(FreeField) is None
    freq = [natural_modes(one, DampingConfig(), 4).freq for one in (field, uniform)]
    np.testing.assert_allclose(freq[0], freq[1], rtol=1e-9)


SOFT = Material(E=2.3e9, nu=0.3, rho=2100.0, expansion=0.0)
STIFF = Material(E=9.1e9, nu=0.2, rho=2600.0, expansion=0.0)


@pytest.mark.parametrize("own", [None, (2.0, 5e-3)])
@pytest.mark.parametrize("component", [0, 2])
def test_continuous_layers_are_what_fine_columns_come_to(component, own):
    """Two layers with Rayleigh damping, of one its own too: 400 quadratic elements against waves, to 1e-6."""
    coarse = np.array([12.0, -8.0, -33.0])
    stiff = replace(STIFF, damping=own)
    field = FreeField(coarse, (SOFT, stiff), 1, frozenset())
    fine = np.concatenate([np.linspace(12.0, -8.0, 201), np.linspace(-8.0, -33.0, 201)[1:]])
    many = FreeField(fine, (SOFT,) * 200 + (stiff,) * 200, 2, frozenset())
    omega, damping = np.array([4.0, 60.0, 170.0]), (7.0, 1e-3)
    answer = respond(many, component, (-(omega**2) + 0j, 1j * omega), damping)
    at_ends = answer.motion[:, [399, 799]]  # relative to the surface, of a unit acceleration of it
    exact = layer_motion(field, component, omega, damping)
    total = 1.0 + at_ends * -(omega**2)[:, None]
    assert np.abs(total - exact).max() <= 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("order", [1, 2])
def test_a_column_strains_below_its_surface_alone(order):
    """Motion (z - 12) / 5 has the slope 1/5 down to the lowest end, and none above the surface."""
    levels = np.array([12.0, 9.0, 2.0])
    field = FreeField(levels, (SOFT, STIFF), order, frozenset())
    nodes = levels[1:] if order == 1 else np.array([10.5, 9.0, 5.5, 2.0])
    z = np.array([12.5, 12.0, 11.0, 9.0, 8.0, 2.0])
    motion = (nodes - 12.0) / 5.0
    assert slopes(field, z) @ motion == pytest.approx([0.0, 0.2, 0.2, 0.2, 0.2, 0.2], abs=1e-12)
    assert shapes(field, z) @ motion == pytest.approx([0.0, 0.0, -0.2, -0.6, -0.8, -2.0], abs=1e-12)
