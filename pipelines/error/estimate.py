"""The estimate of the reduction error that every reduced run makes of itself: the order of the stages."""

from __future__ import annotations

import time
from dataclasses import replace

from romdam.config.load import Job
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.error.estimate import FinerModel, estimate_error
from romdam.error.statement import ErrorStatement
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.reduction.refinement import embedding, slightly_finer
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import ReducedModel, mode_choice, reduce_scene


def finer_model(
    job: Job, scene: Scene, reduced: ReducedModel | None, store: BlockStore | None = None
) -> FinerModel | None:
    """The finer model of a job; None where no estimate is asked for, or none can be made.

    There is none at full order, with all modes, without joints, with modes that dashpots couple, and without
    damping: undamped histories part in time whatever the basis, and their peaks are what counts.
    """
    wanted = job.config.outputs.error_estimate and job.config.every_joint and job.config.model.modes != "all"
    if reduced is None or not wanted or not reduced.system.diagonal or not reduced.system.C.diagonal().any():
        return None
    fine = reduce_scene(scene, slightly_finer(mode_choice(job.config.model)), job.config.damping, store)
    return FinerModel(prepare(job, fine.system), embedding(scene, reduced, fine))


def estimate_run(job: Job, finer: FinerModel, motion: GroundMotion, history: History) -> ErrorStatement:
    """Estimate what leaving out modes has changed in a run, and what the estimate cost.

    Raises
    ------
    ConvergenceError
        where a step of the finer model does not converge.
    """
    start = time.process_time()
    settings = settings_for(job, finer.prepared, motion, history.stats["finest_step"])
    ground = ground_at_steps(motion, settings.steps.base, job.config.transient.duration)
    statement = estimate_error(finer, history, ground, settings)
    return replace(statement, details={"cpu_seconds": time.process_time() - start})
