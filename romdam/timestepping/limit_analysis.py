"""Limit analysis on rigid motions: tell whether joints can hold blocks that nothing else holds.

At rest the forces of the gaps balance the loads in every rigid motion R of what floats, R^T (f + B^T p) = 0,
with p_n >= 0 and |t| <= c + mu p_n. Where no p does that, whatever it would strain, there is no equilibrium.
The disc is a polygon around it, so that nothing is refused that might rest.

References
----------
Livesley, Int. J. Numer. Meth. Engng 12 (1978) 1853: limit analysis of structures formed from rigid blocks.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, vstack

from romdam.contact.components import ALONG_J, ALONG_K
from romdam.contact.problem import GapProblem, Limits, gap_memory
from romdam.contact.softening import put_limits
from romdam.core.arrays import Floats
from romdam.core.system import System

_SIDES = 16  # of the polygon: 2 % more than the disc
_RIGID = 1e-12  # of the largest stiffness: a mode below it is a rigid motion
_UPRIGHT = 1e-9  # of a side of the polygon along an axis: round-off of its cosine
_BALANCED = 1e-6  # of the loads, what may be left
_MOST, _HALVINGS = 8.0, 7  # times the strength that is tried, and how often that range is halved


def needed_strength(system: System, problem: GapProblem) -> float:
    """Least factor on the shear strength with which the joints might hold what floats; 1 where they may be.

    It is inf where no shear strength would do, as for a block that is lifted or joints without friction.
    """
    k = system.K.diagonal()
    rigid = np.flatnonzero((k <= _RIGID * k.max(initial=0.0)) & (system.M.diagonal() > 0.0))
    if not (system.diagonal and system.force[rigid].any()) or problem.tension.any():
        return 1.0
    motions, loads = csr_matrix(system.B)[:, rigid].T.toarray(), system.force[rigid]
    memory = gap_memory(problem)
    put_limits(problem, memory)
    low, high = 1.0, _MOST
    if _holds(motions, loads, memory.limits, low):
        return low
    if not _holds(motions, loads, memory.limits, high):
        return np.inf
    for _ in range(_HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if _holds(motions, loads, memory.limits, middle) else (middle, high)
    return high


def _holds(motions: Floats, loads: Floats, limits: Limits, factor: float) -> bool:
    """Tell whether forces of the gaps, of so many times their shear strength, balance loads on rigid motions.

    Parameters
    ----------
    motions : (r, N) jumps of the gaps in every motion
    loads : (r,) on the motions
    """
    from scipy.optimize import linprog  # here: few scenes come to it, and it loads 90 modules

    n = len(limits.tension)
    d = motions.shape[1] // n
    size, left = np.abs(loads).max(), np.full((len(loads), 1), -1.0)
    pulled = motions[:, ::d] @ limits.tension  # forces are counted from the bonds' tension
    rest = (loads - pulled) / size
    A = csr_matrix(np.vstack([np.hstack([motions, left]), np.hstack([-motions, left])]))
    b, bounds = np.concatenate([-rest, rest]), [(0.0, None), *[(None, None)] * (d - 1)] * n + [(0.0, None)]
    if d == 3:
        cone, most = _cone(limits, factor, size)
        A, b = vstack([A, cone], format="csr"), np.concatenate([b, most])
    cost = np.append(np.zeros(d * n), 1.0)
    found = linprog(cost, A_ub=A, b_ub=b, bounds=bounds, method="highs")
    return not found.success or bool(found.fun <= _BALANCED)


def _cone(limits: Limits, factor: float, size: float) -> tuple[csr_matrix, Floats]:
    """Rows and right-hand side of n . t <= factor (c + mu p_n), forces in units of a size [N]."""
    mu, cohesion = limits.mu, limits.cohesion
    disc = (mu[:, ALONG_J] == mu[:, ALONG_K]) & (cohesion[:, ALONG_J] == cohesion[:, ALONG_K])
    rows, most = [], []
    for side in range(_SIDES):
        angle = 2.0 * np.pi * side / _SIDES
        along = np.array([np.cos(angle), np.sin(angle)])
        a = int(abs(along[ALONG_K]) > abs(along[ALONG_J]))
        gaps = np.flatnonzero((disc | (np.abs(along).max() > 1.0 - _UPRIGHT)) & np.isfinite(cohesion[:, a]))
        values = np.column_stack([-factor * mu[gaps, a], np.tile(along, (len(gaps), 1))])
        rows.append((gaps, values))
        most.append(factor * cohesion[gaps, a] / size)
    gaps, values = (np.concatenate([one[i] for one in rows]) for i in range(2))
    columns = 3 * gaps[:, None] + np.arange(3)
    number = np.repeat(np.arange(len(gaps)), 3)
    shape = len(gaps), 3 * len(limits.tension) + 1
    return csr_matrix((values.ravel(), (number, columns.ravel())), shape=shape), np.concatenate(most)
