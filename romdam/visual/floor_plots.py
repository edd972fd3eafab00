"""Floor spectra of one run, and of the runs of a suite."""

from __future__ import annotations

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from romdam.core.display_units import SI, DisplayUnits
from romdam.postprocess.floor_spectra_of_runs import spectra_over_runs
from romdam.visual.style import COLOURS, GREY, legend_below, scaled

_MOST = 6  # places that are drawn; files hold all
_STILL = 1e-3  # of the largest ordinate, below which a direction is not drawn
_WIDE, _HIGH = 3.6, 2.3  # inches of a panel


def floor_spectra_figure(dataset: xr.Dataset, system: DisplayUnits = SI) -> Figure | None:
    """Floor spectra: a row for each place, a column for each direction that moves; broadened ones broken."""
    if "floor_spectrum" not in dataset:
        return None
    figure, panels, (factor, unit) = _panels(dataset.floor_spectrum, system)
    for (place, component), ax in panels.items():
        at = {"floor_place": place, "component": component}
        for colour, damping in zip(COLOURS, dataset.floor_damping.values, strict=False):
            row = dataset.floor_spectrum.sel(at | {"floor_damping": damping})
            label = f"{100.0 * damping:g} % damping"
            ax.plot(dataset.floor_frequency, factor * row, color=colour, lw=1.0, label=label)
            if "floor_spectrum_broadened" in dataset:
                wide = dataset.floor_spectrum_broadened.sel(at | {"floor_damping": damping})
                ax.plot(dataset.floor_frequency, factor * wide, color=colour, lw=0.8, ls="--")
        peak = factor * float(dataset.floor_peak_acceleration.sel(at))
        ax.axhline(peak, color=GREY, lw=0.6, ls=":", label="peak of the place itself")
        ax.set_ylabel(f"{place}, {component}\n[{unit}]")
    figure.suptitle(f"Floor spectra  ·  {dataset.attrs['record']}", fontsize=9, x=0.02, ha="left")
    legend_below(figure, panels.values())
    return figure


def floor_spectra_of_runs(summary: xr.Dataset) -> Figure | None:
    """Median, 84th percentile and largest of the runs, at the middle scale and damping."""
    combined = spectra_over_runs(summary)
    if not combined:
        return None
    middle = {"scale": combined.sizes["scale"] // 2, "floor_damping": combined.sizes["floor_damping"] // 2}
    chosen = combined.isel(middle)
    figure, panels, (factor, unit) = _panels(chosen.floor_spectrum, SI)
    for (place, component), ax in panels.items():
        of_panel = chosen.sel(floor_place=place, component=component)
        for k, statistic in enumerate(of_panel.statistic.values):
            for name, style in (("floor_spectrum", "-"), ("floor_spectrum_broadened", "--")):
                if name in of_panel:
                    row = factor * of_panel[name].sel(statistic=statistic)
                    label = str(statistic) if style == "-" else None
                    ax.plot(of_panel.floor_frequency, row, color=COLOURS[k], lw=1.0, ls=style, label=label)
        ax.set_ylabel(f"{place}, {component}\n[{unit}]")
    damping, scale = 100.0 * float(chosen.floor_damping), float(chosen.scale)
    title = f"Floor spectra of {chosen.attrs['runs']} runs, scale {scale:g}, {damping:g} % damping"
    figure.suptitle(title, fontsize=9, x=0.02, ha="left")
    legend_below(figure, panels.values())
    return figure


def _panels(
    spectrum: xr.DataArray, system: DisplayUnits
) -> tuple[Figure, dict[tuple[str, str], Axes], tuple[float, str]]:
    """A panel for each place and direction that moves, the factor of its numbers and their unit."""
    places = [str(name) for name in spectrum.floor_place.values[:_MOST]]
    every, factor, unit = scaled(spectrum, "m s-2", system)
    size = abs(every).max([dim for dim in spectrum.dims if dim not in ("floor_place", "component")])
    moves = [str(c) for c in spectrum.component.values if (size.sel(component=c) > _STILL * size.max()).any()]
    moves = moves or ["x"]
    shape = len(places), len(moves)
    figure = Figure(figsize=(_WIDE * shape[1], _HIGH * shape[0] + 0.6), layout="constrained")
    grid = figure.subplots(*shape, sharex=True, squeeze=False)
    panels = {(place, c): grid[i, k] for i, place in enumerate(places) for k, c in enumerate(moves)}
    for ax in panels.values():
        ax.set_xscale("log")
        ax.set_xlim(float(spectrum.floor_frequency[0]), float(spectrum.floor_frequency[-1]))
    for ax in grid[-1]:
        ax.set_xlabel("frequency of the oscillator [Hz]")
    return figure, panels, (factor, unit)
