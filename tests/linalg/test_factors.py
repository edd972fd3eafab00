"""Thin factors of matrices whose rank is known, and sparse matrices of dense ones."""

import numpy as np
import pytest

from romdam.linalg.dense import factors, sparse

RNG = np.random.default_rng(7)


def of_rank(rank, rows=90, columns=40):
    return RNG.standard_normal((rows, rank)) @ RNG.standard_normal((rank, columns))


@pytest.mark.parametrize("rank", [1, 5, 30])
def test_the_rank_is_found_and_every_column_kept_however_it_is_scaled(rank):
    A = of_rank(rank) * 10.0 ** RNG.uniform(-12.0, 12.0, 40)
    left, right = factors(A)
    assert left.shape == (90, rank) and right.shape == (rank, 40)
    off = np.linalg.norm(left @ right - A, axis=0) / np.linalg.norm(A, axis=0)
    assert off.max() < 2e-7  # single precision, as files keep it


def test_columns_of_zeros_stay_zeros():
    A = of_rank(5)
    A[:, [0, 17]] = 0.0
    left, right = factors(A)
    np.testing.assert_allclose(left @ right, A, atol=1e-7 * np.abs(A).max())
    assert (right[:, [0, 17]] == 0.0).all()


@pytest.mark.parametrize("A", [of_rank(40), np.zeros((0, 4)), np.zeros((4, 0)), of_rank(31)])
def test_where_it_would_gain_nothing_the_matrix_stays_as_it_is(A):
    left, right = factors(A)
    assert left is A
    np.testing.assert_array_equal(right, np.eye(A.shape[1]))


def test_no_stress_at_all_has_no_combinations():
    left, right = factors(np.zeros((6, 8)))
    assert left.shape == (6, 0) and right.shape == (0, 8)


def test_few_rows_need_no_more_combinations_than_they_are():
    A = RNG.standard_normal((6, 60))
    left, right = factors(A)
    assert right.shape == (6, 60)
    np.testing.assert_allclose(left @ right, A, atol=1e-7)


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_sparse_matrix_has_what_is_not_zero_in_its_place(order):
    A = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [-1.0, np.nan, 3.0], [0.0, 0.0, 1e-300]], order=order)
    made = sparse(A)
    np.testing.assert_array_equal(made.toarray(), A)
    assert made.indptr.tolist() == [0, 1, 1, 4, 5] and made.indices.tolist() == [1, 0, 1, 2, 2]
    assert sparse(np.zeros((0, 3))).shape == (0, 3) and sparse(np.zeros((2, 0))).nnz == 0
