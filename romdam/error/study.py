"""Speed against error of many settings: their table, their Dataset, and their picture."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

import romdam
from romdam.config.load import Job
from romdam.core.arrays import Bools
from romdam.visual.style import COLOURS, GREY, STYLE

_MARKERS = "osD^vP*X<>"
_COLUMNS = (  # variable, heading, format, factor
    ("integrator", "integrator", "{}", None),
    ("finest_step", "finest step s", "{:.6g}", 1.0),
    ("modes", "modes a block", "{}", None),
    ("corrections", "corrections", "{:d}", 1),
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
    "corrections": "corrected open-joint modes of each block",
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
    corrections: int
    unknowns: int
    peak_opening: float
    peak_error: float
    l2_error: float
    cpu_seconds: float
    cpu_spread: float
    steps: int
    failure: str = ""


def study_dataset(cases: list[CaseResult], job: Job, about: dict[str, object]) -> xr.Dataset:
    """All cases in one Dataset with dimension `case`; `about` says what was compared with what."""
    names = list(CaseResult.__dataclass_fields__)
    columns = {name: np.array([getattr(case, name) for case in cases]) for name in names}
    columns["on_front"] = pareto_front(columns["cpu_seconds"], columns["l2_error"]).astype(np.int8)
    variables = {
        name: xr.Variable(("case",), values, {"long_name": _LONG_NAMES[name], "units": _UNITS.get(name, "1")})
        for name, values in columns.items()
    }
    return xr.Dataset(
        variables,
        coords={"case": np.arange(len(cases))},
        attrs={
            "Conventions": "CF-1.11",
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


def study_figure(dataset: xr.Dataset) -> Figure:
    """CPU time against L2 error, one line for each integrator and basis, the Pareto front marked."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 6.0), layout="constrained")
        ax = figure.subplots()
        _lines(ax, dataset)
        _front(ax, dataset)
        ax.set_xlabel("CPU time of the time loop [s]")
        ax.set_ylabel("L2 error of all openings [%]")
        for axis, name in ((ax.xaxis, "x"), (ax.yaxis, "y")):
            ax.set(**{f"{name}scale": "log"})
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_minor_locator(NullLocator())
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.margins(x=0.14, y=0.08)
        ax.set_title(f"{dataset.attrs['title']}\n{dataset.attrs['compared']}", loc="left")
        figure.legend(loc="outside lower center", ncols=2)
        return figure


def _lines(ax: Axes, dataset: xr.Dataset) -> None:
    """One line for each integrator (dash and marker) and basis (colour), through its steps."""
    added = (f", {c} corrections" if c else "" for c in dataset.corrections.values)
    bases = np.array([f"{modes}{more}" for modes, more in zip(dataset.modes.values, added, strict=True)])
    for k, integrator in enumerate(dict.fromkeys(dataset.integrator.values)):
        for b, base in enumerate(dict.fromkeys(bases)):
            rows = np.flatnonzero((bases == base) & (dataset.integrator.values == integrator))
            ax.plot(
                dataset.cpu_seconds.values[rows],
                100.0 * dataset.l2_error.values[rows],
                color=COLOURS[b % len(COLOURS)],
                ls=("-", "--", ":", "-.")[k % 4],
                marker=_MARKERS[k % len(_MARKERS)],
                ms=4,
                lw=0.9,
                label=f"{integrator}: {base}",
            )


def _front(ax: Axes, dataset: xr.Dataset) -> None:
    """The Pareto front as a band, with the finest step at its points where there is room."""
    rows = np.flatnonzero(dataset.on_front.values)
    rows = rows[np.argsort(dataset.cpu_seconds.values[rows])]
    cpu, error = dataset.cpu_seconds.values[rows], 100.0 * dataset.l2_error.values[rows]
    ax.plot(cpu, error, color=GREY, lw=6, alpha=0.4, zorder=0, solid_capstyle="round", label="Pareto front")
    last = np.inf
    for x, y, step in zip(cpu, error, dataset.finest_step.values[rows], strict=True):
        if y < 0.8 * last:
            text, last = f"{1e3 * step:.4g} ms", y
            ax.annotate(text, (x, y), xytext=(-7, -3), textcoords="offset points", ha="right", fontsize=7.5)
