"""Worker processes: every task gets its answer, whatever happens to the workers."""

import os
import signal
import subprocess
import sys
import time

import pytest

from romdam.errors import RecordError
from romdam.pipelines.cluster import open_pool
from romdam.pipelines.workers import LocalPool, WorkerDied


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


def sleep(shared: float, task: int) -> int:
    time.sleep(shared)
    return task


def test_every_task_is_made_once_and_told_with_its_number():
    assert sorted(LocalPool(2).map(square, 3, range(7))) == [(i, 3 * i * i) for i in range(7)]
    assert list(LocalPool(2).map(square, 3, [])) == []


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


def test_any_other_error_ends_the_worker_with_its_traceback():
    with pytest.raises(RuntimeError, match="its traceback stands above"):
        list(LocalPool(1).map(refuse, ValueError, range(2)))


def test_workers_end_when_nobody_asks_for_more():
    psutil = pytest.importorskip("psutil")
    asked = LocalPool(2).map(sleep, 0.0, range(100))
    next(asked)
    busy = {one for one in psutil.Process().children(recursive=True) if one.status() != "zombie"}
    asked.close()
    left = {one for one in psutil.Process().children(recursive=True) if one.status() != "zombie"}
    assert len(busy - left) >= 2  # what they are forked from stays


SCRIPT = """
import os, sys, time
from romdam.pipelines.workers import LocalPool
from test_workers import sleep
if __name__ == "__main__":
    for number, result in LocalPool(2).map(sleep, 0.2, range(1000)):
        print(os.getpid(), flush=True)
"""


def test_workers_end_when_their_parent_is_killed(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    here = os.path.dirname(__file__)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([here, *sys.path])}
    process = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, env=environment, text=True)
    assert process.stdout is not None and int(process.stdout.readline()) == process.pid
    family = children(process.pid)
    process.kill()
    process.wait()
    limit = time.perf_counter() + 20.0
    while any(os.path.exists(f"/proc/{one}") for one in family) and time.perf_counter() < limit:
        time.sleep(0.05)
    assert len(family) >= 3 and not any(os.path.exists(f"/proc/{one}") for one in family)


def children(process: int) -> list[int]:
    """Processes started by a process, and theirs."""
    psutil = pytest.importorskip("psutil")
    return [one.pid for one in psutil.Process(process).children(recursive=True)]


def test_one_worker_runs_here(tmp_path):
    with open_pool(1, None, "romdam", tmp_path) as pool:
        assert list(pool.map(square, 2, [3])) == [(0, 18)]
