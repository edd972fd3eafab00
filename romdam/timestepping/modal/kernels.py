"""Products with the modes in the time loop, for one run or many, and the motion of the modes.

Four rows of a matrix are taken for all runs before the next four: they are read from memory once, and every
run gets the sums that it gets alone, bit for bit. Rows without force are skipped. (BLAS would pack the
matrices anew at every step.)
"""

from __future__ import annotations

from romdam.core.arrays import Floats
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


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _dot_rows(A: Floats, x: Floats, y: Floats) -> None:
    """y += A x, A of up to four rows."""
    if len(A) == _FOUR:
        a, b, c, d = A[0], A[1], A[2], A[3]
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
        for j in range(len(x)):
            s0 += a[j] * x[j]
            s1 += b[j] * x[j]
            s2 += c[j] * x[j]
            s3 += d[j] * x[j]
        y[0] += s0
        y[1] += s1
        y[2] += s2
        y[3] += s3
        return
    for r in range(len(A)):
        row, total = A[r], 0.0
        for j in range(len(x)):
            total += row[j] * x[j]
        y[r] += total


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def add_rows(A: Floats, p: Floats, scale: float, out: Floats) -> None:
    """out += scale A^T p, skipping unloaded rows."""
    first = 0
    while first + _FOUR <= len(p):
        f0, f1, f2, f3 = scale * p[first], scale * p[first + 1], scale * p[first + 2], scale * p[first + 3]
        if f0 != 0.0 or f1 != 0.0 or f2 != 0.0 or f3 != 0.0:
            a, b, c, d = A[first], A[first + 1], A[first + 2], A[first + 3]
            for j in range(len(out)):
                out[j] += f0 * a[j] + f1 * b[j] + f2 * c[j] + f3 * d[j]
        first += _FOUR
    for i in range(first, len(p)):
        f = scale * p[i]
        if f != 0.0:
            row = A[i]
            for j in range(len(out)):
                out[j] += row[j] * f


@njit(**VIEWS)
def gap_jumps(model: ModalModel, rows: Ints, q: Floats, w: Floats) -> None:
    """w = G q of some runs, block by block."""
    for a in range(len(rows)):
        w[rows[a]] = 0.0
    for t in range(len(model.tiles)):
        r0, r1, c0, c1, start = model.tiles[t]
        G = model.values[start : start + (r1 - r0) * (c1 - c0)].reshape(r1 - r0, c1 - c0)
        for r in range(0, r1 - r0, _FOUR):
            end = min(r + _FOUR, r1 - r0)
            for a in range(len(rows)):
                _dot_rows(G[r:end], q[rows[a], c0:c1], w[rows[a], r0 + r : r0 + end])


@njit(**VIEWS)
def modal_forces(model: ModalModel, rows: Ints, p: Floats, r: Floats) -> None:
    """r = G^T p of some runs, block by block."""
    for a in range(len(rows)):
        r[rows[a]] = 0.0
    for t in range(len(model.tiles)):
        r0, r1, c0, c1, start = model.tiles[t]
        G = model.values[start : start + (r1 - r0) * (c1 - c0)].reshape(r1 - r0, c1 - c0)
        for i in range(0, r1 - r0, _FOUR):
            end = min(i + _FOUR, r1 - r0)
            for a in range(len(rows)):
                add_rows(G[i:end], p[rows[a], r0 + i : r0 + end], 1.0, r[rows[a], c0:c1])


@njit(**VIEWS)
def residual_jumps(R: Floats, rows: Ints, p: Floats, goal: Floats) -> None:
    """goal = R p of some runs, R symmetric: what the modes that are no states tend to."""
    for a in range(len(rows)):
        goal[rows[a]] = 0.0
    for i in range(0, len(R), _FOUR):
        end = min(i + _FOUR, len(R))
        for a in range(len(rows)):
            add_rows(R[i:end], p[rows[a], i:end], 1.0, goal[rows[a]])


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def external_force(model: ModalModel, acc: Floats, f: Floats) -> None:
    """External modal force at one instant."""
    copy(model.static, f)
    for a in range(len(acc)):
        for j in range(len(f)):
            f[j] += model.load[a, j] * acc[a]


@njit(cache=True)
def add_carried(
    carried: Floats | None, motion: Floats, first: int, within: tuple[float, float], jump: Floats
) -> None:
    """Add the jumps that moving supports make within a base step, exactly for linear acceleration.

    Parameters
    ----------
    carried : (N, m)
    motion : (3 m, samples) acceleration, velocity and displacement of the supports
    first : sample at which the base step begins
    within : how far into it, from 0 to 1, and its length [s]
    """
    if carried is None:
        return
    share, dt = within
    t, m = share * dt, carried.shape[1]
    for k in range(m):
        start, change = motion[k, first], motion[k, first + 1] - motion[k, first]
        acc = 0.5 * start + share * change / 6.0
        disp = motion[2 * m + k, first] + t * (motion[m + k, first] + t * acc)
        for i in range(len(jump)):
            jump[i] += carried[i, k] * disp


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
    not overlap, gives up on vector instructions.

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
