"""Distributions of a suite's parameters and their correlation, against closed forms."""

import math

import numpy as np
import pytest
from scipy.stats import lognorm, norm, spearmanr, truncnorm
from suite_jobs import write_job

import romdam
from romdam.core.errors import ConfigError
from romdam.results.suite.design import design_dataset, varied_keys
from romdam.results.suite.sampling import (
    Marginal,
    correlated,
    latin_hypercube,
    lognormal_spread,
    monte_carlo,
    score_correlation,
)

STIFF = "joints.gap.normal_stiffness"
U = np.array([1e-12, 1e-3, 0.1, 0.5, 0.9, 0.999])


def samples(tmp_path, parameters, design, **suite):
    job = romdam.load_config(
        write_job(tmp_path, records=1, suite={"parameters": parameters, "design": design, **suite})
    )
    made = design_dataset(job, job.config.suite, varied_keys(job, job.config.suite))
    return {name: made[f"parameter_{name}"].values for name in parameters}


@pytest.mark.parametrize(
    ("low", "high"), [(-np.inf, np.inf), (1.0, 4.0), (-np.inf, 2.0), (9.0, np.inf), (9.0, 9.2)]
)
def test_quantiles_are_those_of_scipy(low, high):
    a, b = (low - 3.0) / 1.5, (high - 3.0) / 1.5
    want = truncnorm(a, b, loc=3.0, scale=1.5)
    np.testing.assert_allclose(Marginal("normal", 3.0, 1.5, low, high).value(U), want.ppf(U), rtol=2e-9)
    logs = Marginal("lognormal", 3.0, 1.5, *(np.exp(x) for x in (low, high)))
    np.testing.assert_allclose(np.log(logs.value(U)), want.ppf(U), rtol=2e-9)


def test_moments_are_what_is_asked_for(tmp_path):
    """Mean and cov, median and beta, mean and std; a Latin hypercube of 2,000 has them to 0.1 %."""
    base = {"path": STIFF, "distribution": "lognormal"}
    for said, mean, std in (
        ({"mean": "16 GPa/m", "cov": "30 %"}, 16e9, 4.8e9),
        ({"mean": "16 GPa/m", "std": "4.8 GPa/m"}, 16e9, 4.8e9),
        ({"median": "16 GPa/m", "beta": 0.4}, 16e9 * math.exp(0.08), 16e9 * math.exp(0.08) * 0.41655),
        ({"median": "16 GPa/m", "std": "4.8 GPa/m"}, None, 4.8e9),
    ):
        x = samples(tmp_path, {"k": {**base, **said}}, {"latin_hypercube": 2000})["k"]
        if mean is not None:
            assert x.mean() == pytest.approx(mean, rel=1e-3)
        else:
            assert np.median(x) == pytest.approx(16e9, rel=1e-3)
        assert x.std() == pytest.approx(std, rel=1e-2)
    said = {"path": STIFF, "distribution": "normal", "mean": "16 GPa/m", "cov": 0.2, "low": "14 GPa/m"}
    x = samples(tmp_path, {"k": said}, {"latin_hypercube": 2000})["k"]
    want = truncnorm((14 - 16) / 3.2, np.inf, loc=16e9, scale=3.2e9)
    assert x.mean() == pytest.approx(want.mean(), rel=1e-3) and x.min() >= 14e9
    assert x.std() == pytest.approx(want.std(), rel=1e-2)


def test_nataf_has_the_closed_forms():
    """Two lognormal: ln(1 + rho V V) / (s s); uniform: 2 sin(pi rho / 6); normal and lognormal."""
    sa, sb = lognormal_spread(cov=0.3), lognormal_spread(cov=0.6)
    a, b = (Marginal("lognormal", 1.0, s, 0.0, np.inf) for s in (sa, sb))
    for rho in (-0.6, -0.2, 0.4, 0.9):
        assert score_correlation(a, b, rho) == pytest.approx(math.log1p(rho * 0.18) / (sa * sb), abs=1e-10)
        flat = Marginal("uniform", 0.0, 0.0, 2.0, 5.0)
        assert score_correlation(flat, flat, rho) == pytest.approx(2 * math.sin(math.pi * rho / 6), abs=1e-10)
        bell = Marginal("normal", 7.0, 2.0, -np.inf, np.inf)
        assert score_correlation(bell, a, rho) == pytest.approx(rho * 0.3 / sa, abs=1e-10)
        assert score_correlation(bell, bell, rho) == rho
    with pytest.raises(ValueError, match="outside -0"):
        score_correlation(a, b, -0.99)


@pytest.mark.parametrize(("make", "strata"), [(latin_hypercube, True), (monte_carlo, False)])
def test_samples_are_correlated_and_keep_their_strata(make, strata):
    wanted = np.array([[1.0, 0.7, -0.3], [0.7, 1.0, 0.0], [-0.3, 0.0, 1.0]])
    unit = correlated(make(4000, 3, 5), wanted, strata=strata)
    scores = norm.ppf(unit)
    assert np.abs(np.corrcoef(scores.T) - wanted).max() < (0.01 if strata else 0.04)
    # Spearman's coefficient of a Gaussian copula is 6 / pi asin(rho / 2)
    assert np.abs(spearmanr(unit).statistic - 6 / np.pi * np.arcsin(wanted / 2)).max() < 0.04
    if strata:
        np.testing.assert_array_equal(np.sort((unit * 4000).astype(int), axis=0)[:-1, 0], np.arange(3999))
    same = correlated(make(4000, 3, 5), wanted, strata=strata)
    np.testing.assert_array_equal(unit, same)


def test_a_suite_has_the_correlation_of_values(tmp_path):
    parameters = {
        "k": {"path": STIFF, "distribution": "lognormal", "mean": "16 GPa/m", "cov": 0.8},
        "gap": {"path": "joints.gap.gap", "distribution": "normal", "mean": "2 mm", "std": "0.5 mm"},
        "mu": {"path": "joints.gap.friction", "low": 0.2, "high": 0.9},
    }
    pairs = [{"between": ["gap", "k"], "value": 0.6}, {"between": ["k", "mu"], "value": "-50 %"}]
    for design, off in (({"latin_hypercube": 20000}, 0.01), ({"monte_carlo": 20000, "seed": 3}, 0.02)):
        x = samples(tmp_path, parameters, design, correlation={"pairs": pairs})
        found = np.corrcoef([x["k"], x["gap"], x["mu"]])
        assert found[0, 1] == pytest.approx(0.6, abs=off) and found[0, 2] == pytest.approx(-0.5, abs=off)
        assert np.corrcoef(np.log(x["k"]), x["gap"])[0, 1] == pytest.approx(
            0.6 * 0.8 / lognormal_spread(cov=0.8), abs=off
        )
    x = samples(tmp_path, parameters, {"latin_hypercube": 20000},
                correlation={"pairs": pairs, "of": "scores"})  # fmt: skip
    assert np.corrcoef(np.log(x["k"]), x["gap"])[0, 1] == pytest.approx(0.6, abs=0.01)
    want = lognorm(lognormal_spread(cov=0.8))
    assert np.quantile(x["k"], 0.9) / np.median(x["k"]) == pytest.approx(want.ppf(0.9), rel=2e-3)


LN = {"path": STIFF, "distribution": "lognormal", "mean": "16 GPa/m", "cov": 0.3}
MU = {"path": "joints.gap.friction", "low": 0.2, "high": 0.9}
GAP = {"path": "joints.gap.gap", "low": "0 mm", "high": "2 mm"}


@pytest.mark.parametrize(
    ("parameters", "more", "part"),
    [
        ({"k": {**LN, "cov": -0.3}}, {}, "cov must be at least 0, got -0.3"),
        ({"k": {**LN, "std": "1 GPa/m"}}, {}, "one of `std`, `cov` and `beta`, got mean, std, cov"),
        ({"k": {**LN, "median": "16 GPa/m"}}, {}, "one of `mean` and `median`"),
        ({"k": {**LN, "distribution": "normal", "cov": None, "beta": 0.3}}, {}, "`beta` is of a lognormal"),
        ({"k": {**LN, "distribution": "uniform"}}, {}, "`mean` belongs to"),
        ({"k": {**LN, "low": "900 GPa/m"}}, {}, "leave a probability of"),
        ({"k": {**LN, "low": "30 GPa/m", "high": "20 GPa/m"}}, {}, "`low` must be below `high`"),
        ({"k": {**LN, "mean": "16 m"}}, {}, "16 m"),
        ({"k": LN}, {"design": "grid"}, "the full grid needs `values`"),
        ({"k": LN}, {"design": {"table": "s.csv"}}, "leave only `path`"),
        ({"mu": {"path": "joints.gap.friction", "distribution": "normal", "mean": 0.3, "cov": 0.5}}, {},
         "its normal distribution reaches that; give `low` and `high`"),
        ({"k": LN, "mu": MU}, {"correlation": {"pairs": [{"between": ["k", "E"], "value": 0.2}]}},
         "no parameter is 'E'"),
        ({"k": LN, "mu": MU}, {"correlation": {"pairs": [{"between": ["k", "mu"], "value": 1.0}]}},
         "must be less than 1"),
        ({"k": LN, "mu": MU}, {"correlation": {"pairs": [{"between": ["k", "mu"], "value": 0.99}]}},
         "no correlation of these values is outside"),
        ({"k": LN, "mu": {"path": "joints.gap.friction", "values": [0.2, 0.3]}},
         {"correlation": {"pairs": [{"between": ["k", "mu"], "value": 0.2}]}}, "'mu' has `values`"),
        ({"k": LN, "mu": MU, "gap": GAP}, {"correlation": {"of": "scores", "pairs": [
            {"between": ["k", "mu"], "value": 0.9}, {"between": ["k", "gap"], "value": 0.9}]}},
         "not positive definite (least eigenvalue -0.273)"),
        ({"k": LN, "mu": MU}, {"correlation": {"pairs": [{"between": ["k", "mu"], "value": 0.2},
                                                         {"between": ["mu", "k"], "value": 0.3}]}}, "twice"),
        ({"mu": {"path": "joints.gap.friction", "values": [0.2]}},
         {"design": "grid", "correlation": {"pairs": [{"between": ["k", "mu"], "value": 0.2}]}},
         "random samples"),
    ],
)  # fmt: skip
def test_wrong_distributions_are_refused(tmp_path, parameters, more, part):
    with pytest.raises(ConfigError) as told:
        samples(tmp_path, parameters, **{"design": {"latin_hypercube": 50}, **more})
    assert part in str(told.value) and "suite.yaml" in str(told.value)
