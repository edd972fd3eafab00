"""Craig-Bampton reduction of one block.

The displacement is u = Psi u_b + Phi q with the retained joint DOFs u_b, the constraint modes
Psi = -K_ii^-1 K_ib over the interior DOFs i, and the fixed-interface modes Phi below the cut-off. If retained
DOFs and supports do not prevent rigid motions of the interior (normal gaps alone hold the block), K_ii is
singular. Then K_ii - s M_ii with a small negative shift s replaces it, and the rigid motions are among Phi.
The basis is still a Ritz basis, and complete with all modes. Without such motions s is zero.

Static vectors: the static responses K_ii^-1 f_i of the interior to the inertia of the ground acceleration and
to the loads f are added to Phi. Their span with Psi contains K^-1 f, so that the static response to these
loads is that of the mesh for any number of modes. They are made M-orthogonal to the modes and diagonal in K,
and are then treated like modes (modal truncation augmentation); their omega^2 are no natural frequencies.

Residual vectors: the static responses of the interior, K_ii^-1 (K phi - omega^2 M phi)_i, to the unbalanced
forces of the lowest open-joint modes phi of this basis. Each costs one solution, and reduces the error more
than further fixed-interface modes do (docs/errors.md, "Choosing modes, steps and mesh").

References
----------
Craig, Bampton, AIAA Journal 6 (1968) 1313; Dickens, Nakagawa, Wittbrodt, Computers & Structures 62 (1997) 985
(modal truncation augmentation).
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import repeat
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Bools, Floats
from romdam.core.basis import BlockBasis
from romdam.core.errors import ReductionError
from romdam.effects.added_mass import WetMass
from romdam.linalg.dense import DEPENDENT, eigh, independent, orthonormalising, without_roundoff
from romdam.linalg.modes.eigen import dense_modes, modes_below
from romdam.linalg.modes.rigid import rigid_modes, without_strain
from romdam.linalg.solvers import Solver, make_solver
from romdam.linalg.symmetric import Symmetric
from romdam.reduction.basis import Augmented
from romdam.reduction.interface import sees_more_nodes_than_gaps
from romdam.reduction.methods.flexible_rest import needs_no_mass
from romdam.reduction.methods.residual_vectors import (
    FINER_LEAST,
    FINER_VECTORS,
    ROUND_OFF,
    Interior,
    larger,
    lowest_with,
)
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.reductor import Bases, BasisFiles, Reductor
from romdam.reduction.storage.keys import block_content
from romdam.reduction.substructure import FREE_SHIFT, FreeBlock, Substructure

log = logging.getLogger(__name__)


def retains_joint_nodes(substructure: Substructure) -> bool:
    """Tell whether Craig-Bampton reduction serves a part: a single block that retains what its joints see.

    It does not serve a block whose joints see very many nodes, which are better kept without mass
    (`flexible_rest`), nor one whose joints see more nodes than they have gaps, for which fewer unknowns do,
    nor one with a viscous boundary that nothing else has to hold: its forces need exact static responses.
    """
    if len(substructure.blocks) > 1:
        return False
    (name,) = substructure.blocks
    if needs_no_mass(substructure, int(substructure.interface.retained.sum())):
        return False
    if substructure.scene.blocks[name].absorbing and substructure.mesh_part.stands_free(substructure.scene):
        return False
    loads = substructure.block_loads
    return not sees_more_nodes_than_gaps(loads.operators[name], substructure.interface, loads.directions)


class CraigBampton(Reductor):
    """Fixed-interface modes of a block in memory."""

    name: ClassVar[str] = "craig_bampton"

    def serves(self, substructure: Substructure, choice: ModeChoice) -> bool:
        """See `retains_joint_nodes`."""
        return retains_joint_nodes(substructure)

    def key(self, substructure: Substructure, choice: ModeChoice) -> object:
        """The block, whatever its name, and its loads."""
        return block_content(substructure, choice)

    def reduce(self, substructure: Substructure, choice: ModeChoice, files: BasisFiles) -> Iterator[Bases]:
        """Yield the basis, then one with `FINER_VECTORS` residual vectors more that contains it."""
        (name,) = substructure.blocks
        log.info("block %s: reducing", name)
        block, first = substructure.free_block(), None
        for reduced in reduce_block(block, choice):
            report = reduced.report() | choice.report()
            if first is None:
                first = block.basis(reduced.omega2, reduced.basis, report)
                yield {name: first}
                continue
            vectors = Augmented(first, block.spread @ reduced.more, reduced.mix)
            columns, participation = slice(0, len(reduced.omega2)), vectors.project(block.inertia)
            yield {name: BlockBasis(vectors, columns, reduced.omega2, participation, report)}


@dataclass(frozen=True)
class ReducedBlock:
    """A reduced block: its open-joint modes [basis, more] mix, which are M-orthonormal.

    Attributes
    ----------
    omega2 : (m,) of the open-joint modes, ascending [1/s2]
    basis : (n, k) basis vectors over the free DOFs
    more : (n, r) residual vectors that are not in `basis`
    mix : (k + r, m) coefficients of the modes in both
    retained, fixed_interface, static, residual_vectors : numbers of retained DOFs, fixed-interface modes,
        static vectors and residual vectors that span the basis
    highest : frequency of the highest fixed-interface mode [Hz], 0 if there is none
    orthonormality : largest entry of |Phi^T M Phi - I|
    residual : largest |K phi - omega^2 M phi| / (omega^2 |M phi|) of the fixed-interface modes
    """

    omega2: Floats
    basis: Floats
    more: Floats
    mix: Floats
    retained: int
    fixed_interface: int
    highest: float
    orthonormality: float
    residual: float
    static: int = 0
    residual_vectors: int = 0

    def formed(self) -> ReducedBlock:
        """Return the same block with the open-joint modes as its basis."""
        k = self.basis.shape[1]
        modes = self.basis @ self.mix[:k]
        if self.more.shape[1]:
            modes += self.more @ self.mix[k:]
        return replace(self, basis=modes, more=np.zeros((len(modes), 0)), mix=np.eye(len(self.omega2)))

    def report(self) -> dict[str, object]:
        """Return the numbers of the reduction as plain values."""
        return {
            "retained_dofs": self.retained,
            "fixed_interface_modes": self.fixed_interface,
            "static_vectors": self.static,
            "residual_vectors": self.residual_vectors,
            "highest_fixed_interface_hz": self.highest,
            "frequencies_hz": [float(f) for f in np.sqrt(self.omega2[:10]) / (2.0 * np.pi)],
            "orthonormality_error": self.orthonormality,
            "eigenvalue_residual": self.residual,
        }


class FixedInterfaceModes(NamedTuple):
    """Fixed-interface modes, followed by static vectors, all diagonal in K.

    Attributes
    ----------
    modes : number of modes; the other columns are static vectors
    omega2 : (m,) diagonal of Phi^T K Phi, ascending for the modes [1/s2]
    Phi : (n, m) modes and static vectors over the interior
    forces : (n, m) (K - s M) Phi
    gram : (m, m) Phi^T M Phi, the identity up to round-off
    residual : of the modes, see `ReducedBlock`
    """

    modes: int
    omega2: Floats
    Phi: Floats
    forces: Floats
    gram: Floats
    residual: float

    @property
    def highest(self) -> float:
        """Highest frequency of a mode [Hz], 0 if there is none."""
        return highest_hz(self.omega2[: self.modes])

    @property
    def orthonormality(self) -> float:
        """Largest entry of |Phi^T M Phi - I|."""
        return float(np.abs(self.gram - np.eye(len(self.gram))).max(initial=0.0))


def reduce_block(block: FreeBlock, choice: ModeChoice) -> Iterator[ReducedBlock]:
    """Reduce a block and diagonalise it with its joints open; on request reduce it again, finer.

    Yields
    ------
    ReducedBlock
        first the reduced block, with its open-joint modes as basis; then a finer one, for the error estimate.
        It adds `FINER_VECTORS` residual vectors, of modes with the added mass of water, to the first basis,
        and needs no new factors. If the first has all modes, it is yielded again.

    Raises
    ------
    ReductionError
        if a factorisation or an eigenproblem fails.
    """
    K, M, retained, shift = block.K, block.M, block.retained, block.shift
    interior_dofs = int((~retained).sum())
    rigid = rigid_modes(K, M, block.motions.rigid).shape[1]
    if choice.count is not None and choice.count >= interior_dofs:
        omega2, basis = dense_modes(K, M)
        complete = ReducedBlock(
            omega2=without_strain(without_roundoff(omega2), rigid),
            basis=basis,
            more=np.zeros((len(basis), 0)),
            mix=np.eye(len(omega2)),
            retained=len(retained) - interior_dofs,
            fixed_interface=interior_dofs,
            highest=highest_hz(omega2),
            orthonormality=0.0,
            residual=0.0,
        )
        yield from repeat(complete)  # without end: nothing is finer
    Psi, modes, solver = _ritz_vectors(block, choice)
    boundary = Psi.shape[1]
    T = over_interior(retained, np.hstack([Psi, modes.Phi]))
    T[retained, :boundary] = np.eye(boundary)
    # T^T M T, of which the part of the modes is known
    constraint = T.T @ (M @ T[:, :boundary])
    mass = np.block([[constraint[:boundary], constraint[boundary:].T], [constraint[boundary:], modes.gram]])
    # T^T K T = s T^T M T + T^T (K - s M) T; the second term does not couple constraint modes with the others,
    # and constraint modes have (K - s M)-forces at the retained DOFs only
    stiffness = shift * mass
    stiffness[:boundary, :boundary] += (K[retained] - shift * M[retained]) @ T[:, :boundary]
    stiffness[boundary:, boundary:] += np.diag(modes.omega2 - shift)
    omega2, V = diagonalise(stiffness, mass, block.label)
    reduced = ReducedBlock(
        omega2=omega2,
        basis=T,
        more=T[:, :0],
        mix=V,
        retained=boundary,
        fixed_interface=modes.modes,
        static=modes.Phi.shape[1] - modes.modes,
        highest=modes.highest,
        orthonormality=modes.orthonormality,
        residual=modes.residual,
    )
    interior = Interior(solver, modes.forces, boundary)
    reduced, interior = _with_residual_vectors(block, reduced, interior, choice.residual_vectors, 0.0, None)
    reduced = reduced.formed()
    yield replace(reduced, omega2=without_strain(without_roundoff(reduced.omega2), rigid))
    finer, _ = _with_residual_vectors(block, reduced, interior, FINER_VECTORS, FINER_LEAST, block.wet)
    yield replace(finer, omega2=without_strain(without_roundoff(finer.omega2), rigid))


def _ritz_vectors(block: FreeBlock, choice: ModeChoice) -> tuple[Floats, FixedInterfaceModes, Solver]:
    """Compute constraint modes, fixed-interface modes with static vectors, and the solver of the interior."""
    retained, shift = block.retained, block.shift
    K_i, M_i = block.K[~retained], block.M[~retained]
    K_ii, M_ii = csr_matrix(K_i[:, ~retained]), csr_matrix(M_i[:, ~retained])
    columns = int(retained.sum()) + choice.columns + block.loads.shape[1]
    shifted = K_ii - shift * M_ii if shift else K_ii
    solver = make_solver(shifted, block.motions.of(~retained), columns, choice.solving, block.label)
    coupling = (K_i[:, retained] - shift * M_i[:, retained]).toarray()
    Psi = -solver.solve(coupling) if coupling.shape[1] else coupling
    if shift:
        choice = choice.with_rigid_motions(
            rigid_modes(K_ii, M_ii, block.motions.of(~retained).rigid).shape[1]
        )
    return Psi, fixed_interface_modes(K_ii, M_ii, block.loads[~retained], choice, solver, shift), solver


def fixed_interface_modes(
    K: csr_matrix, M: csr_matrix, loads: Floats, choice: ModeChoice, solver: Solver, shift: float
) -> FixedInterfaceModes:
    """Compute the lowest modes of the interior, and static vectors of loads.

    Parameters
    ----------
    K, M : (n, n) of the interior
    loads : (n, l) forces on the interior
    solver : for K - shift M
    """
    omega2, Phi = modes_below(K, M, choice.count, choice.cutoff, solver, shift)
    MPhi = M @ Phi
    residual = eigen_residual(K, MPhi, omega2, Phi)
    forces = MPhi * (omega2 - shift)
    static_omega2, A, static_forces = static_vectors(M, Phi, MPhi, forces, loads, solver)
    modes_and_static = np.hstack([Phi, A])
    return FixedInterfaceModes(
        modes=len(omega2),
        omega2=np.append(omega2, static_omega2 + shift),
        Phi=modes_and_static,
        forces=np.hstack([forces, static_forces]),
        gram=modes_and_static.T @ np.hstack([MPhi, M @ A]),
        residual=residual,
    )


def static_vectors(
    M: csr_matrix, Phi: Floats, MPhi: Floats, forces: Floats, loads: Floats, solver: Solver
) -> tuple[Floats, Floats, Floats]:
    """Compute the part of static responses to loads that is not in the span of the modes.

    Parameters
    ----------
    Phi, MPhi, forces : (n, m) modes, M times them and (K - s M) times them
    loads : (n, l); a load that is zero, or whose response is in the span of the modes, gives no vector
    solver : for K - s M

    Returns
    -------
    omega2 : (k,) diagonal of K - s M in the vectors, ascending: omega^2 - s [1/s2]
    vectors : (n, k) M-orthonormal, M-orthogonal to the modes and diagonal in K - s M
    forces : (n, k) (K - s M) times the vectors
    """
    length = np.linalg.norm(loads, axis=0)
    F = loads[:, length > 0.0] / length[length > 0.0]
    if not F.shape[1]:
        return np.zeros(0), Phi[:, :0], Phi[:, :0]
    A = solver.solve(F)
    size = np.sqrt((A * (M @ A)).sum(axis=0))
    A, F = A / size, F / size
    for _ in range(2):  # the second time removes the round-off of the first
        in_modes = MPhi.T @ A
        A, F = A - Phi @ in_modes, F - forces @ in_modes
    remains = (A * (M @ A)).sum(axis=0) > ROUND_OFF**2
    A, F = A[:, remains], F[:, remains]
    if not A.shape[1]:
        return np.zeros(0), A, F
    C = orthonormalising(A.T @ (M @ A), DEPENDENT)
    energy = C.T @ (A.T @ F) @ C
    omega2, U = eigh(0.5 * (energy + energy.T))
    return omega2, A @ (C @ U), F @ (C @ U)


def highest_hz(omega2: Floats) -> float:
    """Return the highest frequency [Hz] of ascending omega2 [1/s2], 0 if there is none."""
    return float(np.sqrt(max(omega2[-1], 0.0)) / (2.0 * np.pi)) if len(omega2) else 0.0


def eigen_residual(K: csr_matrix | Symmetric, MPhi: Floats, omega2: Floats, Phi: Floats) -> float:
    """Compute the largest |K phi - omega^2 M phi| / (omega^2 |M phi|) of the elastic modes."""
    inertia = MPhi * omega2
    size = np.linalg.norm(inertia, axis=0)
    elastic = omega2 > FREE_SHIFT
    if not elastic.any():
        return 0.0
    return float((np.linalg.norm(K @ Phi - inertia, axis=0)[elastic] / size[elastic]).max())


def over_interior(retained: Bools, inside: Floats) -> Floats:
    """Extend vectors over the interior to all free DOFs, with zeros at the retained ones."""
    T = np.zeros((len(retained), inside.shape[1]))
    T[~retained] = inside
    return T


def diagonalise(K: Floats, M: Floats, label: str) -> tuple[Floats, Floats]:
    """Compute all modes of reduced matrices: omega2 ascending [1/s2], and M-orthonormal vectors.

    Raises
    ------
    ReductionError
        if M is not positive definite.
    """
    from scipy.linalg import LinAlgError

    try:
        return eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
    except LinAlgError as error:
        raise ReductionError(f"{label}: the reduced mass is not positive definite ({error})") from error


def _with_residual_vectors(
    block: FreeBlock,
    reduced: ReducedBlock,
    interior: Interior,
    count: int,
    least: float,
    wet: WetMass | None,
) -> tuple[ReducedBlock, Interior]:
    """Add residual vectors of the lowest open-joint modes to a reduced block, and diagonalise it again.

    Parameters
    ----------
    interior : forces on the interior, for vectors in terms of the basis of `reduced`
    count : number of modes
    least : M-norm of a residual vector below which it is left out; see `larger`
    wet : added mass of the water in these modes; None without any

    Returns
    -------
    extended : the basis of `reduced`, with the residual vectors in `more`
    interior : forces on the interior, for vectors in terms of the modes of `extended`
    """
    K, M, retained = block.K, block.M, block.retained
    T, V = reduced.basis, reduced.mix
    count = min(count, len(T) - V.shape[1])
    if not count:
        return reduced, interior.after(V, np.zeros((int((~retained).sum()), 0)))
    added_mass = None if wet is None else wet.of(wet.operator @ T @ V)
    lowest_omega2, coefficients = lowest_with(added_mass, reduced.omega2, V, count)
    lowest = T @ coefficients
    inertia = M @ (lowest * (lowest_omega2 - block.shift))
    unbalanced = interior.forces(coefficients) - inertia[~retained]
    if wet is not None:
        unbalanced -= wet.inertia(lowest * lowest_omega2)[~retained]
    D = over_interior(retained, interior.solver.solve(unbalanced))
    D = larger(D - T @ (V @ (V.T @ (T.T @ (M @ D)))), M, lowest_omega2, least)
    D = independent(D, M)
    D = independent(D - T @ (V @ (V.T @ (T.T @ (M @ D)))), M)  # again, against round-off
    KD = K @ D
    coupling, of_residual = V.T @ (T.T @ KD), D.T @ KD
    stiffness = np.block(
        [[np.diag(reduced.omega2), coupling], [coupling.T, 0.5 * (of_residual + of_residual.T)]]
    )
    omega2, C = eigh(stiffness)
    mix = np.vstack([V @ C[: V.shape[1]], C[V.shape[1] :]])
    number = reduced.residual_vectors + D.shape[1]
    extended = replace(reduced, omega2=omega2, more=D, mix=np.ascontiguousarray(mix), residual_vectors=number)
    return extended, interior.after(mix, (KD - block.shift * (M @ D))[~retained])
