"""Exact propagation of uncoupled modes over one step, and the exact work done in it.

Each mode q'' + c q' + k q = f(t) + p, with f linear over the step and p constant, is advanced by the
exponential of its augmented matrix on z = (q, v, f, f'). Nothing is divided by a frequency, so rigid
and overdamped modes are ordinary cases. The works over the step are exact too,

    int v f dt = f(0) (q(h) - q(0)) + f' (moment . z),   int c v^2 dt = z^T D z,

both from Gramians int_0^h e^(A^T s) Q e^(A s) ds, so the energy ledger carries no quadrature error.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from romdam.core.arrays import Floats

_TAYLOR = 18  # terms; with the norm below this leaves less than round-off
_NORM = 0.5  # of A tau before doubling
_PAIRS = [(a, b) for a in range(4) for b in range(a, 4)]


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


def modal_propagator(k: Floats, c: Floats, dt: float) -> Propagator:
    """Exact step coefficients.

    Parameters
    ----------
    k : (m,) modal stiffness omega^2 [1/s2], zero for rigid modes
    c : (m,) modal damping coefficient 2 xi omega [1/s]
    dt : step [s]

    Returns
    -------
    Propagator
    """
    E, work, loss = _step_matrices(k, c, dt)
    return Propagator(
        dt=dt,
        q_q=E[:, 0, 0].copy(),
        q_v=E[:, 0, 1].copy(),
        v_q=E[:, 1, 0].copy(),
        v_v=E[:, 1, 1].copy(),
        q_0=E[:, 0, 2] - E[:, 0, 3] / dt,
        q_1=E[:, 0, 3] / dt,
        v_0=E[:, 1, 2] - E[:, 1, 3] / dt,
        v_1=E[:, 1, 3] / dt,
        q_p=E[:, 0, 2].copy(),
        v_p=E[:, 1, 2].copy(),
        moment=_moment(work, E),
        loss=_upper(loss),
    )


def stacked(steps: list[Propagator]) -> Propagator:
    """Several steps in one, every array with a leading axis."""
    fields = zip(*steps, strict=True)
    return Propagator(*(np.stack([np.asarray(value) for value in values]) for values in fields))


def _step_matrices(k: Floats, c: Floats, dt: float) -> tuple[Floats, Floats, Floats]:
    """(m, 4, 4) exponential and the two Gramians, by Taylor series and doubling.

    Doubling X(2 tau) = X(tau) + E^T X E adds positive terms only; the usual block exponential would
    overflow for strongly damped modes.
    """
    m = len(k)
    scale = np.maximum(np.sqrt(k), 1.0 / dt)  # v is carried as v / scale, which balances A
    A = np.zeros((m, 4, 4))
    A[:, 0, 1] = scale
    A[:, 1, 0] = -k / scale
    A[:, 1, 1] = -c
    A[:, 1, 2] = 1.0 / scale
    A[:, 2, 3] = 1.0
    norm = np.abs(A).sum(axis=2).max(initial=1.0) * dt
    doublings = max(0, int(np.ceil(np.log2(norm / _NORM))))
    tau = dt / 2.0**doublings
    Q = np.zeros((2, m, 4, 4))
    Q[0, :, 1, 2] = Q[0, :, 2, 1] = 0.5 * scale
    Q[1, :, 1, 1] = c * scale**2
    X = np.zeros((2, m, 4, 4))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    *parts, E = _exponentials(A * tau, np.append(0.5 * (nodes + 1.0), 1.0))
    for part, weight in zip(parts, weights, strict=True):
        X += 0.5 * tau * weight * (part.transpose(0, 2, 1) @ Q @ part)
    for _ in range(doublings):
        X = X + E.transpose(0, 2, 1) @ X @ E
        E = E @ E
    unscale = np.ones((m, 4))
    unscale[:, 1] = 1.0 / scale
    E = E * unscale[:, None, :] / unscale[:, :, None]
    X = X * unscale[:, None, :] * unscale[:, :, None]
    return E, X[0], X[1]


def _exponentials(A: Floats, shares: Floats) -> Floats:
    """exp(share A) for every share, (shares, *A.shape), from one Taylor series."""
    terms = np.empty((_TAYLOR, *A.shape))
    terms[0] = np.eye(A.shape[-1])
    for order in range(1, _TAYLOR):
        terms[order] = terms[order - 1] @ A / order
    powers = shares[:, None] ** np.arange(_TAYLOR)
    return np.asarray((powers @ terms.reshape(_TAYLOR, -1)).reshape(len(shares), *A.shape))


def _moment(X: Floats, E: Floats) -> Floats:
    """(4, m) linear form of int s v ds, from the terms with f' in the form of int v f dt."""
    return np.stack([2.0 * X[:, 0, 3], 2.0 * X[:, 1, 3], 2.0 * X[:, 2, 3] - E[:, 0, 3], X[:, 3, 3]])


def _upper(X: Floats) -> Floats:
    """(10, m) coefficients of the quadratic form, off-diagonal pairs added up."""
    return np.stack([X[:, a, b] * (1.0 if a == b else 2.0) for a, b in _PAIRS])
