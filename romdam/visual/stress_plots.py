"""Figures of stress over time, and of its duration and extent beside the limits of the USACE."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from romdam.visual.style import COLOURS, GREY, new_figure, scaled

# Limits where linear analysis still serves: at a ratio of 1, falling to none at 2 (EM 1110-2-6053, chapter 4)
DURATION_LIMITS = {"arch dams": 0.4, "gravity dams": 0.3}  # [s]
AREA_LIMIT = 20.0  # [%] of an arch dam's face


def stress_histories(dataset: xr.Dataset) -> Figure | None:
    """Major principal, cantilever and arch stress of the named nodes, one panel a node."""
    if "stress_probe" not in dataset:
        return None
    names = list(dataset.stress_probe.values)
    figure, axes = new_figure(rows=len(names), height=2.1)
    for ax, name in zip(axes, names, strict=True):
        own = dataset.sel(stress_probe=name)
        lines = {
            "major principal": own.principal_stress[:, 0],
            "cantilever": own.vertical_stress,
            "arch": own.arch_stress,
        }
        _, factor, unit = scaled(abs(own.principal_stress), "Pa")
        for k, (label, values) in enumerate(lines.items()):
            if values.notnull().any():
                ax.plot(dataset.time, values * factor, color=COLOURS[k], lw=0.8, label=label)
        if "tensile_strength" in dataset:
            ax.axhline(
                float(dataset.tensile_strength) * factor, color=GREY, lw=1.0, ls="--", label="strength"
            )
        ax.set_ylabel(f"{name}\nstress [{unit}]")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4)
    axes[0].set_title(f"Stress, tension positive  ·  {dataset.attrs['record']}", loc="left", y=1.08)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(dataset.time[0]), float(dataset.time[-1]))
    figure.align_ylabels()
    return figure


def stress_damage(dataset: xr.Dataset) -> Figure | None:
    """Longest duration and largest extent of stress above multiples of the strength, beside their limits."""
    if "cumulative_inelastic_duration" not in dataset:
        return None
    faces = "overstressed_area" in dataset
    figure = Figure(figsize=(8.6 if faces else 4.6, 3.2), layout="constrained")
    axes = list(figure.subplots(1, 1 + faces, squeeze=False)[0])
    level = dataset.dcr_level.values
    longest = dataset.cumulative_inelastic_duration.max("stress_node").values
    axes[0].plot(level, longest, "o-", ms=3, color=COLOURS[1], label="longest at any node")
    for k, (name, limit) in enumerate(DURATION_LIMITS.items()):
        axes[0].plot([1.0, 2.0], [limit, 0.0], color=GREY, ls=("--", ":")[k], lw=1.2, label=f"limit, {name}")
    axes[0].set_ylabel("cumulative inelastic duration [s]")
    if faces:
        _areas(axes[1], dataset)
    for ax in axes:
        ax.set_xlabel("demand-capacity ratio")
        ax.set_xlim(1.0, 2.0)
        ax.set_ylim(0.0, 1.25 * max(0.1, ax.get_ylim()[1]))
        ax.legend(loc="upper right")
    figure.suptitle(
        f"Stress above the tensile strength of {float(dataset.tensile_strength) / 1e6:.3g} MPa  ·  "
        f"{dataset.attrs['record']}", fontsize=9, x=0.02, ha="left",
    )  # fmt: skip
    return figure


def _areas(ax: Axes, dataset: xr.Dataset) -> None:
    """Overstressed share of each face, and of all of them together."""
    level, area = dataset.dcr_level.values, dataset.overstressed_area.values
    whole = dataset.stress_face_area.values
    for share in 100.0 * area / whole[:, None] if len(whole) > 1 else np.zeros((0, len(level))):
        ax.plot(level, share, color=COLOURS[0], lw=0.7, alpha=0.45)
    label = "all faces" if len(whole) > 1 else str(dataset.stress_face.values[0])
    ax.plot(level, 100.0 * area.sum(axis=0) / whole.sum(), "o-", ms=3, color=COLOURS[1], label=label)
    if len(whole) > 1:
        ax.plot([], [], color=COLOURS[0], lw=0.7, label="each face")
    ax.plot([1.0, 2.0], [AREA_LIMIT, 0.0], color=GREY, ls="--", lw=1.2, label="limit, arch dams")
    ax.set_ylabel("overstressed part of the face [%]")
