"""`spacing`: gaps farther apart than the nodes, each for a patch of the face."""

import json
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from arch_dams import arch_dam
from scene_builders import box, two_boxes
from simulating import simulated

import romdam
from romdam.config import parse_config
from romdam.config.load import Job
from romdam.config.other_mesh import with_automatic_spacing, with_spacing
from romdam.config.sections.job import DampingConfig
from romdam.core.errors import ConfigError
from romdam.error.discretisation import MeshRun
from romdam.error.estimate import jump_of_forces
from romdam.error.metrics import relative_l2
from romdam.pipelines.automatic_spacing import Nodes, fewest_points
from romdam.pipelines.check import check
from romdam.reduction.mode_choice import ALL_MODES
from romdam.reduction.synthesis import reduce_scene
from romdam.scene import joints, patches
from romdam.scene.build import build_scene
from romdam.scene.joints import local_axes
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.patches import coarsen_gaps, mean_normal
from romdam.scene.stress.sections import gaps_above
from romdam.terminal.lines import info_lines
from romdam.timestepping.grouting import grouted

EXAMPLE = Path(__file__).parents[2] / "configs" / "two_cantilevers.yaml"


def floating_pair(element="hex8", left=1.0, right=1.0, **joint):
    """Two boxes of 4 x 2 x 12 m over each other at y = 2, held far from the joint."""
    return {
        "blocks": {
            "left": box([0, 0, 0], [4, 2, 12], [1.0, 2.0, left], element),
            "right": box([0, 2, 0], [4, 2, 12], [1.0, 2.0, right], element),
        },
        "supports": [{"block": "left", "face": "ymin"}, {"block": "right", "face": "ymax"}],
        "joints": {"c": {"between": ["left", "right"], "normal_stiffness": 1e9} | joint},
    }


PAIRS = {
    "node to node": ({}, 3.0),
    "a length that divides nothing": ({}, 2.7),
    "longer than the face is wide": ({}, 9.0),
    "corners of quadratic facets": ({"element": "hex20", "gaps": "corners"}, 3.0),
    "mortar, meshes that do not match": ({"right": 1.5}, 3.0),
    "mortar of triangles": ({"element": "tet10"}, 3.0),
}


@pytest.fixture(params=PAIRS.values(), ids=PAIRS)
def pair(request, make):
    """A scene with a gap for every node, and one with `spacing`."""
    keys, spacing = request.param
    return make(floating_pair(**keys)), make(floating_pair(**keys, spacing=spacing)), spacing


@pytest.mark.parametrize("spacing", ["1e-9 m", "5 mm"])
def test_a_spacing_far_below_the_distance_of_the_nodes_is_refused(make, spacing):
    """15 or 20 x 7 nodes share 4 m x 12 m: nodes are about 0.86 m apart, so 8.6 mm is the least."""
    with pytest.raises(
        ConfigError, match=r"joints.c.spacing: .* of the distance of the nodes, 0.\d+ m, limit"
    ):
        make(floating_pair(spacing=spacing))


def test_memory_of_gaps_apart_is_estimated_before_it_is_taken(make, monkeypatch):
    """The face has 33 x 97 nodes."""
    asked = []
    whole = coarsen_gaps

    def traced(*args):
        tracemalloc.start()
        try:
            joint = whole(*args)
            asked.append((tracemalloc.get_traced_memory()[1], len(joint.area)))
        finally:
            tracemalloc.stop()
        return joint

    keys = {"spacing": 0.2}
    raw = floating_pair(**keys)
    for block in raw["blocks"].values():
        block["box"]["element_size"] = [0.125, 2.0, 0.125]
    monkeypatch.setattr(joints, "coarsen_gaps", traced)
    make(raw)
    ((peak, gaps),) = asked
    assert gaps > 1000
    estimate = 8.0 * patches._DENSE * 33 * 97 * gaps
    assert 0.8 < peak / estimate < 1.2
    monkeypatch.setattr(patches, "memory_limit", lambda limit: 0.9 * estimate)
    with pytest.raises(ConfigError, match=rf"joints.c.spacing: {gaps} gaps for 3201 nodes take .* GB"):
        make(raw)


def forces_on(scene, pressure):
    """Forces on the nodes of the right block (nodes, 3) of a contact force on every gap."""
    joint = scene.joints["c"]
    forces = np.zeros((len(scene.blocks["right"].points), 3))
    np.add.at(forces, joint.nodes[1], joint.weights[1].T @ (pressure[:, None] * joint.axes[:, 0]))
    return forces


def test_areas_add_up_and_points_are_as_far_apart_as_asked(pair):
    every, some, spacing = pair
    joint = some.joints["c"]
    assert len(joint.area) < len(every.joints["c"].area)
    assert joint.area.sum() == pytest.approx(48.0, rel=1e-12) and (joint.area > 0.0).all()
    apart = np.linalg.norm(joint.position[:, None] - joint.position, axis=2) + 1e9 * np.eye(len(joint.area))
    assert 0.7 * min(spacing, 4.0) <= apart.min(axis=1).min() and apart.min(axis=1).max() <= 1.5 * spacing
    corners = {(x, 2.0, z) for x in (0.0, 4.0) for z in (0.0, 12.0)}
    assert corners <= {tuple(place) for place in np.round(joint.position, 9)}


def test_a_rigid_motion_of_a_side_opens_every_gap_by_what_it_moves_there(pair):
    _, some, _ = pair
    joint, rng = some.joints["c"], np.random.default_rng(1)
    shift, turn = rng.normal(size=(2, 3))
    points = some.blocks["right"].points[joint.nodes[1]]
    jump = joint.weights[1] @ (shift + np.cross(turn, points))
    exact = shift + np.cross(turn, joint.weights[1] @ points)  # a mortar weight is a mean around its corner
    np.testing.assert_allclose(jump, exact, atol=1e-12)
    at_point = (joint.at_point or joint.weights)[1] @ (shift + np.cross(turn, points))
    np.testing.assert_allclose(at_point, shift + np.cross(turn, joint.position), atol=1e-9)


def test_node_to_node_jumps_are_those_at_the_points(make):
    joint = make(floating_pair(spacing=3.0)).joints["c"]
    scene = make(floating_pair(spacing=3.0))
    points = scene.blocks["right"].points[joint.nodes[1]]
    np.testing.assert_allclose(joint.weights[1] @ points, joint.position, atol=1e-12)


def test_uniform_pressure_is_the_same_on_every_node(pair):
    every, some, _ = pair
    exact, found = (forces_on(scene, 3e5 * scene.joints["c"].area) for scene in (every, some))
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-9 * np.abs(exact).max())


def test_pressure_that_grows_linearly_has_its_force_and_moment(make):
    """Node to node, where the gaps of all nodes have both exactly, but for the lumping of the mesh."""
    resultants = []
    for spacing in ({}, {"spacing": 3.0}):
        scene = make(floating_pair(**spacing))
        joint = scene.joints["c"]
        points = scene.blocks[joint.face.block].points
        nodes = 1e5 * (1.0 + points[:, 2] / 7.0 - points[:, 0] / 5.0)
        force = forces_on(scene, joint.of_corners(nodes) * joint.area)
        points = scene.blocks["right"].points
        resultants.append(np.append(force.sum(axis=0), np.cross(points, force).sum(axis=0)))
    np.testing.assert_allclose(*resultants, rtol=1e-10)


def test_water_in_the_joint_weighs_the_same(make):
    forces = []
    for spacing in ({}, {"spacing": 3.0}):
        raw = floating_pair(**spacing)
        raw["loads"] = {"joint_water": [{"joints": ["c"], "level": 9.3}]}
        joint = make(raw).joints["c"]
        arm = np.cross(joint.position, joint.water[:, None] * joint.axes[:, 0])
        forces.append(np.append(joint.water_resultant, arm.sum(axis=0)))
    np.testing.assert_allclose(*forces, rtol=1e-10, atol=1e-6)


def test_what_is_above_a_section_is_the_same(make):
    """Uniform pressure: the part of the area above the plane, which cuts facets."""
    above = []
    for spacing in ({}, {"spacing": 3.0}):
        raw = floating_pair(**spacing)
        plane = {"blocks": ["right"], "normal": [0, 0, 1], "point": [1, 3, 7.3]}
        raw["outputs"] = {"stress": {"blocks": ["right"], "sections": {"s": plane}}}
        scene = make(raw)
        joint = scene.joints["c"]
        above.append(joint.area @ gaps_above(joint, scene.stress.sections[0], scene.blocks))
    np.testing.assert_allclose(above, 4.0 * (12.0 - 7.3), rtol=1e-7)


def test_no_gap_stands_where_nothing_can_open(make):
    """Both blocks are held below: with all nodes and with fewer gaps the lowest row is left out, and its area
    told apart."""
    raw = floating_pair()
    raw["supports"] = [{"block": name, "face": "zmin"} for name in ("left", "right")]
    every = make(raw).joints["c"]
    raw["joints"]["c"]["spacing"] = 3.0
    some = make(raw).joints["c"]
    assert every.position[:, 2].min() == some.position[:, 2].min() == 1.0
    assert some.area.sum() == pytest.approx(every.area.sum(), rel=1e-12) and every.area.sum() < 48.0
    assert some.whole_area.sum() == pytest.approx(48.0, rel=1e-12)


def test_normals_along_the_line_of_two_nodes_are_of_both_sides(make):
    raw = floating_pair(spacing=3.0, normal="nodes", tolerance=0.2)
    raw["blocks"]["right"]["box"]["origin"] = [0, 2.1, 0]
    joint = make(raw).joints["c"]
    np.testing.assert_allclose(joint.axes[:, 0], np.tile([0.0, 1.0, 0.0], (len(joint.area), 1)), atol=1e-12)


@pytest.mark.parametrize("keys", [{}, {"right": 1.5}], ids=["node to node", "mortar"])
def test_a_turned_and_renumbered_face_has_the_same_gaps(make, keys):
    """Round-off must not choose between the two triangulations of four points on a circle."""
    scene = make(floating_pair(**keys))
    joint = scene.joints["c"]
    block = scene.blocks[joint.face.block]
    surface = MortarSurface(block.name, block.points, joint.face.facets[0])
    along = local_axes(mean_normal(joint)[None])[0, 1:]
    origin = joint.position[0]
    plain = coarsen_gaps(joint, surface, 3.0, along, origin, "here")
    a = np.radians(33.0)
    turn = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    rng = np.random.default_rng(3)
    order = rng.permutation(len(joint.area))
    turned = replace(
        joint,
        position=(joint.position @ turn.T)[order] + 1e-12 * rng.normal(size=joint.position.shape),
        axes=(joint.axes @ turn.T)[order],
        area=joint.area[order],
        share=joint.share[order],
        corner=joint.corner[order],
        weights=tuple(w[order] for w in joint.weights),
        at_point=None if joint.at_point is None else tuple(w[order] for w in joint.at_point),
    )
    other = coarsen_gaps(turned, surface, 3.0, along @ turn.T, origin @ turn.T, "here")
    apart = np.linalg.norm((plain.position @ turn.T)[:, None] - other.position, axis=2)
    pair = apart.argmin(axis=1)
    assert apart.min(axis=1).max() < 1e-9 and len(plain.area) == len(other.area)
    for found, exact in zip(other.weights, plain.weights, strict=True):
        assert abs(found[pair] - exact).max() < 1e-8


@pytest.mark.parametrize("keys", [{}, {"right": 1.5}], ids=["node to node", "mortar"])
@pytest.mark.parametrize("spacing", [2.5, 3.0, 4.0])
def test_contact_points_do_not_depend_on_the_block_that_is_named_first(make, keys, spacing):
    """Nodes at equal distances from where a point is wanted must not be chosen by the joint's axes."""
    raw = floating_pair(spacing=spacing, **keys)
    one = make(raw).joints["c"]
    raw["joints"]["c"]["between"] = raw["joints"]["c"]["between"][::-1]
    other = make(raw).joints["c"]
    apart = np.linalg.norm(one.position[:, None] - other.position, axis=2)
    assert len(one.area) == len(other.area) and apart.min(axis=1).max() < 1e-9
    np.testing.assert_allclose(other.area[apart.argmin(axis=1)], one.area, rtol=1e-9)


def test_a_gap_has_the_axes_of_the_node_at_which_it_stands(make):
    """On a face that is bent by a few degrees, its nodes in any order."""
    scene = make(floating_pair())
    joint, block = scene.joints["c"], scene.blocks["left"]
    angle = 0.02 * joint.position[:, 0] - 0.01 * joint.position[:, 2]
    normals = np.column_stack([np.sin(angle), np.cos(angle), np.zeros(len(angle))])
    bent = replace(joint, axes=local_axes(normals))
    surface = MortarSurface(block.name, block.points, joint.face.facets[0])
    along = local_axes(mean_normal(bent)[None])[0, 1:]
    some = coarsen_gaps(bent, surface, 3.0, along, bent.position[0], "here")
    nodes = np.linalg.norm(some.position[:, None] - bent.position, axis=2).argmin(axis=1)
    assert 4 < len(some.area) < len(bent.area)
    np.testing.assert_array_equal(some.axes, bent.axes[nodes])


def test_nodes_that_are_farther_apart_keep_their_gaps(make):
    every, some = make(two_boxes()).joints["c"], make(two_boxes(spacing=0.5)).joints["c"]
    assert np.array_equal(every.position, some.position) and some.patches is None
    assert abs(every.weights[0] - some.weights[0]).max() == 0.0


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"spacing": 3.0, "normal_stiffness": {"per_gap": 1e9}}, "`spacing` changes the number of gaps"),
        ({"spacing": 0.0}, r"joints\.c\.spacing"),
        ({"spacing": "automatic"}, "spacing"),
        ({"spacing": "auto"}, "spacing: auto of joint c needs transient.accuracy"),
        ({"spacing": {"c": 3.0}}, "`spacing` names 1 joints, and this is one; give a length, or auto"),
    ],
)
def test_what_cannot_be_meant_is_refused(make, keys, message):
    with pytest.raises(ConfigError, match=message):
        make(floating_pair(**keys))


def test_a_face_that_turns_around_a_corner_is_refused(make):
    scene = make(floating_pair())
    joint = scene.joints["c"]
    axes = joint.axes.copy()
    axes[joint.position[:, 2] > 9.0] = axes[0] @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    surface = MortarSurface("left", scene.blocks["left"].points, joint.face.facets[0])
    with pytest.raises(ConfigError, match=r"joints\.c\.spacing: the face turns by"):
        bent = replace(joint, axes=axes)
        coarsen_gaps(bent, surface, 5.0, np.eye(3)[:2], joint.position[0], "s.yaml: joints.c")


def shaken(spacing=None, **changes):
    """Openings of the example's coarse mesh with friction, and where they are."""
    raw = yaml.safe_load(EXAMPLE.read_text())
    raw["joints"]["contraction"] |= {"friction": 0.6, "shear_stiffness": "8 GPa/m"}
    raw["joints"]["contraction"] |= {"spacing": spacing} if spacing else {}
    config = parse_config(raw | changes, EXAMPLE.name)
    scene = build_scene(config, EXAMPLE.parent, EXAMPLE.name)
    system = reduce_scene(scene, config.model, config.damping).system
    time = np.arange(0.0, 3.0, 0.0025)
    ground = np.zeros((3, len(time)))
    ground[1] = 4.0 * np.sin(14.0 * time) * np.sin(np.pi * time / 3.0)
    history = simulated(system, ground, 0.0025, stride=4, initial_state="undeformed")
    return history, scene.joints["contraction"]


def test_openings_are_those_of_all_gaps_but_for_what_the_spacing_leaves():
    """The mesh itself leaves 6 %."""
    (every, whole), (some, joint) = shaken(), shaken("5 m")
    assert len(joint.area) < 0.4 * len(whole.area)
    pair = [int(np.argmin(np.linalg.norm(whole.position - place, axis=1))) for place in joint.position]
    at = np.linalg.norm(whole.position[pair] - joint.position, axis=1) < 1e-6
    wanted = every.jump[:, np.array(pair)[at], 0]
    assert relative_l2(some.jump[:, at, 0], wanted) < 0.003
    assert max(abs(some.energy["residual"])) < 1e-9 * max(abs(some.energy["input"]))


def test_auto_takes_what_the_accuracy_allows_and_the_result_says_it(tmp_path, caplog):
    caplog.set_level("INFO")
    raw = yaml.safe_load(EXAMPLE.read_text())
    raw["joints"]["contraction"]["spacing"] = "auto"
    raw["records"][0]["file"] = str(EXAMPLE.parent / raw["records"][0]["file"])
    raw["outputs"] |= {"plots": False, "mesh_error": False}
    taken = {}
    raw["model"] = {"modes": 10}
    for accuracy in ("20 %", "0.01 %"):
        raw["transient"] = {"accuracy": accuracy, "duration": "3 s"}
        path = tmp_path / f"{accuracy.split()[0]}.yaml"
        path.write_text(yaml.safe_dump(raw))
        with romdam.open_result(romdam.run(path, tmp_path / path.stem).paths[0]) as result:
            stated = json.loads(result.dataset.attrs["configuration"])["joints"]["contraction"]["spacing"]
            taken[accuracy] = stated, result.dataset.sizes["gap"]
            (said,) = (line for line in info_lines(result.dataset) if line.startswith("not included"))
            assert said.endswith(result.dataset.attrs["error_not_included"])
            assert ("the spacing of contact points" in said) == (stated is not None)
    assert taken["0.01 %"] == (None, 100)
    spacing, gaps = taken["20 %"]
    assert spacing > 5.0 and gaps < 50
    assert "which change the openings by about" in caplog.text


@pytest.mark.parametrize(
    "integrator", ["adaptive", pytest.param("generalized_alpha", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("keys", [{"spacing": 3.0}, {"element": "hex20", "gaps": "corners"}], ids=str)
def test_a_joint_that_has_just_been_grouted_is_closed_wherever_it_is_looked_at(make, keys, integrator):
    """At rest every gap carries p A, and its opening is -p / K_n, also at its very position."""
    keys = {"normal_stiffness": 2e10, "shear_stiffness": 1e10, "friction": 0.7, **keys}
    raw = floating_pair(**keys, grouting_pressure=5e5)
    raw["supports"] = [{"block": name, "face": "zmin"} for name in ("left", "right")]
    scene = make(raw)
    damping = DampingConfig.model_validate({"rayleigh": {"frequencies": [5.0, 50.0], "ratio": 0.05}})
    system = grouted(reduce_scene(scene, ALL_MODES, damping).system, 1e-10)
    rest = simulated(
        system, np.zeros((3, 11)), 0.001, integrator=integrator, initial_state="static", stride=1
    )
    np.testing.assert_allclose(rest.jump[0, :, 0], -5e5 / 2e10, rtol=1e-6)
    np.testing.assert_allclose(rest.traction[0, :, 0], 5e5 * scene.joints["c"].area, rtol=1e-6)
    assert np.abs(rest.jump[0, :, 1:]).max() < 1e-6 * 5e5 / 2e10
    if integrator == "adaptive":  # what joint forces see of the row, from which an estimate goes on
        jump = jump_of_forces(rest, system, rest.coordinates.row(0)[0], 0)
        np.testing.assert_allclose(jump[:, 0], -rest.traction[0, :, 0] / system.law.K_n, rtol=1e-6)


def runs_of(strengths, order=1.6):
    """Runs of joints of 10 x 40 m whose errors are c h^p of a common opening, each with a time of its own.

    A joint has 4 gaps at its corners, and further ones in 400 / h^2; nodes are 1 m apart.
    """
    time, ran = np.linspace(0.0, 9.0, 901), []

    def run(lengths):
        ran.append(dict(lengths))
        jumps, positions, joints, areas, first = [], [], {}, [], 0
        for k, (name, c) in enumerate(strengths.items()):
            h = lengths.get(name) or 0.0
            count = 400 if not h else max(4, round(400 / h**2))
            error = c * h**order * np.sin((5.0 + 2.0 * k) * time) / np.sqrt(2.0)
            jumps.append(np.repeat((np.sin(3.0 * time) / np.sqrt(2.0) + error)[:, None], count, axis=1))
            positions.append(np.stack([np.full(count, 50.0 * k), np.zeros(count), np.arange(count)], axis=1))
            areas.append(np.full(count, 400.0 / count))
            joints[name] = slice(first, first := first + count)
        jump = np.concatenate(jumps, axis=1)[:, :, None]
        return MeshRun(time, jump, np.concatenate(positions), joints, area=np.concatenate(areas))

    return run, ran


def gaps_of(lengths):
    return sum(400.0 / h**2 for h in lengths.values())


@pytest.mark.parametrize("judged_by", ["half the length", "a gap at every node"])
def test_a_joint_that_opens_little_has_fewer_gaps_and_together_they_are_the_fewest(judged_by):
    """Errors c h^1.6, c of 0.32 and 0.02 %: h_j^5.2 ~ 1 / c_j^2 has the fewest gaps that leave 1 %."""
    strengths = {"crown": 0.0032, "side": 0.0002}
    run, ran = runs_of(strengths)
    every_node = None if judged_by == "half the length" else run({})
    nodes = dict.fromkeys(strengths, Nodes(400, 1.0))
    lengths = fewest_points(run, nodes, 8.0, 0.01, every_node).lengths
    # of two joints in a whole of both, relative to which an error is 1 / sqrt(2) of that of its joint
    error = {name: c * lengths[name] ** 1.6 / np.sqrt(2.0) for name, c in strengths.items()}
    assert 0.007 < np.linalg.norm(list(error.values())) < 0.0101
    assert lengths["side"] / lengths["crown"] == pytest.approx(16.0 ** (1.0 / 2.6), rel=0.02)
    common = (0.01 * np.sqrt(2.0) / np.linalg.norm(list(strengths.values()))) ** (1.0 / 1.6)
    assert gaps_of(lengths) < 0.8 * gaps_of(dict.fromkeys(strengths, common))
    assert not any(lengths["crown"] == pytest.approx(k, abs=0.01) for k in range(1, 9))
    assert len(ran) <= 5


def test_where_no_length_keeps_the_accuracy_every_node_has_a_gap():
    run, ran = runs_of({"crown": 0.5})
    choice = fewest_points(run, {"crown": Nodes(400, 1.0)}, 8.0, 0.01)
    assert choice.lengths == {"crown": None} and choice.run is None
    assert {} not in ran and {"crown": None} not in ran


def test_two_runs_that_are_the_same_choose_no_spacing():
    run, _ = runs_of({"crown": 0.0})
    same = fewest_points(lambda lengths: run({"crown": 10.0}), {"crown": Nodes(400, 1.0)}, 8.0, 0.01)
    assert same.lengths == {"crown": None}


def test_joints_of_a_dam_have_a_spacing_each():
    raw = arch_dam(ground=False, element="hex20") | {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400.0}},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 20},
        "transient": {"finest_step": 0.001},
    }
    raw["arch_dam"]["joints"] = {"normal_stiffness": 2e10, "gaps": "corners", "spacing": {"J1": "12 m"}}
    config = parse_config(raw, "s.yaml")
    assert {name: joint.spacing for name, joint in config.every_joint.items()} == {
        name: 12.0 if name == "J1" else None for name in config.every_joint
    }
    job = with_spacing(with_automatic_spacing(Job(config, Path("s.yaml"))), {"J1": 3.0, "J2": 5.0})
    lengths = [joint.spacing for joint in job.config.every_joint.values()]
    assert lengths == [3.0, 5.0, *[None] * (len(lengths) - 2)]
    raw["arch_dam"]["joints"]["spacing"] = {"J9": 12.0}
    with pytest.raises(ConfigError, match=r"arch_dam.joints.spacing: no 'J9' is defined; defined are J1"):
        parse_config(raw, "s.yaml")


def test_check_says_that_spacing_is_left_to_the_run(tmp_path):
    raw = yaml.safe_load(EXAMPLE.read_text())
    raw["joints"]["contraction"]["spacing"] = "auto"
    raw["transient"] = {"accuracy": "1 %", "duration": "2 s"}
    raw["records"][0]["file"] = str(EXAMPLE.parent / raw["records"][0]["file"])
    path = tmp_path / "c.yaml"
    path.write_text(yaml.safe_dump(raw))
    assert "spacing: auto are (contraction); every node has one here" in " ".join(check(path).skipped)
