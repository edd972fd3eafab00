"""Measures and spectra of the records of a suite, and what they are called."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import RecordError
from romdam.core.motion import GroundMotion
from romdam.records.components import measures, peak, spectrum
from romdam.records.measures import arias_history
from romdam.records.processing.offset import doubt_drift
from romdam.records.processing.resampling import cut_or_extended
from romdam.records.processing.sequence import SEQUENCE, members_of, sequence_text
from romdam.records.spectra import pseudo_acceleration

PERIODS = np.geomspace(0.01, 10.0, 100)
# name -> unit, long name
MEASURES = {
    "pga": ("m s-2", "peak ground acceleration"),
    "pgv": ("m s-1", "peak ground velocity"),
    "pgd": ("m", "peak ground displacement"),
    "arias": ("m s-1", "Arias intensity"),
    "cav": ("m s-1", "cumulative absolute velocity"),
    "d5_75": ("s", "significant duration, 5 to 75 % of Arias intensity"),
    "d5_95": ("s", "significant duration, 5 to 95 % of Arias intensity"),
    "duration": ("s", "time of the last sample, pads included"),
    "dt": ("s", "sampling interval"),
}
# how a measure grows with the scale of the record; the others do not change
_POWER = {"pga": 1, "pgv": 1, "pgd": 1, "cav": 1, "sa": 1, "arias": 2}


def analysed(motion: GroundMotion, duration: float | None) -> GroundMotion:
    """The motion that a run sees: cut to a duration, or followed by rest up to it; None for all of it [s]."""
    if duration is None:
        return motion
    return replace(motion, acc=cut_or_extended(motion.acc, round(duration / motion.dt) + 1))


def analysed_share(motion: GroundMotion, duration: float | None) -> tuple[float, float]:
    """Measure what a run sees of a motion: its peak, and its Arias intensity, as shares of the whole.

    The intensity is summed over the components. Both are 1 where nothing but rest is cut, and for a motion
    that is none.
    """
    shortened = analysed(motion, duration)
    whole = float(arias_history(motion.acc, motion.dt)[..., -1].sum())
    if whole <= 0.0:
        return 1.0, 1.0
    return shortened.peak / motion.peak, float(arias_history(shortened.acc, motion.dt)[..., -1].sum()) / whole


def peak_time(motion: GroundMotion) -> float:
    """Time of the largest acceleration of a component [s]."""
    return float(motion.time[np.abs(motion.acc).max(axis=0).argmax()])


def peak_text(attrs: Mapping[str, Any]) -> str:
    """The peak acceleration of what a result analysed, and that of the whole record where it is another."""
    whole = float(attrs["record_peak_acceleration"])
    analysed_peak = float(attrs.get("analysed_peak_acceleration", whole))
    rest = "" if analysed_peak == whole else f" of what was analysed, {whole:.3g} m/s² of the whole record"
    return f"{analysed_peak:.3g} m/s²{rest}"


def sequence_of(attrs: Mapping[str, Any]) -> str:
    """The records of the sequence that a result is of, and when they start; empty where it is of one."""
    try:
        members = json.loads(str(attrs.get("record_provenance", "{}")))[SEQUENCE]
        return sequence_text([{"record": m["record"], "start": float(m["start"])} for m in members])
    except (ValueError, TypeError, KeyError):  # none, or another program has changed the attribute
        return ""


def earlier_records(motion: GroundMotion | None) -> list[str]:
    """Names of the records before the last one of a sequence."""
    return [] if motion is None else [str(member["record"]) for member in members_of(motion)[:-1]]


def stated_warnings(attrs: Mapping[str, Any]) -> list[str]:
    """What a result warns of, of its run, its configuration and its record."""
    names = ("run_warnings", "configuration_doubts", "record_warnings")
    lists = (json.loads(str(attrs.get(name, "[]"))) for name in names)
    return [str(text) for texts in lists for text in texts]


def measures_at_scales(
    motion: GroundMotion | None, factors: Floats, period: float, of: str = "largest"
) -> dict[str, Floats]:
    """Measures of a record, and its PSa at a period, at every scale.

    Parameters
    ----------
    motion : before it is scaled; None gives NaN
    factors : (scales,) what it is multiplied by
    period : of the PSa at 5 % damping [s]
    of : what of the components they are of
    """
    if motion is None:
        return {name: np.full(len(factors), np.nan) for name in (*MEASURES, "sa")}
    values = measures(motion.acc, motion.dt, of)
    values["sa"] = float(spectrum(motion.acc, motion.dt, np.array([period]), 0.05, of)[0])
    return {name: values[name] * factors ** _POWER.get(name, 0) for name in (*MEASURES, "sa")}


def intensity(motion: GroundMotion, period: float | None, damping: float, of: str) -> float:
    """PSa at a period of a record, PGA where there is none [m/s2].

    Raises
    ------
    RecordError
        where the components are not there that `of` needs, and for a record that drifts.
    """
    if drifts := doubt_drift(motion.acc, motion.dt):
        raise RecordError(drifts)
    if period is None:
        return peak(motion.acc, of)
    return float(spectrum(motion.acc, motion.dt, np.array([period]), damping, of)[0])


def largest_psa(motion: GroundMotion | None, periods: Floats, damping: float) -> Floats:
    """PSa of the largest component, (periods,) [m/s2]; NaN without a motion."""
    if motion is None:
        return np.full(len(periods), np.nan)
    return np.asarray(pseudo_acceleration(motion.acc, motion.dt, periods, damping).max(axis=0))
