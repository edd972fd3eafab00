"""The work of a suite's worker: integrate the runs of one task and make their rows.

The suite (scene, reduced model, samples) travels to every worker once; a task brings its ground motions.
A worker writes nothing but the results that are kept whole, into the suite's own folder.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from romdam.config.load import Job
from romdam.config.parameters import Varied
from romdam.core.errors import ConfigError, ResultError, describe_error, recoverable
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History, System, with_parameters
from romdam.core.threads import cpu_time, one_thread
from romdam.effects.scene_effects import scene_effects
from romdam.error.statement import row_errors
from romdam.fem.assembly import Assembly
from romdam.fem.damping import modal_coefficients
from romdam.fem.gaps import gap_law
from romdam.pipelines.balance import with_balance
from romdam.pipelines.error.estimate import finer_model, with_estimates
from romdam.pipelines.floor_spectra import floors_of
from romdam.pipelines.simulation import RunModel, prepare, simulate_motions
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.pipelines.suites.progress import Note
from romdam.pipelines.suites.tasks import Run, Suite, Task, sample_content, scaled
from romdam.reduction.synthesis import DryModel, ReducedModel
from romdam.results.case_warnings import case_warnings
from romdam.results.suite.rows import SuiteRow, row_values
from romdam.results.variables import Case
from romdam.scene.varied import part_factors

_INTEGRATION = 0.5  # of a task's time; the rest goes to its rows and the estimates of their errors


def sample_model(suite: Suite, number: int) -> RunModel:
    """The model of one sample; nothing is reduced.

    Raises
    ------
    ConfigError
        for values that do not fit together, and joints that are not those of the plan.
    """
    if not suite.samples.places:
        return suite.model
    job, model = suite.job, suite.model
    scene, varied = suite.samples.scene(job, model.scene, number)
    if sample_content(scene, varied) != suite.samples.contents[number]:
        raise ConfigError(
            f"{job.path}: joints: their gap tables have changed since the suite was started, or are others "
            f"on a worker; leave those in {job.folder} as they are, and run the same command again"
        )
    assert model.reduced is not None
    if suite.samples.structural:
        return structural_model(job, model, scene, varied)
    system, finer = _with_sample(job, model.system, scene, varied), model.finer
    if finer is not None:
        other = _with_sample(job, finer.prepared.system, scene, varied)
        finer = replace(finer, prepared=prepare(job, other, like=finer.prepared))
    reduced, prepared = replace(model.reduced, system=system), prepare(job, system, like=model.prepared)
    sample = replace(model, scene=scene, prepared=prepared, reduced=reduced, finer=finer)
    if system.sustained is None:
        return sample
    return replace(sample, stress=stress_fields(scene, sample.reduced_at_rest))  # of another state at rest


def structural_model(job: Job, model: RunModel, scene: Scene, varied: Varied) -> RunModel:
    """The model with other materials and levels: its parts scaled as wholes, then all effects of the scene.

    Parameters
    ----------
    model : with what is needed for that, see `romdam.reduction.synthesis.reduce_scene_twice`
    scene, varied : of the sample
    """
    assert model.reduced is not None and model.reduced.dry is not None
    dry, law = model.reduced.dry, gap_law(scene)
    factors = part_factors(model.scene, scene, str(job.path))
    directions = dry.system.law.directions
    effects = scene_effects(
        scene, varied.config.damping, directions, Assembly(scene.blocks), dry.choice.solving
    )

    def of_sample(dry: DryModel) -> ReducedModel:
        reduced = dry.scaled(factors).with_effects(effects)
        return replace(reduced, system=with_parameters(reduced.system, law, None))

    reduced, finer = of_sample(dry), model.finer
    if model.finer_dry is not None:
        finer = finer_model(job, scene, reduced, of_sample(model.finer_dry))
    sample = replace(model, scene=scene, prepared=prepare(job, reduced.system), reduced=reduced, finer=finer)
    return replace(sample, stress=stress_fields(scene, sample.reduced_at_rest))


def _with_sample(job: Job, system: System, scene: Scene, varied: Varied) -> System:
    before, after = job.config.damping, varied.config.damping
    omega2 = system.K.diagonal()[: system.solids]
    both = (
        None if before == after else (modal_coefficients(before, omega2), modal_coefficients(after, omega2))
    )
    return with_parameters(system, gap_law(scene), both)


@one_thread()
def run_task(suite: Suite, task: Task) -> list[SuiteRow]:
    """Integrate the runs of a task together; their rows in its order, those that failed with a message.

    Raises
    ------
    ResultError
        where a result that is to be kept cannot be written.
    """
    wall, cpu = time.perf_counter(), cpu_time()
    samples = dict.fromkeys(run.index[2] for run in task.runs)
    models = {number: sample_model(suite, number) for number in samples}
    motions = [scaled(task.motions[run.record], run) for run in task.runs]
    note = Note(suite.notes, task.runs[0].key, len(task.runs))
    report = note.report_stage(0.0, _INTEGRATION)
    outcomes = integrate_runs(suite.job, [models[run.index[2]] for run in task.runs], motions, report)
    spent = (time.perf_counter() - wall, cpu_time() - cpu)
    # each run has the share of the task's time that its own steps took
    cpu_seconds = [
        0.0 if isinstance(outcome, Exception)
        else outcome.stats.get("all_runs_cpu_seconds", outcome.stats["loop_cpu_seconds"])
        for outcome in outcomes
    ]  # fmt: skip
    total = sum(cpu_seconds)
    shares = [seconds / total if total > 0.0 else 1.0 / len(outcomes) for seconds in cpu_seconds]
    rows, report = list[SuiteRow](), note.report_stage(_INTEGRATION, 1.0)
    for run, motion, outcome, share in zip(task.runs, motions, outcomes, shares, strict=True):
        if isinstance(outcome, Exception):
            rows.append(_failed(run, outcome))
            continue
        report(len(rows), len(task.runs))
        clock = (share * spent[0], share * spent[1])
        try:
            rows.append(_row(suite, models[run.index[2]], run, motion, outcome, clock))
        except ResultError:  # of the folder or the disk, which are those of all runs
            raise
        except recoverable() as error:
            rows.append(_failed(run, error))
    return rows


def _failed(run: Run, error: Exception) -> SuiteRow:
    """The row of a run that failed, which is that of any run of the same content, whatever its name."""
    lasts = not isinstance(error, MemoryError)
    return SuiteRow(run.key, describe_error(error).replace(f"record {run.name}", "its record"), lasts=lasts)


def integrate_runs(
    job: Job,
    models: Sequence[RunModel],
    motions: Sequence[GroundMotion],
    progress: Callable[[int, int], None] | None = None,
) -> Sequence[History | Exception]:
    """The one place where a suite integrates: every history, or why there is none."""
    try:
        prepared = [model.prepared for model in models]
        return simulate_motions(job, prepared, motions, job.config.transient.duration, progress)
    except recoverable() as error:
        if len(motions) == 1:
            return [error]
    return [
        integrate_runs(job, [lone_model], [motion])[0]
        for lone_model, motion in zip(models, motions, strict=True)
    ]


def _row(
    suite: Suite,
    model: RunModel,
    run: Run,
    motion: GroundMotion,
    history: History,
    clock: tuple[float, float],
) -> SuiteRow:
    """The numbers of a run that took `clock` seconds so far; its result is written if it is kept."""
    wall, cpu = time.perf_counter() - clock[0], cpu_time() - clock[1]
    history = with_balance(suite.job, model, history)
    history, estimate = with_estimates(suite.job, model, motion, history)
    attributes = {"model_order": suite.job.config.model.order}
    stated = row_errors(attributes | (dict(estimate.attributes) if estimate is not None else {}))
    history, floors = floors_of(suite.job, model, motion, history)
    history, stress = stress_of(model.scene, model.stress, history)
    case = Case(model.scene, motion, history, stress, floors)
    stated["wall_seconds"] = time.perf_counter() - wall
    stated["cpu_seconds"] = cpu_time() - cpu
    kept = None if suite.write is None else suite.write(suite, run, case, estimate)
    warnings = tuple(case_warnings(case, suite.job))
    return SuiteRow(run.key, "", row_values(case, stated), kept, warnings=warnings)
