"""A suite as a person meets it: what it makes, what it keeps, how it goes on, what it says of failures."""

import errno
import io
import json
import logging
import re
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from cf_files import CHECKER, errors_of_the_checker, flaws
from suite_jobs import BASE, MU, command, differing, made, pulse, summary, write_job
from test_cli import call

import romdam
from romdam.core.errors import ResultError
from romdam.pipelines.suites import run as pipeline
from romdam.pipelines.suites.run import SuiteOptions, run_suite
from romdam.reduction.methods.craig_bampton import CraigBampton
from romdam.results.suite.journal import JOURNAL, read_rows
from romdam.terminal.lines import suite_warning_lines

SAMPLES = {
    "scales": [0.5, 1.0],
    "parameters": {
        "mu": {"path": "joints.gap.friction", "values": [0.0, 0.6]},
        "ratio": {"path": "damping.rayleigh.ratio", "values": ["3 %", "5 %"]},
    },
}
HERE = SuiteOptions(workers=1)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A suite of 3 records x 2 scales x 4 samples, two runs to a task, and its configuration."""
    folder = tmp_path_factory.mktemp("suite")
    config = write_job(folder, suite=SAMPLES | {"batch": 2})
    return config, made(config, folder / "out")


def test_summary_is_what_single_runs_give(whole, tmp_path):
    config, outcome = whole
    found = outcome.summary
    assert dict(found.sizes) == {
        "record": 3, "scale": 2, "sample": 4, "joint": 1, "gap": 8, "node": 1, "component": 3,
    }  # fmt: skip
    assert not found.status.any() and outcome.failures == {} and outcome.made == outcome.runs == 24
    for name, sample in (("r1", 0), ("r2", 3)):
        raw = yaml.safe_load(config.read_text()) | {"pipeline": "run"}
        raw["joints"]["gap"]["friction"] = float(found.parameter_mu[sample])
        raw["damping"]["rayleigh"]["ratio"] = float(found.parameter_ratio[sample])
        raw["records"] = [
            {**BASE["records"][0], "files": f"{config.parent}/records/{name}.txt", "scale": 0.5}
        ]
        raw["outputs"] = raw["outputs"] | {"plots": False}
        # the basis of all samples is that for friction; without friction a smaller one would do
        raw["model"] = {"modes": 8}
        (tmp_path / "one.yaml").write_text(yaml.safe_dump(raw))
        single = romdam.run(romdam.load_config(tmp_path / "one.yaml"), tmp_path / f"{name}{sample}")
        row = found.isel(scale=0, sample=sample).sel(record=name)
        with xr.open_dataset(single.paths[0], engine="h5netcdf") as result:
            close = 1e-9 if sample == 3 else 0.02  # the same basis, or one with fewer retained DOFs
            assert float(row.peak_opening[0]) == pytest.approx(float(result.peak_opening[0]), rel=close)
            assert float(row.energy_input) == pytest.approx(float(result.energy_input[-1]), rel=close)
            if sample == 3:
                peak = result.peak_displacement.values
                np.testing.assert_allclose(row.peak_displacement.values, peak, rtol=1e-9)
                assert (peak >= np.abs(result.displacement.values).max(axis=0)).all()


def test_files_keep_to_cf(whole, tmp_path):
    files = sorted((whole[0].parent / "out").glob("*.nc"))
    assert {"summary.nc", "design.nc"} <= {path.name for path in files}
    for path in files:
        assert list(flaws(path)) == [], path
        if CHECKER is not None:
            assert errors_of_the_checker(path, tmp_path / "report.json") == [], path


@pytest.mark.parametrize("friction", [pytest.param(0.0, marks=pytest.mark.slow), 0.6])
def test_a_run_of_a_suite_has_the_bits_of_a_single_one(tmp_path, friction):
    """Though four march together, with a step for an accuracy, and only peaks are kept."""
    joints = {"gap": BASE["joints"]["gap"] | {"friction": friction}}
    config = write_job(tmp_path, records=4, joints=joints, transient={"accuracy": "1 %"})
    found = made(config, tmp_path / "out").summary
    raw = yaml.safe_load(config.read_text()) | {"pipeline": "run"}
    del raw["suite"]
    raw["outputs"] = raw["outputs"] | {"plots": False}
    (tmp_path / "one.yaml").write_text(yaml.safe_dump(raw))
    singles = romdam.run(romdam.load_config(tmp_path / "one.yaml"), tmp_path / "single").paths
    assert [path.stem for path in singles] == list(found.record.values)
    for path in singles:
        row = found.isel(scale=0, sample=0).sel(record=path.stem)
        with xr.open_dataset(path, engine="h5netcdf") as single:
            assert np.array_equal(row.peak_opening, single.peak_opening)
            assert np.array_equal(row.peak_displacement, single.peak_displacement)
            assert float(row.energy_damping) == float(single.energy_damping[-1])
            assert ("dissipated_energy" in found) == ("dissipated_energy" in single) == (friction > 0.0)
            if friction:
                dissipated = single.dissipated_energy[-1].values
                total = dissipated.sum(dtype=float)  # of single precision in the file
                assert float(row.dissipated_energy[0]) == pytest.approx(total, rel=2e-7) and total > 0.0
                assert total == pytest.approx(float(single.energy_friction[-1]), rel=2e-7)


def test_frictionless_samples_have_no_slip_and_rough_ones_have(whole):
    found = whole[1].summary
    rough = found.parameter_mu.values > 0
    assert np.isnan(found.peak_slip.values[:, :, ~rough]).all()
    assert (found.peak_slip.values[:, :, rough] > 0.0).all()


def test_record_measures_follow_the_scale(whole):
    found = whole[1].summary
    np.testing.assert_allclose(found.record_pga[:, 0], [0.5 * np.abs(pulse(i)).max() for i in range(3)])
    np.testing.assert_allclose(found.record_sa[:, 1], 2.0 * found.record_sa[:, 0])
    np.testing.assert_allclose(found.record_arias[:, 1], 4.0 * found.record_arias[:, 0])
    np.testing.assert_allclose(found.record_d5_95[:, 1], found.record_d5_95[:, 0])


def test_every_variable_says_what_it_is(whole):
    with xr.open_dataset(whole[1].path, engine="h5netcdf") as found:
        assert all(v.attrs.get("long_name") for v in found.data_vars.values())
        assert "largest" in found.record_pga.attrs["long_name"]  # of the components, which no interval is of
        assert "largest" not in found.record_dt.attrs["long_name"]
        assert found.parameter_mu.attrs == {"units": "1", "long_name": "joints.gap.friction"}


def test_second_call_makes_nothing_and_reduces_nothing(whole, monkeypatch):
    config, outcome = whole
    before = summary(outcome.path.parent)
    monkeypatch.setattr(CraigBampton, "reduce", None)
    monkeypatch.setattr(pipeline, "append_rows", None)
    again = made(config, outcome.path.parent)
    assert again.made == 0 and differing(before, summary(outcome.path.parent)) == []


@pytest.mark.slow
def test_only_what_is_stale_is_made_again(whole, tmp_path):
    config, _ = whole
    job = write_job(tmp_path, suite=SAMPLES | {"batch": 2})
    made(job, tmp_path / "out")
    np.savetxt(tmp_path / "records" / "r1.txt", 1.1 * pulse(1))
    assert made(job, tmp_path / "out").made == 8
    raw = yaml.safe_load(job.read_text())
    raw["suite"]["parameters"]["mu"]["values"] = [0.0, 0.6, 0.9]
    raw["title"] = "another title changes nothing"
    job.write_text(yaml.safe_dump(raw))
    assert made(job, tmp_path / "out").made == 12
    assert config != job


def test_interrupted_suite_goes_on_to_the_same_bits(whole, tmp_path, monkeypatch):
    config, outcome = whole
    real, landed = pipeline.append_rows, []

    def stop(path, rows):
        real(path, rows)
        landed.append(rows)
        if len(landed) == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "append_rows", stop)
    with pytest.raises(KeyboardInterrupt):
        made(config, tmp_path)
    monkeypatch.undo()
    kept = (tmp_path / JOURNAL).read_bytes()
    assert len(kept.split()) > 8 and len(read_rows(tmp_path / JOURNAL)) == 8
    resumed = made(config, tmp_path)
    assert resumed.made == resumed.runs - 8
    assert (tmp_path / JOURNAL).read_bytes().startswith(kept)
    assert differing(outcome.summary, resumed.summary) == []


def test_damaged_rows_are_made_again(whole, tmp_path, caplog):
    config, outcome = whole
    made(config, tmp_path)
    path = tmp_path / JOURNAL
    path.write_bytes(path.read_bytes()[:-300])
    with caplog.at_level(logging.WARNING):
        again = made(config, tmp_path)
    assert path.name in caplog.text and again.made == 1
    assert differing(outcome.summary, again.summary) == []


def kill_at_random(config, out, times, seed):
    """Kill -9 the command again and again, then let it finish; how many runs were there at each kill."""
    draw, seen = np.random.default_rng(seed), []
    for _ in range(times):
        running = subprocess.Popen(command(config, out, "--workers", 1), start_new_session=True)
        rows, before = out / JOURNAL, len(read_rows(out / JOURNAL))
        end = time.monotonic() + 60.0
        while running.poll() is None and time.monotonic() < end:
            if len(read_rows(rows)) > before:
                break
            time.sleep(0.01)
        time.sleep(draw.uniform(0.0, 0.5))
        running.kill()
        running.wait()
        seen.append(rows.read_bytes())
    return seen


@pytest.mark.parametrize(
    ("times", "batch"), [(1, 6), pytest.param(20, 1, marks=pytest.mark.slow)], ids=["once", "20 times"]
)
def test_kill_9_costs_at_most_the_runs_in_flight(tmp_path, times, batch):
    job = write_job(tmp_path, records=6 if times > 1 else 3, suite=SAMPLES | {"batch": batch})
    undisturbed = made(job, tmp_path / "undisturbed")
    runs = undisturbed.runs
    seen = kill_at_random(job, tmp_path / "out", times, 5)
    resumed = made(job, tmp_path / "out")
    final = (tmp_path / "out" / JOURNAL).read_bytes()
    assert len(seen[-1].split(b'{"key"')) > times and len(final.split(b'{"key"')) == runs + 1
    assert all(final.startswith(rows) for rows in seen), "finished rows are never made again"
    assert differing(undisturbed.summary, resumed.summary) == []


@pytest.mark.slow
def test_bad_records_are_named_and_the_others_go_on(tmp_path):
    job = write_job(tmp_path)
    for name, text in (("nan", "1\nnan\n2\n"), ("empty", ""), ("unit", "900\n-980\n" * 30)):
        (tmp_path / "records" / f"{name}.txt").write_text(text)
    raw = yaml.safe_load(job.read_text())
    raw["records"] += [
        {**BASE["records"][0], "files": "records/r0.txt"},  # a duplicate
        {"file": "missing.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}},
    ]
    job.write_text(yaml.safe_dump(raw))
    code, stdout, stderr = call("run", job, "--out", tmp_path / "out", "--workers", 1)
    assert code == 1 and "5 of 8 runs failed" in stderr and "summary.nc" in stdout
    for part in ("nan.txt", "empty.txt", "is the unit right", "named 'r0' is there already", "missing.txt"):
        assert part in stderr
    found = summary(tmp_path / "out")
    assert found.record.values.tolist() == ["empty", "nan", "r0", "r1", "r2", "unit", "r0.2", "missing"]
    good = found.status.values.ravel() == 0
    assert good.tolist() == [False, False, True, True, True, False, False, False]
    assert np.isfinite(found.peak_opening.values[good]).all()
    assert np.isnan(found.peak_opening.values[~good]).all()
    assert (found.message.values.ravel()[~good] != "").all()


def test_run_that_fails_is_a_row_that_stays_failed(tmp_path, monkeypatch):
    from romdam.core.errors import ConvergenceError
    from romdam.pipelines.suites import runs as suite_runs

    real = suite_runs.simulate_motions

    def fails(job, prepared, motions, *rest):
        return [
            ConvergenceError("step 3: stopped") if m.name.startswith("r1") else h
            for m, h in zip(motions, real(job, prepared, motions, *rest), strict=True)
        ]

    monkeypatch.setattr(suite_runs, "simulate_motions", fails)
    job = write_job(tmp_path)
    outcome = made(job, tmp_path / "out")
    assert outcome.failures == {"r1__0__0": "step 3: stopped"}
    assert outcome.summary.status.values.ravel().tolist() == [0, 1, 0]
    again = made(job, tmp_path / "out")
    assert again.made == 0 and again.failures == outcome.failures


def test_what_fails_after_a_run_is_a_row_too(tmp_path, monkeypatch):
    from romdam.pipelines.suites import runs as suite_runs

    real = suite_runs.stress_of
    calls = iter(range(100))

    def fails(scene, fields, history):
        if next(calls) == 1:
            raise FloatingPointError("overflow")
        return real(scene, fields, history)

    monkeypatch.setattr(suite_runs, "stress_of", fails)
    found = made(write_job(tmp_path), tmp_path / "out")
    assert list(found.failures.values()) == ["FloatingPointError: overflow"]
    assert sorted(found.summary.status.values.ravel()) == [0, 0, 1]


@pytest.mark.slow
def test_misfortune_of_one_run_leaves_the_others_of_its_task(tmp_path, monkeypatch):
    from romdam.pipelines.suites import runs as suite_runs

    real = suite_runs.simulate_motions

    def fails(job, prepared, motions, *rest):
        if any(motion.name.startswith("r1") for motion in motions):
            raise MemoryError("too much")
        return real(job, prepared, motions, *rest)

    monkeypatch.setattr(suite_runs, "simulate_motions", fails)
    assert made(write_job(tmp_path), tmp_path / "out").failures == {"r1__0__0": "MemoryError: too much"}


@pytest.mark.slow
def test_whole_results_land_and_open_as_one_tree(tmp_path):
    job = write_job(tmp_path, suite={"keep": "full", "scales": [1.0, 2.0]})
    outcome = made(job, tmp_path / "out")
    tree = romdam.open_suite(tmp_path / "out")
    assert tree["runs/r1__1__0/opening"].dtype == np.float64
    largest = tree["runs/r1__1__0"].gap_peak_opening.max()
    assert tree.peak_opening.sel(record="r1").isel(scale=1).item() == pytest.approx(float(largest))
    assert tree["design"].sizes["sample"] == 1
    names = tree.file.sel(record=["r1", "r0"]).values
    with romdam.open_result(tmp_path / "out" / "runs" / str(names[0, 1, 0])) as result:
        top = result.displacement("right", nodes=[0], times=[0.2])
        assert top.shape == (1, 1, 3) and result.dataset.attrs["suite_run_key"]
    (tmp_path / "out" / "runs" / str(names[1, 0, 0])).unlink()
    assert made(job, tmp_path / "out").made == 1 and outcome.made == 6


def test_decimated_results_are_single_and_sparse(tmp_path):
    job = write_job(tmp_path, suite={"keep": {"output_interval": "0.05 s"}})
    made(job, tmp_path / "out")
    (path,) = (tmp_path / "out" / "runs").glob("r0__0__0-*.nc")
    with xr.open_dataset(path, engine="h5netcdf") as result:
        assert result.opening.dtype == np.float32 and result.time.dtype == np.float64
        np.testing.assert_allclose(np.diff(result.time), 0.05)


def test_sizes_are_told_beforehand(tmp_path):
    told = []
    run_suite(romdam.load_config(write_job(tmp_path)), tmp_path / "out", HERE, tell=told.append)
    assert told[0].startswith("3 runs; up to ") and str(tmp_path / "out") in told[0]


class FullDisk(io.BytesIO):
    """A disk that takes half of what is written and refuses the rest."""

    def __init__(self, path):
        super().__init__()
        self.path = path

    def write(self, data):
        with open(self.path, "ab") as file:
            file.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")


def test_full_disk_stops_the_suite_and_loses_nothing(whole, tmp_path, monkeypatch):
    config, outcome = whole
    real, calls = Path.open, []

    def opened(path, mode="r", *rest, **more):
        if path.name == JOURNAL and mode == "ab":
            calls.append(path)
            if len(calls) > 3:
                return FullDisk(path)
        return real(path, mode, *rest, **more)

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(ResultError, match=r"rows\.jsonl: cannot be written .*No space.*; free the disk"):
        made(config, tmp_path)
    monkeypatch.undo()
    assert len(read_rows(tmp_path / JOURNAL)) >= 6
    (tmp_path / ".left.nc.123.part").write_text("by a writer that was killed")
    assert differing(outcome.summary, made(config, tmp_path).summary) == []
    assert not list(tmp_path.rglob("*.part"))


def test_warnings_of_runs_stand_in_the_summary(tmp_path):
    """Once for all runs that differ in its numbers alone, as their own results and the journal have them."""
    config = write_job(tmp_path, records=2, suite={"parameters": MU, "keep": "full"})
    outcome = made(config, tmp_path / "out")
    stated = json.loads(outcome.summary.attrs["run_warnings"])
    every = [
        json.loads(xr.load_dataset(path).attrs["run_warnings"])
        for path in (tmp_path / "out" / "runs").glob("*.nc")
    ]
    assert len(every) == 4 and sum(map(len, every)) > len(stated) > 0
    assert sum(warned["runs"] for warned in stated) == sum(map(len, every))
    assert {warned["warning"] for warned in stated} <= {text for texts in every for text in texts}
    assert len({re.sub(r"[-+0-9.e]+", "", warned["warning"]) for warned in stated}) == len(stated)
    lines = suite_warning_lines(outcome.summary, None)
    assert (
        lines[-1] == f"{stated[-1]['runs']} of 4 runs, {stated[-1]['record']} first: {stated[-1]['warning']}"
    )
    again = made(config, tmp_path / "out")
    assert again.made == 0 and again.summary.attrs["run_warnings"] == outcome.summary.attrs["run_warnings"]
