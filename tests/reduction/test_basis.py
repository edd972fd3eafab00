"""Every kind of basis gives what the array gives."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import random_array

from romdam.core.basis import BlockBasis
from romdam.linalg import dense
from romdam.reduction.basis import Augmented, Dense, Lazy, Mapped, Product, Scaled, Turn, factored

rng = np.random.default_rng(0)
LEFT, RIGHT = rng.standard_normal((30, 7)), rng.standard_normal((7, 5))
WHOLE = LEFT @ RIGHT
NONE = np.arange(0)
FACTORS = np.array([2.0, -1.0, 0.5, 3.0, 1e-3])
MIXED, PLAIN = (Turn(np.arange(7), mix, NONE, NONE, mix.shape[1]) for mix in (RIGHT, np.eye(7)))


def mapped(array, folder):
    (folder / "basis").write_bytes(b"head" * 4 + array.tobytes())
    return Mapped.of(folder / "basis", 16, array.shape)


def inner(vectors, massless=0):
    columns = vectors.shape[1]
    return BlockBasis(vectors, slice(0, columns), np.ones(columns), np.zeros((columns, 3)), {}, massless)


KINDS = {
    "dense": lambda folder: Dense(WHOLE),
    "mapped": lambda folder: mapped(WHOLE, folder),
    "lazy": lambda folder: Lazy(Dense(LEFT), MIXED),
    "lazy over mapped": lambda folder: Lazy(mapped(LEFT, folder), MIXED),
    "lazy over lazy": lambda folder: Lazy(Lazy(Dense(LEFT), PLAIN), MIXED),
    "augmented": lambda folder: Augmented(inner(Dense(LEFT[:, :4])), LEFT[:, 4:], RIGHT),
    "augmented over mapped": lambda folder: Augmented(
        inner(mapped(LEFT[:, :4].copy(), folder)), LEFT[:, 4:], RIGHT
    ),
    "augmented by nothing": lambda folder: Augmented(inner(Dense(LEFT)), LEFT[:, :0], RIGHT),
    "product": lambda folder: Product(Dense(LEFT), RIGHT),
    "product over mapped": lambda folder: Product(mapped(LEFT, folder), RIGHT),
    "lazy over product": lambda folder: Lazy(Product(Dense(LEFT), np.eye(7)), MIXED),
    "scaled product": lambda folder: Scaled(Product(Dense(LEFT), RIGHT / FACTORS), FACTORS),
    "lazy over augmented": lambda folder: Lazy(
        Augmented(inner(Dense(LEFT[:, :4])), LEFT[:, 4:], np.eye(7)), MIXED
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


def test_coordinates_that_are_kept_are_not_mixed():
    """Old coordinates 5, 0 and 2 are mixed to three new ones; the others come after, out of order."""
    turn = Turn(np.array([5, 0, 2]), RIGHT[:3, :3], np.array([1, 3, 4, 6]), np.array([8, 3, 5, 4]), 9)
    matrix = np.zeros((7, 9))
    matrix[[5, 0, 2], :3] = RIGHT[:3, :3]
    matrix[[1, 3, 4, 6], [8, 3, 5, 4]] = 1.0
    made, known = Lazy(Dense(LEFT), turn), LEFT @ matrix
    q = rng.standard_normal((9, 2))
    for found, array in (
        (made.rows(), known),
        (made.apply(q), known @ q),
        (made.apply(q[:, 0]), known @ q[:, 0]),
        (made.project(known), known.T @ known),
    ):
        np.testing.assert_allclose(found, array, rtol=0.0, atol=1e-13 * np.abs(array).max())


def test_a_mapped_basis_cannot_be_changed(tmp_path):
    with pytest.raises(ValueError, match="read-only"):
        mapped(WHOLE, tmp_path).rows()[0, 0] = 1.0


@pytest.mark.parametrize("massless", [0, 12])
def test_a_finer_basis_has_the_motions_of_the_one_that_it_contains(massless):
    """Three modes and further vectors, with and without mass; two vectors more make one mode more.

    What is without mass gives up what it has of the new vector, as `with_more_without_mass` has it.
    """
    modes, left = 3, rng.standard_normal((30, 17))
    k = modes + massless
    others = np.r_[:modes, k : k + 2]
    new, turn = rng.standard_normal((5, 1)), rng.standard_normal((4, 4))
    mix = np.zeros((k + 2, k + 1))
    mix[others, : modes + 1] = np.hstack([np.eye(5, modes), new]) @ turn
    if massless:
        known = rng.standard_normal((massless, 1))
        mix[modes:k, modes + 1 :] = np.eye(massless) + 0.1 * known @ known.T
        mix[others, modes + 1 :] = new @ known.T
    coarse = inner(Dense(left[:, :k]), massless)
    finer = Augmented(coarse, left[:, k : k + 2], mix)
    whole, operator = left[:, : k + 2] @ mix, random_array((9, 30), density=0.3, format="csr", rng=rng)
    for found, known in (
        (finer.rows() @ finer.within, left[:, :k]),
        (finer.rows(), whole),
        (finer.under(operator), operator @ whole),
    ):
        assert np.abs(found - known).max() < 1e-12 * np.abs(whole).max()


@pytest.mark.parametrize("kind", KINDS)
def test_a_basis_that_is_kept_as_a_product_says_of_what(kind, tmp_path):
    made = KINDS[kind](tmp_path)
    if "product" not in kind:
        assert factored(made) is None
        return
    left, mix = factored(made)
    np.testing.assert_allclose(left.rows() @ mix, WHOLE, atol=1e-13)
    np.testing.assert_array_equal(left.rows(), LEFT)


def test_the_operator_on_a_finer_basis_is_made_of_that_on_the_other():
    fine = Augmented(inner(Dense(LEFT[:, :4])), LEFT[:, 4:], RIGHT)
    operator = random_array((4, 30), density=0.3, format="csr", rng=rng)
    of_inner = operator @ LEFT[:, :4]
    np.testing.assert_allclose(fine.under(operator, of_inner), operator @ WHOLE, atol=1e-13)


def test_a_product_with_a_triangle_is_that_with_all_its_zeros(monkeypatch):
    """Some columns at a time, of which only rows that are not zero are taken."""
    monkeypatch.setattr(dense, "_ABREAST", 2)
    triangle = np.triu(rng.standard_normal((7, 7)))[rng.permutation(7)]
    np.testing.assert_allclose(dense.product(LEFT, triangle), LEFT @ triangle, atol=1e-13)
    np.testing.assert_allclose(dense.product(LEFT, RIGHT), LEFT @ RIGHT, atol=1e-13)


@pytest.mark.skipif(
    not Path("/proc/self/smaps").exists(), reason="the memory of a mapping is Linux's to tell"
)
def test_a_mapped_basis_does_not_stay_in_memory(tmp_path):
    array = rng.standard_normal((500, 1000))
    made, sparse = mapped(array, tmp_path), random_array((4, 500), density=0.3, format="csr", rng=rng)

    def resident():
        """Bytes of the file that stand in memory."""
        lines = Path("/proc/self/smaps").read_text().splitlines()
        at = next(k for k, line in enumerate(lines) if line.endswith(str(tmp_path / "basis")))
        return 1024 * int(next(line for line in lines[at:] if line.startswith("Rss:")).split()[1])

    rows = made.rows()
    assert (rows == array).all() and resident() > 0
    for use in (
        lambda: made.apply(np.ones(1000)),
        lambda: made.project(np.ones(500)),
        lambda: made.under(sparse),
    ):
        use()
        assert resident() == 0
    assert (rows == array).all()  # read again
