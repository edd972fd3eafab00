"""Figures of one result, each made from its Dataset alone; to add one, add it to FIGURES.

A figure is drawn without pyplot, so that no global state, backend or style is touched.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import TriAnalyzer, Triangulation

from romdam.core.files import replacing
from romdam.visual.sliding_plots import sliding_histories
from romdam.visual.stress_plots import stress_damage, stress_histories, stress_sections
from romdam.visual.style import COLOURS, GREY, STYLE, new_figure, scaled

Array = np.ndarray

_DPI = 160
_COMPRESSION = 3  # of zlib: level 6 takes 0.03 s longer for the figures of a run, to make them 10 % smaller
_FLAT = 0.08  # inscribed over circumscribed circle of a triangle on the rim, below which it is left out


def ground_motion(dataset: xr.Dataset) -> Figure:
    """Ground acceleration of every shaken component."""
    acc = dataset.ground_acceleration
    shaken = [c for c in acc.component.values if float(abs(acc.sel(component=c)).max()) > 0.0] or ["x"]
    figure, axes = new_figure(rows=len(shaken), height=1.9)
    for ax, component in zip(axes, shaken, strict=True):
        row = acc.sel(component=component)
        ax.plot(acc.time, row, color=COLOURS[0], lw=0.7)
        _mark_peak(ax, row, "{:.2f} m/s²")
        ax.set_ylabel(f"ground acc. {component}\n[m/s²]")
    return _finish(figure, axes, dataset, "Ground motion")


def top_displacements(dataset: xr.Dataset) -> Figure | None:
    """Displacement of the output nodes, one panel for each component that moves."""
    if "displacement" not in dataset:
        return None
    disp = dataset.displacement
    largest = abs(disp).max(("time", "node"))
    moving = [
        c for c in disp.component.values if float(largest.sel(component=c)) > 0.02 * float(largest.max())
    ]
    figure, axes = new_figure(rows=max(1, len(moving)), height=2.3)
    for ax, component in zip(axes, moving, strict=False):
        values, _, unit = scaled(disp.sel(component=component), "m")
        for k, node in enumerate(disp.node.values):
            ax.plot(
                disp.time, values.sel(node=node), color=COLOURS[k % len(COLOURS)], lw=0.9, label=str(node)
            )
        ax.set_ylabel(f"displacement {component}\n[{unit}]")
        ax.axhline(0.0, color=GREY, lw=0.5, zorder=0)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=6)
    return _finish(figure, axes, dataset, "Displacement of the output nodes, relative to the base")


def joint_opening(dataset: xr.Dataset) -> Figure | None:
    """Largest opening of each joint against time, one panel a joint."""
    if "opening" not in dataset:
        return None
    names = list(dataset.joint.values)
    figure, axes = new_figure(rows=len(names), height=2.1 if len(names) < 4 else 1.4)
    for ax, name in zip(axes, names, strict=True):
        values, _, unit = scaled(dataset.opening[:, dataset.gap_joint.values == name], "m")
        ax.fill_between(
            dataset.time, values.min("gap"), values.max("gap"), color=COLOURS[0], alpha=0.25, lw=0
        )
        ax.plot(dataset.time, values.max("gap"), color=COLOURS[0], lw=0.9, label="widest gap")
        ax.axhline(0.0, color=GREY, lw=0.5, zorder=0)
        _mark_peak(ax, values.max("gap"), "{:.3g} " + unit)
        ax.set_ylabel(f"{name}\nopening [{unit}]")
    return _finish(figure, axes, dataset, "Joint opening: widest gap (line) and range over the joint (band)")


def opening_envelope(dataset: xr.Dataset) -> Figure | None:
    """Largest opening of every gap over the joint's face, one map a joint."""
    if "gap_peak_opening" not in dataset:
        return None
    names = list(dataset.joint.values)
    columns = min(4, len(names))
    rows = -(-len(names) // columns)
    face = max(_width_over_height(dataset, name) for name in names)
    figure = Figure(figsize=(columns * (4.0 * face + 0.8) + 1.2, 4.8 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    peaks, _, unit = scaled(dataset.gap_peak_opening, "m")
    norm = Normalize(min(0.0, float(peaks.min())), float(peaks.max()))
    for ax, name in zip(axes, names, strict=False):
        _face_map(ax, dataset, dataset.gap_joint.values == name, peaks, norm)
        ax.set_title(str(name))
    for ax in axes[len(names) :]:
        ax.set_visible(False)
    bar = mpl.cm.ScalarMappable(norm, "viridis")
    figure.colorbar(bar, ax=list(axes[: len(names)]), label=f"largest opening [{unit}]", shrink=0.85)
    figure.suptitle(f"Opening envelope\n{dataset.attrs['record']}", fontsize=9, x=0.02, ha="left")
    return figure


def energy_ledger(dataset: xr.Dataset) -> Figure:
    """Draw where the input energy is: stacked parts against the input, and the imbalance.

    What the time stepping takes is one part: of its two terms only the sum is never negative.
    """
    parts = ["kinetic", "strain", "joint_stored", "damping", "friction", "contact"]
    values = {p: dataset[f"energy_{p}"].values for p in parts}
    if "energy_numerical" in dataset:
        values["contact"] = values["contact"] + dataset.energy_numerical.values
    shown = [p for p in parts if values[p].any()]
    figure, axes = new_figure(rows=2, height=2.6, ratios=(3, 1))
    supplied, factor, unit = scaled(dataset.energy_input, "J")
    stack = [values[p] * factor for p in shown]
    labels = [_ENERGY_LABELS.get(p, p) for p in shown]
    colours = [COLOURS[parts.index(p)] for p in shown]  # the same part has the same colour in every figure
    axes[0].stackplot(dataset.time.values, stack, labels=labels, colors=colours, lw=0, alpha=0.85)
    axes[0].plot(dataset.time, supplied, color="black", lw=1.0, label="input")
    axes[0].set_ylabel(f"energy [{unit}]")
    axes[0].legend(loc="upper left")
    imbalance, _, unit = scaled(dataset.energy_residual, "J")
    axes[1].plot(dataset.time, imbalance, color=COLOURS[0], lw=0.8)
    axes[1].set_ylabel(f"imbalance\n[{unit}]")
    return _finish(figure, axes, dataset, "Energy ledger")


_ENERGY_LABELS = {"joint_stored": "joint springs", "contact": "time stepping"}

FIGURES: dict[str, Callable[[xr.Dataset], Figure | None]] = {
    "ground_motion": ground_motion,
    "top_displacements": top_displacements,
    "joint_opening": joint_opening,
    "opening_envelope": opening_envelope,
    "sliding": sliding_histories,
    "energy": energy_ledger,
    "stress": stress_histories,
    "stress_damage": stress_damage,
    "stress_sections": stress_sections,
}


def write_plots(dataset: xr.Dataset, folder: Path, stem: str) -> list[Path]:
    """Write every figure that the dataset has data for as `folder`/`stem`-<figure>.png.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """
    paths = []
    for name, draw in FIGURES.items():
        with mpl.rc_context(STYLE):
            figure = draw(dataset)
            if figure is not None:
                paths.append(save_figure(figure, folder / f"{stem}-{name}.png"))
    return paths


def opening_comparison(histories: dict[str, tuple[Array, Array]], title: str) -> Figure:
    """Widest opening against time of several computations.

    Parameters
    ----------
    histories : label -> (time (nt,) [s], opening (nt, ng) [m]); the first is drawn on top
    title : of the figure
    """
    with mpl.rc_context(STYLE):
        figure, axes = new_figure(rows=1, height=2.9)
        for k, (label, (time, opening)) in reversed(list(enumerate(histories.items()))):
            widest, style = opening.max(axis=1) * 1e3, "-" if k else "--"
            axes[0].plot(time, widest, style, color=COLOURS[1 - k % 2], lw=1.0 if k else 1.2, label=label)
            axes[0].set_xlim(time[0], time[-1])
        axes[0].set_ylabel("widest opening [mm]")
        axes[0].set_xlabel("time [s]")
        axes[0].set_title(title, loc="left")
        axes[0].legend(loc="upper left")
    return figure


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure whole or not at all; `savefig` would draw it twice, once for its layout alone."""
    figure.set_dpi(_DPI)
    write_png: Callable[..., None] = FigureCanvasAgg(figure).print_png
    with replacing(path) as part:
        write_png(part, pil_kwargs={"compress_level": _COMPRESSION})
    return path


def _finish(figure: Figure, axes: list[Axes], dataset: xr.Dataset, title: str) -> Figure:
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(dataset.time[0]), float(dataset.time[-1]))
    axes[0].set_title(f"{title}  ·  {dataset.attrs['record']}", loc="left")
    figure.align_ylabels()
    return figure


def _mark_peak(ax: Axes, row: xr.DataArray, text: str) -> None:
    """A dot and a number at the largest absolute value."""
    k = int(np.abs(row.values).argmax())
    x, y = float(row.time[k]), float(row[k])
    ax.plot([x], [y], "o", ms=3, color=COLOURS[1], zorder=5)
    label = f"{text.format(y)} at {x:.2f} s"
    ax.annotate(label, (x, y), xytext=(6, 0), textcoords="offset points", va="center", fontsize=7.5)


def _face_map(ax: Axes, dataset: xr.Dataset, chosen: Array, peaks: xr.DataArray, norm: Normalize) -> None:
    """One joint's gaps in its own plane: the local axis nearest to vertical up, the other across."""
    x, y = _face_coordinates(dataset, chosen)
    if np.ptp(x) > 0.0 and np.ptp(y) > 0.0:
        mesh = Triangulation(x, y)
        mesh.set_mask(TriAnalyzer(mesh).get_flat_tri_mask(_FLAT))  # those across a hollow edge
        ax.tripcolor(mesh, peaks.values[chosen], norm=norm, cmap="viridis", shading="gouraud")
        ax.scatter(x, y, s=2, color="white", lw=0)
    else:  # gaps in a row have no face
        ax.scatter(x, y, c=peaks.values[chosen], s=24, norm=norm, cmap="viridis", lw=0)
    ax.grid(visible=False)
    ax.set_aspect("equal")
    ax.set_xlabel("across [m]")
    ax.set_ylabel("up [m]")


def _face_coordinates(dataset: xr.Dataset, chosen: Array) -> tuple[Array, Array]:
    """Positions of gaps across and up their joint's plane [m]."""
    position = dataset.gap_position.values[chosen]
    across, up = _plane_axes(dataset.gap_tangent.values[chosen].mean(axis=0))
    return position @ across, position @ up


def _width_over_height(dataset: xr.Dataset, name: str) -> float:
    """Shape of a joint's face, kept between what a figure can show."""
    x, y = _face_coordinates(dataset, dataset.gap_joint.values == name)
    return float(np.clip(np.ptp(x) / max(np.ptp(y), 1e-9), 0.25, 1.5))


def _plane_axes(tangents: Array) -> tuple[Array, Array]:
    """Unit vectors across and up the joint plane from its local axes j and k, (2, 3)."""
    normal = np.cross(tangents[0], tangents[1])
    normal /= np.linalg.norm(normal)
    up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    if np.linalg.norm(up) < 1e-6:
        up = tangents[1]
    up = up / np.linalg.norm(up)
    across = np.cross(up, normal)
    return (across if across.sum() >= 0.0 else -across), up
