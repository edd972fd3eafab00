"""What a suite varies and asks for: samples, targets, names, and what of it is refused."""

import numpy as np
import pytest
import xarray as xr
import yaml
from scipy.stats import qmc
from suite_jobs import BASE, MU, edited, made, named_records, pulse, summary, write_job
from test_cli import call

import romdam
from romdam.core.errors import ConfigError
from romdam.pipelines.error.certify import certify
from romdam.pipelines.run import run as run_job
from romdam.pipelines.suites import run as pipeline
from romdam.pipelines.suites.run import SuiteOptions, run_suite
from romdam.postprocess.responses import PARAMETER, parameters
from romdam.results.suite.sampling import latin_hypercube

SHADOWS = (("gap", "joint"), ("component", "scale"), ("record", "sample"), ("node", "peak_opening"),
           ("status", "run_key"), ("parameter_gap", "record_pga"), ("time", "file"))  # fmt: skip


@pytest.mark.parametrize(
    "names",
    [pytest.param(pair, marks=[pytest.mark.slow] * (not {"gap", "run_key"} & {*pair})) for pair in SHADOWS],
    ids=", ".join,
)
def test_no_parameter_shadows_a_name_of_the_summary(tmp_path, names):
    paths = ("joints.gap.friction", "damping.rayleigh.ratio")
    config = write_job(tmp_path, records=1)
    varied = {n: {"path": p, "values": [0.01, 0.6]} for n, p in zip(names, paths, strict=True)}
    edited(config, parameters=varied, keep="full" if "run_key" in names else "peaks")
    found = made(config, tmp_path / "out").summary
    assert set(parameters(found)) == set(names)
    assert all(sorted(found[PARAMETER + n].values.tolist()) == [0.01, 0.01, 0.6, 0.6] for n in names)
    for name, variable in found.variables.items():
        for dim in set(variable.dims) & set(found.coords):
            taken = found[name].sel({dim: found[dim].values[-1]})
            assert taken.dims == tuple(d for d in variable.dims if d != dim)
    assert found.peak_opening.dims == ("record", "scale", "sample", "joint")
    assert found.gap_peak_opening.dims == ("record", "scale", "sample", "gap")


def test_summaries_of_before_open_with_their_parameters():
    old = xr.Dataset(coords={"sample": [0, 1], "mu": ("sample", [0.1, 0.2]), "record": ["a"]})
    assert {name: v.values.tolist() for name, v in parameters(old).items()} == {"mu": [0.1, 0.2]}


def test_records_that_cannot_be_written_are_told_before_the_first_run(tmp_path):
    config = write_job(tmp_path, records=1)
    np.savetxt(tmp_path / "records" / "r1.txt", pulse(0)[:5])
    named_records(config, short=1, whole=0)
    edited(config, keep={"every": "0.1 s"})
    assert "nothing but the start would be written" in made(config, tmp_path / "b").failures["short"]


@pytest.mark.parametrize(
    ("suite", "sections", "part"),
    [
        ({"scales": [0]}, {}, "scales"),
        ({"scales": [-1.0]}, {}, "scales"),
        ({"scales": [float("nan")]}, {}, "scales"),
        ({"scales": [float("inf")]}, {}, "scales"),
        ({"scales": [True]}, {}, "scales"),
        ({"scales": [1, 1.0]}, {}, "given twice"),
        ({"parameters": MU, "design": {"latin_hypercube": 0}}, {}, "latin_hypercube"),
        ({"parameters": MU, "design": {"latin_hypercube": 10**9}}, {}, "1000000"),
        ({"parameters": {n: {"path": p, "low": 0.1, "high": 0.2, "count": 9999} for n, p in
          (("a", "joints.gap.friction"), ("b", "joints.gap.gap"))}}, {}, "1 scales of 9.998e+07 samples"),
        ({"parameters": {"a": {"path": "joints.gap.friction", "low": 0.1, "high": 0.2, "count": 999_999}},
          "scales": [1, 2]}, {}, "2 scales of 999999 samples are 2e+06 runs"),
        ({"keep": {"output_interval": "7 ms"}}, {}, "whole multiple of transient.finest_step"),
        ({"parameters": {"m": {"path": "joints.gap.frictoin", "values": [0.1]}}}, {}, "frictoin"),
        ({"parameters": {"m": {"path": "joints..friction", "values": [0.1]}}}, {}, "no joint is ''"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_found_before_the_first_run(tmp_path, monkeypatch, suite, sections, part):
    monkeypatch.setattr(pipeline, "_make_missing", None)
    config = write_job(tmp_path, records=2, suite=suite, **sections)
    with pytest.raises(ConfigError) as told:
        made(config, tmp_path / "out")
    assert part in str(told.value) and "suite.yaml" in str(told.value)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("mu\nnan\n", "line 2"),
        ("mu\ninf\n", "line 2"),
        ("mu\n0.3\n\nthree\n", "line 4"),
        ("mu,mu\n0.3,0.4\n", "2 columns are 'mu'"),
        ("mu,other\n0.3,0.4\n", "'mu, other'"),
        ("mu\n0,3\n", "has 2 values for 1 columns"),
        ("mu\n\n", "holds no samples"),
        ("", "holds no samples"),
        ("mu\n0.3,,4\n", "has 3 values"),
        ('mu\n"0.3\n', "cannot be read"),
        ("mu\n3\n", "friction"),
        ("mu\n0x1\n", "line 2"),
    ],
)
def test_bad_tables_are_refused_with_their_line(tmp_path, text, part):
    suite = {"parameters": {"mu": {"path": "joints.gap.friction"}}, "design": {"table": "s.csv"}}
    config = write_job(tmp_path, records=1, suite=suite)
    (tmp_path / "s.csv").write_text(text)
    with pytest.raises(ConfigError) as told:
        made(config, tmp_path / "out")
    assert part in str(told.value) and "s.csv" in str(told.value)


def test_a_table_of_a_spreadsheet_is_read(tmp_path):
    parameters = {n: {"path": f"joints.gap.{n}"} for n in ("friction", "gap")}
    config = write_job(tmp_path, records=1, suite={"parameters": parameters, "design": {"table": "s.csv"}})
    (tmp_path / "s.csv").write_bytes(b'\xef\xbb\xbfgap, friction\r\n"5 mm", 30 %\r\n\r\n0.002,0.5\r\n')
    found = made(config, tmp_path / "out").summary
    assert found.parameter_gap.values.tolist() == [0.005, 0.002]
    assert found.parameter_friction.values.tolist() == [0.3, 0.5]


@pytest.mark.parametrize(
    ("suite", "part"),
    [
        ({"parameters": {"E": {"path": "materials.concrete.nu", "values": [0.2]}}}, "reduced basis"),
        ({"parameters": {"m": {"path": "joints.none.friction", "values": [0.1]}}}, "no joint is 'none'"),
        ({"parameters": {"m": {"path": "joints.gap.friction", "values": [3]}}}, "joints.gap.friction"),
        ({"parameters": {"m": {"path": "joints.gap.friction"}}}, "needs `values`"),
        ({"parameters": {"m": {"path": "joints.gap.friction", "low": 0.1}}}, "belong together"),
        ({"design": {"latin_hypercube": 5}}, "Latin hypercube needs"),
        ({"design": {"table": "none.csv"}, "parameters": {"m": {"path": "joints.gap.gap"}}}, "none.csv"),
        ({"scales": [1, 1]}, "given twice"),
        ({"keep": "everything"}, "suite.keep"),
        ({"outputz": 1}, "outputz"),
    ],
)
def test_bad_suites_are_refused_in_one_message(tmp_path, suite, part):
    code, _, stderr = call("run", write_job(tmp_path, suite=suite), "--out", tmp_path / "o", "--workers", 1)
    assert code == 2 and part in stderr and ("suite.yaml" in stderr or "none.csv" in stderr), stderr
    assert not (tmp_path / "o" / "summary.nc").exists()


def test_full_order_suite_is_refused(tmp_path):
    job = write_job(tmp_path, model={"order": "full"})
    with pytest.raises(ConfigError, match="needs a reduced model"):
        made(job, tmp_path / "out")


def test_names_of_records_stay_in_the_folder(tmp_path):
    job = write_job(tmp_path, records=1, suite={"keep": "full"})
    odd = tmp_path / "records" / "a b;c.txt"
    np.savetxt(odd, pulse(1))
    (tmp_path / "list.csv").write_text("file,name\nrecords/r0.txt,../../escape\n")
    raw = yaml.safe_load(job.read_text())
    raw["records"].append({"manifest": "list.csv", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}})
    job.write_text(yaml.safe_dump(raw))
    outcome = made(job, tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["list.csv", "out", "records", "suite.yaml"]
    assert len(list((tmp_path / "out" / "runs").glob("a_b_c__0__0-*.nc"))) == 1
    assert any("../../escape" in message or "name" in message for message in outcome.failures.values())


@pytest.mark.parametrize(("samples", "parameters", "seed"), [(1, 1, 0), (200, 3, 1)])
def test_latin_hypercube_is_that_of_scipy(samples, parameters, seed):
    theirs = qmc.LatinHypercube(d=parameters, seed=np.random.default_rng(seed)).random(samples)
    np.testing.assert_array_equal(latin_hypercube(samples, parameters, seed), theirs)


def test_latin_hypercube_and_table_are_the_samples(tmp_path):
    parameters = {
        "mu": {"path": "joints.gap.friction", "low": 0.2, "high": 0.8},
        "K": {"path": "joints.gap.normal_stiffness", "low": "1 GPa/m", "high": "100 GPa/m",
              "distribution": "loguniform"},
    }  # fmt: skip
    suite = {"parameters": parameters, "design": {"latin_hypercube": 8, "seed": 3}}
    found = made(write_job(tmp_path / "a", records=1, suite=suite), tmp_path / "a" / "out").summary
    mu, K = found.parameter_mu.values, found.parameter_K.values
    assert np.sort(np.floor(8 * (mu - 0.2) / 0.6).astype(int)).tolist() == list(range(8))
    assert np.sort(np.floor(8 * np.log10(K / 1e9) / 2).astype(int)).tolist() == list(range(8))
    table = {"parameters": {n: {"path": p["path"]} for n, p in parameters.items()}}
    job = write_job(tmp_path / "b", records=1, suite=table | {"design": {"table": "s.csv"}})
    lines = ["mu,K", *(f"{float(m)!r},{float(k)!r}" for m, k in zip(mu, K, strict=True))]
    (tmp_path / "b" / "s.csv").write_text("\n".join(lines))
    same = made(job, tmp_path / "b" / "out").summary
    np.testing.assert_array_equal(same.peak_opening, found.peak_opening)


def test_gap_table_that_changes_under_a_suite_is_told(tmp_path):
    """A run would land under the key of the other table."""
    joint = BASE["joints"]["gap"] | {"gap": {"table": "gaps.csv"}}
    parameters = {"mu": {"path": "joints.gap.friction", "values": [0.0, 0.6]}}
    job = write_job(tmp_path, suite={"parameters": parameters}, joints={"gap": joint})
    table = tmp_path / "gaps.csv"
    table.write_text("x,y,z,gap\n0,0,0,0.001\n5,0,0,0.001\n0,0,20,0.001\n")

    def told(line):
        table.write_text(table.read_text().replace("0.001", "0.002"))

    with pytest.raises(ConfigError, match="gap tables have changed since the suite was started"):
        run_suite(romdam.load_config(job), tmp_path / "out", SuiteOptions(workers=1), tell=told)
    assert not list((tmp_path / "out" / "rows").glob("*.nc"))


@pytest.mark.slow
def test_samples_are_those_of_their_plan_whatever_numpy_is_set_to_print_here(tmp_path):
    """Workers are other processes: what is set in the caller's, as by an import, is not set in theirs."""
    config = write_job(tmp_path, records=1, suite={"parameters": MU})
    with np.printoptions(legacy="1.13"):
        first = made(config, tmp_path / "out")
    assert first.made == 2 and not first.failures
    assert made(config, tmp_path / "out").made == 0


def test_target_intensities_are_reached(tmp_path):
    target = {"measure": "sa", "period": "0.2 s", "values": ["0.1 g", "0.3 g"]}
    job = write_job(tmp_path, suite={"intensities": target, "period": 0.2})
    found = made(job, tmp_path / "out").summary
    np.testing.assert_allclose(found.record_sa, np.tile([0.980665, 2.941995], (3, 1)), rtol=1e-9)
    np.testing.assert_allclose(found.scale, [0.980665, 2.941995])


@pytest.mark.slow
def test_a_kept_run_is_certified_with_its_sample_and_scale(tmp_path):
    """A run that a suite has kept, and the same job as a lone run: one certificate."""
    config = write_job(tmp_path, records=1, suite={"keep": "full", "scales": [0.5, 2.0], "parameters": MU})
    made(config, tmp_path / "out")
    kept = tmp_path / "out" / "runs" / str(summary(tmp_path / "out").file.values[0, 1, 1])
    raw = yaml.safe_load(config.read_text()) | {"pipeline": "run"}
    del raw["suite"]
    raw["joints"]["gap"]["friction"] = 0.6
    raw["records"][0]["scale"] = {"factor": 2.0}
    (tmp_path / "lone.yaml").write_text(yaml.safe_dump(raw))
    (lone,) = run_job(romdam.load_config(tmp_path / "lone.yaml"), tmp_path / "lone").paths
    stated, expected = (certify(path).statement.errors["opening"] for path in (kept, lone))
    assert stated.l2 == pytest.approx(expected.l2, rel=1e-9)
    assert stated.peak == pytest.approx(expected.peak, rel=1e-9)
