"""A matrix of which only the upper triangle is kept is the matrix, in products and for every solver."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, random_array, triu

from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import Solving, make_solver
from romdam.linalg.symmetric import Symmetric


@pytest.fixture
def matrix():
    """Symmetric positive definite, (60, 60)."""
    rough = random_array((60, 60), density=0.1, rng=np.random.default_rng(0), format="csr").toarray()
    return csr_matrix(rough + rough.T + 30.0 * np.eye(60))


@pytest.mark.parametrize("shape", [(60,), (60, 1), (60, 16), (60, 37), (60, 0)])
def test_products_are_the_matrix_s(matrix, shape):
    right = np.random.default_rng(1).standard_normal(shape)
    np.testing.assert_allclose(Symmetric(matrix) @ right, matrix @ right, rtol=1e-13, atol=1e-13)


def test_both_triangles_come_back_bit_for_bit(matrix):
    kept = Symmetric(csr_matrix(triu(matrix)))
    assert np.array_equal(kept.whole().toarray(), matrix.toarray())
    assert kept.upper.nnz < 0.6 * matrix.nnz


@pytest.mark.parametrize("name", ["superlu", "multifrontal", "pardiso", "pardiso_single", "multigrid"])
def test_every_solver_takes_it(matrix, name):
    pytest.importorskip(
        {"superlu": "scipy", "multifrontal": "scipy", "multigrid": "scipy"}.get(name, "pypardiso")
    )
    motions = Motions(np.arange(60), np.random.default_rng(2).standard_normal((60, 6)))
    right = np.random.default_rng(3).standard_normal((60, 5))
    found = make_solver(Symmetric(matrix), motions, 5, Solving(name), "b").solve(right)
    np.testing.assert_allclose(matrix @ found, right, atol=1e-9)
