"""Blocks with merged interfaces over their free DOFs: matrices, loads, and where each block has its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags_array, hstack

from romdam.core.arrays import Floats
from romdam.core.scene import Bools, Ints, Scene
from romdam.effects.added_mass import WetMass
from romdam.fem.parts import gather, part_matrices
from romdam.linalg.modes.rigid import rigid_modes
from romdam.linalg.multigrid import Motions
from romdam.linalg.symmetric import Symmetric
from romdam.reduction.methods.boundary_forces import boundary_tractions, free_field_forces
from romdam.reduction.methods.craig_bampton import FREE_SHIFT
from romdam.reduction.methods.inertia_relief import unbalanced
from romdam.scene.supports import rigid_motions
from romdam.scene.ties import Part


@dataclass(frozen=True)
class MergedPart:
    """A part over its free DOFs.

    Attributes
    ----------
    K, M : (n, n), of K the upper triangle
    right : (n, a) sparse, of unit length: what the basis answers statically right
    held : whether supports stop every rigid motion
    motions : of the free DOFs
    rigid : (n, r) M-orthonormal rigid motions that supports leave
    row : (N,) number of every DOF of every block among the free ones, block after block; -1 where it is none
    slaves : those that follow free DOFs, and what they follow, (s, n) sparse; None without mortar ties
    inertia : block name -> (3 nodes, 3) M r of its own
    wet : added mass of water, None without any
    place : what to call the part in messages
    """

    K: Symmetric
    M: csr_matrix
    right: csc_matrix
    held: bool
    motions: Motions
    rigid: Floats
    row: Ints
    slaves: tuple[Ints, csr_matrix] | None
    inertia: dict[str, Floats]
    wet: WetMass | None
    place: str

    @property
    def shift(self) -> float:
        """K less it times M is positive definite."""
        return 0.0 if self.held else -FREE_SHIFT

    @property
    def inner(self) -> Bools:
        """(n,) where there is neither mass nor load: the inside of rock without mass."""
        return np.asarray((self.M.diagonal() == 0.0) & (np.diff(csr_matrix(self.right).indptr) == 0))

    @property
    def first(self) -> Ints:
        """(n,) where every free DOF stands among the blocks' for the first time."""
        found = np.empty(self.K.shape[0], dtype=np.int64)
        here = np.flatnonzero(self.row >= 0)[::-1]
        found[self.row[here]] = here
        return found

    def over_blocks(self, values: Floats) -> Floats:
        """Values of the free DOFs over those of every block, zero where held."""
        found = np.take(values, self.row, axis=0, mode="wrap")  # quicker than values[row]
        found[self.row < 0] = 0.0
        if self.slaves is not None:
            which, follow = self.slaves
            found[which] = follow @ values
        return found


def merged_part(
    part: Part, scene: Scene, operator: csr_matrix, static: Floats, wet: WetMass | None, carried: Floats
) -> MergedPart:
    """The matrices of a part, and the loads that its basis is to answer statically right.

    Parameters
    ----------
    operator : gap operator of the part
    static : (3 nodes, l) static forces on it
    wet : added mass of its water
    carried : inertia of supports that move on their own, over the part's nodes
    """
    fixed = part.fixed(scene.fixed)
    free = ~fixed.ravel()
    K, M, inertia = part_matrices(part, scene.blocks)
    K, M = csr_matrix(K[free][:, free]), csr_matrix(M[free][:, free])
    shaken = [name for name in part.blocks if name not in scene.radiating]
    heavy = [name for name in part.blocks if name not in scene.excluded_from_gravity]
    loads = [
        _sum(part, inertia, shaken),
        static,
        _sum(part, inertia, heavy)[:, : 3 if 0 < len(heavy) < len(part.blocks) else 0],
        boundary_tractions(part, scene),
        free_field_forces(part, scene),
        carried,
    ]
    mesh, held = part.mesh(scene.blocks), part.stands_free(scene)
    motions = Motions(np.flatnonzero(free), rigid_motions(mesh, np.arange(part.nodes)).reshape(-1, 6)[free])
    rigid = np.zeros((K.shape[0], 0)) if held or not M.diagonal().any() else rigid_modes(K, M, motions.rigid)
    right = _unit_columns([operator[:, free].T, *(load[free] for load in loads)])
    dofs = np.concatenate([(3 * part.number[name][:, None] + np.arange(3)).ravel() for name in part.blocks])
    row = np.full(3 * part.every_node, -1)
    row[np.flatnonzero(free)] = np.arange(K.shape[0])
    return MergedPart(
        K=Symmetric(K),
        M=M,
        right=right[:, unbalanced(right, rigid, M)],
        held=held,
        motions=motions,
        rigid=rigid,
        row=row[dofs],
        slaves=_slaves(part, dofs, free),
        inertia=inertia,
        wet=None if wet is None else WetMass(wet.operator[:, free], wet.flexibility),
        place=f"part {part.name}",
    )


def _slaves(part: Part, dofs: Ints, free: Bools) -> tuple[Ints, csr_matrix] | None:
    """DOFs of the blocks, by numbers in the part, that follow free ones, and the rows by which they do."""
    if part.slaves is None:
        return None
    which = np.flatnonzero(dofs >= 3 * part.nodes)
    return which, part.slaves[dofs[which] - 3 * part.nodes][:, free]


def _sum(part: Part, inertia: dict[str, Floats], blocks: list[str]) -> Floats:
    """M r of some of the blocks, (3 nodes, 3)."""
    some = {name: values if name in blocks else np.zeros_like(values) for name, values in inertia.items()}
    return gather(part, some)


def _unit_columns(loads: list[csr_matrix | Floats]) -> csc_matrix:
    """The loads that are not zero, each of unit length."""
    right = csc_matrix(hstack([csc_matrix(load) for load in loads]))
    length = np.sqrt(np.asarray(right.multiply(right).sum(axis=0)).ravel())
    some = np.flatnonzero(length > 0.0)
    return csc_matrix(right[:, some] @ diags_array(1.0 / length[some]))
