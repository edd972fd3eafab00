"""The largest opening of every gap as a map of each joint, within its rim."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.tri import Triangulation

from romdam.core.arrays import Floats, Ints
from romdam.visual.joint_maps import map_panels, plane_of
from romdam.visual.style import GREY
from romdam.visual.suite_plots import WIDTH, display_unit

_HOLLOW = 3.0  # of the sum of two discs' radii: gaps farther apart have a hollow between them
_HIGHEST = 2.9  # inches of a map


def opening_map(envelopes: xr.Dataset) -> Figure | None:
    """Largest opening of every gap over all runs, in each joint's plane, on discs of the gaps' own areas.

    Between the discs nothing is known, and nothing is drawn; they are cut off at the joint's rim. Nothing
    where no joint opens.
    """
    names = [str(name) for name in envelopes.joint.values]
    factor, unit = display_unit(envelopes.opening, "m")
    peaks = factor * np.nanmax(envelopes.opening.values[-1], axis=0)
    if not float(peaks.max(initial=0.0)) > 0.0:
        return None
    chosen = {name: envelopes.gap_joint.values == name for name in names}
    planes = {name: plane_of(envelopes.gap_position.values[gaps]) for name, gaps in chosen.items()}
    norm = Normalize(min(0.0, float(peaks.min())), float(peaks.max()))
    figure, axes = map_panels(
        planes, {name: name for name in names}, norm,
        label=f"largest opening [{unit}]", unit="m", width=WIDTH, highest=_HIGHEST,
    )  # fmt: skip
    for name, ax in axes.items():
        across, up = planes[name].across, planes[name].up
        size = 2.0 * np.sqrt(envelopes.gap_area.values[chosen[name]] / np.pi)
        discs = EllipseCollection(
            size, size, 0.0 * size, units="xy", offsets=np.column_stack([across, up]),
            transOffset=ax.transData, array=peaks[chosen[name]], norm=norm, cmap="viridis", lw=0,
        )  # fmt: skip
        ax.add_collection(discs)
        outline = outline_of(across, up, 0.5 * size)
        if outline is not None:
            discs.set_clip_path(outline, ax.transData)
            ax.add_patch(PathPatch(outline, fill=False, ec=GREY, lw=0.6, clip_on=False))
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
