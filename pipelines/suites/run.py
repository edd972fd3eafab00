"""A suite from a configuration to its summary: records x scales x samples on one reduced model."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import xarray as xr

from romdam.config.load import Job, Source, naming_lines
from romdam.core.counted import Counted
from romdam.core.errors import placed
from romdam.core.files import prepare_folder, private_folder, sweep_parts
from romdam.core.html.card import card
from romdam.core.machine import return_free_memory
from romdam.core.threads import one_thread
from romdam.pipelines.jobs import load_config
from romdam.pipelines.run import Clock, Stage, reduced_model, silent, write_shared
from romdam.pipelines.stresses import stress_fields
from romdam.pipelines.suites.cluster import Pool, open_pool
from romdam.pipelines.suites.folder import leftovers, of_no_run, suite_lock
from romdam.pipelines.suites.kept import write_kept
from romdam.pipelines.suites.mesh_error import state_mesh_error
from romdam.pipelines.suites.plan import Plan, finished, make_plan, tasks_of
from romdam.pipelines.suites.progress import watched
from romdam.pipelines.suites.runs import run_task
from romdam.pipelines.suites.sizes import results_bytes, summary_bytes
from romdam.pipelines.suites.tasks import Suite
from romdam.pipelines.summary import refuse_summary, write_summary_files
from romdam.records.record_set import write_choice
from romdam.reduction.storage.model_file import BlockStore
from romdam.results.dataset import write_dataset
from romdam.results.suite.journal import JOURNAL, append_rows
from romdam.results.suite.rows import SuiteRow
from romdam.results.suite.summary import (
    CACHE_FOLDER,
    DESIGN,
    RUNS_FOLDER,
    summary_dataset,
)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SuiteOptions:
    """Places where a suite computes and keeps reduced blocks.

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
    """The outcome of a suite.

    Attributes
    ----------
    path : of the summary
    summary : the summary
    runs, made : all runs, and those of them that this call made
    failures : name of a record or a run -> message
    leftovers : files in the folder that are of no run of this design
    tables : the summary's rows as CSV, and as a spreadsheet where one is asked for
    """

    path: Path
    summary: xr.Dataset
    runs: int
    made: int
    failures: dict[str, str]
    leftovers: tuple[Path, ...] = ()
    tables: tuple[Path, ...] = ()

    def _repr_html_(self) -> str:
        sizes = ", ".join(f"{self.summary.sizes[name]} {name}s" for name in ("record", "scale", "sample"))
        worst = self.summary.peak_opening.max().item() if "peak_opening" in self.summary else None
        rows = {
            "runs": f"{self.runs} ({sizes}), {self.made} of them made by this call",
            "largest opening": "" if worst is None else f"{1e3 * worst:.3g} mm",
            "failed": "; ".join(f"{name}: {message}" for name, message in self.failures.items()),
            "file": str(self.path),
        }
        return card(str(self.summary.attrs["title"]), "SuiteOutcome", rows)


@one_thread()
@naming_lines
def run_suite(
    job: Source,
    out: str | Path,
    options: SuiteOptions | None = None,
    show: Stage = silent,
    tell: Callable[[str], None] = log.info,
) -> SuiteOutcome:
    """Make every run of a suite that is not there yet, and the summary of all.

    Parameters
    ----------
    job : a configuration with `pipeline: suite`, as `romdam.load_config` takes one
    out : folder, made if needed; what is finished there is kept
    show : told of every stage and its progress
    tell : told what is going to be made, and its size, before it is; then what is odd about the records, and
        what else lies in the folder

    Raises
    ------
    RomdamError
        for bad input, where another suite works in the folder, and where the disk refuses a file; a run or
        record that fails becomes a failed row.
    """
    job, options, clock = load_config(job), options or SuiteOptions(), Clock(show)
    folder = prepare_folder(Path(out).absolute())
    refuse_summary(job, folder, DESIGN)
    workers = open_pool(options.workers, options.scheduler, run_task.__module__, folder)
    with suite_lock(folder), workers as pool:
        plan = make_plan(job, clock)
        suite = build_suite(plan, folder, options.cache, clock)
        return_free_memory()  # each stage takes its own
        statement = state_mesh_error(plan, show, suite_store(plan.job, folder, options.cache))
        return_free_memory()
        rows, count = _make_missing(suite, plan, folder, pool, clock, tell)
        if statement is not None:
            tell(statement.sentence)
        with clock.stage("summary", "writing the summary"):
            row_of = {run.index: rows[run.key] for run in plan.runs if run.key in rows}
            summary = summary_dataset(plan.job, plan.scene, plan.design, plan.records, row_of)
            if statement is not None:
                summary.attrs.update(statement.attributes)
            write_dataset(plan.design, folder / DESIGN)
            write_choice(plan.considered, folder)
            path, *tables = write_summary_files(summary, plan.job, folder)
        left = leftovers(folder, plan, rows)
    for name, motion in plan.motions.items():
        if motion.warnings:
            tell(f"warning: {name}: {'; '.join(motion.warnings)}")
    if left:
        tell(of_no_run(left, job.path, folder))
    failures = {record.name: record.message for record in plan.records if record.motion is None}
    failures |= {run.name: rows[run.key].message for run in plan.runs if rows[run.key].message}
    return SuiteOutcome(path, summary, summary.status.size, count, failures, left, tuple(tables))


def suite_store(job: Job, folder: Path, cache: Path | None) -> BlockStore:
    """Where a suite keeps reduced blocks: the given folder, that of the configuration, or one of its own."""
    configured = job.config.suite.cache if job.config.suite else None
    return BlockStore(cache or (job.folder / configured if configured else folder / CACHE_FOLDER))


def build_suite(plan: Plan, folder: Path, cache: Path | None, clock: Clock) -> Suite:
    """The reduced model, once for all samples; without its bases over the mesh where no run reads them."""
    job, scene, samples = plan.job, plan.scene, plan.samples
    store = suite_store(job, folder, cache)
    with clock.stage("model", "reducing the blocks"), placed(job.path):
        model = reduced_model(job, scene, store, estimated=True, also=samples.also)
    model = replace(model, stress=stress_fields(scene, model.reduced_at_rest))
    suite = Suite(job, model, samples, folder / RUNS_FOLDER, {})
    if suite.keeps_results:
        files = write_shared(prepare_folder(suite.folder), model, rock=job.config.outputs.rock)
        suite = replace(suite, files=files, write=write_kept)
    if samples.structural or (samples.places and model.stress and model.system.sustained is not None):
        return suite
    # what is sent to the workers holds what it maps: a basis of a file would be read into each process
    assert model.reduced is not None
    reduced = replace(model.reduced, basis={}, before={}, turns=(), reservoir=None)
    return replace(suite, model=replace(model, reduced=reduced))


def _make_missing(
    suite: Suite, plan: Plan, folder: Path, pool: Pool, clock: Clock, tell: Callable[[str], None]
) -> tuple[dict[str, SuiteRow], int]:
    """Key -> row of all runs, and how many had to be made."""
    sweep_parts(folder)
    sweep_parts(suite.folder)
    with clock.stage("plan", "looking for finished runs"):
        rows = finished(suite, folder, plan)
        tasks = tasks_of(suite, plan, rows)
    missing = sum(len(task.runs) for task in tasks)
    tell(_announcement(suite, plan, missing, folder))
    with (
        clock.stage("runs", Counted(missing, "runs")) as progress,
        private_folder(folder) as notes,
        watched(notes, missing, progress) as end_task,
    ):
        suite = replace(suite, notes=notes)
        for number, done in pool.map(run_task, suite, tasks):
            if isinstance(done, Exception):  # the rows of this task are left to be made again
                message = f"its workers died, {done}; lower suite.batch, or give the workers more memory"
                done = [SuiteRow(run.key, message, lasts=False) for run in tasks[number].runs]
            else:
                append_rows(folder / JOURNAL, [row for row in done if row.lasts])
            rows |= {row.key: row for row in done}
            end_task(len(tasks[number].runs), tasks[number].runs[0].key)
    return rows, missing


def _announcement(suite: Suite, plan: Plan, missing: int, folder: Path) -> str:
    """Announce the runs that are going to be made, and their size."""
    runs, motions, scene = plan.runs, plan.motions, suite.model.scene
    memory = summary_bytes(scene, len(runs))
    size = results_bytes(suite.job, scene, suite.model.system, motions.values(), len(runs) / len(motions))
    before = f", {len(runs) - missing} of them there already" if missing < len(runs) else ""
    return (
        f"{len(runs)} runs{before}; up to {max(1.0, size / 1e6):.0f} MB in {folder}, "
        f"and {max(1.0, memory / 1e6):.0f} MB of memory for the summary"
    )
