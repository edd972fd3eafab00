"""Annual frequencies from a hazard curve and a lognormal fragility, and what of a table is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm
from suite_jobs import BASE, made, write_job
from summaries import lognormal_curves
from test_cli import call

import romdam
from romdam.core.errors import ConfigError
from romdam.postprocess.hazard import HazardCurve
from romdam.postprocess.hazard_of_response import hazard_rows, with_hazard_of_response
from romdam.postprocess.responses import WITHIN
from romdam.results.suite.hazard_table import read_hazard
from romdam.terminal.tables import hazard_tables
from romdam.visual.report.parts import PageTable
from romdam.visual.report.statistics import hazard_section
from romdam.visual.report.subject import Subject, Topic


@pytest.mark.parametrize(("theta", "beta", "k"), [(3.0, 0.4, 2.5), (0.2, 0.05, 3.0), (9.0, 0.8, 1.2)])
def test_a_power_law_gives_the_closed_form_of_cornell(theta, beta, k):
    x = np.array([0.5, 1.0, 4.0])
    found, outside = HazardCurve(x, 2e-3 * x**-k).annual_frequency(theta, beta)
    assert found == pytest.approx(2e-3 * theta**-k * math.exp(0.5 * (k * beta) ** 2), rel=1e-12)
    assert 0.0 < outside < 1.0


def test_a_kinked_curve_gives_the_integral_of_the_fragility_over_it():
    x, H = np.array([0.5, 1.0, 2.0, 5.0, 12.0]), np.array([2e-2, 5e-3, 9e-4, 1e-4, 4e-6])
    curve, (theta, beta) = HazardCurve(x, H), (2.7, 0.45)

    def hazard(u):  # straight in logarithms, its end intervals prolonged
        i = int(np.clip(np.searchsorted(x, math.exp(u)) - 1, 0, len(x) - 2))
        slope = math.log(H[i + 1] / H[i]) / math.log(x[i + 1] / x[i])
        return H[i] * math.exp(slope * (u - math.log(x[i])))

    # by parts: the density of the capacity times the hazard
    def density(u):
        return hazard(u) * norm.pdf(u, math.log(theta), beta)

    want = quad(density, -4.0, 6.0, points=np.log(x).tolist(), epsabs=1e-14, limit=400)[0]
    found, outside = curve.annual_frequency(theta, beta)
    assert found == pytest.approx(want, rel=1e-8)
    assert 0.0 < outside < 0.05


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (
            "intensity [g],annual frequency\n0.1,1e-2\n0.2,2e-2\n",
            "line 3: intensities must rise and frequencies",
        ),
        ("intensity [g],annual frequency\n0.2,1e-2\n0.1,1e-3\n", "got 0.1 and 1e-3 after 0.2 and 1e-2"),
        ("intensity [g],annual frequency\n0.1,1e-2\n0.2,0\n", "line 3: must be two numbers above 0"),
        ("intensity [g],annual frequency\n0.1,1e-2\n", "at least 2 rows, got 1"),
        ("intensity [m],annual frequency\n0.1,1e-2\n0.2,1e-3\n", "line 2"),
        ("intensity,annual frequency\n0.1,1e-2\n0.2,1e-3\n", "line 1: columns must be"),
        ("intensity [g],annual frequency\n0.1,many\n", "line 2"),
        ("", "line 1"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, text, part):
    path = tmp_path / "hazard.csv"
    path.write_text(text)
    with pytest.raises(ConfigError) as told:
        read_hazard(path, "m/s^2")
    assert part in str(told.value) and str(path) in str(told.value)


def test_the_report_has_annual_frequencies(tmp_path):
    config = write_job(tmp_path, records=3, suite={"scales": [0.2, 0.5, 1.0, 2.0]})
    summary = made(config, tmp_path / "out").summary
    threshold = float(summary.peak_opening.median())
    table = tmp_path / "hazard.csv"
    table.write_text("intensity [g],annual frequency\n0.01,0.5\n0.1,1e-2\n2,1e-5\n")
    call("report", tmp_path / "out", "--threshold", f"{threshold} m", "--hazard", table)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "per year" in page and "outside" in page and "--hazard" in page


CURVE = "intensity [g],annual frequency\n0.01,0.5\n0.1,1e-2\n2,1e-5\n"


def test_a_suite_states_the_hazard_of_its_response(tmp_path):
    """Its levels are those named, in other units; the frequencies follow by independent steps."""
    (tmp_path / "hazard.csv").write_text(CURVE)
    hazard = {"table": "hazard.csv", "measure": "pga", "levels": ["4 mm", "0.1 in", "900 mm"]}
    suite = {"scales": [0.2, 0.5, 1.0, 2.0], "hazard": hazard}
    outputs = {**BASE["outputs"], "plots": False, "mesh_error": False}
    config = write_job(tmp_path, records=3, suite=suite, outputs=outputs)
    said = call("run", config, "--out", tmp_path / "out", "--workers", 1)[1]
    assert "Hazard of peak opening, by pga" in said and "per year" in said and "2.54" in said
    summary = romdam.open_suite(tmp_path / "out").to_dataset()
    assert summary.hazard_level.values == pytest.approx([2.54e-3, 4e-3, 0.9])
    assert summary.annual_frequency.attrs["units"] == "year-1"
    assert summary.hazard_frequency.values == pytest.approx([0.5, 1e-2, 1e-5])
    assert summary.hazard_intensity.values == pytest.approx(np.array([0.01, 0.1, 2]) * 9.80665)
    for k in (0, 1):
        theta, beta = float(summary.hazard_median[k]), float(summary.hazard_dispersion[k])
        # capacities of the three records, in logarithms between two scales: their mean and deviation
        level = float(summary.hazard_level[k])
        y, x = summary.peak_opening.values[:, :, 0, 0], summary.record_pga.values
        capacity = [np.interp(math.log(level), np.log(a), np.log(b)) for a, b in zip(y, x, strict=True)]
        assert math.log(theta) == pytest.approx(np.mean(capacity), abs=1e-6)
        assert beta == pytest.approx(np.std(capacity), rel=1e-4)

        def rate(u, theta=theta, beta=beta):
            slopes = np.diff(np.log([0.5, 1e-2, 1e-5])) / np.diff(np.log([0.01, 0.1, 2]))
            i = int(u > math.log(0.1 * 9.80665))
            log_hazard = math.log(1e-2) + slopes[i] * (u - math.log(0.1 * 9.80665))
            return math.exp(log_hazard) * norm.pdf(u, math.log(theta), beta)

        m = math.log(theta)
        want = quad(rate, m - 9 * beta, m + 9 * beta, points=[m, math.log(0.980665)], epsabs=1e-14)[0]
        assert float(summary.annual_frequency[k]) == pytest.approx(want, rel=1e-6)
    assert np.isnan(summary.annual_frequency[2]) and "no run exceeds" in str(
        summary.hazard_level_statement.values[2]
    )
    section = hazard_section(Subject(summary, Topic()))
    (table,) = [part for part in section.parts if isinstance(part, PageTable)]
    assert [row[0].text for row in table.rows] == ["2.54", "4", "900"] and table.rows[2][1].text == "-"
    assert "hazard" not in (tmp_path / "out" / "summary.csv").read_text().split("\n")[0]


@pytest.mark.parametrize(
    ("hazard", "part"),
    [
        ({"table": "none.csv"}, "none.csv"),
        ({"table": "hazard.csv", "measure": "pgv"}, "line 2"),
        (
            {"table": "hazard.csv", "response": "peak_openings"},
            "'peak_openings' is no response of a run; take",
        ),
        ({"table": "hazard.csv", "levels": ["-3 mm"]}, "suite.hazard.levels[0]: must be above 0"),
        ({"table": "hazard.csv", "levels": ["3 mm", "0.3 cm"]}, "suite.hazard.levels[1]"),
        ({"table": "hazard.csv", "levels": ["3 MPa"]}, "suite.hazard.levels[0]"),
    ],
)
def test_wrong_hazards_are_refused_by_check_and_by_run(tmp_path, hazard, part):
    (tmp_path / "hazard.csv").write_text(CURVE)
    config = write_job(tmp_path, records=1, suite={"hazard": hazard})
    for command in (romdam.check, lambda c: romdam.run_suite(c, tmp_path / "out")):
        with pytest.raises(ConfigError) as told:
            command(config)
        assert part in str(told.value)


def test_levels_that_nobody_named_lie_within_the_runs_and_a_response_may_be_missing():
    rng = np.random.default_rng(4)
    summary = lognormal_curves(rng, 3.0, 0.4, np.geomspace(1.0, 8.0, 8), 40)[0]
    x = np.array([0.5, 1.0, 4.0])
    curve = HazardCurve(x, 2e-3 * x**-2.0)
    found = with_hazard_of_response(summary, curve, "peak_opening", "sa", None)
    low, high = np.quantile(summary.peak_opening, [0.05, 0.95])
    levels = found.hazard_level.values
    assert len(levels) == 12 and levels[0] >= 0.97 * low and levels[-1] <= 1.03 * high
    assert (np.diff(found.annual_frequency.values) < 0.0).all()
    # capacities of a level y are theta y^(1/1.3), so frequencies go with y^(-2/1.3)
    k = int(np.abs(levels - 1.0).argmin())
    want = 2e-3 * (3.0 * levels[k] ** (1 / 1.3)) ** -2.0 * math.exp(0.5 * (2.0 * 0.4) ** 2)
    assert float(found.annual_frequency[k]) == pytest.approx(want, rel=0.25)  # 40 records
    # records that sequences repeat do not count
    repeated = np.where(np.arange(40) < 30, "", "r000")
    within = summary.assign({WITHIN: ("record", repeated)})
    part = with_hazard_of_response(within, curve, "peak_opening", "sa", [1.0])
    first = summary.isel(record=slice(30))
    want = with_hazard_of_response(first, curve, "peak_opening", "sa", [1.0]).annual_frequency.values
    assert part.annual_frequency.values == pytest.approx(want, rel=1e-12)
    assert (
        "no run has peak_slip"
        in with_hazard_of_response(summary, curve, "peak_slip", "sa", None).attrs["hazard_statement"]
    )


def test_bounds_of_an_annual_frequency_are_those_of_the_scatter_between_records():
    """Of n known capacities ln(lambda) has the variance k^2 beta^2 / n + k^4 beta^4 / (2 n) for H = k0 x^-k:
    that of ln(theta) is beta^2 / n, of beta^2 it is 2 beta^4 / n, and they are independent."""
    theta, beta, k, records = 3.0, 0.4, 2.5, 400
    levels = np.geomspace(0.3, 30.0, 12)
    summary, capacity = lognormal_curves(np.random.default_rng(5), theta, beta, levels, records)
    x = np.array([0.1, 1.0, 50.0])
    found = with_hazard_of_response(summary, HazardCurve(x, 2e-3 * x**-k), "peak_opening", "sa", [1.0])
    of_sample = np.log(capacity).std()
    frequency = 2e-3 * math.exp(-k * np.log(capacity).mean() + 0.5 * (k * of_sample) ** 2)
    assert float(found.annual_frequency[0]) == pytest.approx(frequency, rel=5e-3)
    spread = math.sqrt((k * of_sample) ** 2 / records + (k * of_sample) ** 4 / (2.0 * records))
    low, high = np.log(found.annual_frequency_bounds.values[0] / frequency)
    assert (high, low) == pytest.approx((1.645 * spread, -1.645 * spread), rel=0.2)
    assert "hazard_warning" not in found.attrs


@pytest.mark.parametrize("records", [1, 4, 5])
def test_few_records_are_warned_of_and_have_no_bounds(records):
    levels = np.geomspace(0.3, 30.0, 12)
    summary, _ = lognormal_curves(np.random.default_rng(5), 3.0, 0.4, levels, records)
    curve = HazardCurve(np.array([0.1, 1.0, 50.0]), np.array([0.5, 2e-3, 1e-7]))
    found = with_hazard_of_response(summary, curve, "peak_opening", "sa", [1.0])
    warned = found.attrs.get("hazard_warning", "")
    assert np.isfinite(found.annual_frequency_bounds.values).all() == (records == 5) == (not warned)
    assert records == 5 or warned.startswith(f"annual frequencies are of {records} record")
    (row,) = hazard_rows(found, 1.0)
    assert (" to " in row[2]) == (records == 5)
    (table,) = hazard_tables(found)
    assert (table.caption is None) == (records == 5)
