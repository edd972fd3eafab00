"""Figures of joints that carry shear: how they move along each direction, slip, and how safe they are."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from romdam.core.display_units import SI, DisplayUnits
from romdam.core.round_off import NOTHING, without_round_off
from romdam.core.system import SLIP
from romdam.postprocess.sliding import mean_slip
from romdam.visual.style import (
    COLOURS,
    GREY,
    LINES,
    directions,
    finish,
    legend_below,
    mark_point,
    new_figure,
    same_limits,
    scaled,
)

_FACTORS = (
    0.5,
    1.0,
    2.0,
    3.0,
    5.0,
    10.0,
    20.0,
)  # of safety that are numbered; beyond, all is far from sliding
_COLUMNS = 5  # of a legend within a panel
_WIDEST, _NARROWEST = 1.8, 0.8  # points of lines, those behind the wider ones
_LEGEND = 0.15  # of a panel's height, for each row of its legend
_MOVES = 0.02  # of the largest component, below which one is not drawn


def component_panels(
    dataset: xr.Dataset, vectors: xr.DataArray, dim: str, what: str, system: DisplayUnits
) -> tuple[Figure, list[Axes]]:
    """Vectors (time, dim, component) along the stream, across it and up: a panel for each that moves."""
    along = {
        name: (vectors * xr.DataArray(axis, dims="component")).sum("component")
        for name, axis in directions(dataset).items()
    }
    _, factor, unit = scaled(
        xr.concat(along.values(), "along"), "m", system
    )  # one unit, so that panels can be compared
    least = _MOVES * max(float(abs(values).max()) for values in along.values())
    moving = {name: values for name, values in along.items() if float(abs(values).max()) > least}
    figure, axes = new_figure(rows=max(1, len(moving)), height=2.3)
    for ax, (name, component) in zip(axes, moving.items(), strict=False):
        values = component * factor
        for k, joint in enumerate(values[dim].values):
            colour, ls = COLOURS[k % len(COLOURS)], LINES[k // len(COLOURS) % len(LINES)]
            ax.plot(values.time, values.sel({dim: joint}), color=colour, ls=ls, lw=0.9, label=str(joint))
        ax.set_ylabel(f"{what}\n{name} [{unit}]")
        ax.axhline(0.0, color=GREY, lw=0.5, zorder=0)
    legend_below(figure, axes[:1])
    return figure, axes


def joint_displacements(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Mean displacement of block J relative to block I of every joint since the start, by direction."""
    if "joint_displacement" not in dataset or not float(abs(dataset.joint_displacement).max()) > NOTHING:
        return None
    figure, axes = component_panels(
        dataset, dataset.joint_displacement, "joint", "relative displacement", system
    )
    return finish(figure, axes, dataset, "Relative displacement across the joints, J over I, mean over each")


def joint_slip(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Slip of the gap that slips most against time, and its range, a panel at one scale for each that slides.

    The number is the peak over all steps, whose time is not kept: its dot is at the largest written row.
    """
    if "slip" not in dataset:
        return None
    slid, joints = (dataset.joint_state == SLIP).any("time").values, dataset.gap_joint.values
    names = [name for name in dataset.joint.values if slid[joints == name].any()]
    if not names:
        return None
    size = np.hypot(*dataset.slip.transpose("tangent", ...).values)
    values, factor, unit = scaled(
        xr.DataArray(size, dims=("time", "gap"), coords={"time": dataset.time}), "m", system
    )
    figure, axes = new_figure(rows=len(names), height=2.1 if len(names) < 4 else 1.4)
    for ax, name in zip(axes, names, strict=True):
        slip = values[:, joints == name]
        ax.fill_between(slip.time, slip.min("gap"), slip.max("gap"), color=COLOURS[0], alpha=0.25, lw=0)
        ax.plot(slip.time, slip.max("gap"), color=COLOURS[0], lw=0.9, label="largest slip")
        most = slip.max("gap")
        at = most[int(most.values.argmax())]
        peak = factor * float(dataset.peak_slip.sel(joint=name))
        mark_point(ax, slip, (float(at.time), float(at)), f"{peak:.3g} {unit} near {float(at.time):.2f} s")
        ax.set_ylabel(f"{name}\nslip [{unit}]")
    same_limits(axes)
    return finish(
        figure, axes, dataset, "Slip: the gap that slips most (line) and range over the joint (band)"
    )


def joints_of_kinds(names: Iterable[str]) -> dict[str, list[str]]:
    """Kind -> names of its joints: base_1 and base_2 are of the kind base; no number, its own."""
    kinds = dict[str, list[str]]()
    for name in names:
        kinds.setdefault(re.split(r"[_\W]?\d", name)[0] or name, []).append(name)
    return kinds


def sliding_histories(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Factor of safety against sliding, and slip of block J over block I since the start.

    A pair of panels for each kind of joint, those of one unit: base_1, base_2, ... are of the kind base.
    """
    if "sliding_safety_factor" not in dataset:
        return None
    kinds = joints_of_kinds(map(str, dataset.joint.values))
    figure, axes = new_figure(rows=2 * len(kinds), height=2.4 if len(kinds) == 1 else 1.9)
    slip, _, unit = scaled(mean_slip(dataset), "m", system)
    factors = dataset.sliding_safety_factor
    known = factors.values[np.isfinite(factors.values)]
    if not known.size and not slip.any():
        return None
    lowest = float(known.min(initial=1.0))
    highest = float(known.max(initial=1.0))
    top = next((tick for tick in _FACTORS[2:] if tick >= highest), _FACTORS[-1])  # as far as there are any
    ticks = [tick for tick in _FACTORS if 0.8 * lowest < tick <= top]
    for row, (kind, names) in enumerate(kinds.items()):
        safety, moved = axes[2 * row : 2 * row + 2]
        for k, name in enumerate(names):
            colour, ls = COLOURS[k % len(COLOURS)], LINES[k % len(LINES)]
            width = _WIDEST - k * (_WIDEST - _NARROWEST) / max(
                len(names) - 1, 1
            )  # mirrored joints move alike
            safety.plot(dataset.time, factors.sel(joint=name), color=colour, ls=ls, lw=width)
            moved.plot(dataset.time, slip.sel(joint=name), color=colour, ls=ls, lw=width, label=name)
        safety.axhline(1.0, color=GREY, lw=0.8, ls="--", zorder=0)
        safety.set(
            yscale="log",
            ylim=(0.8 * min(lowest, 1.0), top),
            ylabel=f"{kind}, factor of\nsafety up to {top:g}",
        )
        safety.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        safety.minorticks_off()
        moved.set_ylabel(f"{kind}\nslip [{unit}]")
        if len(kinds) > 1:
            rows = -(-len(names) // _COLUMNS)
            moved.margins(y=0.0)
            low, high = moved.get_ylim()
            moved.set_ylim(low - 0.05 * (high - low), high + (0.05 + _LEGEND * rows) * (high - low))
            moved.legend(loc="upper left", ncols=_COLUMNS)
    if len(kinds) == 1:
        legend_below(figure, axes)
    return finish(figure, axes, dataset, "Sliding, along the joint")


def dissipated_energies(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Energy that the gaps of each joint have dissipated since the start, the largest at the end first."""
    if "dissipated_energy" not in dataset or not float(dataset.dissipated_energy[-1].max()) > 0.0:
        return None
    gaps, joints = dataset.dissipated_energy, dataset.gap_joint.values
    totals = xr.concat([gaps[:, joints == name].sum("gap") for name in dataset.joint.values], "joint")
    values, _, unit = scaled(totals.assign_attrs(gaps.attrs), "J", system)
    last = without_round_off(values[:, -1])
    figure, axes = new_figure(rows=1, height=2.6)
    for rank, k in enumerate(np.argsort(-values[:, -1].values, kind="stable")):
        colour, ls = COLOURS[rank % len(COLOURS)], LINES[rank // len(COLOURS) % len(LINES)]
        label = f"{dataset.joint.values[k]}, {last[k]:.3g} {unit}"
        axes[0].plot(dataset.time, values[k], color=colour, ls=ls, lw=0.9, label=label)
    axes[0].set_ylabel(f"dissipated energy\n[{unit}]")
    legend_below(figure, axes)
    return finish(figure, axes, dataset, "Energy dissipated in the joints, sum over the gaps of each")
