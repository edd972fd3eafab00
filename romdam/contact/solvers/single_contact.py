"""The gap-space problem of one gap with friction, solved exactly by trying its states.

With the forces of all other gaps held, the gap obeys y = A p + b, where A (3, 3) is positive definite. It is
open, sticks or slides. The first two states are linear equations. If friction limits the resultant, the
direction of sliding is one angle, and it is a root of a function of that angle, which is found by scanning
the circle.

The usual projected step on (p_n, t) is cheaper but not safe. Where normal and tangential directions are
strongly coupled (rigid joints, mu above 1) it can come to rest at a force that is no solution, or move in a
circle. Trying the states cannot.

References
----------
Bonnefon, Daviet, "Quartic formulation of Coulomb 3D frictional contact", INRIA RT-0400 (2011): a solution
exists for every positive definite A; the sliding direction is the root of a quartic.
"""

from __future__ import annotations

import math

import numpy as np

from romdam.contact.components import ALONG_J, ALONG_K, NORMAL, SHEAR_J, SHEAR_K
from romdam.contact.cone import shear_limit
from romdam.core.arrays import Floats
from romdam.core.jit import copy, njit

_ANGLES = 96  # the quartic has at most four roots
_BISECTIONS = 60  # of an angle that a sign change encloses
_ROUND_OFF = 1e-12  # relative, of one contact's state


@njit(cache=True)
def _slide(
    A: Floats, b: Floats, cohesion: float, mu: float, closed: bool, angle: float
) -> tuple[float, float, float]:
    """Force on the limit at an angle: (p_n, y_t across it, y_t along it); p_n < 0 where none fits.

    y_t of a closed gap is times the stiffness of its normal direction: like y_t of an open one it has no
    poles then, and across it is a trigonometric polynomial of degree two. Where that stiffness is negative,
    mu large and the coupling strong, a gap can be closed that could be open too.
    """
    e_j, e_k = math.cos(angle), math.sin(angle)
    pull = A[NORMAL, SHEAR_J] * e_j + A[NORMAL, SHEAR_K] * e_k
    push, stiff = -b[NORMAL] - cohesion * pull, A[NORMAL, NORMAL] + mu * pull
    s_j, s_k = (
        A[SHEAR_J, SHEAR_J] * e_j + A[SHEAR_J, SHEAR_K] * e_k,
        A[SHEAR_K, SHEAR_J] * e_j + A[SHEAR_K, SHEAR_K] * e_k,
    )
    y_j, y_k = b[SHEAR_J] + cohesion * s_j, b[SHEAR_K] + cohesion * s_k
    if not closed:
        p_n = 0.0 if push <= _ROUND_OFF * (abs(b[NORMAL]) + abs(cohesion * pull)) else -1.0
        return p_n, e_j * y_k - e_k * y_j, e_j * y_j + e_k * y_k
    y_j = stiff * y_j + push * (A[SHEAR_J, NORMAL] + mu * s_j)
    y_k = stiff * y_k + push * (A[SHEAR_K, NORMAL] + mu * s_k)
    along = (e_j * y_j + e_k * y_k) * math.copysign(1.0, stiff)
    return push / stiff if stiff != 0.0 else -1.0, e_j * y_k - e_k * y_j, along


@njit(cache=True)
def _bottom(
    A: Floats, b: Floats, cohesion: float, mu: float, closed: bool, left: float, right: float
) -> float:
    """Angle in between where y_t across it is smallest, or where its sign is another one than at the ends."""
    sign = math.copysign(1.0, _slide(A, b, cohesion, mu, closed, left)[1])
    for _ in range(_BISECTIONS):
        third = (right - left) / 3.0
        lower = sign * _slide(A, b, cohesion, mu, closed, left + third)[1]
        upper = sign * _slide(A, b, cohesion, mu, closed, right - third)[1]
        if lower <= 0.0:
            return left + third
        if lower < upper:
            right -= third
        else:
            left += third
    return right


@njit(cache=True)
def _slides_between(
    A: Floats, b: Floats, cohesion: float, mu: float, closed: bool, left: float, right: float, p: Floats
) -> bool:
    """Slide against the jump at the angle in between where y_t across it vanishes; whether that can be."""
    rising = _slide(A, b, cohesion, mu, closed, right)[1] > _slide(A, b, cohesion, mu, closed, left)[1]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (left + right)
        if (_slide(A, b, cohesion, mu, closed, middle)[1] > 0.0) == rising:
            right = middle
        else:
            left = middle
    p_n, _, along = _slide(A, b, cohesion, mu, closed, left)
    if p_n < 0.0 or along > 0.0:
        return False
    t = shear_limit(cohesion, mu, p_n)
    p[NORMAL], p[SHEAR_J], p[SHEAR_K] = p_n, t * math.cos(left), t * math.sin(left)
    return True


@njit(cache=True)
def _sliding(A: Floats, b: Floats, cohesion: float, mu: float, p: Floats) -> bool:
    """Slide on the resultant limit against the jump; whether there is such a solution."""
    cell = 2.0 * math.pi / _ANGLES
    for closed in (False, True):
        before, here = (
            _slide(A, b, cohesion, mu, closed, -cell)[1],
            _slide(A, b, cohesion, mu, closed, 0.0)[1],
        )
        for n in range(_ANGLES):
            angle = cell * n
            after = _slide(A, b, cohesion, mu, closed, angle + cell)[1]
            low, high, middle = angle, angle + cell, angle + cell
            if here * after > 0.0 and abs(here) <= min(abs(before), abs(after)):  # two roots in a cell?
                low = angle - cell
                middle = _bottom(A, b, cohesion, mu, closed, low, high)
            crosses = _slide(A, b, cohesion, mu, closed, middle)[1] * here <= 0.0
            if crosses and _slides_between(A, b, cohesion, mu, closed, low, middle, p):
                return True
            if crosses and middle < high and _slides_between(A, b, cohesion, mu, closed, middle, high, p):
                return True
            before, here = here, after
    return False


@njit(cache=True)
def _row(A: Floats, r: int, p: Floats, b: Floats) -> float:
    """Row r of A p + b."""
    return A[r, NORMAL] * p[NORMAL] + A[r, SHEAR_J] * p[SHEAR_J] + A[r, SHEAR_K] * p[SHEAR_K] + b[r]


@njit(cache=True)
def _combination(
    A: Floats, b: Floats, cohesion: Floats, mu: Floats, closed: bool, moves: tuple[int, int], p: Floats
) -> bool:
    """Solve for one combination of states: closed or open, each shear stuck (0) or sliding (its sign)."""
    J, right = np.zeros((3, 3)), np.zeros(3)
    for r in range(3):
        J[r, r] = 1.0
        if closed if r == 0 else moves[r - 1] == 0:
            J[r, NORMAL], J[r, SHEAR_J], J[r, SHEAR_K], right[r] = (
                A[r, NORMAL],
                A[r, SHEAR_J],
                A[r, SHEAR_K],
                -b[r],
            )
    for a in range(2):
        if moves[a] == 0:
            continue
        if math.isfinite(cohesion[a]):
            J[SHEAR_J + a, NORMAL], right[SHEAR_J + a] = -moves[a] * mu[a], moves[a] * cohesion[a]
        else:
            return False
    solution = np.linalg.solve(J, right)
    good = solution[NORMAL] >= 0.0 if closed else _row(A, NORMAL, solution, b) >= 0.0
    for a in range(2):
        limit = shear_limit(cohesion[a], mu[a], solution[NORMAL])
        if moves[a] == 0:
            good = good and abs(solution[SHEAR_J + a]) <= limit * (1.0 + _ROUND_OFF)
        else:  # slides against its jump
            good = good and _row(A, SHEAR_J + a, solution, b) * moves[a] <= 0.0
    if good:
        copy(solution, p)
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
    stuck = np.empty(3)
    if cohesion[ALONG_J] == cohesion[ALONG_K] and mu[ALONG_J] == mu[ALONG_K]:
        for closed in (False, True):
            good = _combination(A, b, cohesion, mu, closed, (0, 0), stuck)
            limit = shear_limit(cohesion[ALONG_J], mu[ALONG_J], stuck[NORMAL])
            if good and math.hypot(stuck[SHEAR_J], stuck[SHEAR_K]) <= limit:
                copy(stuck, p)
                return True
        return math.isfinite(cohesion[ALONG_J]) and _sliding(A, b, cohesion[ALONG_J], mu[ALONG_J], p)
    for closed in (False, True):
        for j in (0, 1, -1):
            for k in (0, 1, -1):
                if _combination(A, b, cohesion, mu, closed, (j, k), p):
                    return True
    return False
