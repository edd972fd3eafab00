"""Corrections of the open-joint modes: nearer to the mesh, still a basis."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csr_matrix
from small_scenes import DAMPING, raw, scene

from romdam.config.sections.job import ModelConfig
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import assemble_mass
from romdam.linalg.dense import independent
from romdam.reduction.methods.residual_vectors import FINER_LEAST, larger
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice


def frequencies(model):
    made = reduce_scene(scene(raw()), ModelConfig(**model), DAMPING)
    return np.sort(np.sqrt(made.system.K.diagonal())) / (2.0 * np.pi), made


@pytest.mark.parametrize("model", [{"modes": 6}, {"cutoff": 300.0}])
def test_corrected_frequencies_are_far_nearer_to_the_mesh_and_never_below_it(model):
    full = assemble_full(scene(raw()), DAMPING)
    exact = np.sqrt(eigh(full.K.toarray(), full.M.toarray(), eigvals_only=True)[:10]) / (2.0 * np.pi)
    plain, _ = frequencies(model)
    corrected, made = frequencies(model | {"residual_vectors": 8})
    assert made.report["left"]["residual_vectors"] == 8
    assert (corrected[:10] >= exact * (1.0 - 1e-9)).all()
    assert ((corrected[:10] - exact) <= 0.05 * (plain[:10] - exact) + 1e-7 * exact).all()


def test_corrected_bases_are_orthonormal_to_round_off():
    """One pass of orthogonalisation leaves 1e-9 of what the residual vectors have in common."""
    built = scene(raw())
    for made in reduce_scene_twice(built, ModelConfig(modes=3, residual_vectors=8), DAMPING):
        for name, block in built.blocks.items():
            T = made.basis[name].vectors.rows()
            assert np.abs(T.T @ (assemble_mass(block) @ T) - np.eye(T.shape[1])).max() < 1e-13
        assert made.system.size < assemble_full(built, DAMPING).size


def test_of_answers_that_are_nothing_no_residual_vector_is_left():
    M = csr_matrix(np.diag([1.0, 2.0, 3.0]))
    none = independent(np.zeros((3, 2)), M)
    assert none.shape == (3, 0)
    assert independent(none, M).shape == (3, 0)
    one = independent(np.array([[1.0, 2.0], [1.0, 2.0], [0.0, 0.0]]), M)
    np.testing.assert_allclose(np.abs(one[:, 0]), np.array([1.0, 1.0, 0.0]) / np.sqrt(3.0), rtol=1e-14)


def test_dependent_residual_vectors_are_dropped():
    _, made = frequencies({"modes": "all", "residual_vectors": 8})
    assert made.report["left"]["residual_vectors"] == 0
    _, made = frequencies({"modes": 0, "residual_vectors": 500})
    assert made.system.size <= assemble_full(scene(raw()), DAMPING).size


@pytest.mark.parametrize(
    ("lengths", "kept"),
    [
        ((1e-3, 1e-5, 5e-7), [0, 1]),
        ((5e-7, 2e-7, 1e-8), [0, 1]),  # of a basis that lacks little
        ((1e-8, 1e-9, 0.0), []),
    ],
)
def test_residual_vectors_that_are_round_off_beside_the_others_are_left_out(lengths, kept):
    D, mass = np.diag(lengths), csr_matrix(np.eye(3))
    omega2 = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(larger(D, mass, omega2, FINER_LEAST), D[:, kept])
    np.testing.assert_array_equal(larger(D, mass, omega2, 0.0), D)
