"""Speed against error of many settings: their table and their Dataset."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import romdam
from romdam.config.load import Job
from romdam.core.arrays import Bools
from romdam.core.system import History
from romdam.error.comparison import Comparison

_COLUMNS = (  # variable, heading, format, factor
    ("integrator", "integrator", "{}", None),
    ("finest_step", "finest step s", "{:.6g}", 1.0),
    ("modes", "modes a block", "{}", None),
    ("residual_vectors", "residual", "{:d}", 1),
    ("unknowns", "unknowns", "{:d}", 1),
    ("peak_opening", "peak opening mm", "{:.3f}", 1e3),
    ("peak_error", "peak error %", "{:.2g}", 1e2),
    ("l2_error", "L2 error %", "{:.2g}", 1e2),
    ("cpu_seconds", "CPU s", "{:.3f}", 1.0),
    ("steps", "steps", "{:d}", 1),
    ("on_front", "front", "{}", None),
)
_UNITS = {"finest_step": "s", "peak_opening": "m", "cpu_seconds": "s"}
_LONG_NAMES = {
    "integrator": "time integrator",
    "finest_step": "smallest step taken",
    "modes": "fixed-interface modes of each block, or their cut-off",
    "residual_vectors": "of each block, one for each of its lowest modes with the joints open",
    "unknowns": "unknowns of the model",
    "peak_opening": "largest opening within the compared seconds",
    "peak_error": "relative error of the largest opening",
    "l2_error": "relative L2 error of all openings",
    "cpu_seconds": "CPU time of the time loop over the whole record, median of the repeats",
    "cpu_spread": "largest minus smallest CPU time of the repeats over their median",
    "steps": "steps taken over the whole record",
    "failure": "why a case has no numbers",
    "on_front": "whether no other case is both faster and nearer",
}


@dataclass(frozen=True)
class CaseResult:
    """One setting and what it gave; where it failed, numbers are NaN and `failure` says why."""

    integrator: str
    finest_step: float
    modes: str
    residual_vectors: int
    unknowns: int
    peak_opening: float = math.nan
    peak_error: float = math.nan
    l2_error: float = math.nan
    cpu_seconds: float = math.nan
    cpu_spread: float = math.nan
    steps: int = 0
    failure: str = ""


@dataclass(frozen=True)
class Setting:
    """Integrator and finest step [s], modes of a block as text, residual vectors, unknowns of the model."""

    integrator: str
    finest_step: float
    modes: str
    residual_vectors: int
    unknowns: int


def case_result(setting: Setting, runs: Sequence[History], comparison: Comparison) -> CaseResult:
    """Error of a setting, and the CPU time of its repeated runs."""
    stats, cpu = runs[0].stats, [run.stats["loop_cpu_seconds"] for run in runs]
    return CaseResult(
        **asdict(setting) | {"finest_step": stats["finest_step"]},
        peak_opening=comparison.peak,
        peak_error=comparison.error.peak,
        l2_error=comparison.error.l2,
        cpu_seconds=median(cpu),
        cpu_spread=(max(cpu) - min(cpu)) / median(cpu),
        steps=int(stats["steps"]),
    )


def failed_case(setting: Setting, failure: str) -> CaseResult:
    """A setting that has no numbers."""
    return CaseResult(**asdict(setting), failure=failure)


def study_dataset(cases: list[CaseResult], job: Job, about: dict[str, object]) -> xr.Dataset:
    """All cases in one Dataset with dimension `case`; `about` says what was compared with what."""
    names = list(CaseResult.__dataclass_fields__)
    columns = {name: np.array([getattr(case, name) for case in cases]) for name in names}
    columns["on_front"] = pareto_front(columns["cpu_seconds"], columns["l2_error"]).astype(np.int8)
    variables = {
        name: xr.Variable(("case",), values, {"long_name": _LONG_NAMES[name]} | _units(name, values))
        for name, values in columns.items()
    }
    number = {"long_name": "number of the case", "units": "1"}
    return xr.Dataset(
        variables,
        coords={"case": ("case", np.arange(len(cases)), number)},
        attrs={
            "title": f"Speed against error: {job.config.title or job.path.stem}",
            "source": f"romdam {romdam.__version__}",
            "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
            "machine": f"{_processor()}, {os.cpu_count()} cores",
            "configuration_file": job.path.name,
            "configuration": json.dumps(job.config.model_dump(mode="json")),
            "configuration_sha256": job.digest,
            **about,
        },
    )


def _units(name: str, values: NDArray[Any]) -> dict[str, str]:
    return {} if values.dtype.kind == "U" else {"units": _UNITS.get(name, "1")}


def pareto_front(cost: NDArray[np.float64], error: NDArray[np.float64]) -> Bools:
    """Cases that no other is at least as good as in both, and better in one; NaN never is."""
    front = np.zeros(len(cost), dtype=bool)
    for i in np.flatnonzero(np.isfinite(cost) & np.isfinite(error)):
        as_good = (cost <= cost[i]) & (error <= error[i])
        front[i] = not (as_good & ((cost < cost[i]) | (error < error[i]))).any()
    return front


def _processor() -> str:
    """Name of the processor where the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def study_table(dataset: xr.Dataset) -> str:
    """The cases as a Markdown table, the nearest last."""
    order = np.argsort(-np.nan_to_num(dataset.l2_error.values, nan=np.inf), kind="stable")
    rows = [[heading for _, heading, _, _ in _COLUMNS], ["---"] * len(_COLUMNS)]
    for i in order:
        if str(dataset.failure.values[i]):
            rows.append([*_cells(dataset, i)[:5], str(dataset.failure.values[i])])
        else:
            rows.append(_cells(dataset, i))
    attrs = dataset.attrs
    head = f"{attrs['title']}\n{attrs['compared']}\n{attrs['machine']}; romdam {romdam.__version__}\n\n"
    return head + "\n".join("| " + " | ".join(row) + " |" for row in rows) + "\n"


def _cells(dataset: xr.Dataset, i: int) -> list[str]:
    cells = []
    for name, _, form, factor in _COLUMNS:
        value = dataset[name].values[i]
        if name == "on_front":
            cells.append("yes" if value else "")
        else:
            cells.append(form.format(value if factor is None else factor * value))
    return cells
