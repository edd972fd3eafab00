"""`spacing: auto`: gaps as far apart as the wanted accuracy allows, on the strongest record."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping

from romdam.config.load import Job
from romdam.config.other_mesh import with_spacing
from romdam.core.motion import GroundMotion
from romdam.error.comparison import OVER_COARSER, OVER_FINER
from romdam.error.discretisation import MeshRun, discretisation
from romdam.error.statement import percent
from romdam.pipelines.automatic_modes import FIRST, with_modes, with_vectors
from romdam.pipelines.error.sibling import run_of
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.simulation import RunModel, as_run, prepare, simulate_motion
from romdam.records.processing.resampling import strongest_part
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene

log = logging.getLogger(__name__)

SECONDS = 10.0  # of a record, as `romdam verify` compares
_COARSEST, _FINEST = 8, 2  # times the distance of the nodes: what is tried first, and last


def automatic_joints(job: Job) -> list[str]:
    """Names of the joints with `spacing: auto`."""
    return [name for name, joint in job.config.every_joint.items() if joint.spacing == "auto"]


def choose_spacing(job: Job, motions: list[GroundMotion], store: BlockStore | None = None) -> Job:
    """The job with gaps as far apart as changes the openings by at most `transient.accuracy`.

    Spacings of eight, four and two times the distance of the nodes are run on the strongest `SECONDS` of the
    record of the largest acceleration. What a spacing changes is stated as for a mesh, from the run on half
    of it or on twice it; where two times that distance is too coarse, every node has a gap, which is not run
    here.

    Raises
    ------
    ConfigError
        for faces that are too curved for gaps between their nodes.
    ConvergenceError
        where a step does not converge.
    """
    accuracy = job.config.transient.step_accuracy
    assert accuracy is not None  # the configuration asks for it
    motion = as_run(job, max(motions, key=lambda m: m.peak))
    if all(support.motion is None for support in job.config.supports):  # those that move begin at rest
        _, motion = strongest_part(motion, SECONDS)
    trial = with_modes(with_vectors(job), FIRST) if job.config.model.modes == "auto" else job
    every_joint, automatic = scene_of(with_spacing(job, None)).joints, automatic_joints(job)
    joints = [every_joint[name] for name in automatic]
    nodes = {name: len(joint.area) for name, joint in zip(automatic, joints, strict=True)}
    distance = max(math.sqrt(joint.whole_area.sum() / len(joint.area)) for joint in joints)
    times, judged = _COARSEST, _run(with_spacing(trial, _COARSEST * distance), motion, store)
    while times > _FINEST:
        half = times // 2
        better = _run(with_spacing(trial, half * distance), motion, store)
        about = {"record": motion.name, "seconds": float(judged.time[-1])}
        if not _differ(judged, better, nodes):  # two runs that are the same say nothing of either
            times, judged = half, better
            continue
        error = discretisation(judged, better, finer=True, about=about).errors["opening"].l2
        log.info(
            "spacing %.4g m: %d gaps, which change the openings by about %s in L2 (%g of the difference to "
            "half of it); accuracy %s",
            times * distance, len(judged.position), percent(error), OVER_FINER, percent(accuracy),
        )  # fmt: skip
        if error <= accuracy:
            return with_spacing(job, times * distance)
        if error * OVER_COARSER / OVER_FINER <= accuracy:
            return with_spacing(job, half * distance)
        times, judged = half, better
    log.info("spacing %.4g m is too coarse: every node has a gap", times * distance)
    return with_spacing(job, None)


def _differ(coarse: MeshRun, fine: MeshRun, nodes: Mapping[str, int]) -> bool:
    """Tell whether every joint has more gaps in the finer run, or has them at all its nodes in both."""
    for name, most in nodes.items():
        fewer, more = (run.joints[name].stop - run.joints[name].start for run in (coarse, fine))
        if not (fewer < more or fewer >= most):
            return False
    return True


def _run(job: Job, motion: GroundMotion, store: BlockStore | None) -> MeshRun:
    """Run a job without the stress of its modes."""
    scene = scene_of(job)
    reduced = reduce_scene(scene, job.config.model, job.config.damping, store)
    model = RunModel(scene, prepare(job, reduced.system), reduced)
    return run_of(model, simulate_motion(job, model.prepared, motion), None)
