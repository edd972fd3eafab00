"""Worker processes and dask clusters give the bits of one process, whatever happens to the workers."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

import romdam
from romdam.errors import ConfigError
from romdam.pipelines.cluster import open_pool
from romdam.pipelines.suite import SuiteOptions, run_suite

pytest.importorskip("distributed")

from suite_jobs import command, differing, summary, write_job

SUITE = {"scales": [0.5, 1.0, 1.5], "batch": 1}


def dask(*arguments: object) -> subprocess.Popen[str]:
    code = f"import sys; from distributed.cli.dask_{arguments[0]} import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments[1:])], stderr=subprocess.PIPE, text=True
    )


@pytest.fixture
def cluster(tmp_path):
    """A scheduler and two workers in processes of their own, as a person starts them by hand."""
    contact = tmp_path / "scheduler.json"
    common = ("--scheduler-file", contact, "--no-dashboard")
    scheduler = dask("scheduler", "--host", "127.0.0.1", "--port", 0, *common)
    while not contact.exists():
        time.sleep(0.1)
    options = (*common, "--nthreads", 1, "--no-nanny", "--local-directory", tmp_path)
    workers = [dask("worker", *options) for _ in range(2)]
    yield json.loads(contact.read_text())["address"], workers
    for process in (*workers, scheduler):
        process.kill()
        process.wait()


@pytest.mark.slow
def test_one_of_two_workers_started_by_hand_is_killed(tmp_path, cluster):
    address, workers = cluster
    job = romdam.load_config(write_job(tmp_path, records=5, suite=SUITE))
    alone = run_suite(job, tmp_path / "alone", SuiteOptions(workers=1))
    said = []

    @contextmanager
    def killing(text):
        def progress(done, total):
            said.append(done)
            if len(said) == 3:
                workers[0].kill()

        yield progress

    found = run_suite(job, tmp_path / "out", SuiteOptions(scheduler=address), show=killing)
    assert workers[0].wait() == -signal.SIGKILL and workers[1].poll() is None
    assert found.made == found.runs == 15 and found.failures == {}
    assert differing(alone.summary, found.summary) == []


@pytest.mark.slow
def test_two_processes_give_the_bits_of_one_and_ctrl_c_ends_them(tmp_path):
    job = write_job(tmp_path, records=5, suite=SUITE)
    alone = run_suite(romdam.load_config(job), tmp_path / "alone", SuiteOptions(workers=1))
    running = subprocess.Popen(
        command(job, tmp_path / "out", "--workers", 2),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while not (tmp_path / "out" / "rows.jsonl").exists() and running.poll() is None:
        time.sleep(0.01)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does: to every process
    _, stderr = running.communicate(timeout=60)
    assert running.returncode == 130 and "goes on when run again" in stderr and "Traceback" not in stderr
    assert not (tmp_path / "out" / "summary.nc").exists()
    subprocess.run(command(job, tmp_path / "out", "--workers", 2), check=True)
    assert differing(alone.summary, summary(tmp_path / "out")) == []


def test_scheduler_that_does_not_answer_is_named(monkeypatch):
    def refuse(*args, **kwargs):
        raise OSError("timed out")

    monkeypatch.setattr("distributed.Client.__init__", refuse)
    pool = open_pool(None, "tcp://127.0.0.1:9", "romdam")
    with pytest.raises(ConfigError, match=r"--scheduler tcp://127.0.0.1:9: no dask scheduler answers"):
        pool.__enter__()
