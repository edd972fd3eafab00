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

import numpy as np
import xarray as xr

from romdam.config.load import Job
from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.system import History
from romdam.core.version import SOURCE
from romdam.error.comparison import Differences
from romdam.postprocess.stated_errors import percent
from romdam.postprocess.variant_tables import markdown_table

WANTED_ERRORS = (0.1, 0.05, 0.02, 0.01, 0.005)  # for which the cheapest setting is named
_NO_CASE = -1  # number of the cheapest setting where none keeps an error

_COLUMNS = (  # variable, heading, format, factor; first what tells settings from others
    ("mesh", "mesh", "{}", None),
    ("contact_points", "contact points", "{}", None),
    ("gaps", "gaps", "{:d}", 1),
    ("modes", "modes a block", "{}", None),
    ("residual_vectors", "residual", "{:d}", 1),
    ("integrator", "integrator", "{}", None),
    ("finest_step", "finest step s", "{:.6g}", 1.0),
    ("unknowns", "unknowns", "{:d}", 1),
    ("model_cpu_seconds", "CPU of model s", "{:.3g}", 1.0),
    ("peak_opening", "peak opening mm", "{:.3f}", 1e3),
    ("peak_error", "peak error %", "{:.2g}", 1e2),
    ("l2_error", "L2 error %", "{:.2g}", 1e2),
    ("cpu_seconds", "CPU of loop s", "{:.3f}", 1.0),
    ("total_cpu_seconds", "CPU s", "{:.3g}", 1.0),
    ("steps", "steps", "{:d}", 1),
    ("on_front", "front", "{}", None),
    ("of_job", "of the job", "{}", None),
)
_OF_SETTING = 9  # columns that a setting without numbers has
_FLAGS = {"on_front", "of_job"}
_UNITS = {
    "finest_step": "s", "peak_opening": "m", "cpu_seconds": "s", "model_cpu_seconds": "s",
    "total_cpu_seconds": "s",
}  # fmt: skip
_LONG_NAMES = {
    "integrator": "time integrator",
    "finest_step": "smallest step taken",
    "modes": "fixed-interface modes of each block, or their cut-off",
    "residual_vectors": "of each block, one for each of its lowest modes with the joints open",
    "unknowns": "unknowns of the model",
    "mesh": "mesh of the setting: the job's, or what it is made of",
    "contact_points": "where the gaps of the joints stand",
    "gaps": "number of gaps",
    "mesh_unknowns": "unknowns of the mesh",
    "model_cpu_seconds": "CPU time of building the scene and reducing it, once for all records",
    "compared_gaps": "number of gaps that are compared",
    "peak_opening": "largest opening within the compared seconds",
    "peak_error": "relative error of the largest opening",
    "l2_error": "relative L2 error of all openings",
    "cpu_seconds": "CPU time of the time loop over the whole record, median of the repeats",
    "cpu_spread": "largest minus smallest CPU time of the repeats over their median",
    "total_cpu_seconds": "CPU time of the model and of the time loop, what one record costs",
    "steps": "steps taken over the whole record",
    "setting": "mesh, modes, integrator and finest step in words",
    "failure": "why a case has no numbers",
    "on_front": "whether no other case is both cheaper for one record and nearer",
    "of_job": "whether it is the job's own setting, or the one that its accuracy has chosen",
}


@dataclass(frozen=True)
class Setting:
    """A setting of a study.

    Attributes
    ----------
    integrator : its name
    finest_step : smallest step [s]
    modes : of a block, as text
    residual_vectors : number for each block
    unknowns, mesh_unknowns : of the model, and of the mesh that it is reduced from
    mesh, contact_points : their names
    gaps : number of all
    model_cpu_seconds : CPU time of building the scene and reducing it [s]
    of_job : whether it is the job's own
    """

    integrator: str
    finest_step: float
    modes: str
    residual_vectors: int
    unknowns: int
    mesh: str = "as given"
    contact_points: str = "as given"
    gaps: int = 0
    mesh_unknowns: int = 0
    model_cpu_seconds: float = 0.0
    of_job: bool = False

    @property
    def words(self) -> str:
        """All that tells it from others."""
        points = "" if self.contact_points == "as given" else f", gaps: {self.contact_points}"
        vectors = f" + {self.residual_vectors} vectors" if self.residual_vectors else ""
        step = f"{1e3 * self.finest_step:.4g} ms"
        return f"mesh {self.mesh}{points}, {self.modes}{vectors}, {self.integrator}, {step}"


@dataclass(frozen=True)
class CaseResult(Setting):
    """One setting and what it gave; where it failed, numbers are NaN and `failure` says why."""

    compared_gaps: int = 0
    peak_opening: float = math.nan
    peak_error: float = math.nan
    l2_error: float = math.nan
    cpu_seconds: float = math.nan
    cpu_spread: float = math.nan
    steps: int = 0
    failure: str = ""


def case_result(setting: Setting, runs: Sequence[History], differences: Differences) -> CaseResult:
    """Error of a setting, and the CPU time of its repeated runs, those that chose the step counted."""
    stats = runs[0].stats
    cpu = [run.stats.get("all_runs_cpu_seconds", run.stats["loop_cpu_seconds"]) for run in runs]
    return CaseResult(
        **asdict(setting) | {"finest_step": stats["finest_step"]},
        compared_gaps=differences.gaps,
        peak_opening=differences.peak,
        peak_error=differences.errors["opening"].peak,
        l2_error=differences.errors["opening"].l2,
        cpu_seconds=median(cpu),
        cpu_spread=(max(cpu) - min(cpu)) / median(cpu),
        steps=int(stats["steps"]),
    )


def failed_case(setting: Setting, failure: str) -> CaseResult:
    """A setting that has no numbers."""
    return CaseResult(**asdict(setting), failure=failure)


def study_dataset(cases: list[CaseResult], job: Job, about: dict[str, object]) -> xr.Dataset:
    """All cases in one Dataset with dimension `case`; `about` says what was compared with what.

    For each of `WANTED_ERRORS` it has the cheapest case that keeps it.
    """
    names = list(CaseResult.__dataclass_fields__)
    columns = {name: np.array([getattr(case, name) for case in cases]) for name in names}
    columns |= {"of_job": columns["of_job"].astype(np.int8), "setting": np.array([c.words for c in cases])}
    error, total = columns["l2_error"], columns["model_cpu_seconds"] + columns["cpu_seconds"]
    columns |= {"total_cpu_seconds": total, "on_front": pareto_front(total, error).astype(np.int8)}
    variables = {}
    for name, values in columns.items():
        units = {} if values.dtype.kind == "U" else {"units": _UNITS.get(name, "1")}
        variables[name] = xr.Variable(("case",), values, {"long_name": _LONG_NAMES[name]} | units)
    wanted = np.array(WANTED_ERRORS)
    cheapest = {
        "long_name": f"number of the cheapest case that keeps the error; {_NO_CASE}: none does",
        "units": "1",
    }
    variables["cheapest_case"] = xr.Variable(
        ("wanted_error",), cheapest_cases(total, error, wanted), cheapest
    )
    number = {"long_name": "number of the case", "units": "1"}
    limit = {"long_name": "relative L2 error of the openings that is to be kept", "units": "1"}
    return xr.Dataset(
        variables,
        coords={
            "case": ("case", np.arange(len(cases)), number),
            "wanted_error": ("wanted_error", wanted, limit),
        },
        attrs={
            "title": f"Speed against error: {job.config.title or job.path.stem}",
            "source": SOURCE,
            "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
            "machine": f"{_processor()}, {os.cpu_count()} cores",
            "configuration_file": job.path.name,
            "configuration": json.dumps(job.config.model_dump(mode="json")),
            "configuration_sha256": job.digest,
            **about,
        },
    )


def pareto_front(cost: Floats, error: Floats) -> Bools:
    """Cases that no other is at least as good as in both, and better in one; NaN never is."""
    front = np.zeros(len(cost), dtype=bool)
    for i in np.flatnonzero(np.isfinite(cost) & np.isfinite(error)):
        as_good = (cost <= cost[i]) & (error <= error[i])
        front[i] = not (as_good & ((cost < cost[i]) | (error < error[i]))).any()
    return front


def cheapest_cases(cost: Floats, error: Floats, wanted: Floats) -> Ints:
    """Number of the cheapest case within each wanted error, -1 where there is none.

    Of cases of one cost the nearer counts, then the first; NaN never does.

    Parameters
    ----------
    cost, error : (n,) CPU time [s] and relative error of every case
    wanted : (m,) relative errors
    """
    order = np.lexsort((error, cost))
    order = order[np.isfinite(cost[order]) & np.isfinite(error[order])]
    kept = (order[error[order] <= limit] for limit in wanted)
    return np.array([cases[0] if len(cases) else _NO_CASE for cases in kept], dtype=np.int64)


def _processor() -> str:
    """Name of the processor where the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def study_table(dataset: xr.Dataset) -> str:
    """The cases as a Markdown table, the nearest last, and a short one of the cheapest for each error."""
    order = np.argsort(-np.nan_to_num(dataset.l2_error.values, nan=np.inf), kind="stable")
    rows = [[heading for _, heading, _, _ in _COLUMNS]]
    for i in order:
        if str(dataset.failure.values[i]):
            rows.append([*_cells(dataset, i)[:_OF_SETTING], str(dataset.failure.values[i])])
        else:
            rows.append(_cells(dataset, i))
    short = [["L2 error at most", "cheapest setting", "CPU s", "of that the loop", "L2 error"]]
    for wanted, i in zip(dataset.wanted_error.values, dataset.cheapest_case.values, strict=True):
        if i == _NO_CASE:
            short.append([f"{100 * wanted:g} %", "none of these", "", "", ""])
        else:
            cpu = (f"{dataset[name].values[i]:.3g}" for name in ("total_cpu_seconds", "cpu_seconds"))
            error = percent(float(dataset.l2_error.values[i]))
            short.append([f"{100 * wanted:g} %", str(dataset.setting.values[i]), *cpu, error])
    attrs = dataset.attrs
    head = f"{attrs['title']}\n{attrs['compared']}\n{attrs['machine']}; {SOURCE}\n"
    head += f"CPU s: scene, reduction and time loop ({attrs['timed_seconds']:g} s), what one record costs\n\n"
    return f"{head}{markdown_table(rows[0], rows[1:])}\n{markdown_table(short[0], short[1:])}"


def _cells(dataset: xr.Dataset, i: int) -> list[str]:
    cells = []
    for name, _, form, factor in _COLUMNS:
        value = dataset[name].values[i]
        if name in _FLAGS:
            cells.append("yes" if value else "")
        else:
            cells.append(form.format(value if factor is None else factor * value))
    return cells
