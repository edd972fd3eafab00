"""Gaps that have been stuck for long are no unknowns of the sweeps: what holds them is eliminated.

    [p_h]       [-y_h ]          M_hh = W_hh^-1,   M_hf = W_hh^-1 W_hf,   M_ff = W_ff - W_fh W_hh^-1 W_hf
    [   ] = M   [     ]  + ...
    [y_f]       [ p_f ]          h the held gaps, f the others

M is the principal pivot of W on the held gaps. Sweeps run on M_ff; the held gaps' force follows from theirs,
and those that are not stuck in it are let go, by one exchange of all their directions. So a held gap costs a
product, and every step proves it stuck. Of the 189 gaps of configs/arch_dam.yaml at a tenth of
its shaking 122 never slide; 114 are held on average, and the march takes 0.59 of the time
(`tests/benchmarks/bench_held_gaps.py`). M is in single precision, like the sweeps: the responses between them
are exact.

References
----------
Cottle, Pang, Stone, The Linear Complementarity Problem (SIAM, 2009), 2.3: principal pivots.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from romdam.contact.cone import project_shear, slides
from romdam.contact.problem import GapMemory, Limits
from romdam.core.arrays import Floats, Singles
from romdam.core.jit import ARRAYS, njit

_WORTH = 8  # M is made anew for one more gap in so many, and given up for fewer held ones
_REGULAR = 1e-12  # of the largest diagonal: a singular matrix is inverted too, and refused
_CONDITION = 1e5  # of W on the held gaps: beyond it single precision does not hold them


@njit(cache=True)
def tableau(memory: GapMemory) -> Singles:
    """M, (N, N) or with an idle column."""
    return memory.inverse[1].view(np.float32)


@njit(cache=True)
def is_stuck(limits: Limits, p: Floats, i: int) -> bool:
    """Whether gap i is closed and its shear below its limit in both directions."""
    b = 3 * i
    limit_j = limits.cohesion[i, 0] + limits.mu[i, 0] * p[b]
    limit_k = limits.cohesion[i, 1] + limits.mu[i, 1] * p[b]
    return p[b] > 0.0 and limit_j > 0.0 and limit_k > 0.0 and not slides(limit_j, limit_k, p[b + 1], p[b + 2])


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _exchange(M: Singles, size: int, k: NDArray[np.int64], P: Singles, X: Singles) -> None:
    """Exchange forces and displacements of some directions in r = M z: the given are found, and the reverse.

    M goes through memory once, however many directions there are.

    Parameters
    ----------
    k : (m,) the directions, in threes
    P, X : (m, m) inverse of M on them, (m, size) its product with their rows; changed
    """
    own = np.zeros(size, dtype=np.bool_)
    for a in range(len(k)):
        own[k[a]] = True
    factor = np.empty(len(k), dtype=np.float32)
    for i in range(size):
        if own[i]:
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
def let_go(memory: GapMemory, size: int, going: NDArray[np.bool_]) -> None:
    """Make some held gaps unknowns of the sweeps again; what they have gathered is void."""
    M, k = tableau(memory), np.flatnonzero(np.repeat(going, 3))
    own, rows = np.empty((len(k), len(k))), np.empty((len(k), size), dtype=np.float32)
    for a in range(len(k)):
        for b in range(len(k)):
            own[a, b] = M[k[a], k[b]]
        for j in range(size):
            rows[a, j] = M[k[a], j]
    P = np.linalg.inv(own).astype(np.float32)
    _exchange(M, size, k, P, np.dot(P, rows))
    for i in range(len(going)):
        if going[i]:
            memory.active[1, i], memory.order[1, i] = False, 0
            memory.counts[1, 0] -= 1
    memory.counts[0, 0] = 0
    memory.active[0, :] = False


@njit(cache=True)
def let_all_go(memory: GapMemory) -> None:
    """Hold no gap any more."""
    for i in range(memory.active.shape[1]):
        if memory.active[1, i]:
            memory.active[1, i], memory.order[1, i] = False, 0
    memory.active[0, :] = False
    memory.counts[0, 0], memory.counts[1, 0] = 0, 0


@njit(**ARRAYS)
def let_go_where_not_stuck(limits: Limits, memory: GapMemory) -> None:
    """Let those go that are not stuck in the force at hand, which is brought within their limits.

    All go where these are many: an exchange of m directions costs m N^2, more than what holding saves.
    """
    p, going = memory.force, np.zeros(len(limits.mu), dtype=np.bool_)
    for i in range(len(going)):
        if memory.active[1, i] and not is_stuck(limits, p, i):
            going[i] = True
            b = 3 * i
            p[b] = max(p[b], 0.0)
            limit_j = limits.cohesion[i, 0] + limits.mu[i, 0] * p[b]
            limit_k = limits.cohesion[i, 1] + limits.mu[i, 1] * p[b]
            p[b + 1], p[b + 2], _ = project_shear(p[b + 1], p[b + 2], limit_j, limit_k)
    held, gone = memory.counts[1, 0], going.sum()
    if _WORTH * (held - gone) < len(going) or _WORTH * gone > held:
        let_all_go(memory)
    elif going.any():
        let_go(memory, len(p), going)


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def multiply(M: Singles, memory: GapMemory, held: bool, z: Singles, out: Floats) -> None:
    """out += M z in the rows of the held gaps, or of those that are gathered."""
    flags = memory.active[1] if held else memory.active[0]
    for i in range(len(flags)):
        if flags[i]:
            for b in range(3 * i, 3 * i + 3):
                row, total = M[b], np.float32(0.0)
                for j in range(len(z)):
                    total += row[j] * z[j]
                out[b] += total


@njit(**ARRAYS)
def _hold(W: Floats, memory: GapMemory, wanted: NDArray[np.bool_]) -> None:
    """Make M for the wanted gaps, or hold none where they determine each other."""
    let_all_go(memory)
    flags = np.repeat(wanted, 3)
    h, f, M = np.flatnonzero(flags), np.flatnonzero(~flags), tableau(memory)
    W_hh, W_hf, largest = np.empty((len(h), len(h))), np.empty((len(h), len(f))), np.diag(W).max()
    for a in range(len(h)):
        for b in range(len(h)):
            W_hh[a, b] = W[h[a], h[b]]
        W_hh[a, a] += _REGULAR * largest
        for b in range(len(f)):
            W_hf[a, b] = W[h[a], f[b]]
    Z = np.linalg.inv(W_hh)
    if not np.abs(Z).max() * largest < _CONDITION:
        return
    X = np.dot(Z, W_hf)
    S = np.dot(W_hf.T.copy(), X)
    for a in range(len(h)):
        for b in range(len(h)):
            M[h[a], h[b]] = Z[a, b]
        for b in range(len(f)):
            M[h[a], f[b]], M[f[b], h[a]] = -X[a, b], X[a, b]
    for a in range(len(f)):
        for b in range(len(f)):
            M[f[a], f[b]] = W[f[a], f[b]] - S[a, b]
    memory.active[1] |= wanted
    memory.counts[1, 0] = wanted.sum()


@njit(**ARRAYS)
def note_stuck(W: Floats, limits: Limits, memory: GapMemory) -> None:
    """Count for how many solutions every gap has been stuck, and hold those that have been for long.

    That is for as many as W has rows: the sweeps (10 N^2 each) have then cost more than making M (N^3) does.
    """
    streak, new = memory.order[1], 0
    for i in range(len(streak)):
        streak[i] = streak[i] + 1 if is_stuck(limits, memory.force, i) else 0
        new += int(streak[i] >= len(W) and not memory.active[1, i])
    memory.counts[1, 1] += memory.counts[1, 0]
    if _WORTH * new >= len(streak):
        _hold(W, memory, (streak >= len(W)) | memory.active[1])
