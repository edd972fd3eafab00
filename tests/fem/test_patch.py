"""Constant strain is exact on distorted meshes of every element, curved ones included.

The nodal forces K u of u = A x must be the consistent forces of the traction sigma n on the
boundary and zero inside (patch test, e.g. Zienkiewicz & Taylor, The Finite Element Method, vol. 1, ch. 10).
"""

import dataclasses

import numpy as np
import pytest

from romdam.config.sections.job import BoxConfig
from romdam.core.errors import MeshError
from romdam.core.scene import Material
from romdam.fem.assembly import assemble
from romdam.fem.loads import pressure_force
from romdam.geometry.boxes import box_block
from romdam.geometry.elements import SOLIDS
from romdam.geometry.facets import area_vectors, boundary_facets

STEEL = Material(E=210e9, nu=0.3, rho=7850.0)


def distorted(element, amount=0.03):
    config = BoxConfig(origin=(0, 0, 0), size=(1, 1, 1), element_size=0.5, element=element)
    block = box_block("cube", config, STEEL, "s.yaml: blocks.cube.box")
    rng = np.random.default_rng(7)
    return dataclasses.replace(block, points=block.points + amount * rng.uniform(-1, 1, block.points.shape))


@pytest.mark.parametrize("element", SOLIDS)
def test_constant_strain(element):
    block = distorted(element)
    K, _ = assemble(block)
    A = np.random.default_rng(8).standard_normal((3, 3)) * 1e-4
    strain = (A + A.T) / 2
    lam, mu = 121.15384615384616e9, 80.76923076923077e9  # 210 GPa, 0.3
    stress = lam * np.trace(strain) * np.eye(3) + 2 * mu * strain
    force = (K @ (block.points @ A.T).ravel()).reshape(-1, 3)
    facets = boundary_facets(block.cells, element)
    traction = np.zeros_like(force)
    np.add.at(traction, facets, area_vectors(block.points, facets) @ stress)
    assert np.abs(force - traction).max() < 1e-12 * np.abs(K.data).max() * 1e-4 * 3
    assert np.abs(force).max() > 1e6  # something was tested


@pytest.mark.parametrize("element", SOLIDS)
def test_rigid_motion_costs_nothing_and_mass_is_the_volume(element):
    block = distorted(element)
    K, M = assemble(block)
    x, n = block.points, len(block.points)
    motions = [np.tile(e, n) for e in np.eye(3)] + [np.cross(e, x).ravel() for e in np.eye(3)]
    for motion in motions:
        assert np.abs(K @ motion).max() < 1e-13 * np.abs(K.data).max() * np.abs(motion).max() * 10
    assert abs(K - K.T).max() == 0 and abs(M - M.T).max() == 0
    facets = boundary_facets(block.cells, element)
    if element == "tet4":  # flat facets: int x . n dA = 3 V is a nodal sum
        volume = (
            np.einsum(
                "fjk,fjk->", area_vectors(x, facets).mean(axis=1, keepdims=True).repeat(3, 1), x[facets]
            )
            / 3
        )
        assert motions[0] @ M @ motions[0] == pytest.approx(STEEL.rho * volume, rel=1e-12)
    assert motions[0] @ M @ motions[0] == pytest.approx(motions[2] @ M @ motions[2], rel=1e-14)


@pytest.mark.parametrize("element", SOLIDS)
def test_mass_matrix_is_positive_definite(element):
    _, M = assemble(distorted(element))
    eigenvalues = np.linalg.eigvalsh(M[::3][:, ::3].toarray())
    assert eigenvalues.min() > 0


@pytest.mark.parametrize("element", SOLIDS)
def test_renumbering_permutes_the_matrices(element):
    block = distorted(element)
    K, M = assemble(block)
    new = np.random.default_rng(9).permutation(len(block.points))
    points = np.empty_like(block.points)
    points[new] = block.points
    K2, M2 = assemble(dataclasses.replace(block, points=points, cells=new[block.cells][::-1]))
    dof = (3 * new[:, None] + np.arange(3)).ravel()
    assert abs(K2[dof][:, dof] - K).max() < 1e-14 * abs(K).max() * 10
    assert abs(M2[dof][:, dof] - M).max() < 1e-14 * abs(M).max() * 10


@pytest.mark.parametrize("element", SOLIDS)
def test_pressure_all_around_is_in_equilibrium(element):
    block = distorted(element)
    force = pressure_force(block.points, boundary_facets(block.cells, element), 1e6)
    assert np.abs(force.sum(axis=0)).max() < 1e-8
    assert np.abs(np.cross(block.points, force).sum(axis=0)).max() < 1e-8


def test_chunks_add_up(monkeypatch):
    import romdam.fem.assembly as assembly

    block = distorted("tet10")
    K, M = assemble(block)
    monkeypatch.setattr(assembly, "_CHUNK", 7)
    K2, M2 = assemble(block)
    assert abs(K - K2).max() < 1e-14 * abs(K).max() * 10 and abs(M - M2).max() < 1e-14 * abs(M).max() * 10


def test_inverted_element_is_refused():
    block = distorted("hex8", 0.0)
    cells = block.cells.copy()
    cells[3] = cells[3][[4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(MeshError) as caught:
        assemble(dataclasses.replace(block, cells=cells))
    assert str(caught.value) == (
        "mesh: element 3 of block 'cube' (hex8, counted from 0, around (0.75, 0.75, 0.25)) has a Jacobian "
        "determinant of -0.01563 m3, limit above 0 (1 such elements here): its nodes are in the wrong order "
        "or it is turned inside out; repair the mesh"
    )
