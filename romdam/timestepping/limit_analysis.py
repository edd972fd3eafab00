"""Limit analysis on rigid motions: tell whether joints can hold blocks that nothing else holds.

At rest the forces of the gaps balance the loads in every rigid motion R of what floats, R^T (f + B^T p) = 0,
with p_n >= 0 and |t| <= c + mu p_n. Where no p does that, whatever it would strain, there is no equilibrium.
The disc is a polygon around it, so that nothing is refused that might rest.

References
----------
Livesley, Int. J. Numer. Meth. Engng 12 (1978) 1853: limit analysis of structures formed from rigid blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, hstack, vstack

from romdam.contact.components import ALONG_J, ALONG_K
from romdam.contact.problem import GapProblem, Limits, gap_memory
from romdam.contact.softening import put_limits
from romdam.core.arrays import Floats
from romdam.core.motion import Motion
from romdam.core.system import System
from romdam.linalg.factor import Factor

_SIDES = 32  # of the polygon: 0.5 % more than the disc
_RIGID = 1e-12  # of the largest stiffness: a mode below it is a rigid motion
_UPRIGHT = 1e-9  # of a side of the polygon along an axis: round-off of its cosine
_BALANCED = 1e-6  # of the loads, what may be left
_STILL = 1e-3  # of the largest motion: a part that moves less stands still
_HELD_BY_MASS = 10.0  # [1/s2] of M in K + s M, so that it can be factored: 0.5 Hz
_STRAINED = 1e-6  # share of strain energy in that of K + s M, from which on a motion is none of a rigid part
_RIGID_MOTIONS, _ROUNDS = 6, 4  # of a part in one piece; iterations, of which each gains 1e-4 at least
_MOST, _HALVINGS = 8.0, 10  # times the strength that is tried, and how often that range is halved


@dataclass(frozen=True)
class Collapse:
    """Why loads on what floats cannot be balanced.

    Attributes
    ----------
    kind : "slides", where more shear strength would do; "lifts off", where the resultant leaves the joints
        without compression; "overturns", where its moment does
    strength : least factor on the shear strength that would do; inf for more than `_MOST`, or none
    parts : that move, by name
    """

    kind: Literal["slides", "lifts off", "overturns"]
    strength: float
    parts: tuple[str, ...]


def find_collapse(system: System, problem: GapProblem, history: Floats | None = None) -> Collapse | None:
    """Find how what floats moves away under its loads; None where the joints might hold it.

    Parameters
    ----------
    history : (L, n, s) what the joints' laws remember, such as bonds that are broken; None of unloaded gaps
    """
    if problem.tension.any() or system.gyroscopic or not system.floating:
        return None
    R, names = _rigid_motions(system)
    motions, loads = np.asarray(R.T @ system.B.T.toarray()), np.asarray(R.T @ system.force)
    memory = gap_memory(problem)
    if history is not None and history.size:
        memory.trial[:] = memory.history[:] = history
    put_limits(problem, memory)
    limits = memory.limits
    moving = _mechanism(motions, loads, limits, 1.0)
    if moving is None:
        return None
    size = {name: np.abs(moving[names == name]).max(initial=0.0) for name in system.parts}
    parts = tuple(name for name, moves in size.items() if moves > _STILL * max(size.values()))
    if motions.shape[1] == len(limits.tension):  # frictionless: no normal force of either sign balances it
        left = loads - motions @ np.linalg.lstsq(motions, loads, rcond=None)[0]
        slides = bool(np.abs(left).max() > _BALANCED * np.abs(loads).max())
    else:
        stuck = limits._replace(cohesion=np.full_like(limits.cohesion, np.inf))
        slides = _mechanism(motions, loads, stuck, 1.0) is None
        limits = limits if slides else stuck
    if slides:
        if _mechanism(motions, loads, limits, _MOST) is not None:
            return Collapse("slides", np.inf, parts)
        low, high = 1.0, _MOST
        for _ in range(_HALVINGS):  # of the factor on the shear strength that would do
            middle = float(np.sqrt(low * high))
            holds = _mechanism(motions, loads, limits, middle) is None
            low, high = (low, middle) if holds else (middle, high)
        return Collapse("slides", high, parts)
    shifts = np.asarray(R.T @ system.load)[:, system.motions[Motion.BASE]]
    shifts = np.hstack([np.where((names == name)[:, None], shifts, 0.0) for name in system.parts])
    held = _mechanism(shifts.T @ motions, shifts.T @ loads, limits, 1.0) is None
    return Collapse("overturns" if held else "lifts off", np.inf, parts)


def _rigid_motions(system: System) -> tuple[csr_matrix, NDArray[np.str_]]:
    """Motions without strain, joints open, (n, r), and the part that each belongs to, (r,)."""
    columns, names = [csr_matrix((system.size, 0))], list[str]()
    k, mass = system.K.diagonal(), system.M.diagonal()
    for name, part in system.parts.items():
        size = part.stop - part.start
        if system.diagonal:
            rigid = (k[part] <= _RIGID * k.max(initial=0.0)) & (mass[part] > 0.0)
            motions = np.eye(size)[:, rigid]
        elif size == 0 or not mass[part].any():
            motions = np.zeros((size, 0))
        else:  # by inverse iteration of a block
            K, M = csr_matrix(system.K[part, part]), csr_matrix(system.M[part, part])
            shifted = csr_matrix(K + _HELD_BY_MASS * M)
            factor = Factor(shifted)
            X = np.random.default_rng(0).standard_normal((size, min(2 * _RIGID_MOTIONS, size)))
            for _ in range(_ROUNDS):
                X = np.linalg.qr(factor.solve(M @ X))[0]
            share, V = eigh(X.T @ (K @ X), X.T @ (shifted @ X))
            motions = np.asarray(X @ V[:, share < _STRAINED])
        columns.append(csr_matrix(np.pad(motions, ((part.start, system.size - part.stop), (0, 0)))))
        names += [name] * motions.shape[1]
    return csr_matrix(hstack(columns)), np.array(names, dtype=np.str_)


def _mechanism(motions: Floats, loads: Floats, limits: Limits, factor: float) -> Floats | None:
    """Motion in which loads win; None where gaps of so many times their shear strength balance them.

    Parameters
    ----------
    motions : (r, N) jumps of the gaps in every motion
    loads : (r,) on the motions
    """
    from scipy.optimize import linprog  # here: few scenes come to it, and it loads 90 modules

    n = len(limits.tension)
    d = motions.shape[1] // n
    size, left = np.abs(loads).max(initial=0.0), np.full((len(loads), 1), -1.0)
    if size == 0.0:
        return None
    pulled = motions[:, ::d] @ limits.tension  # forces are counted from the bonds' tension
    rest = (loads - pulled) / size
    A = csr_matrix(np.vstack([np.hstack([motions, left]), np.hstack([-motions, left])]))
    b, bounds = np.concatenate([-rest, rest]), [(0.0, None), *[(None, None)] * (d - 1)] * n + [(0.0, None)]
    if d == 3:  # n . t <= factor (c + mu p_n) for every side's normal n
        mu, cohesion = limits.mu, limits.cohesion
        disc = (mu[:, ALONG_J] == mu[:, ALONG_K]) & (cohesion[:, ALONG_J] == cohesion[:, ALONG_K])
        numbers, coefficients, most = list[NDArray[np.int64]](), list[Floats](), list[Floats]()
        for side in range(_SIDES):
            angle = 2.0 * np.pi * side / _SIDES
            normal = np.array([np.cos(angle), np.sin(angle)])
            a = int(abs(normal[ALONG_K]) > abs(normal[ALONG_J]))
            bounded = (disc | (np.abs(normal).max() > 1.0 - _UPRIGHT)) & np.isfinite(cohesion[:, a])
            gaps = np.flatnonzero(bounded)
            numbers.append(gaps)
            coefficients.append(np.column_stack([-factor * mu[gaps, a], np.tile(normal, (len(gaps), 1))]))
            most.append(factor * cohesion[gaps, a] / size)
        gaps, values = np.concatenate(numbers), np.concatenate(coefficients)
        columns = 3 * gaps[:, None] + np.arange(3)
        rows = np.repeat(np.arange(len(gaps)), 3)
        cone = csr_matrix((values.ravel(), (rows, columns.ravel())), shape=(len(gaps), 3 * n + 1))
        A, b = vstack([A, cone], format="csr"), np.concatenate([b, *most])
    cost = np.append(np.zeros(d * n), 1.0)
    optimum = linprog(cost, A_ub=A, b_ub=b, bounds=bounds, method="highs")
    if not optimum.success or optimum.fun <= _BALANCED:
        return None
    below, above = optimum.ineqlin.marginals[: 2 * len(loads)].reshape(2, -1)
    return np.asarray(below - above)
