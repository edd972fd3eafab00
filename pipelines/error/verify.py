"""The verification: the reduced model and the unreduced mesh are run on the same record and compared.

Nothing of this is an estimate. Because the unreduced run is expensive, it covers the strongest ten seconds of
the record unless a duration is given, and its cost is announced before it begins. A third history, from a
file, may be compared with both.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from romdam.config.load import Job, Source, naming_lines
from romdam.core.errors import ConfigError
from romdam.core.files import prepare_folder
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.scene_digest import scene_digest
from romdam.core.system import History
from romdam.core.threads import one_thread
from romdam.effects.full_order import assemble_full
from romdam.error.comparison import ComparedRun, compared_openings
from romdam.error.histories import read_reference
from romdam.error.statement import ErrorStatement, write_verification
from romdam.error.verification import STRESS, against_stored, full_order_step, verification
from romdam.fem.stress import observing_stress
from romdam.pipelines.check import full_order_seconds
from romdam.pipelines.job_warnings import log_scene_warnings, log_warnings
from romdam.pipelines.jobs import load_config
from romdam.pipelines.moving_supports import refuse_drifting
from romdam.pipelines.run import Clock, Stage, build_model, choose_mesh_and_modes, silent
from romdam.pipelines.simulation import (
    RunModel,
    as_run,
    ground_at_steps,
    prepare,
    settings_for,
    simulate_motion,
    source_step,
)
from romdam.pipelines.sizes import refuse_lengths
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.records.processing.resampling import strongest_part
from romdam.records.record_set import load_motions
from romdam.results.stress.file import StressFields
from romdam.timestepping.integrators.registry import FULL_ORDER
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.steps import fixed_steps

log = logging.getLogger(__name__)

WINDOW = 10.0  # [s] of a record that is run at full order


@dataclass(frozen=True)
class Verified:
    """An error: `statement` as written to `path`, and a figure of both opening histories."""

    statement: ErrorStatement
    path: Path
    figure: Path


@one_thread()
@naming_lines
def verify(
    job: Source,
    out: str | Path,
    duration: float | None = None,
    reference: Path | None = None,
    show: Stage = silent,
    tell: Callable[[str], None] = log.info,
) -> Verified:
    """Run the configured reduced model and the full order on the first record, and state the difference.

    Both begin as the configuration's runs do, also where a record's strongest part is taken.

    Parameters
    ----------
    job : a configuration with model.order reduced, as `romdam.load_config` takes one
    out : folder for verification.json and the figure; results there get the statement too
    duration : seconds of the record from its start [s], inf for all that the job runs of it; the strongest
        `WINDOW` of that if None, or the first one where there is a reference, whose times are the record's
    reference : an .npz to compare with as well, see `romdam.error.histories.read_reference`
    show : told of every stage and its progress
    tell : told what the full order is going to cost, before it is run

    Raises
    ------
    RomdamError
        for bad input, a scene without joints, and steps that do not converge.
    """
    job = load_config(job)
    if job.config.model.order == "full":
        raise ConfigError(
            f"{job.path}: model.order is full, there is no reduced model to verify; set it to reduced"
        )
    refuse_without_joints(job)
    folder, clock = prepare_folder(Path(out)), Clock(show)
    stored = read_reference(reference) if reference else None
    motions = load_motions(job.config.records, job.folder)
    first, motion = 0.0, as_run(job, motions[0], duration)
    refuse_drifting(job, motions[:1])
    log_warnings(job, motions[:1])
    moving = any(support.motion is not None for support in job.config.supports)  # they begin at rest
    if duration is None and stored is None and not moving:
        first, motion = strongest_part(motion, WINDOW)
    seconds = min(WINDOW if duration is None else duration, motion.duration)
    refuse_lengths(job, [motion], seconds)
    job, _ = choose_mesh_and_modes(job, motions, clock)
    model = build_model(job, clock)
    job = log_scene_warnings(model.scene, job)
    warm = max(10.0 * motion.dt, job.config.transient.finest_step or 0.0)
    simulate_motion(job, model.prepared, motion, warm)  # compiled kernels are not part of the time
    with clock.stage("reduced", "reduced model") as progress:
        history = simulate_motion(job, model.prepared, motion, seconds, progress)
    reduced = _compared(model, history, stress_fields(model.scene, model.reduced_at_rest))
    full = _compared(model, _full_order(job, model, motion, seconds, reduced, clock, tell), {})
    about = labels(job, motions[0], model.scene) | {
        "first_second": first,
        "cpu_seconds_reduction": clock.cpu["model"],
    }
    if stored is not None:
        about |= against_stored(reduced, full, stored)
    runs = {
        f"{name}, dt {run.stats['finest_step']:g} s": run
        for name, run in (("reduced", reduced), ("full order", full))
    }
    title = f"Reduced model against the unreduced mesh  ·  {motion.name}"
    return write_statement(folder, verification(reduced, full, about), runs, title)


def refuse_without_joints(job: Job) -> None:
    """Refuse a job that has no openings to compare."""
    if not job.config.every_joint:
        raise ConfigError(
            f"{job.path}: joints: there is none, and openings are what is compared; name at least one"
        )


def labels(job: Job, motion: GroundMotion, scene: Scene) -> dict[str, object]:
    """What a statement is of: the record, the configuration and the scene."""
    return {
        "record": motion.name,
        "configuration_file": job.path.name,
        "configuration_sha256": job.digest,
        "scene_sha256": scene_digest(scene),
        "record_sha256": motion.digest,
    }


def write_statement(
    folder: Path, statement: ErrorStatement, runs: Mapping[str, ComparedRun], title: str
) -> Verified:
    """Write a statement, and the figure of the openings of both runs that it compares."""
    from romdam.visual.plots import opening_comparison, save_figure

    figure = opening_comparison({name: (run.time, run.opening) for name, run in runs.items()}, title)
    path = save_figure(figure, folder / f"{statement.kind}.png")
    return Verified(statement, write_verification(folder, statement), path)


def _full_order(
    job: Job,
    model: RunModel,
    motion: GroundMotion,
    seconds: float,
    reduced: ComparedRun,
    clock: Clock,
    tell: Callable[[str], None],
) -> History:
    """Run the unreduced mesh, once its cost is told."""
    dt = source_step(motion, model.system)
    steps = fixed_steps(full_order_step(reduced, dt), float(reduced.time[1]), dt)
    settings = replace(settings_for(job, model.prepared, motion), steps=steps)
    system = observing_stress(model.scene, assemble_full(model.scene, job.config.damping))
    full, ground = prepare(job, system, FULL_ORDER), ground_at_steps(motion, steps.base, seconds, system)
    count = ground.shape[1] - 1
    tell(
        f"{job.path}: {count} steps of the mesh's {system.size} unknowns, about "
        f"{count * full_order_seconds(system):.2g} s, for {seconds:g} s of {motion.name}"
    )
    with clock.stage("full", f"full order, {count} steps") as progress:
        return simulate_one(full, ground, settings, progress)


def _compared(model: RunModel, history: History, fields: dict[str, StressFields]) -> ComparedRun:
    """A run as it is compared, with the largest principal stress of every stress node."""
    history, stress = stress_of(model.scene, fields, history)
    run = compared_openings(model.scene, history, model.system.law.joints)
    return run if stress is None else replace(run, histories={STRESS: stress.largest["principal"]})
