"""The subject of a report, and the names and counts of its sections."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from romdam.core.display_units import unit_text
from romdam.postprocess.hazard import HazardCurve
from romdam.postprocess.responses import each_once, responses
from romdam.results.suite.rows import RunIndex

_WORDS = {
    "peak_mean_compressive_stress": "peak compressive stress, mean of a writing interval",
    "peak_compressive_stress": "peak compressive stress, one instant",
    "peak_compression": "peak compression, one instant",
    "residual_opening": "residual opening of a gap",
    "residual_slip": "residual slip of a gap",
    "residual_sliding": "residual slip of the joint",
}


@dataclass(frozen=True)
class Topic:
    """Choices of what a report is about.

    Attributes
    ----------
    response : of the curves, fragility, correlation and sensitivity; None for the first that the suite has
    intensity : measure that curves and fragility are a function of
    thresholds : of the fragilities, in the response's SI unit; round numbers from the data if empty
    command : how the report was asked for
    hazard : of the intensity, which makes annual frequencies of fragilities; None without
    """

    response: str | None = None
    intensity: str = "sa"
    thresholds: tuple[float, ...] = ()
    command: str = ""
    hazard: HazardCurve | None = None


@dataclass(frozen=True)
class Subject:
    """A summary and what the sections of its report need besides.

    Attributes
    ----------
    summary : of the suite
    topic : what the report is about
    spectra : `psa` (record, period) [m/s2]; None where they are not known
    picture : bytes of a PNG of the scene; None where there is none
    files : place of a run -> (text, address on the page) of its result and figures
    """

    summary: xr.Dataset
    topic: Topic
    spectra: xr.Dataset | None = None
    picture: bytes | None = None
    files: Mapping[RunIndex, Sequence[tuple[str, str]]] = field(default_factory=dict)

    @property
    def response(self) -> str:
        """The response that is looked at."""
        return self.topic.response or next(iter(responses(self.summary)), "")

    @property
    def population(self) -> xr.Dataset:
        """The runs that statistics are of: no motion counts twice."""
        return each_once(self.summary)

    @property
    def done(self) -> int:
        """Runs of `population` that succeeded."""
        return int((self.population.status == 0).sum())

    @property
    def configuration(self) -> dict[str, dict[str, object]]:
        """The validated configuration; empty where the summary has none."""
        return dict(json.loads(str(self.summary.attrs.get("configuration", "{}"))))


def values_of(subject: Subject, name: str, keep: bool = False) -> np.ndarray:
    """Finite numbers of a variable of the runs; those of all runs that are there where `keep`."""
    if name not in subject.summary:
        return np.empty(0)
    values = subject.summary[name].values[subject.summary.status.values == 0]
    return values if keep else values[np.isfinite(values)]


def plain(name: str) -> str:
    """A name as words, which tell a mean from one instant's compression, and a gap from its joint."""
    return _WORDS.get(name, name.replace("_", " "))


def in_unit(values: xr.DataArray) -> str:
    """The unit of a variable in brackets, if it has one."""
    unit = unit_text(str(values.attrs.get("units", "1")))
    return f" [{unit}]" if unit else ""


def runs_text(summary: xr.Dataset) -> str:
    """The number of runs that a statistic is made of, as words."""
    failed = summary.attrs["failed"]
    return f"{summary.attrs['runs']} runs" + (
        f", {failed} failed one{'s' * (failed > 1)} left out" if failed else ""
    )
