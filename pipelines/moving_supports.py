"""Supports of their own motion: what their records need before a scene is reduced."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from romdam.config.load import Job
from romdam.config.sections.motion_along import StationConfig
from romdam.config.sections.supports import SupportMotionConfig
from romdam.core.errors import ConfigError
from romdam.core.motion import GroundMotion, MovingSupports, SupportMotion
from romdam.core.scene import Scene
from romdam.records.processing.support_motions import refuse_drift
from romdam.records.record_set import load_motions
from romdam.scene.build import build_scene


def scene_of(job: Job) -> Scene:
    """Build the scene of a job, with the records of supports that have one.

    Raises
    ------
    RomdamError
        for bad input, several records of one support, and one whose displacement drifts.
    """
    scene = build_scene(job.config, job.folder, str(job.path))
    moving = scene.find(MovingSupports)
    if moving is None:
        return scene
    motions = []
    for motion in moving.motions:
        entry: SupportMotionConfig | StationConfig | None = (
            job.config.supports[motion.support].motion if motion.station is None else _station(job, motion)
        )
        if entry is None or entry.record is None:
            motions.append(motion)
            continue
        location = f"{job.path}: {motion.key}.record"
        records = load_motions([entry.record], job.folder)
        if len(records) != 1:
            raise ConfigError(f"{location}: a support has one record, got {len(records)}; name one file")
        still = replace(records[0], acc=0.0 * records[0].acc)
        motion = replace(motion, record=records[0])
        refuse_drift(still, [motion], location)
        motions.append(motion)
    return scene.with_effects(replace(moving, motions=tuple(motions)))


def _station(job: Job, motion: SupportMotion) -> StationConfig | None:
    """The entry of a station; None of a wave's."""
    stations = () if job.config.ground.along is None else job.config.ground.along.stations
    return stations[motion.support] if stations else None


def refuse_drifting(job: Job, motions: Sequence[GroundMotion]) -> None:
    """Refuse ground motions that supports cannot move against, before anything is reduced.

    Raises
    ------
    RecordError
        for one whose displacement drifts.
    ConfigError
        for several where a support has its own record.
    """
    moving: list[SupportMotionConfig | StationConfig] = [
        support.motion for support in job.config.supports if support.motion is not None
    ]
    along = job.config.ground.along
    if along is not None:
        moving += along.stations
    own = [support_motion for support_motion in moving if support_motion.record is not None]
    if own and len(motions) > 1:
        raise ConfigError(
            f"{job.path}: a support's or station's own record goes with one record, and `records` has "
            f"{len(motions)}; name one, or give `delay` and `factor`"
        )
    supports = []
    for k, support in enumerate(job.config.supports):
        if support.motion is not None and support.motion.record is None:
            supports.append(SupportMotion(k, support.motion.delay, support.motion.factor))
    for k, station in enumerate(() if along is None else along.stations):
        if station.record is None:
            supports.append(SupportMotion(k, station.delay, station.factor, station=0.0))
    for motion in motions:
        every = [*supports]
        if own:  # what moves by its own record is left by the base's
            every.append(SupportMotion(0, factor=0.0))
        if along is not None and along.velocity is not None:  # its stations are known once there is a mesh
            every.append(SupportMotion(0, delay=motion.dt, station=0.0))
        refuse_drift(motion, every, f"{job.path}: records")
