"""Damping of the solids from a configuration, Rayleigh's or modal; none on motions that joints alone hold.

The mass term of Rayleigh damping is a drag against the ground. On a body that supports hold it stands for
energy lost in strain. On a body that slides or rocks on joints it would brake the rigid motion, as a viscous
friction that is not there. So the damping of the solids does not act on the rigid motions R that supports and
viscous boundaries leave: with C_a = alpha M + beta K,

    C = C_a - D D^T,   D = C_a R (R^T C_a R)^(-1/2),

which is symmetric and positive semidefinite and has C R = 0. As K R = 0, D is sqrt(alpha) M R for R with
R^T M R = 1; in open-joint modes alpha is left off those of zero frequency. Dashpots of viscous boundaries,
damping in water and a damping matrix that a block brings act on rigid motions as on any other.

A material may have Rayleigh damping of its own: C_a = alpha M + beta K + sum_b (alpha_b - alpha) M_b +
(beta_b - beta) K_b over the blocks b of such materials, K_b of the record's modulus. The first two terms are
of the scene with the mass of water, attached masses and the stiffness of anchors, which have no material.

References
----------
Hall, J. F. (2006), Problems encountered from the use (or misuse) of Rayleigh damping, Earthquake Engineering
& Structural Dynamics 35, 525-545: mass-proportional damping acts on rigid motion as an external drag.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.arrays import Bools, Floats
from romdam.core.scene import Block, Scene
from romdam.fem.absorbing import boundary_dashpots
from romdam.fem.assembly import assemble
from romdam.linalg.modes.rigid import rigid_modes
from romdam.scene.supports import motions_of_pieces
from romdam.scene.ties import Part

_DRAG = 1e-9  # of the largest drag on a rigid motion, below which it is round-off


def rayleigh_coefficients(rayleigh: RayleighConfig | None) -> tuple[float, float]:
    """(alpha [1/s], beta [s]) of C = alpha M + beta K; both zero without Rayleigh damping."""
    return (0.0, 0.0) if rayleigh is None else rayleigh.coefficients


def material_coefficients(block: Block, rayleigh: RayleighConfig | None) -> tuple[float, float]:
    """(alpha [1/s], beta [s]) of a block: of its material, or else those of the whole scene."""
    return rayleigh_coefficients(rayleigh) if block.material.damping is None else block.material.damping


def further_damping(
    block: Block, rayleigh: RayleighConfig | None, *, dashpots: bool = True
) -> csr_matrix | None:
    """Damping of a block besides the scene's alpha M + beta K, (3 n, 3 n) [N s/m]; None where it has nothing.

    Dashpots of absorbing faces, where they are asked for, and what stands in the place of the scene's
    Rayleigh damping: that of the block's material, or a damping matrix that the block brings.
    """
    alpha, beta = rayleigh_coefficients(rayleigh)
    further = boundary_dashpots(block) if block.absorbing and dashpots else None
    brought = block.matrices
    if brought is not None and brought.C is not None:
        instead = brought.C - alpha * brought.M - beta * brought.K
    elif (of_material := material_coefficients(block, rayleigh)) != (alpha, beta):
        K, M = assemble(block)
        instead = (of_material[0] - alpha) * M + (of_material[1] - beta) * K
    else:
        return further
    return csr_matrix(instead if further is None else instead + further)


def further_drag(block: Block, rayleigh: RayleighConfig | None) -> float:
    """What the mass term of a block's damping is more than the scene's alpha [1/s].

    A damping matrix that a block brings has no such term: it acts on rigid motion as it says.
    """
    alpha = 0.0 if brings_damping(block) else material_coefficients(block, rayleigh)[0]
    return alpha - rayleigh_coefficients(rayleigh)[0]


def joints_alone_hold(part: Part, scene: Scene) -> bool:
    """Tell whether neither supports nor a viscous boundary stop every rigid motion of a part."""
    viscous = any(scene.blocks[name].absorbing for name in part.blocks)
    return not viscous and not part.stands_free(scene)


def sliding_motions(part: Part, scene: Scene, K: csr_matrix, M: csr_matrix, free: Bools) -> Floats:
    """Rigid motions (n, r) over a part's free DOFs that joints alone hold, M-orthonormal.

    Parameters
    ----------
    K, M : (n, n) of the part over its free DOFs
    free : (3 nodes,) True where no support holds
    """
    if not M.diagonal().any() or not joints_alone_hold(part, scene):
        return np.zeros((K.shape[0], 0))
    return rigid_modes(K, M, motions_of_pieces(part.mesh(scene.blocks), part.nodes)[free])


def rigid_drag(inertia: Floats, R: Floats) -> Floats:
    """D (n, k), whose D D^T is taken off a damping matrix so that it does not act on motions R.

    Parameters
    ----------
    inertia : (n, r) the forces of the mass terms on the motions at unit velocity, alpha M R where all have
        one alpha
    R : (n, r) the motions; those without drag have no column of D
    """
    drag, V = np.linalg.eigh(R.T @ inertia)
    some = drag > _DRAG * drag.max(initial=0.0)
    return np.asarray(inertia @ (V[:, some] / np.sqrt(drag[some])))


def drag_of_matrix(part: Part, scene: Scene) -> float:
    """Largest drag on a rigid motion that joints alone hold, by a block's damping matrix, over mass [1/s]."""
    matrices = scene.blocks[part.blocks[0]].matrices  # no tie takes such a block
    if matrices is None or matrices.C is None:
        return 0.0
    free = ~part.fixed(scene.fixed).ravel()
    K, M, C = (csr_matrix(matrix[free][:, free]) for matrix in (matrices.K, matrices.M, matrices.C))
    R = sliding_motions(part, scene, K, M, free)
    return float(np.linalg.eigvalsh(R.T @ (C @ R)).max(initial=0.0))


def damping_coupling(C: Floats) -> float:
    """Largest coupling of modes by their damping C (m, m): |C_ik| over the mean sqrt(C_ii C_kk), i not k.

    It is zero where the damping is classical: modes of the damped structure are those of the undamped one.
    """
    diagonal = C.diagonal()
    others = np.abs(C - np.diag(diagonal))
    mean = np.sqrt(np.maximum(np.outer(diagonal, diagonal), 0.0))
    return float(np.divide(others, mean, out=np.zeros_like(others), where=mean > 0.0).max(initial=0.0))


def brings_damping(block: Block) -> bool:
    """Tell whether a block has a damping matrix, which stands in place of Rayleigh damping."""
    return block.matrices is not None and block.matrices.C is not None


def modal_coefficients(damping: DampingConfig, omega2: Floats) -> Floats:
    """Modal damping coefficients 2 xi omega of the open-joint modes, zero of rigid motions.

    Parameters
    ----------
    damping : Rayleigh damping, or ratios in the order of ascending frequency; the last ratio given
        holds for all higher modes
    omega2 : (m,) in any order [1/s2]

    Returns
    -------
    (m,) [1/s]
    """
    if damping.modal is None:
        alpha, beta = rayleigh_coefficients(damping.rayleigh)
        return np.where(omega2 > 0.0, alpha + beta * omega2, 0.0)
    ratios = np.atleast_1d(np.asarray(damping.modal, dtype=float))
    ranked = ratios[np.minimum(np.arange(len(omega2)), len(ratios) - 1)]
    ratio = np.empty_like(omega2)
    ratio[np.argsort(omega2, kind="stable")] = ranked
    return 2.0 * ratio * np.sqrt(omega2)
