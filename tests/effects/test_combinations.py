"""Every pair of effects: full order and the reduced model with all modes are one, or the physics is named."""

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from simulating import simulated

import romdam.effects.compressible_water
from romdam.config import parse_config
from romdam.config.effects import EFFECTS, EXCLUDED
from romdam.config.sections.job import DampingConfig
from romdam.core.errors import ConfigError
from romdam.core.motion import GroundMotion, MovingSupports, SupportMotion
from romdam.core.scene import ForceHistory, Material
from romdam.effects.full_order import assemble_full
from romdam.fem.column import wave_moduli
from romdam.records.processing.force_rows import add_force_rows
from romdam.records.processing.integrate import displacement
from romdam.records.processing.support_motions import add_support_rows
from romdam.reduction.mode_choice import ALL_MODES
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.construction import constructed
from romdam.timestepping.grouting import grouted
from romdam.timestepping.sustained import rested

DT = 0.01
SIDES = ["xmin", "ymin", "ymax"]
LAW = {"normal_stiffness": "2 GPa/m", "shear_stiffness": "1 GPa/m", "friction": 0.5}


def box(origin, size, edge, material="concrete"):
    return {"material": material, "box": {"origin": origin, "size": size, "element_size": edge}}


def water(model):
    """Beside both blocks; slow sound, so that waves matter on so small a scene."""
    faces = [{"block": name, "face": "ymin"} for name in ("left", "right")]
    slow = {"sound_speed": 150.0, "bottom_reflection": 0.6, "cutoff": 12.0} if model == "compressible" else {}
    return {"water": {"model": model, "level": 7.5, "length": 8.0, "faces": faces} | slow}


KEYS = {
    "moving supports": {"supports": {"delay": 0.03, "factor": 1.3}},
    "motion along": {"ground": {"along": {"axis": [0.6, 0.8, 0], "velocity": 250.0, "cutoff": 8.0}}},
    "Westergaard's added mass": water("westergaard"),
    "incompressible water": water("incompressible"),
    "compressible water": water("compressible"),
    "viscous boundary": {"ground": {"viscous": [{"block": "rock", "faces": ["zmin", *SIDES]}]}},
    "free field": {
        "ground": {"input": "free_field", "viscous": [{"block": "rock", "faces": ["zmin", *SIDES]}]}
    },
    "inclined waves": {
        "ground": {
            "input": "free_field",
            "viscous": [{"block": "rock", "faces": ["zmin", *SIDES]}],
            "incidence": {"angle": 25.0, "axis": [0.8, 0.6, 0.0], "at": 3.0},
        }
    },
    "staged weight": {"loads": {"weight": "staged"}},
    "force histories": {
        "loads": {
            "force_history": [
                {
                    "table": str(Path(__file__).parent / "force.csv"),
                    "unit": "MN",
                    "block": "right",
                    "at": [8, 0, 8],
                    "direction": [-1, 1, 0.5],
                    "start": "0.05 s",
                },
                {
                    "table": str(Path(__file__).parent / "force.csv"),
                    "unit": "kPa",
                    "block": "left",
                    "face": "xmin",
                    "scale": 60.0,
                    "after": "hold",
                },
            ]
        }
    },
    "temperature": {
        "loads": {
            "temperature": [
                {
                    "faces": {
                        "table": str(Path(__file__).parent / "temperature_of_faces.csv"),
                        "unit": "degC",
                        "upstream": "ymin",
                        "downstream": "ymax",
                    },
                    "reference": "12 degC",
                    "blocks": ["left", "right"],
                }
            ]
        }
    },
    "water in joints": {"loads": {"joint_water": [{"joints": ["joint"], "level": 6.0}]}},
    "grouting": {"joints": {"grouting_pressure": 2e5}},
    "staged construction": {
        "construction": [
            {"name": "blocks", "pour": ["right"]},
            {"name": "cold", "temperature": [{"change": "-4 K", "blocks": ["left"]}]},
            {"name": "lower", "grout": [{"joints": ["joint"], "below": 4.2}]},
            {"name": "upper", "grout": [{"joints": ["joint"], "above": 4.2}]},
        ]
    },
    "anchors": {
        "anchors": {
            "down": {
                "head": {"block": "left", "at": [1.3, 2.2, 8]},
                "foot": {"block": "rock", "at": [1, 1, -3]},
                "stiffness": 3e9,
                "pretension": 2e5,
            },
            "across": {
                "head": {"block": "left", "at": [3, 1.5, 6]},
                "foot": {"block": "right", "at": [6, 2.5, 5]},
                "E": 2e11,
                "area": 0.02,
                "pretension": 1e5,
                "loss": 0.1,
            },
            "away": {"head": {"block": "right", "at": [6, 4, 7]}, "foot": [6, 9, 0], "stiffness": 5e8},
        }
    },
    "dampers": {
        "dampers": {
            "across": {
                "head": {"block": "left", "at": [3, 1.5, 6]},
                "foot": {"block": "right", "at": [6, 2.5, 7]},
                "damping": 4e6,
            },
            "down": {
                "head": {"block": "left", "at": [1.3, 2.2, 8]},
                "foot": {"block": "rock", "at": [1, 1, -3]},
                "damping": 2e6,
            },
            "away": {"head": {"block": "right", "at": [6, 4, 7]}, "foot": [6, 9, 0], "damping": 1e6},
        }
    },
    "masses": {
        "masses": {
            "gate": {"block": "right", "face": "ymax", "mass": 2e5},
            "hoist": {"block": "left", "at": [2, 2, 8], "mass": 5e4},
        }
    },
    "modal damping": {"damping": {"modal": 0.04}},
    "damping by material": {
        "materials": {
            "concrete": {"damping": {"frequencies": [2.0, 20.0], "ratio": 0.08}},
            "rock": {"damping": {"alpha": 0.3, "beta": 4e-4}},
        }
    },
    "moduli by duration": {"materials": {"concrete": {"E_dynamic": 4.5e9}, "rock": {"E_dynamic": 2.4e9}}},
}


OWN = {"water", "ground", "construction", "anchors", "dampers", "masses"}  # sections of effects alone
ON_ROCK = "water on rock"  # no effect by itself: the reservoir of others lies on the rock


def job(*effects):
    """A block on rock with mass, one beside it on a support, a mortar joint with friction between them.

    The rock reaches below both, and upstream as far as the water, where that lies on it.
    """
    asked, rock = {}, box([0, -2, -4], [4, 8, 4], [2, 4, 2], "rock")
    for name in effects:
        if name == ON_ROCK:
            asked["water"]["rock"] = [{"block": "rock", "face": "zmax"}]
            rock = box([0, -10, -4], [8, 16, 4], [2, 4, 2], "rock")
            continue
        for section, keys in KEYS[name].items():
            if section == "materials":
                already = asked.get(section, {})
                keys = {name: already.get(name, {}) | values for name, values in keys.items()}
            asked[section] = keys if isinstance(keys, list) else asked.get(section, {}) | keys
    rests = [
        {"block": "right", "face": "zmin"} | ({"motion": asked["supports"]} if "supports" in asked else {})
    ]
    if not asked.get("ground", {}).get("viscous"):
        rests.append({"block": "rock", "face": "zmin"})
    materials = {
        "concrete": {"E": 3e9, "nu": 0.2, "rho": 2400.0, "expansion": 1e-5},
        "rock": {"E": 2e9, "nu": 0.25, "rho": 2500.0},
    }
    return {
        "materials": {k: keys | asked.get("materials", {}).get(k, {}) for k, keys in materials.items()},
        "blocks": {
            "rock": rock,
            "left": box([0, 0, 0], [4, 4, 8], [2, 4, 2]),
            "right": box([4, 0, 0], [4, 4, 8], [2, 4, 8 / 3]),
        },
        "ties": {"foot": {"between": ["left", "rock"], "discretization": "mortar"}},
        "supports": rests,
        "joints": {"joint": {"between": ["left", "right"]} | LAW | asked.get("joints", {})},
        "loads": {"gravity": [0, 0, -9.81]} | asked.get("loads", {}),
        "damping": asked.get("damping", {"rayleigh": {"frequencies": [2.0, 20.0], "ratio": 0.04}}),
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}],
        "model": {"modes": "all"},
        "transient": {"finest_step": DT},
        "outputs": {"nodes": {"top": {"block": "left", "at": [0, 0, 8]}}},
    } | {key: keys for key, keys in asked.items() if key in OWN}


def shaking(scene, seconds=0.6):
    """A pulse along all axes, (rows, nt), followed by what supports do."""
    time = np.arange(round(seconds / DT) + 1) * DT
    window = np.sin(np.pi * np.minimum(time / 0.5, 1.0)) ** 2
    acc = np.stack(
        [a * window * np.sin(2 * np.pi * f * time) for a, f in ((6.0, 3.1), (8.0, 4.3), (3.0, 6.0))]
    )
    ground = (
        acc
        if scene.find(MovingSupports) is None
        else add_support_rows(acc, DT, scene.find(MovingSupports).motions)
    )
    return add_force_rows(ground, DT, [one.signal for one in scene.every(ForceHistory)])


def ready(system):
    """Built, grouted, and at rest."""
    return rested(grouted(constructed(system, 1e-8), 1e-8), 1e-10)


def all_modes(K, M, *_):
    """Of the reservoir too, whose reduction is exact then."""
    return eigh(K.toarray(), M.toarray())


@pytest.mark.parametrize(
    "pair",
    [
        pytest.param(pair, marks=[pytest.mark.slow] * (k % 2))  # every other pair by default
        for k, pair in enumerate(pair for pair in combinations(KEYS, 2) if frozenset(pair) not in EXCLUDED)
    ]
    + [
        ("compressible water", ON_ROCK),
        ("compressible water", ON_ROCK, "motion along"),
        ("incompressible water", ON_ROCK, "free field"),
        ("compressible water", ON_ROCK, "free field", "moving supports", "staged weight"),
    ],
    ids=", ".join,
)
def test_pair_at_full_order_and_reduced_with_all_modes(pair, monkeypatch):
    """Jumps, displacements and joint forces within 1e-8 of their peaks; ledgers close."""
    monkeypatch.setattr(romdam.effects.compressible_water, "modes_below", all_modes)
    config = parse_config(job(*pair), "s.yaml")
    assert all(EFFECTS[name].acts(config) for name in pair if name != ON_ROCK)
    scene = build_scene(config, Path(), "s.yaml")
    ratios = "modal damping" in pair  # whose matrix would be full on the mesh
    made = [reduce_scene(scene, ALL_MODES, config.damping).system]
    made += [] if ratios else [assemble_full(scene, config.damping)]
    found = [simulated(ready(one), shaking(scene), DT, "generalized_alpha") for one in made]
    for history in found:
        assert history.stats["ledger_imbalance"] < 1e-11
        assert (history.state != 0).mean() > 0.0 and history.jump.any()
    for name in ("jump", "disp", "traction", "attached"):
        own, mesh = getattr(found[0], name), getattr(found[-1], name)
        assert np.abs(own - mesh).max(initial=0.0) <= 1e-8 * np.abs(mesh).max(initial=0.0), name


@pytest.mark.parametrize(
    ("before", "name"), [*(((), name) for name in KEYS), (("compressible water", "free field"), ON_ROCK)]
)
def test_each_effect_changes_what_happens(before, name):
    """Nothing is passed over: with the effect the same shaking opens the joint otherwise."""
    jumps = []
    for effects in (before, (*before, name)):
        config = parse_config(job(*effects), "s.yaml")
        scene = build_scene(config, Path(), "s.yaml")
        system = ready(reduce_scene(scene, ALL_MODES, config.damping).system)
        jumps.append(simulated(system, shaking(scene), DT, "generalized_alpha").jump)
    assert np.abs(jumps[1] - jumps[0]).max() > 1e-3 * np.abs(jumps[0]).max()


@pytest.mark.parametrize("pair", [tuple(sorted(pair)) for pair in EXCLUDED], ids=", ".join)
def test_pair_that_physics_excludes_is_refused_with_the_reason(pair):
    """One reservoir has one water; a column of rock has no modal ratios; waves come one way."""
    raw = job(*pair)
    if all("water" in KEYS[name] for name in pair):
        assert raw["water"]["model"] in ("westergaard", "incompressible", "compressible")
        return  # one key, of one value
    reason = EXCLUDED[frozenset(pair)]
    if pair == ("free field", "motion along"):  # whose rock has viscous faces too
        reason = EXCLUDED[frozenset({"motion along", "viscous boundary"})]
    with pytest.raises(ConfigError, match=re.escape(reason)):
        parse_config(raw, "s.yaml")


def test_supports_that_follow_one_motion_move_water_with_waves_as_the_base_does():
    """Along the river neither floor nor banks move the water, so only the dam does: the same jumps."""
    raw = job("moving supports", "compressible water")
    raw["supports"][1]["motion"] = raw["supports"][0]["motion"]
    moving = build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")
    config = parse_config(job("compressible water"), "s.yaml")
    acc = shaking(build_scene(config, Path(), "s.yaml")) * [[0.0], [1.0], [0.0]]
    ground = add_support_rows(acc, DT, moving.find(MovingSupports).motions)
    for build in (assemble_full, lambda scene, damping: reduce_scene(scene, config.model, damping).system):
        own = simulated(build(moving, config.damping), ground, DT, "generalized_alpha")
        still = build(build_scene(config, Path(), "s.yaml"), config.damping)
        base = simulated(still, acc + ground[3:6], DT, "generalized_alpha")
        np.testing.assert_allclose(own.jump, base.jump, atol=1e-9 * np.abs(base.jump).max())
        follows = ground[9:12].T
        np.testing.assert_allclose(own.disp, base.disp + follows, atol=1e-9 * np.abs(follows).max())


@pytest.mark.parametrize("reduced", [False, True])
def test_wave_of_a_moving_support_leaves_through_a_viscous_face(reduced):
    """A bar without lateral strain, moved at one end by d(t), at s from it: d(t - s/c), and no reflection."""
    bar = Material(E=20e9, nu=0.0, rho=2500.0)
    raw = {
        "materials": {"bar": {"E": bar.E, "nu": bar.nu, "rho": bar.rho}},
        "blocks": {"bar": box([0, 0, 0], [200, 5, 5], 5.0, "bar")},
        "supports": [{"block": "bar", "face": "xmax", "motion": {"delay": 0.1}}],
        "ground": {"viscous": [{"block": "bar", "faces": ["xmin"], "distance": 1e8}]},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}],
        "model": {"modes": "all"},
        "transient": {"finest_step": DT},
        "outputs": {"nodes": {"in": {"block": "bar", "at": [100, 0, 0]}}},
    }
    scene = build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")
    dt, n = 1e-3, 401
    t = dt * np.arange(n)
    pulse = np.where(t < 0.1, np.sin(np.pi * t / 0.1) ** 4, 0.0)
    acc = np.gradient(np.gradient(pulse, dt), dt)
    motion = SupportMotion(0, record=GroundMotion("pulse", np.stack([acc, 0 * acc, 0 * acc]), dt))
    ground = add_support_rows(np.zeros((3, n)), dt, (motion,))
    damping = DampingConfig()
    system = reduce_scene(scene, ALL_MODES, damping).system if reduced else assemble_full(scene, damping)
    history = simulated(system, ground, dt, "generalized_alpha")
    d, late = displacement(acc, dt), 100.0 / np.sqrt(wave_moduli(bar)[2] / bar.rho)
    exact = np.interp(t - late, t, d, left=0.0)
    assert np.abs(history.disp[:, 0] - exact).max() < 0.01 * np.abs(exact).max()
    assert history.stats["ledger_imbalance"] < 1e-10


@pytest.mark.parametrize("effects", [(), ("compressible water",), ("incompressible water",)])
def test_base_in_a_free_field_and_moving_supports_superpose(effects):
    """With the joint wide open all is linear: both motions make the sum of each alone, at their own times.

    Of the supports alone nothing comes up through the rock: they move it as on rock shaken uniformly.
    """
    far = {"gap": 1.0}
    raw, still = (job(*effects, "moving supports", name) for name in ("free field", "viscous boundary"))
    for one in (raw, still):
        one["joints"]["joint"] |= far
        one["loads"] = {}
        one["outputs"]["nodes"]["side"] = {"block": "right", "at": [8, 0, 8]}
    found = {}
    for kind, one in (("field", raw), ("uniform", still)):
        config = parse_config(one, "s.yaml")
        scene = build_scene(config, Path(), "s.yaml")
        ground = shaking(scene)
        base, supports = ground.copy(), ground.copy()
        base[3:], supports[:3] = 0.0, 0.0
        system = assemble_full(scene, config.damping)
        for name, motion in (("both", ground), ("base", base), ("supports", supports)):
            history = simulated(system, motion, DT, "generalized_alpha")
            assert (history.state == 0).all()
            found[kind, name] = history.disp
    size = np.abs(found["field", "both"]).max()
    superposed = found["field", "base"] + found["field", "supports"]
    np.testing.assert_allclose(found["field", "both"], superposed, atol=1e-10 * size)
    np.testing.assert_allclose(found["field", "supports"], found["uniform", "supports"], atol=1e-10 * size)
    assert np.abs(found["field", "supports"]).max() > 1e-3 * size
