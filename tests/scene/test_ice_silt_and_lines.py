"""Ice, silt and lines of force by hand: sums and moments, on every element and on faces that lean."""

import numpy as np
import pytest
from gravity_dams import gravity_dam
from scene_builders import box

from romdam import load_config
from romdam.config import parse_config
from romdam.core.errors import ConfigError
from romdam.fem.loads import surface_forces
from romdam.scene.build import build_scene

ELEMENTS = ("hex8", "hex20", "hex27", "tet4", "tet10")
WALL = {"block": "wall", "face": "ymin"}
G = 9.7
OTHERS = {
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}


def wall(element, **loads):
    """8 m long, 2 m thick and 12 m high; rows of 1.5 m, which no level of these tests meets."""
    return {
        "blocks": {"wall": box([0, 0, 0], [8, 2, 12], [4.0, 1.0, 1.5], element)},
        "supports": [{"block": "wall", "face": "zmin"}],
        "loads": {"gravity": [0, 0, -G]} | loads,
    }


def acting(scene, block="wall"):
    """Sum (3,) of the forces on a block and moment (3,) about the origin."""
    (kind, force), *none = surface_forces(scene, block).items()
    assert kind == "forces" and not none
    return force.sum(axis=0), np.cross(scene.blocks[block].points, force).sum(axis=0)


@pytest.mark.parametrize("element", ELEMENTS)
def test_ice_pushes_along_its_thickness(make, element):
    """150 kN/m over 8 m, from 9.9 to 10.7 m; it is one force at 10.3 m."""
    ice = {"level": "10.7 m", "thickness": "80 cm", "thrust": "150 kN/m", "faces": [WALL]}
    force, moment = acting(make(wall(element, ice=[ice])))
    assert force == pytest.approx([0.0, 1.2e6, 0.0], rel=1e-9, abs=1e-3)
    assert moment == pytest.approx([-1.2e6 * 10.3, 0.0, 1.2e6 * 4.0], rel=1e-9, abs=1e-2)


def test_a_wall_that_faces_another_way_is_pressed_as_much(make):
    """The side of 2 m length, which faces +x."""
    faces = [{"block": "wall", "face": "xmax"}]
    silt = {"level": 7.3, "density": 900.0, "pressure_ratio": 0.45, "faces": faces}
    force, _ = acting(make(wall("hex8", silt=[silt])))
    assert force == pytest.approx([-0.45 * 900.0 * G * 7.3**2 / 2.0 * 2.0, 0.0, 0.0], rel=1e-9, abs=1e-3)
    ice = {"level": "10.7 m", "thickness": "80 cm", "thrust": "150 kN/m", "faces": faces}
    force, _ = acting(make(wall("hex8", ice=[ice])))
    assert force == pytest.approx([-150e3 * 2.0, 0.0, 0.0], rel=1e-9, abs=1e-3)


@pytest.mark.parametrize("element", ELEMENTS)
def test_silt_presses_by_its_weight_under_water(make, element):
    """gamma 900 x 9.7 N/m3, K 0.45, 7.3 m deep before a wall of 8 m: K gamma h2 / 2, at a third of h."""
    silt = {"level": 7.3, "density": 900.0, "pressure_ratio": 0.45, "faces": [WALL]}
    force, moment = acting(make(wall(element, silt=[silt])))
    thrust = 0.45 * 900.0 * G * 7.3**2 / 2.0 * 8.0
    assert force == pytest.approx([0.0, thrust, 0.0], rel=1e-9, abs=1e-3)
    assert moment == pytest.approx([-thrust * 7.3 / 3.0, 0.0, thrust * 4.0], rel=1e-9, abs=1e-2)


def test_on_a_face_that_leans_silt_stands_and_ice_pushes_level(make):
    """Before the second monolith's downstream face, 16 m long, of slope (70 - 19.25) / 66.5; level 31 m.

    Water of the job has no part in it: its weight is that of `loads.gravity`.
    """
    slope, depth = (70.0 - 19.25) / 66.5, 31.0
    faces = [{"block": "monolith_2", "face": "downstream"}]
    silt = {"level": depth, "density": 800.0, "pressure_ratio": 0.6, "faces": faces}
    scene = make(gravity_dam() | {"loads": {"gravity": [0, 0, -G], "silt": [silt]}})
    force, _ = acting(scene, "monolith_2")
    above = 800.0 * G * depth**2 / 2.0 * 16.0
    assert force == pytest.approx([0.0, -0.6 * above, -slope * above], rel=1e-9, abs=1e-2)
    ice = {"level": depth, "thickness": 0.5, "thrust": 2e5, "faces": faces}
    scene = make(gravity_dam() | {"loads": {"gravity": [0, 0, -G], "ice": [ice]}})
    force, moment = acting(scene, "monolith_2")
    assert force == pytest.approx([0.0, -2e5 * 16.0, 0.0], rel=1e-9, abs=1e-2)
    assert moment[0] == pytest.approx(2e5 * 16.0 * (depth - 0.25), rel=1e-9)


def test_faces_by_a_pattern_are_loaded_each(tmp_path):
    """Before the upstream faces of three monoliths of 16 m, whatever their bases."""
    ice = {"level": 95, "thickness": 1, "thrust": 1e5, "faces": [{"block": "monolith_*", "face": "upstream"}]}
    raw = gravity_dam() | OTHERS | {"loads": {"ice": [ice]}}
    job = load_config(raw, tmp_path)
    scene = build_scene(job.config, tmp_path, "s.yaml")
    for name in ("monolith_1", "monolith_2", "monolith_3"):
        assert acting(scene, name)[0] == pytest.approx([0.0, 16e5, 0.0], rel=1e-9, abs=1e-2)


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_line_has_its_sum_and_its_moment(make, element):
    """5 m along the crest, aslant and over no node: 12 kN down and 3 kN across for each metre."""
    line = {
        "block": "wall",
        "start": [1.3, 0.4, 12.0],
        "end": [5.3, 1.6, 9.25],
        "force": [0, 3e3, "-12 kN/m"],
    }
    force, moment = acting(make(wall(element, line=[line])))
    length = np.sqrt(4.0**2 + 1.2**2 + 2.75**2)
    wanted = length * np.array([0.0, 3e3, -12e3])
    assert force == pytest.approx(wanted, rel=1e-9, abs=1e-6)
    assert moment == pytest.approx(np.cross([3.3, 1.0, 10.625], wanted), rel=1e-9)


def test_units_of_feet_are_those_of_metres():
    line = {"block": "wall", "start": [0, 0, 12], "end": [8, 0, 12], "force": [0, 0, "-1 kip/ft"]}
    raw = wall("hex8", line=[line]) | {"materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400.0}}}
    config = parse_config(raw | OTHERS, "s.yaml")
    assert config.loads.line[0].force[2] == pytest.approx(-4448.2216 / 0.3048, rel=1e-7)


def test_two_loads_on_a_node_are_no_oddity_and_forces_on_one_still_are(make):
    silt = {"level": 7.3, "density": 900.0, "pressure_ratio": 0.45, "faces": [WALL]}
    ice = {"level": 7.0, "thickness": 0.5, "thrust": 1e5, "faces": [WALL]}
    force = {"block": "wall", "at": [0, 0, 12], "force": [0, 0, -1e3]}
    scene = make(wall("hex8", silt=[silt], ice=[ice], force=[force, force]))
    said = [remark for remark in scene.remarks if "their sum acts" in remark]
    assert len(said) == 1 and said[0].startswith("loads.force[1]: its node")


@pytest.mark.parametrize(
    ("loads", "says"),
    [
        (
            {"ice": [{"level": 13, "thickness": 1, "thrust": 1e5, "faces": [WALL]}]},
            "loads.ice[0].level: the ice is above the top of its faces: 13 m, and they reach from 0 to 12 m",
        ),
        (
            {"silt": [{"level": 0, "density": 900, "pressure_ratio": 0.5, "faces": [WALL]}]},
            "loads.silt[0].level: the silt is not above the foot of its faces: 0 m",
        ),
        (
            {"silt": [{"level": 5, "density": 900, "pressure_ratio": 0.5, "faces": [WALL, WALL]}]},
            "loads.silt[0].faces[1]: 16 of 16 facets of block 'wall' are named by",
        ),
        (
            {"ice": [{"level": 5, "thickness": 1, "thrust": -1e5, "faces": [WALL]}]},
            "loads.ice[0].thrust",
        ),
        (
            {"line": [{"block": "wall", "start": [0, 0, 12], "end": [9, 0, 12], "force": [0, 0, -1e3]}]},
            "loads.line[0].end: (9, 0, 12) is outside its elements, 1 m from its nearest node, limit",
        ),
        (
            {"line": [{"block": "wall", "start": [0, 0, 12], "end": [0, 0, 12], "force": [0, 0, -1e3]}]},
            "`start` and `end` are one point; name both ends, or take loads.force",
        ),
        (
            {"line": [{"block": "wall", "start": [0, 0, 12], "end": [8, 0, 12], "force": [0, 0, 0]}]},
            "`force` must not be zero",
        ),
        (
            {"line": [{"block": "dam", "start": [0, 0, 12], "end": [8, 0, 12], "force": [0, 0, 1]}]},
            "loads.line[0].block",
        ),
        (
            {"ice": [{"level": 5, "thickness": 6, "thrust": 1e5, "faces": [WALL]}]},
            "loads.ice[0].thickness: the ice reaches below the foot of its faces",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(make, loads, says):
    with pytest.raises(ConfigError) as refused:
        make(wall("hex8", **loads))
    assert says in str(refused.value)
