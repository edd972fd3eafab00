"""Rows without mass and load are condensed: the same answers, from fewer factors and halves of solutions."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from romdam.config.sections.job import BoxConfig
from romdam.core.errors import ReductionError
from romdam.core.scene import Material
from romdam.fem.assembly import assemble
from romdam.geometry.boxes import box_block
from romdam.linalg.condensed import CondensedSingle, is_condensable
from romdam.linalg.factor import Factor

pytest.importorskip("pypardiso")


@pytest.fixture(scope="module")
def column():
    """K of a 10 x 10 x 30 m tet10 cantilever, and its rows below 20 m."""
    box = BoxConfig(
        origin=(0.0,) * 3, size=(10.0, 10.0, 30.0), element_size=(3.333333, 3.333333, 3.75), element="tet10"
    )
    made = box_block("b", box, Material(30e9, 0.2, 2400.0), "b")
    free = np.repeat(made.points[:, 2] > 0.0, 3)
    K = assemble(made)[0][free][:, free]
    return csr_matrix(K), np.repeat(made.points[:, 2] < 20.0, 3)[free]


@pytest.fixture(scope="module")
def solver(column):
    return CondensedSingle(*column)


def condensed(K, inner):
    """The matrix over the outer rows, dense."""
    K = K.toarray()
    return K[~inner][:, ~inner] - K[~inner][:, inner] @ np.linalg.solve(
        K[inner][:, inner], K[inner][:, ~inner]
    )


def test_forces_outside_and_inside_are_answered(column, solver):
    K, inner = column
    right = np.random.default_rng(1).standard_normal((K.shape[0], 20))
    right[:, 3] = 0.0
    right[inner, :10] = 0.0
    known = Factor(K).solve(right)
    for some in (slice(0, 10), slice(10, 20), slice(0, 20)):
        answer = solver.solve(right[:, some])
        off = np.abs(answer - known[:, some]).max(axis=0) / np.abs(known).max()
        assert off.max() < 1e-7
    assert np.abs(solver.solve(right[:, 0]) - known[:, 0]).max() < 1e-7 * np.abs(known).max()
    assert np.abs(solver.precondition(right) - known).max() > 1e-7 * np.abs(known).max()


def test_two_iterations_of_which_the_first_takes_half(column, solver, monkeypatch):
    K, inner = column
    right = np.random.default_rng(2).standard_normal((K.shape[0], 3)) * ~inner[:, None]
    calls = {"forward": 0, "backward": 0}
    for name in calls:
        half = getattr(solver._inner, name)

        def counted(f, half=half, name=name):
            calls[name] += 1
            return half(f)

        monkeypatch.setattr(solver._inner, name, counted)
    solver.solve(right)
    assert calls == {"forward": 1, "backward": 2}


def test_what_is_left_where_they_meet_is_sharp_on_what_it_was_made_for(column, solver):
    K, inner = column
    exact = condensed(K, inner)
    vectors = np.linalg.eigh(exact)[1][:, :12]
    forces = exact @ vectors
    before, sharp = solver.near, CondensedSingle(K, inner)
    sharp.sharpen(vectors)

    def off(factors):
        return np.abs(factors.solve(forces) - vectors).max(axis=0) / np.abs(vectors).max(axis=0)

    assert off(sharp.near).max() < 1e-9 < 1e-2 * off(before).max()
    other = np.random.default_rng(3).standard_normal((len(exact), 5))
    assert np.abs(sharp.near.solve(exact @ other) - other).max() < 1e-3  # and no worse anywhere else


def test_only_a_majority_that_touches_the_rest_is_condensed(column):
    K, inner = column
    assert is_condensable(K, inner)
    assert not is_condensable(K, ~inner)
    assert not is_condensable(K, np.ones_like(inner))
    assert not is_condensable(K, np.zeros_like(inner))
    with pytest.raises(ReductionError, match="are allowed"):
        CondensedSingle(K, inner, 1e3)
