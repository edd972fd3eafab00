"""Two results side by side on one clock: L2, peaks and phase of every joint and every displacement.

The clock is equally spaced at the larger of the two writing intervals over the time that both results have,
and begins at a row of the one that is written more sparsely; both are interpolated linearly to it. L2 and
peaks are those of `romdam.error.metrics`, relative to the second result. The phase is the shift in time at
which the two correlate best (parabola through the three best samples), positive where the first is late;
a component of a node that is at rest beside its others has none, since that is round-off.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping

import numpy as np
import xarray as xr
from scipy.signal import correlate

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ResultError
from romdam.error.alignment import at_times, coinciding, common_clock
from romdam.error.histories import ComparedHistories, HistoryKey
from romdam.error.metrics import magnitude_error, opening_error

log = logging.getLogger(__name__)

_SHIFT = 0.1  # of the compared time: what is farther apart is another motion
_REST = 1e-6  # of a node's largest displacement: a component that does less is at rest
_OVER = ("quantity", "variant", "time")
_VARIABLES = {  # number of dimensions of _OVER, unit, meaning
    "history": (3, "m", "opening of the widest gap, or displacement relative to the base"),
    "peak": (2, "m", "largest opening, or largest displacement in magnitude"),
    "places": (1, "1", "gaps or components that are compared"),
    "l2_difference": (1, "1", "L2 of the difference over that of the second result"),
    "peak_difference": (1, "1", "difference of the largest values over that of the second result"),
    "phase": (1, "s", "by how much the first result is late"),
}


def side_by_side(first: ComparedHistories, second: ComparedHistories, names: tuple[str, str]) -> xr.Dataset:
    """Compare two results.

    Parameters
    ----------
    names : of the two

    Returns
    -------
    Dataset over `variant` (the two), `quantity` and `time` [s] with what `_VARIABLES` says

    Raises
    ------
    ResultError
        where they have no place, or too little time, in common.
    """
    second = _with_gaps_of(first, second)
    common = [key for key in first.series if key in second.series]
    if not common:
        raise ResultError(
            f"{names[0]} and {names[1]} have no gap, joint or node in common; gaps are known by position "
            "(within 1 mm) or number, joints and nodes by name"
        )
    time = common_clock(first.time, second.time, names)
    quantities = _quantities(common, {**second.joint, **first.joint})
    rows = [_measures(first, second, places, time) for places in quantities.values()]
    tables = {
        name: (_OVER[:count], np.array(values), {"units": unit, "long_name": text})
        for (name, (count, unit, text)), values in zip(
            _VARIABLES.items(), zip(*rows, strict=True), strict=True
        )
    }
    return xr.Dataset(tables, {"time": time, "variant": list(names), "quantity": list(quantities)})


def _measures(
    first: ComparedHistories, second: ComparedHistories, places: list[HistoryKey], time: Floats
) -> tuple[object, ...]:
    """Values that are stated of one quantity, in the order of `_VARIABLES`."""
    pair, opens = (_at(first, places, time), _at(second, places, time)), places[0][0] != "node"
    node = places[0][:2]  # all components of its displacement are the size that one is measured by
    reference = None if opens else _at(second, [key for key in second.series if key[:2] == node], time)
    error = opening_error(*pair) if reference is None else magnitude_error(*pair, reference)
    widest = [values.max(axis=1) for values in pair]
    peaks = [float((values if opens else np.abs(values)).max()) for values in pair]
    rests = reference is not None and min(peaks) < _REST * np.abs(reference).max()
    late = float("nan") if rests else phase(*pair, float(time[1] - time[0]))
    return widest, peaks, len(places), error.l2, error.peak, late


def phase(first: Floats, second: Floats, interval: float) -> float:
    """By how much the first of two histories (nt, places) is late, in the unit of `interval`; NaN at rest."""
    pair = [history - history.mean(axis=0) for history in (first, second)]
    if not all(history.any() for history in pair):
        return float("nan")
    lag = np.arange(-int(_SHIFT * len(first)), int(_SHIFT * len(first)) + 1)
    best = _correlation(pair[0], pair[1], lag)
    k = int(best.argmax())
    within = 0.0
    if 0 < k < len(lag) - 1:
        before, here, after = best[k - 1 : k + 2]
        within = 0.5 * (before - after) / (before - 2.0 * here + after)
    return float(interval * (lag[k] + within))


def _correlation(first: Floats, second: Floats, lag: Ints) -> Floats:
    """Of first(t + lag) and second(t) where both are, over their sizes there, which favours no lag."""
    count, later, earlier = len(first), np.maximum(lag, 0), np.maximum(-lag, 0)
    product = np.zeros(2 * count - 1)
    for history, other in zip(first.T, second.T, strict=True):
        product += correlate(history, other, method="fft")
    size = [np.concatenate([[0.0], np.cumsum((history**2).sum(axis=1))]) for history in (first, second)]
    sizes = (size[0][count - earlier] - size[0][later]) * (size[1][count - later] - size[1][earlier])
    return np.asarray(product[count - 1 + lag] / np.sqrt(np.maximum(sizes, np.finfo(float).tiny)))


def _quantities(places: list[HistoryKey], joint: Mapping[HistoryKey, str]) -> dict[str, list[HistoryKey]]:
    """Words -> places: gaps joint by joint, else the widest of a joint; displacements axis by axis."""
    keys: dict[str, list[HistoryKey]] = {}
    for key in (key for key in places if key[0] == "gap"):
        keys.setdefault(f"opening of {joint.get(key, 'all gaps')}", []).append(key)
    for key in (key for key in places if key[0] == "joint"):
        if f"opening of {key[1]}" not in keys:
            keys[f"widest opening of {key[1]}"] = [key]
    for key in (key for key in places if key[0] == "node"):
        keys[f"displacement {key[2]} of {key[1]}"] = [key]
    return keys


def _with_gaps_of(first: ComparedHistories, second: ComparedHistories) -> ComparedHistories:
    """The second result with its gaps named as those of the first at the same positions."""
    if not first.position or not second.position:
        return second
    names, others = list(first.position), list(second.position)
    rows, pairs = coinciding(*(np.array([*result.position.values()]) for result in (first, second)))
    if len(rows) < max(len(names), len(others)):
        log.warning("%d gaps are at one place, of %d and %d", len(rows), len(names), len(others))
    renamed = {others[b]: names[a] for a, b in zip(rows, pairs, strict=True)}
    series = {key: values for key, values in second.series.items() if key[0] != "gap"}
    series |= {name: second.series[other] for other, name in renamed.items()}
    joint = {name: second.joint[other] for other, name in renamed.items() if other in second.joint}
    return ComparedHistories(second.time, series, {}, joint)


def _at(histories: ComparedHistories, places: list[HistoryKey], time: Floats) -> Floats:
    return at_times(time, histories.time, np.column_stack([histories.series[key] for key in places]))
