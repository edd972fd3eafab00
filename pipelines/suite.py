"""A suite from a configuration to its summary: records x scales x samples on one reduced model."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from romdam.config.load import Job
from romdam.config.parameters import Place, vary
from romdam.config.suite import KeepConfig, SuiteConfig
from romdam.errors import ConfigError, RecordError
from romdam.fem.gaps import gap_law
from romdam.files import prepare_folder, sweep_parts
from romdam.outputs.dataset import write_dataset
from romdam.outputs.design import design_dataset, parameter_places
from romdam.outputs.suite import (
    CACHE_FOLDER,
    DESIGN,
    ROWS_FOLDER,
    RUNS_FOLDER,
    SuiteRecord,
    intensity,
    summary_dataset,
    write_summary,
)
from romdam.outputs.suite_rows import Row, write_rows
from romdam.pipelines.cluster import Pool, open_pool
from romdam.pipelines.run import Clock, Model, Stage, settled, silent, with_finer, write_shared
from romdam.pipelines.shaking import check_interval
from romdam.pipelines.stresses import stress_fields
from romdam.pipelines.suite_plan import divide, finished, plan_runs, row_bytes, tasks_of, written_rows
from romdam.pipelines.suite_runs import Run, Study, Task, run_task, sample_scene
from romdam.records.motion import GroundMotion
from romdam.records.tolerant import load_each
from romdam.reduction.store import BlockStore
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.scene.model import Scene

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SuiteOptions:
    """Where a suite computes.

    Attributes
    ----------
    workers : processes on this machine, one for each core if not given
    scheduler : address of a dask scheduler, instead
    cache : folder of reduced blocks; that of the configuration, or `cache` in the output folder, if not given
    """

    workers: int | None = None
    scheduler: str | None = None
    cache: Path | None = None


@dataclass(frozen=True)
class SuiteOutcome:
    """What a suite has come to.

    Attributes
    ----------
    path : of the summary
    summary : the summary
    runs, made : all runs, and those of them that this call made
    failures : name of a record or a run -> message
    """

    path: Path
    summary: xr.Dataset
    runs: int
    made: int
    failures: dict[str, str]


def run_suite(
    job: Job,
    out: str | Path,
    options: SuiteOptions | None = None,
    show: Stage = silent,
    tell: Callable[[str], None] = log.info,
) -> SuiteOutcome:
    """Make every run of a suite that is not there yet, and the summary of all.

    Parameters
    ----------
    job : a configuration with `pipeline: suite`
    out : folder, made if needed; what is finished there is kept
    show : told of every stage and its progress
    tell : told what is going to be made, and its size, before it is

    Raises
    ------
    RomdamError
        for bad input, and where the disk refuses a file; a run or record that fails becomes a failed row.
    """
    job, options, clock = _suite_job(job), options or SuiteOptions(), Clock(show)
    folder = prepare_folder(Path(out).absolute())
    one_thread = threadpool_limits(limits=1)  # the bits of a result must not depend on the number of cores
    with one_thread, open_pool(options.workers, options.scheduler, run_task.__module__, folder) as pool:
        with clock.stage("records", "reading records"):
            records = read_records(job)
        job = settled(job, [record.motion for record in records if record.motion is not None], clock)
        places = parameter_places(job, _suite(job))
        design = design_dataset(job, _suite(job), places)
        write_dataset(design, folder / DESIGN)
        study = build_study(job, (places, design), folder, options.cache, clock)
        rows, made = _make_missing(study, records, folder, (pool, clock, tell))
    with clock.stage("summary", "writing the summary"):
        summary = summary_dataset(job, study.model.scene, design, records, rows)
        path = write_summary(summary, folder)
    return SuiteOutcome(path, summary, summary.status.size, made, _failures(records, rows))


def _suite(job: Job) -> SuiteConfig:
    return job.config.suite or SuiteConfig()


def _suite_job(job: Job) -> Job:
    """The job with what its suite implies for the single runs.

    Raises
    ------
    ConfigError
        for a full-order model, and an output interval that the step does not divide.
    """
    suite, config = _suite(job), job.config
    if config.model.order == "full":
        raise ConfigError(
            f"{job.path}: model.order: a suite needs a reduced model, got full; set order: reduced, "
            "or use pipeline: run"
        )
    outputs = config.outputs
    if isinstance(suite.keep, KeepConfig):
        outputs = outputs.model_copy(update={"every": suite.keep.every})
    job = replace(job, config=config.model_copy(update={"suite": suite, "outputs": outputs}))
    check_interval(job)
    return job


def read_records(job: Job) -> list[SuiteRecord]:
    """Every record of a suite with its scale factors, those that cannot be used too.

    Raises
    ------
    RecordError
        where no record can be used.
    """
    suite = _suite(job)
    records = []
    for one in load_each(job.config.records, job.folder):
        factors = np.full(len(suite.scales), np.nan)
        message = one.error
        if one.motion is not None:
            factors, message = _factors(suite, one.motion)
        records.append(SuiteRecord(one.name, None if message else one.motion, message, factors))
    if all(record.motion is None for record in records):
        raise RecordError("\n".join(f"{record.name}: {record.message}" for record in records))
    return records


def _factors(suite: SuiteConfig, motion: GroundMotion) -> tuple[np.ndarray, str]:
    """What a record is multiplied by at each scale; or why it cannot be scaled."""
    target = suite.intensities
    if target is None:
        return np.array(suite.scales), ""
    has = intensity(motion, target.measure, target.period, target.damping)
    if has <= 0.0:
        nothing = np.full(len(target.values), np.nan)
        return nothing, f"{motion.name}: cannot be scaled to {target.measure}, it does not move"
    return np.array(target.values) / has, ""


def build_study(
    job: Job, design: tuple[dict[str, Place], xr.Dataset], folder: Path, cache: Path | None, clock: Clock
) -> Study:
    """Scene and reduced model, once for all samples."""
    places, table = design
    samples = tuple(
        {name: float(table[name].values[i]) for name in places} for i in range(table.sizes["sample"])
    )
    with clock.stage("scene", "building the scene"):
        scene = _roughest(job, build_scene(job.config, job.folder, str(job.path)), places, samples)
    own = _suite(job).cache
    store = BlockStore(cache or (job.folder / own if own else folder / CACHE_FOLDER))
    with clock.stage("model", "reducing the blocks"):
        reduced = reduce_scene(scene, job.config.model, job.config.damping, store)
    model = with_finer(job, Model(scene, reduced.system, reduced), clock, store)
    model = replace(model, stress=stress_fields(scene, reduced))
    job = replace(job, path=job.path.absolute())  # a worker of a cluster has a working folder of its own
    study = Study(job, model, places, samples, folder / RUNS_FOLDER, {})
    if study.keeps_results:
        study = replace(study, files=write_shared(prepare_folder(study.folder), model))
    return study


def _roughest(job: Job, scene: Scene, places: dict[str, Place], samples: Sequence[dict[str, float]]) -> Scene:
    """The scene with the joints of a sample with shear, if there is one: its basis serves all samples."""
    for values in samples if places else ():
        varied = sample_scene(job, scene, vary(job.config, places, values, str(job.path)))
        if gap_law(varied).directions == 3:
            return varied
    return scene


def _make_missing(
    study: Study,
    records: Sequence[SuiteRecord],
    folder: Path,
    means: tuple[Pool, Clock, Callable[[str], None]],
) -> tuple[list[Row], int]:
    """Rows of all runs, and how many had to be made."""
    pool, clock, tell = means
    motions = {record.name: record.motion for record in records if record.motion is not None}
    with clock.stage("plan", "looking for finished runs"):
        runs = plan_runs(study, records)
        done = finished(study, folder, runs)
        tasks = tasks_of(divide(study, runs, motions), done, motions)
    tell(_announcement(study, runs, motions, len(done), folder))
    sweep_parts(prepare_folder(folder / ROWS_FOLDER))
    sweep_parts(study.folder)
    sweep_parts(folder)
    rows = list(done.values())
    with clock.stage("runs", f"{len(runs) - len(done)} runs") as progress:
        for number, found in pool.map(run_task, study, tasks):
            rows += _land(tasks[number], found, folder)
            progress(len(rows) - len(done), len(runs) - len(done))
    return rows, len(runs) - len(done)


def _land(task: Task, found: list[Row] | Exception, folder: Path) -> list[Row]:
    """Write the rows of a task; those of one whose workers died are left to be made again."""
    if isinstance(found, Exception):
        message = f"its workers died, {found}; lower suite.batch, or give the workers more memory"
        return [Row(run.record, run.scale, run.sample, run.key, message) for run in task.runs]
    write_rows(found, folder / ROWS_FOLDER / f"{task.name}.nc")
    return found


def _announcement(
    study: Study, runs: Sequence[Run], motions: dict[str, GroundMotion], done: int, folder: Path
) -> str:
    """What is going to be made."""
    gaps, joints = len(study.model.system.law), len(study.model.scene.joints)
    size = len(runs) * (12.0 * gaps + 8.0 * (8 * joints + 20 + 3 * len(study.model.scene.probes)))
    if study.keeps_results:
        single = isinstance(study.suite.keep, KeepConfig) and study.suite.keep.precision == "single"
        rows = sum(written_rows(study.job, motions[run.record]) for run in runs)
        size += rows * row_bytes(study) * (0.5 if single else 1.0)
    before = f", {done} of them there already" if done else ""
    return f"{len(runs)} runs{before}; up to {size / 1e6:.0f} MB in {folder}"


def _failures(records: Sequence[SuiteRecord], rows: Sequence[Row]) -> dict[str, str]:
    bad = {record.name: record.message for record in records if record.motion is None}
    return bad | {f"{row.record}__{row.scale}__{row.sample}": row.message for row in rows if row.message}
