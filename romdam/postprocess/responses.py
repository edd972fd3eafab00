"""Responses, intensities and curves of a suite, as its summary holds them.

What is computed of a suite takes the Dataset of `summary.nc`, or a selection (`summary.sel(joint="J3")`), and
the name of a response. Runs that failed are NaN there; they are left out, never counted as exceedances, and
`attrs["failed"]` says how many. Where numbers cannot be had, `attrs["statement"]` says why and they are NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.postprocess.weights import effective_number, weights_of

RUNS = ("record", "scale", "sample")
MEASURE = "record_"  # how the summary's variables of the records' measures begin
PARAMETER = "parameter_"  # and those of the samples' parameters, which a user may call `gap` or `scale`
WITHIN = "within_sequence"  # variable of the summary: record -> a sequence that has it in it, "" for none


def each_once(summary: xr.Dataset) -> xr.Dataset:
    """The runs of a summary without those of records that a sequence of it repeats.

    The mainshock of a sequence runs alone too. Statistics over records would count its motion twice.
    """
    if WITHIN not in summary:  # of a version without sequences
        return summary
    return summary.isel(record=np.flatnonzero(summary[WITHIN].values.astype(str) == ""))


def repeated_text(summary: xr.Dataset) -> str:
    """Say whose runs `each_once` leaves out; empty where it leaves out none."""
    if WITHIN not in summary:
        return ""
    names = zip(summary.record.values, summary[WITHIN].values.astype(str), strict=True)
    repeated = [f"{name} (in {sequence})" for name, sequence in names if sequence]
    return f"without the runs of {', '.join(repeated)} alone, which sequences repeat" if repeated else ""


_NOT_RESPONSES = (
    "wall_seconds",
    "cpu_seconds",
    "steps",
    "finest_step",
    "estimated_time_error",
    "estimated_reduction_error",
    "estimated_mesh_error",
)


def responses(summary: xr.Dataset) -> list[str]:
    """Names of what a run answers with, in the summary's order."""
    return [
        str(name)
        for name, values in summary.data_vars.items()
        if values.dims[:3] == RUNS and values.dtype.kind == "f"
        and not {"gap", "floor_frequency"} & {*values.dims} and name not in _NOT_RESPONSES
    ]  # fmt: skip


def response_of(summary: xr.Dataset, response: str) -> xr.DataArray:
    """A response of each run, (record, scale, sample): the largest over joints, nodes and so on.

    Quantities whose compression is negative are turned, so that larger always means more.

    Raises
    ------
    ResultError
        for a name that is no response of the suite.
    """
    known = [str(n) for n, v in summary.data_vars.items() if v.dims[:3] == RUNS and v.dtype.kind == "f"]
    if response not in known:
        raise ResultError(f"{response}: is no response of this suite; it has {', '.join(known)}")
    values = turned(summary[response])
    attributes = dict(values.attrs)
    rest = [dim for dim in values.dims if dim not in RUNS]
    return (values.max(rest) if rest else values).assign_attrs(attributes)


def turned(values: xr.DataArray) -> xr.DataArray:
    """A response as a size, so that larger always means more: compression is negative in files alone."""
    if "compression negative" not in (text := str(values.attrs.get("long_name", ""))):
        return values
    return (-values).assign_attrs(values.attrs | {"long_name": text.replace(" negative", " positive")})


def intensity_of(summary: xr.Dataset, intensity: str) -> xr.DataArray:
    """A measure of each scaled record, (record, scale); `scale` itself is one too.

    Raises
    ------
    ResultError
        for a name that is no measure of the suite.
    """
    if intensity == "scale":
        about = summary.scale.attrs
        return (
            (summary.scale * xr.ones_like(summary.scale_factor))
            .transpose("record", "scale")
            .assign_attrs(about)
        )
    if MEASURE + intensity not in summary:
        raise ResultError(
            f"{intensity}: is no measure of this suite's records; "
            f"it has {', '.join([*measures(summary), 'scale'])}"
        )
    return summary[MEASURE + intensity].transpose("record", "scale")


def measures(summary: xr.Dataset) -> list[str]:
    """Names of the records' measures."""
    return [str(n).removeprefix(MEASURE) for n in summary.data_vars if str(n).startswith(MEASURE)]


def parameters(summary: xr.Dataset) -> dict[str, xr.DataArray]:
    """Name -> values (sample) of the parameters that the samples vary; 0.1 wrote them without prefix."""
    sampled = {str(n): v for n, v in summary.coords.items() if v.dims == ("sample",) and n != "sample"}
    return {name.removeprefix(PARAMETER): values for name, values in sampled.items()}


@dataclass(frozen=True)
class Curve:
    """One record with one sample over the scales whose runs are there, intensity rising, and its weight."""

    intensity: Floats
    response: Floats
    weight: float = 1.0

    def at(self, levels: Floats) -> Floats:
        """Response at intensities, linear in logarithms where it can be; NaN outside the curve."""
        x = np.log(self.intensity)
        if (self.response > 0.0).all():
            return np.exp(np.interp(np.log(levels), x, np.log(self.response), np.nan, np.nan))
        return np.interp(np.log(levels), x, self.response, np.nan, np.nan)

    def reaches(self, threshold: float) -> float:
        """Intensity at which the response first exceeds a threshold, between two of the curve's points."""
        i = int(np.argmax(self.response > threshold))
        x, y = np.log(self.intensity[i - 1 : i + 1]), self.response[i - 1 : i + 1]
        if y[0] > 0.0 and threshold > 0.0:
            y, threshold = np.log(y), float(np.log(threshold))
        return float(np.exp(x[0] + (threshold - y[0]) / (y[1] - y[0]) * (x[1] - x[0])))


def curves_of(values: xr.DataArray, levels: xr.DataArray) -> list[Curve]:
    """A curve for each record and sample that has a run, and a weight above 0."""
    weights = weights_of(values)
    of_records = np.ones(values.sizes["record"]) if weights is None else weights
    y = values.transpose("record", "sample", "scale").values
    x = np.broadcast_to(levels.values[:, None, :], y.shape)
    each = np.repeat(of_records, y.shape[1]).tolist()
    curves = []
    for row_x, row_y, weight in zip(
        x.reshape(-1, x.shape[-1]), y.reshape(-1, y.shape[-1]), each, strict=True
    ):
        there = np.flatnonzero(np.isfinite(row_x) & np.isfinite(row_y) & (row_x > 0.0))
        there = there[np.argsort(row_x[there], kind="stable")]
        if len(there) and weight > 0.0:
            curves.append(Curve(row_x[there], row_y[there], weight))
    return curves


def about_runs(
    summary: xr.Dataset, values: xr.DataArray, measured: xr.DataArray | None = None
) -> dict[str, object]:
    """Names, units and numbers of runs that every result states."""
    finite = int(np.isfinite(values.values).sum())
    there, weights = values.notnull().any(("scale", "sample")).values, weights_of(values)
    about: dict[str, object] = {
        "title": str(summary.attrs.get("title", "")),
        "response": str(values.name),
        "response_units": str(values.attrs.get("units", "1")),
        "response_long_name": str(values.attrs.get("long_name", values.name)),
        "runs": finite,
        "records": int(there.sum()),
        "effective_records": float(there.sum()) if weights is None else effective_number(weights[there]),
        "failed": int(values.size - finite),
    }
    if measured is not None:
        about["intensity"] = str(measured.name or "scale").removeprefix(MEASURE)
        about["intensity_units"] = str(measured.attrs.get("units", "1"))
        about["intensity_long_name"] = str(measured.attrs.get("long_name", about["intensity"]))
    return about
