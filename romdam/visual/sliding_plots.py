"""Figure of sliding: factor of safety and mean slip of every joint over time."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from romdam.postprocess.sliding import mean_slip
from romdam.visual.style import COLOURS, GREY, new_figure, scaled

_SHOWN = (0.8, 20.0)  # factors of safety
_LINES = ("-", "--", ":")  # of the joints that share a colour


def sliding_histories(dataset: xr.Dataset) -> Figure | None:
    """Factor of safety against sliding, and slip of block J over block I since the start, of every joint."""
    if "sliding_safety_factor" not in dataset:
        return None
    figure, axes = new_figure(rows=2, height=2.4)
    slip, _, unit = scaled(mean_slip(dataset), "m")
    for k, name in enumerate(dataset.joint.values):
        colour, ls = COLOURS[k % len(COLOURS)], _LINES[k // len(COLOURS) % len(_LINES)]
        axes[0].plot(dataset.time, dataset.sliding_safety_factor.sel(joint=name), color=colour, ls=ls, lw=0.8)
        axes[1].plot(dataset.time, slip.sel(joint=name), color=colour, ls=ls, lw=0.9, label=str(name))
    axes[0].axhline(1.0, color=GREY, lw=0.8, ls="--", zorder=0)
    axes[0].set(yscale="log", ylim=_SHOWN, ylabel="factor of safety\nagainst sliding")
    axes[0].set_yticks([1, 2, 3, 5, 10, 20], ["1", "2", "3", "5", "10", "20"])
    axes[1].set_ylabel(f"slip along the joint\n[{unit}]")
    axes[1].set(xlabel="time [s]", xlim=(float(dataset.time[0]), float(dataset.time[-1])))
    figure.legend(loc="outside lower center", ncols=min(4, dataset.joint.size))
    axes[0].set_title(f"Sliding  ·  {dataset.attrs['record']}", loc="left")
    figure.align_ylabels()
    return figure
