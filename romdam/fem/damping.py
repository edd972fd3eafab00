"""Damping of the solids from a configuration, Rayleigh's or modal; none on motions that joints alone hold.

The mass term of Rayleigh damping is a drag against the ground. On a body that supports hold it stands for
energy lost in strain. On a body that slides or rocks on joints it would brake the rigid motion, as a viscous
friction that is not there. So the damping of the solids does not act on the rigid motions R that supports and
viscous boundaries leave: with C_a = alpha M + beta K,

    C = C_a - D D^T,   D = C_a R (R^T C_a R)^(-1/2),

which is symmetric and positive semidefinite and has C R = 0. As K R = 0, D is sqrt(alpha) M R for R with
R^T M R = 1; in open-joint modes alpha is left off those of zero frequency. Dashpots of viscous boundaries,
damping in water and a damping matrix that a block brings act on rigid motions as on any other.

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
from romdam.linalg.modes.rigid import rigid_modes
from romdam.scene.supports import motions_of_pieces
from romdam.scene.ties import Part

_DRAG = 1e-9  # of the largest drag on a rigid motion, below which it is round-off


def rayleigh_coefficients(rayleigh: RayleighConfig | None) -> tuple[float, float]:
    """(alpha [1/s], beta [s]) of C = alpha M + beta K; both zero without Rayleigh damping.

    Two frequencies with one ratio xi give alpha = 2 xi w1 w2 / (w1 + w2), beta = 2 xi / (w1 + w2).
    """
    if rayleigh is None:
        return 0.0, 0.0
    if rayleigh.frequencies is None or rayleigh.ratio is None:
        return float(rayleigh.alpha or 0.0), float(rayleigh.beta or 0.0)
    w1, w2 = (2.0 * np.pi * f for f in rayleigh.frequencies)
    return 2.0 * rayleigh.ratio * w1 * w2 / (w1 + w2), 2.0 * rayleigh.ratio / (w1 + w2)


def further_damping(block: Block, rayleigh: RayleighConfig | None) -> csr_matrix | None:
    """Damping of a block besides Rayleigh's, (3 n, 3 n) [N s/m]; None where it has nothing.

    Dashpots of absorbing faces, and a damping matrix that the block brings, which stands in Rayleigh's place.
    """
    brought = block.matrices
    if brought is None or brought.C is None:
        return boundary_dashpots(block) if block.absorbing else None
    alpha, beta = rayleigh_coefficients(rayleigh)
    return csr_matrix(brought.C - alpha * brought.M - beta * brought.K + boundary_dashpots(block))


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
    inertia : (n, r) alpha M R, the forces of the mass term on the motions at unit velocity
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
