"""Craig-Bampton reduction of a large block out of core: the basis of `craig_bampton`, never whole in memory.

Constraint modes are solved for in blocks of right-hand sides that go to disk as they come; a run that is
stopped goes on there. With T = [Psi, Phi; 1, 0] the reduced stiffness needs no product with T,

    T^T (K - s M) T = diag(S, omega^2 - s),    S = (K - s M)_bb + (K - s M)_bi Psi,

and M_r = T^T M T takes two blocks of columns at a time. T goes to the block's file, of which a reader maps
the rows that it touches, and V beside it: the open-joint modes T V are formed where they are asked for.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Bools, Floats
from romdam.effects.added_mass import WetMass
from romdam.linalg.dense import independent, without_roundoff
from romdam.linalg.modes.rigid import rigid_modes
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import Solver, make_solver
from romdam.reduction.methods.craig_bampton import (
    FixedInterfaceModes,
    ReducedBlock,
    diagonalise,
    fixed_interface_modes,
    over_interior,
    retains_joint_nodes,
)
from romdam.reduction.methods.residual_vectors import (
    FINER_LEAST,
    FINER_VECTORS,
    larger,
    lowest_with,
)
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.reductor import Bases, BasisFiles, Reductor
from romdam.reduction.storage.keys import block_content
from romdam.reduction.storage.model_file import StreamedBasis
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.reduction.substructure import Substructure

log = logging.getLogger(__name__)

LARGE = 200e6  # bytes of a basis from which on it goes through the disk
_NODES = 4096  # of the basis at a time


class CraigBamptonOutOfCore(Reductor):
    """Fixed-interface modes of a block whose basis is large; all modes of a block need it in memory."""

    name: ClassVar[str] = "craig_bampton_out_of_core"
    out_of_core: ClassVar[bool] = True

    def serves(self, substructure: Substructure, choice: ModeChoice) -> bool:
        """A basis of more than `LARGE` bytes that is not of all modes; see `retains_joint_nodes`."""
        if choice.keeps_all or not retains_joint_nodes(substructure):
            return False
        retained = substructure.interface.retained
        return 8.0 * len(retained) * (int(retained.sum()) + choice.expected_modes) > LARGE

    def key(self, substructure: Substructure, choice: ModeChoice) -> object:
        """The block, whatever its name, and its loads."""
        return block_content(substructure, choice)

    def reduce(self, substructure: Substructure, choice: ModeChoice, files: BasisFiles) -> Iterator[Bases]:
        """Yield the basis and, if it is asked for, a finer one, each in its file; both have the same T."""
        (name,) = substructure.blocks
        block = _split(substructure)
        substructure.assembly.release(substructure.blocks)
        T, modes, reduced = _ritz_vectors(block, choice, files)
        boundary, free = block.boundary, ~substructure.scene.fixed[name].ravel()
        for level, (K, M) in enumerate(reduced):
            low, V = diagonalise(K + block.shift * M, M, block.label)
            numbers = ReducedBlock(
                omega2=without_roundoff(low),
                basis=np.zeros((0, 0)),
                more=np.zeros((0, 0)),
                mix=np.zeros((0, 0)),
                retained=boundary,
                fixed_interface=modes.modes,
                static=len(modes.omega2) - modes.modes,
                highest=modes.highest,
                orthonormality=modes.orthonormality,
                residual=modes.residual,
                residual_vectors=len(V) - boundary - len(modes.omega2),
            )
            rows = _rows_over_nodes(block, T.narrowed(len(V)), free)
            report = numbers.report() | choice.report()
            basis = StreamedBasis(numbers.omega2, rows, block.inertia, report, V)
            yield {name: files.write(substructure.scene.blocks[name], basis, level)}
        T.remove()


@dataclass(frozen=True)
class _SplitBlock:
    """A block over its free DOFs in turned frames, split in retained and interior DOFs i.

    Attributes
    ----------
    retained : (n,) True for retained DOFs
    K_retained : rows of K - s M at the retained DOFs
    M : (n, n) mass
    K_ii, M_ii : K - s M and M of the interior
    coupling : columns of K - s M at the retained DOFs, over the interior
    loads : (n_i, l) forces on the interior whose static response the basis contains
    motions : rigid motions of the interior
    wet : added mass of water; None without any
    spread, inertia, shift, label : see `FreeBlock`
    """

    retained: Bools
    K_retained: csr_matrix
    M: csr_matrix
    K_ii: csr_matrix
    M_ii: csr_matrix
    coupling: csr_matrix
    loads: Floats
    motions: Motions
    wet: WetMass | None
    spread: csr_matrix
    inertia: Floats
    shift: float
    label: str

    @property
    def boundary(self) -> int:
        """Number of retained DOFs."""
        return self.coupling.shape[1]

    def stiffness_inside(self, vectors: Floats) -> Floats:
        """Forces (K - s M) of vectors (n, k) on the interior."""
        inside = self.K_ii @ vectors[~self.retained]
        return np.asarray(inside + self.coupling @ vectors[self.retained])


def _split(substructure: Substructure) -> _SplitBlock:
    """Split the matrices of a block; the whole stiffness goes when this returns."""
    block = substructure.free_block()
    retained, shift = block.retained, block.shift
    stiffness = block.K - shift * block.M if shift else block.K
    interior = stiffness[~retained]
    return _SplitBlock(
        retained=retained,
        K_retained=csr_matrix(stiffness[retained]),
        M=block.M,
        K_ii=interior[:, ~retained],
        M_ii=block.M[~retained][:, ~retained],
        coupling=csr_matrix(interior[:, retained]),
        loads=block.loads[~retained],
        motions=block.motions.of(~retained),
        wet=block.wet,
        spread=block.spread,
        inertia=block.inertia,
        shift=shift,
        label=block.label,
    )


def _ritz_vectors(
    block: _SplitBlock, choice: ModeChoice, files: BasisFiles
) -> tuple[OutOfCoreMatrix, FixedInterfaceModes, list[tuple[Floats, Floats]]]:
    """Compute the Ritz vectors T; the solver goes when they are there.

    Returns
    -------
    T : constraint modes, fixed-interface modes with static vectors, and residual vectors
    modes : the fixed-interface modes
    reduced : for the basis, and a finer one if it is asked for: T^T (K - s M) T and T^T M T of its first
        vectors
    """
    retained, shift, boundary = block.retained, block.shift, block.boundary
    columns = boundary + choice.columns + block.loads.shape[1]
    solver = make_solver(block.K_ii, block.motions, columns, choice.solving, block.label)
    T = files.scratch(len(retained), boundary)
    T.fill(boundary, lambda first, last: _constraint_modes(block, solver, first, last))
    log.info("%s: %d constraint modes; the modes are to come", block.label, boundary)
    K = block.K_ii + shift * block.M_ii if shift else block.K_ii
    if shift:
        choice = choice.with_rigid_motions(rigid_modes(K, block.M_ii, block.motions.rigid).shape[1])
    modes = fixed_interface_modes(K, block.M_ii, block.loads, choice, solver, shift)
    T.widen(len(modes.omega2))
    T.fill(T.shape[1], lambda a, b: over_interior(retained, modes.Phi[:, a - boundary : b - boundary]))
    K_r = np.zeros((T.shape[1],) * 2)
    K_r[:boundary, :boundary] = T.before(block.K_retained)[:, :boundary]
    K_r[np.arange(boundary, len(K_r)), np.arange(boundary, len(K_r))] = modes.omega2 - shift
    M_r, reduced = T.gram(block.M), []
    levels: list[tuple[int, float, WetMass | None]] = [(choice.residual_vectors, 0.0, None)]
    if files.finer:
        levels.append((FINER_VECTORS, FINER_LEAST, block.wet))
    for count, least, wet in levels:
        if count:
            low, V = diagonalise(K_r + shift * M_r, M_r, block.label)
            D = _residual_vectors(block, solver, T, low, V, count, least, wet)
            KD = np.empty_like(D)
            KD[retained] = block.K_retained @ D
            KD[~retained] = block.stiffness_inside(D)
            T.append(D)
            K_r, M_r = _bordered(K_r, T.before(KD.T)), _bordered(M_r, T.before((block.M @ D).T))
        reduced.append((K_r, M_r))
    return T, modes, reduced


def _constraint_modes(block: _SplitBlock, solver: Solver, first: int, last: int) -> Floats:
    """Constraint modes `first` to `last`, (n, last - first)."""
    T = over_interior(block.retained, -solver.solve(block.coupling[:, first:last].toarray()))
    T[np.flatnonzero(block.retained)[first:last], np.arange(last - first)] = 1.0
    return T


def _residual_vectors(
    block: _SplitBlock,
    solver: Solver,
    T: OutOfCoreMatrix,
    omega2: Floats,
    V: Floats,
    count: int,
    least: float,
    wet: WetMass | None,
) -> Floats:
    """Static responses (n, r) to what the lowest open-joint modes leave, M-orthonormal and apart from T.

    Parameters
    ----------
    omega2, V : of the open-joint modes T V
    count : number of modes
    least : M-norm below which a vector is left out; see `larger`
    wet : added mass of water in these modes; None without any
    """
    M, inside, shift = block.M, ~block.retained, block.shift
    added_mass = None if wet is None else wet.of(T.before(wet.operator) @ V)
    lowest, coefficients = lowest_with(added_mass, omega2, V, count)
    modes = T.combined(coefficients[:, : len(lowest)])
    unbalanced = block.stiffness_inside(modes)
    unbalanced -= (M @ (modes * (lowest - shift)))[inside]
    if wet is not None:
        unbalanced -= wet.inertia(T.combined(coefficients) * lowest)[inside]

    def apart(D: Floats) -> Floats:
        """Part of vectors that is M-orthogonal to T."""
        return np.asarray(D - T.combined(V @ (V.T @ T.before((M @ D).T).T)))

    D = over_interior(block.retained, solver.solve(unbalanced))
    D = independent(larger(apart(D), M, lowest, least), M)
    return independent(apart(D), M)  # again, against round-off


def _bordered(known: Floats, rows: Floats) -> Floats:
    """A symmetric matrix whose first rows and columns are known, with its last rows (k, m)."""
    whole = np.empty((rows.shape[1],) * 2)
    first = len(known)
    whole[:first, :first] = known
    whole[first:] = rows
    whole[:, first:] = whole[first:].T
    return whole


def _rows_over_nodes(block: _SplitBlock, T: OutOfCoreMatrix, free: Bools) -> Iterator[Floats]:
    """Ritz vectors T over all DOFs in global axes, some nodes at a time: (3 nodes, m).

    Parameters
    ----------
    free : (3 nodes,) True where no support holds
    """
    spread = csr_matrix(block.spread)
    ends = [*range(0, len(free), 3 * _NODES), len(free)]
    free_ends = np.concatenate([[0], np.cumsum(free)])[ends].tolist()
    pieces = zip(pairwise(ends), pairwise(free_ends), T.pieces(free_ends), strict=True)
    for (first, last), (first_free, last_free), rows in pieces:
        yield spread[first:last][:, first_free:last_free] @ rows
