"""Rigid motions of a body that its supports leave: those that strain nothing."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import spmatrix

from romdam.core.arrays import Floats

_STRAINLESS = 1e-8  # energy of a motion, of that with every stiffness on the diagonal alone, up to round-off
_DEPENDENT = 1e-8  # share of the largest motion below which supports hold one wholly


def rigid_modes(K: spmatrix, M: spmatrix, motions: Floats) -> Floats:
    """Combine rigid motions into M-orthonormal ones that strain nothing.

    Parameters
    ----------
    K, M : (n, n) over the free DOFs; M may be semidefinite, but not on all of a rigid motion
    motions : (n, m) the rigid motions of the free body, on these DOFs. Where supports hold some of a motion,
        what is left of it is no rigid motion and strains the body

    Returns
    -------
    (n, r) the combinations, r from 0 to 6
    """
    U, size, _ = np.linalg.svd(motions, full_matrices=False)
    Q = U[:, size > _DEPENDENT * size.max(initial=0.0)]
    if not Q.shape[1]:
        return np.zeros((len(motions), 0))
    energy, V = eigh(Q.T @ (K @ Q), Q.T @ (K.diagonal()[:, None] * Q))
    R = Q @ V[:, energy < _STRAINLESS]
    mass, V = np.linalg.eigh(R.T @ (M @ R))
    return np.asarray(R @ (V / np.sqrt(mass)))


def without_strain(omega2: Floats, number: int) -> Floats:
    """Ascending omega^2 [1/s2] whose lowest, those of rigid motions, are zero and not round-off."""
    return np.append(np.zeros(number), omega2[number:])
