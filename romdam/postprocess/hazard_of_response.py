"""Annual frequency at which a response of a suite exceeds its levels: the hazard of the response."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.postprocess.fragility import fragility
from romdam.postprocess.hazard import HazardCurve
from romdam.postprocess.responses import each_once, intensity_of, response_of

LEVEL = "hazard_level"  # dimension and coordinate
STATEMENT = "hazard_statement"  # attribute of a summary without frequencies: why
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
    Dataset with `annual_frequency`, `annual_frequency_outside_table`, `hazard_median`, `hazard_dispersion`,
        `hazard_level_statement` (hazard_level), and the hazard itself, `hazard_frequency` (hazard_intensity);
        with the attribute `hazard_statement` alone where no run has the response
    """
    if response not in summary:
        return summary.assign_attrs({STATEMENT: f"no run has {response}, so there is no frequency of it"})
    population = each_once(summary)
    values, measured = response_of(population, response), intensity_of(population, measure)
    y = np.array(levels if levels is not None else _chosen(values.values))
    if not y.size:
        return summary.assign_attrs({STATEMENT: f"no run has a {response} above 0"})
    rows, statements = np.full((len(y), 4), np.nan), list[str]()
    for row, level in zip(rows, y, strict=True):
        fit = fragility(population, response, float(level), measure)
        statements.append(str(fit.attrs["statement"]))
        if fit.theta.notnull():
            theta, beta = float(fit.theta), float(fit.beta)
            row[:] = (*curve.annual_frequency(theta, beta), theta, beta)
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
    return summary.assign_coords(coords).assign(data)


def _chosen(values: Floats) -> Floats:
    """Round levels between small and large values, (n,) rising."""
    positive = values[np.isfinite(values) & (values > 0.0)]
    if not positive.size:
        return np.empty(0)
    low, high = (float(end) for end in np.quantile(positive, _ENDS))
    return np.unique([float(f"{level:.2g}") for level in np.geomspace(low, high, _LEVELS)])


def hazard_rows(summary: xr.Dataset, factor: float) -> list[tuple[str, str, str, str, str]]:
    """Level times a factor, annual frequency, return period [years], share outside the table [%], note."""
    rows = []
    for k, level in enumerate(summary[LEVEL].values):
        frequency = float(summary.annual_frequency[k])
        cells = ("-", "-", "-")
        if np.isfinite(frequency):
            outside = 100.0 * float(summary.annual_frequency_outside_table[k])
            years = f"{1.0 / frequency:.3g}" if frequency > 0.0 else "-"
            cells = (f"{frequency:.3g}", years, f"{outside:.2g}")
        rows.append((f"{factor * level:.4g}", *cells, str(summary.hazard_level_statement.values[k])))
    return rows
