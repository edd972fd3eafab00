"""Admissible shear of a gap: a disc where its limits are equal along j and k, else a rectangle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from romdam.contact.components import ALONG_J, ALONG_K
from romdam.core.jit import njit

if TYPE_CHECKING:
    from romdam.contact.problem import Limits

_ON_LIMIT = 1e-9  # of a limit: a shear that is nearer to it slides


@njit(cache=True)
def shear_limit(cohesion: float, mu: float, p: float) -> float:
    """Limit of the shear along one direction, c + mu p, with p the force that friction acts on [N]."""
    return cohesion + mu * p


@njit(cache=True)
def shear_limits(limits: Limits, i: int, p: float) -> tuple[float, float]:
    """Limits of the shear of gap i along j and k [N].

    Parameters
    ----------
    p : force that friction acts on, p_c with the tension of a bond [N]
    """
    limit_j = shear_limit(limits.cohesion[i, ALONG_J], limits.mu[i, ALONG_J], p)
    limit_k = shear_limit(limits.cohesion[i, ALONG_K], limits.mu[i, ALONG_K], p)
    return limit_j, limit_k


@njit(cache=True)
def project_shear(t_j: float, t_k: float, limit_j: float, limit_k: float) -> tuple[float, float, bool]:
    """Nearest admissible shear to a trial shear, and whether the gap slips.

    Equal limits bound the resultant (a disc), unequal limits each direction (a rectangle).
    """
    if limit_j == limit_k:
        large, small = max(abs(t_j), abs(t_k)), min(abs(t_j), abs(t_k))
        # no hypot: it is a call, in the innermost loop
        size = large * math.sqrt(1.0 + (small / large) ** 2) if large > 0.0 else 0.0
        if size <= limit_j:
            return t_j, t_k, False
        return t_j * (limit_j / size), t_k * (limit_j / size), True
    p_j = min(max(t_j, -limit_j), limit_j)
    p_k = min(max(t_k, -limit_k), limit_k)
    return p_j, p_k, p_j != t_j or p_k != t_k


@njit(cache=True)
def slides(limit_j: float, limit_k: float, t_j: float, t_k: float) -> bool:
    """Tell whether a shear is on its limit (to round-off), never without one."""
    near_j, near_k = (1.0 - _ON_LIMIT) * limit_j, (1.0 - _ON_LIMIT) * limit_k
    if limit_j == limit_k:
        return near_j > 0.0 and t_j**2 + t_k**2 >= near_j**2
    return (near_j > 0.0 and abs(t_j) >= near_j) or (near_k > 0.0 and abs(t_k) >= near_k)
