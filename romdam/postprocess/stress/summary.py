"""Stress over time at the nodes asked for: envelopes, fields at the worst step, durations above the strength.

The stress of a node is linear in the reduced coordinates, sigma(t) = S q(t) + sigma_0. Histories are rebuilt
for some nodes at a time and summarised at once, so that whole histories of many nodes are never held. Fields
at the worst steps are rebuilt afterwards, because the steps are known only then.

Principal stresses follow in closed form, with s the deviator of sigma (`principal_stresses`):

    sigma_k = m + 2 r cos(theta + 2 pi k / 3),   k = 0, 2, 1 from major to minor,
    m = tr(sigma) / 3,   r^2 = s : s / 6,   cos(3 theta) = det s / (2 r^3).

With theta from 0 to pi / 3 the major one lies between m + r and m + 2 r, and the minor one between m - 2 r
and m - r. These bounds cost much less than the arc cosine, and mostly they are enough (`outer_histories`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.scene import StressNodes, StressSites
from romdam.core.threads import side_by_side

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))  # row and column of each component in the tensor
MEASURES = ("principal", "vertical", "arch")
DCR_LEVELS = np.round(np.arange(1.0, 2.01, 0.1), 1)  # ratios of demand to capacity (the tensile strength)
_TENSORS = 1 << 16  # at a time: their 3 MB and intermediate results stay in a processor's cache


@dataclass(frozen=True)
class StressHistory:
    """Stress of nodes over time, rebuilt where it is asked for.

    Attributes
    ----------
    fields : block -> (k, 6, m) stress at its nodes in a unit of each reduced coordinate; empty at full order
    coordinates : block -> (nt, m) its reduced coordinates; at full order (nt, 6 k) the stress itself [Pa]
    offset : block -> (k, 6) stress without displacement (of held-back thermal expansion) [Pa]
    sections : (nt, sections, 6) forces along and moments about the axes of named sections [N], [N m]
    """

    fields: Mapping[str, Floats]
    coordinates: Mapping[str, Floats]
    offset: Mapping[str, Floats] = field(default_factory=dict)
    sections: Floats = field(default_factory=lambda: np.zeros((0, 0, 6)))

    @classmethod
    def observed(cls, stress: Floats, nodes: Mapping[str, int], offset: Mapping[str, Floats]) -> Self:
        """History of stress that was observed itself (at full order), without sections.

        Parameters
        ----------
        stress : (nt, 6 k) block after block [Pa]
        nodes : block -> how many of the k nodes are its own
        offset : see the class
        """
        stops = np.cumsum([6 * count for count in nodes.values()])[:-1]
        return cls({}, dict(zip(nodes, np.split(stress, stops, axis=1), strict=True)), offset)

    def at(self, block: str, rows: slice, times: slice = slice(None)) -> Floats:
        """Stress (nt, rows, 6) [Pa], tension positive, components xx yy zz xy yz xz.

        In memory the history of a component is contiguous (it is a view of (rows, 6, nt)): what goes along it
        is quicker, and BLAS by half, than the other way.
        """
        q = self.coordinates[block][times]
        if block in self.fields:
            stress_modes = self.fields[block][rows]
            stress = (stress_modes.reshape(6 * len(stress_modes), stress_modes.shape[2]) @ q.T).reshape(
                -1, 6, len(q)
            )
        else:
            stress = np.array(q.reshape(len(q), -1, 6)[:, rows].transpose(1, 2, 0), order="C")
        if block in self.offset:
            stress += self.offset[block][rows][:, :, None]
        return stress.transpose(2, 0, 1)


@dataclass(frozen=True)
class StressSummary:
    """Summary of the stress histories; the k nodes are those of the sites' blocks, one after another.

    Measures are "principal" (the largest of the major one, the smallest of the minor one), "vertical" and
    "arch", normal stresses along `StressNodes.up` and `arch`.

    Attributes
    ----------
    largest, smallest : measure -> (k,) over the written times [Pa]
    time_of_largest : measure -> (k,) [s]
    worst_time : measure -> time at which it is largest anywhere outside the ring of `StressNodes` [s]
    at_worst : measure -> (k,) field at that time [Pa]
    tensor : (k, 6) at the worst time of the major principal stress [Pa]
    duration : (k, levels) total time of major principal stress above DCR_LEVELS x strength [s]; None without
        a strength
    at_start : (k,) major principal stress at the first time, of the loads at rest [Pa]
    change : (k,) largest major principal stress of the tensor less that at the first time [Pa]; None without
        a strength
    duration_of_change : as `duration`, of that
    probes : (nt, p, 6) histories of the named nodes [Pa]
    probe_axes : (p, 2, 3) cantilever and arch direction of the named nodes
    sections : (nt, sections, 6) forces along and moments about the axes of named sections [N], [N m]
    """

    largest: dict[str, Floats]
    smallest: dict[str, Floats]
    time_of_largest: dict[str, Floats]
    worst_time: dict[str, float]
    at_worst: dict[str, Floats]
    tensor: Floats
    duration: Floats | None
    at_start: Floats
    change: Floats | None
    duration_of_change: Floats | None
    probes: Floats
    probe_axes: Floats
    sections: Floats


def principal_stresses(stress: Floats) -> Floats:
    """Principal stresses (..., 3), largest first, of (..., 6) components xx yy zz xy yz xz.

    Closed form of the characteristic cubic; two nearly equal ones are good to 1e-8 of the largest.

    References
    ----------
    Smith, Commun. ACM 4 (1961) 168.
    """
    mean, size = _deviator(stress)
    first, third = _outer(stress, mean, size)
    return np.stack([first, 3.0 * mean - first - third, third], axis=-1)


def _deviator(stress: Floats) -> tuple[Floats, Floats]:
    """Mean m, and size r of the deviator."""
    xx, yy, zz, xy, yz, xz = np.moveaxis(stress, -1, 0)
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    return mean, np.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + yz * yz + xz * xz)) / 6.0)


def _outer(stress: Floats, mean: Floats, size: Floats) -> tuple[Floats, Floats]:
    """Major and minor principal stress, by mean m and size r of the deviator."""
    xx, yy, zz, xy, yz, xz = np.moveaxis(stress, -1, 0)
    a, b, c = xx - mean, yy - mean, zz - mean
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    cube = 2.0 * size**3
    ratio = np.divide(determinant, cube, out=np.zeros_like(cube), where=cube > 0.0)
    angle = np.arccos(np.clip(ratio, -1.0, 1.0)) / 3.0
    first = mean + 2.0 * size * np.cos(angle)
    return first, mean + 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)


def outer_histories(stress: Floats, level: float = np.inf) -> tuple[Floats, Floats]:
    """Major and minor principal stress (nt, k) of histories (nt, k, 6) where they matter, bounds elsewhere.

    They are exact where they may be the largest and the smallest of their history, at both ends of intervals
    that may exceed a level, and at the first time. Elsewhere m + r stands for the major one, which is never
    less, and m - r for the minor one, which is never more: at 9 of 10 times on an arch dam's faces, which
    takes half the time.
    """
    mean, size = _deviator(stress)
    major, minor, most, least = mean + size, mean - size, mean + 2.0 * size, mean - 2.0 * size
    needed, exceeding = (most >= major.max(axis=0)) | (least <= minor.min(axis=0)), most > level
    needed[:1] = True
    needed |= exceeding
    needed[1:] |= exceeding[:-1]
    needed[:-1] |= exceeding[1:]
    nodes, times = np.nonzero(needed.T)  # node by node, because their histories are contiguous
    where = times, nodes
    major[where], minor[where] = _outer(stress[where], mean[where], size[where])
    return major, minor


def stress_along(stress: Floats, direction: Floats) -> Floats:
    """Normal stress d . s d (...) along unit vectors (..., 3)."""
    weights = np.stack(
        [direction[..., k] * direction[..., l] * (1.0 if k == l else 2.0) for k, l in _PAIRS], axis=-1
    )
    return np.asarray(np.einsum("...k,...k->...", stress, weights))


def duration_above(stress: Floats, level: float, dt: float) -> Floats:
    """Total time (k,) that histories (nt, k), linear between samples, spend above a level [s].

    References
    ----------
    USACE EM 1110-2-6051 (2003) and EM 1110-2-6053 (2007): cumulative inelastic duration of stress excursions.
    """
    over = stress - level
    return np.asarray(_seconds_above(over[:-1], over[1:], dt).sum(axis=0))


def _seconds_above(start: Floats, end: Floats, dt: float) -> Floats:
    """Time that intervals spend above zero, linear from their start to their end [s]."""
    size, above = np.abs(start) + np.abs(end), np.maximum(start, 0.0) + np.maximum(end, 0.0)
    return np.asarray(dt * np.divide(above, size, out=np.zeros_like(size), where=size > 0.0))


def _durations(stress: Floats, levels: Floats, dt: float) -> Floats:
    """Durations (k, levels) of histories (nt, k) above ascending levels [s].

    Few intervals exceed any level: only these are kept, and fewer of them from level to level.
    """
    over = stress > levels[0]
    nodes, times = np.nonzero((over[:-1] | over[1:]).T)
    ends, totals = np.stack([stress[times, nodes], stress[times + 1, nodes]]), []
    for level in levels:
        exceeding = (ends > level).any(axis=0)
        nodes, ends = nodes[exceeding], ends[:, exceeding]
        seconds = _seconds_above(ends[0] - level, ends[1] - level, dt)
        total = np.bincount(nodes, seconds, minlength=stress.shape[1])
        totals.append(total.astype(np.float64))  # NumPy counts nothing in integers
    return np.stack(totals, axis=1)


def summarise(sites: StressSites, history: StressHistory, time: Floats) -> StressSummary:
    """Summarise the histories of all nodes, and rebuild the fields at the worst steps.

    Parameters
    ----------
    time : (nt,) equidistant [s]
    """
    dt = float(time[1] - time[0]) if len(time) > 1 else 0.0
    # some nodes of a block at a time
    at_once = max(1, _TENSORS // len(time))
    chunks = [
        (name, slice(first, min(first + at_once, len(nodes.nodes))))
        for name, nodes in sites.blocks.items()
        for first in range(0, max(len(nodes.nodes), 1), at_once)  # a block may have sections alone
    ]
    summaries = list(
        side_by_side(partial(_of_nodes, sites, history, name, rows, dt) for name, rows in chunks)
    )
    joined = {key: np.concatenate([summary[key] for summary in summaries]) for key in summaries[0]}
    # the step at which a measure is largest outside the ring; anywhere, where all nodes lie in it
    counted = np.concatenate([nodes.counted for nodes in sites.blocks.values()])
    worst = {}
    for m in MEASURES:
        # NaN where a node has no arch direction
        largest = np.nan_to_num(np.asarray(joined[f"largest {m}"], dtype=float), nan=-np.inf)
        outside = np.where(counted, largest, -np.inf) if counted.any() else largest
        worst[m] = int(joined[f"step {m}"][int(outside.argmax())]) if len(outside) else 0
    fields = {m: _at_step(sites, history, step) for m, step in worst.items()}
    probes = [history.at(block, slice(row, row + 1)) for block, row in sites.probes.values()]
    probe_axes = [
        (sites.blocks[block].up[row], sites.blocks[block].arch[row]) for block, row in sites.probes.values()
    ]
    return StressSummary(
        largest={m: joined[f"largest {m}"] for m in MEASURES},
        smallest={m: joined[f"smallest {m}"] for m in MEASURES},
        time_of_largest={m: time[joined[f"step {m}"]] for m in MEASURES},
        worst_time={m: float(time[step]) for m, step in worst.items()},
        at_worst={m: fields[m][m] for m in MEASURES},
        tensor=fields["principal"]["tensor"],
        duration=joined.get("duration"),
        at_start=joined["at start"],
        change=joined.get("change"),
        duration_of_change=joined.get("duration of change"),
        probes=np.concatenate([np.zeros((len(time), 0, 6)), *probes], axis=1),
        probe_axes=np.array(probe_axes, dtype=float).reshape(-1, 2, 3),
        sections=history.sections,
    )


def _of_nodes(
    sites: StressSites, history: StressHistory, name: str, rows: slice, dt: float
) -> dict[str, NDArray[np.generic]]:
    """Summarise the histories of some nodes of a block; each array has a row for every node."""
    stress, strength = history.at(name, rows), np.inf if sites.strength is None else sites.strength
    measures = _measures(stress, sites.blocks[name], rows, strength)
    major = measures["principal"][0]
    summary: dict[str, NDArray[np.generic]] = {"at start": major[0]}
    for measure, (upper, lower) in measures.items():
        step = upper.argmax(axis=0)
        summary[f"step {measure}"] = step
        summary[f"largest {measure}"] = np.take_along_axis(upper, step[None], axis=0)[0]
        summary[f"smallest {measure}"] = lower.min(axis=0)
    if sites.strength is not None:
        change, _ = outer_histories(stress - stress[0], sites.strength)
        levels = DCR_LEVELS * sites.strength
        summary["duration"] = _durations(major, levels, dt)
        summary["duration of change"] = _durations(change, levels, dt)
        summary["change"] = change.max(axis=0)
    return summary


def _measures(
    stress: Floats, nodes: StressNodes, rows: slice, strength: float = np.inf
) -> dict[str, tuple[Floats, Floats]]:
    """Measure -> its histories for the largest and for the smallest value, (nt, rows) each.

    Those of the principal stresses hold bounds where nothing depends on them, see `outer_histories`.
    """
    vertical, arch = (stress_along(stress, axes[rows]) for axes in (nodes.up, nodes.arch))
    return {
        "principal": outer_histories(stress, strength),
        "vertical": (vertical, vertical),
        "arch": (arch, arch),
    }


def _at_step(sites: StressSites, history: StressHistory, step: int) -> dict[str, Floats]:
    """Every measure, and the tensor, of all nodes at one step."""
    values: dict[str, list[Floats]] = {name: [] for name in (*MEASURES, "tensor")}
    for name, nodes in sites.blocks.items():
        rows = slice(0, len(nodes.nodes))
        stress = history.at(name, rows, slice(step, step + 1))
        for measure, (upper, _) in _measures(stress, nodes, rows).items():
            values[measure].append(upper[0])
        values["tensor"].append(stress[0])
    return {name: np.concatenate(of_blocks) for name, of_blocks in values.items()}
