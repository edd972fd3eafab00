"""Blocks with merged interfaces over their free DOFs: matrices, loads, and where each block has its DOFs.

Inertia relief gives the part of a force that a floating body answers by straining. Nothing holds it
statically. With R its rigid motions, R^T M R = 1, the force f - M R R^T f is in equilibrium with the inertia
of the acceleration R R^T f, and its response has no rigid part. If K less a small shift times M stands for K,
f itself would be answered by a rigid motion, a million times the strain.

References
----------
Rubin, AIAA Journal 13 (1975) 995; Craig, Kurdila, Fundamentals of Structural Dynamics (2006), ch. 17.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags_array, eye_array, hstack

from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.scene import FreeField
from romdam.effects.added_mass import WetMass
from romdam.effects.free_field import field_motions
from romdam.fem.absorbing import boundary_dashpots
from romdam.fem.parts import assemble_part, gather
from romdam.linalg.modes.rigid import rigid_modes
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import Solver, Solving, make_solver
from romdam.linalg.symmetric import Symmetric
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.reduction.substructure import FREE_SHIFT, Substructure
from romdam.scene.supports import rigid_motions

_BALANCED = 1e-10  # square of what is left of a load of unit length, below which that is round-off
_TOGETHER = 256  # loads that are answered at a time


@dataclass(frozen=True)
class MergedPart:
    """A part over its free DOFs.

    Attributes
    ----------
    K, M : (n, n), of K the upper triangle
    right : (n, a) sparse, of unit length: loads whose static response the basis contains
    held : whether supports stop every rigid motion
    motions : of the free DOFs
    rigid : (n, r) M-orthonormal rigid motions that supports leave
    row : (N,) number of every DOF of every block among the free ones, block after block; -1 where it is none
    slaves : those that follow free DOFs, (s,); None without mortar ties
    slave_weights : what they follow, (s, n) sparse; None without mortar ties
    wet : added mass of water, None without any
    label : what to call the part in messages
    """

    K: Symmetric
    M: csr_matrix
    right: csc_matrix
    held: bool
    motions: Motions
    rigid: Floats
    row: Ints
    slaves: Ints | None
    slave_weights: csr_matrix | None
    wet: WetMass | None
    label: str

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
        firsts = np.empty(self.K.shape[0], dtype=np.int64)
        rows = np.flatnonzero(self.row >= 0)[::-1]
        firsts[self.row[rows]] = rows
        return firsts

    def over_blocks(self, values: Floats) -> Floats:
        """Values of the free DOFs over those of every block, zero where held."""
        spread = np.take(values, self.row, axis=0, mode="wrap")  # quicker than values[row]
        spread[self.row < 0] = 0.0
        if self.slaves is not None and self.slave_weights is not None:
            spread[self.slaves] = self.slave_weights @ values
        return spread

    def static_response(self, solver: Solver, force: Floats) -> Floats:
        """Responses to static forces (n, k); of a floating part with inertia relief.

        Parameters
        ----------
        solver : for K - s M
        """
        rigid = self.rigid
        if not rigid.shape[1]:
            return solver.solve(force)
        inertia = self.M @ rigid
        response = solver.solve(force - inertia @ (rigid.T @ force))
        return np.asarray(response - rigid @ (inertia.T @ response))

    def work(self, T: OutOfCoreMatrix) -> Floats:
        """Work (a, m) of the loads, with inertia relief, on vectors T (N, m) over the DOFs of every block."""

        def over_every_block(loads: csc_matrix) -> csr_matrix:
            """Transposed loads, each free DOF counted once."""
            across = csr_matrix(loads.T)
            entries = (across.data, self.first[across.indices], across.indptr)
            return csr_matrix(entries, shape=(loads.shape[1], T.shape[0]))

        total = T.before(over_every_block(self.right))
        if self.rigid.shape[1]:
            inertia = over_every_block(csc_matrix(self.M @ self.rigid))
            total -= (self.right.T @ self.rigid) @ T.before(inertia)
        return total


def merge_blocks(substructure: Substructure, loads: Sequence[csr_matrix | Floats], label: str) -> MergedPart:
    """Add the matrices of a part's blocks, and scale its loads.

    Parameters
    ----------
    loads : each (3 nodes, k): what the basis is to answer statically right
    label : what to call the part in messages
    """
    mesh_part, scene, free = substructure.mesh_part, substructure.scene, substructure.free
    K, M = assemble_part(mesh_part, substructure.assembly)
    K, M = csr_matrix(K[free][:, free]), csr_matrix(M[free][:, free])
    held, wet = mesh_part.stands_free(scene), substructure.wet
    motions = _motions(substructure)
    rigid = np.zeros((K.shape[0], 0)) if held or not M.diagonal().any() else rigid_modes(K, M, motions.rigid)
    # loads that are not zero, each of unit length, that do more than accelerate the part rigidly
    right = csc_matrix(hstack([csc_matrix(load[free]) for load in loads]))
    length = np.sqrt(np.asarray(right.multiply(right).sum(axis=0)).ravel())
    some = np.flatnonzero(length > 0.0)
    right = csc_matrix(right[:, some] @ diags_array(1.0 / length[some]))
    dofs = np.concatenate(
        [(3 * mesh_part.number[name][:, None] + np.arange(3)).ravel() for name in mesh_part.blocks]
    )
    row = np.full(3 * mesh_part.every_node, -1)
    row[np.flatnonzero(free)] = np.arange(K.shape[0])
    slaves = weights = None
    if mesh_part.slaves is not None:
        slaves = np.flatnonzero(dofs >= 3 * mesh_part.nodes)
        weights = mesh_part.slaves[dofs[slaves] - 3 * mesh_part.nodes][:, free]
    return MergedPart(
        K=Symmetric(K),
        M=M,
        right=right[:, unbalanced(right, rigid, M)],
        held=held,
        motions=motions,
        rigid=rigid,
        row=row[dofs],
        slaves=slaves,
        slave_weights=weights,
        wet=None if wet is None else WetMass(wet.operator[:, free], wet.flexibility),
        label=label,
    )


def _motions(substructure: Substructure) -> Motions:
    """Rigid motions of a part's free DOFs."""
    mesh_part, free = substructure.mesh_part, substructure.free
    mesh, nodes = mesh_part.mesh(substructure.scene.blocks), np.arange(mesh_part.nodes)
    return Motions(np.flatnonzero(free), rigid_motions(mesh, nodes).reshape(-1, 6)[free])


def sustained_forces(
    substructure: Substructure, loads: Sequence[csr_matrix | Floats], solving: Solving
) -> csr_matrix:
    """Forces that K answers as the stiffness at rest, K_s, does loads: (3 nodes, l), K K_s^-1 loads.

    Less K_s / r of that, which the loads span, with r the ratio of the sustained modulus to that of the
    record in most of the part. Inside a block they are a factor times the loads, so that they stand where
    loads do and where blocks of other ratios meet. Empty where all blocks have one ratio.

    Parameters
    ----------
    loads : each (3 nodes, k)
    """
    mesh_part, scene, free = substructure.mesh_part, substructure.scene, substructure.free
    ratios = {name: scene.blocks[name].material.sustained_ratio for name in mesh_part.blocks}
    size = 3 * mesh_part.nodes
    if len(set(ratios.values())) < 2:
        return csr_matrix((size, 0))
    most = max(ratios, key=lambda name: len(scene.blocks[name].points))
    K_s, rest = csr_matrix((size, size)), csr_matrix((size, size))
    met = np.zeros((2, size), dtype=bool)  # DOFs of the ratio of most, and of others
    for name, ratio in ratios.items():
        spread = mesh_part.spread(name)
        stiffness = spread.T @ substructure.assembly.matrices(name)[0] @ spread
        K_s, rest = K_s + ratio * stiffness, rest + (1.0 - ratio / ratios[most]) * stiffness
        met[int(ratio != ratios[most])] |= spread.getnnz(axis=0) > 0
    rest = csr_matrix(rest[free][:, free])
    # three ratios: blocks of others than most meet each other, too
    interface = (met[1] if len(set(ratios.values())) > 2 else met[0] & met[1])[free]
    right = csc_matrix(hstack([csc_matrix(load[free]) for load in loads]))
    right = right[:, np.flatnonzero(right.getnnz(axis=0))]
    solver = make_solver(
        Symmetric(csr_matrix(K_s[free][:, free])),
        _motions(substructure),
        right.shape[1],
        solving,
        f"part {mesh_part.name} under loads that last",
    )
    columns = [csr_matrix((right.shape[0], 0))]
    for first in range(0, right.shape[1], _TOGETHER):
        some = right[:, first : first + _TOGETHER].toarray()
        forces = rest @ solver.solve(some)
        columns.append(csr_matrix(np.where(interface[:, None] | (some != 0.0), forces, 0.0)))
    spread_free = csr_matrix(eye_array(size, format="csr")[:, free])
    return csr_matrix(spread_free @ hstack(columns))


def unbalanced(loads: csc_matrix, rigid: Floats, M: csr_matrix) -> Ints:
    """Numbers of the loads (n, a), of unit length, that do more than accelerate a body rigidly.

    Parameters
    ----------
    rigid : (n, r) M-orthonormal rigid motions
    """
    inertia, along = M @ rigid, loads.T @ rigid
    left = 1.0 - ((2.0 * (loads.T @ inertia) - along @ (inertia.T @ inertia)) * along).sum(axis=1)
    return np.flatnonzero(left > _BALANCED)


def ground_inertia(substructure: Substructure) -> list[Floats]:
    """Inertia M r (3 nodes, 3) of the blocks that are shaken; and, if some have no weight, of the others."""
    mesh_part, scene = substructure.mesh_part, substructure.scene
    inertia = {name: substructure.assembly.inertia(name) for name in mesh_part.blocks}
    shaken = [name for name in mesh_part.blocks if name not in scene.radiating]
    heavy = [name for name in mesh_part.blocks if name not in scene.loads.excluded_from_gravity]
    total = []
    for blocks in (shaken, heavy) if 0 < len(heavy) < len(mesh_part.blocks) else (shaken,):
        counted = {
            name: values if name in blocks else np.zeros_like(values) for name, values in inertia.items()
        }
        total.append(gather(mesh_part, counted))
    return total


def boundary_tractions(substructure: Substructure) -> Floats:
    """Forces of every absorbing face's dashpots when it moves rigidly, (3 nodes, 6 faces)."""
    mesh_part = substructure.mesh_part
    columns = [np.zeros((3 * mesh_part.nodes, 0))]
    for name in mesh_part.blocks:
        block = substructure.scene.blocks[name]
        for face in block.absorbing:
            arm = block.points - block.points[face.facets].mean(axis=(0, 1))
            turned = [np.cross(axis, arm).ravel() for axis in np.eye(3)]
            rigid = np.column_stack([np.tile(np.eye(3), (len(arm), 1)), *turned])
            alone = replace(block, absorbing=(face,))
            columns.append(mesh_part.spread(name).T @ (boundary_dashpots(alone) @ rigid))
    return np.hstack(columns)


def free_field_forces(substructure: Substructure) -> csr_matrix:
    """Static forces that move rock as `field_motions` of the free field do, (3 nodes, columns)."""
    mesh_part, field = substructure.mesh_part, substructure.scene.find(FreeField)
    if field is None or field.blocks.isdisjoint(mesh_part.blocks):
        return csr_matrix((3 * mesh_part.nodes, 0))
    return csr_matrix(
        sum(
            mesh_part.spread(name).T
            @ (
                substructure.assembly.matrices(name)[0]
                @ field_motions(substructure.scene.blocks[name], field)
            )
            for name in mesh_part.blocks
            if name in field.blocks
        )
    )
