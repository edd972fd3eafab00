"""Figures of stress over time, and of its duration and extent beside the limits of the USACE."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from romdam.core.arrays import Floats
from romdam.core.display_units import SI, DisplayUnits
from romdam.postprocess.maxima import limits_of
from romdam.postprocess.stress.faces import LARGEST_RATIO
from romdam.postprocess.stress.summary import duration_above
from romdam.visual.style import COLOURS, GREY, finish, legend_below, new_figure, scaled


def stress_histories(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Major principal, cantilever and arch stress of the named nodes, one panel a node."""
    if "stress_probe" not in dataset:
        return None
    names = list(dataset.stress_probe.values)
    figure, axes = new_figure(rows=len(names), height=2.1)
    for ax, name in zip(axes, names, strict=True):
        of_probe = dataset.sel(stress_probe=name)
        lines = {
            "major principal": of_probe.principal_stress[:, 0],
            "cantilever": of_probe.vertical_stress,
            "arch": of_probe.arch_stress,
        }
        _, factor, unit = scaled(abs(of_probe.principal_stress), "Pa", system)
        for k, (label, values) in enumerate(lines.items()):
            if values.notnull().any():
                ax.plot(dataset.time, values * factor, color=COLOURS[k], lw=0.8, label=label)
        if "tensile_strength" in dataset:
            ax.axhline(
                float(dataset.tensile_strength) * factor, color=GREY, lw=1.0, ls="--", label="strength"
            )
        ax.set_ylabel(f"{name}\nstress [{unit}]")
    legend_below(figure, axes)
    return finish(figure, axes, dataset, "Stress, tension positive")


def stress_sections(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Force, moment and linearised stress of every section over time, one row a section."""
    if "section_force" not in dataset:
        return None
    names = [str(name) for name in dataset.section.values]
    figure = Figure(figsize=(11.0, 0.9 + 2.1 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), 3, squeeze=False, sharex=True)
    kinds = (("force", "axis", "N"), ("moment", "axis", "N m"), ("stress", "side", "Pa"))
    for column, (kind, dim, unit) in zip(axes.T, kinds, strict=True):
        values, dim = dataset[f"section_{kind}"], f"section_{dim}"
        size, name_of_unit = system.suited(unit, 1e6)
        for ax, name in zip(column, names, strict=True):
            for k, along in enumerate(values[dim].values):
                force = values.sel({"section": name, dim: along}) / size
                ax.plot(dataset.time, force, color=COLOURS[k], lw=0.8, label=str(along))
            ax.set_ylabel(f"{name}\n{kind} [{name_of_unit}]")
        column[0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4 if kind == "stress" else 3,
                         fontsize=7, columnspacing=0.8, handlelength=1.2)  # fmt: skip
        column[-1].set_xlabel("time [s]")
    axes[0, 0].set_xlim(float(dataset.time[0]), float(dataset.time[-1]))
    figure.suptitle(
        f"Sections, tension positive  ·  {dataset.attrs['record']}", fontsize=9, x=0.02, ha="left"
    )
    return figure


def stress_damage(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Duration and extent of stress above multiples of the strength, beside the limits of linear analysis.

    Durations are linear up to the largest limit and logarithmic above, so that limits and curves both show.
    """
    if "cumulative_inelastic_duration" not in dataset:
        return None
    faces = "face_overstressed_share" in dataset
    figure = Figure(figsize=(9.2 if faces else 5.2, 4.0), layout="constrained")
    axes = list(figure.subplots(1, 1 + faces, squeeze=False)[0])
    if faces:
        lines = _face_curves(dataset, "face_inelastic_duration")
    else:  # the longest duration at any node outside the ring
        duration = dataset.cumulative_inelastic_duration.values
        counted = (
            dataset.stress_ring.values == 0 if "stress_ring" in dataset else np.ones(len(duration), bool)
        )
        lines = {("any node", "total"): duration[counted].max(axis=0, initial=0.0)}
    of_probes = {}
    for name in dataset.stress_probe.values if "stress_probe" in dataset else ():
        major = dataset.principal_stress.sel(stress_probe=name).values[:, :1]
        levels, dt = dataset.dcr_level.values * float(dataset.tensile_strength), float(dataset.time[1])
        of_probes[str(name), "total"] = np.array([duration_above(major, x, dt)[0] for x in levels])
    _curves(axes[0], dataset, {**lines, **of_probes})
    known = limits_of(dataset)
    largest = max(limits.duration for limits in known.values())
    axes[0].set_yscale("symlog", linthresh=largest, linscale=1.5)
    axes[0].set_ylim(-0.02 * largest, max(1.5 * largest, 1.3 * axes[0].get_ylim()[1]))
    axes[0].set_yticks([0.0, *(x.duration for x in known.values()), 1.0, 3.0, 10.0, 30.0])
    axes[0].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes[0].set_ylim(top=max(1.5 * largest, 1.3 * max(np.nanmax(y, initial=0.0) for y in lines.values())))
    axes[0].set_ylabel(f"longest cumulative inelastic duration [s],\nlogarithmic above {largest:g} s")
    if faces:
        _curves(axes[1], dataset, _face_curves(dataset, "face_overstressed_share"))
        most = float(np.nanmax(dataset.face_overstressed_share.values, initial=0.0))
        axes[1].set_ylim(-0.5, max(1.5 * max(x.area for x in known.values()), 1.1 * most))
        axes[1].set_ylabel("overstressed part of the face [%]")
    ratio = np.array([1.0, LARGEST_RATIO])
    for (kind, limits), style in zip(known.items(), ("-", ":"), strict=False):
        for ax, values in zip(axes, (limits.duration_at(ratio), np.full(2, limits.area)), strict=False):
            ax.plot(ratio, values, color="black", lw=1.8, ls=style, label=f"limit, {kind}s")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3 if faces else 2)
    strength = float(dataset.tensile_strength)
    size, unit = system.suited("Pa", strength)
    figure.suptitle(
        f"Stress above the tensile strength of {strength / size:.3g} {unit}\n"
        f"outside the ring; dashed: of the change  ·  {dataset.attrs['record']}",
        fontsize=9, x=0.02, ha="left",
    )  # fmt: skip
    return figure


def _face_curves(dataset: xr.Dataset, variable: str) -> dict[tuple[str, str], Floats]:
    """(face, total or change) -> values at every demand-capacity ratio."""
    pairs = [(str(f), str(b)) for f in dataset.stress_face.values for b in dataset.stress_basis.values]
    return {(f, b): dataset[variable].sel(stress_face=f, stress_basis=b).values for f, b in pairs}


def _curves(ax: Axes, dataset: xr.Dataset, lines: dict[tuple[str, str], Floats]) -> None:
    """One colour for each name, dashed for the change."""
    names = list(dict.fromkeys(name for name, _ in lines))
    for (name, basis), values in lines.items():
        colour, total = COLOURS[names.index(name) % len(COLOURS)], basis == "total"
        style, label = ("-" if total else "--"), (name if total else None)
        ax.plot(dataset.dcr_level, values, style, color=colour, lw=1.3, label=label)
    ax.set_xlabel("demand-capacity ratio")
    ax.set_xlim(1.0, LARGEST_RATIO)
