"""A step that conserves energy: the joint force acts with the mean that does the work the gaps store.

A constant joint force does the work p . dw over a step. In general that is not the change of the energy
stored in the springs of the gaps and in the residual flexibility, so energy is lost or gained wherever
contact changes. Here the force is the mean of its values at both ends of the step, plus a multiple of the
change of the jump that makes the two energies equal (a discrete gradient). The multiple depends on the
solution of the step, so it is iterated. While the closed set stands still and nothing slides, it is zero.
"""

from __future__ import annotations

import numpy as np

from romdam.contact.problem import GapMemory, GapProblem
from romdam.contact.step import solve_gaps
from romdam.core.arrays import Floats
from romdam.core.jit import ARRAYS, njit
from romdam.timestepping.modal.arrays import ModalModel, ModalState
from romdam.timestepping.modal.kernels import add_rows

_MEAN_ITERATIONS = 50  # of the discrete gradient in a step that changes the closed set or slides
_REST = 1e-12  # relative change of its force that counts as rest


@njit(cache=True)
def _elastic(model: ModalModel, problem: GapProblem, p_c: Floats, p: Floats, g: Floats) -> float:
    """Energy of the residual flexibility and of the gaps' springs."""
    d = len(p) // max(len(problem.gap), 1)
    energy = 0.0
    for i in range(len(p)):
        energy += 0.5 * problem.compliance[i] * p_c[i] ** 2
        if len(model.R) and p[i] != 0.0:
            row = model.R[i]
            for j in range(len(p)):
                energy += 0.5 * p[i] * row[j] * p[j]
    for i in range(len(problem.gap)):
        energy += 0.5 * problem.tension[i] * g[d * i] ** 2
    return energy


@njit(**ARRAYS)
def try_conserving(
    conserving: bool | None,
    model: ModalModel,
    half: Floats,
    problem: GapProblem,
    memory: GapMemory,
    state: ModalState,
    w_free: Floats,
    shift: Floats,
    y: Floats,
    tolerance: float,
    steady: bool,
) -> float:
    """Solve a step in which the joint force acts with a mean that does the work the gaps store.

    The mean is (p_0 + p_1) / 2, which is exact while the closed set stands still, and a multiple of the
    change of the states' jump on the loaded gaps where it does not (a discrete gradient).

    Parameters
    ----------
    half : (N, N) half the states' flexibility over a step [m/N]
    w_free : (N,) free jumps of the states [m]
    shift : (N,) or (0,) what is added to them [m]
    y : (N,) receives the solution [m]
    tolerance, steady : see `romdam.contact.step.solve_gaps`

    Returns
    -------
    float, the relative residual of the gap-space problem; above the tolerance means no convergence
    """
    if conserving is None:
        return np.inf
    ends = state.recorded.gaps
    p_0 = ends.traction.ravel()
    d = len(p_0) // max(len(problem.gap), 1)
    before = _elastic(model, problem, memory.force, p_0, ends.jump.ravel())
    correction, p_1, g_1 = np.zeros_like(p_0), np.zeros_like(p_0), np.zeros_like(p_0)
    old_force = memory.force.copy()
    residual, w_1 = 0.0, w_free.copy()
    for _ in range(_MEAN_ITERATIONS):
        w = w_free.copy()
        w[: len(shift)] += shift
        add_rows(half, p_0 + 2.0 * correction, w)
        memory.force[:] = old_force
        residual = solve_gaps(problem, memory, state.closed, w, y, tolerance, steady)
        if not residual <= tolerance:
            return residual
        changed = False
        for i in range(len(p_1)):  # whole joint force and opening at the step's end
            g_1[i] = y[i] - problem.compliance[i] * memory.force[i]
            p_1[i] = memory.force[i]
            if i % d == 0:
                p_1[i] -= problem.tension[i // d] * g_1[i]
                changed = changed or (memory.force[i] > 0.0) != state.closed[i // d]
        slid = 0.0  # energy that sliding takes, which never is negative [J]
        for i in range(len(memory.accumulated_slip)):
            for a in range(3 * i + 1, 3 * i + 3):
                slid -= memory.force[a] * y[a]
        state.mean[:] = 0.5 * (p_0 + p_1) + correction
        w_1[:] = w_free
        add_rows(half, 2.0 * state.mean, w_1)
        if not changed and slid == 0.0:
            break
        moved = (w_1 - state.w) * ((p_0 != 0.0) | (p_1 != 0.0))
        missing = _elastic(model, problem, memory.force, p_1, g_1) - before + slid
        missing += (0.5 * (p_0 + p_1)) @ moved
        size = moved @ moved
        new = -(missing / size) * moved if size > 0.0 else np.zeros(len(moved))
        if np.abs(new - correction).max() <= _REST * np.abs(state.mean).max():
            break
        correction = new
    state.w[:] = w_1
    return residual
