"""Damping of solids does not act on rigid motions that joints alone hold: matrices, closed forms of slides.

The matrix is held against P^T (alpha M + beta K) P, with P = 1 - R (R^T M R)^-1 R^T M and R written down here
from the nodes' positions, and modal damping against the modes of the mesh.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh, null_space
from scipy.sparse import csr_matrix
from small_scenes import march, scene
from test_massless import MU, G, block_on_rock, pulse, raw_block_on_rock

from romdam.config.sections.job import DampingConfig, ModelConfig, RayleighConfig
from romdam.core.arrays import Floats
from romdam.core.scene import Absorbing, BlockMatrices, Scene
from romdam.core.system import System
from romdam.effects.full_order import assemble_full
from romdam.error.replay import step_factor
from romdam.fem.assembly import assemble
from romdam.fem.parts import basis_over_unknowns, unknowns
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.supports import rigid_motions as rigid_motions_of
from romdam.scene.ties import scene_parts

ALPHA, BETA = 1.64, 4e-4
RAYLEIGH = DampingConfig(rayleigh=RayleighConfig(alpha=ALPHA, beta=BETA))
MODAL = DampingConfig(modal=0.05)
ALL = ModelConfig(modes="all")


def raw(**changes: Any) -> dict[str, Any]:
    """A pier on the ground, a slab of two boxes tied together on it, and a block that slides along x."""
    boxes = {
        "pier": ([0, 0, 0], [4, 3, 4]),
        "slab_1": ([0, 0, 4], [2, 3, 1]),
        "slab_2": ([2, 0, 4], [2, 3, 1]),
        "rail": ([4, 0, 0], [2, 3, 4]),
    }
    joint = {"normal_stiffness": 5e9, "shear_stiffness": 2e9, "friction": 0.3}
    return {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400.0}},
        "blocks": {
            name: {
                "material": "concrete",
                "box": {"origin": at, "size": size, "element_size": [2.0, 1.5, 1.0]},
            }
            for name, (at, size) in boxes.items()
        },
        "ties": {"slab": {"between": ["slab_1", "slab_2"]}},
        "joints": {
            "bed_1": {"between": ["pier", "slab_1"]} | joint,
            "bed_2": {"between": ["pier", "slab_2"]} | joint,
            "side": {"between": ["pier", "rail"]} | joint,
        },
        "supports": [
            {"block": "pier", "face": "zmin"},
            {"block": "rail", "face": "zmin", "fix": ["y", "z"]},
        ],
        "loads": {"gravity": [0, 0, -9.81]},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"x": 1}}],
        "model": {"modes": "all"},
        "transient": {"finest_step": 0.001},
    } | changes


WET = [{"block": name, "face": "ymin"} for name in ("pier", "slab_1", "rail")]
WATER = {"level": 5.0, "model": "westergaard", "faces": WET}
RIGID = {"pier": 0, "slab_1": 6, "rail": 1}  # the first block of each part, and how many rigid motions it has


def rigid_motions(built: Scene) -> Floats:
    """Translations and rotations of every part that has some, over the free DOFs."""
    numbered, columns = unknowns(built), []
    for name, part in scene_parts(built).items():
        if not RIGID.get(part.blocks[0]):
            continue
        points = part.mesh(built.blocks).points[: part.nodes]
        turns = np.cross(np.eye(3), points[:, None]).transpose(0, 2, 1).reshape(-1, 3)
        every = np.hstack([np.tile(np.eye(3), (len(points), 1)), turns])
        free = numbered.free[name]
        kept = null_space(every[~free]) if (~free).any() else np.eye(6)
        assert kept.shape[1] == RIGID[part.blocks[0]]
        column = np.zeros((max(part.stop for part in numbered.parts.values()), kept.shape[1]))
        column[numbered.parts[name]] = every[free] @ kept
        columns.append(column)
    return np.hstack(columns)


def damping_of(system: System) -> Floats:
    return system.damping_force(np.eye(system.size))


@pytest.mark.parametrize("water", [None, WATER], ids=["dry", "with water"])
def test_the_mass_term_acts_on_what_is_left_without_rigid_motions(water):
    """Full order and reduced, of a part held, one that floats, and one that slides along one axis."""
    built = scene(raw() | ({"water": water} if water else {}))
    system, R = assemble_full(built, RAYLEIGH), rigid_motions(built)
    M, K = system.M.toarray(), system.K.toarray()
    P = np.eye(len(M)) - R @ np.linalg.solve(R.T @ M @ R, R.T @ M)
    exact = P.T @ (ALPHA * M + BETA * K) @ P
    assert np.abs(damping_of(system) - exact).max() <= 1e-11 * np.abs(exact).max()
    assert np.abs(system.damping_force(R)).max() <= 1e-11 * ALPHA * np.abs(M @ R).max()
    small = reduce_scene(built, ALL, RAYLEIGH)
    T = basis_over_unknowns(built, small.basis, small.system.size)
    of_modes = T.T @ exact @ T
    assert small.system.diagonal
    assert np.abs(small.system.C.toarray() - of_modes).max() <= 1e-9 * np.abs(of_modes).max()
    assert (small.system.C.diagonal() == 0.0).sum() == 7


def test_modal_ratios_leave_rigid_motions_alone_too():
    built = scene(raw())
    small, full, R = (
        reduce_scene(built, ALL, MODAL),
        assemble_full(built, DampingConfig()),
        rigid_motions(built),
    )
    M, K = full.M.toarray(), full.K.toarray()
    omega2, Phi = eigh(K, M)
    exact = M @ Phi @ np.diag(2 * 0.05 * np.sqrt(np.maximum(omega2, 0.0))) @ Phi.T @ M
    T = basis_over_unknowns(built, small.basis, small.system.size)
    of_modes = T.T @ exact @ T
    assert np.abs(small.system.C.toarray() - of_modes).max() <= 1e-6 * np.abs(of_modes).max()
    assert np.abs(small.system.C @ (T.T @ (M @ R))).max() <= 1e-9 * np.abs(of_modes).max()


def test_what_a_viscous_boundary_holds_keeps_all_its_damping():
    """The slab on dashpots: not only joints hold it, and its mass term stays, as in a free field's column."""
    built = scene(raw())
    block = built.blocks["slab_1"]
    dashpots = (Absorbing(block.faces["zmax"], np.inf),)
    built = replace(built, blocks=built.blocks | {"slab_1": replace(block, absorbing=dashpots)})
    plain = replace(built, blocks=built.blocks | {"slab_1": block})
    full, numbered = assemble_full(built, RAYLEIGH), unknowns(built)
    slab = numbered.parts["slab_1+slab_2"]
    C_b = damping_of(full) - (ALPHA * full.M + BETA * full.K).toarray()
    assert np.linalg.eigvalsh(C_b[slab, slab]).min() >= -1e-9 * np.abs(C_b[slab, slab]).max()
    rail = numbered.parts["rail"]
    dry = damping_of(assemble_full(plain, RAYLEIGH))
    assert np.abs((damping_of(full) - dry)[rail, rail]).max() <= 1e-12 * np.abs(dry).max()
    small = reduce_scene(built, ALL, RAYLEIGH)
    T = basis_over_unknowns(built, small.basis, small.system.size)
    of_modes = T.T @ damping_of(full) @ T
    assert np.abs(small.system.C.toarray() - of_modes).max() <= 1e-9 * np.abs(of_modes).max()


@pytest.mark.parametrize("name", ["rail", "pier"])
def test_a_matrix_that_a_block_brings_is_all_its_damping(name):
    """It drags rigid motions too, and the mass term of Rayleigh's neither adds to it nor is taken off it."""
    built = scene(raw())
    block = built.blocks[name]
    K, M = assemble(block)
    C, size = csr_matrix(2.5 * M + 1.1e-3 * K), 3 * len(block.points)
    axes = np.tile(np.arange(3), (len(block.points), 1))
    own = BlockMatrices(K, M, axes, np.tile(np.eye(3), (len(block.points), 1)), C, None, np.zeros(size))
    plain = damping_of(assemble_full(built, RAYLEIGH))
    built = replace(built, blocks=built.blocks | {name: replace(block, matrices=own)})
    full, numbered = assemble_full(built, RAYLEIGH), unknowns(built)
    part, free = numbered.parts[name], numbered.free[name]
    exact = plain.copy()
    exact[part, part] = C[free][:, free].toarray()
    assert np.abs(damping_of(full) - exact).max() <= 1e-11 * np.abs(exact).max()
    small = reduce_scene(built, ALL, RAYLEIGH)
    T = basis_over_unknowns(built, small.basis, small.system.size)
    of_modes = T.T @ exact @ T
    assert np.abs(damping_of(small.system) - of_modes).max() <= 1e-9 * np.abs(of_modes).max()


def test_a_replay_and_a_step_solve_with_the_matrix_that_they_damp_by():
    built, h = scene(raw()), 1e-3
    system = assemble_full(built, RAYLEIGH)
    gamma = 1.0 - np.sqrt(0.5)
    A = system.M.toarray() + h * gamma * damping_of(system) + (h * gamma) ** 2 * system.K.toarray()
    right = np.random.default_rng(1).standard_normal((len(A), 3))
    for transposed in (False, True):
        answer = step_factor(system, h).solve(right, transposed)
        assert np.abs(A @ answer - right).max() <= 1e-9


def sliding_block(order: str, mu: float, damping: DampingConfig) -> System:
    """A block of 4 x 4 x 1 m on massless rock; its joint without shear where mu is zero."""
    config = raw_block_on_rock(stiff=1.0, friction=mu) if mu else raw_block_on_rock(stiff=1.0)
    if not mu:
        del config["joints"]["base"]["friction"], config["joints"]["base"]["shear_stiffness"]
    built = scene(config) if not mu else block_on_rock(0.0, stiff=1.0, friction=mu)
    return assemble_full(built, damping) if order == "full" else reduce_scene(built, ALL, damping).system


ORDERS = [
    ("full", "generalized_alpha"),
    *(("reduced", name) for name in ("generalized_alpha", "adaptive", "modal")),
]


@pytest.mark.parametrize(("order", "integrator"), ORDERS)
def test_a_block_without_friction_keeps_its_velocity(order, integrator):
    """A pulse of 6 m/s2 for 0.4 s, linear over a step at its ends: 2.4 m/s, for good."""
    dt = 0.001
    along = pulse(dt, 6.0, end=1.5)
    ground = np.outer([1.0, 0.0, 0.0], along)
    h = march(sliding_block(order, 0.0, RAYLEIGH), dt, ground, initial_state="static", integrator=integrator)
    v = -np.trapezoid(along, dx=dt)
    later = h.time > 0.55
    assert h.vel[later, 0] == pytest.approx(v, rel=1e-6)
    moved = h.disp[later, 0]
    assert np.diff(moved) == pytest.approx(v * np.diff(h.time[later]), rel=1e-5)


@pytest.mark.parametrize(("order", "integrator"), ORDERS)
def test_a_sliding_block_slows_down_by_friction_alone(order, integrator):
    """mu g of deceleration while it slides, whatever its velocity; alpha v would be 60 % more at 1.5 m/s."""
    dt = 0.001
    ground = np.outer([1.0, 0.0, 0.0], pulse(dt, 12.0, end=1.2))
    h = march(sliding_block(order, MU, RAYLEIGH), dt, ground, initial_state="static", integrator=integrator)
    a, b = (int(np.searchsorted(h.time, t)) for t in (0.6, 0.8))
    assert abs(h.vel[b, 0]) > 0.5
    rate = (h.vel[b, 0] - h.vel[a, 0]) / (h.time[b] - h.time[a])
    assert rate == pytest.approx(MU * G, rel=1e-3)


def test_internal_unknowns_of_a_superelement_follow_rigid_motion():
    """An oscillator of 1e9 N/m on a corner, along x: it goes where the corner goes, without strain."""
    plain = scene(raw_block_on_rock(stiff=1.0))
    block = plain.blocks["block"]
    K, M = assemble(block)
    n, corner = K.shape[0], 3 * 5
    size = n + 3  # of a node without a place in the mesh
    K_2, M_2 = np.zeros((size, size)), np.zeros((size, size))
    K_2[:n, :n], M_2[:n, :n] = K.toarray(), M.toarray()
    spring = np.zeros(size)
    spring[n], spring[corner] = 1.0, -1.0
    K_2 += 1e9 * np.outer(spring, spring)
    M_2[n, n] = 1e3
    points = np.vstack([block.points, block.points[:1]])
    motion = np.vstack([np.tile(np.arange(3), (len(block.points), 1)), [[6, -1, -1]]])
    translations = np.vstack([np.tile(np.eye(3), (len(block.points), 1)), np.zeros((3, 3))])
    translations[n] = [1.0, 0.0, 0.0]
    own = BlockMatrices(csr_matrix(K_2), csr_matrix(M_2), motion, translations, None, None, np.zeros(size))
    R = rigid_motions_of(replace(block, points=points, matrices=own)).reshape(-1, 6)
    assert R[n] == pytest.approx(R[corner], rel=1e-9, abs=1e-9)
    assert np.abs(K_2 @ R).max() <= 1e-9 * np.abs(K_2).max()
