"""Residuals, inertia relief and rigid motions of a few unknowns, worked out on paper; a basis with water."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import eigsh

from romdam.config import parse_config
from romdam.effects.full_order import assemble_full
from romdam.linalg.conjugate import conjugate_gradients
from romdam.linalg.factor import Factor
from romdam.linalg.modes.eigen import lowest_modes
from romdam.linalg.modes.flexibility import Flexibility
from romdam.linalg.modes.rigid import rigid_modes
from romdam.reduction.methods.craig_bampton import eigen_residual
from romdam.reduction.methods.merged_part import unbalanced
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene_twice
from romdam.scene.build import build_scene

# masses of 1, 2 and 1 on springs of 6: nothing holds them
CHAIN_K = csr_matrix(np.array([[6.0, -6, 0], [-6, 12, -6], [0, -6, 6]]))
CHAIN_M = csr_matrix(np.diag([1.0, 2.0, 1.0]))


def test_residual_is_that_of_the_worst_elastic_mode():
    """0, |9 - 10| / 10 and |120 - 100| / 100 of masses 1, 1 and 4; a rigid motion does not count."""
    K, omega2 = csr_matrix(np.diag([400.0, 900.0, 12000.0, 7.0])), np.array([400.0, 1000.0, 2500.0, 0.0])
    mass = np.diag([1.0, 1.0, 4.0, 1.0])
    assert eigen_residual(K, mass, omega2, np.eye(4)) == pytest.approx(0.2, rel=1e-12)


def test_loads_that_do_more_than_accelerate_a_body():
    """(1, 2, 1) is M r, and accelerates the chain as a whole; (1, 0, 0) strains it: (3, -2, -1)/4 is left."""
    rigid = np.full((3, 1), 0.5)
    loads = csc_matrix(np.array([[1 / 6**0.5, 1.0], [2 / 6**0.5, 0.0], [1 / 6**0.5, 0.0]]))
    assert unbalanced(loads, rigid, CHAIN_M).tolist() == [1]


def test_rigid_motion_of_a_chain_has_unit_mass():
    found = rigid_modes(CHAIN_K, CHAIN_M, np.ones((3, 1)))
    np.testing.assert_allclose(np.abs(found), 0.5, rtol=1e-12)


def test_a_chain_answers_forces_without_rigid_motion():
    """(1, 0, -1) stretches both springs by 1/6: 1/6, 0, -1/6. Of (1, 0, 0) the part (3, -2, -1)/4 strains.

    The springs carry 3/4 and 1/4: u_1 - u_2 = 1/8, u_2 - u_3 = 1/24; u_1 + 2 u_2 + u_3 = 0 gives u_2 = -1/48.
    """
    shift = -1e-3
    D = Flexibility(CHAIN_M, Factor(CHAIN_K - shift * CHAIN_M).solve, shift, CHAIN_K)
    found = D.displacement(np.array([[1.0, 1.0], [0.0, 0.0], [-1.0, 0.0]]))
    expected = [[1 / 6, 1 / 8 - 1 / 48], [0, -1 / 48], [-1 / 6, -1 / 24 - 1 / 48]]
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_mode_of_a_mass_on_two_springs():
    """3 and 6 in series are 2 under a mass of 2; the node between has none: omega^2 = 1, shifted or not."""
    K, M = csr_matrix(np.array([[9.0, -6], [-6, 6]])), csr_matrix(np.diag([0.0, 2.0]))
    for shift in (0.0, -0.5):
        omega2, modes = lowest_modes(K, M, 1, Factor(K - shift * M), shift)
        assert omega2 == pytest.approx([1.0])
        np.testing.assert_allclose(np.abs(modes[:, 0]), np.array([2 / 3, 1.0]) / 2**0.5, rtol=1e-9)


def test_every_column_is_solved_to_its_size():
    """Columns of 1 and of 1e9 times that, by conjugate gradients without a preconditioner."""
    rng = np.random.default_rng(1)
    A = np.diag(np.linspace(1.0, 50.0, 40)) + 0.5
    R = rng.normal(size=(40, 2)) * [1.0, 1e9]
    X = conjugate_gradients(A, R.copy(), lambda r: r.copy(), "none")
    left = np.linalg.norm(A @ X - R, axis=0) / np.linalg.norm(R, axis=0)
    assert left.max() < 1e-9


def test_finer_basis_follows_the_water():
    """Beside three modes a block, its residual vectors are of wet modes: eight wet frequencies to 50 ppm.

    Those of dry modes leave 400 ppm.
    """
    boxes = {"a": ([0, 0, 0], [2, 2, 8]), "b": ([2, 0, 0], [3, 2, 8])}
    raw = {
        "materials": {"c": {"E": "30 GPa", "nu": 0.18, "rho": 2440}},
        "blocks": {
            name: {"material": "c", "box": {"origin": at, "size": size, "element_size": 1.0}}
            for name, (at, size) in boxes.items()
        },
        "supports": [{"block": name, "face": "zmin"} for name in boxes],
        "joints": {"j": {"between": ["a", "b"], "normal_stiffness": "16 GPa/m"}},
        "water": {
            "level": 7.5, "faces": [{"block": name, "face": "ymin"} for name in boxes],
            "model": "incompressible", "density": 3000.0,
        },
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 3},
        "damping": {"rayleigh": {"alpha": 1.0, "beta": 1e-3}},
        "transient": {"finest_step": 0.01},
    }  # fmt: skip
    config = parse_config(raw, "s.yaml")
    scene = build_scene(config, ".", "s.yaml")
    full = assemble_full(scene, config.damping)
    expected = np.sort(eigsh(full.K, 8, full.M, sigma=0.0, v0=np.ones(full.size))[0])
    _, fine = reduce_scene_twice(scene, ModeChoice(count=3), config.damping)
    error = np.sqrt(np.sort(fine.system.K.diagonal())[:8] / expected) - 1.0
    assert error.min() > -1e-9 and error.max() < 5e-5
