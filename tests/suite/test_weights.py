"""Weights of records: quantiles, likelihood and frequencies by hand; the summary; what is refused."""

import numpy as np
import pytest
import yaml
from scipy.optimize import minimize
from scipy.stats import norm
from suite_jobs import BASE, MU, made, summary, write_job
from summaries import lognormal_curves, suite_page, summary_of
from test_cli import call
from test_report import rows_of, suite_summary

import romdam
from romdam.core.errors import ConfigError
from romdam.postprocess.extremes import opening_envelopes
from romdam.postprocess.fragility import fragility
from romdam.postprocess.hazard_of_response import few_records
from romdam.postprocess.incremental import ida_curves
from romdam.postprocess.weights import WEIGHT, effective_number, weighted_quantiles
from romdam.results.suite.record_weights import record_weights
from romdam.visual.report.subject import Subject, Topic


def weighted(summary, weights):
    return summary.assign_coords({WEIGHT: ("record", np.asarray(weights, dtype=float) / np.sum(weights))})


def test_effective_number_by_hand():
    assert effective_number(np.array([2.0, 1.0, 1.0])) == pytest.approx(16.0 / 6.0)
    assert effective_number(np.ones(7)) == pytest.approx(7.0)
    assert effective_number(np.array([3.0, 0.0])) == 1.0 and effective_number(np.zeros(2)) == 0.0


def test_quantiles_by_hand():
    """1, 2, 3 weigh 1/2, 1/4, 1/4, 8/3 effective values: windows of 3/8 from share 5/8 on.

    The median's window is 5/16 to 11/16: 3/16 of it in the first stretch and 3/16 in the second: 1.5.
    That of 84 % is 0.525 to 0.9: 0.225 in the second and 0.15 in the third: 2.4.
    """
    values, weights = np.array([3.0, 1.0, 2.0]), np.array([0.25, 0.5, 0.25])
    found = weighted_quantiles(values, (0.0, 0.5, 0.84, 1.0), weights)
    np.testing.assert_allclose(found, [1.0, 1.5, 2.4, 3.0], rtol=1e-12)
    np.testing.assert_allclose(weighted_quantiles(values, (0.5, 1.0), 40.0 * weights), [1.5, 3.0])
    with_none = weighted_quantiles(np.append(values, 99.0), (0.5, 1.0), np.append(weights, 0.0))
    np.testing.assert_allclose(with_none, [1.5, 3.0])


def test_quantiles_with_equal_weights_are_those_of_numpy():
    values = np.random.default_rng(3).normal(size=(11, 4, 2))
    shares = (0.0, 0.16, 0.37, 0.5, 0.84, 1.0)
    nearly = 1.0 + 1e-13 * np.arange(11)  # by the general way
    for weights in (None, np.full(11, 0.3), nearly):
        np.testing.assert_allclose(
            weighted_quantiles(values, shares, weights), np.quantile(values, shares, axis=0), atol=1e-11
        )


def test_fragility_maximises_the_weighted_likelihood():
    """By scipy's minimiser, from capacities that are known, of records that always or never exceed."""
    found, capacity = lognormal_curves(np.random.default_rng(5), 3.0, 0.4, np.geomspace(2.0, 4.5, 6), 12)
    weights = np.random.default_rng(6).uniform(0.2, 3.0, 12)
    fit = fragility(weighted(found, weights), "peak_opening", 1.0)
    known = (capacity > 2.0) & (capacity < 4.5)
    assert 0 < known.sum() < 12

    def loss(at):
        theta, beta = at[0], np.exp(at[1])
        z = (np.log(capacity) - theta) / beta
        parts = np.where(known, norm.logpdf(z) - at[1], 0.0)
        parts += np.where(capacity <= 2.0, norm.logcdf((np.log(2.0) - theta) / beta), 0.0)
        parts += np.where(capacity >= 4.5, norm.logsf((np.log(4.5) - theta) / beta), 0.0)
        return -weights @ parts

    best = minimize(loss, [1.0, -1.0], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12})
    assert float(fit.theta) == pytest.approx(np.exp(best.x[0]), rel=1e-6)
    assert float(fit.beta) == pytest.approx(np.exp(best.x[1]), rel=1e-6)
    assert float(fragility(found, "peak_opening", 1.0).theta) != pytest.approx(float(fit.theta), rel=1e-3)
    assert fit.attrs["effective_records"] == pytest.approx(weights.sum() ** 2 / (weights @ weights))


def test_known_capacities_have_weighted_moments_and_bounds_of_the_effective_number():
    """Mean and deviation of the logarithms; the median is bounded by a profile of so many as count alike."""
    found, capacity = lognormal_curves(np.random.default_rng(8), 3.0, 0.3, np.geomspace(0.5, 20.0, 12), 9)
    weights = np.array([1.0, 2.0, 0.5, 4.0, 1.0, 1.0, 3.0, 0.25, 2.0])
    fit, x = fragility(weighted(found, weights), "peak_opening", 1.0), np.log(capacity)
    mean = np.average(x, weights=weights)
    variance = np.average((x - mean) ** 2, weights=weights)
    assert float(np.log(fit.theta)) == pytest.approx(mean, abs=1e-9)
    assert float(fit.beta) == pytest.approx(np.sqrt(variance), rel=1e-9)
    # profile: n/2 ln(1 + d^2 / variance) = z^2 / 2
    number = weights.sum() ** 2 / (weights @ weights)
    away = np.sqrt(variance * np.expm1(norm.ppf(0.975) ** 2 / number))
    np.testing.assert_allclose(np.log(fit.theta_bounds), [mean - away, mean + away], rtol=2e-4)


def test_a_record_of_weight_0_changes_no_statistic_and_equal_weights_change_none():
    whole = suite_summary(records=7, failed=0)
    without = whole.isel(record=slice(0, 6))
    zero = weighted(whole, [1, 1, 1, 1, 1, 1, 0])
    for one in (zero, weighted(without, np.full(6, 0.2))):
        a, b = fragility(one, "peak_opening", 0.02), fragility(without, "peak_opening", 0.02)
        for name in ("theta", "beta", "theta_bounds", "beta_bounds", "group_share"):
            np.testing.assert_allclose(a[name], b[name], rtol=1e-9, err_msg=name)
        np.testing.assert_allclose(opening_envelopes(one).opening, opening_envelopes(without).opening)
        np.testing.assert_allclose(ida_curves(one).fractiles, ida_curves(without).fractiles, rtol=1e-12)


def test_the_page_states_weights_and_weighted_medians():
    opening = np.array([0.01, 0.02, 0.03])
    whole = suite_summary(records=3, scales=1, failed=0)
    whole["peak_opening"] = whole.peak_opening.copy(data=opening[:, None, None, None])
    text = suite_page(Subject(weighted(whole, [2, 1, 1]), Topic()))
    row = next(row for row in rows_of(text, "responses") if row and row[0] == "peak opening")
    assert row[4] == "15"  # mm, see test_quantiles_by_hand
    stated = next(row for row in rows_of(text, "what") if row and row[0] == "weights of the records")
    assert stated[1] == "r000 50 %, r001 25 %, r002 25 %; they count as 2.67"
    assert "by the weights of the records" in text


def test_few_effective_records_are_few():
    assert few_records(6, 6.0) == ""
    assert "6 records that by their weights count as 2.7" in few_records(6, 2.7)


NAMES = ["r0", "r1", "near_1"]


def test_weights_by_name_and_pattern():
    np.testing.assert_allclose(record_weights({"r?": 1.0, "near_*": 2.0}, NAMES, "job"), [0.25, 0.25, 0.5])
    np.testing.assert_allclose(record_weights({"*": 1.0, "r1": 8.0}, NAMES, "job"), [0.1, 0.8, 0.1])


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        ({"*": 1.0, "r9": 1.0}, "no record is 'r9'; the records are near_1, r0, r1"),
        ({"r0": 1.0, "r1": 1.0}, "the record 'near_1' has no weight"),
        ({"r*": 1.0, "*0": 1.0, "near_1": 1.0}, "the record 'r0' has several weights"),
        ({"*": 0.0}, "all weights are 0"),
    ],
)
def test_weights_that_do_not_fit_the_records_are_refused(weights, said):
    with pytest.raises(ConfigError) as refused:
        record_weights(weights, NAMES, "job.yaml")
    assert str(refused.value).startswith("job.yaml: suite.weights: ") and said in str(refused.value)


@pytest.mark.parametrize("pipeline", ["suite", pytest.param("run", marks=pytest.mark.slow)])
def test_a_summary_has_the_weights_and_wrong_ones_are_refused_before_any_run(tmp_path, pipeline):
    outputs = {**BASE["outputs"], "plots": False, "mesh_error": False}
    suite = {"weights": {"r0": 2, "r[12]": 1}} | ({"parameters": MU} if pipeline == "suite" else {})
    suite["weights"] = {"r0": 2, "r1": 1, "r2": 1}
    config = write_job(tmp_path, suite=suite, outputs=outputs, pipeline=pipeline)
    code, said, _ = call("run", config, "--out", tmp_path / "out")
    assert code == 0
    found = summary(tmp_path / "out")
    np.testing.assert_allclose(found[WEIGHT], [0.5, 0.25, 0.25])
    assert found[WEIGHT].attrs["effective_records"] == pytest.approx(8.0 / 3.0)
    if pipeline == "suite":
        assert "weights of records, which count as 2.67" in said
    raw = yaml.safe_load(config.read_text())
    for weights, words in (
        ({"r0": 1, "r1": 1, "r2": 1, "kobe": 1}, "kobe"), ({"r0": -1}, "suite.weights.r0"),
        ({"r0": float("inf")}, "suite.weights.r0"), ({"*": 0}, "all weights are 0"), ({}, "suite.weights"),
    ):  # fmt: skip
        raw["suite"]["weights"] = weights
        config.write_text(yaml.safe_dump(raw))
        code, _, stderr = call("run", config, "--out", tmp_path / "other")
        assert code == 2 and words in stderr and "Traceback" not in stderr, stderr
        assert not list((tmp_path / "other").glob("*.nc"))


def test_changed_weights_make_no_run_again(tmp_path):
    config = write_job(tmp_path, suite={"parameters": MU, "weights": {"*": 1}})
    assert made(config, tmp_path / "out").made == 6
    raw = yaml.safe_load(config.read_text())
    raw["suite"]["weights"] = {"*": 1, "r1": 3}
    config.write_text(yaml.safe_dump(raw))
    again = made(config, tmp_path / "out")
    assert again.made == 0
    np.testing.assert_allclose(again.summary[WEIGHT], [0.2, 0.6, 0.2])
    assert romdam.open_suite(tmp_path / "out").to_dataset()[WEIGHT].dims == ("record",)


def test_stripes_are_weighted_too():
    """One scale: r exceeds where its capacity is below its intensity; a probit by scipy's minimiser."""
    random = np.random.default_rng(11)
    sa = np.exp(random.normal(0.0, 0.6, 40))
    exceeds = np.exp(random.normal(0.0, 0.4, 40)) < sa
    weights = random.uniform(0.1, 2.0, 40)
    found = summary_of(np.where(exceeds, 2.0, 0.5)[:, None, None], sa[:, None])
    fit = fragility(weighted(found, weights), "peak_opening", 1.0)

    def loss(at):
        z = (np.log(sa) - at[0]) / np.exp(at[1])
        return -weights @ np.where(exceeds, norm.logcdf(z), norm.logsf(z))

    best = minimize(loss, [0.0, -1.0], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12})
    assert float(np.log(fit.theta)) == pytest.approx(best.x[0], abs=1e-6)
    assert float(fit.beta) == pytest.approx(np.exp(best.x[1]), rel=1e-6)
