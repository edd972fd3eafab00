"""Water that lies on rock with mass: closed form of a layer on a half-space, own meshes, and refusals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arch_dams import DIVISIONS, arch_dam
from arch_dams import ROCK as CANYON
from reservoir_meshes import box as mesh_box
from reservoir_meshes import written
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu
from test_water_in_free_field import ON_ROCK, apart, crest, harmonic, make, moved

from romdam.config import parse_config
from romdam.core.errors import ConfigError
from romdam.core.scene import FreeField, Material, Reservoir
from romdam.effects.compressible_water import reservoir_waves
from romdam.effects.full_order import assemble_full
from romdam.fem.column import wave_moduli
from romdam.fem.water.own_mesh import water_body
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.scene.plausible import odd_remarks

C, RHO, H, CUTOFF = 1440.0, 1000.0, 40.0, 100.0
ROCK = Material(8e9, 0.25, 2500.0)


def box(origin, size, edge, material):
    return {"material": material, "box": {"origin": origin, "size": size, "element_size": edge}}


def column(**changes):
    """Rock 80 m deep, 60 m long, on rollers, with a wall at its end that is held, and water 40 m deep."""
    raw = {
        "materials": {
            "wall": {"E": 1e14, "nu": 0.2, "rho": 2400.0},
            "rock": {"E": ROCK.E, "nu": ROCK.nu, "rho": ROCK.rho},
        },
        "blocks": {
            "rock": box([0, -60, -80], [10, 60, 80], [10, 10, 4], "rock"),
            "wall": box([0, 0, 0], [10, 5, 40], [10, 5, 4], "wall"),
        },
        "supports": [
            {"block": "wall", "face": "ymax"},
            {"block": "wall", "face": "xmin"},
            *({"block": "rock", "face": face, "fix": [face[0]]} for face in ("xmin", "xmax", "ymin", "ymax")),
        ],
        "ground": {"input": "free_field", "viscous": [{"block": "rock", "faces": ["zmin"], "distance": 1e8}]},
        "water": {
            "model": "compressible",
            "level": H,
            "faces": [{"block": "wall", "face": "ymin"}],
            "rock": [{"block": "rock", "face": "zmax"}],
            "length": 60.0,
            "cutoff": CUTOFF,
        },
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "damping": {"rayleigh": {"alpha": 0.0, "beta": 0.0}},
        "model": {"order": "full"},
        "transient": {"finest_step": 0.01},
        "outputs": {"nodes": {"floor": {"block": "rock", "at": [0, -30, 0]}}},
    }
    raw["water"] |= changes
    config = parse_config(raw, "s.yaml")
    return build_scene(config, Path(), "s.yaml"), config


@pytest.mark.parametrize("reflection", [1.0, 0.6])
def test_water_layer_on_a_half_space_has_the_closed_form(reflection):
    """P waves come up: at the floor p = i rho c tan(w H/c) (v - q p/rho), v = v_0 - p/(rho_r c_p).

    Pressure all along the floor and motion of the rock, 0.1 to 1.8 times the first frequency of the water,
    where the rock stands still and carries all: within 1 % of the largest.
    """
    scene, config = column(bottom_reflection=reflection)
    system, waves = assemble_full(scene, config.damping), reservoir_waves(scene)
    coupling = water_body(scene.find(Reservoir), scene.blocks, C / (10.0 * CUTOFF)).coupling["rock"]
    floor = np.flatnonzero(np.diff(coupling.indptr))
    impedance = np.sqrt(ROCK.rho * wave_moduli(ROCK)[2])
    absorbed = (1.0 - reflection) / (1.0 + reflection) / (RHO * C)
    pressures, motions = [], []
    for share in (0.1, 0.4, 0.7, 0.9, 1.0, 1.1, 1.4, 1.8):
        omega = share * np.pi * C / (2.0 * H)
        A = csc_matrix(system.K - omega**2 * system.M + 1j * omega * system.C)
        u = splu(A).solve(-np.asarray(system.load @ harmonic(system, omega, 2)))
        stiffness = 1j * RHO * C * np.tan(omega * H / C)
        free = 1.0 / (1j * omega)
        pressure = stiffness * free / (1.0 + stiffness * (absorbed + 1.0 / impedance))
        pressures.append((1j * omega * (waves.at_dam.T @ u[system.solids :])[floor], pressure))
        motions.append((free + 1j * omega * (system.observe @ u)[2], free - pressure / impedance, free))
    size = max(abs(exact) for _, exact in pressures)
    for found, exact in pressures:
        assert np.abs(found - exact).max() < 0.01 * size
    for found, exact, free in motions:
        assert abs(found - exact) < 0.01 * abs(free)
    reduction = [abs(exact / free) for _, exact, free in motions]
    assert min(reduction) < (1e-10 if reflection == 1.0 else 0.5) < max(reduction)


def test_meshed_reservoir_on_rock_is_the_prism(tmp_path):
    """Layers of even thickness, which do not match the rock: crest within 1 %, harmonic and not."""
    mesh = mesh_box([0, -120, 0], [20, 120, 40], [10, 5, 5])
    file = written(tmp_path / "water.msh", mesh, "ymin")
    prism, config = make(**ON_ROCK)
    meshed, _ = make(**ON_ROCK, mesh={"file": file, "group": "all", "unit": "m", "end": "ymin"})
    one, other = assemble_full(meshed, config.damping), assemble_full(prism, config.damping)
    for share in (0.4, 0.8, 1.2):
        omega = share * np.pi * C / (2.0 * H)
        for axis in (1, 2):
            exact = crest(other, omega, axis)
            assert np.abs(crest(one, omega, axis) - exact).max() < 0.01 * np.abs(exact).max()
    assert apart(moved(one).disp, moved(other).disp) < 0.01
    reduced = moved(reduce_scene(meshed, config.model, config.damping).system)
    assert apart(reduced.disp, moved(one).disp) < 0.01
    assert reduced.stats["ledger_imbalance"] < 1e-10


def test_canyon_of_an_arch_dam_is_covered_by_dam_and_three_rocks():
    """Rigid motion of dam and rock makes the flux of all walls, which the divergence theorem gives alone."""
    rocks = [{"block": f"rock_{zone}", "face": "surface"} for zone in ("left", "centre", "right")]
    finer = DIVISIONS | {"up": 8, "along": 2, "rock": 4, "upstream": 3}
    raw = arch_dam(rock=CANYON | {"boundary": "viscous"}, divisions=finer) | {
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 60},
        "transient": {"finest_step": 0.01},
    }
    raw["water"] = {
        "model": "compressible",
        "level": 90.0,
        "length": 120.0,
        "cutoff": 8.0,
        "faces": [{"block": f"C{k}", "face": "upstream"} for k in (1, 2, 3, 4)],
        "rock": rocks,
    }
    scene = build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")
    body = water_body(scene.find(Reservoir), scene.blocks, 18.0)
    swept = np.zeros_like(body.rigid)
    swept[body.wet] = sum(Q @ np.tile(np.eye(3), (Q.shape[1] // 3, 1)) for Q in body.coupling.values())
    assert {"rock_left", "rock_centre", "rock_right"} < set(body.coupling)
    off = np.abs(swept - body.rigid).sum(axis=0) / np.abs(body.rigid).sum(axis=0)
    assert off.max() < 0.003  # five times as much on the coarsest mesh


def test_floor_below_the_surface_of_the_record_is_said():
    """The channel beyond the far end moves as the record does, not as the rock at its depth."""
    scene, _ = column()
    field = scene.find(FreeField)
    deep = scene.with_effects(replace(field, levels=field.levels + 30.0))
    said = [[remark for remark in odd_remarks(one, {}) if "far end" in remark] for one in (scene, deep)]
    assert [len(remarks) for remarks in said] == [0, 1]
    assert "the dam's foot is 30 m below the level surface" in said[1][0]


def test_turned_model_moves_alike():
    """By 30 degrees about the vertical: the crest's harmonic motion turns with all else."""
    scene, config = make(**ON_ROCK)
    angle = np.radians(30.0)
    R = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    blocks = {name: replace(block, points=block.points @ R.T) for name, block in scene.blocks.items()}
    reservoir = replace(scene.find(Reservoir), upstream=R @ scene.find(Reservoir).upstream)
    turned = assemble_full(replace(scene, blocks=blocks).with_effects(reservoir), config.damping)
    system, omega = assemble_full(scene, config.damping), 0.8 * np.pi * C / (2.0 * H)
    by_axis = np.stack([crest(turned, omega, axis) for axis in range(3)], axis=1)
    for axis in range(3):
        exact = R @ crest(system, omega, axis)
        np.testing.assert_allclose(by_axis @ R[:, axis], exact, atol=1e-9 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length": 90.0}, r"water.rock: 600 of the 900 m2 of .* limit 0.95 .* shorten `length`"),
        (
            {"rock": [{"block": "rock", "face": "zmin"}]},
            r"water.rock\[0\]: no wall .* lies on the face \(0 m2",
        ),
        ({"model": "westergaard", "cutoff": 50.0}, r"rock: Westergaard's pressure knows no floor that moves"),
        (
            {"rock": [{"block": "wall", "face": "ymin"}]},
            r"water.rock\[0\].*water.faces\[0\]",
        ),
    ],
)
def test_rock_that_the_water_does_not_lie_on_is_refused(changes, message):
    with pytest.raises(ConfigError, match=message):
        column(**changes)


def test_reduced_rock_without_mass_of_its_own_under_water_is_refused():
    """Tied to a dam with mass it shares the dam's coordinates; by itself it has no inertia."""
    scene, config = column()
    rock = scene.blocks["rock"]
    light = replace(rock, material=replace(rock.material, rho=0.0), absorbing=())
    bare = replace(scene, blocks=scene.blocks | {"rock": light}, radiating=frozenset()).without(FreeField)
    with pytest.raises(ConfigError, match=r"water.rock: block 'rock' has no mass.*model.order: full"):
        reduce_scene(bare, config.model, config.damping)
