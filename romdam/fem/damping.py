"""Damping coefficients from a configuration."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.arrays import Floats
from romdam.core.scene import Block
from romdam.fem.absorbing import boundary_dashpots


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
    own = block.matrices
    if own is None or own.C is None:
        return boundary_dashpots(block) if block.absorbing else None
    alpha, beta = rayleigh_coefficients(rayleigh)
    return csr_matrix(own.C - alpha * own.M - beta * own.K + boundary_dashpots(block))


def modal_coefficients(damping: DampingConfig, omega2: Floats) -> Floats:
    """Modal damping coefficients 2 xi omega of the open-joint modes.

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
        return alpha + beta * omega2
    given = np.atleast_1d(np.asarray(damping.modal, dtype=float))
    ranked = given[np.minimum(np.arange(len(omega2)), len(given) - 1)]
    ratio = np.empty_like(omega2)
    ratio[np.argsort(omega2, kind="stable")] = ranked
    return 2.0 * ratio * np.sqrt(omega2)
