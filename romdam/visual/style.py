"""The look of all figures: one palette, one set of sizes, units that suit the numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from romdam.core.arrays import Floats
from romdam.core.display_units import SI, DisplayUnits
from romdam.core.round_off import NOTHING

# Okabe and Ito's palette, told apart with any colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
GREY = "#999999"
# settings of windows and of the machine, which a style leaves as they are
_NO_STYLE = (
    "backend", "interactive", "toolbar", "tk.", "webagg.", "timezone", "date.epoch", "docstring.",
    "figure.max_open_warning", "figure.raise_window", "savefig.directory",
)  # fmt: skip
# on matplotlib's own defaults: the user's style sheet or matplotlibrc may be dark, or ask for a TeX
STYLE: dict[Any, Any] = {k: v for k, v in mpl.rcParamsDefault.items() if not k.startswith(_NO_STYLE)} | {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "savefig.facecolor": "white",
}
_LABEL_INCHES = 0.46  # from a vertical axis to its name: ticks and "−1000"
_LEFT, _RIGHT = 0.84, 0.22  # inches beside panels: names of two lines; half a number
_ABOVE, _BELOW, _BETWEEN = 0.32, 0.5, 0.14  # inches
_LEGEND_ROW, _LEGEND_PAD = 0.19, 0.14  # inches of a legend
_COLUMNS = 4  # of a legend at most
LINES = ("-", "--", ":")  # of what shares a colour
_NEAR = 0.99  # cosine of the angle below which a direction has an axis' name


def new_figure(
    rows: int, height: float, ratios: tuple[float, ...] | None = None
) -> tuple[Figure, list[Axes]]:
    """Panels under one another with a common time axis, `height` of each in inches; see `fit_panels`."""
    figure = Figure(figsize=(7.2, height * rows + 0.6))
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=ratios)
    return figure, list(grid[:, 0])


def scaled(values: xr.DataArray, units: str, system: DisplayUnits = SI) -> tuple[xr.DataArray, float, str]:
    """Values in a unit that suits the largest of them.

    Parameters
    ----------
    units : of the values, as files state them

    Returns
    -------
    the scaled values, the factor they were multiplied by, the unit's name
    """
    largest = float(abs(values).max()) if values.size else 0.0
    if largest < NOTHING:  # round-off is drawn and told as 0
        return values * 0.0, 0.0, system.suited(units, 0.0)[1]
    size, unit = system.suited(units, largest)
    return values / size, 1.0 / size, unit


def same_limits(axes: Iterable[Axes]) -> None:
    """Give panels of one quantity the vertical scale of the largest, so that they can be compared."""
    panels = list(axes)
    low, high = np.array([ax.get_ylim() for ax in panels]).T
    for ax in panels:
        ax.set_ylim(low.min(), high.max())


def legend_below(figure: Figure, axes: Iterable[Axes]) -> None:
    """A legend under the panels, where it covers neither titles nor data; each label once."""
    handles_of: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles_of.setdefault(label, handle)
    figure.legend(
        handles_of.values(),
        handles_of.keys(),
        loc="outside lower center",
        ncols=min(_COLUMNS, max(1, len(handles_of))),
    )


def mark_point(ax: Axes, row: xr.DataArray, at: tuple[float, float], text: str) -> None:
    """A dot at a time and a value with a text beside it, to its left where it comes late in the row."""
    ax.plot([at[0]], [at[1]], "o", ms=3, color=COLOURS[1], zorder=5)
    late = at[0] > float(row.time[0]) + 0.75 * float(row.time[-1] - row.time[0])
    ax.annotate(
        text, at, xytext=(-6 if late else 6, 0), textcoords="offset points",
        va="center", ha="right" if late else "left", fontsize=7.5,
    )  # fmt: skip


def finish(figure: Figure, axes: list[Axes], dataset: xr.Dataset, title: str) -> Figure:
    """Panels over time in the end: their common axis, and the title with the record."""
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(dataset.time[0]), float(dataset.time[-1]))
    axes[0].set_title(f"{title}  ·  {dataset.attrs['record']}", loc="left")
    return fit_panels(figure, axes)


def fit_panels(figure: Figure, axes: list[Axes]) -> Figure:
    """Give the panels of `new_figure` what titles, names, numbers and legends leave.

    All of them have one size, so nothing is measured: a constrained layout takes two fifths of the drawing.
    """
    align_labels(axes)
    legends = [-(-len(legend.get_texts()) // _COLUMNS) for legend in figure.legends]
    bottom = _BELOW + sum(_LEGEND_PAD + _LEGEND_ROW * rows for rows in legends)
    wide, high = figure.get_size_inches()
    each = (high - _ABOVE - bottom - (len(axes) - 1) * _BETWEEN) / len(axes)
    figure.subplots_adjust(
        left=_LEFT / wide, right=1.0 - _RIGHT / wide, top=1.0 - _ABOVE / high, bottom=bottom / high,
        hspace=_BETWEEN / each,
    )  # fmt: skip
    return figure


def align_labels(axes: Iterable[Axes]) -> None:
    """Put the names of vertical axes at one distance, where numbers of `scaled` values have room.

    `Figure.align_ylabels` measures every panel's numbers for every panel's name: a third of drawing.
    """
    for ax in axes:
        shift = ScaledTranslation(-_LABEL_INCHES, 0.0, ax.figure.dpi_scale_trans)
        ax.yaxis.set_label_coords(0.0, 0.5, transform=ax.transAxes + shift)


def directions(dataset: xr.Dataset) -> dict[str, Floats]:
    """Name -> unit vector of the three directions that components are shown along.

    They are those of the stream where the result says which way is upstream, else the global axes.
    """
    up = np.array([0.0, 0.0, 1.0])
    if "upstream" not in dataset.attrs:
        return {f"along {axis}": row for axis, row in zip("xyz", np.eye(3), strict=True)}
    down = -np.asarray(dataset.attrs["upstream"], dtype=float)
    return {"downstream": down, "to the right bank": np.cross(down, up), "up": up}


def range_colours(low: float, high: float) -> Colormap:
    """Colours of values whose sign matters: white at zero, from there on as far as the value is."""
    most = max(-low, high)
    first, last = ((0.5 + 0.5 * end / most if most > 0.0 else 0.5) for end in (low, high))
    return ListedColormap(mpl.colormaps["RdBu_r"](np.linspace(first, last, 256)))


def axis_name(direction: Floats, otherwise: str) -> str:
    """Name of the global axis along which a direction points, or nearly."""
    k = int(np.abs(direction).argmax())
    return "xyz"[k] if abs(direction[k]) > _NEAR else otherwise


def side_name(towards: Floats, upstream: Floats | None) -> str:
    """From which side something is seen whose eye lies in a direction."""
    if upstream is not None and abs(share := float(towards @ upstream)) > 0.5 * np.linalg.norm(towards):
        return f"from {'upstream' if share > 0.0 else 'downstream'}"
    long, short = np.argsort(-np.abs(towards[:2]))
    names = [f"{'-' if towards[k] < 0.0 else '+'}{'xy'[k]}" for k in (long, short)]
    return f"from {names[0]}, and {names[1]}"


def image_panels(images: dict[str, Any], title: str) -> tuple[Figure, list[Axes]]:
    """Images (rows, columns, 3) of equal size side by side under their names, without axes."""
    rows, columns = next(iter(images.values())).shape[:2]
    figure = Figure(figsize=(4.6 * len(images), 4.6 * rows / columns + 0.9), layout="constrained")
    axes = list(figure.subplots(1, len(images), squeeze=False)[0])
    for ax, (name, image) in zip(axes, images.items(), strict=True):
        ax.imshow(image)
        ax.set_title(name, fontsize=8)
        ax.set_axis_off()
    figure.suptitle(title, fontsize=9, x=0.02, ha="left")
    return figure, axes


def image_grid(images: dict[str, Any], title: str) -> tuple[Figure, list[Axes]]:
    """Images of equal size in rows, up to four tall ones or two broad ones in each, under their titles."""
    high, wide = next(iter(images.values())).shape[:2]
    rows = -(-len(images) // (4 if high > wide else 2))
    columns = -(-len(images) // rows)
    width = max(2.2, min(5.0, 4.2 * wide / high))
    height = (width * high / wide + 0.5) * rows
    figure = Figure(figsize=(width * columns + 1.2, height + 0.4), layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for ax in axes:
        ax.set_axis_off()
    for ax, (name, image) in zip(axes, images.items(), strict=False):
        ax.imshow(image)
        ax.set_title(name, fontsize=8)
    figure.suptitle(title, fontsize=9, x=0.02, ha="left")
    return figure, axes
