"""The estimate of the reduction error that every reduced run makes of itself: the order of the stages."""

from __future__ import annotations

from dataclasses import replace

from romdam.config.coupling import coupling
from romdam.config.load import Job
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.core.threads import cpu_time
from romdam.error.estimate import FinerModel, estimate_error
from romdam.error.statement import ErrorStatement
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.reduction.refinement import embedding
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import ReducedModel, reduce_scene, reduce_scene_twice


def can_estimate(job: Job) -> bool:
    """Tell whether an estimate is wanted and can be made.

    There is none without joints, with modes that something couples, and without damping: undamped histories
    part in time whatever the basis, and their peaks are what counts.
    """
    config = job.config
    wanted = config.outputs.error_estimate and bool(config.every_joint)
    return wanted and config.damping.acts and coupling(config) is None


def reduced_models(
    job: Job, scene: Scene, store: BlockStore | None = None
) -> tuple[ReducedModel, FinerModel | None]:
    """The reduced model of a job, and the finer one; None where no estimate is wanted or can be made."""
    model, damping = job.config.model, job.config.damping
    if model.modes == "all" or not can_estimate(job):
        return reduce_scene(scene, model, damping, store), None
    reduced, fine = reduce_scene_twice(scene, model, damping, store)
    return reduced, FinerModel(prepare(job, fine.system), embedding(scene, reduced, fine))


def estimate_run(job: Job, finer: FinerModel, motion: GroundMotion, history: History) -> ErrorStatement:
    """Estimate what leaving out modes has changed in a run, and what the estimate cost.

    Raises
    ------
    ConvergenceError
        where a step of the finer model does not converge.
    """
    start = cpu_time()
    settings = settings_for(job, finer.prepared, motion, history.stats["finest_step"])
    system, duration = finer.prepared.system, job.config.transient.duration
    ground = ground_at_steps(motion, settings.steps.base, duration, system)
    statement = estimate_error(finer, history, ground, settings)
    return replace(statement, details={"cpu_seconds": cpu_time() - start})
