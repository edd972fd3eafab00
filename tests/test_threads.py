"""Libraries keep to one thread but where more pay; no bit of a job depends on what they may start."""

import os
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest
import threadpoolctl
import yaml
from scipy import linalg
from scipy.sparse import csr_matrix, diags_array
from threadpoolctl import threadpool_info, threadpool_limits

import romdam
from romdam.config.load import Job, parse_config
from romdam.core import threads
from romdam.core.errors import ConvergenceError, WriteError
from romdam.core.threads import (
    BESIDE,
    DENSE_EIGENPROBLEM,
    at_once,
    cpu_time,
    helpers,
    in_background,
    one_thread,
    side_by_side,
    threads_for,
)
from romdam.linalg.dense import eigh
from romdam.linalg.multifrontal import Multifrontal
from romdam.pipelines import run as pipeline
from romdam.timestepping.modal.loop import integrate

ROOT = Path(__file__).parents[1]


def allowed() -> set[int]:
    """Threads that the BLAS libraries of this process may start."""
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


CORES = threads.cores


@pytest.fixture(autouse=True)
def four_cores(monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: 4)
    with threadpool_limits(4, user_api="blas"):
        yield
        assert allowed() == {4}, "what was there before comes back"


def test_a_job_has_one_thread_and_large_work_as_many_as_its_size_pays_for():
    with one_thread():
        assert allowed() == {1}
        for unknowns, count in [(99, 1), (100, 2), (250, 3), (10_000, 4)]:
            with threads_for(unknowns, 100):
                assert allowed() == {count}
            assert allowed() == {1}
        with one_thread():
            pass
        assert allowed() == {1}, "a job within a job ends with the outer one"
    assert allowed() == {4}


def test_what_the_user_allows_is_not_exceeded():
    with threadpool_limits(2, user_api="blas"):
        with one_thread(), threads_for(10_000, 100):
            assert allowed() == {2}
        assert allowed() == {2}


def test_libraries_are_listed_again_once_a_module_has_come(monkeypatch):
    listed, real = [], threadpoolctl.ThreadpoolController
    monkeypatch.setattr(threadpoolctl, "ThreadpoolController", lambda: listed.append(1) or real())
    monkeypatch.setattr(threads, "_libraries", {})
    with one_thread():
        for _ in range(3):
            with threads_for(1, 100):
                pass
        assert len(listed) == 1
        monkeypatch.setitem(sys.modules, "a_module_with_a_library", threads)
        with threads_for(1, 100):
            assert len(listed) == 2
    with one_thread():
        assert len(listed) == 2, "another job has the same libraries"
        assert allowed() == {1}, "what another job has set is not relied on"


def test_outside_a_job_nothing_is_changed():
    with threads_for(10_000, 100):
        assert allowed() == {4}


def test_an_error_leaves_what_was_before():
    with pytest.raises(ZeroDivisionError), one_thread(), threads_for(10_000, 100):
        _ = 1 / 0


def test_jobs_that_share_a_process_stay_at_one_and_the_last_gives_back():
    both, turns = Barrier(2), [Barrier(2), Barrier(2)]

    def job(number: int) -> set[int]:
        with one_thread():
            both.wait()
            with threads_for(10_000, 100):
                found = allowed()
                both.wait()
            if number:
                turns[0].wait()  # the first one has ended
                assert allowed() == {1}
        if not number:
            turns[0].wait()
        return found

    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(job, range(2))) == [{1}, {1}]


def test_eigenpairs_are_those_of_scipy_and_large_ones_have_more_threads(monkeypatch):
    seen, real = [], linalg.eigh

    def watched(*given, **options):
        seen.append(allowed())
        return real(*given, **options)

    monkeypatch.setattr(linalg, "eigh", watched)
    monkeypatch.setattr("romdam.linalg.dense.DENSE_EIGENPROBLEM", 40)
    A = np.random.default_rng(0).standard_normal((40, 40))
    K, M = A + A.T, A @ A.T + 40.0 * np.eye(40)
    with one_thread():
        values, vectors = eigh(K, M)
        eigh(K[:39, :39])
        mixed, _ = eigh(K, M, kind=2)
    assert seen == [{2}, {1}, {2}]
    assert np.allclose(K @ vectors, M @ vectors * values, atol=1e-10)
    assert np.allclose(np.sort(np.linalg.eigvals(K @ M).real), mixed)


def test_a_run_has_the_same_bits_whatever_the_libraries_may_start(tmp_path, quick_job):
    """Dense eigenproblems of 200 unknowns and more differ in their last bits between one thread and two."""
    made = []
    for count in (1, 2, 4):
        with threadpool_limits(count, user_api="blas"):
            (path,) = romdam.run(quick_job, tmp_path / str(count)).paths
        made.append(romdam.open_result(path).dataset)
    assert made[0].sizes["mode"] < DENSE_EIGENPROBLEM
    for other in made[1:]:
        for name in ("opening", "reduced_coordinates"):
            assert np.array_equal(made[0][name], other[name])


def test_tasks_keep_their_order_and_two_are_worked_on_at_once():
    both = Barrier(2, timeout=60.0)

    def task(number: int) -> int:
        both.wait()  # a task alone would wait for ever
        assert helpers() == 1, "a task has no helpers of its own"
        return number

    with one_thread():
        assert helpers() == 2
        assert list(side_by_side(partial(task, k) for k in range(6))) == list(range(6))


def test_an_error_of_a_task_comes_in_its_turn():
    def task(number: int) -> float:
        return 1 / (number - 3)

    with one_thread():
        made = side_by_side(partial(task, k) for k in range(6))
        assert [next(made) for _ in range(3)] == [-1 / 3, -0.5, -1.0]
        with pytest.raises(ZeroDivisionError):
            next(made)


def test_a_task_beside_the_body_goes_on_with_it_and_ends_before():
    body, ended = threading.Event(), []

    def task() -> str:
        assert body.wait(60.0)
        ended.append(1)
        return "made"

    with one_thread():
        with in_background(task, BESIDE) as made:
            body.set()
            assert made() == made() == "made"
        with pytest.raises(KeyError), in_background(partial(ended.append, 2), BESIDE):
            raise KeyError
        assert ended == [1, 2]
        with in_background(partial(divmod, 1, 0), BESIDE) as failing:
            for _ in range(2):
                with pytest.raises(ZeroDivisionError):
                    failing()


def test_two_tasks_are_worked_on_at_once_and_the_first_error_waits_for_the_other():
    both, ended = Barrier(2, timeout=10.0), list[int]()

    def task(k: int) -> int:
        both.wait()
        return k

    def failing() -> None:
        both.wait()
        raise ValueError("first")

    def late() -> None:
        both.wait()
        time.sleep(0.05)
        ended.append(1)

    with one_thread():
        assert at_once(partial(task, 1), partial(task, 2), BESIDE) == (1, 2)
        with pytest.raises(ValueError, match="first"):
            at_once(failing, late, BESIDE)
        assert ended == [1]
        with pytest.raises(ValueError, match="first"):
            at_once(late, failing, BESIDE)


def test_one_thread_that_the_user_allows_does_everything_itself():
    with threadpool_limits(1, user_api="blas"), one_thread():
        assert set(side_by_side([threading.get_ident] * 4)) == {threading.get_ident()}
        with in_background(threading.get_ident, BESIDE) as made:
            assert made() == threading.get_ident()


def test_tasks_of_a_small_model_are_done_first():
    with one_thread():
        own = threading.get_ident()
        assert at_once(threading.get_ident, threading.get_ident, BESIDE - 1) == (own, own)
        assert at_once(threading.get_ident, threading.get_ident, BESIDE) != (own, own)
        with in_background(threading.get_ident, BESIDE - 1) as made:
            assert made() == threading.get_ident()
        with in_background(threading.get_ident, BESIDE) as made:
            assert made() != threading.get_ident()


def test_cpu_of_what_worked_for_a_thread_is_its_own():
    def task() -> None:
        start = time.thread_time()
        while time.thread_time() < start + 0.05:
            pass

    with one_thread():
        start, alone = cpu_time(), time.thread_time()
        list(side_by_side([task] * 4))
        assert cpu_time() - start >= 0.2 > time.thread_time() - alone
        start = cpu_time()
        at_once(task, task, BESIDE)
        assert cpu_time() - start >= 0.1
        start = cpu_time()
        with in_background(task, BESIDE):
            pass
        assert cpu_time() - start < 0.05, "what goes on beside it has a clock of its own"


def test_columns_have_the_same_bits_on_one_thread_and_two():
    n = 400
    A = csr_matrix(diags_array([-np.ones(n - 1), 2.1 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1]))
    right = np.random.default_rng(0).standard_normal((n, 150))
    solver = Multifrontal(A, np.arange(n))
    with one_thread():
        two = solver.solve(right)
    assert np.array_equal(two, solver.solve(right))
    assert np.abs(A @ two - right).max() < 1e-12


def test_the_time_loop_lets_other_threads_go_on():
    assert integrate.targetoptions["nogil"]


@pytest.fixture
def arch_job():
    """A small arch dam on light rock, above the size from which fronts factor it, for two seconds."""
    path = ROOT / "configs" / "arch_dam.yaml"
    raw = yaml.safe_load(path.read_text())
    dam = raw["arch_dam"]
    dam["divisions"] |= {"along": 2, "up": 3, "rock": 2, "upstream": 2, "downstream": 2, "through": 1}
    raw["outputs"]["plots"] = False
    raw["transient"]["duration"] = "2 s"
    return Job(parse_config(raw, path.name), path)


@pytest.mark.slow
def test_an_arch_dam_has_the_same_bits_on_one_thread_and_two(tmp_path, arch_job, monkeypatch):
    """Its reduction, stress and estimate work on two cores; files beside it are named by content."""
    monkeypatch.setattr(threads, "BESIDE", 0)
    made = []
    for count in (1, 2):
        with threadpool_limits(count, user_api="blas"):
            (path,) = romdam.run(arch_job, tmp_path / str(count)).paths
        made.append(romdam.open_result(path).dataset)
    one, two = made
    assert one.attrs["model_file"] == two.attrs["model_file"]
    assert one.attrs["stress_file"] == two.attrs["stress_file"]
    for name in one.data_vars:
        assert np.array_equal(one[name], two[name], equal_nan=one[name].dtype.kind == "f"), name
    assert one.attrs["error_estimate"] == two.attrs["error_estimate"]


@pytest.mark.parametrize("least", [0, pytest.param(threads.BESIDE, marks=pytest.mark.slow)])
def test_what_is_written_beside_the_march_fails_as_before_it(tmp_path, quick_job, monkeypatch, least):
    """The error is that of the whole job, not of one record, also where the march has failed meanwhile."""
    monkeypatch.setattr(threads, "BESIDE", least)

    def full(*_: object, **__: object) -> None:
        raise WriteError("the disk is full")

    monkeypatch.setattr(pipeline, "write_shared", full)
    with pytest.raises(WriteError, match="the disk is full"):
        romdam.run(quick_job, tmp_path)

    def stuck(*_: object) -> None:
        raise ConvergenceError("step 3 did not converge")

    monkeypatch.setattr(pipeline, "simulate_motion", stuck)
    with pytest.raises(WriteError, match="the disk is full"):
        romdam.run(quick_job, tmp_path)
    monkeypatch.setattr(pipeline, "write_shared", lambda *_, **__: {})
    with pytest.raises(ConvergenceError):
        romdam.run(quick_job, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == []


@pytest.fixture
def quick_job():
    """The main job with 60 modes a block, for a second."""
    job = romdam.load_config(ROOT / "configs" / "two_cantilevers.yaml")
    config = job.config
    quick = config.model_copy(
        update={
            "outputs": config.outputs.model_copy(
                update={"plots": False, "error_estimate": False, "mesh_error": False}
            ),
            "transient": config.transient.model_copy(update={"duration": 1.0}),
        }
    )
    return type(job)(quick, job.path)


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({"cpu.max": "150000 100000\n"}, 2),
        ({"cpu.max": "max 100000\n"}, 64),
        ({"cpu.max": ""}, 64),
        ({"cpu/cpu.cfs_quota_us": "400000\n", "cpu/cpu.cfs_period_us": "100000\n"}, 4),
        ({"cpu/cpu.cfs_quota_us": "-1\n", "cpu/cpu.cfs_period_us": "100000\n"}, 64),
        ({}, 64),
    ],
)
def test_limit_of_a_container_is_kept(tmp_path, files, cores):
    (tmp_path / "cpu").mkdir()
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert threads.limit_of_container(tmp_path, 64) == cores


def test_cores_are_counted_where_there_is_no_affinity(monkeypatch):
    monkeypatch.delattr("os.sched_getaffinity")
    assert 1 <= CORES() <= (os.cpu_count() or 1)
