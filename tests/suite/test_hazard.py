"""Annual frequencies from a hazard curve and a lognormal fragility, and what of a table is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm
from suite_jobs import made, write_job
from test_cli import call

from romdam.core.errors import ConfigError
from romdam.postprocess.hazard import HazardCurve
from romdam.results.suite.hazard_table import read_hazard


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
    assert "per year" in page and "outside the hazard" in page and "--hazard" in page
