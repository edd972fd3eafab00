"""`romdam certify` and `romdam study` as a person meets them."""

import json
import shutil

import numpy as np
import pytest
import xarray as xr
import yaml
from cf_files import flaws
from test_cli import SMALL, call

import romdam
from romdam.config import load_config
from romdam.core.errors import ConvergenceError
from romdam.error.metrics import relative_l2
from romdam.error.study import pareto_front, study_table
from romdam.timestepping.integrators.generalized_alpha import GeneralizedAlpha


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small job and its result."""
    made = tmp_path_factory.mktemp("certify")
    time = np.arange(100) * 0.01
    pulse = 6.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-2 * time)
    np.savetxt(made / "pulse.txt", pulse)
    (made / "small.yaml").write_text(SMALL)
    code, _, err = call("run", made / "small.yaml", "--out", made / "out", "--quiet")
    assert code == 0, err
    return made


@pytest.fixture
def result(folder, tmp_path):
    """A copy of the result beside a copy of its configuration, to be spoilt."""
    shutil.copytree(folder, tmp_path / "job")
    return tmp_path / "job" / "out" / "pulse.nc"


def spoilt(result, edit):
    with xr.load_dataset(result, engine="h5netcdf") as dataset:
        edit(dataset).to_netcdf(result, engine="h5netcdf")
    return result


def test_every_run_states_an_estimate(folder):
    with xr.open_dataset(folder / "out" / "pulse.nc", engine="h5netcdf") as dataset:
        assert dataset.attrs["error_estimate"].startswith("Leaving out modes changes the openings by about")
        assert 0.0 < dataset.attrs["error_estimate_opening_l2"] < 0.5
        assert dataset.estimated_error_l2.values == [dataset.attrs["error_estimate_opening_l2"]]  # one joint
        assert dataset.estimated_error_peak.dims == ("joint",)


def test_a_run_states_what_its_steps_are_worth(folder, tmp_path):
    """Within a factor of two of what a sixteenth of the step changes; by `accuracy` where that is given."""
    raw, opening, stated = yaml.safe_load(SMALL), [], []
    raw["records"][0]["file"] = str(folder / "pulse.txt")
    raw["outputs"] = raw.get("outputs", {}) | {"mesh_error": False, "output_interval": 0.01}
    for transient in ({"finest_step": 2e-3}, {"finest_step": 1.25e-4}, {"accuracy": 0.01}):
        raw["transient"] = transient
        lone = romdam.run(raw, tmp_path / "out").results[0].dataset
        opening.append(lone.opening.values)
        stated.append(lone.attrs["solver_estimated_time_error"])
        assert ("solver_accuracy" in lone.attrs) == ("accuracy" in transient)
    true = np.linalg.norm(opening[0] - opening[1]) / np.linalg.norm(opening[1])
    assert 0.5 * true < stated[0] < 2.0 * true and true > 1e-4
    assert stated[1] < 0.3 * stated[0]


def test_estimate_can_be_left_out_and_is_absent_where_it_means_nothing(folder, tmp_path):
    for sections in ({"outputs": {"error_estimate": False}}, {"damping": {}}, {"model": {"modes": "all"}}):
        raw = yaml.safe_load(SMALL) | sections
        raw["records"][0]["file"] = str(folder / "pulse.txt")
        raw["transient"] = {"finest_step": 1e-4, "duration": 0.05}
        raw["outputs"] = {"plots": False, "mesh_error": False} | sections.get("outputs", {})
        (tmp_path / "job.yaml").write_text(yaml.safe_dump(raw))
        code, _, err = call("run", tmp_path / "job.yaml", "--out", tmp_path / "out")
        assert code == 0, err
        with xr.open_dataset(tmp_path / "out" / "pulse.nc", engine="h5netcdf") as dataset:
            stated = dataset.attrs.get("error_estimate", "nothing")
            assert ("unknown: without damping" in stated) if "damping" in sections else stated == "nothing"


def test_certificate_is_printed_written_and_kept_in_the_result(result):
    code, out, err = call("certify", result)
    assert code == 0, err
    assert "Certificate, 0.99 s of pulse" in out.replace("\n", " ")
    stated = json.loads(result.with_suffix(".certificate.json").read_text())
    assert set(stated["error"]) == {"opening", "displacement", "energy"}
    assert 0.0 < stated["defect_for_the_same_forces"]["opening"]["l2"] < 0.1
    with xr.open_dataset(result, engine="h5netcdf") as dataset:
        assert json.loads(dataset.attrs["certificate"]) == stated
    assert "Certificate" in call("info", result)[1]


def test_certificate_and_estimate_are_within_a_factor_two_of_the_truth(result):
    raw = yaml.safe_load(SMALL)
    raw["model"]["modes"] = "all"
    (result.parents[1] / "all.yaml").write_text(yaml.safe_dump(raw))
    code, _, err = call("run", result.parents[1] / "all.yaml", "--out", result.parents[1] / "all")
    assert code == 0, err
    with xr.open_dataset(result.parents[1] / "all" / "pulse.nc", engine="h5netcdf") as dataset:
        truth = dataset.opening.values
    with xr.open_dataset(result, engine="h5netcdf") as dataset:
        true = relative_l2(dataset.opening.values, truth)
        estimate = dataset.attrs["error_estimate_opening_l2"]
    call("certify", result)
    stated = json.loads(result.with_suffix(".certificate.json").read_text())["error"]["opening"]["l2"]
    assert 0.5 < stated / true < 2.0
    assert 0.5 < estimate / true < 2.0


def test_two_passes_say_what_the_last_one_changed(result):
    code, _, err = call("certify", result, "--passes", 2, "--config", result.parents[1] / "small.yaml")
    assert code == 0, err
    stated = json.loads(result.with_suffix(".certificate.json").read_text())
    assert stated["last_pass_changed"] < 0.3 * stated["error"]["opening"]["l2"]


def test_what_cannot_be_certified_is_refused(result, tmp_path):
    other = result.parents[1] / "other.yaml"
    other.write_text(SMALL.replace("modes: 10", "modes: 11"))
    code, _, err = call("certify", result, "--config", other)
    assert code == 2 and "is not the configuration that" in err
    full = result.parents[1] / "full.yaml"
    full.write_text(SMALL.replace("{order: reduced, modes: 10}", "{order: full}"))
    call("run", full, "--out", tmp_path / "full", "--quiet")
    code, _, err = call("certify", tmp_path / "full" / "pulse.nc")
    assert code == 2 and "is a full-order result" in err
    record = result.parents[1] / "pulse.txt"
    np.savetxt(record, 2.0 * np.loadtxt(record))
    code, _, err = call("certify", result)
    assert code == 2 and "was made with another record 'pulse'" in err
    np.savetxt(record, 0.5 * np.loadtxt(record))
    code, _, err = call("certify", spoilt(result, lambda d: d.assign_attrs(solver_base_step=-0.01)))
    assert code == 2 and "solver_base_step must be above 0, got -0.01" in err
    code, _, err = call(
        "certify",
        spoilt(
            result,
            lambda d: d.drop_attrs(deep=False).assign_attrs(
                {name: value for name, value in d.attrs.items() if name != "solver_base_step"}
            ),
        ),
    )
    assert code == 2 and "solver_base_step must be a step in seconds, got none" in err
    code, _, err = call("certify", spoilt(result, lambda d: d.drop_vars("mean_normal_force")))
    assert code == 2 and "holds no joint forces (mean_normal_force)" in err


def test_a_run_whose_integrator_takes_no_jumps_is_not_certified(folder, tmp_path, monkeypatch):
    """A certificate would lack its defect. Generalised-alpha takes them, where it is named too."""
    raw = yaml.safe_load(SMALL)
    raw["records"][0]["file"] = str(folder / "pulse.txt")
    raw["transient"] = {"integrator": "generalized_alpha", "finest_step": 5e-4, "duration": 0.05}
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(raw))
    code, _, err = call("run", tmp_path / "job.yaml", "--out", tmp_path / "out", "--quiet")
    assert code == 0, err
    with monkeypatch.context() as patch:
        patch.setattr(GeneralizedAlpha, "shifts", False)
        code, _, err = call("certify", tmp_path / "out" / "pulse.nc")
    assert code == 2 and "generalized_alpha cannot take them" in err and "romdam verify" in err
    assert not list((tmp_path / "out").glob("*.certificate.json"))
    code, _, err = call("certify", tmp_path / "out" / "pulse.nc")
    assert code == 0, err
    (stated,) = (tmp_path / "out").glob("*.certificate.json")
    assert 0.0 < json.loads(stated.read_text())["error"]["opening"]["l2"] < 0.1


STUDY = {
    "modes": [4, 10],
    "residual_vectors": [0, 5],
    "integrators": ["modal", "adaptive"],
    "finest_steps": ["2.5 ms", "1.25 ms"],
    "repeats": 1,
}


def test_study_writes_its_dataset_table_and_picture(folder, tmp_path):
    config = folder / "study.yaml"
    config.write_text(yaml.safe_dump(yaml.safe_load(SMALL) | {"study": STUDY}))
    code, out, err = call("study", config, "--out", tmp_path)
    assert code == 0, err
    assert list(flaws(tmp_path / "study.nc")) == []
    with xr.open_dataset(tmp_path / "study.nc", engine="h5netcdf") as dataset:
        assert dataset.sizes["case"] == 17 and dataset.of_job.values.tolist() == [0] * 16 + [1]
        assert dataset.attrs["machine"] and "all " in dataset.attrs["compared"]
        error = dataset.l2_error.values
        assert np.isfinite(error).all() and dataset.on_front.values.any()
        best = (dataset.modes == "10 modes") & (dataset.residual_vectors == 5) & (dataset.finest_step < 0.002)
        assert error[best.values].max() < 0.6 * error.max()  # static vectors leave less to further modes
        for name in dataset.variables:
            assert name == "case" or dataset[name].attrs["long_name"]
    assert out.count("| adaptive |") == 9  # and the job's own setting
    assert (tmp_path / "study.md").read_text().count("\n| ") == 2 + 17 + 2 + 5
    assert (tmp_path / "study.png").stat().st_size > 10_000


def test_study_against_full_order_and_a_failing_case(folder, tmp_path, monkeypatch):
    from romdam.pipelines.error import study as pipeline

    real = pipeline.simulate_one

    def fails(prepared, ground, settings, progress=None):
        if prepared.integrator.name == "adaptive":
            raise ConvergenceError("step 3: did not converge")
        return real(prepared, ground, settings, progress)

    monkeypatch.setattr(pipeline, "simulate_one", fails)
    config = folder / "full.yaml"
    study = STUDY | {"modes": [10], "residual_vectors": [0], "finest_steps": ["2.5 ms"], "reference": "full"}
    config.write_text(yaml.safe_dump(yaml.safe_load(SMALL) | {"study": study}))
    found = pipeline.study(load_config(config), tmp_path)
    assert "full order" in found.dataset.attrs["compared"]
    assert np.isnan(found.dataset.l2_error.values[1]) and not found.dataset.on_front.values[1]
    assert "step 3: did not converge" in study_table(found.dataset)


def test_study_refuses_full_order(folder, tmp_path):
    (folder / "bad.yaml").write_text(SMALL.replace("{order: reduced, modes: 10}", "{order: full}"))
    code, _, err = call("study", folder / "bad.yaml", "--out", tmp_path)
    assert code == 2 and "a study is about reduced models" in err


def test_front_holds_what_nothing_beats():
    cost = np.array([1.0, 2.0, 3.0, 2.0, np.nan, 1.0])
    error = np.array([5.0, 3.0, 3.0, 4.0, 0.1, 5.0])
    assert pareto_front(cost, error).tolist() == [True, True, False, False, False, True]
