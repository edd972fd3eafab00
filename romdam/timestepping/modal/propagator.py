"""Exact propagation of uncoupled modes over one step, and the exact work done in it.

Each mode obeys q'' + c q' + k q = f(t) + p, where f is linear over the step and p is constant. With the
vector z = (q, v, f, f') this is z' = A z, so the step is the matrix exponential of A. No term is divided by a
frequency, and rigid and overdamped modes are ordinary cases. An unknown without mass obeys c q' + k q = f(t)
+ p; it has the velocity v = (f + p - k q) / c in place of a state of its own.

The works over a step of length h are quadratic in z and are exact too:

    int v f dt = f(0) (q(h) - q(0)) + f' (moment . z),   int c v^2 dt = z^T D z.

Both follow from Gramians int_0^h e^(A^T s) Q e^(A s) ds, so the energy ledger has no quadrature error.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats

_TAYLOR = 18  # terms; with the norm below this leaves less than round-off
_NORM = 0.5  # of A tau before doubling
_WORK, _LOSS = 0, 1  # the two Gramians
DISP, VEL, FORCE, RATE = 0, 1, 2, 3  # of z, RATE being f'
_PAIRS = [(a, b) for a in range(4) for b in range(a, 4)]
QQ, QV, QF, QR, VV, VF, VR, FF, FR, RR = range(len(_PAIRS))  # pairs of q, v, f and f' (R)


class Propagator(NamedTuple):
    """Coefficients of one step for m modes.

    Attributes
    ----------
    dt : step [s]; a number, or (levels,) where several steps are stacked
    q_q, q_v, v_q, v_v : (m,) state to state
    q_0, q_1, v_0, v_1 : (m,) external force at the step's start and end to state
    q_p, v_p : (m,) force constant over the step to state
    moment : (4, m) int s v ds as a linear form of (q, v, f + p, f')
    loss : (10, m) int c v^2 dt as a quadratic form of (q, v, f + p, f'), upper triangle by rows
    """

    dt: Any
    q_q: Floats
    q_v: Floats
    v_q: Floats
    v_v: Floats
    q_0: Floats
    q_1: Floats
    v_0: Floats
    v_1: Floats
    q_p: Floats
    v_p: Floats
    moment: Floats
    loss: Floats


def modal_propagator(
    k: Floats, c: Floats, dt: float, massless: NDArray[np.bool_] | None = None
) -> Propagator:
    """Exact step coefficients.

    Parameters
    ----------
    k : (m,) modal stiffness omega^2 [1/s2], zero for rigid modes
    c : (m,) modal damping coefficient 2 xi omega [1/s]
    dt : step [s]
    massless : (m,) unknowns without mass, whose k and c are positive; none by default

    Returns
    -------
    Propagator
    """
    # exponential and the two Gramians by Taylor series and doubling: X(2 tau) = X(tau) + E^T X E adds
    # positive terms only; the usual block exponential would overflow for strongly damped modes
    m, (A, scale, velocity, doublings) = len(k), _generator(k, c, dt, massless)
    forms = np.zeros((2, m, 4, 4))
    forms[_WORK, :, :, FORCE] = 0.5 * velocity
    forms[_WORK] += forms[_WORK].transpose(0, 2, 1)
    forms[_LOSS] = c[:, None, None] * velocity[:, :, None] * velocity[:, None, :]
    X = np.zeros((2, m, 4, 4))
    shares, weights = _gauss()
    *steps, E = _exponentials(A, shares)
    for e, weight in zip(steps, weights, strict=True):
        X += 0.5 * (dt / 2.0**doublings) * weight * (e.transpose(0, 2, 1) @ forms @ e)
    for _ in range(doublings):
        X = X + E.transpose(0, 2, 1) @ X @ E
        E = E @ E
    unscale = np.ones((m, 4))
    unscale[:, VEL] = 1.0 / scale
    if massless is not None and massless.any():
        E[massless, VEL] = np.einsum("mi,mij->mj", velocity, E)[massless] / scale[massless, None]
    E = E * unscale[:, None, :] / unscale[:, :, None]
    X = X * unscale[:, None, :] * unscale[:, :, None]
    work, loss = X[_WORK], X[_LOSS]
    moment = [  # from the terms with f' in the form of int v f dt
        2.0 * work[:, DISP, RATE],
        2.0 * work[:, VEL, RATE],
        2.0 * work[:, FORCE, RATE] - E[:, DISP, RATE],
        work[:, RATE, RATE],
    ]
    return Propagator(
        dt=dt,
        q_q=E[:, DISP, DISP].copy(),
        q_v=E[:, DISP, VEL].copy(),
        v_q=E[:, VEL, DISP].copy(),
        v_v=E[:, VEL, VEL].copy(),
        q_0=E[:, DISP, FORCE] - E[:, DISP, RATE] / dt,
        q_1=E[:, DISP, RATE] / dt,
        v_0=E[:, VEL, FORCE] - E[:, VEL, RATE] / dt,
        v_1=E[:, VEL, RATE] / dt,
        q_p=E[:, DISP, FORCE].copy(),
        v_p=E[:, VEL, FORCE].copy(),
        moment=np.stack(moment),
        loss=np.stack([loss[:, a, b] * (1.0 if a == b else 2.0) for a, b in _PAIRS]),
    )


def response_to_force(k: Floats, c: Floats, dt: float, massless: NDArray[np.bool_]) -> Floats:
    """`Propagator.q_p` to the bit, without the rest; see `modal_propagator`."""
    A, _, _, doublings = _generator(k, c, dt, massless)
    *_, E = _exponentials(A, _gauss()[0])  # all of them: a product of fewer rows has other bits
    for _ in range(doublings):
        E = E @ E
    return E[:, DISP, FORCE].copy()


def _generator(
    k: Floats, c: Floats, dt: float, massless: NDArray[np.bool_] | None
) -> tuple[Floats, Floats, Floats, int]:
    """Generator of the modes' motion on z, whose velocity is carried as v / scale, which balances it.

    Returns
    -------
    (A, scale, velocity, doublings) : A (m, 4, 4) times a step that takes so many doublings; scale (m,);
        velocity (m, 4), v as a linear form of z
    """
    scale = np.maximum(np.sqrt(k), 1.0 / dt)
    A, velocity = np.zeros((len(k), 4, 4)), np.zeros((len(k), 4))
    velocity[:, VEL] = scale
    A[:, VEL, DISP] = -k / scale
    A[:, VEL, VEL] = -c
    A[:, VEL, FORCE] = 1.0 / scale
    if massless is not None and massless.any():
        A[massless, VEL] = velocity[massless] = 0.0
        velocity[massless, DISP] = -k[massless] / c[massless]
        velocity[massless, FORCE] = 1.0 / c[massless]
    A[:, DISP] = velocity
    A[:, FORCE, RATE] = 1.0
    norm = np.abs(A).sum(axis=2).max(initial=1.0) * dt
    doublings = max(0, int(np.ceil(np.log2(norm / _NORM))))
    return A * (dt / 2.0**doublings), scale, velocity, doublings


@cache
def _gauss() -> tuple[Floats, Floats]:
    """Shares of the step, its end the last, and weights of the quadrature; to find these takes a quarter of a
    propagator's time.
    """
    nodes, weights = np.polynomial.legendre.leggauss(12)
    return np.append(0.5 * (nodes + 1.0), 1.0), weights


def _exponentials(A: Floats, shares: Floats) -> Floats:
    """exp(share A) for every share, (shares, *A.shape), from one Taylor series."""
    terms = np.empty((_TAYLOR, *A.shape))
    terms[0] = np.eye(A.shape[-1])
    for order in range(1, _TAYLOR):
        terms[order] = terms[order - 1] @ A / order
    powers = shares[:, None] ** np.arange(_TAYLOR)
    return np.asarray((powers @ terms.reshape(_TAYLOR, -1)).reshape(len(shares), *A.shape))
