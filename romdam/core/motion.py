"""The ground motion that every later stage sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import RecordError, quote
from romdam.core.fingerprint import fingerprint
from romdam.core.html.card import card

if TYPE_CHECKING:
    import xarray as xr

AXES = ("x", "y", "z")


class Motion(StrEnum):
    """Motions that loads follow; what moves against the base does so in its own rows, x, y, z each."""

    BASE = "acceleration of the base"
    BASE_VELOCITY = "velocity of the base"
    SUPPORTS = "acceleration of supports against the base"
    SUPPORTS_VELOCITY = "velocity of supports against the base"
    SUPPORTS_DISPLACEMENT = "displacement of supports against the base"
    CHANNEL = "waves of a channel's sections"
    CHANNEL_RATE = "rate of the waves of a channel's sections"
    FREE_FIELD = "motion of a column of rock against its surface, and its rate times beta"
    FREE_FIELD_RATE = "rate of that motion"
    FREE_FIELD_TRACTION = "traction on the lower end of a column of rock"


MOST_SAMPLES = 20_000_000  # of a motion: 5 hours at 1 ms, 500 MB for its three components


@dataclass(frozen=True)
class GroundMotion:
    """Ground acceleration in the model's axes, SI.

    `from_arrays` makes one from your own arrays and checks them; `romdam.read_motions` reads those of a job.

    Attributes
    ----------
    name : identifier, unique in a suite; the result file's stem
    acc : (3, nt) ground acceleration along x, y, z [m/s2]; a component that is not given is zero
    dt : sampling interval [s]
    provenance : source file, SHA-256, station, event, unit, what was done to it; plain JSON values
    warnings : what a careful reader should know, one sentence each
    """

    name: str
    acc: NDArray[np.float64]
    dt: float
    provenance: dict[str, object] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @classmethod
    def from_arrays(
        cls, name: str, acc: ArrayLike | Mapping[str, ArrayLike], dt: float, *, place: str = "arrays"
    ) -> Self:
        """Make a ground motion from arrays.

        Parameters
        ----------
        name : of the motion; the result's
        acc : (3, nt) ground acceleration along x, y, z; or name of the axis -> (nt,), those not named are
            zero [m/s2]
        dt : sampling interval [s]
        place : names it in errors, and in the results' account of where their record is from

        Raises
        ------
        RecordError
            for another shape, values that are not finite, fewer than two samples or too many, and a step that
            is not above zero.
        """
        if not isinstance(name, str) or not name:
            raise RecordError(f"{place}: a motion's name is text, got {quote(name)}")
        where = f"{place}, {name}"
        if isinstance(acc, Mapping):
            if not acc or any(name not in AXES for name in acc):
                raise RecordError(f"{where}: acc has components {quote(list(acc))}, known are x, y and z")
            components = {axis: _numbers(acc[axis], f"{where}, component {axis}") for axis in acc}
            shapes = {axis: component.shape for axis, component in components.items()}
            first = next(iter(shapes.values()))
            if len(first) != 1 or any(shape != first for shape in shapes.values()):
                raise RecordError(f"{where}: components must be (nt,) and equally long, got {quote(shapes)}")
            values = np.array([components.get(axis, np.zeros(first)) for axis in AXES])
        else:
            values = _numbers(acc, where)
        if values.ndim != 2 or len(values) != len(AXES):
            raise RecordError(
                f"{where}: acc has shape {values.shape}, wanted (3, nt) of x, y and z; one component alone "
                'is {"x": acc}'
            )
        count, step = values.shape[1], _numbers(dt, f"{where}, dt")
        if not 2 <= count <= MOST_SAMPLES:
            raise RecordError(f"{where}: has {count} samples, must have 2 to {MOST_SAMPLES}")
        if step.ndim or not step > 0.0 or not np.isfinite(step):
            raise RecordError(f"{where}: dt must be a time above 0 in seconds, got {quote(dt)}")
        if not np.all(np.isfinite(values)):
            axis, sample = np.argwhere(~np.isfinite(values))[0]
            raise RecordError(
                f"{where}: component {AXES[axis]} is {values[axis, sample]} at sample {sample}; fill it"
            )
        motion = cls(name, values, float(step))
        motion.provenance.update({"place": place} | motion.provenance_of_arrays)
        return motion

    @property
    def provenance_of_arrays(self) -> dict[str, object]:
        """Account of samples that were arrays in Python, whatever they had been before."""
        return {"given": "as arrays in Python, m/s2", "acceleration_sha256": self.digest}

    @property
    def entry_factors(self) -> Floats:
        """(3,) what `scale`, and a target, of the record's entry multiply x, y and z by, before matching."""
        scale, target = self.provenance.get("scale", 1.0), self.provenance.get("target")
        factor = target.get("factor", 1.0) if isinstance(target, dict) else 1.0
        return np.broadcast_to(np.asarray(scale, dtype=float) * factor, len(AXES)).copy()

    @property
    def is_matched(self) -> bool:
        """Whether its spectrum was matched to a target, by more than a factor."""
        target = self.provenance.get("target")
        return isinstance(target, dict) and "matched" in target

    @property
    def digest(self) -> str:
        """SHA-256 of the samples and their interval: of what is run, wherever it was read from."""
        return fingerprint((self.acc, self.dt))

    def to_xarray(self) -> xr.DataArray:
        """The acceleration as a DataArray over component (x, y, z) and time [m/s2]."""
        import xarray as xr

        about = {"units": "m s-2", "long_name": "ground acceleration"}
        seconds = ("time", self.time, {"units": "s", "long_name": "time"})
        coordinates = {"component": list(AXES), "time": seconds}
        return xr.DataArray(self.acc, coordinates, ("component", "time"), self.name, about)

    def __repr__(self) -> str:
        return (
            f"GroundMotion({self.name!r}, {self.acc.shape[1]} samples of {self.dt:g} s, "
            f"peak {self.peak:.3g} m/s2)"
        )

    def _repr_html_(self) -> str:
        peaks = np.abs(self.acc).max(axis=1)
        rows = {
            "duration": f"{self.duration:.4g} s, {self.acc.shape[1]} samples of {self.dt:g} s",
            "peaks": ", ".join(f"{axis} {peak:.3g} m/s²" for axis, peak in zip(AXES, peaks, strict=True)),
            "from": str(self.provenance.get("place", "")),
            "warnings": "; ".join(self.warnings),
        }
        return card(self.name, "GroundMotion", rows)

    @property
    def time(self) -> NDArray[np.float64]:
        """(nt,) sample times [s]."""
        return np.arange(self.acc.shape[1], dtype=np.float64) * self.dt

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return (self.acc.shape[1] - 1) * self.dt

    @property
    def peak(self) -> float:
        """Largest acceleration of a component [m/s2]."""
        return float(np.abs(self.acc).max())


def _numbers(values: ArrayLike, where: str) -> Floats:
    """A copy as float64; what is no real number is refused."""
    try:
        plain = np.asarray(values)
        if plain.dtype.kind not in "fiu":
            raise TypeError
    except (TypeError, ValueError):
        raise RecordError(f"{where}: wanted real numbers, got {quote(values)}") from None
    if masked := int(np.count_nonzero(np.ma.getmask(np.ma.asanyarray(values)))):
        raise RecordError(
            f"{where}: {masked} of {plain.size} samples are masked, limit 0; fill them, or cut them off"
        )
    return np.array(plain, dtype=np.float64, order="C")


@dataclass(frozen=True)
class SupportMotion:
    """Motion of a support's own: factor times the record, later by the delay; or a record of its own.

    Attributes
    ----------
    support : number of the first entry of `supports` that moves so
    delay : [s]
    factor : of all components
    record : in place of delay and factor
    """

    support: int
    delay: float = 0.0
    factor: float = 1.0
    record: GroundMotion | None = None

    @property
    def name(self) -> str:
        """The key of that entry."""
        return f"supports[{self.support}]"


@dataclass(frozen=True)
class MovingSupports:
    """Supports that do not move as the base does.

    Attributes
    ----------
    motions : those that differ from each other
    components : block name -> (n, 3) number of the motion that a component has; -1 where it has none
    """

    motions: tuple[SupportMotion, ...]
    components: dict[str, Ints]


def ground_rows(supports: int) -> dict[Motion, slice]:
    """Rows of a run's ground motion: the base's three, then those of supports that move by themselves."""
    motions = Motion.SUPPORTS, Motion.SUPPORTS_VELOCITY, Motion.SUPPORTS_DISPLACEMENT
    n = 3 * supports
    after = {motion: slice(3 + k * n, 3 + (k + 1) * n) for k, motion in enumerate(motions)}
    return {Motion.BASE: slice(0, 3)} | after
