"""Mortar joints of scenes: what `discretization` chooses, curved faces, faces covered in part, refusals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mortar_blocks import cube, turn
from scene_builders import box, two_boxes

import romdam
from romdam.core.errors import ConfigError, MeshError
from romdam.geometry.facets import facet_areas
from romdam.scene.build import build_scene
from romdam.scene.mortar.clearance import sagittas
from romdam.scene.mortar.gaps import mortar_gaps
from romdam.scene.mortar.interface import mortar_interface

CONFIGS = Path(__file__).parents[2] / "configs"
PLACE = "s.yaml: joints.c"


def test_auto_is_node_to_node_on_linear_faces_whose_nodes_coincide(make, caplog):
    caplog.set_level("INFO")
    joint = make(two_boxes()).joints["c"]
    assert joint.at_point is None and "mortar" not in caplog.text
    assert all(abs(side - np.eye(6)).max() == 0.0 for side in joint.weights)


@pytest.mark.parametrize("element", ["hex20", "tet10"])
def test_auto_is_mortar_on_quadratic_faces_and_says_so(make, caplog, element):
    caplog.set_level("INFO")
    joint = make(two_boxes(element)).joints["c"]
    assert joint.at_point is not None and len(joint.area) == 9
    assert "joints.c: the faces are quadratic; discretization: mortar" in caplog.text


def test_auto_is_mortar_where_meshes_do_not_match(make, caplog):
    caplog.set_level("INFO")
    raw = two_boxes()
    raw["blocks"]["right"]["box"]["element_size"] = 0.5
    joint = make(raw).joints["c"]
    assert "the nodes of the two faces do not coincide; discretization: mortar" in caplog.text
    assert (
        "mortar, 25 gaps at the corners of 'right' against 'left' over 4 m2, at most 0 m apart" in caplog.text
    )
    assert len(joint.area) == 20, "the held row has no gaps"
    assert joint.whole_area.sum() == pytest.approx(4.0, rel=1e-13)


def test_mortar_on_matching_linear_faces_is_node_to_node(make):
    one, two = (make(two_boxes(discretization=each)).joints["c"] for each in ("mortar", "node_to_node"))
    assert np.array_equal(one.position, two.position) and one.at_point is None
    np.testing.assert_allclose(one.K_n, two.K_n, rtol=1e-13)
    for a, b in zip(one.weights, two.weights, strict=True):
        assert abs(a - b).max() < 1e-13


def test_gaps_corners_is_node_to_node(make):
    assert len(make(two_boxes("tet10", gaps="corners")).joints["c"].area) == 9
    with pytest.raises(ConfigError, match=r"joints.c: `gaps: corners` is for discretization: node_to_node"):
        make(two_boxes("tet10", gaps="corners", discretization="mortar"))


def test_opening_where_nodes_are_one_is_zero(make):
    """Corners tied to the same rock: whatever moves, the jump at the very position is none."""
    raw = two_boxes("tet10")
    raw["blocks"]["rock"] = box([0, 0, -2], [2, 4, 2], element="tet10")
    raw["supports"] = [{"block": "rock", "face": "zmin"}]
    raw["ties"] = {b: {"between": [b, "rock"]} for b in ("left", "right")}
    scene = make(raw)
    joint = scene.joints["c"]
    low = np.flatnonzero(joint.position[:, 2] == 0.0)
    moved = np.random.default_rng(2).normal(size=(len(scene.blocks["rock"].points), 3))
    seen = {}
    for tie in scene.ties:
        name = next(b for b in tie.blocks if b != "rock")
        k = tie.blocks.index(name)
        u = np.random.default_rng(3).normal(size=(len(scene.blocks[name].points), 3))
        u[tie.nodes[k]] = moved[tie.nodes[1 - k]]
        seen[name] = u
    at = [w @ seen[b][n] for w, b, n in zip(joint.at_point, joint.blocks, joint.nodes, strict=True)]
    assert len(low) == 3 and np.abs((at[1] - at[0])[low]).max() < 1e-15
    assert np.abs(at[1] - at[0]).max() > 0.1


@pytest.mark.parametrize(("left", "right"), [("hex8", "hex8"), ("hex20", "hex20"), ("tet10", "tet10")])
def test_a_curved_face_has_its_own_area_and_moves_as_one(left, right):
    """Cylinder of radius 20 m, elements of 4 and 3 m: the faces are up to 0.1 m apart where linear."""
    blocks = [_bent(cube("left", left, 3, 0.0)), _bent(cube("right", right, 4, 12.0))]
    interface = mortar_interface(*blocks, 1e-3, 0.5, PLACE)
    gaps = mortar_gaps(interface)
    slave = blocks[1] if interface.slave_is_J else blocks[0]
    face = slave.faces["ymin" if interface.slave_is_J else "ymax"]
    assert gaps.area.sum() == pytest.approx(facet_areas(slave.points, face).sum(), rel=1e-12)
    assert all(abs(w.sum(axis=1) - 1.0).max() < 1e-12 for w in gaps.weights)
    assert interface.apart < {"hex8": 0.12, "hex20": 0.05, "tet10": 0.03}[left], "of the flat pieces"
    exact = 12.0 * 20.0 * (12.0 / 20.0)
    assert gaps.area.sum() == pytest.approx(exact, rel={"hex8": 4e-3, "hex20": 2e-6, "tet10": 2e-5}[left])


def _bent(block, out=0.0):
    x, y, z = (block.points @ turn()).T
    angle, radius = x / 20.0, 20.0 + out + (y - 12.0)
    return replace(block, points=np.column_stack([radius * np.sin(angle), radius * np.cos(angle), z]))


def test_a_master_that_ends_within_a_facet_leaves_no_gap_outside(make):
    """The joint is 1.3 m high, the elements 1 m: the shares of the corners at 2 m go to those at 1 m."""
    raw = two_boxes()
    raw["blocks"]["right"] = box([0, 2, 0], [2, 2, 1.3], [1.0, 1.0, 1.3])
    raw["blocks"]["left"]["box"]["element_size"] = 0.5
    joint = make(raw).joints["c"]
    assert joint.whole_area.sum() == pytest.approx(2.6, rel=1e-12)
    assert joint.position[:, 2].max() <= 1.3 and joint.area.min() > 0.0


def test_faces_apart_are_refused(make):
    raw = two_boxes(discretization="mortar")
    raw["blocks"]["right"]["box"]["origin"] = [0, 2.5, 0]
    with pytest.raises(ConfigError, match=r"joints.c: blocks 'left' and 'right' do not touch: .* is 0.5 m"):
        make(raw)


@pytest.mark.parametrize("y", [2.1, 1.9, 2.002, 1.998])
@pytest.mark.parametrize("key", ["joints", "ties"])
@pytest.mark.parametrize("element", ["hex8", "hex20", "tet10"])
def test_a_clearance_between_flat_faces_is_refused(make, y, key, element):
    """Nodes opposite each other, and farther apart than the tolerance of 1 mm: no mesh of one face is."""
    raw = two_boxes(element)
    raw["blocks"]["right"]["box"]["origin"] = [0, y, 0]
    raw[key] = {"c": {"between": ["left", "right"]} | ({"normal_stiffness": 1e9} if key == "joints" else {})}
    if key == "ties":
        del raw["joints"]
    how, apart = "apart" if y > 2.0 else "inside each other", f"{abs(y - 2.0):.4g}"
    said = rf"{key}.c: .* {apart} m {how} on average and {apart} m at .* limit 0.001 m \({key}.c.tolerance\)"
    with pytest.raises(MeshError, match=said):
        make(raw)
    raw[key]["c"]["tolerance"] = 0.2
    scene = make(raw)
    assert len(scene.joints) + len(scene.ties) == 1


def test_two_cantilevers_with_air_between_them_are_refused():
    job = romdam.load_config(CONFIGS / "two_cantilevers.yaml").to_dict()
    job["blocks"]["right"]["box"]["origin"] = [0.0, 0.3, 0.0]
    del job["outputs"]["nodes"]  # which were there before
    job = romdam.load_config(job, folder=CONFIGS)
    with pytest.raises(MeshError, match=r"0\.3 m apart on average and 0\.3 m at"):
        build_scene(job.config, CONFIGS, "dam.yaml")


@pytest.mark.parametrize(("left", "right"), [("hex8", "hex8"), ("hex20", "hex20"), ("tet10", "tet10")])
@pytest.mark.parametrize("clearance", [0.15, -0.15])
def test_a_clearance_between_curved_faces_is_more_than_their_curvature(left, right, clearance):
    """Cylinder of radius 20 m, elements of 4 and 3 m: sagittas of 0.1 and 0.056 m, of halves a quarter."""
    blocks = [_bent(cube("left", left, 3, 0.0)), _bent(cube("right", right, 4, 12.0), clearance)]
    with pytest.raises(MeshError, match=r"limit 0\.001 m .* and 0\.[01]\d* m for the curvature"):
        mortar_interface(*blocks, 1e-3, 0.5, PLACE)


def test_what_curvature_allows_is_the_sagitta():
    """h^2 / 8R of both faces on a cylinder, nothing on a plane; the mean distance is within two thirds."""
    blocks = [_bent(cube("left", "hex8", 3, 0.0)), _bent(cube("right", "hex8", 4, 12.0))]
    interface = mortar_interface(*blocks, 1e-3, 0.5, PLACE)
    chords = [40.0 * np.sin(0.3 / n) for n in (3, 4)]
    found = sagittas(interface.slave, interface.master, interface.segments)
    assert found == pytest.approx(sum(h**2 for h in chords) / 160.0, rel=0.02)
    area = interface.segments.area / interface.segments.area.sum()
    assert 0.02 < area @ interface.segments.distance < 2.0 / 3.0 * area @ found


def test_too_little_overlap_is_refused_with_the_areas(make):
    raw = two_boxes()
    raw["blocks"]["right"] = box([1.7, 2, 0], [2, 2, 2])
    with pytest.raises(ConfigError, match=r"each other over 0.6 m2 .* 0.3 of 2 m2 .* limit 0.5 of one"):
        make(raw)
    raw["joints"]["c"]["overlap"] = 0.2
    assert make(raw).joints["c"].whole_area.sum() == pytest.approx(0.6, rel=1e-12)


def test_steep_faces_are_refused_with_the_angle(make):
    blocks = dict(make(two_boxes()).blocks)
    left, right = blocks["left"], blocks["right"]
    slanted = right.points + np.outer(right.points[:, 2] * (right.points[:, 1] == 2.0), [0.0, 0.8, 0.0])
    with pytest.raises(ConfigError, match=r"stand at 38.7 degrees to each other at \(.* than 30 over 1 of"):
        mortar_interface(left, replace(right, points=slanted), 2.0, 0.5, PLACE)


@pytest.mark.parametrize(
    ("element", "across", "own", "share"),
    [
        ("hex8", 1, {}, "3.00"),
        ("hex8", 2, {}, "1.50"),
        ("tet10", 1, {}, "3.00"),
        ("tet10", 1, {"discretization": "node_to_node"}, "0.67"),
        ("tet10", 4, {}, None),
    ],
)
def test_stiffness_against_rotation_is_said_where_it_is_off(make, caplog, element, across, own, share):
    """Gaps at corners, n elements across: 1 + 2/n^2 times the second moment of the face."""
    caplog.set_level("INFO")
    raw = two_boxes(element, **own)
    for block in raw["blocks"].values():
        block["box"] |= {"size": [2, 2, 6], "element_size": [2.0 / across, 1.0, 0.5]}
    for support in raw["supports"]:
        support["face"] = "ymin" if support["block"] == "left" else "ymax"
    make(raw)
    said = f"joints.c: closed, the gaps have {share} times the stiffness of their bedding against rotation"
    assert said in caplog.text if share else "against rotation" not in caplog.text
