"""Stress of whole faces: percentiles by area, and acceptance after the manuals of the USACE.

Acceptance is that of linear analysis: EM 1110-2-6053 (2007), chapter 4, which goes back to Ghanaat, Failure
modes approach to safety evaluation of dams, 13th World Conf. Earthquake Eng. (2004), paper 1115. Tensile
stress may exceed the static tensile strength of the concrete as long as demand over capacity stays at most 2,
the cumulative inelastic duration of every demand-capacity ratio stays below a line from a limit at 1 to none
at 2, and the overstressed share of the surface stays below another limit. Both limits are here as later
papers quote the manual; its text was not at hand. Its share for gravity dams is of the cross section; here it
is of the face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from romdam.core.arrays import Floats, Ints

PERCENTILES = np.array([50.0, 90.0, 95.0, 98.0, 99.0, 100.0])  # of the area; the last is the maximum
HEADLINE = 98.0
BASES = ("total", "change")
CRITERIA = ("ratio", "duration", "area")
LARGEST_RATIO = 2.0
# a criterion: of a face that the ring covers, of one that it mostly covers, and of one that is judged
NOT_JUDGED, UNDECIDED, MISSED, MET = -2, -1, 0, 1


@dataclass(frozen=True)
class StressLimits:
    """Limits of a kind of dam: `duration` at a demand-capacity ratio of 1 [s], `area` [%] of the face."""

    duration: float
    area: float

    def duration_at(self, ratio: Floats) -> Floats:
        """Duration that a demand-capacity ratio may last [s]: linear, none from `LARGEST_RATIO` on."""
        return np.asarray(self.duration * np.clip(LARGEST_RATIO - ratio, 0.0, 1.0))

    def __str__(self) -> str:
        return (
            f"ratio at most {LARGEST_RATIO:g}, duration at most {self.duration:g} s at a ratio of 1 falling "
            f"to 0 s at {LARGEST_RATIO:g}, area at most {self.area:g} %"
        )


LIMITS = {"arch dam": StressLimits(0.4, 20.0), "gravity dam": StressLimits(0.3, 15.0)}


def area_percentiles(values: Floats, area: Floats, percent: Floats) -> Floats:
    """Smallest values that so many percent of an area do not exceed.

    Parameters
    ----------
    values : (k,) NaN where there is none
    area : (k,) tributary areas [m2]
    percent : (p,) 100 gives the largest value

    Returns
    -------
    (p,) NaN where there is no value
    """
    there = np.isfinite(values) & (area > 0.0)
    if not there.any():
        return np.full(len(percent), np.nan)
    order = np.argsort(values[there])
    share = np.cumsum(area[there][order])
    at = np.searchsorted(share, (1.0 - 1e-12) * share[-1] * percent / 100.0)
    return np.asarray(values[there][order][at])


@dataclass(frozen=True)
class FaceDemand:
    """Demand on a face's nodes outside the ring, where levels are demand-capacity ratios.

    Attributes
    ----------
    ratio : largest demand-capacity ratio; NaN where the ring covers the face
    duration : (levels,) longest cumulative duration above each level at any node [s]
    share : (levels,) of the area outside the ring where each level is exceeded at some time [%]
    """

    ratio: float
    duration: Floats
    share: Floats

    def judged(self, levels: Floats, limits: StressLimits) -> tuple[int, ...]:
        """MET or MISSED for each of CRITERIA; NOT_JUDGED where the ring covers the face."""
        if np.isnan(self.ratio):
            return (NOT_JUDGED,) * len(CRITERIA)
        met = (
            self.ratio <= LARGEST_RATIO,
            (self.duration <= limits.duration_at(levels)).all(),
            self.share[0] <= limits.area,
        )
        return tuple(MET if criterion else MISSED for criterion in met)


def face_demand(ratio: Floats, duration: Floats, area: Floats, levels: Floats) -> FaceDemand:
    """The demand on a face from its nodes outside the ring.

    Parameters
    ----------
    ratio : (k,) largest demand-capacity ratios
    duration : (k, levels) [s]
    area : (k,) [m2]
    """
    if not len(ratio):
        nothing = np.full(len(levels), np.nan)
        return FaceDemand(np.nan, nothing, nothing)
    share = 100.0 * area @ (ratio[:, None] > levels) / area.sum()
    return FaceDemand(float(ratio.max()), duration.max(axis=0), share)


def verdict(met: Sequence[int] | Ints) -> str:
    """Say whether a face passes, by which criteria it does not, or that it was not judged."""
    if NOT_JUDGED in list(met):
        return "not judged: all of it is in the ring"
    missed = [name for name, criterion in zip(CRITERIA, met, strict=True) if criterion == MISSED]
    if missed:
        return f"fails: {', '.join(missed)}"
    return "undecided: most of it is in the ring" if UNDECIDED in list(met) else "passes"
