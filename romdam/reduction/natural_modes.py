"""Natural modes of the whole unreduced mesh, with the joints as a linear system has them.

K phi = omega^2 M phi over the free DOFs, M with the added mass of the water. Block Lanczos on every size:
blocks that are alike have frequencies that coincide, of which a single vector may find one only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_matrix, diags_array

from romdam.config.sections.job import DampingConfig
from romdam.core.arrays import Floats
from romdam.core.attachment import Attachment
from romdam.core.errors import ConfigError
from romdam.core.motion import MovingSupports
from romdam.core.scene import Block, FreeField, Reservoir, Scene
from romdam.effects.added_mass import AddedMass, added_mass, added_mass_matrix
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import assemble_mass, inertia
from romdam.fem.damping import (
    damping_coupling,
    further_damping,
    further_drag,
    modal_coefficients,
    rayleigh_coefficients,
    rigid_drag,
    sliding_motions,
)
from romdam.fem.gaps import gap_law, gap_operators
from romdam.fem.parts import Unknowns, unknowns
from romdam.geometry.meshes.quality import sound_volume
from romdam.linalg.modes.eigen import lowest_modes_by_blocks
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import AUTO, Solver, Solving, make_solver
from romdam.scene.supports import rigid_motions
from romdam.scene.ties import scene_parts

_SHIFT = (2.0 * np.pi * 3.0) ** 2  # [1/s2], where rigid motions are: of the order of a dam's lowest omega^2
_RIGID = (
    1e-13  # of the blocks' largest k_ii / m_ii, up to which omega^2 is round-off of a rigid motion's zero
)


@dataclass(frozen=True)
class NaturalModes:
    """Natural modes in ascending frequency; directions are x, y, z.

    Attributes
    ----------
    freq : (m,) [Hz], zero of rigid motions
    damping_ratio : (m,) phi^T C phi / (2 omega phi^T M phi) of undamped modes, C the damping of the solids
        in runs; NaN of rigid motions, and of bonded joints where ratios are given, which are of the modes
        with open joints
    damping_coupling : of the modes, see `romdam.fem.damping.damping_coupling`
    shapes : block -> (m, n, 3), the largest displacement of all nodes is 1
    modal_mass : (m,) phi^T M phi of these shapes [kg]
    participation : (m, 3) phi^T M r / (phi^T M phi)
    effective_mass : (m, 3) [kg]; over all modes they sum to the total less what hangs on supports. M r is
        that of the structure carried along through still water, whose ground does not shake
    motion : (m, 3) share of the structure's kinetic energy along each direction
    total_mass : (3,) of all blocks that are shaken, and of the water that moves with them [kg]
    dry_freq : (m,) the same without water [Hz]; None where there is none
    """

    freq: Floats
    damping_ratio: Floats
    damping_coupling: float
    shapes: dict[str, Floats]
    modal_mass: Floats
    participation: Floats
    effective_mass: Floats
    motion: Floats
    total_mass: Floats
    dry_freq: Floats | None


@dataclass(frozen=True)
class _Pencil:
    """Equations of the structure without water.

    Attributes
    ----------
    K, M : (n, n); K with the springs of joints that are bonded
    load : (n, 3) M r for unit translations
    shift : [1/s2], at which K - shift M is definite
    rigid : omega^2 up to which it is round-off [1/s2]
    motions : nodes and rigid motions of the rows
    K_open : (n, n) K without springs of joints
    """

    K: csr_matrix
    M: csr_matrix
    load: Floats
    shift: float
    rigid: float
    motions: Motions
    K_open: csr_matrix


def natural_modes(
    scene: Scene, damping: DampingConfig, count: int, bonded: bool = False, solving: Solving = AUTO
) -> NaturalModes:
    """Find the lowest modes of a scene's mesh, its joints open, or bonded by their springs.

    Parameters
    ----------
    damping : Rayleigh, or modal ratios in the order of ascending frequency
    count : how many modes; all where the mesh has fewer
    bonded : whether K_n and K_s of every gap act, opening and sliding excluded

    Raises
    ------
    ConfigError
        for a rigid joint that is to be bonded, and where nothing has mass.
    ReductionError
        where the mesh does not fit in memory or modes do not converge.
    """
    numbered, water = unknowns(scene), added_mass(scene)
    pencil = _pencil(scene, numbered, bonded)
    if not pencil.M.diagonal().any():
        raise ConfigError(
            f"blocks: nothing that moves has mass ({len(scene.blocks)} blocks), at least one must; leave out "
            "`mass: false`"
        )
    solver = _solver(pencil, pencil.M, count, solving)
    omega2, modes = _solved(pencil, pencil.M, count, solver)
    M, load, dry = pencil.M, pencil.load, None
    if water is not None:
        M = csr_matrix(M + added_mass_matrix(water, csr_matrix(water.on(numbered.of_block))))
        load, dry = load + _carried(scene, numbered, water), np.sqrt(omega2) / (2.0 * np.pi)
        solver = _solver(pencil, M, count, solving) if pencil.shift else solver
        omega2, modes = _solved(pencil, M, count, solver)
    shapes = {name: _shapes(matrix, modes) for name, matrix in numbered.of_block.items()}
    scale = _scale(shapes)
    factor = modes.T @ load * scale[:, None]
    ratio, coupling = _damping(scene, damping, replace(pencil, M=M), omega2, modes, bonded)
    return NaturalModes(
        freq=np.sqrt(omega2) / (2.0 * np.pi),
        damping_ratio=ratio,
        damping_coupling=coupling,
        shapes={name: own / scale[:, None, None] for name, own in shapes.items()},
        modal_mass=1.0 / scale**2,
        participation=factor,
        effective_mass=(factor / scale[:, None]) ** 2,
        motion=_motion(pencil, modes),
        total_mass=total_mass(scene, water),
        dry_freq=dry,
    )


def _pencil(scene: Scene, numbered: Unknowns, bonded: bool) -> _Pencil:
    system = assemble_full(scene.without(Reservoir, FreeField, MovingSupports), DampingConfig())
    K = csr_matrix(system.K + _springs(scene, numbered)) if bonded else system.K
    heavy = system.M.diagonal() > 0.0
    stiffest = (system.K.diagonal()[heavy] / system.M.diagonal()[heavy]).max(initial=0.0)
    shift = -_SHIFT if system.floating else 0.0
    return _Pencil(
        K, system.M, system.load, shift, _RIGID * float(stiffest), _motions(scene, numbered), system.K
    )


def _springs(scene: Scene, numbered: Unknowns) -> csr_matrix:
    """Stiffness B^T diag(K_n, K_s, K_s) B of all gaps over the unknowns."""
    law, size = gap_law(scene), next(iter(numbered.of_block.values())).shape[1]
    if not np.isfinite(law.K_n).all():
        raise ConfigError(
            f"joints: {int(np.isinf(law.K_n).sum())} of {len(law)} gaps are rigid and no springs bond them, "
            "limit 0; tie their joints"
        )
    B = csr_matrix((3 * len(law), size))
    for name, operator in gap_operators(scene, 3).items():
        B = B + operator @ numbered.of_block[name]
    stiffness = np.column_stack([law.K_n, law.K_s, law.K_s]).ravel()
    return csr_matrix(B.T @ diags_array(stiffness) @ B)


def _motions(scene: Scene, numbered: Unknowns) -> Motions:
    """Nodes and rigid motions of the unknowns, part after part."""
    rows, rigid, first = [], [], 0
    for name, part in scene_parts(scene).items():
        free = numbered.free[name]
        rows.append(first + np.flatnonzero(free))
        nodes = np.arange(part.nodes)
        rigid.append(rigid_motions(part.mesh(scene.blocks), nodes).reshape(-1, 6)[free])
        first += 3 * part.nodes
    return Motions(np.concatenate(rows), np.concatenate(rigid))


def _solver(pencil: _Pencil, M: csr_matrix, count: int, solving: Solving) -> Solver:
    matrix = csr_matrix(pencil.K - pencil.shift * M) if pencil.shift else pencil.K
    return make_solver(matrix, pencil.motions, 4 * count, solving, "the whole mesh")


def _solved(pencil: _Pencil, M: csr_matrix, count: int, solver: Solver) -> tuple[Floats, Floats]:
    """Squared frequencies, zero of rigid motions, and M-orthonormal modes."""
    omega2, modes = lowest_modes_by_blocks(pencil.K, M, count, solver, pencil.shift)
    return np.where(omega2 < pencil.rigid, 0.0, omega2), modes


def _shapes(of_block: csr_matrix, modes: Floats) -> Floats:
    """(m, n, 3) displacement of a block's nodes."""
    return np.ascontiguousarray((of_block @ modes).T.reshape(modes.shape[1], -1, 3))


def _scale(shapes: dict[str, Floats]) -> Floats:
    """Largest displacement of every mode, with the sign of its largest component (m,)."""
    whole = np.concatenate(list(shapes.values()), axis=1)
    mode = np.arange(len(whole))
    node = np.linalg.norm(whole, axis=2).argmax(axis=1)
    farthest = whole[mode, node]
    sign = np.sign(farthest[mode, np.abs(farthest).argmax(axis=1)])
    return np.asarray(sign * np.linalg.norm(farthest, axis=1))


def _motion(pencil: _Pencil, modes: Floats) -> Floats:
    energy = modes * (pencil.M @ modes)
    along = np.stack([energy[pencil.motions.row % 3 == axis].sum(axis=0) for axis in range(3)], axis=1)
    return np.asarray(along / along.sum(axis=1, keepdims=True))


def _damping(
    scene: Scene, damping: DampingConfig, pencil: _Pencil, omega2: Floats, modes: Floats, bonded: bool
) -> tuple[Floats, float]:
    """Damping ratios of M-orthonormal modes and their coupling, see `NaturalModes`; M with the water's."""
    if damping.modal is not None:
        C = np.diag(np.full_like(omega2, np.nan) if bonded else modal_coefficients(damping, omega2))
    else:
        alpha, beta = rayleigh_coefficients(damping.rayleigh)
        numbered, rigid = unknowns(scene), []
        for name, part in scene_parts(scene).items():
            rows = numbered.parts[name]
            of_part = pencil.K_open[rows, rows], pencil.M[rows, rows]
            rigid.append(sliding_motions(part, scene, *of_part, numbered.free[name]))
        R = block_diag(*rigid)
        C, braked = alpha * np.eye(len(omega2)) + beta * modes.T @ (pencil.K_open @ modes), pencil.M @ R
        braked *= alpha
        for name, block in scene.blocks.items():
            spread = numbered.of_block[name]
            further = further_damping(block, damping.rayleigh, dashpots=False)
            if further is not None:
                shapes = spread @ modes
                C += shapes.T @ (further @ shapes)
            if R.shape[1] and (drag := further_drag(block, damping.rayleigh)):
                braked += drag * spread.T @ (assemble_mass(block) @ (spread @ R))
        on_rigid = rigid_drag(braked, R).T @ modes if R.shape[1] else np.zeros((0, len(omega2)))
        C -= on_rigid.T @ on_rigid
    c = C.diagonal()
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = c / (2.0 * np.sqrt(omega2))
    strained = omega2 > 0.0
    return np.where(strained, ratio, np.nan), damping_coupling(C[np.ix_(strained, strained)])


def total_mass(scene: Scene, water: AddedMass | None) -> Floats:
    """Mass (3,) along x, y, z of all blocks that are shaken, and of the water that moves with them [kg]."""
    shaken = [block for name, block in scene.blocks.items() if name not in scene.radiating]
    total = sum((_mass(block) for block in shaken), np.zeros(3))
    for one in scene.every(Attachment):
        moved = one.with_ground(scene.radiating)
        total = total + (one.mass[:, None] * moved**2).sum(axis=0)
    if water is None:
        return total
    normal = _rigid(scene, water)
    return np.asarray(total + (normal * water.times(normal)).sum(axis=0))


def _mass(block: Block) -> Floats:
    """Mass of a block along x, y, z (3,) [kg]."""
    if block.matrices is None:
        return np.full(3, block.material.rho * sound_volume(block, "the whole mesh"))
    return np.asarray((block.matrices.translations * inertia(block, block.matrices.M)).sum(axis=0))


def _rigid(scene: Scene, water: AddedMass) -> Floats:
    """Normal displacement (r, 3) of the wet faces in unit translations of the whole structure."""
    unit = {name: np.tile(np.eye(3), (len(block.points), 1)) for name, block in scene.blocks.items()}
    return np.asarray(water.on(unit))


def _carried(scene: Scene, numbered: Unknowns, water: AddedMass) -> Floats:
    """M_a r over the unknowns (n, 3): the water's, were the structure carried along through still water."""
    force = water.times(_rigid(scene, water))
    return np.asarray(
        sum(numbered.of_block[name].T @ (B.T @ force) for name, B in water.coupling.items()), dtype=float
    )
