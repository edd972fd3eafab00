"""The largest opening of every gap as a map of each joint, within its rim."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.tri import Triangulation

from romdam.core.arrays import Floats, Ints
from romdam.visual.joint_plots import joints_of_kinds
from romdam.visual.style import GREY
from romdam.visual.suite_plots import WIDTH, display_unit

_ROW = 3  # joints of a row
_HOLLOW = 3.0  # of the sum of two discs' radii: gaps farther apart have a hollow between them


def opening_map(envelopes: xr.Dataset) -> Figure:
    """Largest opening of every gap over all runs, in each joint's plane, on discs of the gaps' own areas.

    Between the discs nothing is known, and nothing is drawn; they are cut off at the joint's rim.
    """
    names = [str(name) for name in envelopes.joint.values]
    planes = {n: plane_of(envelopes.gap_position.values[envelopes.gap_joint.values == n]) for n in names}
    kinds = joints_of_kinds(names) if len(names) > _ROW else {"": names}  # joints of a kind have like faces
    rows = [of[k : k + _ROW] for of in kinds.values() for k in range(0, len(of), _ROW)]
    columns = max(map(len, rows))
    shape = {name: float(np.ptp(x) / max(np.ptp(y), 1e-9)) for name, (x, y) in planes.items()}
    width = float(np.clip(columns * (3.4 * max(shape.values()) + 0.5) + 1.3, 2.4, WIDTH))
    each = (width - 1.3) / columns - 0.4
    heights = [float(np.clip(each / min(shape[name] for name in row), 0.3, 2.9)) + 0.5 for row in rows]
    figure = Figure(figsize=(width, max(sum(heights), 2.4)), layout="constrained")
    grid = figure.subplots(len(rows), columns, squeeze=False, height_ratios=heights)
    axes = {name: ax for row, row_axes in zip(rows, grid, strict=True)
            for name, ax in zip(row, row_axes, strict=False)}  # fmt: skip
    for ax in {*grid.ravel()} - {*axes.values()}:
        ax.set_visible(False)
    factor, unit = display_unit(envelopes.opening, "m")
    peaks = factor * np.nanmax(envelopes.opening.values[-1], axis=0)
    norm = Normalize(min(0.0, float(peaks.min())), float(peaks.max()))
    for name, ax in axes.items():
        chosen = envelopes.gap_joint.values == name
        across, up = planes[name]
        size = 2.0 * np.sqrt(envelopes.gap_area.values[chosen] / np.pi)
        discs = EllipseCollection(
            size, size, 0.0 * size, units="xy", offsets=np.column_stack([across, up]),
            transOffset=ax.transData, array=peaks[chosen], norm=norm, cmap="viridis", lw=0,
        )  # fmt: skip
        ax.add_collection(discs)
        outline = outline_of(across, up, 0.5 * size)
        reach = 0.5 * size if outline is None else 0.0 * size
        if outline is not None:
            discs.set_clip_path(outline, ax.transData)
            ax.add_patch(PathPatch(outline, fill=False, ec=GREY, lw=0.6))
        ax.update_datalim(np.column_stack([across - reach, up - reach]))
        ax.update_datalim(np.column_stack([across + reach, up + reach]))
        ax.autoscale_view()
        ax.grid(visible=False)
        ax.set_aspect("equal")
        ax.set_title(name, fontsize=8)
    for row in rows:
        axes[row[0]].set_ylabel("up [m]")
    for name in rows[-1]:
        axes[name].set_xlabel("across [m]")
    figure.colorbar(
        ScalarMappable(norm, "viridis"), ax=list(grid.ravel()), label=f"largest opening [{unit}]", shrink=0.8
    )
    return figure


def outline_of(x: Floats, y: Floats, radius: Floats) -> Path | None:
    """The rim of a joint whose gaps stand on it and within, as loops; None for gaps in a row.

    Triangles between gaps much farther apart than the discs of their areas are wide lie across a hollow.
    """
    try:
        mesh = Triangulation(x, y)
    except (RuntimeError, ValueError):  # fewer than three, or all in a row
        return None
    ends = np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)])
    length = np.hypot(*(np.diff(axis[ends], axis=0)[0] for axis in (x, y)))
    across = (length > _HOLLOW * (radius[ends[0]] + radius[ends[1]])).any(axis=1)
    mesh.set_mask(across)
    rim = ends[:, (mesh.neighbors < 0) & ~across[:, None]]  # edges with no triangle on their other side
    loops = [Path(np.column_stack([x[loop], y[loop]]), closed=True) for loop in _loops(rim)]
    return Path.make_compound_path(*loops) if loops else None


def _loops(edges: Ints) -> list[list[int]]:
    """Chains of edges (2, n) that close, each with its first point at its end again."""
    follows: dict[int, list[int]] = {}
    for begin, end in edges.T.tolist():
        follows.setdefault(begin, []).append(end)
    loops = []
    while follows:
        loop = [next(iter(follows))]
        while loop[-1] in follows:
            ends = follows[loop[-1]]
            loop.append(ends.pop())
            if not ends:
                del follows[loop[-2]]
        loops.append(loop)
    return loops


def plane_of(position: Floats) -> tuple[Floats, Floats]:
    """Coordinates of a joint's gaps across and up: along its longest horizontal extent, and z; (n,) [m].

    A horizontal joint is shown in plan.
    """
    flat = position[:, :2] - position[:, :2].mean(axis=0)
    _, _, axes = np.linalg.svd(flat, full_matrices=False) if len(flat) > 1 else (0, 0, np.eye(2))
    along = axes[0] if axes[0].sum() >= 0.0 else -axes[0]
    if np.ptp(position[:, 2]) <= 1e-9 * max(1.0, float(np.abs(position).max())):
        return flat @ along, flat @ np.array([-along[1], along[0]])
    return flat @ along, position[:, 2]
