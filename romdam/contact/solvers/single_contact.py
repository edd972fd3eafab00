"""The gap-space problem of a single gap with friction, solved exactly by going through its states.

With the forces of all other gaps held, y = A p + b with A (3, 3) positive definite. A gap is open, or
sticks, or slides; on the resultant the direction of sliding is the root of a function of one angle. Where
normal and tangent are strongly coupled (rigid joints, mu above 1) a projected step on (p_n, t) can rest
where no solution is or move in circles; going through the states cannot.

References
----------
Bonnefon, Daviet, "Quartic formulation of Coulomb 3D frictional contact", INRIA RT-0400 (2011): a solution
exists for every positive definite A; the sliding direction is the root of a quartic.
"""

from __future__ import annotations

import math

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.jit import njit

_ANGLES = 96  # the quartic has at most four roots
_BISECTIONS = 60
_ROUND_OFF = 1e-12


@njit(cache=True)
def _slide(
    A: Floats, b: Floats, bound: tuple[float, float], angle: float
) -> tuple[float, float, float, float]:
    """Force on the limit at an angle: (p_n, shear, y_t across it, y_t along it); p_n < 0 where none fits.

    y_t of a closed gap is times the stiffness of its normal direction, which takes it through its poles.
    """
    cohesion, mu = bound
    e_j, e_k = math.cos(angle), math.sin(angle)
    pull = A[0, 1] * e_j + A[0, 2] * e_k
    push, stiff = max(-b[0] - cohesion * pull, 0.0), A[0, 0] + mu * pull
    s_j, s_k = A[1, 1] * e_j + A[1, 2] * e_k, A[2, 1] * e_j + A[2, 2] * e_k
    if push == 0.0:
        stiff = 1.0
    y_j = stiff * (b[1] + cohesion * s_j) + push * (A[1, 0] + mu * s_j)
    y_k = stiff * (b[2] + cohesion * s_k) + push * (A[2, 0] + mu * s_k)
    across, along = e_j * y_k - e_k * y_j, e_j * y_j + e_k * y_k
    p_n = push / stiff if stiff > 0.0 else -1.0
    return p_n, cohesion + mu * p_n, across, along


@njit(cache=True)
def _sliding(A: Floats, b: Floats, bound: tuple[float, float], p: Floats) -> bool:
    """Slide on the resultant limit against the jump; whether there is such a solution."""
    before = _slide(A, b, bound, 0.0)[2]
    for n in range(_ANGLES):
        left, right = 2.0 * math.pi * n / _ANGLES, 2.0 * math.pi * (n + 1) / _ANGLES
        after = _slide(A, b, bound, right)[2]
        if before * after <= 0.0:
            for _ in range(_BISECTIONS):
                middle = 0.5 * (left + right)
                if (_slide(A, b, bound, middle)[2] > 0.0) == (after > before):
                    right = middle
                else:
                    left = middle
            p_n, t, across, along = _slide(A, b, bound, left)
            jumps = abs(across) > 1e-6 * max(abs(before), abs(after))  # no root: a gap that would pull opens
            if p_n >= 0.0 and along <= 0.0 and not jumps:
                p[0], p[1], p[2] = p_n, t * math.cos(left), t * math.sin(left)
                return True
        before = after
    return False


@njit(cache=True)
def _fits(y: float, p: float, limit: float, state: int) -> bool:
    """Whether a shear component sticks within its limit, or slides against its jump."""
    if state == 0:
        return abs(p) <= limit * (1.0 + _ROUND_OFF)
    return y * state <= 0.0


@njit(cache=True)
def _row(A: Floats, r: int, p: Floats, b: Floats) -> float:
    """Row r of A p + b."""
    return A[r, 0] * p[0] + A[r, 1] * p[1] + A[r, 2] * p[2] + b[r]


@njit(cache=True)
def _combination(
    A: Floats, b: Floats, limits: tuple[Floats, Floats], states: tuple[bool, int, int], p: Floats
) -> bool:
    """Solve for one combination of states: closed or open, each shear stuck (0) or sliding (its sign)."""
    cohesion, mu = limits
    closed, moves = states[0], (states[1], states[2])
    J, right = np.eye(3), np.zeros(3)
    for r in range(3):
        if closed if r == 0 else moves[r - 1] == 0:
            J[r, 0], J[r, 1], J[r, 2], right[r] = A[r, 0], A[r, 1], A[r, 2], -b[r]
    for a in range(2):
        if moves[a] == 0:
            continue
        if math.isfinite(cohesion[a]):
            J[1 + a, 0], right[1 + a] = -moves[a] * mu[a], moves[a] * cohesion[a]
        else:
            return False
    found = np.linalg.solve(J, right).astype(np.float64)
    good = found[0] >= 0.0 if closed else _row(A, 0, found, b) >= 0.0
    for a in range(2):
        limit = cohesion[a] + mu[a] * found[0]
        good = good and _fits(_row(A, 1 + a, found, b), found[1 + a], limit, moves[a])
    if good:
        p[0], p[1], p[2] = found
    return good


@njit(cache=True)
def solve_gap(A: Floats, b: Floats, cohesion: Floats, mu: Floats, p: Floats) -> bool:
    """Solve y = A p + b for one gap; whether a state was found that fits (p is left as it was if none).

    Parameters
    ----------
    A : (3, 3) positive definite [m/N]
    b : (3,) response to everything else [m]
    cohesion, mu : (2,) shear limit c + mu p_n along j and k, on the resultant where both are equal [N]
    p : (3,) receives normal force and shear [N]
    """
    limits, stuck = (cohesion, mu), np.empty(3)
    if cohesion[0] == cohesion[1] and mu[0] == mu[1]:
        for closed in (False, True):
            good = _combination(A, b, limits, (closed, 0, 0), stuck)
            if good and math.hypot(stuck[1], stuck[2]) <= cohesion[0] + mu[0] * stuck[0]:
                p[0], p[1], p[2] = stuck
                return True
        return math.isfinite(cohesion[0]) and _sliding(A, b, (cohesion[0], mu[0]), p)
    for closed in (False, True):
        for j in (0, 1, -1):
            for k in (0, 1, -1):
                if _combination(A, b, limits, (closed, j, k), p):
                    return True
    return False
