"""Supports, loads, probes and blocks that nothing holds."""

import dataclasses

import numpy as np
import pytest
from scene_builders import box, two_boxes

from romdam.core.errors import ConfigError
from romdam.fem.loads import static_force
from romdam.geometry.elements import SOLIDS
from romdam.scene.supports import has_no_rigid_body_mode, refuse_free_blocks


def error_of(make, raw):
    with pytest.raises(ConfigError) as caught:
        make(raw)
    return str(caught.value)


def one_box(**keys):
    return {
        "blocks": {"dam": box([0, 0, 0], [2, 2, 2])},
        "supports": [{"block": "dam", "face": "zmin"}],
    } | keys


def test_supports_by_face_plane_and_component(make):
    supports = [
        {"block": "dam", "face": "zmin", "fix": ["z"]},
        {"block": "dam", "face": {"axis": "x", "at": 0.0}, "fix": ["x"]},
        {"block": "dam", "face": {"axis": "y", "at": "2000 mm"}, "fix": ["y"]},
    ]
    scene = make(one_box(supports=supports))
    points, fixed = scene.blocks["dam"].points, scene.fixed["dam"]
    assert np.array_equal(fixed, np.c_[points[:, 0] == 0, points[:, 1] == 2, points[:, 2] == 0])


@pytest.mark.parametrize("element", SOLIDS)
def test_loads_are_what_they_say(element, make):
    blocks = {"dam": box([0, 0, 0], [2, 2, 2], element=element)}
    loads = {
        "gravity": [0, 0, -9.81],
        "pressure": [{"block": "dam", "face": "ymax", "value": "3 kPa"}],
        "force": [{"block": "dam", "at": [1, 1, 2], "force": ["5 kN", 0, 0]}],
    }
    scene = make(one_box(blocks=blocks, loads=loads))
    force = static_force(scene, "dam")
    assert force.sum(axis=0) == pytest.approx([5e3, -3e3 * 4, -9.81 * 2440 * 8], rel=1e-12)
    moment = np.cross(scene.blocks["dam"].points, force).sum(axis=0)
    weight = 9.81 * 2440 * 8
    exact = (
        np.cross([1, 1, 2], [5e3, 0, 0])
        + np.cross([1, 2, 1], [0, -12e3, 0])
        + np.cross([1, 1, 1], [0, 0, -weight])
    )
    assert moment == pytest.approx(exact, rel=1e-12)


def test_probes_find_the_nearest_node(make):
    nodes = {"top": {"block": "dam", "at": [2, 2.0004, 2]}}
    probe = make(one_box(outputs={"nodes": nodes})).probes[0]
    assert (probe.name, probe.block, probe.node) == ("top", "dam", 26)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            {"supports": [{"block": "dam", "face": "bottom"}]},
            "s.yaml: supports[0].face: block 'dam' has no face 'bottom'; its faces are "
            "xmax, xmin, ymax, ymin, zmax, zmin",
        ),
        (
            {"supports": [{"block": "dam", "face": {"axis": "z", "at": 0.25}}]},
            "s.yaml: supports[0].face: the plane z = 0.25 m catches no node of block 'dam', "
            "which spans z = 0 to 2 m; its nearest facet is 0.25 m off, tolerance 1e-06 m; correct `at`, "
            "or raise `tolerance`",
        ),
        (
            {"loads": {"pressure": [{"block": "dam", "face": {"axis": "x", "at": 9}, "value": 1.0}]}},
            "s.yaml: loads.pressure[0].face: the plane x = 9 m catches no node of block 'dam'",
        ),
        (
            {"loads": {"force": [{"block": "dam", "at": [0, 0, 2.5], "force": [1, 0, 0]}]}},
            "s.yaml: loads.force[0].at: no node of block 'dam' within 0.001 m of (0, 0, 2.5); the nearest is "
            "(0, 0, 2), 0.5 m away; use its position, or raise `tolerance`",
        ),
        (
            {"outputs": {"nodes": {"top": {"block": "dam", "at": [0.1, 0, 2]}}}},
            "s.yaml: outputs.nodes.top.at: no node of block 'dam' within 0.001 m of (0.1, 0, 2); the nearest "
            "is (0, 0, 2), 0.1 m away; use its position, or raise `tolerance`",
        ),
        (
            {"supports": []},
            "s.yaml: supports: no support holds block 'dam' (free to move in every way); 6 rigid motions are "
            "free, limit 0; add a support, or a joint to a block that is held",
        ),
        (
            {"supports": [{"block": "dam", "face": "zmin", "fix": ["z"]}]},
            "s.yaml: supports: no support holds block 'dam' (free in translation along x, translation "
            "along y, rotation about z); 3 rigid motions are free, limit 0",
        ),
        (
            {"supports": [{"block": "dam", "face": "zmin", "fix": ["x", "y"]}]},
            "(free in translation along z, 2 combined motions); 3 rigid motions are free",
        ),
    ],
)
def test_bad_scene(keys, message, make):
    assert message in error_of(make, one_box(**keys))


def test_joined_blocks_without_any_support(make):
    error = error_of(make, two_boxes() | {"supports": []})
    assert error == (
        "s.yaml: supports: neither supports nor joints hold block 'left' (free to move in every way), "
        "block 'right' (free to move in every way); 6 rigid motions are free, limit 0; "
        "add a support, or a joint to a block that is held"
    )


def test_only_the_free_block_is_named(make):
    raw = two_boxes()
    raw["blocks"]["third"] = box([0, 9, 0], [2, 2, 2])
    error = error_of(make, raw)
    assert "hold block 'third' (free to move in every way); 6 rigid" in error
    assert "left" not in error


def test_block_held_by_a_joint_alone_is_accepted(make):
    """A frictionless joint leaves it rigid-body modes, which the solver handles."""
    raw = two_boxes()
    scene = make(raw | {"supports": raw["supports"][:1]})
    assert has_no_rigid_body_mode(scene.blocks["left"], scene.fixed["left"])
    assert not has_no_rigid_body_mode(scene.blocks["right"], scene.fixed["right"])
    assert not scene.fixed["right"].any()


def test_loose_piece_of_a_block_is_found(make):
    scene = make(one_box())
    block = scene.blocks["dam"]
    far = dataclasses.replace(
        block,
        points=np.vstack([block.points, block.points + np.array([9, 0, 0])]),
        cells=np.vstack([block.cells, block.cells + len(block.points)]),
    )
    fixed = {"dam": np.vstack([scene.fixed["dam"], np.zeros_like(scene.fixed["dam"])])}
    with pytest.raises(ConfigError, match=r"no support holds block 'dam' \(piece 2 of 2\)"):
        refuse_free_blocks({"dam": far}, {}, fixed, "s.yaml")
