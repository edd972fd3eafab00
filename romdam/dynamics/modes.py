"""What the march does with the modes: the products with them, for one run or many, and their motion.

A lone run's products are matrix times vector and wait for memory; those of many runs are one product of
matrices, several times as fast for each. Directions without force are skipped in the former, runs without
in both.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from romdam.dynamics.arrays import Ints, ModalModel, ModalState, Work
from romdam.dynamics.propagator import Propagator

Floats = NDArray[np.float64]

_FEW = 3  # runs up to which products with vectors are quicker


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _dot_rows(A: Floats, x: Floats, y: Floats) -> None:
    """y += A x."""
    for r in range(len(y)):
        row, total = A[r], 0.0
        for j in range(len(x)):
            total += row[j] * x[j]
        y[r] += total


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def add_rows(A: Floats, p: Floats, scale: float, out: Floats) -> None:
    """out += scale A^T p, skipping unloaded directions."""
    for i in range(len(p)):
        f = scale * p[i]
        if f != 0.0:
            row = A[i]
            for j in range(len(out)):
                out[j] += row[j] * f


@njit(cache=True)
def _together(
    left: Floats, right: Floats, rows: Ints, columns: tuple[int, int], x: Floats, out: Floats
) -> Floats:
    """x[rows, columns] right, as one product of matrices."""
    first, last = columns
    A = left[: len(rows) * (last - first)].reshape(len(rows), last - first)
    C = out[: len(rows) * right.shape[1]].reshape(len(rows), right.shape[1])
    for a in range(len(rows)):
        A[a] = x[rows[a], first:last]
    return np.dot(A, right, C)


@njit(cache=True)
def gap_jumps(model: ModalModel, rows: Ints, q: Floats, w: Floats, work: Work) -> None:
    """w = G q of some runs, block by block."""
    for a in range(len(rows)):
        w[rows[a]] = 0.0
    for t in range(len(model.tiles)):
        r0, r1, c0, c1, start = model.tiles[t]
        G = model.values[start : start + (r1 - r0) * (c1 - c0)].reshape(r1 - r0, c1 - c0)
        if len(rows) <= _FEW:
            for a in range(len(rows)):
                _dot_rows(G, q[rows[a], c0:c1], w[rows[a], r0:r1])
            continue
        product = _together(work.left, G.T, rows, (c0, c1), q, work.out)
        for a in range(len(rows)):
            w[rows[a], r0:r1] += product[a]


@njit(cache=True)
def modal_forces(model: ModalModel, rows: Ints, p: Floats, r: Floats, work: Work) -> None:
    """r = G^T p of some runs, block by block."""
    for a in range(len(rows)):
        r[rows[a]] = 0.0
    for t in range(len(model.tiles)):
        r0, r1, c0, c1, start = model.tiles[t]
        G = model.values[start : start + (r1 - r0) * (c1 - c0)].reshape(r1 - r0, c1 - c0)
        if len(rows) <= _FEW:
            for a in range(len(rows)):
                add_rows(G, p[rows[a], r0:r1], 1.0, r[rows[a], c0:c1])
            continue
        product = _together(work.left, G, rows, (r0, r1), p, work.out)
        for a in range(len(rows)):
            r[rows[a], c0:c1] += product[a]


@njit(cache=True)
def residual_jumps(R: Floats, rows: Ints, p: Floats, goal: Floats, work: Work) -> None:
    """goal = R p of some runs: what the modes that are no states tend to."""
    if len(rows) <= _FEW:
        for a in range(len(rows)):
            goal[rows[a]] = 0.0
            add_rows(R, p[rows[a]], 1.0, goal[rows[a]])
        return
    product = _together(work.left, R, rows, (0, len(R)), p, work.out)
    for a in range(len(rows)):
        goal[rows[a]] = product[a]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def external_force(model: ModalModel, acc: Floats, f: Floats) -> None:
    """External modal force at one instant."""
    f[:] = model.static
    for a in range(len(acc)):
        for j in range(len(f)):
            f[j] += model.load[a, j] * acc[a]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def free_motion(step: Propagator, state: ModalState, f_1: Floats, q_free: Floats) -> None:
    """Displacement at the step's end without joint force."""
    for j in range(len(q_free)):
        q_free[j] = (
            step.q_q[j] * state.q[j]
            + step.q_v[j] * state.v[j]
            + step.q_0[j] * state.f[j]
            + step.q_1[j] * f_1[j]
        )


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def advance(
    step: Propagator, state: ModalState, force: tuple[Floats, Floats], q_free: Floats
) -> tuple[float, float, float]:
    """Move the modes to the step's end; work of external and joint force, and damping loss, in the step.

    Parameters
    ----------
    force : (m,) external force at the step's end, and joint force over the step
    q_free : (m,) displacement at the step's end without joint force
    """
    work, joint, loss = 0.0, 0.0, 0.0
    rate = 1.0 / step.dt
    moment, D = step.moment, step.loss
    for j in range(len(state.q)):
        q, v, f, f_1, r = state.q[j], state.v[j], state.f[j], force[0][j], force[1][j]
        F, s = f + r, (f_1 - f) * rate
        q_1 = q_free[j] + step.q_p[j] * r
        v_1 = step.v_q[j] * q + step.v_v[j] * v + step.v_0[j] * f + step.v_1[j] * f_1 + step.v_p[j] * r
        work += f * (q_1 - q) + s * (
            moment[0, j] * q + moment[1, j] * v + moment[2, j] * F + moment[3, j] * s
        )
        joint += r * (q_1 - q)
        loss += q * (D[0, j] * q + D[1, j] * v + D[2, j] * F + D[3, j] * s)
        loss += v * (D[4, j] * v + D[5, j] * F + D[6, j] * s)
        loss += F * (D[7, j] * F + D[8, j] * s) + D[9, j] * s * s
        state.q[j], state.v[j], state.f[j] = q_1, v_1, f_1
    return work, joint, loss


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def relax(model: ModalModel, state: ModalState, decay: float, p: Floats, goal: Floats) -> tuple[float, float]:
    """Relax the residual flexibility towards a joint force; the force's work on it, and what it loses.

    Parameters
    ----------
    decay : exp(-step / tau)
    p, goal : (N,) joint force at the step's end, and R p
    """
    s, u_r, N = state.s, state.u_r, len(p)
    work, loss, size = 0.0, 0.0, 0.0
    for i in range(N):
        new = decay * u_r[i] + (1.0 - decay) * goal[i]
        if model.conserving:
            work += 0.5 * (p[i] * new - s[i] * u_r[i])
        else:
            work += p[i] * (new - u_r[i])
            loss += 0.5 * (1.0 - decay * decay) * (p[i] - s[i]) * (goal[i] - u_r[i])
        u_r[i] = new
    for i in range(N):
        s[i] = decay * s[i] + (1.0 - decay) * p[i]
        size = max(size, abs(s[i]))
    if size < 1e-30:
        s[:] = 0.0
        u_r[:] = 0.0
    return work, loss
