"""Natural modes in 3-D, and computed against measured frequencies."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from romdam.core.scene import Scene
from romdam.results.case import rock_blocks
from romdam.visual.plots import save_figure
from romdam.visual.rendering import EDGES, Bounds, Image, Picture, fitting_size, grid, surface
from romdam.visual.style import COLOURS, GREY, STYLE, image_grid

_DRAWN = 6  # modes
_SHOWN = 0.08  # of the model's size, that the largest displacement is drawn as
_DIRECTION = np.array([-0.5, -1.0, 0.45])
_PANEL = 640  # pixels of a panel's longer side
_NEAR = 0.05  # band around equal frequencies
_COLOURS = "viridis"


def draw_modes(scene: Scene, dataset: xr.Dataset, path: Path) -> Path:
    """Draw the lowest shapes of the dam's blocks.

    Raises
    ------
    ResultError
        where 3-D pictures cannot be drawn.
    """
    dam = [name for name in scene.blocks if name not in rock_blocks(scene)]
    points = np.concatenate([scene.blocks[name].points for name in dam])
    low, high = points.min(axis=0), points.max(axis=0)
    scale = _SHOWN * float(np.linalg.norm(high - low))
    bounds = low - scale, high + scale
    panels = {}
    for mode in dataset.mode.values[:_DRAWN]:
        shape = dataset.sel(mode=mode)
        masses = 100.0 * shape.effective_mass / shape.total_mass
        shares = ", ".join(f"{axis} {float(masses.sel(direction=axis)):.0f} %" for axis in "xyz")
        name = f"{int(shape.mode)}: {float(shape.frequency):.4g} Hz\neffective mass {shares}"
        panels[name] = _view(scene, dam, shape, scale, bounds)
    with mpl.rc_context(STYLE):
        title = f"{dataset.attrs['title']}  ·  joints {dataset.attrs['joints']}"
        figure, axes = image_grid(panels, title)
        bar = mpl.cm.ScalarMappable(Normalize(0.0, 1.0), _COLOURS)
        label = "displacement over the mode's largest"
        figure.colorbar(bar, ax=axes, label=label, shrink=0.8, pad=0.01, aspect=30)
    return save_figure(figure, path)


def _view(scene: Scene, dam: list[str], mode: xr.Dataset, scale: float, bounds: Bounds) -> Image:
    picture = Picture(bounds, _DIRECTION, fitting_size(bounds, _DIRECTION, _PANEL))
    blocks = mode.block.values
    for name in dam:
        block, shape = scene.blocks[name], np.asarray(mode["shape"].values[blocks == name], dtype=float)
        moved = grid(block.element, block.points + scale * shape, block.cells)
        moved.point_data["size"] = np.linalg.norm(shape, axis=1)
        flat = {"lighting": False, "ambient": 0.0, "diffuse": 1.0}
        picture.add(surface(moved), scalars="size", cmap=_COLOURS, clim=(0.0, 1.0), **flat)
        for at, colour, width in ((block.points, GREY, 1.0), (block.points + scale * shape, EDGES, 1.5)):
            straight = surface(grid(block.element, at, block.cells, straight=True))
            picture.add(straight.extract_feature_edges(30), color=colour, line_width=width, opacity=0.6)
    return picture.image()


def draw_measured(dataset: xr.Dataset, path: Path) -> Path:
    """Draw computed against measured frequencies, with a band of 5 % around equality."""
    measured = dataset.measured_frequency.values
    computed = dataset.frequency.sel(mode=dataset.measured_mode.values).values
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.2, 5.0), layout="constrained")
        ax = figure.subplots()
        ends = np.array([0.0, 1.12 * max(measured.max(), computed.max())])
        ax.fill_between(ends, (1.0 - _NEAR) * ends, (1.0 + _NEAR) * ends, color=GREY, alpha=0.25, lw=0.0)
        ax.plot(ends, ends, color=GREY, lw=0.8)
        ax.plot(measured, computed, "o", color=COLOURS[0], ms=5)
        for name, x, y in zip(dataset.measured.values, measured, computed, strict=True):
            text = f"{name}: {100.0 * (y / x - 1.0):+.1f} %"
            ax.annotate(text, (x, y), xytext=(7, -3), textcoords="offset points", fontsize=7.5)
        ax.set(xlim=ends, ylim=ends, xlabel="measured frequency [Hz]", ylabel="computed frequency [Hz]")
        ax.set_aspect("equal")
        title = f"{dataset.attrs['title']}  ·  joints {dataset.attrs['joints']}; band: 5 %"
        ax.set_title(title, loc="left", wrap=True)
    return save_figure(figure, path)
