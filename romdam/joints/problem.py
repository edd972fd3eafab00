"""All gaps together at the end of a step: the arrays of the implicit problem.

Over a step the jumps respond linearly to the joint force, w = w_free + H p. The tension stiffness
K_nz acts in both signs of the opening; it is linear and goes into H, so that what remains is
purely unilateral: p = p_c - K_nz g with p_c >= 0 acting through K_n - K_nz in compression only.
The compliance of the gaps (1/(K_n - K_nz), 1/K_s; zero where rigid) adds to the diagonal:

    y = W p_c + y_free,   W = H' + diag(compliance),   H' = (I + H D)^-1 H,   y_free = (I + H D)^-1 w_free,

with D = diag(K_nz) on the normal directions, and the initial gap and the slip anchors in y_free:

    y_n >= 0,  p_n >= 0,  y_n p_n = 0;   |t| <= mu' p_n,  y_t = -lambda t/|t|,  lambda >= 0 where sliding.

W is symmetric and positive definite; K_n = infinity is the same problem with a zero on the diagonal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from romdam.errors import ConfigError

Floats = NDArray[np.float64]


class GapProblem(NamedTuple):
    """Constant arrays of the gap-space problem; n gaps, d directions each, N = d n.

    Attributes
    ----------
    W : (N, N) flexibility of the jumps with the gaps' own compliance on the diagonal [m/N]
    Z : (n, n) its inverse (frictionless, where W is well conditioned), else (0, 0) [N/m]
    lift : (N, N) or (0, 0), the factor (I + H D)^-1 where there is tension stiffness
    tension : (n,) K_nz [N/m]
    compliance : (N,) of the gaps [m/N]
    mu : (n, 2) friction on p_c, scaled so that the limit is mu times the whole normal force
    gap : (n,) initial gap [m]
    """

    W: Floats
    Z: Floats
    lift: Floats
    tension: Floats
    compliance: Floats
    mu: Floats
    gap: Floats


class Limits(NamedTuple):
    """What bounds the shear of every gap: c + mu p_n, equal along j and k for a bound on the resultant.

    Attributes
    ----------
    cohesion : (n, 2) c [N]
    mu : (n, 2)
    """

    cohesion: Floats
    mu: Floats


class ActiveSet(NamedTuple):
    """The inverse of W (or Z) on an active set, changed in place.

    Attributes
    ----------
    active : (n,) whether a gap is in the set
    inverse : (n, n) the inverse on the set in its leading rows
    order : (n,) the gaps of the set in the order of those rows
    counts : (4,) size of the set, changes since the inverse was made, changes in all, largest in a step
    work : (3, n) scratch
    """

    active: NDArray[np.bool_]
    inverse: Floats
    order: NDArray[np.int64]
    counts: NDArray[np.int64]
    work: Floats


class GapMemory(NamedTuple):
    """What the solver carries from step to step.

    Attributes
    ----------
    force : (N,) p_c of the last step, the warm start [N]
    anchor : (n, 2) slip anchors [m], moved by accepted steps only; empty without friction
    active, inverse, order, counts : two of each of `ActiveSet`'s: closed gaps with W, open gaps with Z.
        With friction inverse[0] is W on the gaps of order[0], counts[0, 0] their number, and
        counts[0, 1:] are the steps that needed Newton, the iterations in all and the most in a step
    work : (3, N) scratch
    limits : in force now
    """

    force: Floats
    anchor: Floats
    active: NDArray[np.bool_]
    inverse: Floats
    order: NDArray[np.int64]
    counts: NDArray[np.int64]
    work: Floats
    limits: Limits


def gap_problem(H: Floats, stiffness: tuple[Floats, Floats, Floats], mu: Floats, gap: Floats) -> GapProblem:
    """Set up the gap-space problem of one time step.

    Parameters
    ----------
    H : (N, N) jump per joint force over the step [m/N]; N = n (frictionless) or 3 n
    stiffness : K_n (inf where rigid), K_nz, K_s, each (n,) [N/m]
    mu : (n, 2)
    gap : (n,) [m]

    Raises
    ------
    ConfigError
        where K_nz exceeds K_n, or equals it at a gap with friction.
    """
    K_n, K_nz, K_s = stiffness
    n = len(gap)
    d = len(H) // max(n, 1)
    _check_tension(K_n, K_nz, mu)
    unilateral = np.maximum(K_n - K_nz, 1e-12 * np.where(np.isinf(K_n), 1.0, K_n))
    compliance = np.zeros((n, d))
    compliance[:, 0] = 1.0 / unilateral
    if d == 3:
        with np.errstate(divide="ignore"):
            compliance[:, 1:] = np.where(K_s > 0.0, 1.0 / K_s, 0.0)[:, None]
    lift: Floats = np.zeros((0, 0))
    W: Floats = H
    if K_nz.any():
        D = np.zeros((n, d))
        D[:, 0] = K_nz
        lift = np.asarray(np.linalg.inv(np.eye(n * d) + H * D.ravel()), dtype=float)
        W = np.asarray(lift @ H)
    with np.errstate(invalid="ignore"):
        whole = np.where(np.isinf(K_n), 1.0, K_n / unilateral)
    W = 0.5 * (W + W.T) + np.diag(compliance.ravel())
    return GapProblem(
        W=np.ascontiguousarray(W),
        Z=_dual(W) if d == 1 else np.zeros((0, 0)),
        lift=np.ascontiguousarray(lift),
        tension=np.ascontiguousarray(K_nz, dtype=float),
        compliance=compliance.ravel(),
        mu=np.ascontiguousarray(mu * whole[:, None]),
        gap=np.ascontiguousarray(gap, dtype=float),
    )


def _check_tension(K_n: Floats, K_nz: Floats, mu: Floats) -> None:
    wrong = (K_nz > K_n) | ((K_nz == K_n) & (mu.max(axis=1, initial=0.0) > 0.0))
    if wrong.any():
        i = int(np.argmax(wrong))
        raise ConfigError(
            "joints: tension_stiffness must be below normal_stiffness (at most equal without friction), "
            f"got {K_nz[i]:.4g} N/m against {K_n[i]:.4g} N/m at gap {i}; lower tension_stiffness"
        )


def _dual(W: Floats) -> Floats:
    """The inverse of W, or nothing where round-off would spoil it."""
    nothing = np.zeros((0, 0))
    if len(W) == 0:
        return nothing
    try:
        Z = np.linalg.inv(W)
    except np.linalg.LinAlgError:
        return nothing
    good = np.abs(Z @ W - np.eye(len(W))).max() < 1e-9
    return np.ascontiguousarray(0.5 * (Z + Z.T)) if good else nothing


def gap_memory(problem: GapProblem) -> GapMemory:
    """A memory with every gap open and unloaded."""
    n, N = len(problem.gap), len(problem.W)
    return GapMemory(
        force=np.zeros(N),
        anchor=np.zeros((0 if n == N else n, 2)),
        active=np.zeros((2, n), dtype=np.bool_),
        inverse=np.zeros((2 if n == N else 1, N, N)),
        order=np.zeros((2, n), dtype=np.int64),
        counts=np.zeros((2, 4), dtype=np.int64),
        work=np.zeros((3, N)),
        limits=Limits(np.zeros((n, 2)), problem.mu.copy()),
    )
