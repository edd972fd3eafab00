"""Margins of a dam in its load combinations: one row for each thing that is required, with its verdict.

References
----------
FERC, Engineering Guidelines, chapter 3 (2016), gravity dams: usual, unusual, extreme and post-earthquake
combinations with required factors of safety; USACE, EM 1110-2-2100 (2005), Stability Analysis of Concrete
Structures: the same by the class of the structure.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from romdam.core.scene import MOST_RING
from romdam.postprocess.sliding import sliding
from romdam.postprocess.stability import NOT_FOUND, joint_stability
from romdam.postprocess.stress.faces import HEADLINE

SATISFIED, NOT_SATISFIED, NO_SHEAR = "satisfied", "not satisfied", "no joint carries shear"
SLIDES, UNDECIDED = "slides", "undecided: the ring leaves out most of the face"
_SLIDES = 1e-6  # of a factor, by which a joint that slides may be above 1
Row = tuple[str, ...]
HEAD: Row = (
    "combination", "situation", "record", "of", "criterion", "value", "required", "margin", "verdict",
)  # fmt: skip
_FACTOR, _SLIP, _TENSION = "factor of safety", "slip left [mm]", "tension [MPa]"


@dataclass(frozen=True)
class Margin:
    """One thing that is required in a combination.

    Attributes
    ----------
    combination, situation, record : which
    of : joint, group of joints, or face
    criterion : what is judged, with its unit
    value, required : in that unit; NaN where a joint carries no shear
    margin : value over what is required, or the inverse of what must not be exceeded; satisfied from 1
    failure : why there is no value; empty where there is one
    """

    combination: str
    situation: str
    record: str
    of: str
    criterion: str
    value: float
    required: float
    margin: float
    failure: str = ""

    @property
    def verdict(self) -> str:
        """Whether it is satisfied."""
        return self.failure or (NOT_SATISFIED if self.margin < 1.0 else SATISFIED)

    @property
    def row(self) -> Row:
        """Its row under `HEAD`."""
        numbers = (self.value, self.required, self.margin)
        texts = (f"{value:.4g}" if np.isfinite(value) else "-" for value in numbers)
        named = (self.combination, self.situation, self.record, self.of, self.criterion)
        return (*named, *texts, self.verdict)


@dataclass(frozen=True)
class Requirement:
    """What a combination requires.

    Attributes
    ----------
    combination, situation : names
    factor : least, of safety against sliding; None where it is not judged
    slip, tension : largest [m], [Pa]; None where they are not judged
    joints : that are judged; None for all that carry shear
    """

    combination: str
    situation: str
    factor: float | None
    slip: float | None
    tension: float | None
    joints: Collection[str] | None

    def without_value(self, record: str, failure: str) -> Margin:
        """What stands in place of margins that could not be found, which is not satisfied."""
        return Margin(self.combination, self.situation, record, "all", "-", np.nan, np.nan, 0.0, failure)

    def at_rest(self, dataset: xr.Dataset, record: str) -> list[Margin]:
        """Margins in the first state of a result, which is at rest."""
        margins = list[Margin]()
        if self.factor is not None:
            for joint in joint_stability(dataset, record, self.factor, self.joints):
                margins.append(self._least(record, joint.joint, joint.factor))
        return self._judged([*margins, *self._stress(dataset, record)], record)

    def shaken(self, dataset: xr.Dataset, record: str) -> list[Margin]:
        """Margins in an earthquake, over all written rows and of what it leaves."""
        margins = list[Margin]()
        judged = [one for one in sliding(dataset) if self.joints is None or one.joint in self.joints]
        for joint in judged:
            if self.factor is not None:
                least = self._least(record, joint.joint, joint.factor)
                # a joint that slides has a factor of 1 and no less
                slides = self.factor <= 1.0 and joint.factor <= 1.0 + _SLIDES
                margins.append(replace(least, failure=SLIDES) if slides else least)
            if self.slip is not None:
                left, most = 1e3 * joint.largest_slip, 1e3 * self.slip
                margins.append(self._most(record, joint.joint, _SLIP, left, most))
        return self._judged([*margins, *self._stress(dataset, record)], record)

    def _judged(self, margins: list[Margin], record: str) -> list[Margin]:
        """The margins, and one that is not satisfied where joints are to be judged and none carries shear."""
        of_joints = self.factor is not None or self.slip is not None
        if of_joints and not any(one.criterion in (_FACTOR, _SLIP) for one in margins):
            margins = [*margins, self.without_value(record, NO_SHEAR)]
        return margins

    def _stress(self, dataset: xr.Dataset, record: str) -> list[Margin]:
        if self.tension is None:
            return []
        stress = dataset.face_principal_stress.sel(area_percentile=HEADLINE)
        return [
            self._of_face(record, str(face), float(value), float(ring))
            for face, value, ring in zip(
                stress.stress_face.values, stress.values, dataset.ring_share.values, strict=True
            )
        ]

    def _of_face(self, record: str, face: str, value: float, ring: float) -> Margin:
        """Of a face's stress [Pa]; met where the ring leaves out most of it [%], it is undecided."""
        assert self.tension is not None
        margin = self._most(record, face, _TENSION, 1e-6 * value, 1e-6 * self.tension)
        is_undecided = ring > 100.0 * MOST_RING and margin.verdict == SATISFIED
        return replace(margin, failure=UNDECIDED) if is_undecided else margin

    def _least(self, record: str, of: str, factor: float) -> Margin:
        assert self.factor is not None
        margin = np.inf if np.isnan(factor) else factor / self.factor
        return Margin(self.combination, self.situation, record, of, _FACTOR, factor, self.factor, margin)

    def _most(self, record: str, of: str, criterion: str, value: float, limit: float) -> Margin:
        named = (self.combination, self.situation, record, of, criterion)
        if np.isnan(value):  # such as of a face that the ring leaves out
            return Margin(*named, value, limit, 0.0, NOT_FOUND)
        return Margin(*named, value, limit, limit / value if value > 0.0 else np.inf)
