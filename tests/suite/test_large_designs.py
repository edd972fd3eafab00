"""Designs of very many samples: estimated before they are built, or refused with figures."""

import re
import tracemalloc

import numpy as np
import pytest
import xarray as xr
from suite_jobs import made, write_job

import romdam
from romdam.core.errors import ConfigError
from romdam.pipelines.check import check
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.run import Clock, silent
from romdam.pipelines.suites import sizes
from romdam.pipelines.suites.plan import make_plan
from romdam.pipelines.suites.run import run_suite
from romdam.pipelines.suites.tasks import Samples
from romdam.results.suite import design as designs
from romdam.results.suite.design import design_dataset, some_samples, varied_keys

RANGES = {
    "mu": {"path": "joints.gap.friction", "low": 0.2, "high": 0.6},
    "k": {"path": "joints.gap.normal_stiffness", "low": "10 GPa/m", "high": "20 GPa/m"},
}
GRID = {name: parameter | {"count": 1000} for name, parameter in RANGES.items()}
LEVELS = {"mu": {"path": "joints.gap.friction", "values": [0.2, 0.4, 0.6]}}
MOST = 20
ROWS = (".jsonl", ".csv", ".nc")  # files that grow with the runs


@pytest.fixture
def built(monkeypatch):
    """Numbers of the samples whose scene is built."""
    numbers, whole = [], Samples.scene

    def counted(self, job, scene, number):
        numbers.append(number)
        return whole(self, job, scene, number)

    monkeypatch.setattr(Samples, "scene", counted)
    return numbers


@pytest.mark.parametrize(
    ("parameters", "design", "records", "runs"),
    [
        (RANGES, {"latin_hypercube": 1_000_000}, 1, 1_000_000),
        (RANGES, {"monte_carlo": 300_000}, 3, 900_000),
        (RANGES, {"sobol_indices": 2**17}, 1, 4 * 2**17),
        (GRID, "grid", 1, 1_000_000),
        (LEVELS, {"monte_carlo": 200_000}, 2, 6),  # samples that are the same are one
    ],
)
def test_a_plan_of_some_samples_counts_the_runs_of_all(parameters, design, records, runs, built, tmp_path):
    job = romdam.load_config(
        write_job(tmp_path, records=records, suite={"parameters": parameters, "design": design})
    )
    plan = make_plan(job, Clock(silent), most=MOST)
    assert plan.count == runs
    assert len(built) == len(plan.samples.values) <= MOST + 2 * len(parameters)


def test_a_table_of_many_samples_is_counted_too(built, tmp_path):
    rows = [f"{0.2 + 1e-5 * number:.5f}" for number in range(20_000)]
    suite = {"parameters": {"mu": {"path": "joints.gap.friction"}}, "design": {"table": "t.csv"}}
    path = write_job(tmp_path, 1, suite)
    (tmp_path / "t.csv").write_text("\n".join(["mu", *rows, *rows[:5]]))
    assert make_plan(romdam.load_config(path), Clock(silent), most=MOST).count == 20_000
    assert len(built) <= MOST


def test_a_small_design_is_built_whole(built, tmp_path):
    job = romdam.load_config(write_job(tmp_path, 1, {"parameters": RANGES, "design": {"monte_carlo": MOST}}))
    plan = make_plan(job, Clock(silent), most=MOST)
    assert plan.distinct is None and len(built) == plan.count == MOST


def test_some_samples_have_every_least_and_largest_value():
    rng = np.random.default_rng(3)
    values = rng.normal(size=(5, 5000))
    values[2] = np.round(values[2])
    design = xr.Dataset({f"parameter_{k}": ("sample", row) for k, row in enumerate(values)})
    some, distinct = some_samples(design, 30)
    assert distinct == 5000 and some.sizes["sample"] <= 30 + 10
    for k, row in enumerate(values):
        chosen = some[f"parameter_{k}"].values
        assert chosen.min() == row.min() and chosen.max() == row.max()


def test_what_a_sample_at_the_end_of_a_range_is_refused_for_is_found_among_many(tmp_path):
    """Water above the top of the dam's joint is refused by the least or the largest level alone."""
    parameters = {
        "mu": {"path": "joints.gap.friction", "low": 0.2, "high": 0.6},
        "level": {"path": "loads.joint_water.0.level", "low": "-30 m", "high": "15 m"},
    }
    loads = {"joint_water": [{"joints": ["gap"], "level": "10 m"}]}
    path = write_job(tmp_path, 1, {"parameters": parameters, "design": {"monte_carlo": 100_000}}, loads=loads)
    with pytest.raises(ConfigError, match=r"level.*\(suite.parameters: sample \d+"):
        make_plan(romdam.load_config(path), Clock(silent), most=MOST)


def test_too_many_runs_for_the_memory_are_refused_before_samples_are_built(built, tmp_path, monkeypatch):
    monkeypatch.setattr(sizes, "memory_limit", lambda limit: 1e9)
    job = romdam.load_config(
        write_job(tmp_path, 1, {"parameters": RANGES, "design": {"monte_carlo": 500_000}})
    )
    with pytest.raises(
        ConfigError, match=r"suite.yaml.*: suite: 500000 runs with 8 gaps take about"
    ) as refused:
        run_suite(job, tmp_path / "out")
    assert not built and "limit 1.0 GB" in str(refused.value)
    (most,) = re.findall(r"make (\S+) runs at most", str(refused.value))
    scene = scene_of(romdam.load_config(tmp_path / "suite.yaml"))
    assert sizes.summary_bytes(scene, float(most)) <= 1.05e9


def test_random_numbers_that_do_not_fit_in_memory_are_not_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(designs, "memory_limit", lambda limit: 1e8)
    suite = {"parameters": RANGES, "design": {"latin_hypercube": 800_000}}
    job = romdam.load_config(write_job(tmp_path, 1, suite))
    message = r"suite.design: 800000 samples of 2 parameters take about 0.1 GB.*take 6.2e\+05 samples"
    with pytest.raises(ConfigError, match=message):
        design_dataset(job, job.config.suite, varied_keys(job, job.config.suite))


@pytest.mark.parametrize(
    "design", [{"latin_hypercube": 40_000}, {"monte_carlo": 40_000}, {"sobol_indices": 8192}]
)
def test_memory_of_the_drawing_is_as_estimated(design, tmp_path):
    suite = {"parameters": RANGES, "design": design}
    if "sobol_indices" not in design:
        suite["correlation"] = {"pairs": [{"between": ["mu", "k"], "value": 0.5}]}
    job = romdam.load_config(write_job(tmp_path, 1, suite))
    places = varied_keys(job, job.config.suite)
    design_dataset(job, job.config.suite, places)  # what is loaded by the way
    tracemalloc.start()
    try:
        samples = design_dataset(job, job.config.suite, places).sizes["sample"]
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert 0.25 < peak / (designs._COPIES * 8.0 * samples * len(RANGES)) < 1.0


@pytest.mark.slow
def test_disk_and_time_of_a_suite_are_those_of_its_rows(tmp_path):
    """By the difference of two suites, so that what does not grow with the runs is out of it."""
    disk, runs = [], (20, 80)
    for count in runs:
        path = write_job(tmp_path / str(count), 1, {"parameters": RANGES, "design": {"monte_carlo": count}})
        made(path, tmp_path / str(count) / "out")
        files = [
            file
            for file in (tmp_path / str(count) / "out").iterdir()
            if file.suffix in (".jsonl", ".csv", ".nc")
        ]
        disk.append(sum(file.stat().st_size for file in files))
    small, large = (check(romdam.load_config(tmp_path / str(count) / "suite.yaml")) for count in runs)
    assert 0.6 < (large.file_size - small.file_size) / (disk[1] - disk[0]) < 1.6
    assert large.costs["integration"] > 2.0 * small.costs["integration"]
    assert large.costs["results"] == pytest.approx(4.0 * small.costs["results"])
