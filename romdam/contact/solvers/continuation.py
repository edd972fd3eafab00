"""The gap-space problem with friction where Gauss-Seidel sweeps do not contract: Newton, then slower methods.

Newton's method usually solves such a step, but it may cycle among a few states, for example where two gaps
stick and slide in turn. Sweeps that solve each gap exactly while the forces of all others are held
(`single_contact`) contract slowly, but they leave such a cycle. So Newton and some of these sweeps alternate.
If that fails too, the solution is followed from the problem without friction, where it is unique, to the
problem with all of it, by raising the friction coefficient in steps.
"""

from __future__ import annotations

import math

import numpy as np

from romdam.contact.problem import GapMemory, Limits
from romdam.contact.solvers.newton import add_row, natural_residual, newton, response
from romdam.contact.solvers.single_contact import solve_gap
from romdam.core.arrays import Floats
from romdam.core.jit import copy, njit

_EXACT_SWEEPS = 16  # between two tries of Newton; 8 or more led out of every cycle that was seen
_TURNS = 13  # of both
_WINDOW = 4  # sweeps between two looks at the residual
_FIRST_SHARE, _LONGER, _LEAST_SHARE = 0.1, 1.5, 1e-4  # of the friction


@njit(cache=True)
def exact_sweeps(
    W: Floats, limits: Limits, memory: GapMemory, y_free: Floats, y: Floats, tolerance: float
) -> float:
    """Gauss-Seidel over all gaps, each solved exactly; natural residual reached."""
    p, residual = memory.force, np.inf
    new, rest = np.empty(3), np.empty(3)
    for k in range(len(p)):
        if not math.isfinite(p[k]):
            p[k] = 0.0
    response(W, p, y_free, y)
    for sweep in range(_EXACT_SWEEPS):
        for i in range(len(limits.mu)):
            b = 3 * i
            for r in range(3):
                new[r], rest[r] = p[b + r], y[b + r]
                for c in range(3):
                    rest[r] -= W[b + r, b + c] * p[b + c]
            if solve_gap(W[b : b + 3, b : b + 3], rest, limits.cohesion[i], limits.mu[i], new):
                for r in range(3):
                    add_row(W[b + r], new[r] - p[b + r], y)
                    p[b + r] = new[r]
        memory.solver.sweeps.counts.iterations += 1
        if sweep % _WINDOW == _WINDOW - 1:
            response(W, p, y_free, y)
            residual = natural_residual(W, limits, p, y)
            if residual <= tolerance or not math.isfinite(residual):
                break
    return residual


@njit(cache=True)
def newton_and_sweeps(
    W: Floats, limits: Limits, memory: GapMemory, y_free: Floats, y: Floats, tolerance: float
) -> float:
    """Newton and, while it fails, again from where exact sweeps lead; natural residual reached.

    Sweeps go on from the better of their last force and Newton's, so that they gain whatever Newton does.
    """
    p, swept, swept_residual = memory.force, memory.force.copy(), np.inf
    residual = newton(W, limits, memory, y_free, y, tolerance)
    for _ in range(_TURNS):
        if residual <= tolerance:
            break
        if not residual < swept_residual:
            copy(swept, p)
        swept_residual = exact_sweeps(W, limits, memory, y_free, y, tolerance)
        if swept_residual <= tolerance or not math.isfinite(swept_residual):
            return swept_residual
        copy(p, swept)
        residual = newton(W, limits, memory, y_free, y, tolerance)
    return residual


@njit(cache=True, inline="always")
def continue_from_no_friction(
    W: Floats, limits: Limits, memory: GapMemory, y_free: Floats, y: Floats, tolerance: float
) -> float:
    """Newton and exact sweeps, and where they fail by shares of the friction up to all; residual reached.

    Newton alone where the solver is told to be hasty.

    Parameters
    ----------
    y : response of memory.force, where all starts [m]
    """
    solved, share, step, hasty = 0.0, 1.0, 2.0 * _FIRST_SHARE, memory.solver.sweeps.counts.hasty
    force = np.zeros(len(y))
    while True:
        eased = Limits(cohesion=limits.cohesion, mu=share * limits.mu, tension=limits.tension)
        if hasty:
            return newton(W, eased, memory, y_free, y, tolerance)
        residual = newton_and_sweeps(W, eased, memory, y_free, y, tolerance)
        good = residual <= tolerance
        if good and share == 1.0:
            return residual
        if good:
            solved, step = share, _LONGER * step
            copy(memory.force, force)
        else:
            step *= 0.5
        if step < _LEAST_SHARE:
            return residual
        share = min(solved + step, 1.0)
        copy(force, memory.force)
        response(W, force, y_free, y)
