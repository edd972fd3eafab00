"""The ring around edges of infinite stress: found where it must be, and what it is for."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from romdam.config import parse_config
from romdam.fem.assembly import assemble
from romdam.fem.loads import static_force
from romdam.fem.stress import stress_operator
from romdam.postprocess.stress.faces import area_percentiles
from romdam.postprocess.stress.summary import StressHistory, summarise
from romdam.scene.build import build_scene
from romdam.scene.stress.ring import near_edges, singular_edges

CONCRETE = {"E": "30 GPa", "nu": 0.2, "rho": 2400}


def scene_of(boxes, links=None, stress=None, loads=None, held=("a",)):
    raw = {
        "materials": {"c": CONCRETE, "rock": CONCRETE | {"E": "10 GPa"}},
        "blocks": {
            name: {"material": material, "box": {"origin": origin, "size": size, **mesh}}
            for name, (material, origin, size, mesh) in boxes.items()
        },
        "supports": [{"block": name, "face": "zmin"} for name in held],
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 5},
        "transient": {"finest_step": 0.01},
        "loads": loads or {},
        "outputs": {"stress": stress} if stress else {},
        **(links or {}),
    }
    return build_scene(parse_config(raw, "s.yaml"), Path("."), "s.yaml")


MESH = {"element_size": 1.0, "element": "hex8"}


def edges_of(scene):
    """Middles of the singular edges, rounded, as a set."""
    links = (*scene.joints.values(), *scene.ties)
    ends, depth = singular_edges(scene.blocks, links, scene.fixed)
    np.testing.assert_allclose(depth, 1.0, rtol=1e-12)
    return {tuple(one) for one in ends.mean(axis=1).round(9)}


def rim(x, y, z):
    """Middles of the edges of 1 m around a rectangle at a height."""
    along_x = {(i + 0.5, float(j), z) for i in range(x) for j in (0, y)}
    return along_x | {(float(i), j + 0.5, z) for i in (0, x) for j in range(y)}


def test_foot_of_a_clamped_box_is_all_there_is():
    assert edges_of(scene_of({"a": ("c", [0, 0, 0], [2, 2, 3], MESH)})) == rim(2, 2, 0.0)


@pytest.mark.parametrize("link", ["ties", "joints"])
def test_flush_blocks_continue_each_other(link):
    boxes = {"a": ("c", [0, 0, 0], [2, 1, 3], MESH), "b": ("c", [0, 1, 0], [2, 1, 3], MESH)}
    kinds = {
        "ties": {"ties": {"t": {"between": ["a", "b"]}}},
        "joints": {"joints": {"t": {"between": ["a", "b"], "normal_stiffness": "1 GPa/m"}}},
    }
    assert edges_of(scene_of(boxes, kinds[link], held=("a", "b"))) == rim(2, 2, 0.0)


def test_inner_corner_of_an_L_and_another_material_count():
    tie = {"ties": {"t": {"between": ["a", "b"]}}}
    low, high = ("c", [0, 0, 0], [3, 1, 1], MESH), ("c", [0, 0, 1], [1, 1, 2], MESH)
    foot = rim(3, 1, 0.0)
    assert edges_of(scene_of({"a": low, "b": high}, tie)) - foot == {(1.0, 0.5, 1.0)}
    rock = ("rock", *low[1:])
    assert edges_of(scene_of({"a": rock, "b": high}, tie)) - foot == rim(1, 1, 1.0)


def test_distance_is_from_the_segment():
    ends, radius = np.array([[[0.0, 0, 0], [2.0, 0, 0]]]), np.array([0.5])
    points = np.array([[1.0, 0.5, 0], [1.0, 0.51, 0], [-0.5, 0, 0], [2.4, 0.4, 0], [2.3, 0.3, 0.2]])
    assert near_edges(points, ends, radius).tolist() == [True, False, True, False, True]


def test_nodes_of_contact_faces_are_left_out():
    boxes = {"a": ("c", [0, 0, 0], [2, 2, 3], MESH), "b": ("c", [0, 2, 0], [2, 2, 3], MESH)}
    joint = {"joints": {"t": {"between": ["a", "b"], "normal_stiffness": "1 GPa/m"}}}
    for contacts, limit in ((0.0, 2.0), (1.0, 1.0)):
        stress = {"blocks": ["a"], "ring": {"edges": "0 m", "contacts": contacts}}
        scene = scene_of(boxes, joint, stress, held=("a", "b"))
        points = scene.blocks["a"].points
        np.testing.assert_array_equal(
            scene.stress.blocks["a"].ring & (points[:, 2] > 0.0),
            (points[:, 1] >= limit) & (points[:, 2] > 0.0),
        )


@pytest.mark.parametrize("size", [1.0, 0.5])  # of the second block: nodes that coincide, and mortar
def test_contact_nodes_that_the_foot_holds_are_contact_nodes(size):
    """They have no gaps. Inside the face they lie on no edge of the outline, which goes on past the joint."""
    fine = {"element_size": [size, 1.0, size], "element": "hex8"}
    boxes = {"a": ("c", [0, 0, 0], [4, 2, 3], MESH), "b": ("c", [0, 2, 0], [4, 2, 3], fine)}
    joint = {"joints": {"t": {"between": ["a", "b"], "normal_stiffness": "1 GPa/m"}}}
    scene = scene_of(boxes, joint, {"blocks": ["a", "b"], "ring": {"edges": "0 m"}}, held=("a", "b"))
    for name in boxes:
        sites, points = scene.stress.blocks[name], scene.blocks[name].points
        on = np.isclose(points[:, 1], 2.0) & (points[:, 0] > 0.0) & (points[:, 0] < 4.0)
        assert on.sum() > 6
        np.testing.assert_array_equal(sites.ring[on], True)
    ends, _ = singular_edges(scene.blocks, scene.joints.values(), scene.fixed)
    inside = (ends[..., 2] < 1e-9).all(axis=1) & (np.abs(ends[..., 1] - 2.0) < 1e-9).all(axis=1)
    assert not inside.any()  # where the joint's face ends at the foot nothing is free


def test_apex_of_a_free_triangle_above_the_foot_is_no_contact():
    """Two corners of it are held and one has a gap, but it does not face the joint."""
    mesh = {"element_size": 1.0, "element": "tet4"}
    boxes = {"a": ("c", [0, 0, 0], [2, 2, 3], mesh), "b": ("c", [0, 2, 0], [2, 2, 3], mesh)}
    joint = {"joints": {"t": {"between": ["a", "b"], "normal_stiffness": "1 GPa/m"}}}
    scene = scene_of(boxes, joint, {"blocks": ["a", "b"], "ring": {"edges": "0 m"}}, held=("a", "b"))
    for name in boxes:
        points, ring = scene.blocks[name].points, scene.stress.blocks[name].ring
        foot_edge = np.isclose(points[:, 2], 0.0) & (np.abs(points[:, :2] - [1.0, 2.0]) > 0.99).any(axis=1)
        off = (np.abs(points[:, 1] - 2.0) > 1e-9) & ~foot_edge
        np.testing.assert_array_equal(ring[off], False)


@pytest.mark.parametrize(("edges", "warned"), [(1.0, False), (2.0, True)])
def test_a_face_that_is_mostly_ring_is_told(caplog, edges, warned):
    """3 m high: the lowest row of nodes has a sixth of the area, each of the next two a third."""
    stress = {"faces": [{"block": "a", "face": "xmin"}], "ring": {"edges": edges}, "strength": "3 MPa"}
    scene = scene_of({"a": ("c", [0, 0, 0], [2, 2, 3], MESH)}, None, stress)
    assert scene.stress.ring_shares == pytest.approx([{1.0: 1 / 2, 2.0: 5 / 6}[edges]])
    assert ("50 % of the area of a.xmin (83.3 %)" in caplog.text) == warned


def pressed(elements):
    """Largest vertical stress of a cantilever of 1 x 4 m under 1 Pa: anywhere, and outside a ring of 1 m."""
    mesh = {"element_size": [1.0 / elements, 0.25, 1.0 / elements], "element": "hex20"}
    face = {"block": "a", "face": "xmin"}
    stress = {"faces": [face], "ring": {"edges": "1 m"}, "strength": "1 MPa"}
    loads = {"pressure": [{**face, "value": 1.0}]}
    scene = scene_of({"a": ("c", [0, 0, 0], [1, 0.25, 4], mesh)}, None, stress, loads)
    block, free = scene.blocks["a"], ~scene.fixed["a"].ravel()
    u = np.zeros(free.size)
    K, _ = assemble(block)
    u[free] = spsolve(K[free][:, free].tocsc(), static_force(scene, "a").ravel()[free])
    sites = scene.stress.blocks["a"]
    history = StressHistory.observed(
        (stress_operator(block, sites.nodes) @ u)[None], {"a": len(sites.nodes)}, {}
    )
    largest = summarise(scene.stress, history, np.zeros(1)).largest["vertical"]
    (face,) = scene.stress.faces
    counted = sites.counted[face.rows]
    headline = area_percentiles(largest[face.rows][counted], face.area[counted], np.array([98.0, 100.0]))
    return largest.max(), headline


def test_headline_converges_where_the_largest_value_does_not():
    """Timoshenko & Goodier, section 22: 3 p (4 - z)^2 / 1^2 - p / 5 on the faces, 27 Pa at z = 1 m."""
    raw, headline = zip(*(pressed(elements) for elements in (2, 4, 8)), strict=True)
    assert raw[1] - raw[0] > 2.0 and raw[2] - raw[1] > 2.0  # the same again with every halving
    assert raw[-1] > 1.15 * 48.0  # the beam's at the foot
    largest = np.array([one[1] for one in headline])
    lowest = 1.0 + 0.5 / np.array([2, 4, 8])  # row of nodes outside the ring, which z = 1 m belongs to
    error = np.abs(largest / (3.0 * (4.0 - lowest) ** 2 - 0.2) - 1.0)
    print(raw, headline, error)
    assert error[-1] < 5e-4 and (error[1:] < 0.5 * error[:-1]).all()
