"""Nested dissection and Cholesky factors by fronts, on graphs and meshes of any shape."""

import numpy as np
import pytest
from scipy.sparse import block_diag, csr_matrix, eye_array, random_array

from romdam.config.sections.job import BoxConfig
from romdam.core.errors import ReductionError
from romdam.core.scene import Material
from romdam.fem.assembly import assemble
from romdam.geometry.boxes import box_block
from romdam.linalg.dissection import dissected
from romdam.linalg.factor import Factor
from romdam.linalg.multifrontal import Multifrontal


def mesh(element, held=True):
    """K of a cantilever, its front held in y alone, and the node of every row."""
    box = BoxConfig(origin=(0.0,) * 3, size=(8.0, 6.0, 20.0), element_size=2.0, element=element)
    block = box_block("b", box, Material(30e9, 0.2, 2400.0), "b")
    free = np.ones((len(block.points), 3), dtype=bool)
    free[block.points[:, 2] == 0.0] = not held
    free[block.points[:, 1] == 0.0, 1] = False
    rows = np.flatnonzero(free.ravel())
    return assemble(block)[0][rows][:, rows], rows // 3


def anything(size=700):
    """A matrix of random couplings, one row coupled with all: no mesh, and a node for every row."""
    A = random_array((size, size), density=0.004, rng=np.random.default_rng(5)).tolil()
    A[3] = 0.01
    A = csr_matrix(A)
    return csr_matrix(A @ A.T + eye_array(size)), np.arange(size)


def apart():
    """Three bodies that nothing couples, and rows that stand alone."""
    K, node = mesh("hex8")
    parts = [node + k * (node.max() + 1) for k in range(3)]
    return csr_matrix(block_diag([K, K, K, np.eye(4)])), np.concatenate([*parts, 10**6 + np.arange(4)])


CASES = {
    "hex8": lambda: mesh("hex8"),
    "tet10": lambda: mesh("tet10"),
    "anything": anything,
    "apart": apart,
    "dense": lambda: (csr_matrix(np.ones((150, 150)) + 150.0 * np.eye(150)), np.arange(150)),
    "one": lambda: (csr_matrix([[4.0]]), np.array([7])),
}


@pytest.mark.parametrize("case", list(CASES))
def test_a_known_answer_is_what_comes_out(case):
    K, node = CASES[case]()
    known = np.random.default_rng(1).standard_normal((K.shape[0], 5))
    known[:, 2] = 0.0
    solver = Multifrontal(K, node)
    size = np.abs(known).max()
    assert np.abs(solver.solve(K @ known) - known).max() < 1e-9 * size
    assert np.abs(solver.solve(K @ known[:, 0]) - known[:, 0]).max() < 1e-9 * size
    few = np.zeros((K.shape[0], 2))
    few[0, 0] = few[-1, 1] = 1.0
    assert np.abs(K @ solver.solve(few) - few).max() < 1e-9


@pytest.mark.parametrize("case", ["hex8", "tet10", "apart"])
def test_what_is_condensed_is_the_schur_complement(case):
    K, node = CASES[case]()
    inner = node > np.quantile(node, 0.4)
    solver = Multifrontal(K, node, inner)
    outer = np.zeros(len(node), dtype=bool)
    outer[solver.outer] = True
    assert not outer[inner].any() and outer[~inner].all()
    dense = K.toarray()
    condensed = dense[np.ix_(outer, outer)] - dense[np.ix_(outer, ~outer)] @ np.linalg.solve(
        dense[np.ix_(~outer, ~outer)], dense[np.ix_(~outer, outer)]
    )
    force = np.random.default_rng(2).standard_normal((outer.sum(), 3))
    answer = solver.near.solve(force)
    assert np.abs(condensed @ answer - force).max() < 1e-9 * np.abs(force).max()
    whole = np.zeros((len(node), 3))
    whole[outer] = force
    assert np.abs(solver.solve(whole)[outer] - answer).max() < 1e-12 * np.abs(answer).max()


@pytest.mark.parametrize("case", list(CASES))
def test_every_node_is_eliminated_once_and_inner_ones_first(case):
    graph = CASES[case]()[0].astype(bool).astype(float)
    inner = np.arange(graph.shape[0]) % 5 < 2
    order = np.concatenate(dissected(graph, inner))
    assert np.array_equal(np.sort(order), np.arange(graph.shape[0]))
    assert inner[order[: inner.sum()]].all()


def test_the_factors_of_a_solid_are_about_as_sparse_as_those_of_minimum_degree():
    box = BoxConfig(origin=(0.0,) * 3, size=(30.0,) * 3, element_size=2.0, element="hex8")
    block = box_block("b", box, Material(30e9, 0.2, 2400.0), "b")
    rows = np.flatnonzero(np.repeat(block.points[:, 2] > 0.0, 3))
    K = assemble(block)[0][rows][:, rows]
    fronts = Multifrontal(K, rows // 3)._all.fronts
    numbers = sum(f.diagonal.size / 2 + f.below.size for f in fronts)
    assert numbers < 1.3 * Factor(K)._lu.nnz / 2  # of L and U


def test_a_matrix_that_is_not_positive_definite_is_refused():
    K, node = mesh("hex8")
    with pytest.raises(ReductionError, match="singular or not positive definite"):
        Multifrontal(csr_matrix(K - 1e9 * eye_array(K.shape[0])), node)
