"""Reduction keeps what the gaps of a block need, not every node that they see."""

import dataclasses

import numpy as np
import pytest
from scipy.sparse import csr_matrix, vstack
from small_scenes import DAMPING, march, raw, reduced, scene, shaking

from romdam.config.sections.job import ModelConfig
from romdam.core.errors import MeshError
from romdam.core.scene import StaticLoads
from romdam.error.metrics import relative_l2
from romdam.fem.gaps import gap_operators
from romdam.reduction.interface import joint_interface, sees_more_nodes_than_gaps
from romdam.reduction.methods.craig_bampton import CraigBampton
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.refinement import embedding
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice


def cantilevers(element="hex20", height=8.0, **joint):
    config = raw(height, **joint)
    for block in config["blocks"].values():
        block["box"]["element"] = element
    return config


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize(
    ("element", "gaps", "discretization", "more"),
    [
        ("hex8", "nodes", "node_to_node", False),
        ("hex20", "nodes", "node_to_node", False),
        ("hex20", "corners", "node_to_node", True),
        ("hex8", "nodes", "mortar", False),
        ("tet10", "nodes", "mortar", True),
    ],
)
def test_nodes_are_retained_unless_they_are_more_than_the_gaps(element, gaps, discretization, more, friction):
    law = {"gaps": gaps, "friction": [friction, friction], "discretization": discretization}
    built = scene(cantilevers(element, **law))
    directions = 3 if friction else 1
    for name, operator in gap_operators(built, directions).items():
        interface = joint_interface(operator, built.fixed[name])
        assert sees_more_nodes_than_gaps(operator, interface, directions) is more
        report = reduced(built, modes=5).report[name]
        assert ("part" in report) is more
        if not more:
            assert report["retained_dofs"] == interface.retained.sum()


def test_a_node_on_two_joints_does_not_count_as_more():
    """Normal gaps of two joints that meet at an edge: two gaps, one node with three components."""
    edge = csr_matrix(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    interface = joint_interface(edge, np.zeros((1, 3), bool))
    assert interface.retained.sum() == 3 and not sees_more_nodes_than_gaps(edge, interface, 1)


class Retaining(CraigBampton):
    """Every node of a joint is kept, however few gaps see it."""

    def serves(self, substructure, choice):
        return True


def test_fewer_unknowns_leave_less_error():
    """Against all modes of the mesh: half the unknowns, a fraction of the error at equal modes."""
    built, dt = scene(cantilevers(gaps="corners", friction=[0.5, 0.5])), 0.0025
    ground = shaking(dt, 0.5)

    def opening(system):
        return march(system, dt, ground, integrator="modal", initial_state="static").jump

    exact, some = opening(reduced(built).system), reduced(built, modes=30).system
    model = ModelConfig(modes=30)
    retaining = reduce_scene(built, model, DAMPING, reductors=(Retaining(),)).system
    errors = [relative_l2(opening(system), exact) for system in (some, retaining)]
    assert exact[..., 0].max() > 1e-5
    assert some.size < 0.65 * retaining.size and errors[0] < 0.3 * errors[1] and errors[0] < 5e-4


def flexibility(system):
    """Of the gaps, without rigid motions."""
    k, B = system.K.diagonal(), system.B.toarray()
    elastic = k > 1.0
    return (B[:, elastic] / k[elastic]) @ B[:, elastic].T


def test_a_floating_block_answers_its_gaps_as_the_mesh_does():
    """Only the joint holds the right block: static answers are those of inertia relief."""
    config = cantilevers(gaps="corners", friction=[0.5, 0.5])
    config["supports"] = config["supports"][:1]
    built = scene(config)
    whole = reduced(built).system
    exact = flexibility(whole)
    coarse, fine = reduce_scene_twice(built, ModeChoice(count=10), DAMPING)
    for some in (coarse.system, fine.system):
        assert (some.K.diagonal() == 0.0).sum() == (whole.K.diagonal() == 0.0).sum() == 6
        assert np.abs(flexibility(some) - exact).max() < 1e-10 * np.abs(exact).max()
    low = fine.system.K.diagonal()[fine.system.parts["right"]][6:14]
    right = np.sort(whole.K.diagonal()[whole.parts["right"]])[6:14]
    assert fine.system.size > coarse.system.size and np.abs(low / right - 1.0).max() < 1e-8
    assert np.abs(1.0 - (embedding(built, coarse, fine).toarray() ** 2).sum(axis=0)).max() < 1e-7


def test_gaps_that_say_the_same_are_answered_once():
    """Means over the face, one of them twice: as many static answers as the operator has rank."""
    built = scene(cantilevers("hex8", height=16.0))
    joint = built.joints["c"]
    rows = csr_matrix(np.random.default_rng(4).dirichlet(np.ones(joint.weights[0].shape[1]), 5))
    own = {
        name: getattr(joint, name)[:6]
        for name in (
            *("position", "corner", "area", "share", "axes", "gap"),
            *("K_n", "K_nz", "K_s", "mu", "viscosity", "grout", "water"),
        )
    }
    few = dataclasses.replace(joint, weights=(csr_matrix(vstack([rows, rows[:1]])),) * 2, **own)
    built = dataclasses.replace(built, joints={"c": few}, loads=StaticLoads())
    some, whole = reduced(built, modes=4), reduced(built)
    exact = flexibility(whole.system)
    assert np.abs(flexibility(some.system) - exact).max() < 1e-9 * np.abs(exact).max()
    ground = 3  # the answers to the ground's acceleration along x, y and z
    assert [some.report[name]["retained_dofs"] for name in built.blocks] == [5 + ground] * 2


def test_residual_vectors_are_further_modes():
    """The free modes leave nothing to correct; there are at least half as many again."""
    built = scene(cantilevers(gaps="corners"))
    one, other = (reduced(built, modes=count, residual_vectors=rest) for count, rest in ((12, 0), (8, 3)))
    assert one.report["left"]["fixed_interface_modes"] == 12
    assert np.array_equal(one.system.K.diagonal(), other.system.K.diagonal())


def test_bases_are_kept_and_found(tmp_path):
    built, store = scene(cantilevers(gaps="corners")), BlockStore(tmp_path)
    made, again = (reduce_scene(built, ModeChoice(8), DAMPING, store) for _ in range(2))
    assert len(list(tmp_path.iterdir())) == 2
    assert np.array_equal(made.system.B.toarray(), again.system.B.toarray())


def test_a_loose_node_is_named_in_this_form_too():
    built = scene(cantilevers(gaps="corners"))
    left = built.blocks["left"]
    loose = dataclasses.replace(left, points=np.vstack([left.points, [5.0, 6.0, 7.5]]))
    fixed = built.fixed | {"left": np.vstack([built.fixed["left"], [False] * 3])}
    built = dataclasses.replace(built, blocks=built.blocks | {"left": loose}, fixed=fixed)
    with pytest.raises(MeshError, match=r"at \(5, 6, 7.5\) of block 'left' belongs to no element"):
        reduced(built, modes=5)
