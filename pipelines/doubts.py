"""Questions that a careful reader has about a job, from its keys and its records; told, not refused."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence

from romdam.config.load import Job
from romdam.config.plausible import doubts
from romdam.core.motion import GroundMotion
from romdam.records.measures import content_frequency

_CONTENT = 0.9  # of the power of the acceleration lies below the frequency that the step is judged by
_STEPS = 20.0  # of a period, for a step that follows it

log = logging.getLogger(__name__)


def tell_doubts(job: Job, motions: Sequence[GroundMotion]) -> None:
    """Log each doubt as a warning."""
    for line in doubts_of(job, motions):
        log.warning("%s", line)


def doubts_of(job: Job, motions: Sequence[GroundMotion]) -> tuple[str, ...]:
    """A line for each doubt: of keys by names of before, of values, then of each record."""
    of_records = (f"{motion.name}: {text}" for motion in motions for text in _of_motion(job, motion))
    return (*job.renamed, *doubts(job.config), *of_records)


def _of_motion(job: Job, motion: GroundMotion) -> Iterator[str]:
    yield from motion.warnings
    transient = job.config.transient
    dt, seconds = transient.finest_step, transient.duration
    if dt is not None:
        content = content_frequency(motion.acc, motion.dt, _CONTENT)
        if dt > motion.dt * (1.0 + 1e-9):
            yield (
                f"transient.finest_step of {dt:g} s is longer than the record's {motion.dt:g} s, "
                "it is smoothed"
            )
        elif dt > 1.0 / (_STEPS * content):
            yield (
                f"transient.finest_step of {dt:g} s makes {1.0 / (dt * content):.2g} steps of a period at "
                f"{content:.3g} Hz, below which lies {_CONTENT:.0%} of its power; {_STEPS:g} are usual"
            )
    if seconds is not None and seconds < motion.duration * (1.0 - 1e-6):
        yield f"transient.duration cuts the record at {seconds:g} s, it has {motion.duration:g} s"
    elif seconds is not None and seconds > 2.0 * motion.duration:
        yield f"transient.duration of {seconds:g} s goes on long after the record, {motion.duration:g} s"
