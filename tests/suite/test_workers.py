"""Worker processes: every task gets its answer, whatever happens to the workers."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from romdam.core.errors import RecordError, WorkerError
from romdam.pipelines.suites.cluster import open_pool
from romdam.pipelines.suites.workers import LocalPool, WorkerDied


def square(shared: int, task: int) -> int:
    return shared * task**2


def die_once(folder: str, task: int) -> int:
    """The first worker that gets task 2 kills itself."""
    mark = os.path.join(folder, "died")
    if task == 2 and not os.path.exists(mark):
        open(mark, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return task


def die(shared: int, task: int) -> int:
    """Every worker that gets the task `shared` kills itself."""
    if task == shared:
        os.kill(os.getpid(), signal.SIGKILL)
    return task


def refuse(shared: type[Exception], task: int) -> int:
    raise shared(f"task {task}")


def sleep(shared: list[float], task: int) -> int:
    """So many seconds for the first task, and for each of the others."""
    time.sleep(shared[min(task, 1)])
    return task


def test_every_task_is_made_once_and_told_with_its_number():
    assert sorted(LocalPool(2).map(square, 3, range(7))) == [(i, 3 * i * i) for i in range(7)]
    assert list(LocalPool(2).map(square, 3, [])) == []


def test_what_imports_pass_over_in_the_path_is_passed_over(monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, Path("/nowhere")])
    assert list(LocalPool(1).map(square, 3, [2])) == [(0, 12)]


def test_a_task_whose_worker_is_killed_is_made_again(tmp_path):
    assert sorted(LocalPool(2).map(die_once, str(tmp_path), range(5))) == [(i, i) for i in range(5)]
    assert (tmp_path / "died").exists()


def test_a_task_that_kills_every_worker_fails_alone():
    found = dict(LocalPool(2).map(die, 1, range(4)))
    lost = found.pop(1)
    assert isinstance(lost, WorkerDied) and str(lost) == "exit code -9, 3 times"
    assert found == {0: 0, 2: 2, 3: 3}


def test_what_the_function_raises_is_raised_here():
    with pytest.raises(RecordError, match="task 0"):
        list(LocalPool(1).map(refuse, RecordError, range(2)))


@pytest.mark.parametrize("error", [ValueError, OSError, EOFError])
def test_any_other_error_ends_the_worker_with_its_traceback(error, capfd):
    with pytest.raises(RuntimeError, match="its traceback stands above"):
        list(LocalPool(1).map(refuse, error, range(2)))
    assert f"{error.__name__}: task 0" in capfd.readouterr().err


def test_workers_end_when_nobody_asks_for_more():
    psutil = pytest.importorskip("psutil")
    asked = LocalPool(2).map(sleep, [0.0, 0.0], range(100))
    next(asked)
    busy = {one for one in psutil.Process().children(recursive=True) if one.status() != "zombie"}
    asked.close()
    left = {one for one in psutil.Process().children(recursive=True) if one.status() != "zombie"}
    assert len(busy - left) >= 3, "two that work, and what they are forked from"


SCRIPT = """
import os, sys, time
from romdam.pipelines.suites.workers import LocalPool
from romdam.surroundings import hear_signals
from test_workers import sleep
hear_signals()
for number, result in LocalPool(2).map(sleep, [0.0, 60.0], range(1000)):
    print(os.getpid(), flush=True)
"""


@pytest.fixture
def busy_family(tmp_path):
    """A process whose workers are at tasks of a minute, and all that it has started."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path])}
    process = subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, text=True
    )
    assert process.stdout is not None and int(process.stdout.readline()) == process.pid
    family = children(process.pid)
    assert len(family) == 3, "one that loads, two that work"
    yield process, family
    for one in family:
        with suppress(ProcessLookupError):
            os.kill(one, signal.SIGKILL)


def seconds_until_gone(family: list[int]) -> float:
    began = time.perf_counter()
    while any(os.path.exists(f"/proc/{one}") for one in family) and time.perf_counter() - began < 20.0:
        time.sleep(0.02)
    return time.perf_counter() - began


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGKILL,
        pytest.param(signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param(signal.SIGHUP, marks=pytest.mark.slow),
    ],
)
def test_workers_end_at_once_with_their_parent(busy_family, number):
    process, family = busy_family
    process.send_signal(number)
    _, message = process.communicate(timeout=20.0)
    assert process.returncode == (-number if number == signal.SIGKILL else 1)
    assert number == signal.SIGKILL or f"Signalled: stopped by {number.name}; what is finished" in message
    assert seconds_until_gone(family) < 5.0


def test_worker_ends_after_its_task_where_the_one_it_comes_from_was_killed(tmp_path):
    psutil = pytest.importorskip("psutil")
    asked = LocalPool(2).map(sleep, [0.0, 1.0], range(100))
    next(asked)
    (nursery,) = (one for one in psutil.Process().children() if len(one.children()) == 2)
    family = [one.pid for one in nursery.children()]
    nursery.kill()
    with pytest.raises(WorkerError, match="with more memory or fewer --workers where it was killed"):
        list(asked)
    assert len(family) == 2 and seconds_until_gone(family) < 5.0


def children(process: int) -> list[int]:
    """Processes started by a process, and theirs."""
    psutil = pytest.importorskip("psutil")
    return [one.pid for one in psutil.Process(process).children(recursive=True)]


def test_one_worker_runs_here(tmp_path):
    with open_pool(1, None, "romdam", tmp_path) as pool:
        assert list(pool.map(square, 2, [3])) == [(0, 18)]
