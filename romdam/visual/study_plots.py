"""The figure of a study: speed against error."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from romdam.visual.style import COLOURS, GREY, STYLE

_MARKERS = "osD^vP*X<>"


def study_figure(dataset: xr.Dataset) -> Figure:
    """CPU time against L2 error, one line for each integrator and basis, the Pareto front marked."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 6.0), layout="constrained")
        ax = figure.subplots()
        # for each integrator (dash and marker) and basis (colour) a line through its steps
        added = (f", {c} residual vectors" if c else "" for c in dataset.residual_vectors.values)
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

        # the Pareto front as a band, with the finest step at its points where there is room
        rows = np.flatnonzero(dataset.on_front.values)
        rows = rows[np.argsort(dataset.cpu_seconds.values[rows])]
        cpu, error = dataset.cpu_seconds.values[rows], 100.0 * dataset.l2_error.values[rows]
        ax.plot(
            cpu, error, color=GREY, lw=6, alpha=0.4, zorder=0, solid_capstyle="round", label="Pareto front"
        )
        last = np.inf
        for x, y, step in zip(cpu, error, dataset.finest_step.values[rows], strict=True):
            if y < 0.8 * last:
                text, last = f"{1e3 * step:.4g} ms", y
                ax.annotate(
                    text, (x, y), xytext=(-7, -3), textcoords="offset points", ha="right", fontsize=7.5
                )

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
