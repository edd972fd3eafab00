"""The gap element's law at one gap: pure functions of the jump and the slip history.

Sign conventions: opening g = w_i + initial gap, positive when open; normal force p_n positive in
compression; (t_j, t_k) is the shear force on side J. A law returns the new slip anchor and never
moves the old one, so evaluating a rejected iterate changes nothing; the caller commits once per
accepted step.

References
----------
Zivkovic et al., "Using of gap element for contraction joints modeling in seismic analysis of
concrete arch dams": K_n, K_nz, K_s, mu_y, mu_z, initial gap. Slip memory (the anchor) is ours: the
source writes the slip force along the total shear displacement, which dissipates wrongly in cycles;
on first loading the two agree.
"""

from __future__ import annotations

import math

from numba import njit

OPEN, STICK, SLIP = 0, 1, 2


@njit(cache=True)
def normal_force(opening: float, K_n: float, K_nz: float) -> float:
    """Compression [N] of a gap with finite stiffness: K_n closed, K_nz (tension, negative) open."""
    return -K_n * opening if opening < 0.0 else -K_nz * opening


@njit(cache=True)
def project_shear(t_j: float, t_k: float, limit_j: float, limit_k: float) -> tuple[float, float, bool]:
    """Nearest admissible shear to a trial shear, and whether the gap slips.

    Equal limits bound the resultant (a disc), unequal limits each direction (a rectangle).
    """
    if limit_j == limit_k:
        size = math.hypot(t_j, t_k)
        if size <= limit_j:
            return t_j, t_k, False
        return t_j * (limit_j / size), t_k * (limit_j / size), True
    p_j = min(max(t_j, -limit_j), limit_j)
    p_k = min(max(t_k, -limit_k), limit_k)
    return p_j, p_k, p_j != t_j or p_k != t_k


@njit(cache=True)
def coulomb(
    jump: tuple[float, float, float],
    anchor: tuple[float, float],
    stiffness: tuple[float, float, float],
    mu: tuple[float, float],
) -> tuple[float, float, float, int, tuple[float, float]]:
    """Force, state and new anchor of one gap with finite stiffness and Coulomb friction.

    Parameters
    ----------
    jump : (opening, slip along j, slip along k) [m], the opening with the initial gap
    anchor : slip at which the stuck spring carries no force, along j and k [m]
    stiffness : (K_n, K_nz, K_s) [N/m]
    mu : friction coefficients along j and k

    Returns
    -------
    (p_n, t_j, t_k, state, new anchor) : forces [N]; state is OPEN, STICK or SLIP
    """
    opening, w_j, w_k = jump
    K_n, K_nz, K_s = stiffness
    p_n = normal_force(opening, K_n, K_nz)
    if opening >= 0.0:
        return p_n, 0.0, 0.0, OPEN, (w_j, w_k)
    trial_j, trial_k = -K_s * (w_j - anchor[0]), -K_s * (w_k - anchor[1])
    t_j, t_k, slips = project_shear(trial_j, trial_k, mu[0] * p_n, mu[1] * p_n)
    if not slips:
        return p_n, t_j, t_k, STICK, anchor
    return p_n, t_j, t_k, SLIP, (w_j + t_j / K_s, w_k + t_k / K_s)


@njit(cache=True)
def frictionless(
    jump: tuple[float, float, float],
    anchor: tuple[float, float],
    stiffness: tuple[float, float, float],
    mu: tuple[float, float],
) -> tuple[float, float, float, int, tuple[float, float]]:
    """Force and state of one gap that carries no shear; arguments and result as `coulomb`."""
    opening = jump[0]
    state = OPEN if opening >= 0.0 else STICK
    return normal_force(opening, stiffness[0], stiffness[1]), 0.0, 0.0, state, (jump[1], jump[2])


LAWS = {"coulomb": coulomb, "frictionless": frictionless}
