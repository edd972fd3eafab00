"""Open-joint modes and, beside them, static answers made M-orthonormal and diagonal in K; further vectors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, Ints
from romdam.linalg.dense import eigh, without_roundoff
from romdam.linalg.symmetric import Symmetric
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix

_DEPENDENT = 1e-12  # share of the largest, below which a direction of the attachment modes is round-off
_LOST = 2e-14  # the same, of what stood there before the modes' part was taken out
# least 1/omega2 of an attachment mode relative to the first mode's: it is a spring beyond that, and from
# 1e-13 on the first mode would count as its round-off
_STIFF = 1e-12
_KNOWN_ENERGY = 1e-8  # of a vector of unit energy, what others do not know of it and is not round-off
_KNOWN = 1e-10  # squared length of a unit vector's rest, below which T's vectors know it but for round-off


class StaticPencil(NamedTuple):
    """K, of which K - shift M is positive definite, M, and the row of T of each of their unknowns."""

    K: Symmetric
    M: csr_matrix
    shift: float
    rows: Ints


def diagonalised(T: OutOfCoreMatrix, modes: int, pencil: StaticPencil, work: Floats) -> tuple[Floats, Floats]:
    """omega^2 of the basis T V, and V: the modes first, then the attachment modes.

    The static answers A = K^-1 R without their part in the modes are made M-orthonormal and diagonal in K.
    Their energies are R^T A, so that K is asked for its forms on the modes alone. Directions are those of the
    flexibility; the ones that are springs beyond all the motion of interest keep their flexibility with a
    mass that is not above theirs.

    Parameters
    ----------
    T : A and, after it, vectors that span the modes
    modes : how many of these
    work : R^T T, (a, m)
    """
    K, M, shift, rows = pencil
    a, moving = T.shape[1] - modes, M.diagonal() > 0.0
    M_moving, moving_rows = csr_matrix(M[moving][:, moving]), rows[moving]
    M_m = T.gram(M_moving, moving_rows, a)
    K_m = T.gram(K, rows, a) - shift * M_m
    low, C = eigh(0.5 * (K_m + K_m.T), M_m)
    if not a:
        return without_roundoff(low + shift), C
    in_modes = (work[:, a:] @ C / low).T  # C^T Phi^T M A of the modes in A, as far as they are modes
    Phi = T.combined(np.vstack([np.zeros((a, modes)), C]))[moving_rows]
    M_T = T.gram(M_moving, moving_rows, less=(Phi, np.hstack([in_modes, np.zeros((modes, modes))])))
    rest = C.T @ M_T[a:, :a]
    in_modes = in_modes + rest
    twice = work[:, a:] @ C @ in_modes
    flexibility = work[:, :a] - twice - twice.T + in_modes.T @ (low[:, None] * in_modes)
    flexibility = 0.5 * (flexibility + flexibility.T)
    mix, slow = _directions(flexibility, M_T[:a, :a] - rest.T @ rest, low, work.diagonal())
    V = np.block([[np.zeros((a, modes)), mix], [C, -C @ in_modes @ mix]])
    omega2 = np.concatenate([low, 1.0 / slow])
    return np.concatenate([without_roundoff(omega2[:modes] + shift), omega2[modes:] + shift]), V


def with_more(
    T: OutOfCoreMatrix, more: int, pencil: StaticPencil, work: Floats, omega2: Floats, V: Floats
) -> tuple[Floats, Floats]:
    """omega^2 of the basis [T_1 V, T_2], T_2 the last `more` columns of T, and what makes its modes of both.

    By way of the flexibility: with vectors of unit energy springs are small and not large, and answers to
    joint forces hang on the energies alone. What X = T_1 V knows of T_2 is taken out of its energy.

    Parameters
    ----------
    work : R^T T, (a, m)
    omega2, V : of T_1, see `diagonalised`
    """
    (K, M, shift, rows), first = pencil, T.shape[1] - more
    mass, of_modes = T.against(K, M, rows, first, len(work))
    stiffness = np.vstack([work[:, first:], of_modes - shift * mass[len(work) :]])
    of_X, of_T = 1.0 / np.sqrt(omega2 - shift), 1.0 / np.sqrt(stiffness[first:].diagonal())
    between, coupling = (of_X[:, None] * (V.T @ A[:first]) * of_T for A in (mass, stiffness))
    mass_of_T, rest = (of_T[:, None] * A[first:] * of_T for A in (mass, stiffness))
    size, U = eigh(rest - coupling.T @ coupling)
    keep = size > _KNOWN_ENERGY
    U = U[:, keep] / np.sqrt(size[keep])
    P = np.block([[np.eye(len(of_X)), -coupling @ U], [np.zeros((more, len(of_X))), U]])
    slow, W = eigh(P.T @ np.block([[np.diag(of_X**2), between], [between.T, mass_of_T]]) @ P)
    slow = np.maximum(slow[::-1], _STIFF * slow[-1])
    mix = np.concatenate([of_X, of_T])[:, None] * (P @ W[:, ::-1]) / np.sqrt(slow)
    return without_roundoff(1.0 / slow + shift), mix


def orthogonal_remainder(T: OutOfCoreMatrix, static: int, D: Floats, pencil: StaticPencil) -> Floats:
    """Part of D (n, k) that T's vectors, the first `static` aside, lack: M-orthonormal, without round-off."""
    M, rows = pencil.M, pencil.rows
    gram, size = T.gram(M, rows, static), np.sqrt((D * (M @ D)).sum(axis=0))
    D = D[:, size > 0.0] / size[size > 0.0]
    for _ in range(2):  # the second time for the round-off of the first
        inertia, V = np.zeros((D.shape[1], T.shape[0])), np.zeros((T.shape[1], D.shape[1]))
        inertia[:, rows] = (M @ D).T
        V[static:] = np.linalg.solve(gram, T.before(inertia)[:, static:].T)
        D = D - T.combined(V)[rows]
    size, U = np.linalg.eigh(D.T @ (M @ D))
    keep = size > _KNOWN
    return np.asarray(D @ (U[:, keep] / np.sqrt(size[keep])))


def _directions(flexibility: Floats, mass: Floats, low: Floats, whole: Floats) -> tuple[Floats, Floats]:
    """The combinations of static answers that are M-orthonormal and diagonal in K, and their 1 / omega^2.

    `low` are the omega^2 of the modes, `whole` the answers' flexibility with the modes' part in it: where
    that is nearly all, the rest has few digits.
    """
    scale = 1.0 / np.sqrt(np.maximum(flexibility.diagonal(), np.finfo(float).tiny))
    size, U = np.linalg.eigh(flexibility * scale * scale[:, None])
    keep = size > max(_DEPENDENT * size[-1], _LOST * (whole * scale**2).max())
    mix = scale[:, None] * (U[:, keep] / np.sqrt(size[keep]))
    mass = mix.T @ mass @ mix
    slow, W = eigh(0.5 * (mass + mass.T))
    slow = np.maximum(slow[::-1], _STIFF * (1.0 / low[0] if len(low) else slow[-1]))
    return mix @ W[:, ::-1] / np.sqrt(slow), slow
