"""Sobol' indices: the estimators against closed forms and scipy's, and those of a suite of an oscillator."""

import math

import numpy as np
import pytest
import scipy.stats
import xarray as xr
from pytest import approx
from suite_jobs import BASE, made, write_job
from summaries import summary_of
from test_cli import call
from test_distributions import GAP, LN, MU, samples
from test_uncertain import ONE

import romdam
from romdam.core.errors import ConfigError
from romdam.postprocess.dependence import sensitivity
from romdam.postprocess.sobol import BASE_SAMPLES, sobol_estimates, sobol_indices, with_sobol_indices
from romdam.results.suite.sampling import sobol_matrices
from romdam.visual.report.parts import PageTable
from romdam.visual.report.statistics import sobol_section
from romdam.visual.report.subject import Subject, Topic


def ishigami(u):
    x = math.pi * (2.0 * u - 1.0)
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def suite_of(f, base, parameters, seed=1, records=(1.0,)):
    """A summary whose response is a function of the samples, times the factor of each record."""
    unit = sobol_matrices(base, parameters, seed)
    y = f(unit)
    factors = np.asarray(records)[:, None, None]
    sampled = {f"parameter_p{i}": u for i, u in enumerate(unit.T)}
    summary = summary_of(factors * y, np.ones((len(records), 1)), sampled)
    return summary.assign_attrs({BASE_SAMPLES: base})


def test_ishigami_has_its_closed_form():
    """V = a^2/8 + b pi^4/5 + b^2 pi^8/18 + 1/2 (Ishigami, Homma 1990), a = 7, b = 0.1."""
    a, b, p = 7.0, 0.1, math.pi
    V1, V2, V13 = 0.5 * (1 + b * p**4 / 5) ** 2, a**2 / 8, b**2 * p**8 * (1 / 18 - 1 / 50)
    V = V1 + V2 + V13
    want, off = np.array([[V1, V2, 0.0], [V1 + V13, V2, V13]]) / V, []
    for base in (1024, 16384):
        errors = []
        for seed in range(10):
            f = ishigami(sobol_matrices(base, 3, seed)).reshape(5, 1, base)
            errors.append(np.stack(sobol_estimates(f[0], f[1], f[2:], np.ones((1, base))))[:, 0] - want)
        off.append(np.sqrt(np.mean(np.square(errors), axis=0)).max())
    assert off[1] < 2e-3 and off[1] < off[0] / 8.0  # faster than the root of 16 of random samples
    found = sobol_indices(suite_of(ishigami, 1024, 3), "peak_opening").isel(scale=0)
    for k, order in enumerate(("first", "total")):
        low, high = found[f"{order}_bounds"].values.T
        assert (low <= want[k]).all() and (want[k] <= high).all()
    assert found.attrs["statement"] == "" and int(found["count"]) == 1024


def test_weighted_samples_are_samples_that_stand_there_as_often():
    """As a bootstrap draws them: the mean of the drawn ones, not that of all, is taken off their variance."""
    base = 64
    f = 3.0 + ishigami(sobol_matrices(base, 3, 5)).reshape(5, 1, base)
    drawn = np.random.default_rng(2).multinomial(base, np.arange(base) / np.arange(base).sum())
    first, total = sobol_estimates(f[0], f[1], f[2:], drawn[None].astype(float))
    a, b, *mixed = np.repeat(f[:, 0], drawn, axis=1)
    variance = np.mean([a**2, b**2]) - np.mean([a, b]) ** 2
    middle = np.mean(f[:2])
    assert total[0] == approx([np.mean((a - m) ** 2) / 2 / variance for m in mixed], rel=1e-12)
    assert first[0] == approx([np.mean((b - middle) * (m - a)) / variance for m in mixed], rel=1e-12)


def test_indices_are_those_of_scipy():
    base, k = 256, 3
    found = sobol_indices(suite_of(ishigami, base, k), "peak_opening").isel(scale=0)
    A, B, *AB = sobol_matrices(base, k, 1).reshape(k + 2, base, k)
    other = scipy.stats._sensitivity_analysis.saltelli_2010
    f_A, f_B, f_AB = ishigami(A), ishigami(B), np.array([[ishigami(m)] for m in AB])
    mean = np.mean([f_A, f_B])
    first, total = other(f_A[None] - mean, f_B[None] - mean, f_AB - mean)
    assert found["first"].values == approx(first.ravel(), rel=1e-10, abs=1e-12)
    assert found["total"].values == approx(total.ravel(), rel=1e-10)
    # and scipy's own samples and sequence say the same within the bounds
    flat = [scipy.stats.uniform(0, 1)] * k
    theirs = scipy.stats.sobol_indices(func=lambda x: ishigami(x.T), n=4096, dists=flat)
    low, high = found.total_bounds.values.T
    assert (low <= theirs.total_order).all() and (theirs.total_order <= high).all()


def test_a_linear_model_has_the_squares_of_its_coefficients():
    c = np.array([1.0, -2.0, 3.0, 0.0])
    found = sobol_indices(suite_of(lambda u: 5.0 + u @ c, 1024, 4), "peak_opening").isel(scale=0)
    want = c**2 / (c @ c)
    assert found["first"].values == approx(want, abs=2e-3)
    assert found["total"].values == approx(want, abs=2e-3)


def test_a_file_keeps_which_parameter_is_which(tmp_path):
    unit = sobol_matrices(256, 2, 1)
    sampled = {"parameter_z": unit[:, 0], "parameter_a": unit[:, 1]}
    summary = summary_of((3.0 * unit[:, 0] + unit[:, 1])[None, None], np.ones((1, 1)), sampled)
    with_sobol_indices(summary.assign_attrs({BASE_SAMPLES: 256})).to_netcdf(tmp_path / "s.nc")
    with xr.open_dataset(tmp_path / "s.nc") as read:
        for found in (
            read.sobol_first_peak_opening.isel(joint=0),
            sobol_indices(read, "peak_opening")["first"],
        ):
            assert list(found.parameter.values) == ["z", "a"]
            assert found.values[0] == approx([0.9, 0.1], abs=5e-3)


def test_bounds_hold_the_truth_and_shrink_as_the_root_of_the_base_samples():
    c, width, held = np.array([1.0, 2.0]), dict[int, float](), 0
    for base in (64, 1024):
        widths = []
        for seed in range(10):
            found = sobol_indices(suite_of(lambda u: u @ c, base, 2, seed), "peak_opening").isel(scale=0)
            low, high = found.first_bounds.values.T
            widths.append(high - low)
            held += int(((low <= [0.2, 0.8]) & (high >= [0.2, 0.8])).sum())
        width[base] = float(np.mean(widths))
    assert width[64] / width[1024] == approx(4.0, rel=0.15)
    assert held >= 38  # of 40


def test_records_count_by_their_variance():
    """One record follows the first parameter, another of half the size the second."""

    def f(u):
        return np.stack([u[:, 0], 0.5 * u[:, 1] + 9.0])

    unit = sobol_matrices(512, 2, 3)
    summary = summary_of(f(unit)[:, None], np.ones((2, 1)),
                         {f"parameter_p{i}": u for i, u in enumerate(unit.T)})  # fmt: skip
    found = sobol_indices(summary.assign_attrs({BASE_SAMPLES: 512}), "peak_opening").isel(scale=0)
    assert found["first"].values == approx([0.8, 0.2], abs=2e-3)
    assert found["total"].values == approx([0.8, 0.2], abs=2e-3)
    assert int(found["count"]) == 1024


def test_failed_runs_leave_out_their_base_samples_and_many_of_them_everything():
    base, k, c = 256, 2, np.array([1.0, 2.0])
    whole = suite_of(lambda u: u @ c, base, k)
    failed = whole.peak_opening.values.copy()
    failed[0, 0, [3, base + 7, 2 * base + 7, 3 * base + 100]] = np.nan
    some = whole.assign(peak_opening=(whole.peak_opening.dims, failed, whole.peak_opening.attrs))
    found = sobol_indices(some, "peak_opening").isel(scale=0)
    kept = np.setdiff1d(np.arange(base), [3, 7, 100])
    rows = whole.isel(sample=(kept + base * np.arange(k + 2)[:, None]).ravel())
    want = sobol_indices(rows.assign_attrs({BASE_SAMPLES: len(kept)}), "peak_opening").isel(scale=0)
    np.testing.assert_allclose(found["first"].values, want["first"].values, rtol=1e-12)
    np.testing.assert_allclose(found["total"].values, want["total"].values, rtol=1e-12)
    assert int(found["count"]) == base - 3 and found.attrs["statement"].startswith("up to 1.2 % of the base")
    failed[0, 0, :26] = np.nan  # 27 of 256 are more than a tenth
    many = whole.assign(peak_opening=(whole.peak_opening.dims, failed, whole.peak_opening.attrs))
    found = sobol_indices(many, "peak_opening")
    assert found["first"].isnull().all() and "no indices where it is more than 10 %" in found.statement
    added = with_sobol_indices(many)
    assert added.sobol_total_peak_opening.dims == ("scale", "joint", "parameter")
    assert added.sobol_count_peak_opening.values == base - 27
    # what does not vary has no shares, and a record that never ran does not count
    gone = suite_of(lambda u: u @ c, base, k, records=(1.0, np.nan))
    assert sobol_indices(gone, "peak_opening")["first"].values[0] == approx([0.2, 0.8], abs=5e-3)
    flat = sobol_indices(suite_of(lambda u: np.full(len(u), 0.3), base, k), "peak_opening")
    assert flat["first"].isnull().all() and flat.attrs["statement"] == ""


@pytest.mark.slow
def test_a_suite_has_the_shares_of_a_closed_form_oscillator(tmp_path):
    """Under a constant acceleration the peak displacement goes with rho / E, of lognormal rho and E.

    With s the standard deviations of the logarithms, the product has V + 1 = exp(s_E^2 + s_rho^2); one of
    them makes (exp(s_i^2) - 1) / V alone, and 1 - (exp(s_j^2) - 1) / V with the other.
    """
    s = {"E": 0.5, "rho": 0.3}
    medians = {"E": "30 GPa", "rho": 2440}
    parameters = {
        name: {"path": f"materials.concrete.{name}", "distribution": "lognormal", "median": medians[name],
               "beta": beta}
        for name, beta in s.items()
    }  # fmt: skip
    suite = {"parameters": parameters, "design": {"sobol_indices": 64}}
    config = write_job(tmp_path, records=1, suite=suite, **ONE)
    np.savetxt(tmp_path / "records" / "r0.txt", np.full(40, 2.0))
    assert romdam.check(config).records
    made(config, tmp_path / "out")
    summary = romdam.open_suite(tmp_path / "out").to_dataset()
    assert summary.sizes["sample"] == 64 * 4
    ratio = summary.parameter_rho.values / summary.parameter_E.values
    exact = summary.peak_displacement.copy(data=np.broadcast_to(ratio[:, None, None],
                                                                summary.peak_displacement.shape))  # fmt: skip
    exact = with_sobol_indices(summary.assign(peak_displacement=exact))
    y = list(summary.component.values).index("y")
    alone = {name: math.expm1(beta**2) for name, beta in s.items()}
    V = math.expm1(sum(beta**2 for beta in s.values()))
    want = {"first": [alone["E"] / V, alone["rho"] / V],
            "total": [1 - alone["rho"] / V, 1 - alone["E"] / V]}  # fmt: skip
    for order, shares in want.items():
        found = summary[f"sobol_{order}_peak_displacement"].sel(node="top").isel(component=y)
        assert list(found.parameter.values) == ["E", "rho"]
        same = exact[f"sobol_{order}_peak_displacement"].sel(node="top").isel(component=y)
        assert found.values == approx(same.values, abs=1e-4)  # estimates of the closed form at its samples
        low, high = summary[f"sobol_{order}_peak_displacement_bounds"].sel(node="top").values[0, y].T
        assert (low <= shares).all() and (shares <= high).all()
    unit = sobol_matrices(16384, 2, 1)  # and these come to the closed form
    f = np.exp(scipy.stats.norm.ppf(unit) @ [-s["E"], s["rho"]]).reshape(4, 1, -1)
    for order, found in zip(want, sobol_estimates(f[0], f[1], f[2:], np.ones((1, 16384))), strict=True):
        assert found[0] == approx(want[order], abs=5e-3)


@pytest.mark.usefixtures("unrendered")
def test_the_terminal_and_the_report_show_them(tmp_path):
    parameters = {"mu": {"path": "joints.gap.friction", "low": 0.2, "high": 0.6},
                  "gap": {"path": "joints.gap.gap", "values": ["0 mm", "1 mm"]}}  # fmt: skip
    suite = {"parameters": parameters, "design": {"sobol_indices": 16, "seed": 2}}
    outputs = {**BASE["outputs"], "plots": False, "mesh_error": False}
    config = write_job(tmp_path, records=1, suite=suite, outputs=outputs)
    said = call("run", config, "--out", tmp_path / "out", "--workers", 1)[1]
    assert "Shares of the variance of peak opening" in said and "first order" in said
    assert "bounds are up to" in said and "four times as many base samples" in said
    with xr.open_dataset(tmp_path / "out" / "summary.nc", engine="h5netcdf") as summary:
        assert summary.attrs[BASE_SAMPLES] == 16 and "16 base samples, seed 2" in summary.attrs["design"]
        section = sobol_section(Subject(summary, Topic()))
        assert section is not None and "Sobol" in section.title
        (table,) = [part for part in section.parts if isinstance(part, PageTable)]
        assert [row[1] for row in table.rows] == ["gap", "mu"]  # as the file has them
        assert set(np.unique(summary.parameter_gap.values)) == {0.0, 1e-3}
        assert sensitivity(summary).attrs["samples"] == 32  # A and B
    assert "sobol" not in (tmp_path / "out" / "summary.csv").read_text().split("\n")[0]


@pytest.mark.parametrize(
    ("parameters", "more", "part"),
    [
        ({"k": LN, "mu": MU}, {"design": {"sobol_indices": 100}}, "got 100; take 64 or 128"),
        ({"k": LN, "mu": MU}, {"design": {"sobol_indices": 8}}, "at least 16"),
        ({"k": LN, "mu": MU}, {"correlation": {"pairs": [{"between": ["k", "mu"], "value": 0.2}]}},
         "are of independent parameters"),
        ({"k": LN, "mu": {"path": MU["path"]}}, {}, "a design for Sobol' indices needs `low` and `high`"),
        ({}, {}, "a design for Sobol' indices needs `parameters`"),
        ({"k": LN, "mu": MU, "gap": GAP}, {"design": {"sobol_indices": 2**17}, "scales": [1.0, 2.0]},
         "655360 samples are 1.31e+06 runs of every record, limit 1000000"),
    ],
)  # fmt: skip
def test_unsound_designs_are_refused_by_check(tmp_path, parameters, more, part):
    with pytest.raises(ConfigError) as told:
        samples(tmp_path, parameters, **{"design": {"sobol_indices": 64}, **more})
    assert part in str(told.value) and "suite.yaml" in str(told.value)


@pytest.mark.slow
def test_salib_has_the_indices_of_a_suite_from_its_samples(tmp_path):
    """Total indices to round-off. SALib centres the responses by the mean of all runs before the first-order
    estimator, romdam by that of A and B: a shift d changes it by d mean(f_ABi - f_A) / V."""
    sobol = pytest.importorskip("SALib.analyze.sobol", reason="SALib is not installed")
    E = {"path": "materials.concrete.E", "low": "20 GPa", "high": "40 GPa"}
    rho = {"path": "materials.concrete.rho", "low": 2000, "high": 3000}
    base, parameters = 32, {"gap": {**GAP, "low": 0}, "E": E, "rho": rho}
    config = write_job(tmp_path, 1, {"design": {"sobol_indices": base}, "parameters": parameters})
    summary = made(config, tmp_path / "out").summary
    values = {name: summary[f"parameter_{name}"].values for name in parameters}
    y = romdam.prepare(config).run(values).peak_opening.values.reshape(-1, base)  # A, B, AB_1, AB_2, AB_3
    rows = y[[0, 2, 3, 4, 1]].T.ravel()  # SALib has A, AB_1, AB_2, AB_3, B of each base sample
    problem = {"num_vars": 3, "names": [*parameters], "bounds": [[0.0, 1.0]] * 3}
    found = sobol.analyze(problem, rows, calc_second_order=False, seed=1)
    assert found["ST"] == approx(summary.sobol_total_peak_opening.values.ravel(), abs=1e-12)
    shift = y.mean() - y[:2].mean()
    first = found["S1"] + shift * (y[2:] - y[0]).mean(axis=1) / y[:2].var()
    assert first == approx(summary.sobol_first_peak_opening.values.ravel(), abs=1e-12)
    assert found["ST"].min() > 0.01 and abs(shift) > 1e-8
