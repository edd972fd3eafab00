"""The folder of a suite: who may work in it, what lies there, what is cleaned."""

import fcntl
import multiprocessing
import os
import resource
import signal
import subprocess
import time
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from suite_jobs import command, edited, made, write_job
from test_cli import call

import romdam
from romdam.core.errors import ConfigError, ResultError
from romdam.pipelines.suites import kept as suite_kept
from romdam.pipelines.suites.folder import LOCK, clean, suite_lock
from romdam.pipelines.suites.run import SuiteOptions, run_suite
from romdam.results.suite.journal import JOURNAL, append_rows, read_rows
from romdam.results.suite.rows import SuiteRow


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


@pytest.mark.slow
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


@pytest.mark.slow
def test_clean_leaves_a_run_that_has_moved_in_the_design(tmp_path):
    """Its file has the name of before until the suite is run again."""
    out = tmp_path / "out"
    config = write_job(tmp_path, records=2, suite={"keep": "full", "scales": [0.5, 1.0]})
    names = made(config, out).summary.file.values[:, :, 0]
    job = edited(config, scales=[1.0])
    cleaned = clean(job, out, remove=True)
    assert sorted(path.name for path in cleaned.files) == sorted(names[:, 0]) and cleaned.rows == 2
    assert sorted(path.name for path in (out / "runs").glob("*.nc")) == sorted(names[:, 1])
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


@pytest.mark.usefixtures("unrendered")
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


def test_rows_that_the_disk_refuses_leave_nothing_behind(tmp_path):
    """A quota in the middle of a line: the journal is as it was, and says so."""
    journal, row = tmp_path / JOURNAL, SuiteRow("a" * 64, "", {"peak_opening": np.ones(50)})
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
