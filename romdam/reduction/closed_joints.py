"""Frequencies of a reduced model whose gaps are all closed, as its springs hold them."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh, null_space

from romdam.core.arrays import Floats
from romdam.core.system import System

MOST = 2500  # unknowns, up to which it takes some seconds
_SHIFT = (2.0 * np.pi) ** 2  # [1/s2]; rigid motions, whose stiffness is none, are at 1 Hz while it is solved


def closed_frequencies(system: System, count: int) -> Floats:
    """Find the lowest frequencies with every gap closed and, where the model has shear, sticking.

    Parameters
    ----------
    system : reduced, taken without damping; its joints act by K_n and K_s, rigid gaps move as one
    count : at most so many

    Returns
    -------
    (m,) ascending [Hz]; none for more than `MOST` unknowns, without gaps, and with waves in the water
    """
    if system.size > MOST or not len(system.law) or system.gyroscopic:
        return np.zeros(0)
    M, K, B = system.M.toarray(), system.K.toarray(), system.B.toarray()
    law, directions = system.law, system.B.shape[0] // len(system.law)
    stiffness = np.column_stack([law.K_n, law.K_s, law.K_s])[:, :directions].ravel()
    held = np.isinf(stiffness)
    K = K + B[~held].T @ (stiffness[~held, None] * B[~held]) + _SHIFT * M
    if held.any():
        kept = null_space(B[held])
        M, K = kept.T @ M @ kept, kept.T @ K @ kept
    # M may be singular, K is not: the largest of 1 / (omega^2 + shift)
    inverse = eigh(M, K, eigvals_only=True, subset_by_index=[max(len(K) - count, 0), len(K) - 1])[::-1]
    omega2 = 1.0 / inverse[inverse > 0.0] - _SHIFT
    return np.asarray(np.sqrt(np.maximum(omega2, 0.0)) / (2.0 * np.pi))
