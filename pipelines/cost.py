"""What a run costs: short parts of the strongest record are run, and their time is taken to the whole."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from romdam.config.load import Job
from romdam.core.errors import describe_error, recoverable
from romdam.core.motion import GroundMotion
from romdam.core.system import System
from romdam.core.threads import cpu_time
from romdam.error.estimate import LATE, QUIET, WINDOW, rocks_on_joints
from romdam.pipelines.error.estimate import with_estimates
from romdam.pipelines.error.sibling import NoSibling, Sibling
from romdam.pipelines.simulation import RunModel, settings_for, simulate_motion
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.records.measures import moving, significant_duration

log = logging.getLogger(__name__)

_MOTION = ("integration", "estimate", "mesh", "stress")  # costs that grow with the length of a record
COSTS = ("start", "reduction", *_MOTION, "results", "figures")
_PARTS = 4  # of the record, at equal distances: strong motion is some of them
_FIRST = 0.01  # of the record, each part, to begin with: they tell how long the others may be
_ROWS = 5.0  # written rows of a part at least
_START_UP = (
    0.15  # [s] of a part at least: begun from rest amid shaking, joints slip and open as in no later one
)
_BUDGET = 1.0  # s of CPU in the integration of the longer parts
_ENOUGH = 1.0  # s of CPU in the first parts' integration, in which their start counts little: no longer ones
_LONGER = 3.0  # times as long they are at least, so that the start counts little in what is between
# s of CPU, from 0.6 to 1.5 times as much by the machine and its other work
_START = 3.0  # to load libraries and compiled code
_RESULTS = 0.7  # to write a result, or a summary
_ROW = 3.5e-3  # to make the model of a suite's sample and the row of a run
_BYTES = 2.3e-8  # for each byte of a result
_FIGURES = 1.0  # to draw the figures of a result
_JOINT_FIGURES = 0.6  # for each of its joints


def run_costs(
    job: Job,
    model: RunModel,
    motions: Sequence[GroundMotion],
    runs: int = 1,
    sibling: Sibling | NoSibling | None = None,
    stated: int | None = None,
) -> dict[str, float]:
    """CPU seconds of all runs that grow with their length, of `COSTS`; empty where a part fails.

    Parts of two lengths are run, so that what a run takes whatever its length is counted once.

    Parameters
    ----------
    runs : of each record
    sibling : states the error of the mesh in every run, None where that is not stated
    stated : runs that are made on both meshes for that statement instead, before all others
    """
    strongest = max(motions, key=lambda motion: motion.peak)
    whole = run_seconds(job, strongest)
    least = max(_START_UP, _ROWS * settings_for(job, model.prepared, strongest).steps.interval)
    short = min(1.0, _PARTS * max(_FIRST, least / whole))
    start = cpu_time()
    model = replace(model, stress=stress_fields(model.scene, model.reduced_at_rest))
    fields = cpu_time() - start
    try:
        _run_parts(job, model, sibling, strongest, short, only_one=True)  # compiles
        costs = _run_parts(job, model, sibling, strongest, short)
        if short < 1.0:
            share = min(1.0, short * max(_LONGER, _BUDGET / max(costs["integration"], 1e-6)))
            if costs["integration"] > _ENOUGH:
                share = short
            if share < 1.0:  # in parts within which an estimate goes all the way
                share = max(short, min(share, _PARTS * WINDOW / whole))
            longer = costs if share == short else _run_parts(job, model, sibling, strongest, share)
            costs = of_whole(short, costs, share, longer)
            if share < 1.0:
                costs["estimate"] *= estimated_share(model.system, strongest, whole)
    except recoverable() as error:  # no reason to refuse the job: only these parts begin from rest
        log.info(
            "the time of a run is unknown: a short part of %s: %s", strongest.name, describe_error(error)
        )
        return {}
    every = runs * sum(run_seconds(job, motion) for motion in motions) / whole
    on_both = sum(costs[name] for name in ("mesh", "integration") if stated is not None)
    costs = {name: every * seconds for name, seconds in costs.items()}
    if stated is not None:
        costs["mesh"] = stated * on_both
    costs["stress"] += fields
    return costs


def fixed_costs(
    job: Job, records: int, runs: int, joints: int, file_size: float, stages: Mapping[str, float]
) -> dict[str, float]:
    """CPU seconds of a command whatever the length of its records: start, results and figures.

    Parameters
    ----------
    runs : of all records
    file_size : of all results [bytes]
    stages : CPU seconds of the stages of a check that a run has too
    """
    costs = {"start": _START + sum(stages.get(name, 0.0) for name in ("records", "scene", "samples"))}
    if job.config.pipeline == "suite":
        costs["results"] = _ROW * runs
    if job.config.pipeline == "run":
        costs["results"] = _RESULTS * (records + (records > 1)) + _BYTES * file_size
        drawn = records if job.config.outputs.plots else 0
        costs["figures"] = drawn * (_FIGURES + _JOINT_FIGURES * joints)
    return costs


def run_seconds(job: Job, motion: GroundMotion) -> float:
    """Duration of a run [s]."""
    return job.config.transient.duration or motion.duration


def estimated_share(system: System, motion: GroundMotion, whole: float) -> float:
    """Share of a run of `whole` seconds over which its estimate goes, as far as the record tells.

    All of it where joints remember; without shear a window at the largest opening; else while they move, less
    long where blocks rock, see `romdam.error.estimate`. Openings move as long as the ground does.
    """
    law = system.law
    if law.laws:
        return 1.0
    if law.directions == 1:
        return min(1.0, WINDOW / whole)
    late = LATE if rocks_on_joints(system) else QUIET
    shaken = moving(motion.acc[:, : math.ceil(whole / motion.dt) + 1])  # what follows is not run
    spans = significant_duration(shaken, motion.dt, QUIET, 1.0 - late).tolist()
    return min(1.0, max([WINDOW, *(span for span in spans if span > WINDOW)]) / whole)


def record_parts(motion: GroundMotion, whole: float, share: float) -> list[GroundMotion]:
    """Cut a share of the first `whole` seconds from a record, in parts at equal distances."""
    whole = min(whole, motion.duration)
    count = 1 if share >= 1.0 else _PARTS
    samples = max(2, math.ceil(share * whole / count / motion.dt) + 1)
    last = max(0, motion.acc.shape[1] - samples)
    middles = [(k + 0.5) * whole / count / motion.dt for k in range(count)]
    firsts = [min(max(0, round(middle - samples / 2)), last) for middle in middles]
    return [replace(motion, acc=motion.acc[:, first : first + samples]) for first in firsts]


def of_whole(
    share: float, first: dict[str, float], more: float, second: dict[str, float]
) -> dict[str, float]:
    """Costs of the whole from those of two shares: what a part takes whatever its length, and what grows."""
    if not share < more < 1.0:
        return {name: seconds / more for name, seconds in second.items()}
    whole = {}
    for name, seconds in second.items():
        slope = min(max(0.0, (seconds - first[name]) / (more - share)), seconds / more)
        whole[name] = (seconds - slope * more) / _PARTS + slope
    return whole


def _run_parts(
    job: Job,
    model: RunModel,
    sibling: Sibling | NoSibling | None,
    motion: GroundMotion,
    share: float,
    *,
    only_one: bool = False,
) -> dict[str, float]:
    """CPU seconds of running a share of a record, in parts at equal distances, each from rest."""
    costs, parts = dict.fromkeys(_MOTION, 0.0), record_parts(motion, run_seconds(job, motion), share)
    for window in parts[:1] if only_one else parts:
        length = run_seconds(job, motion) if share >= 1.0 else window.duration
        transient = job.config.transient.model_copy(update={"duration": length})
        cut = replace(job, config=job.config.model_copy(update={"transient": transient}))
        times = [cpu_time()]
        history = simulate_motion(cut, model.prepared, window, length)
        times.append(cpu_time())
        history, _ = with_estimates(cut, model, window, history)
        times.append(cpu_time())
        if isinstance(sibling, Sibling):
            for other in sibling.others:
                simulate_motion(other.job, other.model.prepared, window, length)
        times.append(cpu_time())
        stress_of(model.scene, model.stress, history)
        times.append(cpu_time())
        for name, begin, end in zip(_MOTION, times[:-1], times[1:], strict=True):
            costs[name] += end - begin
    return costs
