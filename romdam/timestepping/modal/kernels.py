"""The products of the time loop, and the motion of the modes over a step.

A step multiplies by the jumps of the modes twice: w = G q gives the jumps of the gaps, and r = G^T p the
forces on the modes. G consists of dense blocks, one for each joint and block of the scene. Its rows are taken
in bands, and each band serves all runs before the next one is read, so the matrix passes through memory once
for all of them. Every run gets the same sums as it gets alone, bit for bit. Rows without force are skipped.
BLAS is not used, because it would pack the matrices anew at every step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from romdam.core.arrays import PLACE, Floats
from romdam.core.jit import ARRAYS, VIEWS, copy, njit
from romdam.timestepping.modal.arrays import Ints, ModalModel, ModalState
from romdam.timestepping.modal.propagator import (
    DISP,
    FF,
    FORCE,
    FR,
    QF,
    QQ,
    QR,
    QV,
    RATE,
    RR,
    VEL,
    VF,
    VR,
    VV,
    Propagator,
)

_FOUR = 4  # rows at a time: as many sums as keep the processor busy
_BAND = 16  # rows that stay in the first cache while all runs take them
_1, _2, _3, _4 = PLACE(1), PLACE(2), PLACE(3), PLACE(_FOUR)
_NOTHING = 1e-30  # [N] of relaxed force: digits below it would become subnormal, which is slow
_SUMS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "contract", "nsz"}}


class Rows(NamedTuple):
    """Some rows of a matrix, within the values of all its blocks.

    Attributes
    ----------
    first : index of the first value
    number, length : how many they are, and their values
    row, column : of the first value in the matrix
    """

    first: np.uint64
    number: np.uint64
    length: np.uint64
    row: np.uint64
    column: np.uint64


@njit(cache=True, forceinline=True, **_SUMS)
def _dot_rows(A: Floats, rows: Rows, x: Floats, y: Floats) -> None:
    """y += A x."""
    a, n, x_0, y_0 = rows.first, rows.length, rows.column, rows.row
    fours = rows.number // _4
    for _ in range(fours):
        b, c, d = a + n, a + _2 * n, a + _3 * n
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
        for j in range(n):
            s0 += A[a + j] * x[x_0 + j]
            s1 += A[b + j] * x[x_0 + j]
            s2 += A[c + j] * x[x_0 + j]
            s3 += A[d + j] * x[x_0 + j]
        y[y_0] += s0
        y[y_0 + _1] += s1
        y[y_0 + _2] += s2
        y[y_0 + _3] += s3
        a, y_0 = a + _4 * n, y_0 + _4
    for r in range(rows.number - _4 * fours):
        total = 0.0
        for j in range(n):
            total += A[a + r * n + j] * x[x_0 + j]
        y[y_0 + r] += total


@njit(cache=True, forceinline=True, **_SUMS)
def _add_rows(A: Floats, rows: Rows, p: Floats, y: Floats) -> None:
    """y += A^T p, rows without force left out."""
    a, n, p_0, y_0 = rows.first, rows.length, rows.row, rows.column
    fours = rows.number // _4
    for _ in range(fours):
        f0, f1, f2, f3 = p[p_0], p[p_0 + _1], p[p_0 + _2], p[p_0 + _3]
        if f0 != 0.0 or f1 != 0.0 or f2 != 0.0 or f3 != 0.0:
            b, c, d = a + n, a + _2 * n, a + _3 * n
            for j in range(n):
                y[y_0 + j] += f0 * A[a + j] + f1 * A[b + j] + f2 * A[c + j] + f3 * A[d + j]
        a, p_0 = a + _4 * n, p_0 + _4
    for r in range(rows.number - _4 * fours):
        f = p[p_0 + r]
        if f != 0.0:
            for j in range(n):
                y[y_0 + j] += A[a + r * n + j] * f


@njit(**VIEWS)
def gap_jumps(tiles: Ints, values: Floats, runs: Ints, q: Floats, w: Floats) -> None:
    """w = G q of some runs, block by block."""
    for a in range(len(runs)):
        w[runs[a]] = 0.0
    for t in range(len(tiles)):
        r0, r1, c0, c1, start = tiles[t]
        for r in range(r0, r1, _BAND):
            band = _band(r, r1, (c0, c1), start + (r - r0) * (c1 - c0))
            for a in range(len(runs)):
                _dot_rows(values, band, q[runs[a]], w[runs[a]])


@njit(**VIEWS)
def modal_forces(tiles: Ints, values: Floats, runs: Ints, p: Floats, r: Floats) -> None:
    """r = G^T p of some runs, block by block."""
    for a in range(len(runs)):
        r[runs[a]] = 0.0
    for t in range(len(tiles)):
        r0, r1, c0, c1, start = tiles[t]
        for i in range(r0, r1, _BAND):
            band = _band(i, r1, (c0, c1), start + (i - r0) * (c1 - c0))
            for a in range(len(runs)):
                _add_rows(values, band, p[runs[a]], r[runs[a]])


@njit(**VIEWS)
def residual_jumps(R: Floats, runs: Ints, p: Floats, goal: Floats) -> None:
    """goal = R p of some runs, R symmetric: what the modes that are no states tend to."""
    for a in range(len(runs)):
        goal[runs[a]] = 0.0
    values, N = R.reshape(R.size), len(R)
    for i in range(0, N, _BAND):
        band = _band(i, N, (0, N), i * N)
        for a in range(len(runs)):
            _add_rows(values, band, p[runs[a]], goal[runs[a]])


@njit(cache=True, forceinline=True)
def add_rows(A: Floats, p: Floats, y: Floats) -> None:
    """y += A^T p, rows without force left out."""
    values, (rows, n) = A.reshape(A.size), A.shape
    for i in range(0, rows, _BAND):
        _add_rows(values, _band(i, rows, (0, n), i * n), p, y)


@njit(cache=True, forceinline=True)
def _band(row: int, end: int, columns: tuple[int, int], first: int) -> Rows:
    """Rows before `end` that all runs take before the next ones; their values begin at `first`."""
    (begin, stop), number = columns, min(_BAND, end - row)
    return Rows(PLACE(first), PLACE(number), PLACE(stop - begin), PLACE(row), PLACE(begin))


@njit(cache=True, **_SUMS)
def external_force(model: ModalModel, acc: Floats, f: Floats) -> None:
    """External modal force at one instant."""
    copy(model.static, f)
    for a in range(len(acc)):
        for j in range(len(f)):
            f[j] += model.load[a, j] * acc[a]


@njit(cache=True)
def added_jumps(model: ModalModel, sample: int, acc: Floats, jump: Floats) -> None:
    """Jumps at one base step, but for those that moving supports make; none where `jump` is empty.

    Parameters
    ----------
    acc : (components,) ground acceleration at that step [m/s2]
    """
    for i in range(len(jump)):
        jump[i] = model.shift[sample, i] if len(model.shift) else 0.0
        for a in range(len(model.ground_jump)):
            jump[i] += model.ground_jump[a, i] * acc[a]


@njit(cache=True)
def add_carried(carried: Floats, motion: Floats, first: int, share: float, dt: float, jump: Floats) -> None:
    """Add the jumps that moving supports make within a base step, exactly for linear acceleration.

    Parameters
    ----------
    carried : (N, m), or (0, 0) where no support moves by itself
    motion : (3 m, samples) acceleration, velocity and displacement of the supports
    first : sample at which the base step begins
    share : how far into it, from 0 to 1
    dt : its length [s]
    """
    t, m = share * dt, carried.shape[1]
    for k in range(m):
        start, change = motion[k, first], motion[k, first + 1] - motion[k, first]
        acc = 0.5 * start + share * change / 6.0
        disp = motion[2 * m + k, first] + t * (motion[m + k, first] + t * acc)
        for i in range(len(jump)):
            jump[i] += carried[i, k] * disp


@njit(cache=True, **_SUMS, forceinline=True)
def free_motion(step: Propagator, state: ModalState, f_1: Floats, q_free: Floats) -> None:
    """Displacement at the step's end without joint force."""
    q, v = state.recorded.q, state.recorded.v
    for j in range(len(q_free)):
        q_free[j] = step.q_q[j] * q[j] + step.q_v[j] * v[j] + step.q_0[j] * state.f[j] + step.q_1[j] * f_1[j]


@njit(cache=True, **_SUMS, forceinline=True)
def advance(
    step: Propagator, state: ModalState, f_1: Floats, r: Floats, q_free: Floats
) -> tuple[float, float, float]:
    """Move the modes to the step's end; work of external and joint force, and damping loss, in the step.

    A loop writes one array at most and reads few: beyond that the compiler, which has to check that they do
    not overlap, gives up on vector instructions.

    Parameters
    ----------
    f_1 : (m,) external force at the step's end
    r : (m,) joint force over the step
    q_free : (m,) displacement at the step's end without joint force
    """
    m = len(q_free)
    q, v, f = state.recorded.q, state.recorded.v, state.f
    work, joint, loss = 0.0, 0.0, 0.0
    rate, A, D, q_p = 1.0 / step.dt, step.moment, step.loss, step.q_p
    for j in range(m):
        s, moved = (f_1[j] - f[j]) * rate, q_free[j] + q_p[j] * r[j] - q[j]
        F = f[j] + r[j]
        work += f[j] * moved + s * (A[DISP, j] * q[j] + A[VEL, j] * v[j] + A[FORCE, j] * F + A[RATE, j] * s)
        joint += r[j] * moved
        loss += q[j] * (D[QQ, j] * q[j] + D[QV, j] * v[j] + D[QF, j] * F + D[QR, j] * s)
        loss += v[j] * (D[VV, j] * v[j] + D[VF, j] * F + D[VR, j] * s)
        loss += F * (D[FF, j] * F + D[FR, j] * s) + D[RR, j] * s * s
    for j in range(m):
        v[j] = step.v_q[j] * q[j] + step.v_v[j] * v[j] + step.v_0[j] * f[j]
    for j in range(m):
        v[j] += step.v_1[j] * f_1[j] + step.v_p[j] * r[j]
    for j in range(m):
        q[j] = q_free[j] + q_p[j] * r[j]
    for j in range(m):
        f[j] = f_1[j]
    return work, joint, loss


@njit(**ARRAYS, **_SUMS, forceinline=True)
def relax(model: ModalModel, state: ModalState, decay: float, goal: Floats) -> tuple[float, float]:
    """Relax the residual flexibility towards a joint force; the force's work on it, and what it loses.

    Parameters
    ----------
    decay : exp(-step / tau)
    goal : (N,) R p, p the joint force of the step
    """
    s, u_r, N = state.recorded.s, state.u_r, len(goal)
    conserving = model.conserving is not None
    p = state.recorded.gaps.traction.ravel() if conserving else state.mean
    work, loss = 0.0, 0.0
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
    for i in range(N):
        if not abs(s[i]) < _NOTHING:
            return work, loss
    s[:] = 0.0
    u_r[:] = 0.0
    return work, loss
