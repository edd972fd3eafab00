"""Summaries of suites that never ran, whose population is known."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from romdam.core.arrays import Floats
from romdam.visual.report.page import page
from romdam.visual.report.sections import suite_report
from romdam.visual.report.subject import Subject

RUNS = ("record", "scale", "sample")


def summary_of(
    response: ArrayLike, sa: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None, **more: Any
) -> xr.Dataset:
    """A summary with one joint: response (record, scale, sample) [m], sa (record, scale) [m/s2]."""
    values = np.asarray(response, dtype=float)
    records, scales, samples = values.shape
    about = {"units": "m", "long_name": "largest opening over all gaps and steps"}
    failed = ~np.isfinite(values)
    data: dict[str, Any] = {
        "peak_opening": ((*RUNS, "joint"), values[..., None], about),
        "record_sa": (("record", "scale"), sa, {"units": "m s-2", "long_name": "spectral acceleration"}),
        "record_pga": (("record", "scale"), 0.4 * np.asarray(sa) ** 0.5, {"units": "m s-2"}),
        "status": (RUNS, failed.astype(np.int8)),
        "message": (RUNS, np.where(failed, "contact did not converge", "")),
    }
    coords: dict[str, Any] = {
        "record": [f"r{i:03d}" for i in range(records)],
        "scale": (
            "scale",
            np.arange(1.0, scales + 1.0),
            {"units": "1", "long_name": "factor"},
        ),
        "scale_factor": (("record", "scale"), np.ones((records, scales))),
        "sample": np.arange(samples),
        "joint": ["J1"],
    }
    coords |= {name: ("sample", one) for name, one in (parameters or {}).items()}
    return xr.Dataset(data | more, coords, {"title": "synthetic"})


def lognormal_stripes(
    rng: np.random.Generator, theta: float, beta: float, levels: Floats, records: int
) -> xr.Dataset:
    """Stripes of other records at every level; a run exceeds 1 where its own capacity is below the level."""
    capacity = theta * np.exp(beta * rng.standard_normal((records, len(levels), 1)))
    sa = np.broadcast_to(levels, (records, len(levels)))
    return summary_of(sa[..., None] / capacity, sa)


def lognormal_curves(
    rng: np.random.Generator, theta: float, beta: float, levels: Floats, records: int
) -> tuple[xr.Dataset, Floats]:
    """Curves of records scaled to the levels; each exceeds 1 at its own capacity."""
    capacity = theta * np.exp(beta * rng.standard_normal((records, 1, 1)))
    sa = np.broadcast_to(levels, (records, len(levels)))
    return summary_of((sa[..., None] / capacity) ** 1.3, sa), capacity.ravel()


def suite_page(subject: Subject) -> str:
    """The page of a suite, as text."""
    return page(suite_report(subject))
