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
    lift : (N, N) or (0, 0), the factor (I + H D)^-1 where there is tension stiffness
    tension : (n,) K_nz [N/m]
    compliance : (N,) of the gaps [m/N]
    mu : (n, 2) friction on p_c, scaled so that the limit is mu times the whole normal force
    gap : (n,) initial gap [m]
    """

    W: Floats
    lift: Floats
    tension: Floats
    compliance: Floats
    mu: Floats
    gap: Floats


class GapMemory(NamedTuple):
    """What the solver carries from step to step, changed in place by an accepted step only.

    Attributes
    ----------
    force : (N,) p_c of the last step, the warm start [N]
    anchor : (n, 2) slip anchors [m]; empty without friction
    closed : (n,) whether the gap is in the active set
    inverse : (n, n) the inverse of W on the closed gaps in its leading rows (frictionless), else empty
    order : (n,) the closed gaps in the order of those rows
    work : (n,) scratch
    counts : (4,) closed gaps in `inverse`, changes since it was made, iterations in all, largest in a step
    """

    force: Floats
    anchor: Floats
    closed: NDArray[np.bool_]
    inverse: Floats
    order: NDArray[np.int64]
    work: Floats
    counts: NDArray[np.int64]


def gap_problem(
    H: Floats, stiffness: tuple[Floats, Floats, Floats], mu: Floats, gap: Floats
) -> GapProblem:
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
    W, lift = H, np.zeros((0, 0))
    if K_nz.any():
        D = np.zeros((n, d))
        D[:, 0] = K_nz
        lift = np.linalg.inv(np.eye(n * d) + H * D.ravel())
        W = lift @ H
    with np.errstate(invalid="ignore"):
        whole = np.where(np.isinf(K_n), 1.0, K_n / unilateral)
    W = 0.5 * (W + W.T) + np.diag(compliance.ravel())
    return GapProblem(
        W=np.ascontiguousarray(W),
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
            f"joints: tension_stiffness must be below normal_stiffness (at most equal to it without friction), "
            f"got {K_nz[i]:.4g} N/m against {K_n[i]:.4g} N/m at gap {i}; lower tension_stiffness"
        )


def gap_memory(problem: GapProblem) -> GapMemory:
    """A memory with every gap open and unloaded."""
    n, N = len(problem.gap), len(problem.W)
    frictionless = n == N
    return GapMemory(
        force=np.zeros(N),
        anchor=np.zeros((0 if frictionless else n, 2)),
        closed=np.zeros(n, dtype=np.bool_),
        inverse=np.zeros((n, n) if frictionless else (0, 0)),
        order=np.zeros(n, dtype=np.int64),
        work=np.zeros(n),
        counts=np.zeros(4, dtype=np.int64),
    )
