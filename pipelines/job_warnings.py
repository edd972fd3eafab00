"""Warnings about a job: unlikely values of keys, and what is odd about its scene and its records."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace

from romdam.config.load import Job, line_named, with_lines
from romdam.config.plausible import check_assumptions
from romdam.core.motion import GroundMotion
from romdam.core.scene import FreeField, Scene
from romdam.fem.damping import brings_damping, drag_of_matrix, joints_alone_hold
from romdam.postprocess.incidence import incidence_statement
from romdam.postprocess.record_measures import analysed_share
from romdam.records.measures import content_frequency
from romdam.records.processing.resampling import lost_between
from romdam.results.case import moduli_statement
from romdam.scene.ties import scene_parts
from romdam.timestepping.steps import grid_steps, holds_samples

_CONTENT = 0.9  # of the power of the acceleration lies below the frequency that the step is judged by
_STRONG = 0.95  # of the Arias intensity, where strong motion ends
_STEPS = 20.0  # of a period, for a step that follows it
_SLIDES = (0.1, 0.5)  # [m/s] velocities of sliding at which its drag is told
_LEAST_DRAG = 1e-3  # [1/s] over mass, below which a drag is round-off of a matrix
_G = 9.81  # [m/s2]

log = logging.getLogger(__name__)


def log_warnings(job: Job, motions: Sequence[GroundMotion]) -> None:
    """Log the warnings about a job and its motions."""
    for line in job_warnings(job, motions):
        log.warning("%s", line)


def job_warnings(job: Job, motions: Sequence[GroundMotion]) -> tuple[str, ...]:
    """Collect the warnings about a job: old names of keys, values, the scene, then each motion.

    Each that tells of a key names the file and the line.
    """
    of_records = (
        f"{line_named(job, text)}{motion.name}: {text}"
        for motion in motions
        for text in _of_motion(job, motion)
    )
    return (
        *with_lines(job, (*job.renamed, *check_assumptions(job.config), *job.scene_warnings)),
        *of_records,
    )


def with_scene_warnings(scene: Scene, job: Job) -> Job:
    """Add the warnings about its scene to a job."""
    of_matrices = [
        text
        for block in scene.blocks.values()
        if block.matrices is not None
        for text in block.matrices.warnings
    ]
    return replace(job, scene_warnings=(*scene.remarks, *of_matrices, *_of_damping(job, scene)))


def log_scene_warnings(scene: Scene, job: Job) -> Job:
    """Add the warnings about its scene to a job, and log them."""
    job = with_scene_warnings(scene, job)
    for line in with_lines(job, job.scene_warnings):
        log.warning("%s", line)
    if moduli := moduli_statement(scene):
        log.info("%s: %s", job.path, moduli)
    field = scene.find(FreeField)
    if field is not None and field.inclined:
        log.info("%s: ground.incidence: %s", job.path, incidence_statement(field))
    return job


def _of_damping(job: Job, scene: Scene) -> Iterator[str]:
    """Damping of blocks that joints with friction alone hold: not of rigid motions, but by their matrices."""
    sliding = []  # parts with mass that joints alone hold, and some of them by friction
    for part in scene_parts(scene).values():
        joints = [j for j in scene.joints.values() if set(j.blocks) & set(part.blocks)]
        rubs = any((j.mu > 0.0).any() or any(rows.shear for rows in j.laws) for j in joints)
        massive = any(scene.blocks[name].material.rho > 0.0 for name in part.blocks)
        if massive and rubs and joints_alone_hold(part, scene):
            sliding.append(part)
    names = [n for part in sliding for n in part.blocks if not brings_damping(scene.blocks[n])]
    if names and job.config.damped:
        yield (
            f"damping: acts on what strains {', '.join(names)}, and not on their rigid motions, which joints "
            "with friction alone hold: it does not brake a slide, and swaying on closed joints has less than "
            "the ratios that are given; `romdam modes --joints bonded` states how much for damping.rayleigh"
        )
    for part in sliding:
        drag = drag_of_matrix(part, scene)
        if drag > _LEAST_DRAG:
            slow, fast = (f"{drag * v / _G:.2g} at {v:g} m/s" for v in _SLIDES)
            yield (
                f"blocks.{part.name}.matrices.damping: acts on rigid motion too, up to {drag:.3g} 1/s times "
                f"mass: {part.name}, held by joints with friction alone, slides against it, as if friction "
                f"were higher by {slow} and {fast}. Slips come out too small; write a matrix that leaves "
                "rigid motions alone, or leave it out and give `damping`"
            )


def _of_motion(job: Job, motion: GroundMotion) -> Iterator[str]:
    yield from motion.warnings
    yield from step_warnings(job, motion)


def step_warnings(job: Job, motion: GroundMotion) -> Iterator[str]:
    """Say what steps and duration of a job leave out of a record, a sentence each."""
    transient, interval = job.config.transient, job.config.outputs.output_interval
    dt, seconds = transient.finest_step, transient.duration
    if interval is not None and not (dt is not None and dt > motion.dt):
        base = grid_steps(motion.dt, interval).base
        if not holds_samples(base, motion.dt):
            share, peak = lost_between(motion.acc, motion.dt, base)
            cuts = max(1, round(motion.dt / interval))
            better = motion.dt / cuts if interval < motion.dt else round(interval / motion.dt) * motion.dt
            yield (
                f"outputs.output_interval: {interval:.6g} s and the record's {motion.dt:.6g} s have no "
                f"common step of a useful size: steps of {base:.3g} s pass by its samples and lose "
                f"{share:.2g} of its acceleration in L2, {peak:.2g} of its peak at most; {better:.6g} s "
                "loses nothing"
            )
    if dt is not None:
        content = content_frequency(motion.acc, motion.dt, _CONTENT)
        if dt > motion.dt * (1.0 + 1e-9):
            yield (
                f"transient.finest_step: {dt:g} s is longer than the record's {motion.dt:g} s, it is smoothed"
            )
        elif motion.acc.any() and dt > 1.0 / (_STEPS * content):
            yield (
                f"transient.finest_step: {dt:g} s makes {1.0 / (dt * content):.2g} steps of a period at "
                f"{content:.3g} Hz, below which lies {_CONTENT:.0%} of its power; {_STEPS:g} are usual"
            )
    if seconds is not None and seconds < motion.duration * (1.0 - 1e-6):
        text = f"transient.duration: cuts the record at {seconds:g} s, it has {motion.duration:g} s"
        peak, arias = analysed_share(motion, seconds)
        if peak < 1.0 or arias < _STRONG:
            text += (
                f", and strong motion with it: what is left has a peak of {peak * motion.peak:.3g} of "
                f"{motion.peak:.3g} m/s2 and {arias:.0%} of the Arias intensity"
            )
        yield text
    elif seconds is not None and seconds > 2.0 * motion.duration:
        yield f"transient.duration: {seconds:g} s goes on long after the record, {motion.duration:g} s"
