"""Statistics of suites, against populations that are known and against independent code."""

import warnings

import numpy as np
import pytest
from scipy.stats import CensoredData, norm, spearmanr
from summaries import lognormal_curves, lognormal_stripes, summary_of

from romdam.core.errors import ResultError
from romdam.postprocess.dependence import correlation, sensitivity
from romdam.postprocess.extremes import opening_envelopes, worst_runs
from romdam.postprocess.fragility import fragility, product_limit
from romdam.postprocess.incremental import ida_curves
from romdam.postprocess.lognormal import Observations, fit_lognormal
from romdam.postprocess.responses import intensity_of, measures, parameters, response_of

# Example data distributed with Baker (Earthquake Spectra 31(1), 2015, 579-599): collapses of 40 at each level
BAKER_SA = np.array([0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0])
BAKER_COLLAPSES = np.array([0, 0, 0, 4, 6, 13, 12, 16])


def baker_summary():
    exceeds = np.arange(40)[:, None] < BAKER_COLLAPSES
    return summary_of(np.where(exceeds, 2.0, 0.5)[..., None], np.broadcast_to(BAKER_SA, (40, 8)))


def test_fragility_of_published_stripes_agrees_with_a_probit_regression():
    # statsmodels 0.15.0, GLM(binomial, probit link) of the collapses on [1, ln Sa], tol 1e-14:
    # theta = exp(-a / b), beta = 1 / b
    found = fragility(baker_summary(), "peak_opening", 1.0, "sa", "stripes")
    assert float(found.theta) == pytest.approx(1.0761157946, rel=1e-8)
    assert float(found.beta) == pytest.approx(0.4292372044, rel=1e-8)
    assert found.attrs["observations"] == 320 and found.attrs["exceeding"] == BAKER_COLLAPSES.sum()
    np.testing.assert_allclose(found.group_share, BAKER_COLLAPSES / 40)
    np.testing.assert_allclose(found.group_intensity, BAKER_SA)


def test_profile_bounds_lie_where_the_likelihood_has_fallen_by_the_quantile():
    # a grid search of the likelihood itself, maximised over the other parameter
    found = fragility(baker_summary(), "peak_opening", 1.0, "sa", "stripes")
    theta, beta = np.linspace(0.9, 1.5, 1201)[:, None], np.linspace(0.25, 0.8, 1101)
    height = np.zeros((1201, 1101))
    for sa, hit in zip(BAKER_SA, BAKER_COLLAPSES, strict=True):
        eta = np.log(sa / theta) / beta
        height += hit * norm.logcdf(eta) + (40 - hit) * norm.logsf(eta)
    lowest = height.max() - 0.5 * norm.ppf(0.975) ** 2
    inside = theta[height.max(axis=1) >= lowest, 0]
    np.testing.assert_allclose(found.theta_bounds, [inside[0], inside[-1]], atol=1e-3)
    inside = beta[height.max(axis=0) >= lowest]
    np.testing.assert_allclose(found.beta_bounds, [inside[0], inside[-1]], atol=1e-3)


def test_truncated_fit_agrees_with_scipys_censored_fit():
    rng = np.random.default_rng(4)
    x, limit = rng.normal(0.3, 0.5, 60), 0.5
    seen = Observations(x[x <= limit], np.empty(0), np.full((x > limit).sum(), limit))
    mean, deviation = norm.fit(CensoredData(uncensored=seen.known, right=seen.above))
    fit = fit_lognormal(seen)
    assert np.log(fit.theta) == pytest.approx(mean, abs=2e-4)  # scipy stops its search there
    assert fit.beta == pytest.approx(deviation, abs=2e-4)


@pytest.mark.parametrize("kind", ["stripes", "capacities"])
def test_bounds_hold_the_true_parameters_as_often_as_they_say(kind):
    rng, theta, beta, count = np.random.default_rng(7), 3.0, 0.4, 120
    levels, held = np.log(np.geomspace(1.0, 6.0, 6)), np.zeros(2)
    for _ in range(count):
        if kind == "stripes":
            below = rng.normal(np.log(theta), beta, (6, 15)) <= levels[:, None]
            many = below.sum(axis=1)
            seen = Observations(np.empty(0), np.repeat(levels, many), np.repeat(levels, 15 - many))
        else:
            x = rng.normal(np.log(theta), beta, 40)
            last = np.log(4.0)
            seen = Observations(x[x <= last], np.empty(0), np.full((x > last).sum(), last))
        fit = fit_lognormal(seen)
        for k, (bounds, true) in enumerate(((fit.theta_bounds(), theta), (fit.beta_bounds(), beta))):
            held[k] += bounds[0] <= true <= bounds[1]
    # 95 % of 120, within three standard deviations of the binomial
    assert (np.abs(held - 0.95 * count) <= 3.0 * np.sqrt(count * 0.95 * 0.05)).all()


@pytest.mark.parametrize("records", [40, 400])
def test_fragility_recovers_a_synthetic_lognormal_population(records):
    rng, levels = np.random.default_rng(3), np.geomspace(1.0, 8.0, 8)
    found = fragility(
        lognormal_stripes(rng, 3.0, 0.4, levels, records), "peak_opening", 1.0, method="stripes"
    )
    for name, true in (("theta", 3.0), ("beta", 0.4)):
        low, high = found[f"{name}_bounds"].values
        assert low < true < high and low < float(found[name]) < high
        assert high - low < 1.4 * true / np.sqrt(records / 10)  # and they say something
    curves, capacity = lognormal_curves(rng, 3.0, 0.4, levels, records)
    found = fragility(curves, "peak_opening", 1.0)
    assert found.attrs["method"] == "capacities" and found.attrs["observations"] == records
    assert found.attrs["interpolated"] == ((capacity >= 1.0) & (capacity < 8.0)).sum()
    for name, true in (("theta", 3.0), ("beta", 0.4)):
        low, high = found[f"{name}_bounds"].values
        assert low < true < high


def test_band_holds_the_fit_and_narrows_with_more_records():
    rng, levels = np.random.default_rng(5), np.geomspace(1.0, 8.0, 8)
    width = []
    for records in (10, 160):
        found = fragility(
            lognormal_stripes(rng, 3.0, 0.4, levels, records), "peak_opening", 1.0, method="stripes"
        )
        low, high = found.probability_bounds.values.T
        assert (low <= found.probability.values).all() and (found.probability.values <= high).all()
        width.append((high - low).max())
    assert width[1] < 0.4 * width[0]  # 1 / sqrt(16) in the limit


def test_one_scale_makes_capacities_and_stripes_the_same():
    rng = np.random.default_rng(2)
    sa = np.exp(rng.normal(1.0, 0.6, (60, 1)))
    summary = summary_of(sa[..., None] / np.exp(rng.normal(1.0, 0.4, (60, 1, 1))), sa)
    both = [fragility(summary, "peak_opening", 1.0, method=m) for m in ("capacities", "stripes")]
    assert float(both[0].theta) == float(both[1].theta) and float(both[0].beta) == float(both[1].beta)


@pytest.mark.parametrize(
    ("threshold", "says"),
    [(1e9, "no run exceeds"), (-1.0, "every run exceeds"), (2.5, "do not overlap")],
)
def test_fragility_without_a_maximum_says_why(threshold, says):
    sa = np.arange(1.0, 6.0)[:, None]
    found = fragility(summary_of(sa[..., None], sa), "peak_opening", threshold)
    assert says in found.attrs["statement"]
    assert np.isnan(found.theta) and np.isnan(found.beta_bounds).all()


def test_share_that_falls_with_intensity_is_no_fragility():
    sa = np.arange(1.0, 31.0)[:, None]
    noise = np.random.default_rng(1).normal(0.0, 6.0, 30)
    found = fragility(summary_of((30.0 - sa.ravel() + noise)[:, None, None], sa), "peak_opening", 15.0)
    assert "does not grow" in found.attrs["statement"] and np.isnan(found.theta)


def test_bounds_that_the_data_do_not_set_are_infinite():
    # two exceedances among many, all over the range: nearly no trend, so beta has no upper bound
    sa = np.arange(1.0, 41.0)[:, None]
    response = np.where(np.isin(np.arange(40), [15, 30]), 2.0, 0.5)
    found = fragility(summary_of(response[:, None, None], sa), "peak_opening", 1.0)
    assert np.isinf(found.beta_bounds.values[1]) and np.isfinite(found.beta_bounds.values[0])


def test_failed_runs_are_left_out_and_counted():
    rng, levels = np.random.default_rng(3), np.geomspace(1.0, 8.0, 8)
    whole = lognormal_stripes(rng, 3.0, 0.4, levels, 40)
    half = whole.copy(deep=True)
    half.peak_opening[20:] = np.nan
    found = fragility(half, "peak_opening", 1.0, method="stripes")
    expected = fragility(whole.isel(record=slice(20)), "peak_opening", 1.0, method="stripes")
    assert float(found.theta) == float(expected.theta)
    assert found.attrs["runs"] == 160 and found.attrs["failed"] == 160
    nothing = whole.copy(deep=True)
    nothing.peak_opening[:] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for analysis in (ida_curves, correlation, sensitivity):
            assert analysis(nothing, "peak_opening").attrs["statement"]
        assert fragility(nothing, "peak_opening", 1.0).attrs["statement"] == "there are no runs"
        assert worst_runs(nothing).sizes["run"] == 0


def test_dots_of_capacities_are_the_product_limit_estimate():
    # Kaplan and Meier (1958): steps at 1, 2 and 4 among five records, of which one is cut off at 3
    seen = Observations(np.log([1.0, 2.0, 4.0]), np.empty(0), np.log([3.0, 5.0]))
    found = product_limit(seen)
    np.testing.assert_allclose(found[:, 0], [1.0, 2.0, 4.0])
    np.testing.assert_allclose(found[:, 1], 1.0 - np.cumprod([4 / 5, 3 / 4, 1 / 2]))


def test_first_exceedance_counts_where_a_curve_comes_back():
    sa = np.array([[1.0, 2.0, 4.0, 8.0]])
    summary = summary_of(np.array([[0.5, 2.0, 0.5, 4.0]])[..., None], sa)
    found = fragility(summary, "peak_opening", 1.0)
    assert found.attrs["exceeding"] == 1 and found.attrs["interpolated"] == 1
    assert "one intensity" in found.attrs["statement"]


def test_ida_fractiles_of_power_laws_are_power_laws():
    rng, levels = np.random.default_rng(6), np.geomspace(0.5, 4.0, 5)
    factor = np.exp(rng.normal(0.0, 0.3, (101, 1, 1)))
    sa = np.broadcast_to(levels, (101, 5))
    found = ida_curves(summary_of(0.01 * factor * sa[..., None] ** 1.5, sa))
    expected = np.quantile(factor, [0.16, 0.5, 0.84])[:, None] * 0.01 * found.level.values**1.5
    np.testing.assert_allclose(found.fractiles, expected, rtol=1e-12)
    assert (found["count"] == 101).all() and set(levels) <= set(found.level.values)


def test_ida_does_not_continue_curves_past_their_ends():
    sa = np.array([[1.0, 2.0], [1.0, 4.0], [1.0, 8.0]])
    found = ida_curves(summary_of(sa[..., None], sa))
    reach = found["count"].sel(level=[1.0, 8.0], method="nearest").values
    assert list(reach) == [3, 1]
    assert np.isnan(found.fractiles.sel(level=8.0, method="nearest")).all()


def test_ida_needs_two_intensities():
    sa = np.ones((3, 1))
    assert "two intensities" in ida_curves(summary_of(sa[..., None], sa)).attrs["statement"]


def test_correlation_recovers_a_power_law_and_its_scatter():
    rng = np.random.default_rng(8)
    sa = np.exp(rng.normal(0.0, 0.7, (400, 1)))
    noise = rng.normal(0.0, 0.25, (400, 1, 1))
    summary = summary_of(0.02 * sa[..., None] ** 1.4 * np.exp(noise), sa)
    found = correlation(summary).sel(measure="sa")
    assert float(found.slope) == pytest.approx(1.4, abs=3 * 0.25 / (0.7 * 20))
    assert float(found.dispersion) == pytest.approx(0.25, rel=3 / np.sqrt(800))
    assert float(found.spearman) == pytest.approx(
        spearmanr(sa.ravel(), summary.peak_opening.values.ravel()).statistic, abs=1e-12
    )
    assert int(found["count"]) == 400


def test_correlation_with_what_does_not_vary_is_nan_and_negative_responses_keep_their_rank():
    sa = np.arange(1.0, 6.0)[:, None]
    summary = summary_of(sa[..., None] - 3.0, sa, record_dt=(("record", "scale"), np.full((5, 1), 0.01)))
    found = correlation(summary)
    assert np.isnan(found.sel(measure="dt").spearman)
    assert float(found.sel(measure="sa").spearman) == pytest.approx(1.0)
    assert np.isnan(found.sel(measure="sa").pearson)


def test_sensitivity_finds_what_matters_and_bounds_what_does_not():
    rng = np.random.default_rng(9)
    x = rng.uniform(0.0, 1.0, (3, 200))
    record = np.exp(rng.normal(0.0, 1.0, (10, 1, 1)))  # what a record does must not hide what a sample does
    response = 0.01 * record * np.exp(2.0 * x[0] - 0.5 * x[1] + rng.normal(0.0, 0.05, (10, 1, 200)))
    names = dict(zip(("stiff", "gap", "nothing"), x, strict=True))
    found = sensitivity(summary_of(response, np.ones((10, 1)), names))
    value = dict(zip(found.parameter.values, found.regression.values, strict=True))
    assert value["stiff"] > 0.9 and -0.35 < value["gap"] < -0.15
    low, high = found.regression_bounds.sel(parameter="nothing").values
    assert -0.1 < low < high < 0.1
    assert float(found.r_squared) > 0.95
    expected = spearmanr(x[0], found.effect).statistic
    assert float(found.spearman.sel(parameter="stiff")) == pytest.approx(expected, abs=1e-12)


def test_bootstrap_bounds_hold_zero_as_often_as_they_say():
    rng, held, count = np.random.default_rng(10), np.zeros(2), 80
    for _ in range(count):
        x = rng.uniform(0.0, 1.0, (2, 60))
        response = np.exp(x[0] + rng.normal(0.0, 0.3, 60))[None, None]
        found = sensitivity(summary_of(response, np.ones((1, 1)), {"a": x[0], "nothing": x[1]}))
        for k, name in enumerate(("spearman", "regression")):
            low, high = found[f"{name}_bounds"].sel(parameter="nothing").values
            held[k] += low <= 0.0 <= high
    assert (np.abs(held - 0.95 * count) <= 3.0 * np.sqrt(count * 0.95 * 0.05)).all()


def test_sensitivity_takes_rigid_joints_and_samples_that_failed():
    stiffness = np.tile([1e9, 1e10, np.inf], 6)
    gap = np.repeat([0.0, 1e-3, 2e-3, 3e-3, 4e-3, 5e-3], 3)
    response = np.broadcast_to(0.02 - gap, (4, 2, 18)).copy()
    response[:, :, 0] = np.nan
    response[0, 0, 5] = np.nan
    found = sensitivity(summary_of(response, np.ones((4, 2)), {"stiffness": stiffness, "gap": gap}))
    assert found.attrs["samples"] == 17 and found.attrs["failed"] == 9
    assert float(found.spearman.sel(parameter="gap")) == pytest.approx(-1.0, abs=0.02)
    assert abs(float(found.spearman.sel(parameter="stiffness"))) < 0.2


@pytest.mark.parametrize(
    ("values", "says"),
    [({}, "no parameters"), ({"a": np.ones(8)}, "two values"), ({"a": np.arange(8.0)}, "does not vary")],
)
def test_sensitivity_without_variation_says_why(values, says):
    found = sensitivity(summary_of(np.ones((2, 1, 8)), np.ones((2, 1)), values))
    assert says in found.attrs["statement"]
    assert np.isnan(found.spearman).all()


def test_worst_runs_are_the_largest_in_order():
    response = np.array([[1.0, 5.0], [np.nan, 4.0], [2.0, 3.0]])[..., None]
    found = worst_runs(summary_of(response, np.ones((3, 2))), count=3)
    assert list(found.response.values) == [5.0, 4.0, 3.0]
    assert list(found.record.values) == ["r000", "r001", "r002"]


def test_opening_envelopes_are_fractiles_over_records_and_samples_of_what_ran(monkeypatch):
    rng = np.random.default_rng(11)
    peaks = rng.uniform(0.0, 0.1, (6, 2, 3, 5)).astype(np.float32)
    peaks[2, 1] = np.nan
    gaps = {"gap_peak_opening": (("record", "scale", "sample", "gap"), peaks, {"units": "m"})}
    summary = summary_of(np.ones((6, 2, 3)), np.ones((6, 2)), **gaps).assign_coords(
        gap_joint=("gap", ["J1"] * 5),
        gap_position=(("gap", "component"), rng.uniform(size=(5, 3))),
        component=["x", "y", "z"],
    )
    monkeypatch.setattr("romdam.postprocess.extremes.MEMORY", 40)  # two gaps at a time
    found = opening_envelopes(summary)
    assert list(found["count"]) == [18, 15]
    for k in range(2):
        expected = np.nanquantile(peaks[:, k].reshape(18, 5).astype(float), [0.5, 0.84, 1.0], axis=0)
        np.testing.assert_allclose(found.opening[:, k], expected)
    with pytest.raises(ResultError, match="a model without joints has no openings"):
        opening_envelopes(summary.drop_vars("gap_peak_opening"))


def test_compression_is_turned_and_names_that_are_not_there_are_refused():
    sa = np.arange(1.0, 4.0)[:, None]
    about = {"units": "N", "long_name": "largest force, compression negative"}
    force = (("record", "scale", "sample", "joint"), -sa[..., None, None], about)
    summary = summary_of(sa[..., None], sa, peak_compression=force)
    assert list(response_of(summary, "peak_compression").values.ravel()) == [1.0, 2.0, 3.0]
    assert measures(summary) == ["sa", "pga"] and parameters(summary) == {}
    assert intensity_of(summary, "scale").dims == ("record", "scale")
    with pytest.raises(ResultError, match="nothing: is no response of this suite; it has peak_opening"):
        response_of(summary, "nothing")
    with pytest.raises(ResultError, match=r"nothing: is no measure .* sa, pga, scale"):
        intensity_of(summary, "nothing")
    with pytest.raises(ResultError, match="use auto, capacities or stripes"):
        fragility(summary, "peak_opening", 1.0, method="best")


def test_correlation_counts_records_within_a_scale():
    """Response and measure grow with the scale, and are independent among records: pooled, they correlate."""
    rng = np.random.default_rng(11)
    scale, own, sa = (
        np.array([1.0, 4.0, 16.0]),
        np.exp(rng.normal(size=(200, 1, 1))),
        np.exp(rng.normal(size=(200, 1))),
    )
    summary = summary_of(0.01 * scale[:, None] * own * np.ones((200, 3, 6)), sa * scale)
    pooled = spearmanr((sa * scale).ravel(), (scale * own[:, 0]).ravel()).statistic
    found = correlation(summary).sel(measure="sa")
    assert pooled > 0.5 and abs(float(found.spearman)) < 0.3
    assert (found.count_at_scale == 200).all()
    alone = spearmanr(sa[:, 0], own[:, 0, 0]).statistic
    np.testing.assert_allclose(found.spearman_at_scale, alone, atol=1e-12)


def test_two_records_are_too_few_to_correlate():
    sa = np.array([[1.0, 2.0], [3.0, 6.0]])
    assert "2 records are too few" in correlation(summary_of(sa[..., None], sa)).attrs["statement"]


def test_what_curves_say_of_a_threshold_by_hand():
    """0.5 at 1 and 2 at 4 cross 1 at 2; the next is above at its first intensity, the last below at 5."""
    sa = np.array([[1.0, 4.0], [1.5, 3.0], [0.7, 5.0]])
    response = np.array([[0.5, 2.0], [2.0, 3.0], [0.2, 0.4]])
    found = fragility(summary_of(response[..., None], sa), "peak_opening", 1.0)
    # three at risk at 1.5, two at 2: 1/3 and 1 - (2/3)(1/2)
    np.testing.assert_allclose(found.group_intensity, [1.5, 2.0])
    np.testing.assert_allclose(found.group_share, [1 / 3, 2 / 3])


def test_groups_of_runs_stand_at_their_mean_in_logarithms():
    """Ten runs of unlike intensities in two groups: (1 2 3 4 5)^(1/5) and (6 7 8 9 10)^(1/5)."""
    sa = np.arange(1.0, 11.0)[:, None]
    response = np.where(np.isin(np.arange(10), [1, 5, 7, 8]), 2.0, 0.5)[:, None, None]
    found = fragility(summary_of(response, sa), "peak_opening", 1.0)
    assert found.attrs["method"] == "stripes"
    np.testing.assert_allclose(found.group_intensity, [120.0**0.2, 30240.0**0.2])
    np.testing.assert_allclose(found.group_share, [0.2, 0.6])


def test_effect_of_a_sample_that_failed_in_a_strong_record():
    """Logarithms -1, 0, 1 and 2, 3, none: less 0 and 2.5 they are -1 and -0.5, 0 and 0.5, 1."""
    logarithm = np.array([[-1.0, 0.0, 1.0], [2.0, 3.0, np.nan]])
    summary = summary_of(np.exp(logarithm)[:, None], np.ones((2, 1)), {"friction": [0.3, 0.5, 0.9]})
    np.testing.assert_allclose(sensitivity(summary).effect, [-0.75, 0.25, 1.0])
