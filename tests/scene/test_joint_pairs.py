"""Joints: pairs, axes, stiffness, initial gaps, dropped gaps, several blocks on one line."""

import dataclasses

import numpy as np
import pytest
from scene_builders import box, two_boxes

from romdam.config.sections.joints import JointConfig
from romdam.core.errors import ConfigError, MeshError
from romdam.geometry.elements import SOLIDS
from romdam.geometry.facets import boundary_facets
from romdam.scene.joints import build_joint, local_axes


def error_of(make, raw, folder=None):
    with pytest.raises((ConfigError, MeshError)) as caught:
        make(raw, folder or ".")
    return caught.value


@pytest.mark.parametrize("element", SOLIDS)
def test_area_is_that_of_the_face(element, make):
    raw = two_boxes(element)
    raw["supports"] = [{"block": b, "face": f} for b, f in (("left", "ymin"), ("right", "ymax"))]
    joint = make(raw).joints["c"]
    assert joint.area.sum() == pytest.approx(4.0, rel=1e-13)
    assert joint.area.min() > 0
    assert np.allclose(joint.axes, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12)
    assert np.abs(joint.weights[0].sum(axis=1) - 1).max() < 1e-12


@pytest.mark.parametrize("element", SOLIDS)
def test_gaps_that_supports_hold_are_dropped(element, make):
    """On linear faces the held bottom row goes; on quadratic faces its areas still see free nodes.

    The area of what goes stays the joint's.
    """
    scene = make(two_boxes(element, discretization="node_to_node"))
    joint = scene.joints["c"]
    free = ~scene.fixed["left"][joint.nodes[0]].all(axis=1)
    if not SOLIDS[element].quadratic:
        assert free.all() and len(joint.area) == 6
    else:
        gaps = {"hex20": 21, "hex27": 25, "tet10": 25, "wedge15": 21, "pyramid13": 21}
        assert len(joint.area) == gaps[element]
        assert (joint.weights[0] @ free.astype(float) > 0).all()
    assert joint.whole_area.sum() == pytest.approx(4.0, rel=1e-13)
    assert (joint.share[joint.position[:, 2] > 1.5] == 0.0).all()


def test_gaps_held_along_the_normal_alone_are_dropped(make):
    raw = two_boxes()
    raw["supports"] += [{"block": b, "face": "xmin", "fix": ["y"]} for b in ("left", "right")]
    assert len(make(raw).joints["c"].area) == 4


def test_joint_of_held_faces_is_refused(make):
    raw = two_boxes()
    raw["supports"] = [{"block": "left", "face": "ymax"}, {"block": "right", "face": "ymin"}]
    assert str(error_of(make, raw)) == (
        "s.yaml: joints.c: supports hold all 9 gaps on both sides, so the joint can do nothing; "
        "remove the joint, or free one of its faces"
    )


def test_swapping_the_blocks_mirrors_the_joint(make):
    raw = two_boxes("tet10", gap=1e-3, shear_stiffness=5e8, friction=[0.5, 0.7])
    one = make(raw).joints["c"]
    two = make(raw | {"joints": {"c": raw["joints"]["c"] | {"between": ["right", "left"]}}}).joints["c"]
    order = np.array([np.flatnonzero((two.position == x).all(axis=1))[0] for x in one.position])
    for name in ("area", "gap", "K_n", "K_s", "mu"):
        assert np.allclose(getattr(two, name)[order], getattr(one, name), rtol=1e-12)
    assert np.allclose(two.axes[order], one.axes * [[-1], [-1], [1]], atol=1e-12)
    for mirrored, weights in ((two.weights, one.weights), (two.at_point, one.at_point)):
        for a, b, nodes_a, nodes_b in zip(mirrored[::-1], weights, two.nodes[::-1], one.nodes, strict=True):
            assert np.array_equal(nodes_a, nodes_b)
            assert abs(a[order] - b).max() < 1e-12


@pytest.mark.parametrize("discretization", ["node_to_node", "mortar"])
def test_renumbering_nodes_changes_nothing(make, discretization):
    scene = make(two_boxes("hex20"))
    left = scene.blocks["left"]
    new = np.random.default_rng(5).permutation(len(left.points))
    points = np.empty_like(left.points)
    points[new] = left.points
    blocks = scene.blocks | {"left": dataclasses.replace(left, points=points, cells=new[left.cells])}
    fixed = {name: np.zeros((len(b.points), 3), dtype=bool) for name, b in blocks.items()}
    config = JointConfig(between=("left", "right"), normal_stiffness=1e9, discretization=discretization)
    one = build_joint("c", config, scene.blocks, fixed, None, "s.yaml")
    two = build_joint("c", config, blocks, fixed, None, "s.yaml")
    order = np.array([np.flatnonzero((two.position == x).all(axis=1))[0] for x in one.position])
    seen = np.argsort(two.nodes[0])[np.searchsorted(np.sort(two.nodes[0]), new[one.nodes[0]])]
    assert np.array_equal(two.nodes[0][seen], new[one.nodes[0]])
    assert np.allclose(two.area[order], one.area, rtol=1e-12)
    assert abs(two.weights[0][order][:, seen] - one.weights[0]).max() < 1e-12


def test_four_blocks_on_one_line(make):
    blocks = {"a": [0, 0, 0], "b": [2, 0, 0], "c": [2, 2, 0], "d": [0, 2, 0]}
    between = {"ab": ["a", "b"], "bc": ["b", "c"], "cd": ["c", "d"], "da": ["d", "a"]}
    scene = make(
        {
            "blocks": {name: box(at, [2, 2, 2]) for name, at in blocks.items()},
            "supports": [{"block": name, "face": "zmin"} for name in blocks],
            "joints": {n: {"between": b, "normal_stiffness": 1e9} for n, b in between.items()},
        }
    )
    for joint in scene.joints.values():
        assert joint.area.sum() == pytest.approx(3.0, rel=1e-12)  # 4 m2 less the held row
        assert (np.abs(joint.position[:, :2] - 2).min(axis=1) < 1e-12).all()
    on_line = [np.abs(j.position[:, :2] - 2).max(axis=1).min() for j in scene.joints.values()]
    assert max(on_line) < 1e-12


def test_partial_overlap_of_a_taller_block(make):
    raw = two_boxes()
    raw["blocks"]["right"]["box"]["size"] = [2, 2, 4]
    joint = make(raw).joints["c"]
    assert joint.position[:, 2].max() == 2.0
    assert joint.area.sum() == pytest.approx(3.0)


def test_local_axes_rule():
    normals = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 0, -2], [0.6, 0.8, 0]], dtype=float)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axes = local_axes(normals)
    assert np.allclose(axes @ axes.transpose(0, 2, 1), np.eye(3), atol=1e-14)
    assert np.allclose(np.linalg.det(axes), 1)
    s = np.sqrt(0.5)
    assert np.allclose(axes[:3, 2], [[0, 0, 1], [1, 0, 0], [-s, 0, s]], atol=1e-14)
    assert axes[3, 2, 0] > 0  # steep: k follows x
    assert np.allclose(axes[4, 1:], [[-0.8, 0.6, 0], [0, 0, 1]], atol=1e-14)


@pytest.mark.parametrize("element", SOLIDS)
def test_normals_of_a_curved_joint_are_radial(element, make):
    """Boxes bent into cylinder shells of radius 10 m: the node normals stay within the chord's angle."""
    raw = two_boxes(element)
    raw["supports"] = [{"block": b, "face": f} for b, f in (("left", "ymin"), ("right", "ymax"))]
    scene = make(raw)
    blocks = {}
    for name, block in scene.blocks.items():
        radius, angle = 8 + block.points[:, 1], block.points[:, 0] / 10
        bent = np.c_[radius * np.sin(angle), radius * np.cos(angle), block.points[:, 2]]
        blocks[name] = dataclasses.replace(block, points=bent)
    config = JointConfig(between=("left", "right"), normal_stiffness=1e9)
    joint = build_joint("c", config, blocks, scene.fixed, None, "s.yaml")
    radial = joint.position * [1, 1, 0]
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    half_element = 0.05  # rad: at the rim the mean is that of one facet
    assert (np.einsum("nk,nk->n", radial, joint.axes[:, 0]) > np.cos(1.01 * half_element)).all()
    inner = np.abs(joint.position[:, 0] - 10 * np.sin(0.1)) < 1e-9
    uneven = (
        0.0 if element.startswith("hex") else half_element / 2
    )  # two triangles on one side, one on the other
    assert (np.einsum("nk,nk->n", radial, joint.axes[:, 0])[inner] > np.cos(uneven) - 1e-12).all()
    assert joint.area.sum() == pytest.approx(10 * 0.2 * 2, rel=1e-3)


def test_stiffness_per_area_per_gap_and_rigid(make):
    joint = make(two_boxes(normal_stiffness="10 GPa/m", tension_stiffness={"per_gap": "3 MN/m"})).joints["c"]
    assert np.allclose(joint.K_n, 1e10 * joint.area)
    assert (joint.K_nz == 3e6).all() and (joint.K_s == 0).all()
    assert np.isinf(make(two_boxes(normal_stiffness="rigid")).joints["c"].K_n).all()
    assert (make(two_boxes(gap="-2 mm")).joints["c"].gap == -0.002).all()


def test_gap_table(make, tmp_path):
    """Linear between the corners of the face, nearest outside."""
    rows = ["x,y,z,gap"] + [f"{x},2,{z},{1e-3 * x + 2e-3 * z}" for x in (0, 2) for z in (0, 1.5)]
    (tmp_path / "gap.csv").write_text("\n".join(rows))
    joint = make(two_boxes(gap={"table": "gap.csv"}), tmp_path).joints["c"]
    inside = joint.position[:, 2] <= 1.5
    linear = 1e-3 * joint.position[:, 0] + 2e-3 * joint.position[:, 2]
    assert np.abs(joint.gap - linear)[inside].max() < 1e-8
    outside = joint.gap[~inside & (joint.position[:, 0] != 1)]
    assert outside == pytest.approx([3e-3, 5e-3])


def test_gap_table_along_a_line(make, tmp_path):
    (tmp_path / "gap.csv").write_text("x, y, z, gap\n1, 2, 0, 0.0\n1, 2, 2, 0.004\n")
    joint = make(two_boxes(gap={"table": "gap.csv"}), tmp_path).joints["c"]
    assert np.abs(joint.gap - 0.002 * joint.position[:, 2]).max() < 1e-12


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "x,y,z\n0,0,0\n",
            "gap.csv lacks column gap; its first line must be x,y,z,gap, then one point per line",
        ),
        ("x,y,z,gap\n", "gap.csv has no rows"),
        ("x,y,z,gap\n0,0,0,nan\n", "line 2: gap must be a finite number such as -1.5e3, got 'nan'"),
        ("x,y,z,gap\n0,0,0,1\n0,0,1\n", "line 3: has 3 values for 4 columns ('0,0,1')"),
        (None, "gap.csv cannot be read"),
    ],
)
def test_bad_gap_table(text, message, make, tmp_path):
    if text is not None:
        (tmp_path / "gap.csv").write_text(text)
    error = str(error_of(make, two_boxes(gap={"table": "gap.csv"}), tmp_path))
    assert error.startswith("s.yaml: joints.c.gap.table: ")
    assert message in error


def test_normal_given_and_from_nodes(make):
    joint = make(two_boxes(normal=[0, 2, 0.2])).joints["c"]
    assert np.allclose(joint.axes[:, 0], np.array([0, 1, 0.1]) / np.hypot(1, 0.1))
    raw = two_boxes(normal="nodes", tolerance=0.1)
    raw["blocks"]["right"]["box"]["origin"] = [0, 2.03, 0.04]
    raw["supports"] = raw["supports"][:1]
    raw["supports"].append({"block": "right", "face": "zmin"})
    assert np.allclose(make(raw).joints["c"].axes[:, 0], [0, 0.6, 0.8])


@pytest.mark.parametrize(
    ("normal", "message"),
    [
        ([0, -1, 0], "s.yaml: joints.c.normal must point from block 'left' to 'right', but at 9 of 9 gaps"),
        (
            "nodes",
            "s.yaml: joints.c.normal = nodes needs a distance between the nodes of a pair, but 9 of 9 pairs",
        ),
    ],
)
def test_normals_that_cannot_be(normal, message, make):
    assert str(error_of(make, two_boxes(normal=normal))).startswith(message)


def test_blocks_that_do_not_touch(make):
    raw = two_boxes()
    raw["blocks"]["right"]["box"]["origin"] = [0, 2.5, 0]
    error = error_of(make, raw)
    assert isinstance(error, ConfigError)
    assert str(error) == (
        "s.yaml: joints.c: blocks 'left' and 'right' do not touch: no facets coincide within 0.001 m; "
        "the smallest distance between their nodes is 0.5 m, from (0, 2, 0) to (0, 2.5, 0); "
        "move a block, or raise joints.c.tolerance"
    )


def test_meshes_that_do_not_conform(make):
    raw = two_boxes(discretization="node_to_node")
    raw["blocks"]["right"]["box"]["element_size"] = [1.0, 1.0, 0.5]
    error = error_of(make, raw)
    assert isinstance(error, MeshError)
    assert str(error) == (
        "s.yaml: joints.c: the meshes of 'left' and 'right' do not conform: nodes on the common face "
        "without a partner within 0.001 m: 6 of block 'right'; at (0, 2, 0.5), (1, 2, 0.5), (2, 2, 0.5), ... "
        "(within x 0..2, y 2..2, z 0.5..1.5 m); mesh both blocks with the same nodes on the common face, "
        "raise its `tolerance` if they are the same, or couple the faces by discretization: mortar"
    )


def test_shifted_meshes_do_not_conform(make):
    raw = two_boxes(discretization="node_to_node")
    raw["blocks"]["right"]["box"]["origin"] = [0.3, 2, 0]
    assert "9 of block 'left' and 9 of block 'right'" in str(error_of(make, raw))


@pytest.mark.parametrize(
    ("element", "kinds"), [("tet4", "tet4 against hex8"), ("hex20", "hex20 against hex8")]
)
def test_different_elements_do_not_conform(element, kinds, make):
    raw = two_boxes(discretization="node_to_node")
    raw["blocks"]["left"]["box"]["element"] = element
    error = str(error_of(make, raw))
    assert f"do not conform ({kinds})" in error
    if element == "tet4":
        assert "none, but 8 facets of 'left' are cut otherwise than those they touch" in error
    else:
        assert "12 of block 'left'" in error


def test_second_joint_between_two_blocks(make):
    raw = two_boxes()
    raw["joints"]["d"] = raw["joints"]["c"] | {"between": ["right", "left"]}
    assert str(error_of(make, raw)) == (
        "s.yaml: joints.d.between: blocks 'right' and 'left' are already joined by joints.c, "
        "which takes all facets they share, limit one joint; remove one of the two"
    )


def test_overlapping_blocks_are_no_joint(make):
    """Facets that coincide but look the same way belong to blocks that occupy one place."""
    raw = two_boxes()
    raw["blocks"]["right"]["box"]["origin"] = [0, 0, 0]
    assert "do not touch" in str(error_of(make, raw))


def test_boundary_facets_of_both_blocks_are_found_once(make):
    left = make(two_boxes()).blocks["left"]
    assert len(boundary_facets(left.cells, "hex8")) == 6 * 4
