"""Figures of a suite, each from a Dataset of `analysis` or the summary; narrow enough for a telephone.

A figure is drawn without pyplot, so that no global state, backend or style is touched.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter

from romdam.core.arrays import Floats
from romdam.core.display_units import SI, DisplayUnits, number, unit_text
from romdam.postprocess.responses import intensity_of, response_of
from romdam.visual.style import COLOURS, GREY, scaled

WIDTH = 4.8  # [in]
_MOST_LINES = 300
_PANELS = 4  # scales of a scatter
_FLAT = 1e-3  # m of height, below which a joint is level
_SHORT_NAME = 12  # letters of a joint's name that stand above a narrow panel
_ASIDE = 0.22  # of the distance of two rows of dots
_FRACTILES = 5  # records, from which on fractiles are between them
_MOST_TICKS = 6  # of a logarithmic axis
_STEPS = (1.0,), (1.0, 3.0), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)  # of its ticks, within a decade


def display_unit(
    values: xr.DataArray | Floats | float, units: str, system: DisplayUnits = SI
) -> tuple[float, str]:
    """The factor and the unit that numbers are shown with."""
    if not system.converts(units):
        return 1.0, unit_text(units)
    finite = np.asarray(values, dtype=float)
    _, factor, unit = scaled(xr.DataArray(finite[np.isfinite(finite)]), units, system)
    return factor, unit


def spectra_figure(spectra: xr.Dataset) -> Figure:
    """Pseudo-acceleration of every record, with their median and fractiles: `psa` (record, period)."""
    figure, ax = _panel()
    psa = spectra.psa.dropna("record", how="all")
    for row in psa.values[:_MOST_LINES]:
        ax.plot(psa.period, row, color=GREY, lw=0.5, alpha=0.6)
    shares = ((0.16, ":", "16 %"), (0.5, "-", "median"), (0.84, "--", "84 %"))
    for share, style, label in shares if psa.sizes["record"] >= _FRACTILES else shares[1:2]:
        ax.plot(psa.period, psa.quantile(share, "record"), color=COLOURS[0], lw=1.5, ls=style, label=label)
    _logarithmic(ax, "x")
    _logarithmic(ax, "y")
    ax.set_xlim(float(psa.period[0]), float(psa.period[-1]))
    ax.set_xlabel("period [s]")
    ax.set_ylabel(f"PSa, {100 * float(spectra.attrs['damping']):g} % damping [m/s²]")
    ax.set_title(f"{psa.sizes['record']} records, {spectra.attrs['scaled']}", loc="left")
    ax.legend(loc="lower left")
    return figure


def worst_figure(worst: xr.Dataset, labels: Sequence[str]) -> Figure:
    """The runs with the largest response as bars, the worst on top."""
    lines = 1 + max(label.count("\n") for label in labels)
    figure, ax = _panel(0.9 + (0.26 if lines == 1 else 0.17 * lines + 0.06) * len(labels))
    factor, unit = display_unit(worst.response, worst.attrs["response_units"])
    at, values = np.arange(len(labels)), worst.response.values * factor
    ax.barh(at, values, color=COLOURS[0], height=0.65)
    for y, value in enumerate(values):
        ax.text(value, y, f" {value:.3g}", va="center", fontsize=8)
    ax.set_yticks(at, labels, fontsize=9 if lines == 1 else 8)
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")
    ax.margins(x=0.12)
    ax.set_xlabel(f"{_name(worst.attrs['response'])} [{unit}]")
    return figure


def ida_figure(ida: xr.Dataset) -> Figure:
    """Incremental curves: response along, intensity up, each record and the fractiles."""
    figure, ax = _panel(3.8)
    factor, unit = display_unit(ida.response, ida.attrs["response_units"])
    y = ida.intensity.transpose("record", "sample", "scale").values.reshape(-1, ida.sizes["scale"])
    x = factor * ida.response.transpose("record", "sample", "scale").values.reshape(y.shape)
    for row_x, row_y in list(zip(x, y, strict=True))[:_MOST_LINES]:
        order = np.argsort(row_y)
        ax.plot(row_x[order], row_y[order], "-o", ms=1.5, color=GREY, lw=0.5, alpha=0.6)
    for k, (style, label) in enumerate(((":", "16 %"), ("-", "median"), ("--", "84 %"))):
        row = factor * ida.fractiles.values[k]
        ax.plot(row, ida.level, color=COLOURS[0], lw=1.6, ls=style, label=label)
    if np.nanmin(x) > 0.0:
        _logarithmic(ax, "x")
    _logarithmic(ax, "y")
    ax.set_xlabel(f"{_name(ida.attrs['response'])} [{unit}]")
    ax.set_ylabel(_measure(ida.attrs))
    ax.set_title(f"{ida.attrs['curves']} curves, {ida.attrs['runs']} runs", loc="left")
    ax.legend(loc="upper left", title="of the response")
    return figure


def fragility_figure(fits: Sequence[xr.Dataset]) -> Figure:
    """Fitted fragilities with their bands, and the shares they were fitted to."""
    figure, ax = _panel(3.8)
    factor, unit = display_unit(
        np.array([fit.attrs["threshold"] for fit in fits]), fits[0].attrs["response_units"]
    )
    for colour, fit in zip(COLOURS, fits, strict=False):
        label = f"> {factor * fit.attrs['threshold']:.3g} {unit}"
        if np.isfinite(float(fit.theta)):
            low, high = fit.probability_bounds.values.T
            ax.fill_between(fit.level, low, high, color=colour, alpha=0.15, lw=0)
            ax.plot(fit.level, fit.probability, color=colour, lw=1.6, label=label)
            label = ""
        ax.plot(
            fit.group_intensity, fit.group_share, "o", ms=4, mfc="white", color=colour, label=label or None
        )
    _logarithmic(ax, "x")
    ax.set_ylim(-0.02, 1.02)
    ax.set_xlabel(_measure(fits[0].attrs))
    ax.set_ylabel(f"probability that {_name(fits[0].attrs['response'])} exceeds")
    counted = fits[0].attrs["method"] == "capacities"
    dots = "records by where they exceed" if counted else "shares of groups of runs"
    ax.set_title(f"{fits[0].attrs['runs']} runs; dots: {dots}", loc="left")
    ax.legend(loc="upper left")
    return figure


def correlation_figure(correlated: xr.Dataset) -> Figure:
    """Rank correlation of a response with every measure within each scale, the closest on top."""
    correlated = correlated.dropna("measure", subset=["spearman"])
    correlated = correlated.isel(measure=np.argsort(-abs(correlated.spearman.values), kind="stable"))
    figure, ax = _panel(1.1 + 0.24 * correlated.sizes["measure"])
    at = np.arange(correlated.sizes["measure"])
    several = correlated.sizes["scale"] > 1
    if not several:
        ax.barh(at, correlated.spearman, color=COLOURS[0], height=0.65)
    colours = colormaps["viridis"](np.linspace(0.0, 0.85, correlated.sizes["scale"]))
    aside = np.linspace(-_ASIDE, _ASIDE, correlated.sizes["scale"])  # so that no dot lies on another
    for k in range(correlated.sizes["scale"] if several else 0):
        label = _scale_text(correlated.scale, k)
        ax.plot(correlated.spearman_at_scale[:, k], at + aside[k], "o", ms=4, color=colours[k], label=label)
    ax.set_yticks(at, [str(name) for name in correlated.measure.values])
    ax.invert_yaxis()
    ax.axvline(0.0, color="black", lw=0.6)
    ax.set_xlim(min(0.0, 1.1 * float(correlated.spearman_at_scale.min())), 1.02)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel(f"rank correlation with {_name(correlated.attrs['response'])}")
    records = correlated.count_at_scale.values
    few, most = int(records.min()), int(records.max())
    ax.set_title(f"n = {most if few == most else f'{few} to {most}'} records at each scale", loc="left")
    if several:
        figure.legend(loc="outside lower center", ncols=4, title="a dot a scale")
    return figure


def _scale_text(scale: xr.DataArray, k: int) -> str:
    unit = unit_text(str(scale.attrs.get("units", "1")))
    return f"{float(scale[k]):.3g} {unit}" if unit else f"× {float(scale[k]):.3g}"


def scatter_figure(summary: xr.Dataset, response: str, intensity: str) -> Figure:
    """Response of every record against one measure, a panel a scale: another scale makes no further record.

    Of more than four scales four are shown, the smallest and the largest among them.
    """
    values, measured = response_of(summary, response), intensity_of(summary, intensity)
    shown_scales = np.unique(np.linspace(0, summary.sizes["scale"] - 1, _PANELS).round().astype(int))
    columns = min(2, len(shown_scales))
    rows = -(-len(shown_scales) // columns)
    figure = Figure(figsize=(WIDTH, (3.4 if rows == 1 else 2.5 * rows)), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    factor, unit = display_unit(values, str(values.attrs.get("units", "1")))
    middle = factor * values.median("sample").transpose("record", "scale").values
    for ax, k in zip(axes, shown_scales, strict=False):
        x, y = measured.values[:, k], middle[:, k]
        there = np.isfinite(x) & np.isfinite(y)
        ax.scatter(x[there], y[there], s=12, color=COLOURS[0], alpha=0.7, lw=0, rasterized=True)
        if there.any() and y[there].min() > 0.0 and x[there].min() > 0.0:
            _logarithmic(ax, "x")
            _logarithmic(ax, "y")
        scale = f"{_scale_text(summary.scale, k)}, " if summary.sizes["scale"] > 1 else ""
        ax.set_title(f"{scale}n = {int(there.sum())} records", loc="left")
    for ax in axes[len(shown_scales) :]:
        ax.set_visible(False)
    figure.supxlabel(
        _measure({"intensity": intensity, "intensity_units": measured.attrs.get("units", "1")}), fontsize=9
    )
    figure.supylabel(f"{_name(response)} [{unit}]", fontsize=9)
    return figure


def sensitivity_figure(strength: xr.Dataset) -> Figure:
    """Standardised regression and rank correlation of every parameter with their bounds."""
    figure, ax = _panel(1.3 + 0.45 * strength.sizes["parameter"])
    order = np.argsort(-np.nan_to_num(abs(strength.regression.values)), kind="stable")
    at = np.arange(len(order))
    pairs = (("regression", "standardised regression", -0.14), ("spearman", "rank correlation", 0.14))
    for colour, (name, label, aside) in zip(COLOURS, pairs, strict=False):
        value = strength[name].values[order]
        ends = np.abs(strength[f"{name}_bounds"].values[order].T - value)
        ax.errorbar(value, at + aside, xerr=ends, fmt="o", ms=4, color=colour, capsize=2, lw=1.2, label=label)
    ax.set_yticks(at, [str(name) for name in strength.parameter.values[order]])
    ax.set_ylim(len(order) - 0.5, -0.5)
    ax.axvline(0.0, color="black", lw=0.6)
    ax.set_xlim(-1.08, 1.08)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel(f"effect on {_name(strength.attrs['response'])}, on ranks")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def hazard_figure(summary: xr.Dataset, factor: float, unit: str) -> Figure:
    """Annual frequency of exceedance against levels of the response, in a unit, with its bounds."""
    figure, ax = _panel()
    x, y = factor * summary.hazard_level.values, summary.annual_frequency.values
    there = y > 0.0
    ax.plot(x[there], y[there], "o-", ms=4, color=COLOURS[0])
    if "annual_frequency_bounds" in summary:
        low, high = summary.annual_frequency_bounds.values.T
        known = there & (low > 0.0) & np.isfinite(high)
        ax.fill_between(x[known], low[known], high[known], color=COLOURS[0], alpha=0.15, lw=0)
    _logarithmic(ax, "x")
    _logarithmic(ax, "y")
    ax.set_xlabel(f"{_name(summary.hazard_level.attrs['response'])} [{unit}]")
    ax.set_ylabel("annual frequency of exceedance")
    return figure


def sobol_figure(indices: xr.Dataset) -> Figure:
    """First-order and total index of every parameter with their bounds, of one scale."""
    figure, ax = _panel(1.3 + 0.45 * indices.sizes["parameter"])
    order = np.argsort(-indices["total"].values, kind="stable")
    at = np.arange(len(order))
    pairs = (("first", "first order", -0.14), ("total", "total", 0.14))
    for colour, (name, label, aside) in zip(COLOURS, pairs, strict=False):
        value = indices[name].values[order]
        ends = np.abs(indices[f"{name}_bounds"].values[order].T - value)
        ax.errorbar(value, at + aside, xerr=ends, fmt="o", ms=4, color=colour, capsize=2, lw=1.2, label=label)
    ax.set_yticks(at, [str(name) for name in indices.parameter.values[order]])
    ax.set_ylim(len(order) - 0.5, -0.5)
    ax.axvline(0.0, color="black", lw=0.6)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel("share of the variance")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def height_figure(envelopes: xr.Dataset) -> Figure | None:
    """Openings over height, a panel a joint that has any: medians at every scale, the largest of all runs.

    Nothing where no joint opens.
    """
    height = {str(name): envelopes.gap_position.values[envelopes.gap_joint.values == name, 2]
              for name in envelopes.joint.values}  # fmt: skip
    names = [name for name, z in height.items() if np.ptp(z) > _FLAT]
    if not names or not float(envelopes.opening.max()) > 0.0:
        return None
    columns = min(4 if max(map(len, names)) <= _SHORT_NAME else 3, len(names))
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(WIDTH, 3.4 * rows if rows < 3 else 2.4 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    factor, unit = display_unit(envelopes.opening, "m")
    scales = envelopes.scale.values
    colours = colormaps["viridis"](np.linspace(0.0, 0.85, len(scales)))
    scale_unit = unit_text(str(envelopes.scale.attrs.get("units", "1"))) or "times"
    for ax, name in zip(axes, names, strict=False):
        # lines of a joint: at each height the largest of the gaps there
        chosen = envelopes.gap_joint.values == name
        z = height[name]
        levels = np.unique(np.round(z, 3))
        if len(levels) > 40:  # an irregular mesh has nearly as many heights as gaps
            edges = np.linspace(z.min(), z.max(), 31)
            where, levels = np.clip(np.digitize(z, edges) - 1, 0, 29), 0.5 * (edges[1:] + edges[:-1])
        else:
            where = np.searchsorted(levels, np.round(z, 3))
        held = np.unique(where)
        opening = factor * envelopes.opening.values[:, :, chosen]
        curves = np.stack([opening[..., where == i].max(axis=-1) for i in held], axis=-1)
        for k, scale in enumerate(scales if len(scales) <= 8 else []):
            label = f"median, {scale:.3g} {scale_unit}" if len(scales) > 1 else "median"
            ax.plot(curves[0, k], levels[held], color=colours[k], lw=1.1, label=label)
        if len(scales) == 1:
            ax.plot(curves[1, 0], levels[held], color=COLOURS[1], lw=1.1, label="84 %")
        ax.plot(curves[-1].max(axis=0), levels[held], color="black", lw=1.2, ls="--", label="largest")
        if len(names) > 1:
            ax.set_title(name, fontsize=8)
    for ax in axes[len(names) :]:
        ax.set_visible(False)
    figure.supxlabel(f"largest opening at a height [{unit}]", fontsize=9)
    figure.supylabel("z [m]", fontsize=9)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure


def gap_sketch(summary: xr.Dataset) -> Figure | None:
    """Draw where the gaps are, in 3-D: a picture of the scene where there is no mesh to draw."""
    if "gap_position" not in summary.coords:
        return None
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    ax = figure.add_subplot(projection="3d")
    for k, name in enumerate(summary.joint.values):
        x, y, z = summary.gap_position.values[summary.gap_joint.values == name].T
        ax.scatter(x, y, z, s=8, color=COLOURS[k % len(COLOURS)], label=str(name), depthshade=False)
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")
    ax.set_zlabel("z [m]")
    ax.set_aspect("equal")
    ax.locator_params(nbins=4)
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def _panel(height: float = 3.2) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots()


def _name(response: str) -> str:
    return response.replace("_", " ")


def short(measure: str) -> str:
    """The symbol of a measure of records."""
    return {"sa": "Sa", "scale": "scale"}.get(measure, measure.upper())


def _measure(about: dict[str, str]) -> str:
    """Label of an axis of intensity."""
    unit = unit_text(str(about["intensity_units"]))
    name = short(about["intensity"])
    return f"{name} [{unit}]" if unit else name


def _logarithmic(ax: Axes, which: str) -> None:
    """A logarithmic axis with plain numbers, more of them where it spans little."""
    ax.set(**{f"{which}scale": "log"})
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = ax.get_xlim() if which == "x" else ax.get_ylim()
    axis.set_major_locator(FixedLocator(logarithmic_ticks(low, high).tolist()))
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))


def logarithmic_ticks(low: float, high: float) -> Floats:
    """Round numbers between the ends of a logarithmic axis: as many as have room, three at least."""
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
    choices = [decades[::2], *(np.outer(decades, steps).ravel() for steps in _STEPS)]
    ticks = np.empty(0)
    for every in choices:  # the finest of them that has room
        within = every[(every >= low) & (every <= high)]
        if len(within) > _MOST_TICKS and len(ticks) >= 3:
            break
        ticks = within
    if len(ticks) < 3:  # it spans little
        even = np.asarray(MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high))
        ticks = even[(even >= low) & (even <= high)]
    return ticks
