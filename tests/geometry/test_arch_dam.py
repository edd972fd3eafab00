"""The parametric arch dam: a conforming mesh of the shape asked for, and refusals with numbers."""

from itertools import permutations
from typing import get_args

import numpy as np
import pytest
from arch_dams import DIVISIONS, JOINTS, PERIMETER, ROCK, arch_dam

from romdam.config import parse_config
from romdam.config.sections.places import GridElement
from romdam.core.errors import ConfigError, MeshError
from romdam.fem.assembly import assemble
from romdam.fem.loads import weight_force
from romdam.geometry.facets import area_vectors, boundary_facets, facet_areas
from romdam.scene.ties import scene_parts


def merged(scene):
    """The part, points and boundary of all blocks with ties made one; joints stay open."""
    (part,) = scene_parts(scene).values()
    mesh = part.mesh(scene.blocks)
    return part, mesh.points, boundary_facets(mesh.cells, mesh.element)


def volume(points, facets):
    """By the divergence theorem, V = 1/3 int x n dA."""
    return np.einsum("fjk,fjk->", points[facets], area_vectors(points, facets)) / 3.0


@pytest.mark.parametrize("element", get_args(GridElement))
def test_blocks_conform_wherever_they_meet(make, element):
    scene = make(arch_dam(element=element))
    part, points, facets = merged(scene)
    inside = sum(
        volume(block.points, boundary_facets(block.cells, block.element)) for block in scene.blocks.values()
    )
    assert volume(points, facets) == pytest.approx(inside, rel=1e-12)
    sides = {f"side_{side}" for side in ("left", "right", "upstream", "downstream")}
    named = {"upstream", "downstream", "crest", "surface", "base", "J1", "J2", "J3"} | sides
    seen = set()
    for name, block in scene.blocks.items():
        for face, own in block.faces.items():
            if face in (named if name != "perimeter" else {"crest"}):
                seen |= {tuple(f) for f in np.sort(part.number[name][own], axis=1)}
    assert {tuple(f) for f in np.sort(facets, axis=1)} == seen


@pytest.mark.parametrize("element", get_args(GridElement))
def test_mass_and_weight_are_those_of_the_volume(make, element):
    scene = make(arch_dam(element=element) | {"loads": {"gravity": [0, 0, -9.81]}})
    for name, block in scene.blocks.items():
        M = assemble(block)[1]
        mass = block.material.rho * volume(block.points, boundary_facets(block.cells, block.element))
        rigid = np.tile(np.eye(3), (len(block.points), 1))
        assert np.abs(rigid.T @ (M @ rigid) - mass * np.eye(3)).max() < 1e-12 * mass
        weight = weight_force(scene, name, M).reshape(-1, 3).sum(axis=0)
        expected = np.array([0.0, 0.0, 0.0 if name in scene.loads.excluded_from_gravity else -9.81 * mass])
        assert np.abs(weight - expected).max() < 1e-12 * 9.81 * mass


def test_shape_is_the_one_asked_for(make):
    scene = make(arch_dam(cantilevers=8, element="tet10", divisions=DIVISIONS | {"up": 8, "through": 2}))
    crown = scene.blocks["C4"].faces["J4"]
    at = scene.blocks["C4"].points[np.unique(crown)]
    assert np.abs(at[:, 0]).max() < 1e-9
    crest, base = (at[at[:, 2] == z] for z in (100.0, 0.0))
    assert (crest[:, 1].min(), crest[:, 1].max()) == pytest.approx((-2.0, 5.0))
    assert (base[:, 1].min(), base[:, 1].max()) == pytest.approx((0.0, 24.0))
    top = scene.blocks["C1"].points[np.unique(scene.blocks["C1"].faces["crest"])]
    outer = np.hypot(top[:, 0], top[:, 1] - 123.0).max()  # the arc's centre: -2 + 125
    assert outer == pytest.approx(125.0)
    for joint in scene.joints.values():
        normal = joint.axes[:, 0]
        assert np.abs(normal - normal[0]).max() < 1e-12 and abs(normal[0, 2]) < 1e-12
        assert normal[0, :2] @ (joint.position[0, :2] - (0.0, 123.0)) == pytest.approx(0.0, abs=1e-9)


def test_both_banks_are_mirror_images(make):
    scene = make(arch_dam(ground=False, element="tet10"))
    left, right = scene.blocks["C1"].points * [-1, 1, 1], scene.blocks["C4"].points
    assert np.allclose(*(p[np.lexsort(np.round(p, 6).T)] for p in (left, right)), atol=1e-9)


def test_refining_the_mesh_keeps_feet_and_joints(make):
    coarse, fine = (make(arch_dam(divisions=DIVISIONS | {"along": n, "up": 3 * n})) for n in (1, 2))
    for name, joint in coarse.joints.items():
        sides = [scene.blocks[joint.blocks[0]] for scene in (coarse, fine)]
        foot = [side.points[np.unique(side.faces[name]), 2].min() for side in sides]
        assert foot[0] == pytest.approx(foot[1], abs=1e-9)


def test_parabolic_and_polynomial(make):
    parabola = {"shape": "parabolic", "upstream_radius": 120.0}
    crown = {"upstream": {"polynomial": [0.0, -0.3, 0.003]}, "thickness": 15.0}
    scene = make(arch_dam(ground=False, arcs=parabola, crown=crown))
    top = scene.blocks["C1"].points[np.unique(scene.blocks["C1"].faces["crest"])]
    upstream = top[np.argmin(top[:, 1] - top[:, 0] ** 2 / 240.0)]
    assert upstream[1] == pytest.approx(upstream[0] ** 2 / 240.0, abs=1e-9)


def test_ground_holds_what_the_source_holds(make):
    scene = make(arch_dam())
    bases = {name: block.faces["base"] for name, block in scene.blocks.items() if "base" in block.faces}
    assert all(scene.fixed[name][np.unique(facets)].all() for name, facets in bases.items())
    area = sum(facet_areas(scene.blocks[name].points, facets).sum() for name, facets in bases.items())
    assert area == pytest.approx(2 * 260.0 * (160.0 + 220.0))
    for face, axis in (("side_left", 0), ("side_upstream", 1), ("side_downstream", 1)):
        nodes = np.unique(scene.blocks["rock_left"].faces[face])
        assert scene.fixed["rock_left"][nodes, axis].all()
    assert not scene.fixed["rock_left"][np.unique(scene.blocks["rock_left"].faces["surface"]), 2].any()
    assert not scene.fixed["C2"].any()
    bare = make(arch_dam(ground=False))
    assert bare.fixed["C2"][np.unique(bare.blocks["C2"].faces["contact"])].all()


def test_viscous_boundary_takes_the_place_of_supports(make):
    scene = make(arch_dam(rock=ROCK | {"boundary": "viscous"}))
    assert not any(held.any() for held in scene.fixed.values())
    area = dict.fromkeys((120.0, 260.0, 160.0, 220.0), 0.0)  # by distance: base, banks, up- and downstream
    for block in scene.blocks.values():
        for face in block.absorbing:
            area[face.distance] += facet_areas(block.points, face.facets).sum()
    assert area[120.0] == pytest.approx(2 * 260.0 * (160.0 + 220.0))
    assert area[260.0] == pytest.approx(2 * (160.0 + 220.0) * (120.0 + 100.0))
    assert all(0.85 < area[away] / (2 * 260.0 * 220.0) < 1.0 for away in (160.0, 220.0))  # less the valley
    assert scene.radiating == {"rock_left", "rock_right", "rock_centre"}
    zones = {name: zone | {"mass": name != "left"} for name, zone in ROCK["zones"].items()}
    with pytest.raises(ConfigError, match=r"zone 'left' has no mass to carry any \(1 of 3 zones have none"):
        make(arch_dam(rock=ROCK | {"boundary": "viscous", "zones": zones}))


def test_samples_of_damping_on_viscous_rock_are_refused():
    raw = arch_dam(rock=ROCK | {"boundary": "viscous"}) | {
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"cutoff": 10.0},
        "transient": {"finest_step": 0.01},
        "pipeline": "suite",
        "suite": {"parameters": {"xi": {"path": "damping.rayleigh.ratio", "values": [0.03, 0.05]}}},
        "damping": {"rayleigh": {"frequencies": [2, 15], "ratio": 0.05}},
    }
    with pytest.raises(
        ConfigError,
        match=r"parameters: 1 of damping varied, limit 0 with .* \(arch_dam.rock.boundary\)",
    ):
        parse_config(raw, "s.yaml")


@pytest.mark.parametrize("gaps", ["nodes", "corners"])
def test_gap_areas_fill_the_joint_and_carry_uniform_pressure(make, gaps):
    scene = make(arch_dam(element="tet10", joints=JOINTS | {"gaps": gaps, "discretization": "node_to_node"}))
    for name, joint in scene.joints.items():
        block = scene.blocks[joint.blocks[0]]
        facets = block.faces[name]
        assert joint.area.min() > 0.0
        assert joint.area.sum() == pytest.approx(facet_areas(block.points, facets).sum(), rel=1e-12)
        force = np.zeros(len(block.points))
        np.add.at(force, joint.nodes[0], joint.area @ joint.weights[0])
        consistent = np.zeros((len(block.points), 3))
        np.add.at(consistent, facets, area_vectors(block.points, facets))
        # on facets with curved edges the consistent force of a corner may point the other way
        along = consistent @ joint.axes[0, 0]
        assert np.allclose(force, along, rtol=0.0, atol=1e-12 * joint.area.sum())


def test_corner_gaps_stand_at_corners(make):
    corners, nodes = (
        make(
            arch_dam(element="tet10", joints=JOINTS | {"gaps": gaps, "discretization": "node_to_node"})
        ).joints["J2"]
        for gaps in ("corners", "nodes")
    )
    assert len(corners.gap) == 2 * 4
    assert len(nodes.gap) == 3 * 7
    assert {tuple(p) for p in corners.position.round(6)} < {tuple(p) for p in nodes.position.round(6)}


WRONG = {
    "valley": (
        {"valley": [[0, 22], [100, 400]]},
        r"arch_dam\.valley: its walls cut the arcs: at elevation 75 m the half-width is 305\.5 m, .* reaches",
    ),
    "narrowing": ({"valley": [[0, 60], [100, 50]]}, r"not shrink upwards, got 60 m at 0 m, 50 m at 100 m"),
    "thickness": (
        {"crown": {"thickness": [[0, 24], [60, 5], [100, -1]]}},
        r"arch_dam\.crown\.thickness: must be above 0 from base to crest, got -1 m at elevation 100 m",
    ),
    "crossing": (
        {
            "arcs": {"upstream_radius": 40.0, "downstream_radius": 60.0},
            "crown": {"thickness": [[0, 45], [100, 10]]},
            "valley": [[0, 15], [100, 30]],
        },
        r"joints would cross within the dam: .* lies \d\.?\d* m beyond it at elevation 0 m, .* limit 0",
    ),
    "rock": (
        {"rock": ROCK | {"half_width": 90.0}},
        r"rock\.half_width: the rock is smaller than the dam: 90 m, but dam and perimeter reach 9\d",
    ),
    "shallow": ({"rock": ROCK | {"depth": 2.0}}, r"rock\.depth: .* 2 m, but .* reach 4"),
    "empty zone": (
        {"rock": ROCK | {"zones": {"all": {"material": "rock_a"}, "more": {"material": "rock_b"}}}},
        r"rock\.zones: \d+ cells, .* are in 'all' and in 'more', which have limits along as many axes \(0\)",
    ),
    "nowhere": (
        {
            "rock": ROCK
            | {"zones": {"all": {"material": "rock_a"}, "far": {"material": "rock_b", "x": [900, 999]}}}
        },
        r"rock\.zones\.far: covers nothing: none of the \d+ cells",
    ),
    "layers without thickness": (
        {"divisions": DIVISIONS | {"rock": 40, "growth": 5.0}},
        r"divisions\.rock: 40 layers that grow by 5 make the first one .* of the whole, limit 0\.0001",
    ),
    "left out": (
        {"rock": ROCK | {"zones": {"left": {"material": "rock_a", "x": [-1000, 0]}}}},
        r"rock\.zones: \d+ of \d+ cells of rock are in no zone",
    ),
    "abutment": (
        {"abutment_height": 100.0},
        r"`abutment_height` 100 m must be below the dam's height, 100 m",
    ),
    "material": ({"perimeter": PERIMETER | {"material": "steel"}}, r"perimeter\.material: no 'steel'"),
    "order": (
        {"crown": {"thickness": [[50, 24], [0, 20]]}},
        r"thickness: elevations must ascend, got 50 m then 0 m",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_dams_are_refused_with_numbers(make, case):
    keys, message = WRONG[case]
    with pytest.raises((ConfigError, MeshError), match=message):
        make(arch_dam(**keys))


@pytest.mark.slow
def test_zones_do_not_depend_on_the_order_of_their_keys(make):
    scenes = [
        make(arch_dam(rock=ROCK | {"zones": dict(order)})) for order in permutations(ROCK["zones"].items())
    ]
    for scene in scenes[1:]:
        for name, block in scenes[0].blocks.items():
            assert np.array_equal(scene.blocks[name].points, block.points)
            assert scene.blocks[name].material == block.material


def test_names_that_the_dam_makes_are_taken(make):
    box = {"material": "concrete", "box": {"origin": [0, 0, 0], "size": [1, 1, 1], "element_size": 1.0}}
    with pytest.raises(ConfigError, match=r"blocks\.C2: arch_dam makes a block of that name"):
        make(arch_dam() | {"blocks": {"C2": box}})


def test_tied_boxes_are_one_part(make):
    raw = {
        "blocks": {
            name: {
                "material": "concrete",
                "box": {"origin": [x, 0, 0], "size": [2, 2, 2], "element_size": 1.0},
            }
            for name, x in (("a", 0), ("b", 2), ("c", 6))
        },
        "supports": [{"block": "a", "face": "zmin"}, {"block": "c", "face": "zmin"}],
        "ties": {"t": {"between": ["a", "b"]}},
    }
    scene = make(raw)
    parts = scene_parts(scene)
    assert [p.blocks for p in parts.values()] == [("a", "b"), ("c",)]
    assert parts["a+b"].nodes == 2 * 27 - 9
    for name, block in scene.blocks.items():
        part = next(p for p in parts.values() if name in p.blocks)
        assert np.array_equal(part.mesh(scene.blocks).points[part.number[name]], block.points)
    with pytest.raises(ConfigError, match=r"ties\.t: blocks 'a' and 'c' do not touch"):
        make(raw | {"ties": {"t": {"between": ["a", "c"]}}})


def test_joint_within_a_part_keeps_only_gaps_that_can_move(make):
    """Two boxes on a common foot: their joint's lowest nodes are one node of the part."""
    at = {"foot": ([0, 0, -1], [4, 2, 1]), "left": ([0, 0, 0], [2, 2, 2]), "right": ([2, 0, 0], [2, 2, 2])}
    raw = {
        "blocks": {
            name: {"material": "concrete", "box": {"origin": o, "size": s, "element_size": 1.0}}
            for name, (o, s) in at.items()
        },
        "supports": [{"block": "foot", "face": "zmin"}],
        "ties": {name: {"between": ["foot", name]} for name in ("left", "right")},
        "joints": {"j": {"between": ["left", "right"], "normal_stiffness": 1e9}},
    }
    joint = make(raw).joints["j"]
    assert len(joint.gap) == 6 and joint.position[:, 2].min() == 1.0
