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
from romdam.jit import ARRAYS, copy
from romdam.joints.newton import add_product

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
def _add(source: Floats, target: Floats) -> None:
    """target += source."""
    for i in range(len(target)):
        target[i] += source[i]


@njit(cache=True)
def _together(
    left: Floats, right: Floats, rows: Ints, columns: tuple[int, int], x: Floats, out: Floats
) -> Floats:
    """x[rows, columns] right, as one product of matrices."""
    first, last = columns
    A = left[: len(rows) * (last - first)].reshape(len(rows), last - first)
    C = out[: len(rows) * right.shape[1]].reshape(len(rows), right.shape[1])
    for a in range(len(rows)):
        copy(x[rows[a], first:last], A[a])
    return np.dot(A, right, C)


@njit(**ARRAYS)
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
            _add(product[a], w[rows[a], r0:r1])


@njit(**ARRAYS)
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
            _add(product[a], r[rows[a], c0:c1])


@njit(**ARRAYS)
def residual_jumps(R: Floats, rows: Ints, p: Floats, goal: Floats, work: Work) -> None:
    """goal = R p of some runs: what the modes that are no states tend to."""
    if len(rows) <= _FEW:
        for a in range(len(rows)):
            goal[rows[a]] = 0.0
            add_product(R, p[rows[a]], goal[rows[a]])
        return
    product = _together(work.left, R, rows, (0, len(R)), p, work.out)
    for a in range(len(rows)):
        copy(product[a], goal[rows[a]])


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def external_force(model: ModalModel, acc: Floats, f: Floats) -> None:
    """External modal force at one instant."""
    copy(model.static, f)
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

    A loop writes one array at most and reads few: beyond that the compiler, which has to check that they do
    not overlap, gives up on vector instructions (2.3 -> 1.3 us for 174 modes).

    Parameters
    ----------
    force : (m,) external force at the step's end, and joint force over the step
    q_free : (m,) displacement at the step's end without joint force
    """
    (f_1, r), m = force, len(q_free)
    q, v, f = state.q, state.v, state.f
    work, joint, loss = 0.0, 0.0, 0.0
    rate, A, D, q_p = 1.0 / step.dt, step.moment, step.loss, step.q_p
    for j in range(m):
        s, moved = (f_1[j] - f[j]) * rate, q_free[j] + q_p[j] * r[j] - q[j]
        F = f[j] + r[j]
        work += f[j] * moved + s * (A[0, j] * q[j] + A[1, j] * v[j] + A[2, j] * F + A[3, j] * s)
        joint += r[j] * moved
        loss += q[j] * (D[0, j] * q[j] + D[1, j] * v[j] + D[2, j] * F + D[3, j] * s)
        loss += v[j] * (D[4, j] * v[j] + D[5, j] * F + D[6, j] * s)
        loss += F * (D[7, j] * F + D[8, j] * s) + D[9, j] * s * s
    for j in range(m):
        v[j] = step.v_q[j] * q[j] + step.v_v[j] * v[j] + step.v_0[j] * f[j]
    for j in range(m):
        v[j] += step.v_1[j] * f_1[j] + step.v_p[j] * r[j]
    for j in range(m):
        q[j] = q_free[j] + q_p[j] * r[j]
    for j in range(m):
        f[j] = f_1[j]
    return work, joint, loss


@njit(**ARRAYS, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def relax(model: ModalModel, state: ModalState, decay: float, goal: Floats) -> tuple[float, float]:
    """Relax the residual flexibility towards a joint force; the force's work on it, and what it loses.

    Parameters
    ----------
    decay : exp(-step / tau)
    goal : (N,) R p, p the joint force of the step
    """
    s, u_r, N = state.s, state.u_r, len(goal)
    conserving = model.conserving is not None
    p = state.force.ravel() if conserving else state.mean
    work, loss, size = 0.0, 0.0, 0.0
    for i in range(N):
        new = decay * u_r[i] + (1.0 - decay) * goal[i]
        if conserving:
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
