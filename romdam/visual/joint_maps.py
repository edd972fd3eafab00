"""Maps of the joints of a dam: each in its own plane, horizontal ones in plan, all at one scale of length."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from romdam.core.arrays import Floats
from romdam.visual.joint_plots import joints_of_kinds
from romdam.visual.style import axis_name

_LEVEL = 0.99  # vertical part of a joint's normal from which on it is shown in plan
_ROW_OF_GAPS = 1e-9  # of a joint's length, within which its gaps stand in a row
_BESIDE, _BELOW, _LINE = 0.55, 0.48, 0.13  # inches: numbers and name of an axis; a line of a title
_LETTER = 0.056  # inches, of a title
_LEAST, _TICK = 0.22, 0.32  # inches: of a map, and between its numbers
_BAR = 0.95  # inches, of the bar of colours with its numbers
_MOST_HIGH = 9.0  # inches of all maps, which get smaller until they fit
_SMALLEST = 0.9  # inches of the largest map, below which it gets no smaller
_SIZE = 7.0  # points of letters


@dataclass(frozen=True)
class JointPlane:
    """Where the gaps of a joint stand in its plane.

    Attributes
    ----------
    across, up : (n,) coordinates, distances in the plane; x and y of a horizontal joint [unit of positions]
    names : of both axes
    """

    across: Floats
    up: Floats
    names: tuple[str, str]

    @property
    def size(self) -> Floats:
        """Its extent across and up, (2,)."""
        return np.array([np.ptp(self.across), np.ptp(self.up)])


def plane_of(position: Floats) -> JointPlane:
    """The plane of a joint's gaps, (n, 3): in plan where it is horizontal, else upright along its slope."""
    away = position - position.mean(axis=0)
    size, axes = np.linalg.svd(away, full_matrices=True)[1:]
    in_a_row = len(size) < 2 or size[1] <= _ROW_OF_GAPS * max(size[0], 1e-300)
    vertical = np.array([0.0, 0.0, 1.0])
    if in_a_row:  # no normal: upright, unless the row is level
        level = abs(float(axes[0, 2])) <= _ROW_OF_GAPS
        normal = vertical if level else np.cross(axes[0], vertical)
        if np.linalg.norm(normal) < _ROW_OF_GAPS:  # a vertical row
            normal = np.array([0.0, -1.0, 0.0])
        normal = normal / np.linalg.norm(normal)
    else:
        normal = axes[2]
    if abs(normal[2]) > _LEVEL:
        return JointPlane(position[:, 0], position[:, 1], ("x", "y"))
    up = vertical - normal[2] * normal
    up /= np.linalg.norm(up)
    across = np.cross(up, normal)
    across = across if across.sum() >= 0.0 else -across
    return JointPlane(position @ across, position @ up, (axis_name(across, "across"), axis_name(up, "up")))


def map_panels(
    planes: Mapping[str, JointPlane],
    titles: Mapping[str, str],
    norm: Normalize,
    *,
    label: str,
    unit: str,
    width: float,
    highest: float,
    above: float = 0.0,
) -> tuple[Figure, dict[str, Axes]]:
    """Empty panels for maps of joints at one scale of length, a new row for each kind, with a bar of colours.

    Parameters
    ----------
    planes : of the joints, in the order of the panels
    titles : above the panels
    norm, label : values of the ends of the bar of colours, and its name
    unit : of lengths
    width : of the figure at most [in]
    highest : map at most, and the blank above all of them `above` [in]
    """
    rows: list[list[str]] = []
    extent = {name: plane.size for name, plane in planes.items()}
    largest = np.max([*extent.values()], axis=0)
    scale = min((width - _BAR - _BESIDE) / max(largest[0], 1e-9), highest / max(largest[1], 1e-9))
    letters = {name: _LETTER * max(map(len, title.split("\n"))) for name, title in titles.items()}
    lines = max(title.count("\n") + 1 for title in titles.values())
    while True:
        box = {name: np.maximum(scale * size, _LEAST) for name, size in extent.items()}
        slot = {name: _BESIDE + max(float(box[name][0]), letters[name]) for name in planes}
        rows = []
        for of_kind in joints_of_kinds(planes).values():
            room = 0.0
            for name in of_kind:
                room -= slot[name]
                if room < 0.0:
                    rows.append([])
                    room = width - _BAR - slot[name]
                rows[-1].append(name)
        heights = [max(float(box[name][1]) for name in row) + _LINE * lines + _BELOW for row in rows]
        if sum(heights) <= _MOST_HIGH or scale * largest.max() <= _SMALLEST:
            break
        scale *= 0.93
    high = max(sum(heights), 1.6) + above
    wide = max(sum(slot[name] for name in row) for row in rows) + _BAR
    figure = Figure(figsize=(wide, high))
    axes, top = dict[str, Axes](), high - above
    for row, height in zip(rows, heights, strict=True):
        left, bottom = 0.0, top - height + _BELOW
        for name in row:
            w, h = box[name]
            rectangle = ((left + _BESIDE) / wide, bottom / high, w / wide, h / high)
            axes[name] = _panel(figure, rectangle, planes[name], box[name] / scale, unit)
            axes[name].set_title(titles[name], fontsize=_SIZE, loc="left", pad=3.0)
            for axis, inches in ((axes[name].xaxis, w), (axes[name].yaxis, h)):
                bins = max(1, int(inches / _TICK))
                axis.set_major_locator(MaxNLocator(bins, steps=[1, 2, 5, 10], min_n_ticks=1))
            left += slot[name]
        top -= height
    bar_high = min(3.0, high - above - 0.3)
    bar = figure.add_axes(((wide - _BAR + 0.15) / wide, (high - above - 0.15 - bar_high) / high,
                           0.13 / wide, bar_high / high))  # fmt: skip
    figure.colorbar(ScalarMappable(norm, "viridis"), cax=bar, label=label)
    bar.tick_params(labelsize=_SIZE)
    return figure, axes


def _panel(
    figure: Figure, place: tuple[float, float, float, float], plane: JointPlane, reach: Floats, unit: str
) -> Axes:
    """Axes at a place of the figure, with a joint in their middle and `reach` of its plane (2,)."""
    ax = figure.add_axes(place)
    middle = [0.5 * (float(values.min()) + float(values.max())) for values in (plane.across, plane.up)]
    ax.set_xlim(middle[0] - 0.5 * reach[0], middle[0] + 0.5 * reach[0])
    ax.set_ylim(middle[1] - 0.5 * reach[1], middle[1] + 0.5 * reach[1])
    ax.grid(visible=False)
    ax.tick_params(labelsize=_SIZE, length=2.0, pad=2.0)
    ax.set_xlabel(f"{plane.names[0]} [{unit}]", fontsize=_SIZE, labelpad=1.0)
    ax.set_ylabel(f"{plane.names[1]} [{unit}]", fontsize=_SIZE, labelpad=1.0)
    return ax
