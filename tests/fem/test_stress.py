"""Nodal stress: exact for constant strain and for quadratic elements in bending; the modes' is the mesh's."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from romdam.config import parse_config
from romdam.config.sections.job import BoxConfig
from romdam.core.scene import Material
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import assemble
from romdam.fem.stress import (
    COMPONENTS,
    modal_stress,
    observed_stress,
    stress_operator,
    stress_operators,
)
from romdam.geometry.boxes import box_block
from romdam.geometry.elements import SOLIDS
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

CONCRETE = Material(E=30e9, nu=0.2, rho=2400.0)
LAM, MU = 8333333333.333333, 12.5e9  # 30 GPa, 0.2
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


def brick(element, distortion=0.0, size=(1.0, 1.0, 1.0), edge=0.5):
    config = BoxConfig(origin=(0, 0, 0), size=size, element_size=edge, element=element)
    block = box_block("b", config, CONCRETE, "s.yaml: blocks.b.box")
    moved = distortion * np.random.default_rng(3).uniform(-1, 1, block.points.shape)
    return dataclasses.replace(block, points=block.points + moved)


def voigt(tensor):
    return np.array([tensor[i, j] for i, j in PAIRS])


@pytest.mark.parametrize("element", SOLIDS)
def test_constant_strain_is_exact_at_every_node_of_a_distorted_mesh(element):
    """Patch test with all six components; uniform tension is one of them."""
    block = brick(element, 0.03)
    A = np.random.default_rng(8).standard_normal((3, 3)) * 1e-4
    strain = (A + A.T) / 2
    stress = LAM * np.trace(strain) * np.eye(3) + 2 * MU * strain
    nodes = np.arange(len(block.points))
    found = (stress_operator(block, nodes) @ (block.points @ A.T).ravel()).reshape(-1, 6)
    assert np.abs(found - voigt(stress)).max() < 1e-12 * np.abs(stress).max() * 100
    assert len(COMPONENTS) == 6


@pytest.mark.parametrize("element", SOLIDS)
def test_uniform_tension_is_one_component(element):
    block = brick(element, 0.03)
    strain = np.diag([-0.2, -0.2, 1.0]) * 1e6 / 30e9
    found = stress_operator(block, np.arange(len(block.points))) @ (block.points @ strain).ravel()
    np.testing.assert_allclose(
        found.reshape(-1, 6), np.tile([0, 0, 1e6, 0, 0, 0], (len(block.points), 1)), atol=1e-4
    )


@pytest.mark.parametrize("element", [name for name, e in SOLIDS.items() if e.quadratic])
def test_pure_bending_is_exact_with_quadratic_elements(element):
    """Timoshenko & Goodier, Theory of Elasticity, section 102: sigma_zz = E x / R and no more."""
    block = brick(element, size=(1.0, 1.0, 3.0))
    x, y, z = (block.points - [0.5, 0.5, 0.0]).T
    R, nu = 1e4, CONCRETE.nu
    u = np.stack([-(z**2 + nu * (x**2 - y**2)) / (2 * R), -nu * x * y / R, x * z / R], axis=1)
    found = (stress_operator(block, np.arange(len(x))) @ u.ravel()).reshape(-1, 6)
    assert np.abs(found[:, 2] - CONCRETE.E * x / R).max() < 1e-9 * CONCRETE.E / R
    assert np.abs(np.delete(found, 2, axis=1)).max() < 1e-9 * CONCRETE.E / R


def test_shear_of_a_coarse_cantilever_is_better_than_at_the_nodes():
    """Plane strain cantilever, end load (Timoshenko & Goodier, section 21), 4 x 2 hex20 on a span of 8."""
    config = BoxConfig(origin=(0, -0.5, 0), size=(8, 1, 1), element_size=(2.0, 0.5, 1.0), element="hex20")
    block = box_block("b", config, CONCRETE, "s.yaml: blocks.b.box")
    x, y, _ = block.points.T
    E, nu, span = CONCRETE.E / (1 - 0.04), 0.25, 8.0  # plane strain
    scale = 12.0 / (6 * E)
    u = -scale * y * ((6 * span - 3 * x) * x + (2 + nu) * (y**2 - 0.25))
    v = scale * (3 * nu * y**2 * (span - x) + (4 + 5 * nu) * x / 4 + (3 * span - x) * x**2)
    held = np.stack([np.isin(x, (0, span))] * 2 + [np.ones(len(x), dtype=bool)], axis=1).ravel()
    K, _ = assemble(block)
    field = np.stack([u, v, 0 * x], axis=1).ravel() * held
    field[~held] = spsolve(K[~held][:, ~held].tocsc(), -(K @ field)[~held])
    stress = (stress_operator(block, np.arange(len(x))) @ field).reshape(-1, 6)
    inner = (x > 1.5) & (x < 6.5)
    assert np.abs(stress[:, 0] + 12.0 * (span - x) * y)[inner].max() < 0.005 * 48
    assert np.abs(stress[:, 3] - 6.0 * (0.25 - y**2))[inner].max() < 0.25 * 1.5


def test_rigid_motion_is_free_of_stress():
    block = brick("hex20", 0.03)
    turn = np.cross(np.array([0.3, -0.2, 0.5]), block.points) + 1.0
    stress = stress_operator(block, np.arange(len(block.points))) @ turn.ravel()
    assert np.abs(stress).max() < 1e-13 * CONCRETE.E


def test_some_nodes_are_the_same_rows():
    block = brick("tet10", 0.03)
    nodes = np.array([3, 17, 40])
    whole = stress_operator(block, np.arange(len(block.points)))
    rows = (6 * nodes[:, None] + np.arange(6)).ravel()
    assert abs(stress_operator(block, nodes) - whole[rows]).max() == 0.0


@pytest.mark.parametrize("element", ["hex8", "tet10"])
def test_modal_stress_times_coordinates_is_the_meshs_stress(element):
    """The same displacement gives the same stress to 1e-8, through the modes and through the free DOFs."""
    scene, config = stressed_scene(element)
    reduced = reduce_scene(scene, config.model, config.damping)
    q = np.random.default_rng(5).standard_normal(reduced.system.size)
    modal = modal_stress(stress_operators(scene), reduced.basis)
    full = assemble_full(scene, config.damping)
    u = np.concatenate(
        [
            part.vectors.apply(q[part.columns])[~scene.fixed[name].ravel()]
            for name, part in reduced.basis.items()
        ]
    )
    mesh = observed_stress(scene) @ u
    assert observed_stress(scene).shape[1] == full.size
    found = np.concatenate([modal[name] @ q[reduced.basis[name].columns] for name in modal]).ravel()
    assert np.abs(found - mesh).max() < 1e-8 * np.abs(mesh).max()


def stressed_scene(element="hex8"):
    sizes = {"size": [1, 1, 2], "element_size": 0.5, "element": element}
    raw = {
        "materials": {"c": {"E": "30 GPa", "nu": 0.2, "rho": 2400}},
        "blocks": {
            "left": {"material": "c", "box": {"origin": [0, 0, 0], **sizes}},
            "right": {"material": "c", "box": {"origin": [0, 1, 0], **sizes}},
        },
        "supports": [{"block": b, "face": "zmin"} for b in ("left", "right")],
        "joints": {"j": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}},
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 5},
        "transient": {"finest_step": 0.01},
        "outputs": {
            "stress": {
                "blocks": ["left"],
                "faces": [{"block": "right", "face": "xmin"}],
                "nodes": {"heel": {"block": "right", "at": [1, 2, 0]}},
                "strength": "2 MPa",
            }
        },
    }
    config = parse_config(raw, "s.yaml")
    return build_scene(config, Path("."), "s.yaml"), config


def test_sites_hold_what_was_asked_for_with_the_axes_of_faces_and_joints():
    scene, _ = stressed_scene()
    sites = scene.stress
    right, left = sites.blocks["right"], sites.blocks["left"]
    assert len(left.nodes) == len(scene.blocks["left"].points)
    on_face = scene.blocks["right"].points[right.nodes][:, 0] == 0.0
    assert on_face.sum() == 15 and len(right.nodes) == 16
    np.testing.assert_allclose(right.up[on_face], np.tile([0, 0, 1], (15, 1)), atol=1e-15)
    np.testing.assert_allclose(np.abs(right.arch[on_face]), np.tile([0, 1, 0], (15, 1)), atol=1e-15)
    np.testing.assert_allclose(np.abs(left.arch), np.tile([0, 1, 0], (len(left.nodes), 1)), atol=1e-12)
    (face,) = sites.faces
    assert face.name == "right.xmin" and face.area.sum() == pytest.approx(2.0)
    block, row = sites.probes["heel"]
    np.testing.assert_array_equal(scene.blocks[block].points[right.nodes[row]], [1, 2, 0])
