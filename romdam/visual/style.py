"""The look of all figures: one palette, one set of sizes, units that suit the numbers."""

from __future__ import annotations

from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito's palette, told apart with any colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
GREY = "#999999"
STYLE: dict[Any, Any] = {
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
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def new_figure(
    rows: int, height: float, ratios: tuple[float, ...] | None = None
) -> tuple[Figure, list[Axes]]:
    """Panels under one another with a common time axis; `height` of each in inches."""
    figure = Figure(figsize=(7.2, height * rows + 0.6), layout="constrained")
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=ratios)
    return figure, list(grid[:, 0])


def scaled(values: xr.DataArray, unit: str) -> tuple[xr.DataArray, float, str]:
    """Values in a unit whose prefix keeps the largest between 1 and 1000.

    Returns
    -------
    the scaled values, the factor they were multiplied by, the unit's name
    """
    largest = float(abs(values).max()) if values.size else 0.0
    size, prefix = next(((s, p) for s, p in _PREFIXES if largest >= s), (1.0, ""))
    return values / size, 1.0 / size, prefix + unit


def image_panels(images: list[Any], title: str) -> tuple[Figure, list[Axes]]:
    """Images (rows, columns, 3) of equal size side by side, without axes."""
    rows, columns = images[0].shape[:2]
    figure = Figure(figsize=(4.6 * len(images), 4.6 * rows / columns + 0.9), layout="constrained")
    axes = list(figure.subplots(1, len(images), squeeze=False)[0])
    for ax, image in zip(axes, images, strict=True):
        ax.imshow(image)
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
