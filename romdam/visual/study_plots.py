"""The figure of a study: speed against error."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from romdam.visual.style import COLOURS, GREY, STYLE

_MARKERS = "osD^vP*X<>"
_ROOM = 0.25  # of the width, left of all settings: names of those on the front end at them
_BELOW = 0.06  # of the height, below all settings, for the last of these names
_WIDE = 10.0  # largest over smallest value, below which an axis has numbers at 1, 1.5, 2, 3, 5 and 7


def study_figure(dataset: xr.Dataset) -> Figure:
    """CPU time of one record against L2 error: all settings, the Pareto front, and the job's own.

    Colours are of meshes and their contact points where these are studied, else of bases; markers are of
    integrators. A line joins the steps of what is else one setting.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        ax = figure.subplots()
        cpu, error = dataset.total_cpu_seconds.values, 100.0 * dataset.l2_error.values
        others = dataset.of_job.values == 0
        bases = [
            f"{modes}{f' + {count} vectors' if count else ''}"
            for modes, count in zip(dataset.modes.values, dataset.residual_vectors.values, strict=True)
        ]
        meshes = [
            f"mesh {mesh}{'' if points == 'as given' else f', gaps: {points}'}"
            for mesh, points in zip(dataset.mesh.values, dataset.contact_points.values, strict=True)
        ]
        integrators = [str(name) for name in dataset.integrator.values]
        of_meshes = len({meshes[i] for i in np.flatnonzero(others)}) > 1
        kinds = meshes if of_meshes else bases
        named = list(dict.fromkeys(kinds[i] for i in np.flatnonzero(others)))
        used = list(dict.fromkeys(integrators[i] for i in np.flatnonzero(others)))
        curves = list(zip(meshes, bases, integrators, strict=True))
        for curve in dict.fromkeys(curves[i] for i in np.flatnonzero(others)):
            rows = [i for i in np.flatnonzero(others) if curves[i] == curve]
            colour = COLOURS[named.index(kinds[rows[0]]) % len(COLOURS)]
            marker = _MARKERS[used.index(curve[2]) % len(_MARKERS)]
            ax.plot(cpu[rows], error[rows], color=colour, marker=marker, ms=4, lw=0.5, alpha=0.8)
        for k, kind in enumerate(named):
            ax.plot([], [], color=COLOURS[k % len(COLOURS)], lw=4, label=kind)
        for k, name in enumerate(used):
            ax.plot([], [], color=GREY, marker=_MARKERS[k % len(_MARKERS)], ms=4, lw=0, label=name)
        _draw_front(ax, dataset)
        own = np.flatnonzero(~others & np.isfinite(error))
        if len(own):
            ax.plot(
                cpu[own], error[own], marker="*", ms=13, lw=0, color="white", mec="black", mew=1.2, zorder=6,
                label=f"the job's own setting: {dataset.setting.values[own[0]]}",
            )  # fmt: skip
        ax.set_xlabel("CPU time of one record, scene and reduction included [s]")
        ax.set_ylabel("L2 error of the openings [%]")
        for axis, name, values in ((ax.xaxis, "x", cpu), (ax.yaxis, "y", error)):
            values = values[np.isfinite(values)]
            narrow = len(values) and values.max() < _WIDE * values.min()
            ax.set(**{f"{name}scale": "log"})
            axis.set_major_locator(
                LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if narrow else (1.0, 2.0, 5.0))
            )
            axis.set_minor_locator(NullLocator())
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.margins(x=0.08, y=0.1)
        low, high = ax.get_xlim()
        ax.set_xlim(low * (low / high) ** _ROOM, high)
        low, high = ax.get_ylim()
        ax.set_ylim(low * (low / high) ** _BELOW, high)
        about = str(dataset.attrs["record"])
        if (left := dataset.attrs.get("reference_mesh_error")) is not None:
            about += f"; the mesh of the reference leaves about {100.0 * left:.2g} % itself"
        ax.set_title(f"{dataset.attrs['title']}\n{about}", loc="left")
        figure.legend(loc="outside lower center", ncols=2)
        return figure


def _draw_front(ax: Axes, dataset: xr.Dataset) -> None:
    """The Pareto front as stairs below which no setting is, and the names of the cheapest for each error."""
    rows = np.flatnonzero(dataset.on_front.values)
    rows = rows[np.argsort(dataset.total_cpu_seconds.values[rows], kind="stable")]
    cpu, error = dataset.total_cpu_seconds.values, 100.0 * dataset.l2_error.values
    ax.step(cpu[rows], error[rows], where="post", color="black", lw=1.4, zorder=4, label="Pareto front")
    ax.plot(cpu[rows], error[rows], "o", ms=7, mfc="none", mec="black", mew=1.0, zorder=5)
    kept = zip(dataset.cheapest_case.values, dataset.wanted_error.values, strict=True)
    cheapest = {
        int(i): f"within {100.0 * wanted:g} %: " for i, wanted in kept if i >= 0
    }  # the least that it keeps
    for i, within in (cheapest or {int(row): "" for row in rows[-1:]}).items():
        text = within + str(dataset.setting.values[i]).replace(", ", "\n", 1)
        ax.annotate(
            text, (cpu[i], error[i]), xytext=(-6, -4), textcoords="offset points", ha="right", va="top",
            fontsize=7, zorder=7,
        )  # fmt: skip
