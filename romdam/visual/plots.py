"""Figures of one result, each made from its Dataset alone; to add one, add it to FIGURES.

A figure is drawn without pyplot, so that no global state, backend or style is touched.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heapify, heappop, heappush
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import TriAnalyzer, Triangulation

from romdam.core.display_units import SI, DisplayUnits
from romdam.core.files import replacing
from romdam.core.round_off import NOTHING, ROUND_OFF, without_round_off
from romdam.postprocess.joint_roles import bearing_first
from romdam.postprocess.maxima import peak_ground_acceleration, peak_opening_time, written_note
from romdam.visual.floor_plots import floor_spectra_figure
from romdam.visual.joint_maps import map_panels, plane_of
from romdam.visual.joint_plots import (
    component_panels,
    dissipated_energies,
    joint_displacements,
    joint_slip,
    sliding_histories,
)
from romdam.visual.stress_plots import stress_damage, stress_histories, stress_sections
from romdam.visual.style import (
    COLOURS,
    GREY,
    STYLE,
    finish,
    fit_panels,
    legend_below,
    mark_point,
    new_figure,
    same_limits,
    scaled,
)

Array = np.ndarray

_DPI = 160
_COMPRESSION = 3  # of zlib: level 6 takes 0.03 s longer for the figures of a run, to make them 10 % smaller
_BROADEST, _HIGHEST = 7.6, 3.4  # inches: of all maps of a row with their bar of colours; of a map
_HEADING = 0.45  # inches above all maps
_AT_REST = 1e-6  # of the largest energy, below which none is said to rest at the start
_FLAT = 0.08  # inscribed over circumscribed circle of a triangle on the rim, below which it is left out
_NAMED = 6  # joints that never open, in a title
_WHOLE = 0.995  # of areas that count as equal: a joint's and its map's


def ground_motion(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Ground acceleration of every shaken component; marked is the peak over all steps."""
    acc = dataset.ground_acceleration
    shaken = [c for c in acc.component.values if float(abs(acc.sel(component=c)).max()) > 0.0]
    if not shaken:
        return None
    figure, axes = new_figure(rows=len(shaken), height=1.9)
    (size, unit), peaks = system.suited("m s-2", 1.0), peak_ground_acceleration(dataset)
    for ax, component in zip(axes, shaken, strict=True):
        row = acc.sel(component=component) / size
        ax.plot(acc.time, row, color=COLOURS[0], lw=0.7)
        peak, k = float(peaks.sel(component=component)) / size, int(np.abs(row.values).argmax())
        when = f"{'near' if written_note(dataset) else 'at'} {float(row.time[k]):.2f} s"
        mark_point(ax, row, (float(row.time[k]), float(row[k])), f"{peak:.3g} {unit} {when}")
        ax.set_ylabel(f"ground acc. {component}\n[{unit}]")
    return finish(figure, axes, dataset, "Ground motion")


def top_displacements(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Displacement of the output nodes along the stream, across it and up; a panel for each that moves."""
    if "displacement" not in dataset or not float(abs(dataset.displacement).max()) > NOTHING:
        return None
    figure, axes = component_panels(dataset, dataset.displacement, "node", "displacement", system)
    return finish(figure, axes, dataset, "Displacement of the output nodes, relative to the base")


def joint_opening(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Largest opening of each joint against time, a panel a joint, all at one scale; marked is the peak.

    An opening that does not move has no mark. Nothing where no gap opens or is pressed together.
    """
    if "opening" not in dataset:
        return None
    if not float(abs(dataset.opening).max()) > NOTHING:
        return None
    names = list(dataset.joint.values)
    figure, axes = new_figure(rows=len(names), height=2.1 if len(names) < 4 else 1.4)
    every, factor, unit = scaled(dataset.opening, "m", system)  # one unit, so that panels can be compared
    for ax, name in zip(axes, names, strict=True):
        values = every[:, dataset.gap_joint.values == name]
        ax.fill_between(
            dataset.time, values.min("gap"), values.max("gap"), color=COLOURS[0], alpha=0.25, lw=0
        )
        ax.plot(dataset.time, values.max("gap"), color=COLOURS[0], lw=0.9, label="widest gap")
        ax.axhline(0.0, color=GREY, lw=0.5, zorder=0)
        peak, when = factor * float(dataset.peak_opening.sel(joint=name)), peak_opening_time(dataset, name)
        if when is not None:
            mark_point(ax, values, (when, peak), f"{peak:.3g} {unit} at {when:.2f} s")
        ax.set_ylabel(f"{name}\nopening [{unit}]")
    same_limits(axes)
    return finish(figure, axes, dataset, "Joint opening: widest gap (line) and range over the joint (band)")


def opening_envelope(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Largest opening of every gap over the joint's face, one map a joint that opens, with its largest."""
    if "gap_peak_opening" not in dataset:
        return None
    least = max(ROUND_OFF * float(dataset.peak_opening.max()), NOTHING)
    opens = dataset.peak_opening.values > least
    names = [str(name) for name in dataset.joint.values[opens]]
    if not names:
        return None
    foot, length = system.foot
    chosen = {name: dataset.gap_joint.values == name for name in names}
    planes = {name: plane_of(dataset.gap_position.values[gaps] / foot) for name, gaps in chosen.items()}
    peaks, _, unit = scaled(dataset.gap_peak_opening, "m", system)
    of_names = peaks.values[np.isin(dataset.gap_joint.values, names)]
    norm = Normalize(min(0.0, float(of_names.min())), float(of_names.max()))
    titles = {name: f"{name}\n{float(peaks.values[gaps].max()):.3g} {unit}" for name, gaps in chosen.items()}
    figure, axes = map_panels(
        planes, titles, norm,
        label=f"largest opening [{unit}]", unit=length, width=_BROADEST, highest=_HIGHEST, above=_HEADING,
    )  # fmt: skip
    for name, ax in axes.items():
        x, y, values = planes[name].across, planes[name].up, peaks.values[chosen[name]]
        if np.ptp(x) > 0.0 and np.ptp(y) > 0.0:
            mesh = within_outline(x, y, float(dataset.gap_area.values[chosen[name]].sum()) / foot**2)
            ax.tripcolor(mesh, values, norm=norm, cmap="viridis", shading="gouraud")
            ax.scatter(x, y, s=2, color="white", lw=0)
        else:  # gaps in a row have no face
            ax.scatter(x, y, c=values, s=24, norm=norm, cmap="viridis", lw=0, clip_on=False)
    shut = [str(name) for name in dataset.joint.values[~opens]]
    closed = f"; never open: {', '.join(shut[:_NAMED])}" if shut else ""
    closed += f" and {len(shut) - _NAMED} more" if len(shut) > _NAMED else ""
    wide, high = figure.get_size_inches()
    heading = f"Opening envelope{closed}\n{dataset.attrs['record']}"
    figure.suptitle(heading, fontsize=9, x=0.1 / wide, y=1.0 - 0.06 / high, ha="left", va="top")
    return figure


def energy_ledger(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Draw where the energy is: stacked parts against input and what rested at the start, and the imbalance.

    What the time stepping takes is one part: of its two terms only the sum is never negative. A dam with
    weight and water has strain energy before it is shaken: the stack starts at it, and so does the line.
    """
    parts = ["kinetic", "strain", "joint_stored", "damping", "friction", "contact"]
    values = {p: dataset[f"energy_{p}"].values for p in parts}
    if "energy_numerical" in dataset:
        values["contact"] = values["contact"] + dataset.energy_numerical.values
    nonzero = [p for p in parts if values[p].any()]
    if not nonzero:
        return None
    at_rest = float(sum(row[0] for row in values.values())) - float(dataset.energy_input[0])
    figure, axes = new_figure(rows=2, height=2.6, ratios=(3, 1))
    supplied, factor, unit = scaled(dataset.energy_input + at_rest, "J", system)
    stack = [values[p] * factor for p in nonzero]
    labels = [_ENERGY_LABELS.get(p, p) for p in nonzero]
    colours = [COLOURS[parts.index(p)] for p in nonzero]  # the same part has the same colour in every figure
    axes[0].stackplot(dataset.time.values, stack, labels=labels, colors=colours, lw=0, alpha=0.85)
    rests = abs(at_rest) > _AT_REST * float(abs(supplied).max()) / factor
    label = "initial strain energy + input" if rests else "input"
    axes[0].plot(dataset.time, supplied, color="black", lw=1.0, label=label)
    if rests:
        label = f"initial strain energy, {at_rest * factor:.3g} {unit}"
        axes[0].axhline(at_rest * factor, color="black", lw=0.9, ls="--", label=label)
    axes[0].set_ylabel(f"energy [{unit}]")
    most = float(abs(supplied).max())
    residual = dataset.energy_residual.copy(data=without_round_off(dataset.energy_residual, most / factor))
    imbalance, _, unit = scaled(residual, "J", system)
    axes[1].plot(dataset.time, imbalance, color=COLOURS[0], lw=0.8)
    if not imbalance.any():  # a closed ledger
        axes[1].set_ylim(-1.0, 1.0)
    axes[1].set_ylabel(f"imbalance\n[{unit}]")
    legend_below(figure, axes[:1])
    return finish(figure, axes, dataset, "Energy ledger")


_ENERGY_LABELS = {"joint_stored": "joint springs", "contact": "time stepping"}

FIGURES: dict[str, Callable[[xr.Dataset, DisplayUnits], Figure | None]] = {
    "ground_motion": ground_motion,
    "top_displacements": top_displacements,
    "joint_opening": joint_opening,
    "opening_envelope": opening_envelope,
    "joint_displacement": joint_displacements,
    "joint_slip": joint_slip,
    "sliding": sliding_histories,
    "energy": energy_ledger,
    "dissipated_energy": dissipated_energies,
    "floor_spectra": floor_spectra_figure,
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
    paths, dataset = [], bearing_first(dataset)
    for name, draw in FIGURES.items():
        with mpl.rc_context(STYLE):
            figure = draw(dataset, SI)
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
        legend_below(figure, axes)
        fit_panels(figure, axes)
    return figure


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure whole or not at all; `savefig` would draw it twice, once for its layout alone."""
    figure.set_dpi(_DPI)
    write_png: Callable[..., None] = FigureCanvasAgg(figure).print_png
    with replacing(path) as unfinished:
        write_png(unfinished, pil_kwargs={"compress_level": _COMPRESSION})
    return path


def within_outline(x: Array, y: Array, area: float) -> Triangulation:
    """Triangles between gaps, less those in the joint's hollows and those flat on its rim.

    Where the hull of the gaps is larger than the joint's area, triangles go from the rim inwards, the longest
    edge first, until the area is the joint's; each that goes lays bare a gap that was inside.

    References
    ----------
    Duckham, Kulik, Worboys, Galton (2008), Efficient generation of simple polygons for characterizing the
    shape of a set of points in the plane, Pattern Recognition 41, 3224-3236: the chi-shape.
    """
    mesh = Triangulation(x, y)
    corners, neighbours = np.stack([x, y], axis=1)[mesh.triangles], mesh.neighbors
    edges = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(edges, axis=2)
    size = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2.0
    rim = [(-length[t, k], t, k) for t, k in np.argwhere(neighbours < 0)]
    bare = {int(mesh.triangles[t, j % 3]) for _, t, k in rim for j in (k, k + 1)}
    gone, left = np.zeros(len(size), dtype=bool), float(size.sum())
    heapify(rim)
    while rim and _WHOLE * left > area:
        _, t, k = heappop(rim)
        far = int(mesh.triangles[t, (k + 2) % 3])
        if gone[t] or far in bare or left - size[t] < _WHOLE * area:
            continue
        gone[t], left = True, left - float(size[t])
        bare.add(far)
        for other in (neighbours[t, (k + 1) % 3], neighbours[t, (k + 2) % 3]):
            if other >= 0 and not gone[other]:
                j = int(np.flatnonzero(neighbours[other] == t)[0])
                heappush(rim, (-length[other, j], other, j))
    mesh.set_mask(gone)
    mesh.set_mask(TriAnalyzer(mesh).get_flat_tri_mask(_FLAT))
    return mesh
