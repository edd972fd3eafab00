"""Blocks -> reduced blocks -> one diagonal system with the joints open.

With rigid rock the blocks meet only in their joints, so each is diagonalised alone and the system is
the list of their open-joint modes.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array, eye_array, hstack

from romdam.config.models import DampingConfig, ModelConfig
from romdam.dynamics.system import System
from romdam.fem.damping import modal_coefficients
from romdam.fem.gaps import gap_law
from romdam.fem.unreduced import BlockMatrices, block_matrices
from romdam.reduction.craig_bampton import ALL_MODES, ModeChoice, Substructure, reduce_block
from romdam.reduction.interface import joint_interface
from romdam.scene.held import held_rigidly
from romdam.scene.model import Block, Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BlockBasis:
    """Displacement of a block from the reduced coordinates: u = matrix @ q[columns].

    Attributes
    ----------
    matrix : (3 n, m_s) open-joint modes, M-orthonormal, zero at supports [1/sqrt(kg)]
    columns : the block's slice of q
    """

    matrix: Floats
    columns: slice


@dataclass(frozen=True)
class ReducedModel:
    """A reduced scene.

    Attributes
    ----------
    system : diagonal, see `System`
    basis : block name -> BlockBasis
    report : block name -> numbers on its reduction, and "cpu_seconds" of the whole
    """

    system: System
    basis: dict[str, BlockBasis]
    report: dict[str, object]


def reduce_scene(scene: Scene, model: ModelConfig | ModeChoice, damping: DampingConfig) -> ReducedModel:
    """Reduce every block with the modes of a configuration, or a choice of them, and put them together.

    Raises
    ------
    ConfigError
        for more modes than a block has.
    ReductionError
        where a block cannot be reduced.
    """
    start = time.process_time()
    law = gap_law(scene)
    blocks = block_matrices(scene, law)
    reduced, basis, report, first = {}, {}, dict[str, object](), 0
    choice = model if isinstance(model, ModeChoice) else mode_choice(model)
    for name, block in scene.blocks.items():
        sub, matrix = _reduce(block, blocks[name], scene.fixed[name], choice)
        columns = slice(first, first + len(sub.omega2))
        reduced[name], basis[name] = sub, BlockBasis(matrix, columns)
        report[name] = _report(sub)
        first = columns.stop
    report["cpu_seconds"] = time.process_time() - start
    omega2 = np.concatenate([sub.omega2 for sub in reduced.values()])
    pairs = [(blocks[name], basis[name].matrix) for name in blocks]
    system = System(
        M=csr_matrix(eye_array(first)),
        C=csr_matrix(diags_array(modal_coefficients(damping, omega2))),
        K=csr_matrix(diags_array(omega2)),
        B=csr_matrix(hstack([csr_matrix(b.B @ T) for b, T in pairs])),
        load=np.vstack([T.T @ b.load for b, T in pairs]),
        force=np.concatenate([T.T @ b.force for b, T in pairs]),
        observe=_observe(scene, basis, first),
        law=law,
        parts={name: part.columns for name, part in basis.items()},
        diagonal=True,
        floating=bool((omega2 == 0.0).any()),
    )
    return ReducedModel(system=system, basis=basis, report=report)


def mode_choice(model: ModelConfig) -> ModeChoice:
    """The modes that a configuration asks for."""
    if model.modes == "all":
        return ALL_MODES
    return ModeChoice(count=model.modes, cutoff=model.cutoff, corrections=model.corrections)


def _reduce(
    block: Block, matrices: BlockMatrices, fixed: NDArray[np.bool_], choice: ModeChoice
) -> tuple[Substructure, Floats]:
    """Reduce one block; its substructure and its basis over all DOFs in global axes."""
    interface = joint_interface(matrices.B, fixed)
    turn, free = interface.turn, matrices.free
    K = csr_matrix(turn @ matrices.K @ turn.T)[free][:, free]
    M = csr_matrix(turn @ matrices.M @ turn.T)[free][:, free]
    held = _held_interior(block, fixed, interface.retained.reshape(-1, 3), turn)
    sub = reduce_block(K, M, interface.retained[free], held, choice, f"block {block.name!r}")
    whole = np.zeros((len(free), len(sub.omega2)))
    whole[free] = sub.basis
    return sub, np.asarray(turn.T @ whole)


def _held_interior(
    block: Block, fixed: NDArray[np.bool_], retained: NDArray[np.bool_], turn: csr_matrix
) -> bool:
    """Whether supports and retained DOFs, held, stop every rigid motion.

    Retained DOFs in turned frames are not counted: at worst the shift is used where none is needed.
    """
    held = fixed.copy()
    for node in np.flatnonzero(retained.any(axis=1)):
        frame = turn[3 * node : 3 * node + 3, 3 * node : 3 * node + 3].toarray()
        if np.array_equal(frame, np.eye(3)):
            held[node] |= retained[node]
    return held_rigidly(block, held)


def _report(sub: Substructure) -> dict[str, object]:
    return {
        "retained_dofs": sub.retained,
        "fixed_interface_modes": sub.fixed_interface,
        "corrections": sub.corrections,
        "highest_fixed_interface_hz": sub.highest,
        "frequencies_hz": [float(f) for f in np.sqrt(sub.omega2[:10]) / (2.0 * np.pi)],
        "orthonormality_error": sub.orthonormality,
        "eigenvalue_residual": sub.residual,
    }


def _observe(scene: Scene, basis: dict[str, BlockBasis], size: int) -> csr_matrix:
    rows = np.zeros((3 * len(scene.probes), size))
    for k, probe in enumerate(scene.probes):
        part = basis[probe.block]
        rows[3 * k : 3 * k + 3, part.columns] = part.matrix[3 * probe.node : 3 * probe.node + 3]
    return csr_matrix(rows)
