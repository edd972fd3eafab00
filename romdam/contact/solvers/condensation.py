"""Condensation: contacts that have stuck for a long time are no longer unknowns of the Gauss-Seidel sweeps.

While a contact sticks, its jump y is zero and its force is the unknown; no inequality has to be checked. Let
s be the sticking contacts that are condensed and f the others. Let p be a force whose response
y = W p + y_free is known, and dp its change, which brings y_s to zero: dy_s = -y_s. Eliminating dp_s from
dy = W dp gives

    [dp_s]     [-y_s ]        M_ss = W_ss^-1,        M_sf = -W_ss^-1 W_sf,
    [    ] = M [     ],
    [dy_f]     [ dp_f]        M_fs = W_fs W_ss^-1,   M_ff = W_ff - W_fs W_ss^-1 W_sf,

where M is the principal pivot of the Delassus operator W on s. The sweeps look for dp_f by the smaller matrix
M_ff, and dp_s follows from dp_f by one product. After every step p_s is checked: a contact that no longer
sticks is released, by exchanging its three directions in M back. So every step proves that the condensed
contacts stick.

M is kept in single precision, as the matrix of the sweeps is, because the exact response is computed with W
between the sweeps. `tests/benchmarks/bench_condensation.py` measures how many contacts of an arch dam are
condensed.

References
----------
Cottle, Pang, Stone, The Linear Complementarity Problem (SIAM, 2009), 2.3: principal pivots.
"""

from __future__ import annotations

import numpy as np

from romdam.contact.components import NORMAL, SHEAR_J, SHEAR_K
from romdam.contact.cone import project_shear, shear_limits, slides
from romdam.contact.problem import Limits
from romdam.contact.solvers.state import FrictionalState
from romdam.core.arrays import Bools, Floats, Ints, Singles
from romdam.core.jit import ARRAYS, copy, njit

_WORTH = 8  # M is made anew for one more contact in so many, and given up for fewer condensed ones
_REGULAR = 1e-12  # of W's largest diagonal entry, added: a singular W_ss is inverted too, and then refused
_CONDITION = 1e5  # of W on the condensed contacts: beyond it single precision does not hold them


@njit(cache=True)
def sticks(limits: Limits, p: Floats, i: int) -> bool:
    """Tell whether gap i is closed and its shear below its limit in both directions."""
    p_n, t_j, t_k = p[3 * i + NORMAL], p[3 * i + SHEAR_J], p[3 * i + SHEAR_K]
    limit_j, limit_k = shear_limits(limits, i, p_n)
    return p_n > 0.0 and limit_j > 0.0 and limit_k > 0.0 and not slides(limit_j, limit_k, t_j, t_k)


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _exchange(M: Singles, k: Ints, P: Singles, X: Singles) -> None:
    """Exchange known and unknown of the directions k in r = M z, where o are the other directions.

    r_k = M_kk z_k + M_ko z_o is solved for z_k and put into r_o, so that with P = M_kk^-1 and X = P M_k

        M_kk <- P,   M_ko <- -X_o,   M_ok <- M_ok P,   M_oo <- M_oo - M_ok X_o.

    M goes through memory once, however many directions there are.

    Parameters
    ----------
    M : (N, N) changed in place
    k : (m,) the directions, in threes
    P, X : (m, m), (m, N) as above
    """
    size = len(M)
    exchanged = np.zeros(size, dtype=np.bool_)
    for a in range(len(k)):
        exchanged[k[a]] = True
    factor = np.empty(len(k), dtype=np.float32)
    for i in range(size):
        if exchanged[i]:
            continue
        row = M[i]
        for a in range(len(k)):
            factor[a] = row[k[a]]
        for a in range(0, len(k), 3):
            f, g, h = factor[a], factor[a + 1], factor[a + 2]
            x, y, z = X[a], X[a + 1], X[a + 2]
            for j in range(size):
                row[j] -= f * x[j] + g * y[j] + h * z[j]
        for a in range(len(k)):
            row[k[a]] = np.float32(0.0)
            for b in range(len(k)):
                row[k[a]] += factor[b] * P[b, a]
    for a in range(len(k)):
        for j in range(size):
            M[k[a], j] = -X[a, j]
        for b in range(len(k)):
            M[k[a], k[b]] = P[a, b]


@njit(**ARRAYS)
def _directions(chosen: Bools, which: bool) -> Ints:
    """Directions of the gaps that are chosen (`which` True), or of those that are not, in threes."""
    count = 0
    for i in range(len(chosen)):
        count += int(chosen[i] == which)
    directions, count = np.empty(3 * count, dtype=np.int64), 0
    for i in range(len(chosen)):
        if chosen[i] == which:
            for r in range(3):
                directions[count + r] = 3 * i + r
            count += 3
    return directions


@njit(**ARRAYS)
def release(solver: FrictionalState, going: Bools) -> None:
    """Make some condensed contacts unknowns of the sweeps again.

    M_ff is another matrix then, so the sweeps gather it anew. The contacts wait as those that have just come
    to stick.
    """
    sweeps, sticking = solver.sweeps, solver.sticking
    M, size, k = sticking.pivot, len(sticking.pivot), _directions(going, True)
    M_kk, rows = np.empty((len(k), len(k))), np.empty((len(k), size), dtype=np.float32)
    for a in range(len(k)):
        for b in range(len(k)):
            M_kk[a, b] = M[k[a], k[b]]
        for j in range(size):
            rows[a, j] = M[k[a], j]
    P = np.linalg.inv(M_kk).astype(np.float32)
    _exchange(M, k, P, np.dot(P, rows))
    for i in range(len(going)):
        if going[i]:
            sticking.condensed[i], sticking.wait[i] = False, size
            sticking.counts.number -= 1
    sweeps.counts.gathered = 0
    sweeps.gathered[:] = False


@njit(cache=True)
def release_all(solver: FrictionalState) -> None:
    """Condense no contact any more; M is void, and the sweeps gather W itself."""
    sweeps, sticking = solver.sweeps, solver.sticking
    for i in range(len(sticking.condensed)):
        if sticking.condensed[i]:
            sticking.condensed[i], sticking.wait[i] = False, len(sticking.pivot)
    sweeps.gathered[:] = False
    sweeps.counts.gathered, sticking.counts.number = 0, 0


@njit(**ARRAYS)
def release_sliding(limits: Limits, solver: FrictionalState, p: Floats) -> None:
    """Release the condensed contacts that do not stick under a force p, and bring theirs within the limits.

    Where they are many, all condensed contacts are released: an exchange of m directions costs m N^2, more
    than condensing saves.
    """
    sticking, going, gone = solver.sticking, np.zeros(len(limits.mu), dtype=np.bool_), 0
    for i in range(len(going)):
        if sticking.condensed[i] and not sticks(limits, p, i):
            going[i] = True
            gone += 1
            n, j, k = 3 * i + NORMAL, 3 * i + SHEAR_J, 3 * i + SHEAR_K
            p[n] = max(p[n], 0.0)
            limit_j, limit_k = shear_limits(limits, i, p[n])
            p[j], p[k], _ = project_shear(p[j], p[k], limit_j, limit_k)
    number = sticking.counts.number
    if _WORTH * (number - gone) < len(going) or _WORTH * gone > number:
        release_all(solver)
    elif gone:
        release(solver, going)


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def multiply(M: Singles, chosen: Bools, z: Singles, out: Floats) -> None:
    """out += M z in the rows of the chosen gaps."""
    for i in range(len(chosen)):
        if chosen[i]:
            for b in range(3 * i, 3 * i + 3):
                row, total = M[b], np.float32(0.0)
                for j in range(len(z)):
                    total += row[j] * z[j]
                out[b] += total


@njit(**ARRAYS)
def note_sticking(W: Floats, limits: Limits, solver: FrictionalState, p: Floats) -> None:
    """Count for how many solutions every contact has stuck, and condense those that have for long.

    That is for as many as W has rows, N: the sweeps (10 N^2 a solution) have then cost more than making M
    (N^3) does. None are condensed where W_ss is ill-conditioned, because their forces then determine each
    other.

    Parameters
    ----------
    W : (N, N) Delassus operator [m/N]
    p : (N,) force of the solution [N]
    """
    sticking, new = solver.sticking, 0
    wait, counts = sticking.wait, sticking.counts
    for i in range(len(wait)):
        wait[i] = max(wait[i] - 1, 0) if sticks(limits, p, i) else len(W)
        new += int(wait[i] == 0 and not sticking.condensed[i])
    counts.total += counts.number
    if _WORTH * new < len(wait):
        return
    wanted = np.zeros(len(wait), dtype=np.bool_)
    for i in range(len(wait)):
        wanted[i] = wait[i] == 0 or sticking.condensed[i]
    release_all(solver)
    s, f, M = _directions(wanted, True), _directions(wanted, False), sticking.pivot
    W_ss, W_sf, largest = np.empty((len(s), len(s))), np.empty((len(s), len(f))), 0.0
    for b in range(len(W)):
        largest = max(largest, W[b, b])
    for a in range(len(s)):
        for b in range(len(s)):
            W_ss[a, b] = W[s[a], s[b]]
        W_ss[a, a] += _REGULAR * largest
        for b in range(len(f)):
            W_sf[a, b] = W[s[a], f[b]]
    Z = np.linalg.inv(W_ss)
    for a in range(len(s)):
        for b in range(len(s)):
            if not abs(Z[a, b]) * largest < _CONDITION:  # NaN too
                return
    X = np.dot(Z, W_sf)
    S = np.dot(W_sf.T.copy(), X)
    for a in range(len(s)):
        for b in range(len(s)):
            M[s[a], s[b]] = Z[a, b]
        for b in range(len(f)):
            M[s[a], f[b]], M[f[b], s[a]] = -X[a, b], X[a, b]
    for a in range(len(f)):
        for b in range(len(f)):
            M[f[a], f[b]] = W[f[a], f[b]] - S[a, b]
    copy(wanted, sticking.condensed)
    counts.number = len(s) // 3
