"""Figures of joints that carry shear: how they move along each direction, slip, and how safe they are."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
    scaled,
)

_SHOWN = (0.8, 20.0)  # factors of safety
_MOVES = 0.02  # of the largest component, below which one is not drawn


def component_panels(
    dataset: xr.Dataset, vectors: xr.DataArray, dim: str, what: str
) -> tuple[Figure, list[Axes]]:
    """Vectors (time, dim, component) along the stream, across it and up: a panel for each that moves."""
    along = {
        name: (vectors * xr.DataArray(axis, dims="component")).sum("component")
        for name, axis in directions(dataset).items()
    }
    least = _MOVES * max(float(abs(values).max()) for values in along.values())
    moving = {name: values for name, values in along.items() if float(abs(values).max()) > least}
    figure, axes = new_figure(rows=max(1, len(moving)), height=2.3)
    for ax, (name, component) in zip(axes, moving.items(), strict=False):
        values, _, unit = scaled(component, "m")
        for k, joint in enumerate(values[dim].values):
            colour, ls = COLOURS[k % len(COLOURS)], LINES[k // len(COLOURS) % len(LINES)]
            ax.plot(values.time, values.sel({dim: joint}), color=colour, ls=ls, lw=0.9, label=str(joint))
        ax.set_ylabel(f"{what}\n{name} [{unit}]")
        ax.axhline(0.0, color=GREY, lw=0.5, zorder=0)
    legend_below(figure, axes[:1])
    return figure, axes


def joint_displacements(dataset: xr.Dataset) -> Figure | None:
    """Mean displacement of block J relative to block I of every joint since the start, by direction."""
    if "joint_displacement" not in dataset:
        return None
    figure, axes = component_panels(dataset, dataset.joint_displacement, "joint", "relative displacement")
    return finish(figure, axes, dataset, "Relative displacement across the joints, J over I, mean over each")


def joint_slip(dataset: xr.Dataset) -> Figure | None:
    """Slip of the gap that slips most against time, and its range, one panel for each joint that slides.

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
        xr.DataArray(size, dims=("time", "gap"), coords={"time": dataset.time}), "m"
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
    return finish(
        figure, axes, dataset, "Slip: the gap that slips most (line) and range over the joint (band)"
    )


def sliding_histories(dataset: xr.Dataset) -> Figure | None:
    """Factor of safety against sliding, and slip of block J over block I since the start, of every joint."""
    if "sliding_safety_factor" not in dataset:
        return None
    figure, axes = new_figure(rows=2, height=2.4)
    slip, _, unit = scaled(mean_slip(dataset), "m")
    for k, name in enumerate(dataset.joint.values):
        colour, ls = COLOURS[k % len(COLOURS)], LINES[k // len(COLOURS) % len(LINES)]
        axes[0].plot(dataset.time, dataset.sliding_safety_factor.sel(joint=name), color=colour, ls=ls, lw=0.8)
        axes[1].plot(dataset.time, slip.sel(joint=name), color=colour, ls=ls, lw=0.9, label=str(name))
    axes[0].axhline(1.0, color=GREY, lw=0.8, ls="--", zorder=0)
    label = f"factor of safety against\nsliding, shown up to {_SHOWN[1]:g}"
    axes[0].set(yscale="log", ylim=_SHOWN, ylabel=label)
    axes[0].set_yticks([1, 2, 3, 5, 10, 20], ["1", "2", "3", "5", "10", "20"])
    axes[1].set_ylabel(f"slip along the joint\n[{unit}]")
    legend_below(figure, axes)
    return finish(figure, axes, dataset, "Sliding")


def dissipated_energies(dataset: xr.Dataset) -> Figure | None:
    """Energy that the gaps of each joint have dissipated since the start, the largest at the end first."""
    if "dissipated_energy" not in dataset or not float(dataset.dissipated_energy[-1].max()) > 0.0:
        return None
    gaps, joints = dataset.dissipated_energy, dataset.gap_joint.values
    totals = xr.concat([gaps[:, joints == name].sum("gap") for name in dataset.joint.values], "joint")
    values, _, unit = scaled(totals.assign_attrs(gaps.attrs), "J")
    figure, axes = new_figure(rows=1, height=2.6)
    for rank, k in enumerate(np.argsort(-values[:, -1].values, kind="stable")):
        colour, ls = COLOURS[rank % len(COLOURS)], LINES[rank // len(COLOURS) % len(LINES)]
        label = f"{dataset.joint.values[k]}, {float(values[k, -1]):.3g} {unit}"
        axes[0].plot(dataset.time, values[k], color=colour, ls=ls, lw=0.9, label=label)
    axes[0].set_ylabel(f"dissipated energy\n[{unit}]")
    legend_below(figure, axes)
    return finish(figure, axes, dataset, "Energy dissipated in the joints, sum over the gaps of each")
