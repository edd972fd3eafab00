"""Superelements with internal unknowns: frames, masses and units that no body can have in the job's axes.

The blocks are hex8 meshes condensed here by Craig and Bampton's method in plain NumPy. What is right of
them is known from the mesh: its mass, and that it is free or held.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import block_diag, csr_matrix

from romdam.config.sections.job import BoxConfig
from romdam.core.errors import MeshError
from romdam.core.scene import Material
from romdam.fem.assembly import assemble
from romdam.geometry.boxes import box_block
from romdam.geometry.matrices.checks import check_matrices
from romdam.geometry.matrices.data import INTERNAL, MatrixUnknowns
from romdam.geometry.matrices.files import FileMatrices

PLACE = "job.yaml: blocks.right.matrices"
CONCRETE = Material(30e9, 0.2, 2400.0)
SIZE = np.array([3.0, 2.0, 5.0])
MASS = 2400.0 * SIZE.prod()


@cache
def shape():
    return box_block(
        "right", BoxConfig(origin=(1.0, -2.0, 0.5), size=tuple(SIZE), element_size=1.0), CONCRETE, "b"
    )


@cache
def superelement(held=(), modes=9, mixed=False):
    """The block by its nodes at x = 1 m and `modes` of fixed interface; components `held` at its foot.

    mixed : internal unknowns are a mixture of modes and interface displacements, as of other methods
    """
    mesh = shape()
    K, M = (matrix.toarray() for matrix in assemble(mesh))
    seen = np.repeat(np.isclose(mesh.points[:, 0], 1.0), 3)
    foot = np.isclose(mesh.points[:, 2], 0.5)
    gone = (foot[:, None] & np.isin(np.arange(3), held)).ravel()
    b, i = np.flatnonzero(seen & ~gone), np.flatnonzero(~seen & ~gone)
    Phi = eigh(K[np.ix_(i, i)], M[np.ix_(i, i)], subset_by_index=[0, modes - 1])[1]
    Psi = -np.linalg.solve(K[np.ix_(i, i)], K[np.ix_(i, b)])
    T = np.zeros((len(K), len(b) + modes))
    T[b, np.arange(len(b))] = 1.0
    T[np.ix_(i, np.arange(len(b)))] = Psi
    T[np.ix_(i, len(b) + np.arange(modes))] = Phi
    if mixed:
        mixture = np.eye(T.shape[1])
        mixture[len(b) :] = np.random.default_rng(1).standard_normal((modes, T.shape[1]))
        T = T @ mixture
    motion = np.r_[b % 3, np.full(modes, INTERNAL)]
    position = np.vstack([mesh.points[b // 3], np.full((modes, 3), np.nan)])
    unknowns = MatrixUnknowns(np.r_[b // 3 + 1, 1000 + np.arange(modes)], motion, position)
    return FileMatrices(
        unknowns, csr_matrix(T.T @ K @ T), csr_matrix(T.T @ M @ T), None, None, np.zeros(T.shape[1])
    )


def turned(own, which=4, angle=37.0, axis=(0.3, 1.0, -0.5), matrices=("K", "M")):
    """The matrices with the rows of the node `which` of the interface in axes turned by some degrees."""
    node = np.unique(own.unknowns.node[own.unknowns.motion < 3])[which]
    rows = np.flatnonzero(own.unknowns.node == node)
    n = np.array(axis) / np.linalg.norm(axis)
    cross = np.cross(np.eye(3), n)
    a = np.radians(angle)
    frame = np.eye(3) + np.sin(a) * cross + (1 - np.cos(a)) * cross @ cross
    T = np.eye(len(own.unknowns))
    T[np.ix_(rows, rows)] = frame[np.ix_(own.unknowns.motion[rows], own.unknowns.motion[rows])]
    changed = {name: csr_matrix(T.T @ getattr(own, name).toarray() @ T) for name in matrices}
    return replace(own, **changed), node


def rounded(own, digits):
    def text(matrix):
        values = np.array([float(f"{v:.{digits - 1}e}") for v in matrix.toarray().ravel()])
        return csr_matrix(values.reshape(matrix.shape))

    return replace(own, K=text(own.K), M=text(own.M))


@pytest.mark.parametrize("mixed", [False, True])
def test_a_free_superelement_passes_with_the_mass_of_its_mesh(mixed):
    own = superelement(mixed=mixed)
    checked = check_matrices(own, PLACE, MASS, shape())
    assert checked.warnings == ()
    r = checked.translations
    assert np.allclose(r.T @ (own.M @ r), MASS * np.eye(3), atol=1e-7 * MASS)


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("digits", [17, 8])
@pytest.mark.parametrize(
    "angle, axis", [(37.0, (0.3, 1.0, -0.5)), (90.0, (0, 0, 1)), (180.0, (0, 1, 0)), (1.0, (0, 0, 1))]
)
def test_a_node_in_a_local_frame_is_refused_by_its_number(mixed, digits, angle, axis):
    own, node = turned(superelement(mixed=mixed), angle=angle, axis=axis)
    check_matrices(rounded(superelement(mixed=mixed), digits), PLACE, MASS, shape())
    with pytest.raises(
        MeshError, match=rf"6 motions have no strain, and only \d of .* all nodes but {node} move"
    ):
        check_matrices(rounded(own, digits), PLACE)


def test_a_mass_in_another_frame_than_the_stiffness_is_refused():
    (said,) = check_matrices(turned(superelement(), matrices=("M",))[0], PLACE).warnings
    assert "differ by direction, by 0.04" in said  # of the mass, of which the turned node has a sixth
    own, _ = turned(superelement(), angle=180.0, axis=(0, 1, 0), matrices=("M",))
    with pytest.raises(MeshError, match=r"mass: its .* kg along x, y, z .* a free body's do not, limit 0.1"):
        check_matrices(own, PLACE)


def test_what_is_held_inside_in_some_motions_is_checked_in_the_others():
    """Along x and z the foot is held: the block is free to move along y alone."""
    held = superelement(held=(0, 2))
    (said,) = check_matrices(held, PLACE, None, shape()).warnings
    assert "resists 5 of 6 rigid motions" in said
    assert check_matrices(held, PLACE, None, shape(), supported=True).warnings == ()
    with pytest.raises(MeshError, match="1 motions have no strain, and only 0 of the six"):
        check_matrices(turned(held)[0], PLACE)


def test_what_is_held_inside_in_all_motions_passes_and_is_a_warning():
    held = superelement(held=(0, 1, 2))
    (said,) = check_matrices(held, PLACE).warnings
    assert "resists 6 of 6" in said and "frames of the unknowns cannot be checked" in said


def test_internal_unknowns_that_hang_loose_are_refused():
    own, pair = superelement(), np.array([[1.0, -1.0], [-1.0, 1.0]])
    unknowns = MatrixUnknowns(
        np.r_[own.unknowns.node, 5000, 5001],
        np.r_[own.unknowns.motion, INTERNAL, INTERNAL],
        np.vstack([own.unknowns.position, np.full((2, 3), np.nan)]),
    )
    K, M = block_diag((own.K, pair), "csr"), block_diag((own.M, np.eye(2)), "csr")
    with pytest.raises(MeshError, match="7 motions have no strain"):
        check_matrices(FileMatrices(unknowns, K, M, None, None, np.zeros(len(unknowns))), PLACE)


@pytest.mark.parametrize(
    "of_K, of_M, key",
    [
        (1e-3, 1e-3, "mass"),
        (1e3, 1e3, "mass"),
        (1e-3, 1.0, "stiffness"),
        (1e3, 1.0, "stiffness"),
        (1.0, 1e-3, "mass"),
        (1e-6, 1e-3, "mass"),
    ],
)
@pytest.mark.parametrize("held", [(), (0, 1, 2)])
def test_units_a_thousandfold_off_are_refused(of_K, of_M, key, held):
    own = superelement(held=held)
    own = replace(own, K=own.K * of_K, M=own.M * of_M)
    with pytest.raises(MeshError, match=rf"{key}: .* are tonnes, kN or mm meant"):
        check_matrices(own, PLACE, None, shape(), supported=True)


def test_another_mass_than_the_shapes_is_a_warning_unless_it_is_stated():
    own = superelement()
    light = replace(own, M=own.M * 0.05)
    said = check_matrices(light, PLACE, None, shape()).warnings
    assert len(said) == 1 and "0.05 of volume times density" in said[0]
    assert check_matrices(light, PLACE, 0.05 * MASS, shape()).warnings == ()
