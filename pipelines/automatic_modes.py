"""`model.modes: auto`: as many modes as the wanted accuracy needs, on the strongest record."""

from __future__ import annotations

import math
from dataclasses import replace

from romdam.config.load import Job
from romdam.core.errors import ConfigError
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.pipelines.error.estimate import can_estimate, estimate_run, reduced_models
from romdam.pipelines.simulation import prepare, simulate_motion
from romdam.reduction.storage.model_file import BlockStore

FIRST = 20  # modes of each block
GROWTH = 1.5  # of that number
VECTORS = 20  # residual vectors of each block, where the job names none; they are worth more than modes
_LEAST = 0.5  # of the accuracy, which modes may leave where the steps nearly come to it
_MARGIN = 1.5  # the estimate of the modes is 0.6 of the truth at times


def with_modes(job: Job, modes: int | str) -> Job:
    """The job with a number of modes, or "all"."""
    model = job.config.model.model_copy(update={"modes": modes})
    return replace(job, config=job.config.model_copy(update={"model": model}))


def with_vectors(job: Job) -> Job:
    """The job with `VECTORS` residual vectors, unless it names their number."""
    if "residual_vectors" in job.config.model.model_fields_set:
        return job
    model = job.config.model.model_copy(update={"residual_vectors": VECTORS})
    return replace(job, config=job.config.model_copy(update={"model": model}))


def refuse_unjudged(job: Job) -> None:
    """Refuse `modes: auto` where no estimate can judge a number of modes.

    Raises
    ------
    ConfigError
    """
    if not can_estimate(job):
        raise ConfigError(
            f"{job.path}: model.modes: auto needs joints, damping and outputs.error_estimate, to "
            "estimate the error of leaving out modes; give a number, 60 is a good start"
        )


def choose_modes(
    job: Job,
    scene: Scene,
    motions: list[GroundMotion],
    store: BlockStore | None = None,
    share: float | None = None,
) -> Job:
    """The job with the fewest modes of those tried that leave, together with the steps, a share.

    Every count is run on the record of the largest acceleration and judged by the estimate that every run
    makes of itself. Modes may leave what the steps, which follow from `accuracy` in the same run, do not, and
    half of the accuracy at least. A job that names no residual vectors takes `VECTORS` of them. Where half of
    a block's modes do not do, all are taken.

    Parameters
    ----------
    share : relative error that modes and steps may leave together; the accuracy of the steps if not given

    Raises
    ------
    ConfigError
        where no estimate can be made (no joints, no damping).
    ConvergenceError
        where a step does not converge.
    """
    accuracy = job.config.transient.step_accuracy
    assert accuracy is not None  # the configuration asks for it
    refuse_unjudged(job)
    job = with_vectors(job)
    free = min(int((~fixed).sum()) for fixed in scene.fixed.values())
    motion = max(motions, key=lambda m: m.peak)
    count = FIRST
    while count < free / 2:
        trial = with_modes(job, count)
        reduced, finer = reduced_models(trial, scene, store)
        assert finer is not None
        prepared = prepare(trial, reduced.system)
        history = simulate_motion(trial, prepared, motion, trial.config.transient.duration)
        errors = estimate_run(trial, finer, motion, history).errors  # none where it is unknown
        left = max((share or accuracy) - history.stats["estimated_time_error"], _LEAST * accuracy)
        if errors and _MARGIN * errors["opening"].l2 <= left:
            return trial
        count = math.ceil(GROWTH * count)
    return with_modes(job, "all")
