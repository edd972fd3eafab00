"""Static answers of a large interface without mass: the flexibility that the modes of a part leave.

With the static answers A = K^-1 R to unit joint forces (and to loads) and the modes Phi of the part,

    A - Phi Omega^-2 Phi^T R,    F = R^T K^-1 R - R^T Phi Omega^-2 Phi^T R,

are the answers that the modes lack and their flexibility. They answer a joint force at once, or with the
relaxation time of the damping, so that no mass and no eigenproblem of the size of the interface is needed: a
Cholesky factorisation of F makes them diagonal in K. Below `MANY` directions they keep their mass
(`attachment_modes`), which answers for further modes too: where two pillars pound each other, modes to 120 Hz
and massive answers leave 2 % of the openings, massless ones 9 %, and with modes to 200 Hz 0.03 %. Modes cost
little beside a large interface, so that massless answers stand beside `WIDER` times as many.

References
----------
MacNeal, Computers & Structures 1 (1971) 581; Rubin, AIAA Journal 13 (1975) 995: residual flexibility.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg.lapack import dpstrf, dtrtri

from romdam.core.arrays import Floats
from romdam.core.scene import FreeField, Reservoir
from romdam.core.threads import DENSE_EIGENPROBLEM, threads_for
from romdam.linalg.dense import eigh
from romdam.reduction.methods.attachment_modes import StaticPencil
from romdam.reduction.methods.massless import OMEGA2
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.reduction.substructure import Substructure

MANY = 1500  # static answers: from here on their dense eigenproblem costs more than all the rest
# modes of a part, and a tenth of its unknowns at most: with fewer the statement of the modes is too small
FEWEST = 100
WIDER = 3  # times the modes, or the frequency up to which they are kept, that are asked for
_DEPENDENT = 1e-12  # of the largest flexibility, below which a direction is round-off
_LOST = 2e-14  # the same, of the flexibility before the modes' share was taken out
_KNOWN = 1e-8  # of the energy of a vector, what the static answers must not know of it


def needs_no_mass(substructure: Substructure, directions: int) -> bool:
    """Tell whether the static answers of a part may be without mass.

    They may where they are many and only forces of joints, static loads and inertia act on them: viscous
    boundaries, waves in rock and water, and supports of their own motion see accelerations or velocities too.

    Parameters
    ----------
    directions : number of static answers
    """
    scene, loads = substructure.scene, substructure.block_loads
    blocks, water = substructure.blocks, scene.find(Reservoir)
    return (
        directions > MANY
        and substructure.mesh_part.stands_free(scene)
        and scene.find(FreeField) is None
        and (water is None or water.sound is None)
        and not any(scene.blocks[name].absorbing for name in blocks)
        and not any(loads.carried[name].any() for name in blocks)
    )


def wider(choice: ModeChoice) -> ModeChoice:
    """The number of modes beside static answers without mass."""
    count = None if choice.count is None else WIDER * choice.count
    cutoff = None if choice.cutoff is None else WIDER * choice.cutoff
    return replace(choice, count=count, cutoff=cutoff)


def without_mass(T: OutOfCoreMatrix, modes: int, pencil: StaticPencil, work: Floats) -> tuple[Floats, Floats]:
    """Compute omega^2 and V of the basis T V: the modes, then static answers without mass.

    Parameters
    ----------
    T : A and, after it, vectors that span the modes
    modes : how many of these
    work : R^T T, (a, m)

    Returns
    -------
    omega2 : of the modes [1/s2], then OMEGA2
    V : (m, modes + r)
    """
    a = T.shape[1] - modes
    M_m, K_m = T.gram(pencil.M, pencil.rows, a), T.gram(pencil.K, pencil.rows, a)
    low, C = eigh(0.5 * (K_m + K_m.T), M_m)
    of_modes = work[:, a:] @ C  # R^T Phi
    flexibility = work[:, :a] - (of_modes / low) @ of_modes.T
    flexibility = 0.5 * (flexibility + flexibility.T)
    scale = 1.0 / np.sqrt(np.maximum(flexibility.diagonal(), np.finfo(float).tiny))
    least = max(_DEPENDENT, _LOST * float((work[:, :a].diagonal() * scale**2).max(initial=0.0)))
    with threads_for(a, DENSE_EIGENPROBLEM):
        L, order, rank, _ = dpstrf(flexibility * scale * scale[:, None], tol=least, lower=1)
        inverse, _ = dtrtri(L[:rank, :rank], lower=1)
    pivots = order[:rank] - 1
    mix = np.zeros((a, rank))
    mix[pivots] = scale[pivots, None] * np.tril(inverse).T * np.sqrt(OMEGA2)
    V = np.block([[np.zeros((a, modes)), mix], [C, -C @ (of_modes.T / low[:, None]) @ mix]])
    return np.append(low, np.full(rank, OMEGA2)), V


def with_more_without_mass(
    T: OutOfCoreMatrix, more: int, modes: int, pencil: StaticPencil, work: Floats, omega2: Floats, V: Floats
) -> tuple[Floats, Floats, int]:
    """Compute omega^2 of the basis [T_1 V, T_2], T_2 the last `more` columns of T, and what makes its modes.

    What T_2 answers is taken out of the static answers, which stay without mass.

    Parameters
    ----------
    modes : of T_1 V, which come first
    work : R^T T, (a, m)
    omega2, V : of T_1, see `without_mass`

    Returns
    -------
    omega2 : the modes', then OMEGA2
    mix : (k + more, m)
    massive : how many of these have mass
    """
    first, rest = T.shape[1] - more, len(omega2) - modes
    mass, of_T = T.against(pencil.K, pencil.M, pencil.rows, first, len(work))
    stiffness = np.vstack([work[:, first:], of_T])  # T^T K T_2
    low = omega2[:modes]
    to_modes = V[:, :modes].T @ stiffness[:first] / low[:, None]  # Phi^T K T_2 / omega^2
    to_rest = V[:, modes:].T @ stiffness[:first] / np.sqrt(OMEGA2)  # T_2's answers that the rest has, K = 1
    # vectors Q of T_2 without the modes' part, of unit energy
    energy = stiffness[first:] - to_modes.T @ (low[:, None] * to_modes)
    size, U = eigh(0.5 * (energy + energy.T))
    keep = size > _DEPENDENT * size.max(initial=0.0)
    U = U[:, keep] / np.sqrt(size[keep])
    left, sigma, right = np.linalg.svd(to_rest @ U, full_matrices=False)  # every Q in the rest
    new = 1.0 - sigma**2 > _KNOWN  # what the rest knows of T_2 stays without mass
    left, sigma, U = left[:, new], sigma[new], U @ right[new].T
    # rest' = rest W^-1 - Q sigma left^T W^-1 with W = 1 - left (1 - remaining) left^T, of unit energy
    grown = 1.0 / np.sqrt(1.0 - sigma**2)
    inverse = np.eye(rest) + (left * (grown - 1.0)) @ left.T
    from_Q = -(sigma * grown)[:, None] * left.T
    # the modes: of Phi and Q
    inertia = V[:, :modes].T @ mass[:first]  # Phi^T M T_2
    m_PQ = (inertia - to_modes) @ U
    between = inertia.T @ to_modes
    m_QQ = U.T @ (mass[first:] - between - between.T + to_modes.T @ to_modes) @ U
    q = U.shape[1]
    M = np.block([[np.eye(modes), m_PQ], [m_PQ.T, 0.5 * (m_QQ + m_QQ.T)]])
    K = np.diag(np.append(low, np.ones(q)))
    omega2_modes, C = eigh(K, M)
    scale = np.sqrt(OMEGA2)
    Q_of = np.vstack([-to_modes @ U, np.zeros((rest, q)), U])  # Q in terms of Phi, rest and T_2
    unit = np.vstack([np.eye(modes), np.zeros((rest + more, modes))])
    of_rest = scale * (Q_of @ from_Q)
    of_rest[modes : modes + rest] += inverse
    mix = np.hstack([np.hstack([unit, Q_of]) @ C, of_rest])
    return np.append(omega2_modes, np.full(rest, OMEGA2)), mix, modes + q
