"""Libraries keep to one thread but where more pay; no bit of a job depends on what they may start."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest
from scipy import linalg
from threadpoolctl import threadpool_info, threadpool_limits

import romdam
from romdam.core import threads
from romdam.core.threads import DENSE_EIGENPROBLEM, one_thread, threads_for
from romdam.linalg.dense import eigh

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


@pytest.fixture
def quick_job():
    """The main job with 60 modes a block, for a second."""
    job = romdam.load_config(ROOT / "configs" / "two_cantilevers.yaml")
    config = job.config
    quick = config.model_copy(
        update={
            "outputs": config.outputs.model_copy(update={"plots": False, "error_estimate": False}),
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
