"""Figures of a comparison of variants: histories on top of one another, and how far they are apart."""

from __future__ import annotations

from collections.abc import Callable

import matplotlib as mpl
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from romdam.visual.style import COLOURS, GREY, STYLE, align_labels, scaled

_MOST = 12  # rows of a figure
_DASHES = ("-", "--", ":", "-.")


def displacement_histories(comparison: xr.Dataset) -> Figure | None:
    """Displacement of every output node in the compared component."""
    return _vectors(comparison, "displacement", "node")


def relative_histories(comparison: xr.Dataset) -> Figure | None:
    """Relative displacement of every pair in the compared component."""
    return _vectors(comparison, "relative_displacement", "pair")


def opening_histories(comparison: xr.Dataset) -> Figure | None:
    """Opening of the widest gap of every joint."""
    if "widest_opening" not in comparison:
        return None
    return _figure(comparison, comparison.widest_opening, "joint", "opening of\n{}")


def acceleration_histories(comparison: xr.Dataset) -> Figure | None:
    """Acceleration of every output node in the compared component, relative to the base."""
    return _vectors(comparison, "acceleration", "node")


def relative_acceleration_histories(comparison: xr.Dataset) -> Figure | None:
    """Relative acceleration of every pair in the compared component."""
    return _vectors(comparison, "relative_acceleration", "pair")


def quantity_histories(comparison: xr.Dataset) -> Figure:
    """Two results, see `romdam.error.two_results`: every quantity that they share, some dozen of them."""
    quantities = comparison["quantity"].values[:_MOST]
    first, second = comparison.variant.values
    chosen = comparison.history.sel(quantity=quantities).assign_attrs(comparison.history.attrs)
    labelled = comparison.assign_attrs(reference=second, record=f"{first} against {second}")
    return _figure(labelled, chosen, "quantity", "{}")


HISTORIES: dict[str, Callable[[xr.Dataset], Figure | None]] = {
    "displacement": displacement_histories,
    "relative": relative_histories,
    "opening": opening_histories,
    "acceleration": acceleration_histories,
    "relative_acceleration": relative_acceleration_histories,
}


def _vectors(comparison: xr.Dataset, name: str, dim: str) -> Figure | None:
    if name not in comparison:
        return None
    axis = comparison.attrs["compared_component"]
    words = f"{axis} of {{}}" if dim == "node" else f"{axis} across\n{{}}"
    return _figure(comparison, comparison[name].sel(component=axis), dim, words)


def _figure(comparison: xr.Dataset, values: xr.DataArray, dim: str, words: str) -> Figure:
    """A row for every place: all histories, and what each is more than the reference's."""
    places, reference = values[dim].values, comparison.attrs["reference"]
    difference = values - values.sel(variant=reference, drop=True)
    units = str(values.attrs.get("units", "m"))
    in_unit, _, unit = scaled(values, units)
    off, _, small = scaled(difference, units)
    with mpl.rc_context(STYLE):
        height = 2.2 if len(places) < 4 else 1.5
        figure = Figure(figsize=(11.0, height * len(places) + 1.1), layout="constrained")
        panels = figure.subplots(len(places), 2, squeeze=False, sharex=True)
        for point, (left, right) in zip(places, panels, strict=True):
            _lines(left, in_unit.sel({dim: point}), reference)
            _lines(right, off.sel({dim: point}), reference)
            left.set_ylabel(f"{words.format(point)} [{unit}]")
            right.set_ylabel(f"[{small}]")
            left.set_xlim(float(values.time[0]), float(values.time[-1]))
        panels[0][0].set_title(f"{comparison.attrs['record']}", loc="left")
        panels[0][1].set_title(f"difference to: {reference}", loc="left")
        for ax in panels[-1]:
            ax.set_xlabel("time [s]")
        handles, labels = panels[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(4, len(labels)))
        align_labels(figure.axes)
    return figure


def _lines(ax: Axes, rows: xr.DataArray, reference: str) -> None:
    """Every variant, the reference as a broad line beneath the others."""
    ax.axhline(0.0, color=GREY, lw=0.5, zorder=0)
    others = [name for name in rows.variant.values if name != reference]
    ax.plot(rows.time, rows.sel(variant=reference), color=GREY, lw=2.6, alpha=0.6, label=reference)
    for k, name in enumerate(others):
        colour, dash = COLOURS[k % len(COLOURS)], _DASHES[k // len(COLOURS) % len(_DASHES)]
        ax.plot(rows.time, rows.sel(variant=name), color=colour, ls=dash, lw=0.9, label=str(name))
