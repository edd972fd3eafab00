"""Annual frequency at which a response of a suite exceeds its levels: the hazard of the response."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.postprocess.fragility import fragility, resampled_fits
from romdam.postprocess.hazard import HazardCurve
from romdam.postprocess.responses import about_runs, each_once, intensity_of, response_of

LEVEL = "hazard_level"  # dimension and coordinate
STATEMENT = "hazard_statement"  # attribute of a summary without frequencies: why
WARNING = "hazard_warning"  # attribute of a summary with frequencies that say less than they seem to
FEWEST = 5  # records, below which their scatter is unknown
CONFIDENCE = 0.9  # of the bounds
_RESAMPLES = 200  # of the records
_MOST_LOST = 0.1  # of the resamples, which have no fragility
_LEVELS, _ENDS = 12, (0.05, 0.95)  # levels that nobody has named, and quantiles of the runs between which


def with_hazard_of_response(
    summary: xr.Dataset, curve: HazardCurve, response: str, measure: str, levels: Sequence[float] | None
) -> xr.Dataset:
    """Add to a summary the annual frequency at which a response exceeds each level.

    A lognormal fragility in the measure is fitted at each level, and integrated over the hazard.

    Parameters
    ----------
    curve : of the measure
    response : the largest over joints, nodes and so on counts
    measure : of the records
    levels : of the response [SI], rising; None for some between its small and its large values

    Returns
    -------
    Dataset with `annual_frequency`, `annual_frequency_bounds` (hazard_level, bound) for the scatter between
        records, NaN for fewer than `FEWEST` of them, `annual_frequency_outside_table`, `hazard_median`,
        `hazard_dispersion`, `hazard_level_statement` (hazard_level), and the hazard itself,
        `hazard_frequency` (hazard_intensity); with the attribute `hazard_statement` alone where no run has
        the response
    """
    if response not in summary:
        return summary.assign_attrs({STATEMENT: f"no run has {response}, so there is no frequency of it"})
    population = each_once(summary)
    values, measured = response_of(population, response), intensity_of(population, measure)
    y = np.array(levels if levels is not None else _chosen(values.values))
    if not y.size:
        return summary.assign_attrs({STATEMENT: f"no run has a {response} above 0"})
    about_records = about_runs(population, values)
    records, counts_as = int(str(about_records["records"])), float(str(about_records["effective_records"]))
    rows, statements, bounds = np.full((len(y), 4), np.nan), list[str](), np.full((len(y), 2), np.nan)
    for k, (row, level) in enumerate(zip(rows, y, strict=True)):
        fit = fragility(population, response, float(level), measure)
        statements.append(str(fit.attrs["statement"]))
        if fit.theta.notnull():
            theta, beta = float(fit.theta), float(fit.beta)
            row[:] = (*curve.annual_frequency(theta, beta), theta, beta)
            if counts_as >= FEWEST:
                bounds[k] = _bounds(population, curve, response, float(level), measure)
    units = str(measured.attrs.get("units", "1"))
    about = str(values.attrs.get("long_name", response))
    names = (
        ("annual_frequency", "year-1", f"annual frequency at which a level is exceeded by: {about}"),
        ("annual_frequency_outside_table", "1", "share of it from intensities outside the hazard's table"),
        ("hazard_median", units, "median of the lognormal fragility of the level"),
        ("hazard_dispersion", "1", "logarithmic standard deviation of that fragility"),
    )
    data: dict[str, object] = {
        name: (LEVEL, column, {"units": unit, "long_name": text})
        for (name, unit, text), column in zip(names, rows.T, strict=True)
    }
    text = f"{100 * CONFIDENCE:g} % bounds of the annual frequency, for the scatter between records"
    about_bounds = {"units": "year-1", "long_name": text, "method": f"bootstrap, {_RESAMPLES} resamples"}
    data["annual_frequency_bounds"] = ((LEVEL, "bound"), bounds, about_bounds)
    data["hazard_level_statement"] = (
        LEVEL,
        np.array(statements, dtype=str),
        {"long_name": "why a level has no frequency"},
    )
    text = f"annual frequency at which the intensity is exceeded: {measured.attrs.get('long_name', measure)}"
    data["hazard_frequency"] = (
        "hazard_intensity",
        curve.frequency,
        {"units": "year-1", "long_name": text},
    )
    coords = {
        LEVEL: (
            LEVEL,
            y,
            {"units": str(values.attrs.get("units", "1")), "long_name": f"level of: {about}",
             "response": response, "measure": measure},
        ),
        "hazard_intensity": (
            "hazard_intensity",
            curve.intensity,
            {"units": units, "long_name": str(measured.attrs.get("long_name", measure))},
        ),
    }  # fmt: skip
    if few := few_records(records, counts_as):
        summary = summary.assign_attrs({WARNING: few})
    return summary.assign_coords(coords).assign_coords(bound=["lower", "upper"]).assign(data)


def few_records(records: int, counts_as: float) -> str:
    """Say that annual frequencies are of too few records; empty where they are not.

    Parameters
    ----------
    counts_as : equal records that scatter as little as those by their weights
    """
    if counts_as >= FEWEST:
        return ""
    of = "1 record" if records == 1 else f"{records} records"
    of += "" if counts_as == records else f" that by their weights count as {counts_as:.2g}"
    return (
        f"annual frequencies are of {of}, and the scatter between records needs {FEWEST} at least: they "
        "leave it out, and have no bounds; run more records"
    )


def _bounds(
    summary: xr.Dataset, curve: HazardCurve, response: str, level: float, measure: str
) -> tuple[float, float]:
    """Quantiles of the annual frequency over records drawn with replacement; NaN if too many draws fail."""
    fits = resampled_fits(summary, response, level, measure, _RESAMPLES)
    if len(fits) < (1.0 - _MOST_LOST) * _RESAMPLES:
        return np.nan, np.nan
    frequencies = [curve.annual_frequency(float(theta), float(beta))[0] for theta, beta in fits]
    low, high = np.quantile(frequencies, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    return float(low), float(high)


def _chosen(values: Floats) -> Floats:
    """Round levels between small and large values, (n,) rising."""
    positive = values[np.isfinite(values) & (values > 0.0)]
    if not positive.size:
        return np.empty(0)
    low, high = (float(end) for end in np.quantile(positive, _ENDS))
    return np.unique([float(f"{level:.2g}") for level in np.geomspace(low, high, _LEVELS)])


def hazard_rows(summary: xr.Dataset, factor: float) -> list[tuple[str, str, str, str, str, str]]:
    """Level times a factor, annual frequency, its bounds, return period [years], share outside the table [%],
    and a note."""
    rows = []
    for k, level in enumerate(summary[LEVEL].values):
        frequency = float(summary.annual_frequency[k])
        cells = ("-", "-", "-", "-")
        if np.isfinite(frequency):
            outside = 100.0 * float(summary.annual_frequency_outside_table[k])
            years = f"{float(f'{1.0 / frequency:.3g}'):.0f}" if frequency > 0.0 else "-"
            cells = (f"{frequency:.3g}", _bounds_text(summary, k), years, f"{outside:.2g}")
        rows.append((f"{factor * level:.4g}", *cells, str(summary.hazard_level_statement.values[k])))
    return rows


def _bounds_text(summary: xr.Dataset, k: int) -> str:
    if "annual_frequency_bounds" not in summary:  # of a version before
        return "-"
    low, high = summary.annual_frequency_bounds.values[k]
    return f"{low:.2g} to {high:.2g}" if np.isfinite(low) else "-"
