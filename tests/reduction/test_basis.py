"""Every kind of basis gives what the array gives."""

import numpy as np
import pytest
from scipy.sparse import random_array

from romdam.core.basis import BlockBasis
from romdam.reduction.basis import Augmented, Dense, Lazy, Mapped

rng = np.random.default_rng(0)
LEFT, RIGHT = rng.standard_normal((30, 7)), rng.standard_normal((7, 5))
WHOLE = LEFT @ RIGHT


def mapped(array, folder):
    (folder / "basis").write_bytes(b"head" * 4 + array.tobytes())
    return Mapped.of(folder / "basis", 16, array.shape)


def inner(vectors):
    columns = vectors.shape[1]
    return BlockBasis(vectors, slice(0, columns), np.ones(columns), np.zeros((columns, 3)), {})


KINDS = {
    "dense": lambda folder: Dense(WHOLE),
    "mapped": lambda folder: mapped(WHOLE, folder),
    "lazy": lambda folder: Lazy(Dense(LEFT), RIGHT),
    "lazy over mapped": lambda folder: Lazy(mapped(LEFT, folder), RIGHT),
    "lazy over lazy": lambda folder: Lazy(Lazy(Dense(LEFT), np.eye(7)), RIGHT),
    "augmented": lambda folder: Augmented(inner(Dense(LEFT[:, :4])), LEFT[:, 4:], RIGHT),
    "augmented over mapped": lambda folder: Augmented(
        inner(mapped(LEFT[:, :4].copy(), folder)), LEFT[:, 4:], RIGHT
    ),
    "augmented by nothing": lambda folder: Augmented(inner(Dense(LEFT)), LEFT[:, :0], RIGHT),
    "lazy over augmented": lambda folder: Lazy(
        Augmented(inner(Dense(LEFT[:, :4])), LEFT[:, 4:], np.eye(7)), RIGHT
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_rows_and_products_are_those_of_the_array(kind, tmp_path):
    made = KINDS[kind](tmp_path)
    assert made.shape == WHOLE.shape and made.nbytes == WHOLE.nbytes
    sparse, some = random_array((4, 30), density=0.3, format="csr", rng=rng), np.array([3, 0, 17])
    pairs = [
        (made.rows(slice(5, 9)), WHOLE[5:9]),
        (made.rows(some), WHOLE[some]),
        (made.rows(), WHOLE),
        (made.apply(np.ones(5)), WHOLE @ np.ones(5)),
        (made.apply(np.ones((5, 2))), WHOLE @ np.ones((5, 2))),
        (made.under(sparse), sparse @ WHOLE),
        (made.project(np.ones(30)), WHOLE.T @ np.ones(30)),
        (made.project(WHOLE), WHOLE.T @ WHOLE),
    ]
    for found, known in pairs:
        assert isinstance(found, np.ndarray) and found.shape == known.shape
        assert np.abs(found - known).max() < 1e-13 * np.abs(known).max()


def test_a_mapped_basis_cannot_be_changed(tmp_path):
    with pytest.raises(ValueError, match="read-only"):
        mapped(WHOLE, tmp_path).rows()[0, 0] = 1.0
