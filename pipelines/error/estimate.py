"""The estimates of error that every reduced run makes of itself.

Two things are estimated: what leaving out modes has changed, and what the size of the steps has changed. For
the modes the part of the run around its largest opening is computed again with a finer reduced model, which
is built together with the run's own. For the steps the run is computed again with other steps. This module
decides whether an estimate can be made, with which models and steps, and executes both;
`romdam.error.estimate` computes the differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from romdam.config.load import Job
from romdam.core.errors import describe_error, recoverable
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.core.threads import at_once, cpu_time
from romdam.error.estimate import FinerModel, estimate_error, estimate_time_error, rocks_on_joints
from romdam.error.statement import ErrorStatement, unknown_estimate
from romdam.pipelines.simulation import RunModel, ground_at_steps, prepare, settings_for, source_step
from romdam.reduction.refinement import embedding, parts_without_refinement
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import DryModel, ReducedModel, reduce_scene, reduce_scene_twice
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.step_control import names_of_errors


def can_estimate(job: Job) -> bool:
    """Tell whether an estimate is wanted, which it is not without joints, and can be made."""
    return _is_wanted(job) and not obstacle(job)


def _is_wanted(job: Job) -> bool:
    return job.config.outputs.error_estimate and bool(job.config.every_joint)


def obstacle(job: Job) -> str:
    """Say what keeps the reduction error of a job from being estimated; empty where nothing does."""
    if not job.config.damped:
        return "without damping histories part in time whatever the basis, and their peaks are what counts"
    return ""


def reduced_models(
    job: Job, scene: Scene, store: BlockStore | None = None
) -> tuple[ReducedModel, FinerModel | None]:
    """The reduced model of a job, and the finer one; None where no estimate is wanted or can be made."""
    return variable_models(job, scene, store)[:2]


def variable_models(
    job: Job, scene: Scene, store: BlockStore | None = None, also: Sequence[Scene] | None = None
) -> tuple[ReducedModel, FinerModel | None, DryModel | None]:
    """The reduced model of a job, the finer one, and the finer one before effects act.

    Both finer ones are None where no estimate is wanted or can be made, and the last where `also` is None.

    Parameters
    ----------
    also : see `romdam.reduction.synthesis.reduce_scene_twice`
    """
    model, damping = job.config.model, job.config.damping
    if model.modes == "all" or not can_estimate(job):
        return reduce_scene(scene, model, damping, store, also=also), None, None
    reduced, fine = reduce_scene_twice(scene, model, damping, store, also=also)
    return reduced, finer_model(job, scene, reduced, fine), fine.dry


def finer_model(job: Job, scene: Scene, reduced: ReducedModel, fine: ReducedModel) -> FinerModel:
    """The model that the estimates of runs on a reduced one compare with."""
    not_finer = tuple(parts_without_refinement(scene, reduced, fine))
    return FinerModel(prepare(job, fine.system), embedding(scene, reduced, fine), not_finer)


def estimate_run(job: Job, finer: FinerModel, motion: GroundMotion, history: History) -> ErrorStatement:
    """Estimate what leaving out modes has changed in a run, and what the estimate cost; or say it is unknown.

    Raises
    ------
    ConvergenceError
        where a step of the finer model does not converge.
    """
    if finer.not_finer:
        names = ", ".join(finer.not_finer)
        return unknown_estimate(f"the finer basis to compare with is the run's own in part {names}")
    start = cpu_time()
    chosen = history.stats["finest_step"], history.stats["base_step"]
    settings = settings_for(job, finer.prepared, motion, chosen)
    system, duration = finer.prepared.system, job.config.transient.duration
    ground = ground_at_steps(motion, settings.steps.base, duration, system)
    statement = estimate_error(finer, history, ground, settings)
    return replace(statement, details={"cpu_seconds": cpu_time() - start})


def with_estimates(
    job: Job, model: RunModel, motion: GroundMotion, history: History
) -> tuple[History, ErrorStatement | None]:
    """Estimate the errors of a run's steps and of leaving out modes, both at once.

    The error of the steps is added to the history's stats; the statement is that of the modes. It is None for
    a model with all its modes, which leaves out none, and where no estimate is wanted; where one is wanted
    and cannot be made, it says that the error is unknown. If one of the two fails, as where a step does not
    converge, the run says why in its warnings too.
    """
    finer = model.finer
    if model.reduced is None or not can_estimate(job):
        leaves_out = model.reduced is not None and job.config.model.modes != "all" and _is_wanted(job)
        return history, unknown_estimate(obstacle(job)) if leaves_out else None

    def of_modes() -> ErrorStatement | None:
        return None if finer is None else estimate_run(job, finer, motion, history)

    def of_steps() -> dict[str, float]:
        if "estimated_time_error" in history.stats:
            return {}
        return estimate_steps(job, model.prepared, motion, history)

    try:
        statement, more = at_once(of_modes, of_steps, model.mesh_unknowns)
    except recoverable() as error:
        why = f"its error is not estimated: {describe_error(error)}"
        unknown = None if finer is None else unknown_estimate(describe_error(error))
        return replace(history, warnings=(*history.warnings, why)), unknown
    return replace(history, stats=history.stats | more), statement


def estimate_steps(job: Job, prepared: Prepared, motion: GroundMotion, history: History) -> dict[str, float]:
    """Estimate what the steps of a run have changed, relative: of the openings, of slips and residual slips.

    The finest step is quartered, for half of it may repeat most of the run's error, which is then stated too
    small. The base step, which closed springs follow, is halved; it is cut into three where joints have bonds
    or other memory, so that few instants are common to both runs. Where blocks rock on joints that alone hold
    them, the finest step is doubled, unless it is the base step.

    Raises
    ------
    ConvergenceError
        where a step does not converge.
    """
    finest, settings = history.stats["finest_step"], settings_for(job, prepared, motion)
    law, factor, parts = prepared.system.law, 0.25, 1
    if rocks_on_joints(prepared.system) and 2.0 * finest <= history.stats["base_step"]:
        factor = 2.0
    elif law.laws:
        parts = 3
    elif len(law):
        parts = 2
    dt = source_step(motion, prepared.system) / parts
    steps = prepared.integrator.steps(factor * finest, dt, settings.steps.interval)
    ground = ground_at_steps(motion, steps.base, job.config.transient.duration, prepared.system)
    other = replace(settings, steps=steps, shear_share=min(factor, 1.0))
    errors = estimate_time_error(prepared, history, ground, other)
    return dict(zip(names_of_errors(len(errors)), map(float, errors), strict=True))
