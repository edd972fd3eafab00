"""Inertia relief: the part of a force that a floating body answers by straining.

Nothing holds it statically. With R its rigid motions, R^T M R = 1, the force f - M R R^T f is in equilibrium
with the inertia of the acceleration R R^T f, and its answer has no rigid part. Where K less a small shift
times M stands for K, f itself would be answered by a rigid motion, a million times the strain.

References
----------
Rubin, AIAA Journal 13 (1975) 995; Craig, Kurdila, Fundamentals of Structural Dynamics (2006), ch. 17.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from romdam.core.arrays import Floats, Ints

# square of what is left of a load of unit length, below which that is round-off
_BALANCED = 1e-10


def unbalanced(loads: csc_matrix, rigid: Floats, M: csr_matrix) -> Ints:
    """Numbers of the loads (n, a), of unit length, that do more than accelerate a body rigidly."""
    inertia, along = M @ rigid, loads.T @ rigid
    left = 1.0 - ((2.0 * (loads.T @ inertia) - along @ (inertia.T @ inertia)) * along).sum(axis=1)
    return np.flatnonzero(left > _BALANCED)
