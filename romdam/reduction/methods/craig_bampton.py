"""Craig-Bampton reduction of one block.

u = Psi u_b + Phi q with the retained joint DOFs u_b, constraint modes Psi = -K_ii^-1 K_ib and the
fixed-interface modes Phi below the cut-off. Where the retained DOFs and supports leave the interior
free to move rigidly (normal gaps alone hold the block), K_ii is singular; K_ii + s M_ii with a small s
takes its place, the constraint modes become those of a harmonic motion just below zero frequency, and
the rigid motions appear among the Phi. Any such basis is a Ritz basis, and with all modes it is complete.

Corrections: of the lowest open-joint modes phi of that basis, the static answer of the interior to what they
leave unbalanced, K_ii^-1 (K phi - omega^2 M phi), joins the basis. One solve each brings the modes that carry
the response much nearer to the mesh's: on the two-cantilever model 20 modes and 10 corrections a block
(260 unknowns) have 0.6 % reduction error where 20 modes alone have 6.4 %, and 60 modes 0.5 %.

References
----------
Craig, Bampton, AIAA Journal 6 (1968) 1313.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConfigError, ReductionError
from romdam.linalg.eigen import dense_modes, modes_below
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import AUTO, Solver, Solving, make_solver
from romdam.linalg.symmetric import Symmetric

FREE_SHIFT = (2.0 * np.pi * 0.1) ** 2  # [1/s2], 0.1 Hz: far below any block's elastic modes
_DEPENDENT = 1e-8  # eigenvalue of the corrections' Gram matrix, relative, below which one is dropped
_ALL = 2**62
_SOME = 30  # modes below a frequency, before they are counted


@dataclass(frozen=True)
class ModeChoice:
    """Which fixed-interface modes to keep: a count, or all below a frequency [Hz]; how many corrections.

    A capped count takes what there is in a block with fewer interior DOFs; another one is refused there.
    `solving` says by which solver, and moves no digit that matters.
    """

    count: int | None = None
    cutoff: float | None = None
    corrections: int = 0
    capped: bool = False
    solving: Solving = AUTO

    @property
    def keeps_all(self) -> bool:
        """Whether every mode is asked for."""
        return self.count == _ALL

    @property
    def columns(self) -> int:
        """About how many solves the modes and corrections take."""
        return 4 * (_SOME if self.count is None else self.count) + self.corrections

    def report(self) -> dict[str, object]:
        """What was asked for, as plain values."""
        return {} if self.cutoff is None else {"cutoff_hz": self.cutoff}

    @property
    def basis(self) -> ModeChoice:
        """What decides the basis, without how it is computed."""
        return replace(self, solving=AUTO)


ALL_MODES = ModeChoice(count=_ALL)


@dataclass(frozen=True)
class Substructure:
    """A reduced block in its own open-joint modes.

    Attributes
    ----------
    omega2 : (m,) ascending [1/s2]
    basis : (n, m) M-orthonormal open-joint modes over the free DOFs
    retained, fixed_interface, corrections : how many retained DOFs, modes and corrections span it
    highest : frequency of the highest fixed-interface mode kept [Hz], 0 if there is none
    orthonormality : largest entry of Phi^T M Phi - I
    residual : largest |K phi - omega^2 M phi| of the fixed-interface modes, relative to omega^2 |M phi|
    """

    omega2: Floats
    basis: Floats
    retained: int
    fixed_interface: int
    highest: float
    orthonormality: float
    residual: float
    corrections: int = 0

    def report(self) -> dict[str, object]:
        """The numbers on the reduction, as plain values."""
        return {
            "retained_dofs": self.retained,
            "fixed_interface_modes": self.fixed_interface,
            "corrections": self.corrections,
            "highest_fixed_interface_hz": self.highest,
            "frequencies_hz": [float(f) for f in np.sqrt(self.omega2[:10]) / (2.0 * np.pi)],
            "orthonormality_error": self.orthonormality,
            "eigenvalue_residual": self.residual,
        }


def reduce_block(
    K: csr_matrix,
    M: csr_matrix,
    retained: Bools,
    held: bool,
    choice: ModeChoice,
    place: str,
    motions: Motions,
) -> Substructure:
    """Reduce a block and diagonalise it with its joints open.

    Parameters
    ----------
    K, M : (n, n) sparse, over the free DOFs
    retained : (n,) True for retained DOFs
    held : whether supports and retained DOFs, if held, stop every rigid motion
    choice : the modes to keep
    place : what to call the block in messages
    motions : of the free DOFs

    Raises
    ------
    ConfigError
        for more modes than the interior has DOFs.
    ReductionError
        where a factorisation or an eigenproblem fails.
    """
    interior = int((~retained).sum())
    choice = _within(choice, interior, place)
    if choice.keeps_all or choice.count == interior:
        omega2, basis = dense_modes(K, M)
        highest = float(np.sqrt(max(omega2[-1], 0.0)) / (2.0 * np.pi)) if len(omega2) else 0.0
        return Substructure(
            without_roundoff(omega2), basis, len(retained) - interior, interior, highest, 0.0, 0.0
        )
    (Psi, Phi, omega2_fixed, residual), solver = _ritz_vectors(
        (K, M), retained, held, choice, (place, motions)
    )
    T = _assemble_basis(Psi, Phi, retained)
    K_r, M_r = T.T @ (K @ T), T.T @ (M @ T)
    omega2, V = diagonalise(K_r, M_r, place)
    basis, added = T @ V, 0
    if choice.corrections:
        omega2, basis, added = _corrected(
            K, M, (omega2, basis), (~retained, solver, choice.corrections), place
        )
    gram = Phi.T @ (M[~retained][:, ~retained] @ Phi)
    return Substructure(
        omega2=without_roundoff(omega2),
        basis=basis,
        retained=Psi.shape[1],
        fixed_interface=Phi.shape[1],
        highest=float(np.sqrt(max(omega2_fixed[-1], 0.0)) / (2.0 * np.pi)) if len(omega2_fixed) else 0.0,
        orthonormality=float(np.abs(gram - np.eye(len(gram))).max(initial=0.0)),
        residual=residual,
        corrections=added,
    )


def _within(choice: ModeChoice, interior: int, place: str) -> ModeChoice:
    """The choice, capped at the interior DOFs that there are if it may be."""
    if choice.capped and choice.count is not None:
        choice = replace(choice, count=min(choice.count, interior))
    if not choice.keeps_all and choice.count is not None and choice.count > interior:
        raise ConfigError(
            f"{place}: model.modes asks for {choice.count} fixed-interface modes, the block has {interior} "
            "interior DOFs; ask for fewer, or for `modes: all`"
        )
    return choice


def _ritz_vectors(
    matrices: tuple[csr_matrix, csr_matrix],
    retained: Bools,
    held: bool,
    choice: ModeChoice,
    named: tuple[str, Motions],
) -> tuple[tuple[Floats, Floats, Floats, float], Solver]:
    """Constraint modes, fixed-interface modes, their omega^2 and largest residual; the interior's solver."""
    (K, M), (place, motions) = matrices, named
    shift = 0.0 if held else -FREE_SHIFT
    K_i, M_i = K[~retained], M[~retained]
    K_ii, M_ii = csr_matrix(K_i[:, ~retained]), csr_matrix(M_i[:, ~retained])
    columns = int(retained.sum()) + choice.columns
    shifted = K_ii - shift * M_ii if shift else K_ii
    solver = make_solver(shifted, motions.of(~retained), columns, choice.solving, place)
    coupling = (K_i[:, retained] - shift * M_i[:, retained]).toarray()
    Psi = -solver.solve(coupling) if coupling.shape[1] else coupling
    omega2, Phi = modes_below(K_ii, M_ii, choice.count, choice.cutoff, solver, shift)
    return (Psi, Phi, omega2, eigen_residual(K_ii, M_ii, omega2, Phi)), solver


def eigen_residual(K: csr_matrix | Symmetric, M: csr_matrix, omega2: Floats, Phi: Floats) -> float:
    """Largest relative eigenvalue residual of the elastic modes."""
    inertia = M @ Phi * omega2
    size = np.linalg.norm(inertia, axis=0)
    elastic = omega2 > FREE_SHIFT
    if not elastic.any():
        return 0.0
    return float((np.linalg.norm(K @ Phi - inertia, axis=0)[elastic] / size[elastic]).max())


def _assemble_basis(Psi: Floats, Phi: Floats, retained: Bools) -> Floats:
    boundary = Psi.shape[1]
    T = np.zeros((len(retained), boundary + Phi.shape[1]))
    T[~retained, :boundary] = Psi
    T[~retained, boundary:] = Phi
    T[retained, :boundary] = np.eye(boundary)
    return T


def diagonalise(K: Floats, M: Floats, place: str) -> tuple[Floats, Floats]:
    """All modes of reduced matrices."""
    from scipy.linalg import LinAlgError, eigh

    try:
        return eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
    except LinAlgError as error:
        raise ReductionError(f"{place}: the reduced mass is not positive definite ({error})") from error


def _corrected(
    K: csr_matrix,
    M: csr_matrix,
    modes: tuple[Floats, Floats],
    interior: tuple[Bools, Solver, int],
    place: str,
) -> tuple[Floats, Floats, int]:
    """Open-joint modes with the interior's answer to the lowest ones' residuals; how many were added."""
    (omega2, X), (inside, solver, count) = modes, interior
    low = X[:, :count]
    residual = K @ low - (M @ low) * omega2[:count]
    D = np.zeros_like(low)
    D[inside] = solver.solve(residual[inside])
    D = independent(D - X @ (X.T @ (M @ D)), M)
    Y = np.hstack([X, D - X @ (X.T @ (M @ D))])
    omega2, V = diagonalise(Y.T @ (K @ Y), Y.T @ (M @ Y), place)
    return omega2, Y @ V, D.shape[1]


def independent(D: Floats, M: csr_matrix) -> Floats:
    """M-orthonormal vectors that span D's, without directions that are round-off."""
    size, U = np.linalg.eigh(_unit_diagonal(D.T @ (M @ D)))
    keep = size > _DEPENDENT * size[-1]
    return np.asarray((D / _norms(D, M)) @ (U[:, keep] / np.sqrt(size[keep])))


def _norms(D: Floats, M: csr_matrix) -> Floats:
    return np.sqrt(np.maximum((D * (M @ D)).sum(axis=0), np.finfo(float).tiny))


def _unit_diagonal(gram: Floats) -> Floats:
    scale = 1.0 / np.sqrt(np.maximum(gram.diagonal(), np.finfo(float).tiny))
    return gram * scale * scale[:, None]


def without_roundoff(omega2: Floats) -> Floats:
    """Squared frequencies; those of rigid motions come out as round-off of the stiffest mode and are zero."""
    floor = 1e-13 * omega2.max(initial=0.0)
    return np.where(omega2 < floor, 0.0, omega2)
