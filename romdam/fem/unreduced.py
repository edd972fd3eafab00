"""The unreduced mesh of a scene as one sparse system over its free DOFs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_matrix, hstack

from romdam.config.models import DampingConfig
from romdam.dynamics.system import GapLaw, System
from romdam.errors import ConfigError
from romdam.fem.assembly import assemble
from romdam.fem.damping import rayleigh_coefficients
from romdam.fem.gaps import gap_law, gap_operators
from romdam.fem.loads import static_force
from romdam.scene.held import held_rigidly
from romdam.scene.model import Scene

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class BlockMatrices:
    """One block over all its DOFs (3 * node + component), supports not yet applied.

    Attributes
    ----------
    K, M : (3 n, 3 n) sparse
    B : (directions * ng, 3 n) sparse gap operator
    load : (3 n, 3) M r for unit ground acceleration along x, y, z
    force : (3 n,) static force
    free : (3 n,) True where no support holds
    """

    K: csr_matrix
    M: csr_matrix
    B: csr_matrix
    load: Floats
    force: Floats
    free: Bools


def block_matrices(scene: Scene, law: GapLaw) -> dict[str, BlockMatrices]:
    """Assemble every block of the scene."""
    operators = gap_operators(scene, law.directions)
    found = {}
    for name, block in scene.blocks.items():
        K, M = assemble(block)
        found[name] = BlockMatrices(
            K=K,
            M=M,
            B=operators[name],
            load=M @ np.tile(np.eye(3), (len(block.points), 1)),
            force=static_force(scene, name, M).ravel(),
            free=~scene.fixed[name].ravel(),
        )
    return found


def assemble_full(scene: Scene, damping: DampingConfig) -> System:
    """Build the unreduced system.

    Parameters
    ----------
    scene : the scene
    damping : none or Rayleigh; modal ratios would make C dense

    Raises
    ------
    ConfigError
        for modal damping.
    """
    if damping.modal is not None:
        raise ConfigError(
            "damping.modal: a full-order model takes `rayleigh` damping only (modal ratios would make C "
            "dense); give damping.rayleigh, or use model.order: reduced"
        )
    law = gap_law(scene)
    blocks = block_matrices(scene, law)
    M = csr_matrix(block_diag([b.M[b.free][:, b.free] for b in blocks.values()]))
    K = csr_matrix(block_diag([b.K[b.free][:, b.free] for b in blocks.values()]))
    alpha, beta = rayleigh_coefficients(damping.rayleigh)
    ends = np.cumsum([0] + [int(b.free.sum()) for b in blocks.values()])
    parts = {name: slice(a, b) for name, a, b in zip(blocks, ends[:-1], ends[1:], strict=True)}
    return System(
        M=M,
        C=csr_matrix(alpha * M + beta * K),
        K=K,
        B=csr_matrix(hstack([b.B[:, b.free] for b in blocks.values()])),
        load=np.vstack([b.load[b.free] for b in blocks.values()]),
        force=np.concatenate([b.force[b.free] for b in blocks.values()]),
        observe=_observe(scene, blocks, parts),
        law=law,
        parts=parts,
        diagonal=False,
        floating=not all(held_rigidly(block, scene.fixed[name]) for name, block in scene.blocks.items()),
    )


def _observe(scene: Scene, blocks: dict[str, BlockMatrices], parts: dict[str, slice]) -> csr_matrix:
    size = max((part.stop for part in parts.values()), default=0)
    rows, columns = [], []
    for k, probe in enumerate(scene.probes):
        free = blocks[probe.block].free
        number = np.cumsum(free) - 1 + parts[probe.block].start
        for c in range(3):
            if free[3 * probe.node + c]:
                rows.append(3 * k + c)
                columns.append(number[3 * probe.node + c])
    return csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(3 * len(scene.probes), size))
