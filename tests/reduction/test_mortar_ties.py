"""Blocks tied where their meshes do not match: constant stress passes, and they are one structure."""

import dataclasses
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import small_scenes
from mortar_weights import grid_tie, tied
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh
from small_scenes import DAMPING, full, march, raw, reduced, shaking

from romdam.config.sections.job import BoxConfig
from romdam.config.sections.joints import JointConfig
from romdam.config.sections.water import WaterConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import FacePressure, Material, Probe, Scene, StaticLoads, StressNodes, StressSites, Tie
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import Assembly, assemble
from romdam.fem.loads import static_force
from romdam.fem.parts import assemble_part, basis_over_unknowns, gather, unknowns
from romdam.fem.stress import modal_stress, observed_stress, stress_operators
from romdam.geometry.boxes import box_block
from romdam.geometry.facets import area_vectors, boundary_facets
from romdam.geometry.meshes.files import MeshFiles
from romdam.linalg.solvers import Solving
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.refinement import embedding, much_finer
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.staging import staged_displacement
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.joints import build_joint
from romdam.scene.reservoir.build import build_reservoir
from romdam.scene.ties import scene_parts
from romdam.timestepping.equilibrium import static_equilibrium

CONCRETE = Material(E=30e9, nu=0.2, rho=2400.0)


def box(name, origin, size, element_size, material=CONCRETE):
    config = BoxConfig(origin=origin, size=size, element_size=element_size)
    return box_block(name, config, material, "s.yaml")


def scene(*blocks, held=(), **more):
    """Blocks without joints; of each one in `held` the nodes at its foot are held in all components."""
    fixed = {
        b.name: np.tile((b.points[:, 2:] == b.points[:, 2].min()) & (b.name in held), (1, 3)) for b in blocks
    }
    return Scene(**({"blocks": {b.name: b for b in blocks}, "joints": {}, "fixed": fixed} | more))


def tower(coarse=3, fine=4, height=3.0, held=("low",), **more):
    """Two boxes of 2 m x 2 m on each other with so many elements across; the upper one is the slave."""
    low = box("low", (0, 0, 0), (2, 2, height), 2 / coarse if height == 2 else (2 / coarse, 2 / coarse, 0.5))
    high = box("high", (0, 0, height), (2, 2, height), (2 / fine, 2 / fine, 0.5))
    return tied(scene(low, high, held=held, **more), grid_tie("t", high, low, 2, height))


def stress_of(A, material=CONCRETE):
    lam = material.E * material.nu / (1 + material.nu) / (1 - 2 * material.nu)
    strain = (A + A.T) / 2
    return lam * np.trace(strain) * np.eye(3) + material.E / (1 + material.nu) * strain


def patch(built):
    """Force that u = A x leaves beyond the traction on the outer faces, of the largest traction."""
    (part,) = scene_parts(built).values()
    A = np.random.default_rng(8).standard_normal((3, 3)) * 1e-4
    points = part.mesh(built.blocks).points
    u, outer = (points[: part.nodes] @ A.T).ravel(), {}
    for name, block in built.blocks.items():
        assert np.abs(part.spread(name) @ u - (block.points @ A.T).ravel()).max() < 1e-16
        facets = boundary_facets(block.cells, block.element)
        x, ends = block.points[facets], (points.min(axis=0), points.max(axis=0))
        on = np.any([np.isclose(x, end).all(axis=1).any(axis=1) for end in ends], axis=0)
        force = np.zeros_like(block.points)
        np.add.at(force, facets[on], area_vectors(block.points, facets[on]) @ stress_of(A))
        outer[name] = force.ravel()
    traction = gather(part, outer)
    K = assemble_part(part, Assembly(built.blocks))[0]
    return np.abs(K @ u - traction).max() / np.abs(traction).max()


@pytest.mark.parametrize("sizes", [(3, 4), (4, 3), (2, 5)])
def test_constant_stress_passes(sizes):
    """The coarser or the finer mesh may be the slave."""
    assert patch(tower(*sizes, held=())) < 1e-12


def test_rigid_motion_of_the_whole_costs_nothing():
    built = tower(held=())
    (part,) = scene_parts(built).values()
    K, M = assemble_part(part, Assembly(built.blocks))
    x = part.mesh(built.blocks).points[: part.nodes]
    motions = np.column_stack(
        [np.tile(e, len(x)) for e in np.eye(3)] + [np.cross(e, x).ravel() for e in np.eye(3)]
    )
    assert np.abs(K @ motions).max() < 1e-13 * abs(K).max() * np.abs(motions).max() * 10
    assert motions[:, 0] @ M @ motions[:, 0] == pytest.approx(2400.0 * 2 * 2 * 6, rel=1e-12)
    omega2 = np.sort(reduced(built).system.K.diagonal())
    assert (omega2[:6] == 0.0).all() and omega2[6] > 1e3


def lowest(built, count=6):
    system = full(built)
    return np.sqrt(eigsh(system.K, count, system.M, sigma=0.0, return_eigenvectors=False)) / 2 / np.pi


def test_frequencies_come_to_those_of_one_mesh():
    """Second order in the element size, as the elements are: the slope is 2.4 between 3 and 6 elements."""
    apart = []
    for n in (3, 6):
        one = scene(box("one", (0, 0, 0), (2, 2, 6), (2 / n, 2 / n, 1 / n)), held=("one",))
        low = box("low", (0, 0, 0), (2, 2, 3), (2 / n, 2 / n, 1 / n))
        high = box("high", (0, 0, 3), (2, 2, 3), (2 / (n + 1), 2 / (n + 1), 1 / n))
        pair = tied(scene(low, high, held=("low",)), grid_tie("t", high, low, 2, 3.0))
        apart.append(np.abs(lowest(pair) / lowest(one) - 1).max())
    assert apart[1] < 6e-4 and np.log2(apart[0] / apart[1]) > 2.0


def foot(**more):
    """Two cantilevers on a base that is meshed apart: a joint between them, both slaves at their feet."""
    base = box("base", (0, -3, -2), (3, 6, 2), (1, 1, 1))
    left = box("left", (0, -2, 0), (2, 2, 4), (0.5, 1, 1))
    right = box("right", (0, 0, 0), (2, 3, 4), (0.5, 1, 1))
    whole = scene(base, left, right, held=("base",), **more)
    whole = tied(whole, grid_tie("l", left, base, 2, 0.0), grid_tie("r", right, base, 2, 0.0))
    config = JointConfig(between=("left", "right"), normal_stiffness=30e9)
    parts = tuple(scene_parts(whole).values())
    joint = build_joint("c", config, whole.blocks, whole.fixed, Path(), "s.yaml", parts)
    push = [(name, whole.blocks[name].faces[face]) for name, face in (("left", "ymin"), ("right", "ymax"))]
    return dataclasses.replace(
        whole,
        joints={"c": joint},
        loads=StaticLoads(
            gravity=np.array([0.0, 0.0, -9.81]),
            pressures=tuple(FacePressure(name, facets, 1e4) for name, facets in push),
        ),
        probes=(Probe("foot", "left", int(whole.ties[0].nodes[0][0])), Probe("top", "right", 0)),
    )


def test_gaps_whose_nodes_follow_alike_are_dropped():
    """At the foot of a joint both sides' nodes follow the same ones of the base: 5 of 25 pairs."""
    assert len(foot().joints["c"].gap) == 20


def test_all_modes_march_as_the_full_order_does():
    """A joint whose blocks are tied at their feet, opened by one record in both models."""
    built, dt = foot(), 0.0025
    ground = shaking(dt, duration=0.3, amplitude=20.0)
    mesh, model = full(built), reduced(built)
    exact = eigh(mesh.K.toarray(), mesh.M.toarray(), eigvals_only=True)
    assert len(exact) == model.system.size
    assert np.abs(np.sqrt(np.sort(model.system.K.diagonal()) / exact) - 1).max() < 1e-8
    options = {"integrator": "generalized_alpha", "rho_inf": 0.9, "initial_state": "static"}
    whole, own = march(mesh, dt, ground, **options), march(model.system, dt, ground, **options)
    assert whole.jump.max() > 1e-4
    assert np.linalg.norm(own.jump - whole.jump) < 1e-6 * np.linalg.norm(whole.jump)
    assert np.abs(own.disp - whole.disp).max() < 1e-6 * np.abs(whole.disp).max()


def test_a_reduced_basis_is_orthonormal_and_statically_exact():
    built = foot()
    mesh, model = full(built), reduced(built, cutoff=60.0)
    T, k = basis_over_unknowns(built, model.basis, model.system.size), model.system.K.diagonal()
    assert np.abs(T.T @ (mesh.M @ T) - np.eye(len(k))).max() < 1e-8
    for name, matrix in unknowns(built).of_block.items():
        assert np.abs(matrix @ T - model.basis[name].vectors.rows()).max() < 1e-12 * np.abs(T).max()
    gaps = [static_equilibrium(system, 1e-10)[1] for system in (mesh, model.system)]
    assert gaps[0].force.max() > 0.0
    assert np.abs(gaps[1].jump - gaps[0].jump).max() < 1e-7 * np.abs(gaps[0].jump).max()


def test_multigrid_and_finer_models_know_the_slaves():
    built = foot()
    own, known = (
        reduce_scene(built, ModeChoice(cutoff=60.0, solving=Solving(name)), DAMPING)
        for name in ("multigrid", "superlu")
    )
    assert np.abs(own.system.K.diagonal()[:10] / known.system.K.diagonal()[:10] - 1).max() < 1e-8
    fine = reduce_scene(built, much_finer(ModeChoice(cutoff=60.0)), DAMPING)
    E = embedding(built, known, fine).toarray()
    assert np.abs(E.T @ E - np.eye(E.shape[1])).max() < 1e-9


def test_reactions_balance_what_acts():
    """What the base takes is weight and pressure, force and moment; joint and ties are within."""
    built = foot()
    mesh = full(built)
    u, gaps = static_equilibrium(mesh, 1e-10)
    total, moment = np.zeros(3), np.zeros(3)
    for name, matrix in unknowns(built).of_block.items():
        block = built.blocks[name]
        force = (assemble(block)[0] @ (matrix @ u)).reshape(-1, 3)
        total += force[built.fixed[name].any(axis=1)].sum(axis=0)
        moment += np.cross(block.points, force)[built.fixed[name].any(axis=1)].sum(axis=0)
    loads = [static_force(built, name).reshape(-1, 3) for name in built.blocks]
    acting = sum(
        load[~built.fixed[name].any(axis=1)].sum(axis=0)
        for name, load in zip(built.blocks, loads, strict=True)
    )
    turning = sum(
        np.cross(block.points, load)[~built.fixed[name].any(axis=1)].sum(axis=0)
        for (name, block), load in zip(built.blocks.items(), loads, strict=True)
    )
    assert gaps.force.max() > 0.0
    assert np.abs(total + acting).max() < 1e-9 * np.abs(acting).max()
    assert np.abs(moment + turning).max() < 1e-9 * np.abs(turning).max()


def crossing(order=("c", "b")):
    """Blocks b and c, side by side on a, all meshed apart; at their common foot nodes follow in two ties."""
    blocks = {
        "a": box("a", (0, 0, 0), (4, 2, 1), (1, 1, 0.5)),
        "b": box("b", (0, 0, 1), (2, 2, 1), (2 / 3, 2 / 3, 0.5)),
        "c": box("c", (2, 0, 1), (2, 2, 1), (0.5, 0.4, 0.25)),
    }
    upper, lower = (blocks[name] for name in order)
    feet = [grid_tie(f"{name} on a", blocks[name], blocks["a"], 2, 1.0) for name in "bc"]
    return scene(*blocks.values(), held=("a",)), (*feet, grid_tie("side", upper, lower, 0, 2.0))


@pytest.mark.parametrize("order", [("c", "b"), ("b", "c")])
def test_nodes_follow_nodes_that_follow(order):
    """Linear fields pass every tie; the blocks are one body, which the foot of the lowest holds."""
    built, ties = crossing(order)
    (part,) = scene_parts(tied(built, *ties)).values()
    assert part.every_node - part.nodes == len(
        np.unique(np.concatenate([t.nodes[0] + 1000 * (t.blocks[0] == "c") for t in ties]))
    )
    A = np.random.default_rng(8).standard_normal((3, 3)) * 1e-4
    free = {name: np.zeros_like(held) for name, held in built.fixed.items()}
    (loose,) = scene_parts(tied(dataclasses.replace(built, fixed=free), *ties)).values()
    u = (loose.mesh(built.blocks).points[: loose.nodes] @ A.T).ravel()
    for name, block in built.blocks.items():
        assert np.abs(loose.spread(name) @ u - (block.points @ A.T).ravel()).max() < 1e-16
    whole = patch(tied(dataclasses.replace(built, fixed=free), *ties))
    assert (
        whole < 1e-12 if order == ("c", "b") else whole == pytest.approx(0.084, abs=0.001)
    )  # the finer, or not
    assert part.stands_free(tied(built, *ties))
    assert not loose.stands_free(tied(dataclasses.replace(built, fixed=free), *ties))
    assert (np.sort(reduced(tied(built, *ties)).system.K.diagonal()) > 1e3).all()


def side_by_side(areas=True):
    """Two boxes of one mesh in y and z, grown together, and both slaves on a third."""
    base = box("base", (0, 0, 0), (3, 2, 1), (1.5, 2 / 3, 0.5))
    left = box("left", (0, 0, 1), (1, 2, 1), (0.25, 0.5, 0.5))
    right = box("right", (1, 0, 1), (2, 2, 1), (1, 0.5, 0.5))
    feet = [grid_tie(block.name, block, base, 2, 1.0) for block in (left, right)]
    common = grid_tie("side", left, right, 0, 1.0)
    common = dataclasses.replace(common, weights=None, area=None)
    feet = [foot if areas else dataclasses.replace(foot, area=None) for foot in feet]
    return tied(scene(base, left, right), *feet, common)


def test_a_face_that_is_tied_is_not_wet():
    built, ties = crossing()
    for block, face, dry in (("c", "xmin", True), ("b", "xmax", True), ("c", "ymin", False)):
        keys = {"level": 1.7, "faces": [{"block": block, "face": face}], "upstream": (0, -1, 0)}
        water = WaterConfig(model="westergaard", **keys)
        make = partial(
            build_reservoir, water, built.blocks, ties, built.fixed, MeshFiles(Path(".")), "s.yaml"
        )
        if dry:
            with pytest.raises(ConfigError, match="facets lie in the contact 'side' with a neighbour"):
                make()
        else:
            assert make() is not None


def test_faces_whose_nodes_are_one_are_one_slave_face():
    """By tributary area constant stress passes the common nodes of two slave faces; not by equal shares."""
    assert patch(side_by_side()) < 1e-12
    assert patch(side_by_side(areas=False)) > 1e-3


def test_a_slave_node_that_is_one_with_a_master_node_stays_so():
    """The master's neighbour, grown together with it and with the slave, holds their common edge."""
    built = side_by_side()
    base, left, _ = built.blocks.values()
    edge = [np.flatnonzero(np.isclose(b.points[:, [0, 2]], [0.0, 1.0]).all(axis=1)) for b in (base, left)]
    ends = [nodes[[0, -1]] for nodes in edge]  # of edges that are meshed apart
    (part,) = scene_parts(tied(built, Tie("ends", ("base", "left"), (ends[0], ends[1])))).values()
    (before,) = scene_parts(built).values()
    assert (part.number["left"][ends[1]] == part.number["base"][ends[0]]).all()
    assert (part.number["left"][ends[1]] < part.nodes).all()
    assert part.nodes == before.nodes and part.every_node == before.every_node - 2


def test_a_support_on_a_slave_node_holds_it_in_its_components_only():
    """Rollers along x = 0 of both boxes: they slide along, and in the other components the tie is whole."""
    built = tower(held=())
    rollers = {n: np.isclose(b.points[:, :1], 0.0) * [True, False, False] for n, b in built.blocks.items()}
    (part,), (loose,) = (scene_parts(s).values() for s in (dataclasses.replace(built, fixed=rollers), built))
    assert part.nodes == loose.nodes
    slaves = built.ties[0].nodes[0]
    held = rollers["high"][slaves].ravel()
    rows = [p.spread("high")[(3 * slaves[:, None] + np.arange(3)).ravel()] for p in (part, loose)]
    assert abs(rows[0][held]).sum() == 0.0 and held.sum() == 5
    assert abs(rows[0][~held] - rows[1][~held]).max() == 0.0
    x = part.mesh(built.blocks).points[: part.nodes]
    u = (x @ np.diag([1e-4, -2e-4, 3e-4])).ravel()  # it leaves x = 0 where it is
    assert (
        np.abs(
            part.spread("high") @ u - (built.blocks["high"].points @ np.diag([1e-4, -2e-4, 3e-4])).ravel()
        ).max()
        < 1e-16
    )


def test_nodes_that_follow_each_other_in_a_circle_are_refused():
    built, ties = crossing()
    back = grid_tie("back", built.blocks["a"], built.blocks["b"], 2, 1.0)
    back = dataclasses.replace(back, nodes=ties[0].nodes[::-1], weights=ties[0].weights.T.tocsr(), area=None)
    with pytest.raises(ConfigError) as caught:
        scene_parts(tied(built, *ties, back))
    message = str(caught.value)
    assert message.startswith("ties.b on a, ties.back: ") and "node 30 of block 'a'" in message
    assert "limit 0; give two of the faces the same nodes" in message


def test_bases_are_kept_and_found_by_their_weights(tmp_path):
    built, store = foot(), BlockStore(tmp_path)
    made = reduce_scene(built, ModeChoice(cutoff=40.0), DAMPING, store)
    again = reduce_scene(built, ModeChoice(cutoff=40.0), DAMPING, store)
    assert len(list(tmp_path.iterdir())) == len(built.blocks)
    assert np.array_equal(made.system.B.toarray(), again.system.B.toarray())
    weights = built.ties[0].weights.copy()
    weights.data = np.roll(weights.data, 1)
    other = dataclasses.replace(
        built, ties=(dataclasses.replace(built.ties[0], weights=weights), built.ties[1])
    )
    reduce_scene(other, ModeChoice(cutoff=40.0), DAMPING, store)
    assert len(list(tmp_path.iterdir())) == 2 * len(built.blocks)


def test_weight_and_stress_are_those_of_the_mesh():
    """Staged weight from the basis and from the mesh; stress at slave nodes of any motion."""
    sites = StressSites(
        {n: StressNodes(np.arange(9), np.zeros((9, 3)), np.zeros((9, 3))) for n in ("left", "base")},
        (),
        {},
        None,
    )
    base = foot()
    loads = dataclasses.replace(base.loads, staged_weight=True)
    built = dataclasses.replace(base, loads=loads, stress=sites)
    model = reduced(built, cutoff=60.0)
    by_mesh, by_basis = staged_displacement(built), staged_displacement(built, model.basis)
    for name in built.blocks:
        assert np.abs(by_mesh[name] - by_basis[name]).max() < 1e-8 * np.abs(by_mesh[name]).max()
    q = np.random.default_rng(1).standard_normal(model.system.size)
    whole = observed_stress(built) @ basis_over_unknowns(built, model.basis, len(q)) @ q
    own = [
        (stress @ q[model.basis[name].columns]).ravel()
        for name, stress in modal_stress(stress_operators(built), model.basis).items()
    ]
    assert np.abs(np.concatenate(own) - whole).max() < 1e-10 * np.abs(whole).max()


@pytest.mark.parametrize("discretization", ["node_to_node", "mortar"])
def test_held_slave_nodes_are_shaken_with_the_others(discretization):
    """Two blocks tied side by side on one support: the ground's load is all that free nodes have of M r."""
    config = raw(normal_stiffness=1e9)
    config["blocks"]["third"] = {"material": "concrete", "box": dict(config["blocks"]["right"]["box"])}
    config["blocks"]["third"]["box"]["origin"] = [0, 6, 0]
    config["supports"].append({"block": "third", "face": "zmin"})
    config["ties"] = {"t": {"between": ["right", "third"], "discretization": discretization}}
    built = small_scenes.scene(config)
    load, exact = assemble_full(built, DAMPING).load.sum(axis=0), np.zeros(3)
    for name, block in built.blocks.items():
        inertia = assemble(block)[1] @ np.tile(np.eye(3), (len(block.points), 1))
        exact += inertia.reshape(-1, 3, 3)[~built.fixed[name].all(axis=1)].sum(axis=(0, 1))
    np.testing.assert_allclose(load, exact, rtol=1e-12)
