"""Symmetry reduction: merge gaps that move alike, and leave out modes that nothing excites.

A scene that is its own mirror image, shaken along its plane of symmetry, moves symmetrically. Gaps at
mirrored points open alike, and slide alike or against each other, while the twisting modes stay at rest. Then
one gap can stand for each group of such gaps, and the problem has fewer gaps and modes.

The geometry is not examined. Instead a partition of the gaps is sought, with a sign (or zero) for each
direction of each gap, such that forces which are equal within the groups, up to the signs, and the loads
cause jumps that are equal within the groups too:

    B (K + s)^-1 B^T p  and  B (K + s)^-1 load  constant in every group, for every s,

where the gaps of a group have the same law. A solution for the groups, spread evenly over their gaps, is then
a solution for the gaps, step by step. Without friction it is the only one; with friction there may be others,
as in any step.

The coarsest such partition is computed by refinement: it begins with the groups of equal law, and gaps whose
jumps differ are separated until no jumps differ. Eigenvectors of nearly equal frequencies mix symmetric and
antisymmetric shapes, so the modes of one frequency are rotated into those that the groups and the loads
excite and the rest. What is left out is measured, and the reduction is refused where that is more than
round-off.

References
----------
Godsil, Royle, Algebraic Graph Theory (Springer, 2001), 9.3: equitable partitions and their quotients.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array, eye_array

from romdam.contact.components import NORMAL
from romdam.core.arrays import Floats, Ints
from romdam.core.final_state import STATE_QUANTITIES, FinalState
from romdam.core.recorded import GAP_QUANTITIES, PEAK_QUANTITIES, Quantity
from romdam.core.system import Coordinates, GapLaw, History, System
from romdam.linalg.dense import sparse
from romdam.timestepping.settings import Start

_SAME = 1e-5  # relative, of frequencies squared
_DIFFERENT = 1e-5  # of the largest, by which values differ
_MOVED = 1e-2  # direction among the modes of a frequency; those that gaps move have 0.4 or more, others 1e-4
_DRIVEN = 1e-5  # of the most driven mode; those that mirror nothing of the loads have 1e-7
_EXACT = 1e-6  # of the largest jump, what may be left out
_MIRRORED = 1e-5  # of a state, what may be left out of it
_LEAST = 1e-9  # of the largest omega^2: modes below it are rigid motions, and no lowest frequency
_PROOFS = 12  # random forces on all groups, by whose jumps merging is proved
_SHIFTS, _ABOVE = 5, 1e3  # values of s at which merging is proved, up to so many times the largest omega^2


@dataclass(frozen=True)
class Symmetry:
    """Relation of a system with fewer gaps and modes to the whole one that it stands for.

    Attributes
    ----------
    system : the smaller one
    gaps : (ng,) for every gap of the whole the one that stands for it
    count : for how many each stands
    signs : (ng, directions) by which its jumps and forces are those of the whole; zero where there are none
    modes : (n of the whole, n) its unknowns from those at hand, orthonormal columns
    """

    system: System
    gaps: Ints
    count: Ints
    signs: Floats
    modes: csr_matrix


def merge_equivalent_contacts(
    system: System, active: Ints, known: dict[Hashable, Symmetry | None] | None = None
) -> Symmetry | None:
    """Give the system one gap for each group; None where all gaps are different.

    Parameters
    ----------
    active : the shaken components
    known : results for systems that differ in damping, in their joints' parameters and in the uplift that
        follows from these at most, by what they depend on of these; gains the one of this system
    """
    law, known = system.law, {} if known is None else known
    if len(law) < 2 or not system.diagonal or law.has_memory or law.K_nz.any() or system.sustained:
        return None
    rigid_n, rigid_s = np.isinf(law.K_n), np.isinf(law.K_s)
    spring_n, spring_s = np.where(rigid_n, 0.0, law.K_n), np.where(rigid_s, 0.0, law.K_s)
    values = np.column_stack([rigid_n, rigid_s, spring_n, spring_s, law.mu, law.gap])
    classes = _separated(np.zeros(len(law), dtype=np.int64), values)
    shift = b"" if system.point_shift is None else system.point_shift.tobytes()
    uplift = b"" if system.uplift is None else system.uplift.added.tobytes()
    starts = law.slip.tobytes(), law.slipped.tobytes(), shift, uplift
    key = (active.tobytes(), law.directions, classes.tobytes(), *starts)
    if key not in known:
        known[key] = _equivalence(system, active, classes)
    same = known[key]
    if same is None or (np.isinf(law.K_s) & (same.signs == 0.0).any(axis=1)).any():
        return None
    C = csr_matrix(diags_array((same.modes.T @ system.C @ same.modes).diagonal()))
    return replace(same, system=replace(same.system, C=C, law=_of_groups(law, same.gaps, same.signs)))


def _equivalence(system: System, active: Ints, classes: Ints) -> Symmetry | None:
    """Merge what forces and loads do not tell apart; None where that is nothing, or not exact.

    Parameters
    ----------
    classes : (ng,) equal where gaps have one law
    """
    gaps, signs = _partition(system, active, classes)
    if gaps.max() + 1 == len(gaps):
        return None
    spread = _spread(gaps, signs)
    mean = csr_matrix(spread.T / np.repeat(np.bincount(gaps), signs.shape[1])[:, None])
    B = system.B.toarray()
    jumps = mean @ B
    Q = _modes(system, active, jumps)
    # the directions of every part; those of one stand side by side
    width = {name: len(np.unique(Q[part].indices)) for name, part in system.parts.items()}
    stops = dict(zip(width, np.cumsum(list(width.values())), strict=True))
    smaller = replace(
        system,
        M=csr_matrix(diags_array((Q.T @ system.M @ Q).diagonal().round())),
        C=csr_matrix(diags_array((Q.T @ system.C @ Q).diagonal())),
        K=csr_matrix(diags_array((Q.T @ system.K @ Q).diagonal())),
        B=sparse(jumps @ Q),
        load=Q.T @ system.load,
        force=Q.T @ system.force,
        load_steps={kind: Q.T @ force for kind, force in system.load_steps.items()},
        observe=csr_matrix(system.observe @ Q),
        law=_of_groups(system.law, gaps, signs),
        parts={name: slice(int(stops[name] - width[name]), int(stops[name])) for name in width},
    )
    if system.at_point is not None:
        at_gaps = system.at_point @ Q
        at_groups = mean @ at_gaps
        if np.abs((at_gaps - spread @ at_groups).toarray()).max() > _EXACT * np.abs(system.B @ Q).max():
            return None  # jumps at the gaps' positions differ within a group
        smaller = replace(smaller, at_point=csr_matrix(at_groups))
    if (shift := system.point_shift) is not None:
        if np.abs(shift - spread @ (mean @ shift)).max() > _EXACT * np.abs(shift).max(initial=0.0):
            return None
        smaller = replace(smaller, point_shift=np.asarray(mean @ shift))
    # random forces on the groups: every unit force would take as long as the reduction of large joints
    fewer = smaller.B.toarray()
    forces = np.random.default_rng(1).uniform(-1.0, 1.0, (len(jumps), _PROOFS))
    for s in _shifts(system):
        whole = _jumps(system, B, active, mean.T @ forces, s)
        left_out = np.abs(whole - spread @ _jumps(smaller, fewer, active, forces, s)).max(axis=0)
        if (left_out > _EXACT * np.abs(whole).max(axis=0)).any():
            return None
    return Symmetry(smaller, gaps, np.bincount(gaps), signs, Q)


def _spread(gaps: Ints, signs: Floats) -> csr_matrix:
    """Jumps of the groups at every gap, (d ng, d groups)."""
    d = signs.shape[1]
    rows, columns = np.arange(signs.size), (d * gaps[:, None] + np.arange(d)).ravel()
    return csr_matrix((signs.ravel(), (rows, columns)), shape=(signs.size, d * (gaps.max() + 1)))


def _shifts(system: System) -> Floats:
    """s from the lowest frequencies to the highest."""
    k = system.K.diagonal()
    highest = k.max() if k.any() else 1.0
    return np.geomspace(k[k > _LEAST * highest].min(initial=highest), _ABOVE * highest, _SHIFTS)


def _jumps(system: System, B: Floats, active: Ints, forces: Floats, s: float) -> Floats:
    """Jumps under forces on the gaps, under the loads, and under the static forces, for one s.

    Parameters
    ----------
    B : (N, n) of the system, not sparse
    """
    steps = system.load_steps.values()
    moved = np.column_stack([B.T @ forces, system.load[:, active], system.force, *steps])
    return np.asarray(B @ (moved / (system.K.diagonal() + s)[:, None]))


def expand(history: History, symmetry: Symmetry) -> History:
    """Give the history of all gaps and modes."""
    merged = history.coordinates
    recorded: dict[str, Any] = {
        name: _expanded_quantity(getattr(history, name), of, symmetry, 1)
        for name, of in GAP_QUANTITIES.items()
    }
    peaks = {
        name: _expanded_quantity(values, PEAK_QUANTITIES[name], symmetry, 0)
        for name, values in history.peaks.items()
    }
    modes = None if merged is None else Coordinates(partial(_expanded, symmetry.modes, merged))
    final = history.final
    if final is not None:
        whole = {name: _expanded_state(name, values, symmetry) for name, values in final.arrays.items()}
        final = replace(final, arrays=whole)
    return replace(history, **recorded, peaks=peaks, coordinates=modes, final=final)


def _expanded_state(name: str, values: NDArray[Any], symmetry: Symmetry) -> NDArray[Any]:
    """An array of the final state, of all gaps or modes from those of the merged ones."""
    how, gaps = STATE_QUANTITIES[name], symmetry.gaps
    if how == "modes":
        return np.asarray(symmetry.modes @ values)
    if how is None or values.size == 0:
        return values
    values, signs = values[gaps], symmetry.signs
    if how in ("jump", "force"):
        values = values * (signs if values.shape[1] == signs.shape[1] else signs[:, 1:])
    return values / symmetry.count[gaps, None] if how == "force" else values


def _merged_state(name: str, values: NDArray[Any], symmetry: Symmetry) -> NDArray[Any]:
    """The reverse of `_expanded_state`: mean jumps and whole forces of the groups."""
    how, gaps = STATE_QUANTITIES[name], symmetry.gaps
    if how == "modes":
        return np.asarray(symmetry.modes.T @ values)
    if how is None or values.size == 0:
        return values
    if how == "equal":
        return values[np.unique(gaps, return_index=True)[1]]
    signs = symmetry.signs if values.shape[1] == symmetry.signs.shape[1] else symmetry.signs[:, 1:]
    total = np.zeros((len(symmetry.count), values.shape[1]))
    np.add.at(total, gaps, signs * values)
    return total if how == "force" else total / symmetry.count[:, None]


def merged_final(final: FinalState, symmetry: Symmetry) -> FinalState | None:
    """Give a final state as the system with merged contacts has it; None where it mirrors nothing."""
    merged = dict[str, NDArray[Any]]()
    for name, values in final.arrays.items():
        merged[name] = _merged_state(name, values, symmetry)
        if name in ("q", "v", "jump", "traction", "accumulated_slip", "spring", "contact", "closed"):
            again = _expanded_state(name, merged[name], symmetry).astype(float)
            if np.linalg.norm(values - again) > _MIRRORED * np.linalg.norm(values.astype(float)):
                return None
    return replace(final, arrays=merged)


def _expanded_quantity(values: NDArray[Any], of: Quantity, symmetry: Symmetry, axis: int) -> NDArray[Any]:
    """A quantity of all gaps, which stand along an axis, from that of the merged ones."""
    if values.size == 0:
        return values
    values = values.take(symmetry.gaps, axis=axis)
    count, signs = symmetry.count[symmetry.gaps].astype(float), symmetry.signs
    if of.expansion == "jump":
        values *= signs  # in place: new memory takes eight times as long
    elif of.expansion == "force":
        values *= signs / count[:, None]
    elif of.expansion == "share":
        values /= count[:, None] if of.axis else count
    return values


def merged_start(start: Start, symmetry: Symmetry, whole: System) -> Start | None:
    """Give a state of a whole system as that with merged contacts has it; None where it mirrors nothing."""
    d = start.jump.shape[1]
    spread = _spread(symmetry.gaps, symmetry.signs)
    count = np.repeat(symmetry.count, d)
    jump, traction = spread.T @ start.jump.ravel() / count, spread.T @ start.traction.ravel()
    q, v = symmetry.modes.T @ start.q, symmetry.modes.T @ start.v
    weight = np.sqrt(whole.K.diagonal())
    for values, same in (
        (start.jump.ravel(), spread @ jump),
        (start.traction.ravel(), spread @ (traction / count)),
        (start.q, symmetry.modes @ q),  # rigid motions have no energy
        (weight * start.q, weight * (symmetry.modes @ q)),
        (start.v, symmetry.modes @ v),
    ):
        if np.linalg.norm(values - same) > _MIRRORED * np.linalg.norm(values):
            return None
    return Start(q, v, jump.reshape(-1, d), traction.reshape(-1, d))


def _expanded(modes: csr_matrix, merged: Coordinates, rows: slice) -> tuple[Floats, Floats]:
    """All modes' coordinates in some rows."""
    q, v = merged.make(rows)
    return q @ modes.T, v @ modes.T


def _partition(system: System, active: Ints, gaps: Ints) -> tuple[Ints, Floats]:
    """The group of every gap, numbered as they come, and the signs of its directions, (ng, d)."""
    law, random, before = system.law, np.random.default_rng(0), (0, 0.0)
    B = system.B.toarray()
    signs = np.zeros((len(law), law.directions))
    signs[:, NORMAL] = 1.0
    # what the gaps start with along j and k, beside the initial gap that it is measured by
    slips = [np.column_stack([law.gap, slip]) for slip in (law.slip, law.slipped) if len(slip)]
    while before < (groups := gaps.max() + 1, np.abs(signs).sum()) and groups < len(law):
        before = (groups, np.abs(signs).sum())
        force = signs * random.uniform(0.5, 1.5, (groups, law.directions))[gaps]
        for s in _shifts(system):
            for jump in (*_jumps(system, B, active, force.ravel(), s).T, *slips):
                jump = jump.reshape(signs.shape)
                moves = (signs == 0.0) & (np.abs(jump) > _DIFFERENT * np.abs(jump).max())
                signs[moves] = np.sign(jump[moves])
                gaps = _separated(gaps, signs * jump, np.abs(jump).max())
    first = np.unique(gaps, return_index=True)[1]
    return np.asarray(np.argsort(np.argsort(first))[gaps]), signs


def _separated(gaps: Ints, values: Floats, size: float | None = None) -> Ints:
    """Finer groups: gaps that differ in any column, by a share of its largest value or of a size."""
    labels = [gaps]
    for column in values.T:
        order = np.argsort(column)
        further = np.diff(column[order]) > _DIFFERENT * (np.abs(column).max() if size is None else size)
        label = np.zeros(len(gaps), dtype=np.int64)
        label[order[1:]] = np.cumsum(further)
        labels.append(label)
    return np.asarray(np.unique(np.column_stack(labels), axis=0, return_inverse=True)[1]).ravel()


def _modes(system: System, active: Ints, jumps: Floats) -> csr_matrix:
    """Directions among the modes that forces on the groups or the loads move, (modes, directions)."""
    k, number, first = system.K.diagonal(), np.zeros(system.size, dtype=np.int64), 0
    for part in system.parts.values():  # number of every mode's frequency; parts have frequencies apart
        order = part.start + np.argsort(k[part], kind="stable")
        further = np.diff(k[order], prepend=-np.inf) > _SAME * k[order]
        number[order] = first - 1 + np.cumsum(further)
        first += int(further.sum())
    drives = np.column_stack([system.load[:, active], system.force, *system.load_steps.values()])
    size = np.bincount(number, weights=(system.B.toarray() ** 2).sum(axis=0))
    drives *= _MOVED / _DRIVEN / np.maximum(np.abs(drives).max(axis=0), 1e-300)
    moved = np.hstack([jumps.T / np.sqrt(np.maximum(size, 1e-300))[number, None], drives])
    massless = system.M.diagonal() == 0.0  # flexibilities in any coordinates: all of them stay
    turned, moves = eye_array(system.size, format="lil"), np.linalg.norm(moved, axis=1) > _MOVED
    moves |= massless
    for several in np.flatnonzero(np.bincount(number[~massless]) > 1):
        modes = np.flatnonzero(number == several)
        U, share, _ = np.linalg.svd(moved[modes])
        turned[np.ix_(modes, modes)] = U
        moves[modes] = np.arange(len(modes)) < (share > _MOVED).sum()
    return csr_matrix(turned.tocsc()[:, moves])


def _of_groups(law: GapLaw, gaps: Ints, signs: Floats) -> GapLaw:
    """The law of the groups: a group's stiffness is that of all its gaps."""
    count, first = np.bincount(gaps), np.unique(gaps, return_index=True)[1]

    def mean(slip: Floats) -> Floats:
        if not len(slip):
            return slip
        total = np.zeros((len(count), 2))
        np.add.at(total, gaps, signs[:, 1:] * slip)
        return total / count[:, None]

    ends = {name: np.searchsorted(first, (part.start, part.stop)) for name, part in law.joints.items()}
    return replace(
        law,
        K_n=law.K_n[first] * count,
        K_nz=law.K_nz[first],
        K_s=law.K_s[first] * count,
        mu=law.mu[first],
        gap=law.gap[first],
        slip=mean(law.slip),
        slipped=mean(law.slipped),
        joints={name: slice(int(a), int(b)) for name, (a, b) in ends.items()},
    )
