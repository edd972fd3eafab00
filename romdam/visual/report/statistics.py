"""The sections of a report that say what the runs answered."""

from __future__ import annotations

import numpy as np
import xarray as xr

from romdam.core.display_units import unit_text
from romdam.core.round_off import without_round_off
from romdam.postprocess.dependence import correlation, sensitivity
from romdam.postprocess.extremes import opening_envelopes
from romdam.postprocess.fragility import fragility, none_exceeds
from romdam.postprocess.hazard import HazardCurve
from romdam.postprocess.hazard_of_response import (
    CONFIDENCE,
    LEVEL,
    STATEMENT,
    WARNING,
    few_records,
    hazard_rows,
)
from romdam.postprocess.incremental import ida_curves
from romdam.postprocess.responses import RUNS, parameters, response_of, responses, turned
from romdam.postprocess.sobol import BASE_SAMPLES, sobol_indices, sobol_rows
from romdam.postprocess.weights import weighted_quantiles, weights_of
from romdam.results.suite.rows import AT_THE_END
from romdam.visual import suite_plots as plots
from romdam.visual.floor_plots import floor_spectra_of_runs
from romdam.visual.report.joint_map import opening_map
from romdam.visual.report.parts import (
    PageCell,
    PagePicture,
    PageSection,
    PageTable,
    Part,
    Text,
    Value,
    number,
    picture,
    side_by_side,
)
from romdam.visual.report.subject import Subject, in_unit, plain, runs_text

_ROUND_OFF = 1e-6  # of the largest of a variable, below which a number of a table is shown as 0
_FEWEST_SHOWN = 5  # records whose correlation with their measures is shown
_MANY_ROWS = 40  # of a table, from which on a reader may filter it


def responses_section(subject: Subject) -> PageSection | None:
    """Every response over all runs, and the openings over the joints."""
    rows: list[list[Value]] = []
    weights = weights_of(subject.population)
    shape = tuple(subject.population.sizes[dim] for dim in RUNS)
    each = None if weights is None else np.broadcast_to(weights[:, None, None], shape)
    sizes = {"1": 1.0}  # of the largest response of a unit; shares stand beside 1
    for name in responses(subject.population):
        values = subject.population[name]
        units = str(values.attrs.get("units", "1"))
        most = float(np.nanmax(np.abs(values.values), initial=0.0))
        sizes[units] = max(sizes.get(units, 0.0), most)
    for name in responses(subject.population):
        values = turned(subject.population[name])
        rest = [dim for dim in values.dims if dim not in RUNS]
        for at in np.ndindex(*(values.sizes[dim] for dim in rest)):
            of_place = values.isel(dict(zip(rest, at, strict=True))).transpose(*RUNS)
            there = np.isfinite(of_place.values)
            finite, of_runs = of_place.values[there], None if each is None else each[there]
            if finite.size:
                factor, unit = plots.display_unit(values, str(values.attrs.get("units", "1")))
                where = " ".join(str(of_place.coords[dim].values) for dim in rest if dim in of_place.coords)
                worst = finite.min() if finite.max() <= 0.0 else finite.max()
                row = np.array([*weighted_quantiles(finite, (0.16, 0.5, 0.84), of_runs), worst])
                row = without_round_off(row, sizes[str(values.attrs.get("units", "1"))])
                numbers = _tidy(factor * row, factor * float(np.nanmax(np.abs(values.values))))
                # an energy is that at the end, as its long name says
                ends = str(values.attrs.get("long_name", "")).endswith(AT_THE_END)
                label = plain(str(values.name)) + (AT_THE_END if ends else "")
                rows.append([label, where, unit, *numbers, int(finite.size)])
    if not rows:
        return None
    title = "Over all runs" + (", by the weights of the records" if each is not None else "")
    head = ["response", "where", "unit", "16 %", "median", "84 %", "extreme", "n"]
    parts: list[Part] = []
    if "gap_peak_opening" in subject.population:
        envelopes = opening_envelopes(subject.population)
        count = int(envelopes["count"].sum())
        over_height = plots.height_figure(envelopes)
        heights = picture(over_height, f"Openings over height; {count} runs.") if over_height else None
        of_gaps = opening_map(envelopes)
        largest = picture(of_gaps, f"The largest opening of every gap in {count} runs.") if of_gaps else None
        parts.append(side_by_side(heights, largest))
    table = PageTable(head, rows, title, sortable=len(rows) > _MANY_ROWS)
    sign = Text("Compressions are sizes on this page; in the files compression is negative.", soft=True)
    return PageSection("responses", "Openings and other responses", [*parts, table, sign])


def _tidy(numbers: np.ndarray, overall: float) -> list[float]:
    """Numbers of a row without what is round-off beside its largest; 0 what is beside all of its kind."""
    numbers = np.where(np.abs(numbers) < _ROUND_OFF * overall, 0.0, numbers)
    largest = float(np.abs(numbers).max())
    places = 4 - int(np.floor(np.log10(largest))) if largest > 0.0 else 0
    return [float(value) for value in np.round(numbers, places) + 0.0]


def thresholds_of(values: xr.DataArray) -> tuple[float, ...]:
    """Up to three round thresholds within the middle of a response."""
    finite = values.values[np.isfinite(values.values) & (values.values > 0.0)]
    if not finite.size:
        return ()
    rounded = (float(f"{q:.1g}") for q in np.quantile(finite, (0.3, 0.5, 0.7)))
    return tuple(dict.fromkeys(rounded))


def floors_section(subject: Subject) -> PageSection | None:
    """Floor spectra over the runs."""
    figure = floor_spectra_of_runs(subject.population)
    if figure is None:
        return None
    caption = (
        "Quantiles of the ordinates of all records and samples; broken: broadened. Files hold all of them."
    )
    return PageSection("floors", "Floor spectra", [side_by_side(picture(figure, caption))])


def fragility_section(subject: Subject) -> PageSection | None:
    """Incremental curves and fragilities."""
    if not subject.done or not subject.response:
        return None
    summary, response, intensity = subject.population, subject.response, subject.topic.intensity
    ida = ida_curves(summary, response, intensity)
    values = response_of(summary, response)
    chosen = subject.topic.thresholds or thresholds_of(values)
    fits = [fragility(summary, response, threshold, intensity) for threshold in chosen]
    pictures: list[PagePicture] = []
    if not ida.attrs["statement"]:
        caption = f"Incremental dynamic analysis, {runs_text(ida)}."
        pictures.append(picture(plots.ida_figure(ida), caption))
    if fits:
        caption = f"Fragility with pointwise 95 % bounds, {runs_text(ida)}."
        pictures.append(picture(plots.fragility_figure(fits), caption))
    notes = [f"Incremental curves: {ida.attrs['statement']}."] if ida.attrs["statement"] else []
    if fits:
        counted = {
            "capacities": "each record counts once, by the intensity at which it first exceeds the threshold",
            "stripes": "each run counts once, by whether it exceeds the threshold",
        }[str(fits[0].attrs["method"])]
        source = " The thresholds are round numbers from the data; --threshold sets others."
        notes.append(
            f"Lognormal, by maximum likelihood: {counted} (Baker 2015). Bounds are those of the profile "
            "likelihood. Runs that failed are left out and count as nothing."
            + ("" if subject.topic.thresholds else source)
        )
        if fits[0].attrs["observations"] > fits[0].attrs["records"]:
            notes.append(
                f"The bounds take {fits[0].attrs['observations']} observations of {fits[0].attrs['records']} "
                "records as independent, which those of one record are not: the true bounds are wider."
            )
    if none := next((fit for fit in fits if fit.attrs["exceeding"] == 0), None):
        notes.append(
            f"Where none exceeds, the probability that a record does is at most 1 - 0.05^(1/n) for the n = "
            f"{none.attrs['records']} records, with 95 % confidence."
        )
    parts: list[Part] = [side_by_side(*pictures), *(Text(note, soft=True) for note in notes)]
    if (
        fits
        and subject.topic.hazard is not None
        and (few := few_records(fits[0].attrs["records"], fits[0].attrs["effective_records"]))
    ):
        parts.append(Text(f"Warning: {few}."))
    return PageSection(
        "fragility",
        "Incremental curves and fragility",
        [*parts, _fragility_table(fits, values, subject.topic.hazard)],
    )


def _fragility_table(fits: list[xr.Dataset], values: xr.DataArray, hazard: HazardCurve | None) -> PageTable:
    if not fits:
        return PageTable([], [])
    factor, unit = plots.display_unit(
        np.array([f.attrs["threshold"] for f in fits]), str(values.attrs.get("units", "1"))
    )
    measure = unit_text(str(fits[0].attrs["intensity_units"]))
    rows: list[list[Value]] = []
    for fit in fits:
        theta, beta = (f"{number(float(v))}" for v in (fit.theta, fit.beta))
        bounds = (
            f"{number(float(low))} to {number(float(high))}"
            for low, high in (fit.theta_bounds.values, fit.beta_bounds.values)
        )
        about = fit.attrs
        seen = f"{about['exceeding']} of {about['observations']}"
        if about["exceeding"] == 0:
            seen += f", at most {number(100 * none_exceeds(about['records']))} %"
        yearly: list[Value] = []
        if hazard is not None:
            yearly = ["", ""]
            if fit.theta.notnull():
                frequency, outside = hazard.annual_frequency(float(fit.theta), float(fit.beta))
                yearly = [number(frequency), f"{number(100 * outside)} %"]
        row = [factor * about["threshold"], theta, next(bounds), beta, next(bounds), *yearly, seen]
        rows.append([*row, about["statement"]])
    head = [f"threshold [{unit}]", f"median [{measure}]" if measure else "median", "95 %", "beta", "95 %"]
    head += ["per year", "of it outside the hazard's table"] if hazard is not None else []
    head = [*head, "exceeding", "note"]
    if not any(row[-1] for row in rows):
        head, rows = head[:-1], [row[:-1] for row in rows]
    return PageTable(head, rows, f"Fragility in {fits[0].attrs['intensity_long_name']}")


def hazard_section(subject: Subject) -> PageSection | None:
    """Annual frequency at which the response exceeds its levels, of a suite that names a hazard."""
    summary = subject.summary
    title = "Hazard of the response"
    if STATEMENT in summary.attrs:
        return PageSection("hazard", title, [Text(f"No frequencies: {summary.attrs[STATEMENT]}.")])
    if LEVEL not in summary.coords:
        return None
    about = summary[LEVEL].attrs
    factor, unit = plots.display_unit(summary[LEVEL], str(about["units"]))
    bounds = f"{100 * CONFIDENCE:g} % bounds, by records"
    head = [f"level [{unit}]", "per year", bounds, "return period [years]", "outside the table [%]", "note"]
    rows: list[list[Value]] = [
        [*(PageCell(text, "n") for text in (level, *numbers)), note]
        for level, *numbers, note in hazard_rows(summary, factor)
    ]
    parts: list[Part] = []
    if int((summary.annual_frequency > 0.0).sum()) > 1:  # a curve
        caption = f"Annual frequency at which {plain(str(about['response']))} exceeds a level."
        parts.append(side_by_side(picture(plots.hazard_figure(summary, factor, unit), caption)))
    note = (
        "The fragility of each level is lognormal. Bounds are for the scatter between records (bootstrap); "
        "the frequency itself has no part of it."
    )
    if WARNING in summary.attrs:
        parts.insert(0, Text(f"Warning: {summary.attrs[WARNING]}."))
    return PageSection("hazard", title, [*parts, PageTable(head, rows), Text(note, soft=True)])


def correlation_section(subject: Subject) -> PageSection | None:
    if not subject.done or not subject.response:
        return None
    correlated, title = (
        correlation(subject.population, subject.response),
        "Correlation with the records' measures",
    )
    if correlated.attrs["statement"]:
        return PageSection("correlation", title, [Text(f"No correlation: {correlated.attrs['statement']}.")])
    most = int(correlated.count_at_scale.max())
    if most < _FEWEST_SHOWN:  # of three records the rank correlation is 1 or -1 by chance in a third of cases
        text = f"No correlation: {most} records are too few; at least {_FEWEST_SHOWN} are needed."
        return PageSection("correlation", title, [Text(text)])
    closest = str(correlated.measure.values[int(np.nanargmax(abs(correlated.spearman.values)))])
    said = (
        f"Rank correlation over records within each scale, samples by their median; {runs_text(correlated)}."
    )
    remark = f"Records against {closest}, each scale by itself, samples by their median."
    drawings = side_by_side(
        picture(plots.correlation_figure(correlated), said),
        picture(plots.scatter_figure(subject.population, subject.response, closest), remark),
    )
    names = [f"{name}_at_scale" for name in ("spearman", "pearson", "slope", "dispersion", "count")]
    rows: list[list[Value]] = []
    for i, k in np.ndindex(correlated.spearman_at_scale.shape):
        coefficient = correlated.isel(measure=i, scale=k)
        *numbers, records = (float(coefficient[name]) for name in names)
        rows.append([str(coefficient.measure.values), float(coefficient.scale), *numbers, int(records)])
    head = ["measure", f"scale{in_unit(correlated.scale)}", "rank correlation", "correlation of logs"]
    head += ["slope of logs", "dispersion of ln", "records"]
    return PageSection("correlation", title, [drawings, PageTable(head, rows)])


def sobol_section(subject: Subject) -> PageSection | None:
    """Shares of the variance that the parameters make, where the samples are made for them."""
    if not subject.done or not subject.response or BASE_SAMPLES not in subject.summary.attrs:
        return None
    indices = sobol_indices(subject.summary, subject.response)
    parts: list[Part] = []
    if indices["first"].notnull().any():
        largest = indices.isel(scale=int(np.flatnonzero(indices["first"].notnull().any("parameter"))[-1]))
        scale = f"{float(largest.scale):g}{in_unit(indices.scale)}"
        caption = f"{plain(subject.response)} at scale {scale}; 95 % by a bootstrap over base samples."
        parts.append(side_by_side(picture(plots.sobol_figure(largest), caption)))
    rows = [list[Value](row) for row in sobol_rows(indices)]
    head = [f"scale{in_unit(indices.scale)}", "parameter", "first order", "total", "base samples"]
    notes = [
        "First order is what a parameter does alone, total what it does with all others. Records count "
        "together. Bounds leave out that Sobol's sequence is better than random samples."
    ]
    notes += [f"{indices.attrs['statement'].capitalize()}."] if indices.attrs["statement"] else []
    parts += [PageTable(head, rows), *(Text(note, soft=True) for note in notes)]
    return PageSection("sobol", "Shares of the variance (Sobol' indices)", parts)


def sensitivity_section(subject: Subject) -> PageSection | None:
    if not subject.done or not subject.response or not parameters(subject.population):
        return None
    strength = sensitivity(subject.population, subject.response)
    title = "Sensitivity to the parameters"
    if strength.attrs["statement"]:
        return PageSection("sensitivity", title, [Text(f"No sensitivity: {strength.attrs['statement']}.")])
    caption = (
        f"{strength.attrs['samples']} samples, {runs_text(strength)}; bounds of 95 % by "
        f"{strength.attrs['bounds']}; "
        f"the regression explains {number(100 * float(strength.r_squared))} % of the ranks' variance."
    )
    rows: list[list[Value]] = []
    for k in range(strength.sizes["parameter"]):
        parameter, cells = strength.isel(parameter=k), []
        for name in ("regression", "spearman"):
            value, (low, high) = float(parameter[name]), parameter[f"{name}_bounds"].values
            cells.append("–" if np.isnan(value) else f"{value:.2f} ({low:.2f} to {high:.2f})")
        rows.append([str(parameter.parameter.values), *cells])
    drawing = picture(plots.sensitivity_figure(strength), caption)
    head = ["parameter", "standardised regression", "rank correlation"]
    return PageSection("sensitivity", title, [side_by_side(drawing), PageTable(head, rows)])
