"""Cuts that are refused, each with its place and numbers."""

import numpy as np
import pytest
from scene_builders import box
from test_cutting import a_box, cut, plane, wavy

from romdam.core.errors import ConfigError, MeshError


def refusal(*arguments, **keys):
    with pytest.raises(MeshError) as caught:
        cut(*arguments, **keys)
    return str(caught.value)


def test_teeth_along_faces():
    """A plane at 45 degrees through cubes: steps of half a diagonal, faces at 45 degrees."""
    text = refusal(a_box("hex8", (4, 6, 2)), plane((0, 1, 0), (-1, 1, 0)))
    assert text == (
        "s.yaml: cut.b.along[0]: the joint would be saw-toothed, and its teeth act as keys: 16 of its 16 "
        "faces are off the surface by more than 0.05 of their edges, the worst by 0.7071 m = 0.707 edges, "
        "at (1, 1, 0) m; faces stand at up to 45 degrees to it; cut `through: elements`, mesh with element "
        "faces along the surface, or allow more `teeth`"
    )


def test_teeth_within_the_limit_are_moved_onto_the_surface():
    """A layer 0.04 edges off the plane: allowed, and flat afterwards; the same is refused from 0.03 on."""
    block, at = a_box("hex8", (4, 6, 2)), plane((0, 2.04, 0), (0, 1, 0))
    pieces = cut(block, at)
    assert pieces["A"].points[:, 1].max() == pytest.approx(2.04, abs=1e-14)
    assert "by 0.04 m = 0.04 edges" in refusal(block, at, teeth=0.03)


def test_a_cylinder_smaller_than_the_elements_bends_too_much():
    text = refusal(
        a_box("tet4", (4, 4, 2)), {"cylinder": {"point": (2, 2, 0), "radius": 1.2}}, through="elements"
    )
    assert "the surface bends too much for these elements: mesh finer, or allow more `teeth`" in text
    assert "more than 0.05 of their edges" in text


@pytest.mark.parametrize("through", ["faces", "elements"])
def test_a_plane_that_misses(through):
    text = refusal(a_box("tet4"), plane((0, 9, 0), (0, 1, 0)), through=through)
    assert text == (
        "s.yaml: cut.b.along[0]: the surface misses what is to become A, B: no element is left for the others"
        "; its nodes are -9 to -3 m from the surface (above 0 on its positive side), elements have edges of "
        "about 1.26 m; move the surface, turn its normal, or change the order of `into`"
    )


def test_planes_in_the_wrong_order():
    text = refusal(a_box("hex8"), plane((0, 4, 0), (0, 1, 0)), plane((0, 2, 0), (0, 1, 0)))
    assert text.startswith(
        "s.yaml: cut.b.along[1]: the surface misses what is to become B, C: block 'B' gets no element; its "
        "nodes are 2 to 4 m from the surface"
    )


def test_slivers():
    """A slice of 0.01 edges at the end of a box, whose nodes cannot leave it: 6 sqrt(2) 0.01 / 6 = 0.0141."""
    block = a_box("tet4", (2, 4, 2))
    text = refusal(block, plane((0, 3.99, 0), (0, 1, 0)), through="elements")
    assert text.startswith("s.yaml: cut.b.along[0]: the cut leaves ")
    assert "3.99" in text and "limit 0.02 (1 is a regular tetrahedron); move the surface away" in text
    text = refusal(a_box("hex8", (2, 4, 2)), plane((0, 3.99, 0), (0, 1, 0)), through="elements")
    assert "the cut leaves 4 slivers: the worst, around (0.5, 3.995, 0.5) m, has a quality of 0.0141" in text


def test_hexahedra_that_are_not_cut_through_one_family():
    text = refusal(a_box("hex8", (4, 6, 2)), plane((0, 1.5, 0), (-0.5, 1, 0)), through="elements")
    assert text.startswith("s.yaml: cut.b.along[0]: the surface crosses ")
    assert (
        "are cut like this, limit 0); hexahedra are cut in two only through four edges that run side" in text
    )
    assert "mesh the block with tetrahedra (tet10), or with element faces along the surface" in text


def test_quadratic_hexahedra_are_not_cut():
    text = refusal(a_box("hex20", (2, 2, 2)), plane((0, 0.6, 0), (0, 1, 0)), through="elements")
    assert "elements of the kind hex20 are not cut in two, only tet4, tet10 and hex8; mesh with" in text


@pytest.mark.parametrize("through", ["faces", "elements"])
def test_a_surface_that_ends_in_the_block(through, tmp_path):
    wavy(tmp_path, ".vtu", last=2.5)
    surface = {"surface": {"file": "s.vtu"}}
    text = refusal(a_box("tet4"), surface, folder=tmp_path, through=through, teeth=0.5)
    assert text.startswith("s.yaml: cut.b.along[0]: the surface ends within the block: the joint at (4, ")
    assert "beyond its rim, limit 0.5 of an edge = " in text


def test_surfaces_without_two_sides(tmp_path):
    import meshio

    points = np.array([[0, 3, 0], [4, 3, 0], [4, 3, 4], [0, 3, 4], [2, 5, 2]], dtype=float)
    for cells, what in {
        ((0, 1, 2), (0, 3, 2)): "0 of",
        ((0, 1, 2), (0, 2, 3)): "",
        ((0, 1, 2), (0, 2, 3), (0, 2, 4)): "share an edge with two others",
        ((0, 1, 2), (0, 2, 2)): "have no area",
    }.items():
        meshio.Mesh(points, [("triangle", np.array(cells))]).write(tmp_path / "s.vtu")
        surface = {"surface": {"file": "s.vtu"}}
        if not what:
            assert set(cut(a_box("hex8"), surface, folder=tmp_path)) == {"A", "B"}
        else:
            text = refusal(a_box("hex8"), surface, folder=tmp_path)
            assert (
                text.startswith("s.yaml: cut.b.along[0].surface.file: ") and "a surface that cuts has" in text
            )
            assert what in text or "run the other way round than a neighbour" in text


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (None, "no mesh file"),
        (b"", "cannot be read as an STL file"),
        (b"solid a\nfacet\nvertex 0 0 0\nendfacet\n", "it has 1 corners and 1 triangles"),
        (b"solid a\n" + b"vertex 0 0 zero\n" * 3 + b"endfacet\n", "number 3 of its corners is 'zero'"),
        (b"solid a\n" + b"vertex 0 0 nan\n" * 3 + b"endfacet\n", "expected finite coordinates"),
        (b"x" * 80 + (5).to_bytes(4, "little") + b"0" * 50, "not the length of a binary file"),
    ],
)
def test_damaged_stl(content, what, tmp_path):
    if content is not None:
        (tmp_path / "s.stl").write_bytes(content)
    text = refusal(a_box("hex8"), {"surface": {"file": "s.stl"}}, folder=tmp_path)
    assert text.startswith("s.yaml: cut.b.along[0].surface.file: ") and what in text


def test_a_file_without_facets_or_the_group(tmp_path):
    import meshio

    meshio.Mesh(np.eye(4, 3), [("tetra", np.array([[0, 1, 2, 3]]))]).write(tmp_path / "s.vtu")
    text = refusal(a_box("hex8"), {"surface": {"file": "s.vtu"}}, folder=tmp_path)
    assert "s.vtu holds no triangles or quadrilaterals; export a surface" in text
    text = refusal(a_box("hex8"), {"surface": {"file": "s.vtu", "group": "j"}}, folder=tmp_path)
    assert "surface.group: group 'j' does not exist in" in text and "its groups are none" in text


def dam(**cut_keys):
    keys = {"along": [plane([0, 2, 0], [0, 1, 0])], "into": ["left", "right"]} | cut_keys
    return {
        "blocks": {"dam": box([0, 0, 0], [2, 4, 2]), "other": box([0, 9, 0], [2, 2, 2])},
        "cut": {"dam": keys},
        "supports": [{"block": "left", "face": "zmin"}],
    }


@pytest.mark.parametrize(
    ("raw", "what"),
    [
        (dam(into=["left"]), "cut.dam: `into` names 1 blocks, and `along` has 1 surface, which make 2"),
        (dam(into=["left", "other"]), "cut.dam.into: there is a block 'other' already; rename one"),
        (dam(into=["left", "left"]), "cut.dam.into: there is a block 'left' already"),
        (dam(along=[]), "cut.dam.along must have at least 1 entry"),
        (dam(along=[{}]), "cut.dam.along[0]: give exactly one of `plane`, `cylinder` and `surface`"),
        (dam(along=[plane([0, 2, 0], [0, 0, 0])]), "cut.dam.along[0].plane.normal must not be zero"),
        (dam(teeth=0.9), "cut.dam.teeth must be at most 0.5, got 0.9"),
        (dam(through="cells"), "cut.dam.through must be 'faces' or 'elements'"),
        (dam() | {"cut": {"dan": dam()["cut"]["dam"]}}, "cut.dan: block 'dan' is not defined"),
        (
            dam() | {"supports": [{"block": "dam", "face": "zmin"}]},
            "supports[0].block: no 'dam' is defined; defined are left, other, right",
        ),
        (
            dam(joints={"normal_stiffness": 1e9})
            | {"joints": {"left-right": {"between": ["left", "right"], "normal_stiffness": 1e9}}},
            "joints.left-right: cut.dam makes a joint of that name; rename this one",
        ),
    ],
)
def test_wrong_configurations(raw, what, make):
    with pytest.raises(ConfigError) as caught:
        make(raw)
    assert what in str(caught.value)


def test_a_joint_of_a_block_that_is_cut_again(make):
    raw = dam(joints={"normal_stiffness": 1e9})
    raw["cut"]["right"] = {"along": [plane([1, 0, 0], [1, 0, 0])], "into": ["a", "b"]}
    with pytest.raises(ConfigError, match=r"cut\.dam\.joints: block 'right' is cut again, so that no joint"):
        make(raw)


def test_cuts_that_make_each_other(make):
    raw = dam()
    raw["cut"] |= {
        "p": {"along": [plane([1, 0, 0], [1, 0, 0])], "into": ["q", "r"]},
        "q": {"along": [plane([1, 0, 0], [1, 0, 0])], "into": ["p", "s"]},
    }
    with pytest.raises(
        ConfigError, match=r"cut\.p: block 'p' is not defined; blocks to be cut are dam, left"
    ):
        make(raw)


def test_a_block_in_two_parts_is_told(caplog):
    """A cylinder that leaves two corners of the box outside."""
    cut(
        a_box("tet4", (4, 4, 2), 0.5),
        {"cylinder": {"point": (2, 2, 0), "radius": 2.3}},
        through="elements",
    )
    assert "block 'B' is in 4 parts that share no face" in caplog.text
