"""The gap-space problem with friction where sweeps do not contract: Newton, and slower ways where it fails.

Sweeps solve each gap exactly for the forces of the others (`single_contact`), and at last the solution is
followed from no friction, where it is unique, to all of it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from romdam.contact.problem import GapMemory, Limits
from romdam.contact.solvers.newton import add_row, natural_residual, newton, response
from romdam.contact.solvers.single_contact import solve_gap
from romdam.core.arrays import Floats
from romdam.core.jit import copy, njit

_EXACT_SWEEPS = 200
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


@njit(cache=True, inline="always")
def continue_from_no_friction(
    W: Floats,
    limits: Limits,
    memory: GapMemory,
    y_free: Floats,
    y: Floats,
    control: tuple[float, NDArray[np.bool_]],
) -> float:
    """Newton, then exact sweeps, and where both fail by shares of the friction up to all; residual reached.

    Newton alone where the solver is told to be hasty.

    Parameters
    ----------
    y : response of memory.force, where all starts [m]
    control : (tolerance, closed): closed is not empty where a step that Newton does not solve is
        to be given up
    """
    tolerance, kept = control
    solved, share, step, hasty = 0.0, 1.0, 2.0 * _FIRST_SHARE, memory.solver.sweeps.counts.hasty
    force = np.zeros(len(y))
    while True:
        eased = Limits(cohesion=limits.cohesion, mu=share * limits.mu, tension=limits.tension)
        residual = newton(W, eased, memory, y_free, y, tolerance)
        if not residual <= tolerance and not hasty:
            residual = exact_sweeps(W, eased, memory, y_free, y, tolerance)
        good = residual <= tolerance
        if (good and share == 1.0) or len(kept) or hasty:
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
