"""The gravity dam generator: the shape asked for, its joints, and refusals with numbers."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from gravity_dams import DIVISIONS, FOUNDATION, JOINT, KOYNA, gravity_dam
from scipy.sparse.linalg import spsolve

from romdam.config import load_config
from romdam.config.sections.job import DampingConfig
from romdam.config.sections.places import GridElement
from romdam.core.errors import ConfigError
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import Assembly, assemble
from romdam.fem.gaps import gap_law, gap_operators
from romdam.fem.parts import assemble_part, unknowns
from romdam.geometry.facets import area_vectors, boundary_facets
from romdam.reduction.natural_modes import natural_modes
from romdam.scene.build import build_scene
from romdam.scene.ties import scene_parts

ROOT = Path(__file__).parents[2]
SLOPED = {"upstream": [[-10, -4], [30, 0], [100, 1]], "downstream": [[-10, 80], [60, 20], [90, 9], [100, 9]]}
GALLERY = {"floor": 12.0, "height": 3.0, "upstream": 5.0, "width": 2.5}
FIXED = {"rock": None, "joints": {"base": "tied", "contraction": JOINT, "lift": JOINT}}


def section(config, base):
    """Polygon (n, 2) of the profile above an elevation: up the upstream face, down the downstream one."""

    def face(points):
        points = np.array(points, dtype=float)
        z = np.unique([base, *points[points[:, 0] > base, 0]])
        return np.column_stack([np.interp(z, points[:, 0], points[:, 1]), z])

    return np.vstack([face(config["upstream"]), face(config["downstream"])[::-1]])


def area_and_centroid(polygon):
    """By the shoelace formula."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = cross.sum() / 2
    return abs(area), (cross[:, None] * (a + b)).sum(axis=0) / 6 / area


def volume_and_centroid(block):
    """By the mass matrix of the block."""
    M = assemble(block)[1] / block.material.rho
    unit = np.tile([1.0, 0.0, 0.0], len(block.points))
    volume = unit @ (M @ unit)
    first = [unit @ (M @ np.kron(block.points[:, axis], [1.0, 0.0, 0.0])) for axis in range(3)]
    return volume, np.array(first) / volume


@pytest.mark.parametrize("profile", [KOYNA, SLOPED])
@pytest.mark.parametrize("element", get_args(GridElement))
def test_volume_and_centroid_are_those_of_the_polygon(make, element, profile):
    scene = make(gravity_dam(element=element, **profile, **FIXED))
    for k, base in enumerate((20.0, 0.0, 10.0)):
        area, centroid = area_and_centroid(section(profile, base))
        volume, middle = volume_and_centroid(scene.blocks[f"monolith_{k + 1}"])
        assert volume == pytest.approx(16.0 * area, rel=1e-12)
        assert middle == pytest.approx([16.0 * k + 8.0, *centroid], rel=1e-12)


@pytest.mark.parametrize("element", ["hex8", "tet10"])
def test_gallery_is_cut_out_exactly(make, element):
    scene = make(gravity_dam(element=element, gallery=GALLERY, lifts=[40.0], **FIXED))
    for k, base in enumerate((20.0, 0.0, 10.0)):
        both = [scene.blocks[f"monolith_{k + 1}_{lift}"] for lift in (1, 2)]
        hole = 0.0 if k == 0 else 3.0 * 2.5
        area = area_and_centroid(section(KOYNA, base))[0] - hole
        assert sum(volume_and_centroid(block)[0] for block in both) == pytest.approx(16.0 * area, rel=1e-12)
        assert ("gallery" in both[0].faces) == (k > 0) and "gallery" not in both[1].faces
    at = scene.blocks["monolith_2_1"].points[scene.blocks["monolith_2_1"].faces["gallery"]].reshape(-1, 3)
    assert (at.min(axis=0)[1:], at.max(axis=0)[1:]) == (pytest.approx([5, 12]), pytest.approx([7.5, 15]))


def test_steps_cover_part_of_a_face_and_nothing_odd_is_said(make, caplog):
    make(gravity_dam(rock=FOUNDATION | {"left": 60, "right": 60, "banks": [40.0, 20.0]}))
    assert not caplog.text


def test_names_of_blocks_and_joints(make):
    lifts = make(gravity_dam(lifts=[15.0, 66.5], joints={"base": JOINT, "contraction": JOINT, "lift": JOINT}))
    assert list(lifts.blocks) == [
        *("monolith_1_2", "monolith_1_3", "monolith_2_1", "monolith_2_2", "monolith_2_3"),
        *("monolith_3_1", "monolith_3_2", "monolith_3_3"),
        *("rock_left", "rock_1", "rock_2", "rock_3", "rock_right"),
    ]
    pairs = {name: joint.blocks for name, joint in lifts.joints.items()}
    assert pairs == {
        "base_1": ("rock_1", "monolith_1_2"),
        "lift_1_2": ("monolith_1_2", "monolith_1_3"),
        "contraction_1_2_2": ("monolith_1_2", "monolith_2_2"),
        "contraction_1_2_3": ("monolith_1_3", "monolith_2_3"),
        "base_2": ("rock_2", "monolith_2_1"),
        "step_2_1_1": ("rock_1", "monolith_2_1"),
        "step_2_1_2": ("rock_1", "monolith_2_2"),
        "step_2_3_1": ("rock_3", "monolith_2_1"),
        "lift_2_1": ("monolith_2_1", "monolith_2_2"),
        "lift_2_2": ("monolith_2_2", "monolith_2_3"),
        "contraction_2_3_1": ("monolith_2_1", "monolith_3_1"),
        "contraction_2_3_2": ("monolith_2_2", "monolith_3_2"),
        "contraction_2_3_3": ("monolith_2_3", "monolith_3_3"),
        "base_3": ("rock_3", "monolith_3_1"),
        "lift_3_1": ("monolith_3_1", "monolith_3_2"),
        "lift_3_2": ("monolith_3_2", "monolith_3_3"),
    }
    assert [name for name in make(gravity_dam()).joints if "step" in name] == ["step_2_1", "step_2_3"]
    banks = gravity_dam(base=5.0, rock=FOUNDATION | {"left": 60, "right": 60, "banks": [40.0, 20.0]})
    assert [name for name in make(banks).joints if "step" in name] == ["step_1_left", "step_3_right"]


@pytest.mark.parametrize("element", ["hex8", "hex20", "tet4"])
def test_joints_have_the_area_of_the_faces_between(make, element):
    scene = make(gravity_dam(element=element))
    area = {z: area_and_centroid(section(KOYNA, z))[0] for z in (0.0, 10.0, 20.0)}
    width = {z: np.interp(z, [0, 66.5], [70, 19.25]) for z in area}
    expected = {
        "base_1": 16 * width[20.0],
        "base_2": 16 * width[0.0],
        "base_3": 16 * width[10.0],
        "contraction_1_2": area[20.0],
        "contraction_2_3": area[10.0],
        "step_2_1": area[0.0] - area[20.0],
        "step_2_3": area[0.0] - area[10.0],
    }
    for name, joint in scene.joints.items():
        assert joint.whole_area.sum() == pytest.approx(expected[name], rel=1e-12), name
        axis = 2 if name.startswith("base") else 0
        assert np.abs(joint.axes[:, 0, axis]) == pytest.approx(1.0)
        assert (joint.axes[:, 0, 2] > 0.5).all() == (axis == 2)  # from the rock upwards


def test_every_facet_outside_has_one_name(make):
    scene = make(gravity_dam(gallery=GALLERY, lifts=[40.0], joints=FIXED["joints"] | {"base": JOINT}))
    for name, block in scene.blocks.items():
        facets = np.sort(boundary_facets(block.cells, block.element), axis=1)
        named = np.sort(np.vstack(list(block.faces.values())), axis=1)
        assert len(np.unique(named, axis=0)) == len(named)
        if name.startswith("monolith"):
            assert len(named) == len(facets)
            out = area_vectors(block.points, block.faces["upstream"]).sum(axis=(0, 1))
            assert out[1] < 0 and abs(out[[0, 2]]).max() < 1e-9
        else:
            assert {"base", "side_upstream", "side_downstream"} <= set(block.faces)
            up = area_vectors(block.points, block.faces["surface"]).sum(axis=(0, 1))
            assert up[2] > 0
    assert "side_left" in scene.blocks["rock_left"].faces
    assert "side_right" in scene.blocks["rock_right"].faces
    assert {"base", "top"} <= set(scene.blocks["monolith_2_1"].faces)
    assert {"bottom", "crest"} <= set(scene.blocks["monolith_2_2"].faces)


@pytest.mark.parametrize("element", ["hex8", "hex27", "tet10"])
def test_linear_displacement_passes_through_joints_that_are_tied(make, element):
    """Patch test: u = A x strains everything alike, so that free inner nodes are in equilibrium."""
    kinds = dict.fromkeys(("base", "contraction", "lift"), "tied")
    raw = gravity_dam(element=element, gallery=GALLERY, lifts=[40.0], joints=kinds)
    raw["materials"]["rock"] = raw["materials"]["concrete"]
    scene = make(raw)
    assert not scene.joints
    (part,) = scene_parts(scene).values()
    mesh = part.mesh(scene.blocks)
    K = assemble_part(part, Assembly(scene.blocks))[0]
    u = mesh.points @ np.array([[1.0, 0.3, -0.2], [0.1, -0.5, 0.4], [0.2, 0.6, 0.8]]).T
    force = (K @ u.ravel()).reshape(-1, 3)
    inner = np.setdiff1d(np.arange(part.nodes), np.unique(boundary_facets(mesh.cells, mesh.element)))
    assert len(inner) > 20
    assert np.abs(force[inner]).max() < 1e-12 * np.abs(force).max()


def test_uniform_pressure_passes_through_the_joints(make):
    """Bonded by springs, a column pressed on its crest sinks by p h / E, and p / K_n in base and lift."""
    straight = {"upstream": [[0, 0], [50, 0]], "downstream": [[0, 20], [50, 20]]}
    kinds = {"base": JOINT, "contraction": JOINT, "lift": JOINT}
    stiff = FOUNDATION | {"depth": 10, "upstream": 5, "downstream": 5}
    raw = gravity_dam(**straight, base=0, monoliths=[8, 8], lifts=[20.0], joints=kinds, rock=stiff)
    raw["materials"]["concrete"] = {"E": 30e9, "nu": 0.0, "rho": 2400.0}
    raw["materials"]["rock"] = {"E": 1e14, "nu": 0.0, "rho": 2400.0}
    scene = make(raw)
    K, law, numbered = assemble_full(scene, DampingConfig()).K, gap_law(scene), unknowns(scene)
    B = sum(operator @ numbered.of_block[name] for name, operator in gap_operators(scene, 3).items())
    K = K + B.T @ (B.multiply(np.column_stack([law.K_n, law.K_s, law.K_s]).reshape(-1, 1)))
    force = np.zeros(K.shape[0])
    for k in (1, 2):
        block = scene.blocks[f"monolith_{k}_2"]
        nodal = np.zeros_like(block.points)
        np.add.at(nodal, block.faces["crest"], -1e6 * area_vectors(block.points, block.faces["crest"]))
        force += numbered.of_block[block.name].T @ nodal.ravel()
    u = spsolve(K.tocsc(), force)
    block = scene.blocks["monolith_1_2"]
    sunk = (numbered.of_block[block.name] @ u).reshape(-1, 3)[np.unique(block.faces["crest"]), 2]
    assert sunk == pytest.approx(-1e6 * (50 / 30e9 + 2 / 20e9), rel=1e-4)  # the rock: 5e-5


def test_frequencies_of_a_monolith_on_a_fixed_base(make):
    """Koyna's section, plane stress: rad/s of Abaqus' "Seismic analysis of a concrete gravity dam"."""
    divisions = {"along": 1, "through": 8, "up": 20}
    raw = gravity_dam(monoliths=[1.0], base=0, divisions=divisions, element="hex20", **FIXED)
    modes = natural_modes(make(raw), DampingConfig(), 40)
    plane = modes.freq[(modes.motion[:, 0] < 0.01)][:4] * 2 * np.pi
    assert plane == pytest.approx([18.86, 49.97, 68.16, 98.27], rel=0.01)


def test_frequencies_of_open_monoliths_are_those_of_another_mesh_and_code(make):
    """Three monoliths on fixed bases: quadrilaterals extruded by gmsh, OpenSees 3.7.1 (stdBrick) [Hz]."""
    opensees = [1.3529, 1.6002, 1.9320, 3.1387, 3.3447, 3.5985, 5.5959, 6.743]
    raw = gravity_dam(divisions={"along": 2, "through": 5, "up": 12}, **FIXED)
    raw["materials"]["concrete"]["E"] = 31e9
    freq = natural_modes(make(raw), DampingConfig(), 8).freq
    assert freq == pytest.approx(opensees, rel=0.03)
    assert freq[3:6] == pytest.approx(opensees[3:6], rel=0.01)  # in the plane, where both meshes are fine


def test_koyna_is_five_monoliths_on_rock():
    job = load_config(ROOT / "configs" / "koyna.yaml")
    scene = build_scene(job.config, job.folder, "koyna.yaml")
    assert len(scene.blocks) == 12 and len(scene.joints) == 11
    assert all(joint.mu.max() > 0.0 for joint in scene.joints.values())
    mass = sum(volume_and_centroid(scene.blocks[f"monolith_{k}"])[0] for k in range(1, 6))
    areas = [area_and_centroid(section(KOYNA, base))[0] for base in job.config.gravity_dam.bases]
    assert mass == pytest.approx(15.24 * sum(areas), rel=1e-12)
    assert all(scene.blocks[name].material.rho == 0.0 for name in scene.loads.excluded_from_gravity)


WRONG = {
    "faces": ({"downstream": [[0, 70], [102, 14]]}, "elevation 103 m for `upstream` and 102 m"),
    "order": ({"upstream": [[0, 0], [50, 1], [40, 2], [103, 0]]}, "must ascend, got 50 m then 40 m"),
    "thickness": ({"downstream": [[0, 70], [103, 0]]}, "at 103 m they stand at y = 0, 0 m"),
    "bases": ({"base": [0, 1]}, "`base` has 2 elevations, and there are 3 monoliths"),
    "deep": ({"base": -5}, "`base`: -5 m is not within 0 m, the lowest point of the faces"),
    "high": ({"base": 103}, "below the crest at 103 m"),
    "lift": ({"lifts": [120]}, "`lifts` at 120 m: 120 m is not between the lowest base, 0 m"),
    "lift kind": ({"lifts": [40]}, "`joints.lift` is missing for 1 lift joints"),
    "thin": ({"lifts": [20.1], "joints": FIXED["joints"] | {"base": JOINT}}, "0.1 m apart, limit 0.343 m"),
    "kind": ({"joints": {"base": JOINT}}, "`joints.contraction` is missing for 3 monoliths"),
    "base": ({"rock": None}, "`joints.base` joins the monoliths to `rock`, and there is none"),
    "gallery": ({"gallery": GALLERY | {"upstream": 14.0}}, "at 103 m they stand at y = 0, 14, 16.5, 14.8 m"),
    "floor": ({"gallery": GALLERY | {"floor": 8.0}}, "a base at 10 m leaves no concrete below its floor"),
    "banks": ({"rock": FOUNDATION | {"banks": [30, 30]}}, "`left` is 0 m, `right` 0 m wide"),
    "bank": ({"rock": FOUNDATION | {"left": 9, "right": 9, "banks": [-3, 30]}}, "`rock.banks`: -3 m is not"),
    "growth": (
        {"divisions": DIVISIONS | {"depth": 12, "growth": 5.0}},
        "12 layers that grow by 5 make the first one",
    ),
    "material": ({"material": "steel"}, "gravity_dam.material: no 'steel' is defined"),
}


@pytest.mark.parametrize("keys", WRONG.values(), ids=WRONG)
def test_wrong_input_is_refused_with_numbers(make, keys):
    with pytest.raises(ConfigError, match="gravity_dam") as error:
        make(gravity_dam(**keys[0]))
    assert keys[1] in str(error.value)


def test_a_scene_has_one_dam(make):
    from arch_dams import arch_dam

    with pytest.raises(ConfigError, match="a scene has one dam, and arch_dam is given too"):
        make(arch_dam() | {k: v for k, v in gravity_dam().items() if k != "materials"})


def test_without_rock_the_bases_are_held(make):
    scene = make(gravity_dam(**FIXED))
    for name, block in scene.blocks.items():
        held = np.flatnonzero(scene.fixed[name].all(axis=1))
        assert np.array_equal(held, np.unique(block.faces["base"]))


def test_rock_has_settled_unless_told(make):
    raw = gravity_dam() | {"loads": {"gravity": [0, 0, -9.81]}}
    assert make(raw).loads.excluded_from_gravity == {f"rock_{k}" for k in ("left", "1", "2", "3", "right")}
    raw["gravity_dam"]["rock"] = raw["gravity_dam"]["rock"] | {"weight": True, "mass": True}
    assert not make(raw).loads.excluded_from_gravity
