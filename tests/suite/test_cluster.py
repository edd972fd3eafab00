"""Worker processes and dask clusters give the bits of one process, whatever happens to the workers."""

import ast
import inspect
import json
import os
import pickle
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from importlib import import_module
from pathlib import Path

import pytest
from suite_jobs import command, differing, summary, write_job

import romdam
from romdam.core.errors import ConfigError, ResultError, WorkerError
from romdam.pipelines.suites import admission
from romdam.pipelines.suites import cluster as cluster_module
from romdam.pipelines.suites.cluster import open_pool
from romdam.pipelines.suites.run import SuiteOptions, run_suite
from romdam.results.suite.journal import JOURNAL, read_rows

distributed = pytest.importorskip("distributed")

SUITE = {"scales": [0.5, 1.0, 1.5], "batch": 1}


def dask(folder: Path, *arguments: object, first: str = "pass", **environment: str) -> subprocess.Popen[str]:
    """A dask command in a process of its own, which runs a line of Python first."""
    code = f"import os, sys; {first}; from distributed.cli.dask_{arguments[0]} import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments[1:])],
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | environment,
        cwd=folder,
    )


class Cluster:
    """A scheduler and workers in processes of their own, as a person starts them by hand."""

    def __init__(self, folder: Path) -> None:
        contact = folder / "scheduler.json"
        self._common = ("--scheduler-file", contact, "--no-dashboard")
        self._folder = folder
        self.scheduler = dask(folder, "scheduler", "--host", "127.0.0.1", "--port", 0, *self._common)
        self.processes = [self.scheduler]
        while not contact.exists() or not contact.read_text():
            time.sleep(0.1)
        self.address = json.loads(contact.read_text())["address"]

    def worker(self, **options: str) -> subprocess.Popen[str]:
        """One more."""
        alone = ("--nthreads", 1, "--no-nanny", "--local-directory", self._folder)
        self.processes.append(dask(self._folder, "worker", *self._common, *alone, **options))
        return self.processes[-1]


@pytest.fixture
def cluster(tmp_path):
    one = Cluster(tmp_path)
    yield one
    for process in one.processes:
        process.kill()
        process.wait()


def other_romdam(folder: Path, version: str) -> str:
    """Folder of an installation that differs in a comment, and says another version."""
    root = Path(romdam.__path__[0])
    shutil.copytree(root, folder / "romdam", ignore=shutil.ignore_patterns("__pycache__"))
    pipelines = import_module("romdam.pipelines").__path__[0]
    shutil.copytree(pipelines, folder / "romdam" / "pipelines", dirs_exist_ok=True)
    stated = folder / "romdam" / "core" / "version.py"
    stated.write_text(stated.read_text().replace(romdam.__version__, version) + "# other\n")
    return str(folder)


def refused(job: Path, out: Path, address: str) -> tuple[int, str]:
    """Exit code and message of a suite on a cluster."""
    done = subprocess.run(command(job, out, "--scheduler", address), capture_output=True, text=True)
    assert "Traceback" not in done.stderr and done.stderr.count("romdam: ") == 1, done.stderr
    return done.returncode, done.stderr


@pytest.mark.slow
def test_one_of_two_workers_started_by_hand_is_killed(tmp_path, cluster):
    workers = [cluster.worker() for _ in range(2)]
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

    found = run_suite(job, tmp_path / "out", SuiteOptions(scheduler=cluster.address), show=killing)
    assert workers[0].wait() == -signal.SIGKILL and workers[1].poll() is None
    assert found.made == found.runs == 15 and found.failures == {}
    assert differing(alone.summary, found.summary) == []


def _journal_size(out):
    journal = out / JOURNAL
    return journal.stat().st_size if journal.exists() else 0


def group_ends(group: int, seconds: float) -> bool:
    """Whether nobody of a group of processes is left in time."""
    limit = time.perf_counter() + seconds
    while time.perf_counter() < limit:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.slow
def test_two_processes_give_the_bits_of_one_and_signals_end_them(tmp_path):
    job = write_job(tmp_path, records=40, suite=SUITE)
    alone = run_suite(romdam.load_config(job), tmp_path / "alone", SuiteOptions(workers=1))
    out = tmp_path / "out"
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        before = _journal_size(out)
        running = subprocess.Popen(
            command(job, out, "--workers", 2), stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        while _journal_size(out) == before and running.poll() is None:
            time.sleep(0.01)
        os.killpg(running.pid, number)  # as a terminal does: to every process
        _, stderr = running.communicate(timeout=60)
        assert running.returncode == 128 + number and "Traceback" not in stderr
        assert "what is finished is kept" in stderr and stderr.count("romdam: ") == 1
        assert not (out / "summary.nc").exists() and not list(out.glob("**/.*.part"))
        assert group_ends(running.pid, 10.0)
    subprocess.run(command(job, out, "--workers", 2), check=True)
    assert differing(alone.summary, summary(out)) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "version", "part"),
    [
        ("sys.modules['romdam'] = None", "", "romdam is not there"),
        ("pass", "0.0.9", f"romdam is 0.0.9, here {romdam.__version__}"),
        ("pass", romdam.__version__, "the code of romdam is "),
        ("import numba; numba.__version__ = '0.1'", "", "numba is 0.1, here "),
        ("import platform; platform.python_version = lambda: '3.9.1'", "", "Python is 3.9, here "),
    ],
)
def test_worker_with_other_code_is_refused_before_the_first_task(tmp_path, cluster, first, version, part):
    job = write_job(tmp_path, records=1, suite=SUITE)
    cluster.worker()
    other = {"PYTHONPATH": other_romdam(tmp_path / "other", version)} if version else {}
    cluster.worker(first=first, **other)
    with distributed.Client(cluster.address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=30)
    code, message = refused(job, tmp_path / "out", cluster.address)
    assert code == 2 and part in message and f"--scheduler {cluster.address}: worker tcp://" in message
    assert _journal_size(tmp_path / "out") == 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_suite_goes_on_after_its_scheduler_was_lost(tmp_path, cluster, number):
    cluster.worker()
    job = write_job(tmp_path, records=10, suite=SUITE)
    out = tmp_path / "out"
    running = subprocess.Popen(
        command(job, out, "--scheduler", cluster.address), stderr=subprocess.PIPE, text=True
    )
    while _journal_size(out) == 0 and running.poll() is None:
        time.sleep(0.01)
    cluster.scheduler.send_signal(number)
    _, message = running.communicate(timeout=30)
    assert running.returncode == 1 and "the scheduler is lost" in message and "Traceback" not in message
    kept = len(read_rows(out / JOURNAL))
    assert 0 < kept < 30 and not list(out.glob(".*.part"))
    again = run_suite(romdam.load_config(job), out, SuiteOptions(workers=1))
    alone = run_suite(romdam.load_config(job), tmp_path / "alone", SuiteOptions(workers=1))
    assert 30 - kept >= again.made > 0 and differing(alone.summary, again.summary) == []


@pytest.mark.slow
def test_relative_paths_serve_workers_that_are_elsewhere(tmp_path, cluster, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    cluster.worker(first=f"os.chdir({str(tmp_path / 'elsewhere')!r})")
    write_job(tmp_path / "jobs", records=1, suite=SUITE | {"keep": "full"})
    monkeypatch.chdir(tmp_path)
    job = romdam.load_config("jobs/suite.yaml")
    outcome = run_suite(job, "out", SuiteOptions(scheduler=cluster.address))
    assert outcome.failures == {} and len(list(tmp_path.glob("out/runs/*__*.nc"))) == 3


@pytest.fixture
def small_cluster():
    """A scheduler with one worker in this process."""
    settings = {"processes": False, "dashboard_address": None, "protocol": "tcp"}
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, **settings) as one:
        yield one.scheduler_address


def double(shared: int, task: int) -> int:
    return shared * task


def fail(shared: type[Exception], task: int) -> int:
    raise shared(f"task {task}")


def test_what_the_function_raises_is_told_from_a_lost_cluster(tmp_path, small_cluster):
    with open_pool(None, small_cluster, "romdam", tmp_path) as pool:
        for error in (OSError, TimeoutError):
            with pytest.raises(RuntimeError, match=r"a worker stopped with an error \(task "):
                list(pool.map(fail, error, range(1)))
        with pytest.raises(ConfigError, match="task 0"):
            list(pool.map(fail, ConfigError, range(1)))


def test_worker_that_came_later_and_is_not_fit_ends_the_suite(tmp_path, small_cluster):
    with open_pool(None, small_cluster, "romdam", tmp_path) as pool:
        assert sorted(pool.map(double, 2, range(5))) == [(n, 2 * n) for n in range(5)]
        pool._expected = {**pool._expected, "numba": "0.1"}
        with pytest.raises(WorkerError, match=r"worker tcp://.*: numba is .*, here 0.1; install the same"):
            list(pool.map(double, 2, range(5)))
    assert list(tmp_path.iterdir()) == []


def test_worker_that_does_not_see_the_folder_is_refused(tmp_path, small_cluster, monkeypatch):
    elsewhere = str(tmp_path / "elsewhere")
    monkeypatch.setattr(cluster_module, "_left_in", lambda *_: nullcontext((elsewhere, "")))
    pool = open_pool(None, small_cluster, "romdam", tmp_path)
    with pytest.raises(ConfigError, match=r"worker tcp://.*: does not see the output folder .*elsewhere"):
        pool.__enter__()


def test_shared_data_that_is_not_what_was_written_is_refused(tmp_path):
    with cluster_module._left_in(tmp_path, b"data") as shared:
        Path(shared[0]).write_bytes(b"else")
        with pytest.raises(ResultError, match="is not what was written there"):
            cluster_module.compute(shared, pickle.dumps((double, 1)))


def test_cluster_without_workers_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster_module, "_NO_WORKERS", 0.3)
    with distributed.LocalCluster(
        n_workers=0, dashboard_address=None, processes=False, protocol="tcp"
    ) as one:
        pool = open_pool(None, one.scheduler_address, "romdam", tmp_path)
        with pytest.raises(ConfigError, match=r"--scheduler tcp://127\S+: has no workers, also after 0.3 s"):
            pool.__enter__()


def test_cluster_that_loses_its_last_worker_ends_the_suite(tmp_path, small_cluster, monkeypatch):
    monkeypatch.setattr(cluster_module, "_NO_WORKERS", 0.3)
    monkeypatch.setattr(cluster_module, "_BEAT", 0.1)
    with open_pool(None, small_cluster, "romdam", tmp_path) as pool:
        pool._client.retire_workers()
        with pytest.raises(WorkerError, match=r"has had no workers for 0.3 s; what is finished is kept"):
            list(pool.map(double, 2, range(5)))


def test_proof_runs_where_there_is_no_romdam():
    """The text alone, in a Python that finds no package at all."""
    code = f"exec({inspect.getsource(admission)!r}); print(installed())"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=True
    )
    assert "'romdam': \"not there (No module named 'romdam')\"" in done.stdout


def test_code_that_changed_since_the_process_started_is_told(tmp_path):
    """A worker that has run for weeks holds the code of then."""
    code = (
        "import time, romdam; from romdam.pipelines.suites import admission; found = [admission.installed()];"
        "time.sleep(1.5); open(romdam.__file__, 'a').close(); import os; os.utime(romdam.__file__);"
        "found.append(admission.installed()); print([one['the code of romdam'] for one in found])"
    )
    path = other_romdam(tmp_path, romdam.__version__)
    time.sleep(1.5)
    environment = os.environ | {"PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True
    )
    before, after = ast.literal_eval(done.stdout)
    assert len(before) == 16 and after == "changed on disk since the process started"


def test_code_that_changed_on_both_sides_may_not_be_the_same(tmp_path, monkeypatch):
    (tmp_path / "seen").touch()
    assert admission.problem(admission.installed(), str(tmp_path / "seen")) == ""
    monkeypatch.setattr(admission, "_code", lambda: admission._CHANGED)
    assert "changed on disk" in admission.problem(admission.installed(), str(tmp_path / "seen"))


def listener(answer: bytes | None) -> Iterator[str]:
    """Address of a port that answers whoever calls with these bytes and hangs up; None: says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        calls = []

        def serve() -> None:
            with suppress(OSError):
                while True:
                    call, _ = server.accept()
                    calls.append(call)
                    if answer is not None:
                        call.sendall(answer)
                        call.close()

        threading.Thread(target=serve, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)


ADDRESSES = (
    "", "tcp://", "tls://127.0.0.1:9", "inproc://", "ws://127.0.0.1:9", "tcp://[::1]:9", "tcp://127.0.0.1:0",
    "tcp://127.0.0.1:99999", "127.0.0.1", "tcp://127.0.0.1:abc", "http://127.0.0.1:9", "ucx://127.0.0.1:9",
    "tcp://romdam.invalid:8786", "\0", "tcp://127.0.0.1:9 ",
)  # fmt: skip


@pytest.mark.parametrize("address", ADDRESSES)
def test_address_without_a_scheduler_is_named(address, tmp_path, monkeypatch):
    refuse(address, tmp_path, monkeypatch)


@pytest.mark.parametrize("answer", [None, b"", b"HTTP/1.1 400 Bad Request\r\n\r\n" * 9, b"\xff" * 99])
def test_port_that_answers_anything_else_is_named(answer, tmp_path, monkeypatch):
    for address in listener(answer):
        refuse(address, tmp_path, monkeypatch)


def refuse(address: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "_ANSWER", 0.5)
    began = time.perf_counter()
    with pytest.raises(ConfigError) as error:
        open_pool(None, address, "romdam", folder).__enter__()
    assert str(error.value).startswith(f"--scheduler {address!r}: no dask scheduler answers there (")
    assert "answers there ()" not in str(error.value) and "tcp://192.168.0.1:8786" in str(error.value)
    assert time.perf_counter() - began < 5.0


def test_address_of_a_worker_is_told_from_that_of_the_scheduler(tmp_path, small_cluster):
    with distributed.Client(small_cluster, set_as_default=False) as client:
        (worker,) = client.nthreads()
    with pytest.raises(ConfigError, match="is the address of a dask Worker, give that of the scheduler"):
        open_pool(None, worker, "romdam", tmp_path).__enter__()
