"""The ground motion that every later stage sees."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import RecordError, quote
from romdam.core.fingerprint import fingerprint
from romdam.core.html.card import card
from romdam.core.scene_effect import SceneEffect

if TYPE_CHECKING:
    import xarray as xr
    from scipy.sparse import csr_matrix

AXES = ("x", "y", "z")


class Motion(StrEnum):
    """Motions that loads follow; what moves against the base does so in its own rows, x, y, z each."""

    BASE = "acceleration of the base"
    BASE_VELOCITY = "velocity of the base"
    SUPPORTS = "acceleration of supports against the base"
    SUPPORTS_VELOCITY = "velocity of supports against the base"
    SUPPORTS_DISPLACEMENT = "displacement of supports against the base"
    FORCES = "forces that vary in time"
    CHANNEL = "waves of a channel's sections"
    CHANNEL_RATE = "rate of the waves of a channel's sections"
    FREE_FIELD = "motion of a column of rock against its surface"
    FREE_FIELD_RATE = "rate of that motion"
    FREE_FIELD_TRACTION = "traction on the lower end of a column of rock"
    INCLINED = "forces of inclined waves on the boundary of the rock"


_ACCELERATIONS = {"m/s2": 1.0, "cm/s2": 0.01, "mm/s2": 1e-3, "gal": 0.01, "g": 9.80665}  # in m/s2
_UNITS = re.compile(r"([0-9.]+(?:e[+-]?[0-9]+)?)?\s*([A-Za-z]+(?:/s2)?)")
_UNEVEN = 1e-3  # of a step: times printed with few digits are as far off
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
        cls,
        name: str,
        acc: ArrayLike | Mapping[str, ArrayLike] | xr.DataArray,
        dt: float | None = None,
        *,
        units: str | None = None,
        place: str = "arrays",
    ) -> Self:
        """Make a ground motion from arrays.

        Parameters
        ----------
        name : of the motion; the result's
        acc : (3, nt) ground acceleration along x, y, z; or name of the axis -> (nt,), those not named are
            zero; or a DataArray over component (any of x, y, z) and time [units]
        dt : sampling interval [s]; that of a DataArray's coordinate `time` if not given
        units : of acc, such as "g", "cm/s2" or "9.81 m/s2"; a DataArray's own, else m/s2, if not given
        place : names it in errors, and in the results' account of where their record is from

        Raises
        ------
        RecordError
            for another shape, values that are not finite, fewer than two samples or too many, an unknown
            unit, times that are not even, and a step that is missing or not above zero.
        """
        if not isinstance(name, str) or not name:
            raise RecordError(f"{place}: a motion's name is text, got {quote(name)}")
        where = f"{place}, {name}"
        if not isinstance(acc, Mapping) and hasattr(acc, "coords") and hasattr(acc, "dims"):
            acc, dt, units = _of_data_array(acc, dt, units, where)
        if dt is None:
            raise RecordError(f"{where}: dt is missing; give the sampling interval, such as dt=0.01")
        factor = _in_si(units or "m/s2", where)
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
        motion = cls(name, factor * values, float(step))
        motion.provenance.update({"place": place} | motion.provenance_of_arrays)
        return motion

    @classmethod
    def from_stream(
        cls, stream: Any, components: Mapping[str, str], *, units: str, name: str | None = None
    ) -> Self:
        """Make a ground motion from an ObsPy Stream or Trace.

        Parameters
        ----------
        stream : of accelerations: one trace for each component, with the same start, interval and length
        components : axis of the model -> channel code, such as {"x": "HNE", "y": "HNN"}, or a trace's id;
            axes not named are zero
        units : of the samples, such as "m/s2", "cm/s2" or "4.7e-6 m/s2"
        name : of the motion; network and station of the first trace if not given

        Raises
        ------
        RecordError
            for a channel that is not there or has several traces, traces that do not fit together, and as
            `from_arrays` does.
        """
        traces = [stream] if hasattr(stream, "stats") else list(stream)
        known = ", ".join(str(trace.id) for trace in traces) or "none"
        chosen = {}
        for axis, code in components.items():
            matching = [trace for trace in traces if code in (trace.id, trace.stats.channel)]
            if len(matching) != 1:
                remedy = "merge or select them first" if matching else f"its traces are {known}"
                raise RecordError(
                    f"stream: {len(matching)} traces are of channel {code!r}, limit 1; {remedy}"
                )
            chosen[axis] = matching[0]
        if not chosen:
            raise RecordError(f'stream: components is empty; give {{"x": channel}}, its traces are {known}')
        first, *others = chosen.values()
        begin, step, count = first.stats.starttime, float(first.stats.delta), first.stats.npts
        for trace in others:
            late = abs(float(trace.stats.starttime - begin))
            if late > 0.5 * step or trace.stats.npts != count or float(trace.stats.delta) != step:
                raise RecordError(
                    f"stream: {first.id} and {trace.id} do not fit together: {count} and {trace.stats.npts} "
                    f"samples of {step:g} and {trace.stats.delta:g} s, {late:g} s apart, limit half a "
                    "sample; trim and resample them first"
                )
        named = (
            name or ".".join(word for word in (first.stats.network, first.stats.station) if word) or "stream"
        )
        arrays = {axis: trace.data for axis, trace in chosen.items()}
        motion = cls.from_arrays(named, arrays, step, units=units, place="stream")
        channels = {axis: str(trace.id) for axis, trace in chosen.items()}
        motion.provenance.update(channels=channels, start=str(begin), unit=units)
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


def _in_si(units: str, where: str) -> float:
    """One unit of acceleration in m/s2."""
    plain = re.sub(r"\s*(\^|\*\*)\s*|\s+(?=-2$)", "", units.strip().translate({0xB2: "2"}))
    match = _UNITS.fullmatch(plain.replace("s-2", "s2").replace(" s2", "/s2"))
    unit = _ACCELERATIONS.get(match[2].lower() if match and match[2] != "G" else "") if match else None
    if match is None or unit is None or not (factor := float(match[1] or 1.0) * unit) > 0.0:
        known = ", ".join(_ACCELERATIONS)
        raise RecordError(
            f"{where}: units {quote(units)} is no acceleration; known are {known}, or 9.81 m/s2"
        )
    return factor


def _of_data_array(
    acc: Any, dt: float | None, units: str | None, where: str
) -> tuple[dict[str, Any], float, str | None]:
    """Components, interval [s] and units of a DataArray over time and, if it has several, component."""
    if "time" not in acc.dims or acc.ndim > 2 or (acc.ndim == 2 and "component" not in acc.coords):
        raise RecordError(
            f"{where}: a DataArray has the dimensions component, with names, and time, got {acc.dims}"
        )
    if acc.ndim == 1 and "component" not in acc.coords:
        raise RecordError(f'{where}: the DataArray names no component; give {{"x": array}}, with dt')
    times = np.asarray(acc["time"].values) if "time" in acc.coords else None
    if times is not None and times.dtype.kind in "mM":
        times = (times - times[0]) / np.timedelta64(1, "s")
    if times is not None and len(times) > 1:
        times = _numbers(times, f"{where}, time")
        step = float(times[-1] - times[0]) / (len(times) - 1)
        off = np.abs(np.diff(times) - step).max()
        if not off <= _UNEVEN * step:
            raise RecordError(
                f"{where}: time is not even: steps are {off:.3g} s off {step:.6g} s; resample it"
            )
        if dt is not None and abs(dt - step) > _UNEVEN * step:
            raise RecordError(
                f"{where}: dt is {dt:g} s, and the coordinate time has {step:g} s; leave dt out"
            )
        dt = step if dt is None else dt
    if dt is None:
        raise RecordError(f"{where}: the DataArray has no coordinate time; give dt")
    rows = acc.transpose("component", "time") if acc.ndim == 2 else acc.expand_dims("component")
    names = [str(name) for name in rows["component"].values]
    stated = acc.attrs.get("units")
    return dict(zip(names, rows.values, strict=True)), dt, units or (str(stated) if stated else None)


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
    support : number of the first entry of `supports` that moves so, or of the station
    delay : [s]
    factor : of all components, or of x, y and z
    record : in place of delay and factor
    station : coordinate of a station of `ground.along`, of all supports nearby; None of a support [m]
    """

    support: int
    delay: float = 0.0
    factor: float | tuple[float, float, float] = 1.0
    record: GroundMotion | None = None
    station: float | None = None

    @property
    def name(self) -> str:
        """The key of that entry."""
        return f"supports[{self.support}]" if self.station is None else f"station {self.support}"

    @property
    def key(self) -> str:
        """The key that asks for the motion, and its record's is in."""
        if self.station is None:
            return f"supports[{self.support}].motion"
        return f"ground.along.stations[{self.support}]"


@dataclass(frozen=True)
class Incoherence:
    """Random part of the motion at stations, see `romdam.records.processing.incoherence`.

    Attributes
    ----------
    distance : (k,) coordinates of the stations from where the motion is the record [m]
    loss : alpha / shear velocity of the coherency exp(-(loss omega d)^2) [s/m]
    seed : of the random numbers
    """

    distance: Floats
    loss: float
    seed: int


@dataclass(frozen=True)
class MovingSupports(SceneEffect):
    """Supports that do not move as the base does.

    Attributes
    ----------
    motions : those that differ from each other
    components : block name -> (n, 3) number of the motion that a component has; -1 where it has none
    shares : block name -> (n, motions) sparse shares of the motions in that of a node, all held components
        alike, where motions are of stations; no block where they are not
    incoherence : random part of the stations' motions; None without
    """

    motions: tuple[SupportMotion, ...]
    components: dict[str, Ints]
    shares: dict[str, csr_matrix] = field(default_factory=dict)
    incoherence: Incoherence | None = None


@dataclass(frozen=True)
class ForceSignal:
    """Size of a force that varies in time, straight between its rows.

    Attributes
    ----------
    name : the key that asks for it, `loads.force_history[0]`
    time : (n,) rising, from the start of the record [s]
    force : (n,) along the direction of the force; of a pressure that times the area [N]
    holds : whether the last value stays; else the force ends with its last row
    """

    name: str
    time: Floats
    force: Floats
    holds: bool = False

    def at(self, time: Floats) -> Floats:
        """The force at some times; zero before its first row [N]."""
        last = float(self.force[-1]) if self.holds else 0.0
        return np.interp(time, self.time, self.force, left=0.0, right=last)


def ground_rows(supports: int, forces: int = 0) -> dict[Motion, slice]:
    """Rows of a run's ground motion: the base's three, those of supports that move by themselves, forces."""
    motions = Motion.SUPPORTS, Motion.SUPPORTS_VELOCITY, Motion.SUPPORTS_DISPLACEMENT
    n = 3 * supports
    after = {motion: slice(3 + k * n, 3 + (k + 1) * n) for k, motion in enumerate(motions)}
    of_forces = {Motion.FORCES: slice(3 + 3 * n, 3 + 3 * n + forces)} if forces else {}
    return {Motion.BASE: slice(0, 3)} | after | of_forces
