"""A suite that is edited and run again gives every run its own numbers; its folder, and damage to it."""

import fcntl
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml

import romdam
from romdam.core.errors import ConfigError, ConvergenceError, ResultError
from romdam.pipelines.suites import kept as suite_kept
from romdam.pipelines.suites import run as pipeline
from romdam.pipelines.suites import runs as suite_runs
from romdam.pipelines.suites.folder import LOCK, clean, suite_lock
from romdam.pipelines.suites.run import SuiteOptions, run_suite
from romdam.postprocess.responses import PARAMETER, parameters
from romdam.results.suite.journal import JOURNAL, append_rows, read_rows
from romdam.results.suite.rows import Row

sys.path.insert(0, str(Path(__file__).parents[1]))

from suite_jobs import BASE, command, differing, pulse, summary, write_job
from test_cli import call

MU = {"mu": {"path": "joints.gap.friction", "values": [0.2, 0.6]}}


def made(config, out):
    return run_suite(romdam.load_config(config), out, SuiteOptions(workers=1))


def edited(config, **suite):
    """Change keys of a configuration's `suite:`."""
    raw = yaml.safe_load(config.read_text())
    raw["suite"] |= suite
    config.write_text(yaml.safe_dump(raw))
    return romdam.load_config(config)


def named_records(config, **files):
    """Let a configuration have these records: name -> number of the file."""
    raw = yaml.safe_load(config.read_text())
    entry = {k: v for k, v in BASE["records"][0].items() if k != "files"}
    raw["records"] = [{**entry, "name": name, "file": f"records/r{i}.txt"} for name, i in files.items()]
    config.write_text(yaml.safe_dump(raw))


def as_fresh(config, folder, calls):
    """Run in the folder of before: how many runs that makes, and that a new folder has the same bits."""
    again = made(config, folder / "out")
    fresh = made(config, folder / f"fresh{len(list(folder.iterdir()))}")
    assert again.made == calls
    assert differing(again.summary, fresh.summary) == [] and again.failures == fresh.failures
    assert differing(summary(folder / "out"), fresh.summary) == []
    return again


def test_a_scale_added_in_front_moves_no_number(tmp_path):
    config = write_job(tmp_path, records=1, suite={"scales": [0.25, 1, 2]})
    before = made(config, tmp_path / "out").summary.peak_opening.values.ravel()
    edited(config, scales=[0.25, 0.5, 1, 2])
    after = as_fresh(config, tmp_path, calls=1).summary.peak_opening.values.ravel()
    assert after[[0, 2, 3]].tolist() == before.tolist() and np.isfinite(after).all()


def test_scales_and_samples_are_reordered_and_removed_for_nothing(tmp_path):
    config = write_job(tmp_path, records=2, suite={"scales": [0.5, 1, 2], "parameters": MU})
    made(config, tmp_path / "out")
    edited(config, scales=[2, 0.5], parameters={"mu": MU["mu"] | {"values": [0.6, 0.2]}})
    as_fresh(config, tmp_path, calls=0)
    edited(config, parameters={"other": MU["mu"] | {"values": [0.4, 0.6]}})
    as_fresh(config, tmp_path, calls=4)


def test_records_exchange_names_and_go(tmp_path):
    config = write_job(tmp_path, records=3, suite={"keep": "full"})
    named_records(config, a=0, b=1, c=2)
    made(config, tmp_path / "out")
    for files in ({"b": 0, "a": 1, "c": 2}, {"c": 2, "new": 0}, {"x": 2}):
        named_records(config, **files)
        as_fresh(config, tmp_path, calls=0)
        tree = romdam.open_suite(tmp_path / "out")
        assert sorted(tree["runs"]) == sorted(f"{name}__0__0" for name in files)
        for name, number in files.items():
            result = tree[f"runs/{name}__0__0"]
            assert result.attrs["record"] == f"{name}__0__0"
            assert f'"suite_record": "{name}"' in result.attrs["record_provenance"]
            assert f"r{number}.txt" in result.attrs["record_provenance"]
            assert result.attrs["configuration_sha256"] == romdam.load_config(config).digest


def test_two_records_of_one_file_are_both_there_at_every_start(tmp_path):
    config = write_job(tmp_path, records=1, suite={"keep": "full"})
    named_records(config, one=0, two=0)
    first = made(config, tmp_path / "out")
    assert first.made == 1 and not first.summary.status.values.any()
    as_fresh(config, tmp_path, calls=0)
    assert len(list((tmp_path / "out" / "runs").glob("*.nc"))) == 1
    assert len(set(first.summary.file.values.ravel())) == 1


def test_a_sample_with_friction_changes_the_basis_of_the_others(tmp_path):
    smooth = {"mu": MU["mu"] | {"values": [0.0]}}
    config = write_job(tmp_path, records=1, suite={"parameters": smooth})
    alone = float(made(config, tmp_path / "out").summary.peak_opening[0, 0, 0, 0])
    edited(config, parameters={"mu": MU["mu"] | {"values": [0.0, 0.6]}})
    both = as_fresh(config, tmp_path, calls=2).summary
    assert float(both.peak_opening[0, 0, 0, 0]) != alone  # its basis has the tangential directions by now


def test_parameters_that_say_what_was_so_before_change_no_bit(tmp_path):
    joints = {"gap": BASE["joints"]["gap"] | {"friction": 0.3}}
    config = write_job(tmp_path, records=2, suite={"keep": "full"}, joints=joints)
    made(config, tmp_path / "out")
    ratio = {"path": "damping.rayleigh.ratio", "values": ["5 %"]}
    edited(config, parameters={"mu": MU["mu"] | {"values": [0.3]}, "ratio": ratio})
    as_fresh(config, tmp_path, calls=0)
    edited(config, parameters={})
    as_fresh(config, tmp_path, calls=0)


def test_failures_follow_their_records(tmp_path, monkeypatch):
    """The shorter record's run fails, under whatever name."""
    marching = suite_runs.simulate_motions

    def failing(job, prepared, motions, duration):
        for motion in motions:
            if motion.acc.shape[1] == 60:
                raise ConvergenceError(f"record {motion.name}: step 3 did not converge")
        return marching(job, prepared, motions, duration)

    monkeypatch.setattr(suite_runs, "simulate_motions", failing)
    config = write_job(tmp_path, records=2, suite={"keep": "full", "scales": [1]})
    named_records(config, one=0, other=1)
    assert list(made(config, tmp_path / "out").failures) == ["one__0__0"]
    named_records(config, other=0, one=1)
    again = as_fresh(config, tmp_path, calls=0)
    assert again.failures == {"other__0__0": "its record: step 3 did not converge"}


def test_what_is_kept_is_believed_by_its_bytes(tmp_path, caplog):
    config = write_job(tmp_path, records=3, suite={"keep": "full"})
    before = made(config, tmp_path / "out")
    paths = sorted((tmp_path / "out" / "runs").glob("*.nc"))
    whole = [path.read_bytes() for path in paths]
    changed = bytearray(whole[0])
    changed[len(changed) // 2] ^= 4
    paths[0].write_bytes(changed)
    paths[1].write_bytes(bytes(len(whole[1])))
    paths[2].unlink()
    os.mkfifo(paths[2])
    again = made(config, tmp_path / "out")
    assert again.made == 3 and differing(before.summary, again.summary) == []
    assert all(path.name in caplog.text for path in paths)


@pytest.mark.parametrize("seed", range(6))
def test_damaged_rows_are_never_believed(tmp_path, whole_suite, seed):
    config, journal, before = whole_suite
    out, draw = tmp_path / "out", np.random.default_rng(seed)
    out.mkdir()
    data = bytearray(journal)
    kind = ("bits", "zeroed", "cut", "swapped", "foreign", "words")[seed]
    if kind == "bits":
        for at in draw.integers(0, len(data), 40):
            data[at] ^= 1 << int(draw.integers(8))
    elif kind == "zeroed":
        data[len(data) // 3 : len(data) // 2] = bytes(len(data) // 2 - len(data) // 3)
    elif kind == "cut":
        del data[len(data) // 2 :]
    elif kind == "swapped":
        data = bytearray(data.replace(b'"peak_opening"', b'"peak_OPENING"'))
    elif kind == "foreign":
        data = bytearray(b'{"key": 1}\n\x00\xff\n' + b"0" * 64 + b" {}\n")
    else:
        data = bytearray(data.replace(b"e-05", b"e-04").replace(b"[", b"[NaN, ", 3))
    (out / JOURNAL).write_bytes(data)
    found = made(config, out)
    assert found.made > 0 and differing(found.summary, before) == []


@pytest.fixture(scope="module")
def whole_suite(tmp_path_factory):
    """A configuration, the bytes of its rows, its summary."""
    folder = tmp_path_factory.mktemp("whole")
    config = write_job(folder, suite={"scales": [0.5, 1.0]})
    found = made(config, folder / "out")
    return config, (folder / "out" / JOURNAL).read_bytes(), found.summary


@pytest.mark.parametrize("what", ["folder", "pipe"])
def test_something_else_in_the_place_of_the_rows_is_refused(tmp_path, what):
    config = write_job(tmp_path, records=1)
    (tmp_path / "out").mkdir()
    (os.mkfifo if what == "pipe" else os.mkdir)(tmp_path / "out" / JOURNAL)
    with pytest.raises(ResultError, match=r"rows\.jsonl: is a"):
        made(config, tmp_path / "out")


@pytest.mark.parametrize("name", ["summary.nc", "design.nc"])
def test_a_folder_in_the_place_of_the_summary_is_told_beforehand(tmp_path, name):
    (tmp_path / "out" / name).mkdir(parents=True)
    with pytest.raises(ResultError, match="is a folder"):
        made(write_job(tmp_path, records=1), tmp_path / "out")
    assert not (tmp_path / "out" / JOURNAL).exists()


SHADOWS = ("gap", "joint", "component", "scale", "record", "sample", "node", "peak_opening", "status",
           "run_key", "parameter_gap", "record_pga", "time", "file")  # fmt: skip


def test_no_parameter_shadows_a_name_of_the_summary(tmp_path):
    paths = ("joints.gap.friction", "damping.rayleigh.ratio")
    config = write_job(tmp_path, records=1)
    for names in zip(SHADOWS[::2], SHADOWS[1::2], strict=True):
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


def test_a_second_suite_in_the_folder_is_refused(tmp_path):
    config = write_job(tmp_path)
    (tmp_path / "out").mkdir()
    with suite_lock(tmp_path / "out"):
        for words in (("run",), ("clean",)):
            (tmp_path / "out" / JOURNAL).touch()
            code, _, stderr = call(*words, config, "--out", tmp_path / "out")
            assert code == 2 and f"process {os.getpid()} on " in stderr and "since 20" in stderr, stderr
            assert "wait for its end" in stderr and "Traceback" not in stderr
    made(config, tmp_path / "out")


def test_the_lock_goes_with_a_process_that_is_killed(tmp_path):
    config = write_job(tmp_path, records=1)
    running = subprocess.Popen(command(config, tmp_path / "out", "--workers", 2), start_new_session=True)
    lock, end = tmp_path / "out" / LOCK, time.monotonic() + 60.0
    while not _is_held(lock) and time.monotonic() < end:
        time.sleep(0.01)
    assert _is_held(lock)
    os.kill(running.pid, signal.SIGKILL)
    running.wait()
    assert not _is_held(lock)
    assert made(config, tmp_path / "out").summary.status.values.tolist() == [[[0]]]


def test_a_worker_whose_suite_was_killed_writes_nothing_more(tmp_path, monkeypatch):
    monkeypatch.setattr(suite_kept, "parent_process", lambda: SimpleNamespace(is_alive=lambda: False))
    with pytest.raises(ResultError, match="was killed"):
        made(write_job(tmp_path, records=1, suite={"keep": "full"}), tmp_path / "out")
    assert not list((tmp_path / "out" / "runs").glob("*.nc"))


def test_workers_of_a_suite_that_lives_write_what_is_kept(tmp_path):
    job = romdam.load_config(write_job(tmp_path, records=2, suite={"keep": "full", "batch": 1}))
    assert run_suite(job, tmp_path / "out", SuiteOptions(workers=2)).made == 2
    assert len(list((tmp_path / "out" / "runs").glob("*.nc"))) == 2


def _is_held(path):
    if not path.exists():
        return False
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def test_clean_lists_and_removes_what_is_of_no_run(tmp_path):
    out = tmp_path / "out"
    config = write_job(tmp_path, records=2, suite={"keep": "full", "scales": [0.5, 1.0]})
    made(config, out)
    job = edited(config, scales=[1.0])
    told = []
    again = run_suite(job, out, SuiteOptions(workers=1), tell=told.append)
    own = out / "runs" / str(again.summary.file.values[0, 0, 0])
    assert len(again.leftovers) == 2 and "romdam clean" in told[-1] and again.leftovers[0].name in told[-1]
    (out / "runs" / "notes.nc").write_text("a person's")
    altered = again.leftovers[1]
    altered.write_bytes(altered.read_bytes() + b"!")
    before = sorted(out.rglob("*"))
    look = clean(job, out)
    assert look.files == again.leftovers[:1] and look.rows == 1 and look.size > 1e4
    assert sorted(path.name for path in look.kept) == sorted(["notes.nc", altered.name])
    assert sorted(out.rglob("*")) == before and len(read_rows(out / JOURNAL)) == 4
    code, stdout, _ = call("clean", config, "--out", out, "--remove")
    assert code == 0 and f"removed: {again.leftovers[0]}" in stdout.replace("\n", "")
    assert set(before) - set(out.rglob("*")) == {again.leftovers[0]} and own.exists()
    assert len(read_rows(out / JOURNAL)) == 3 and clean(job, out).files == ()
    assert made(config, out).made == 0


def test_clean_refuses_what_is_not_the_suite(tmp_path):
    config = write_job(tmp_path, records=1)
    with pytest.raises(ResultError, match="is not the folder of a suite"):
        clean(romdam.load_config(config), tmp_path)
    made(config, tmp_path / "out")
    job = edited(config, scales=[3.0])
    with pytest.raises(ResultError, match="none of the 1 runs"):
        clean(job, tmp_path / "out", remove=True)
    raw = yaml.safe_load(config.read_text()) | {"pipeline": "run"}
    config.write_text(yaml.safe_dump(raw))
    with pytest.raises(ConfigError, match="is no suite"):
        clean(romdam.load_config(config), tmp_path / "out")


def test_records_that_cannot_be_written_are_told_before_the_first_run(tmp_path):
    config = write_job(tmp_path, records=1)
    np.savetxt(tmp_path / "records" / "r1.txt", pulse(0)[:5])
    named_records(config, short=1, whole=0)
    edited(config, keep={"output_interval": "0.1 s"})
    assert "nothing but the start would be written" in made(config, tmp_path / "b").failures["short"]


def test_results_of_other_runs_in_the_folder_are_named(tmp_path):
    config = write_job(tmp_path, records=2)
    raw = yaml.safe_load(config.read_text()) | {"pipeline": "run"}
    raw["outputs"] |= {"plots": False}
    single = tmp_path / "single.yaml"
    single.write_text(yaml.safe_dump(raw))
    romdam.run(romdam.load_config(single), tmp_path / "out")
    told = []
    run_suite(romdam.load_config(config), tmp_path / "out", SuiteOptions(workers=1), tell=told.append)
    assert "r0.nc, r1.nc" in told[-1]
    (tmp_path / "records" / "r1.txt").unlink()
    outcome = romdam.run(romdam.load_config(single), tmp_path / "out")
    assert [path.name for path in outcome.others] == ["design.nc", "r1.nc", "summary.nc"]
    code, stdout, _ = call("run", single, "--out", tmp_path / "out")
    assert code == 0 and "r1.nc" in stdout and "not of this run" in stdout


@pytest.mark.parametrize("batch", [1, 2, 3, 7])
def test_whom_a_run_marches_with_does_not_change_its_bits(tmp_path, batch):
    """Records of one and of two axes, samples with and without friction."""
    parameters = {"mu": MU["mu"] | {"values": [0.0, 0.4]},
                  "ratio": {"path": "damping.rayleigh.ratio", "values": ["3 %", "5 %"]}}  # fmt: skip
    config = write_job(tmp_path, records=2, suite={"parameters": parameters})
    np.savetxt(tmp_path / "records" / "both.csv", np.column_stack([pulse(1), pulse(1)[::-1]]))
    raw = yaml.safe_load(config.read_text())
    raw["records"].append({**BASE["records"][0], "files": "records/both.csv", "components": {"x": 1, "y": 2}})
    config.write_text(yaml.safe_dump(raw))
    together = made(config, tmp_path / "together").summary
    edited(config, batch=batch)
    assert differing(together, made(config, tmp_path / "out").summary) == []


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
        ({"parameters": {"m": {"path": "joints..friction", "values": [0.1]}}}, {}, "no joint ''"),
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
        ("mu,mu\n0.3,0.4\n", "'mu, mu'"),
        ("mu,other\n0.3,0.4\n", "'mu, other'"),
        ("mu\n0,3\n", "has 2 values for 1 columns"),
        ("mu\n\n", "holds no samples"),
        ("", "holds no samples"),
        ("mu\n0.3,\n", "has 2 values"),
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


def test_rows_that_the_disk_refuses_leave_nothing_behind(tmp_path):
    """A quota in the middle of a line: the journal is as it was, and says so."""
    journal, row = tmp_path / JOURNAL, Row("a" * 64, "", {"peak_opening": np.ones(50)})
    append_rows(journal, [row])
    before = journal.read_bytes()

    def refused():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 100, resource.RLIM_INFINITY))
        append_rows(journal, [row])

    process = multiprocessing.get_context("fork").Process(target=refused)
    process.start()
    process.join()
    assert process.exitcode == 1 and journal.read_bytes() == before
    assert list(read_rows(journal)) == [row.key]
