"""Gaps that move alike are marched as one, and modes that nothing moves not at all.

A scene that mirrors itself, shaken along its plane of symmetry, moves symmetrically: gaps side by side open
alike, and its twisting modes stay at rest. No geometry is looked at. A partition of the gaps is sought such
that forces equal within its groups, and the loads, give jumps that are,

    B (K + s)^-1 B^T p  and  B (K + s)^-1 load  constant in every group, for every s,

with gaps of one law in a group. The problem of every step, y = W p + y_free >= 0, p >= 0, y p = 0, has one
solution; that of the groups, spread evenly, is one. Friction may have several, so there nothing is folded.

The partition is the coarsest: from groups of equal law on, gaps whose jumps differ are told apart until none
do. Eigenvectors of nearly equal frequencies mix what mirrors and what does not, so the modes of a
frequency are turned to what the groups and the loads move; what is left out is measured. Of the 100 gaps and
360 modes of configs/two_cantilevers.yaml 60 and 193 remain, whose flexibilities are those of the whole to
1e-11 at rest and 1e-8 within a step. Openings are equal to 1e-11, and the march takes half of its time.

References
----------
Godsil, Royle, Algebraic Graph Theory (Springer, 2001), 9.3: equitable partitions and their quotients.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array, eye_array

from romdam.dynamics.system import Alike, History, System

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SAME = 1e-5  # relative, of frequencies squared
_TOLD = 1e-5  # of the largest, by which values differ
_MOVED = 1e-2  # direction among the modes of a frequency; those that move have 0.4 or more, the others 1e-4
_EXACT = 1e-6  # of the largest jump, what may be left out


def folded(system: System, active: Ints) -> System | None:
    """The system with one gap for each group, or None where all gaps are different.

    Parameters
    ----------
    active : the shaken components
    """
    law = system.law
    if len(law) < 2 or not system.diagonal or law.directions != 1 or law.laws or law.K_nz.any():
        return None
    gaps = _partition(system, active)
    count = np.bincount(gaps)
    if len(count) == len(law):
        return None
    mean = csr_matrix((1.0 / count[gaps], (gaps, np.arange(len(law)))))
    jumps = mean @ system.B.toarray()
    small = _quotient(system, gaps, jumps, _modes(system, active, jumps))
    for s in _shifts(system):
        whole = _jumps(system, active, mean.T.toarray(), s)
        left_out = np.abs(whole - _jumps(small, active, np.eye(len(count)), s)[gaps]).max(axis=0)
        if (left_out > _EXACT * np.abs(whole).max(axis=0)).any():
            return None
    return small


def _shifts(system: System) -> Floats:
    """s from the lowest frequencies to the highest."""
    k = system.K.diagonal()
    highest = k.max() if k.any() else 1.0
    return np.geomspace(k[k > 1e-9 * highest].min(initial=highest), 1e3 * highest, 5)


def _jumps(system: System, active: Ints, forces: Floats, s: float) -> Floats:
    """Jumps under forces on the gaps, under the loads, and under the static force, for one s."""
    B = system.B.toarray()
    moved = np.column_stack([B.T @ forces, system.load[:, active], system.force])
    return np.asarray(B @ (moved / (system.K.diagonal() + s)[:, None]))


def unfolded(history: History, alike: Alike) -> History:
    """The history of all gaps and modes."""
    gaps, share = alike.gaps, 1.0 / alike.count[alike.gaps]
    peaks = {name: values[gaps] for name, values in history.peaks.items()}
    peaks["compression"] = peaks["compression"] * share
    return replace(
        history,
        jump=history.jump[:, gaps],
        traction=history.traction[:, gaps] * share[:, None],
        mean_traction=history.mean_traction[:, gaps] * share[:, None],
        state=history.state[:, gaps],
        peaks=peaks,
        q=None if history.q is None else history.q @ alike.modes.T,
        v=None if history.v is None else history.v @ alike.modes.T,
    )


def _clusters(system: System) -> Ints:
    """The number of every mode's frequency; parts have their own."""
    k, number, first = system.K.diagonal(), np.zeros(system.size, dtype=np.int64), 0
    for part in system.parts.values():
        order = part.start + np.argsort(k[part], kind="stable")
        further = np.diff(k[order], prepend=-np.inf) > _SAME * k[order]
        number[order] = first - 1 + np.cumsum(further)
        first += int(further.sum())
    return number


def _partition(system: System, active: Ints) -> Ints:
    """The group of every gap, numbered as they come."""
    law, random, before = system.law, np.random.default_rng(0), 0
    rigid = np.isinf(law.K_n)
    gaps = _told_apart(rigid.astype(np.int64), np.column_stack([np.where(rigid, 0.0, law.K_n), law.gap]))
    while before < gaps.max(initial=-1) + 1 < len(law):
        before = gaps.max() + 1
        force = random.uniform(0.5, 1.5, before)[gaps]
        for s in _shifts(system):
            gaps = _told_apart(gaps, _jumps(system, active, force, s))
    first = np.unique(gaps, return_index=True)[1]
    return np.asarray(np.argsort(np.argsort(first))[gaps])


def _told_apart(gaps: Ints, values: Floats) -> Ints:
    """Finer groups: gaps that differ in any column are not in the same."""
    labels = [gaps]
    for column in values.T:
        order = np.argsort(column)
        label = np.zeros(len(gaps), dtype=np.int64)
        label[order[1:]] = np.cumsum(np.diff(column[order]) > _TOLD * np.abs(column).max())
        labels.append(label)
    return np.asarray(np.unique(np.column_stack(labels), axis=0, return_inverse=True)[1]).ravel()


def _modes(system: System, active: Ints, jumps: Floats) -> csr_matrix:
    """Directions among the modes that forces on the groups or the loads move, (modes, directions)."""
    number, drives = _clusters(system), np.column_stack([system.load[:, active], system.force])
    size = np.bincount(number, weights=(system.B.toarray() ** 2).sum(axis=0))
    drives /= np.maximum(np.abs(drives).max(axis=0), 1e-300)
    moved = np.hstack([jumps.T / np.sqrt(np.maximum(size, 1e-300))[number, None], drives])
    turned, moves = eye_array(system.size, format="lil"), np.linalg.norm(moved, axis=1) > _MOVED
    for several in np.flatnonzero(np.bincount(number) > 1):
        modes = np.flatnonzero(number == several)
        U, share, _ = np.linalg.svd(moved[modes])
        turned[np.ix_(modes, modes)] = U
        moves[modes] = np.arange(len(modes)) < (share > _MOVED).sum()
    return csr_matrix(turned.tocsc()[:, moves])


def _quotient(system: System, gaps: Ints, jumps: Floats, Q: csr_matrix) -> System:
    """The system of the groups; a group's stiffness is that of all its gaps."""
    count, law = np.bincount(gaps), system.law
    first = np.unique(gaps, return_index=True)[1]
    ends = {name: np.searchsorted(first, (part.start, part.stop)) for name, part in law.joints.items()}
    return replace(
        system,
        M=csr_matrix(eye_array(Q.shape[1])),
        C=csr_matrix(diags_array((Q.T @ system.C @ Q).diagonal())),
        K=csr_matrix(diags_array((Q.T @ system.K @ Q).diagonal())),
        B=csr_matrix(jumps @ Q),
        load=Q.T @ system.load,
        force=Q.T @ system.force,
        observe=csr_matrix(system.observe @ Q),
        law=replace(
            law,
            K_n=law.K_n[first] * count,
            K_nz=law.K_nz[first],
            K_s=law.K_s[first] * count,
            mu=law.mu[first],
            gap=law.gap[first],
            joints={name: slice(int(a), int(b)) for name, (a, b) in ends.items()},
        ),
        parts=_parts(system, Q),
        alike=Alike(system, gaps, count, Q),
    )


def _parts(system: System, Q: csr_matrix) -> dict[str, slice]:
    """The directions of every part; those of one stand side by side."""
    width = {name: len(np.unique(Q[part].indices)) for name, part in system.parts.items()}
    stops = dict(zip(width, np.cumsum(list(width.values())), strict=True))
    return {name: slice(int(stops[name] - width[name]), int(stops[name])) for name in width}
