"""The two verifications: a job is run twice on the same record, and what differs is the model or the mesh.

`verify` runs the reduced model and the unreduced mesh. Nothing of it is an estimate. Because the unreduced
run is expensive, it covers the strongest ten seconds of the record unless a duration is given, and its cost
is announced before it begins. A third history, from a file, may be compared with both.

`verify_mesh` runs the job on its mesh and on a sibling of it, with elements of half or of twice the size and
the same steps. The error of the mesh follows from the difference and an order of convergence.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from romdam.config.load import Job, Source, naming_lines
from romdam.core.errors import ConfigError, MeshError, ReductionError
from romdam.core.files import prepare_folder
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.scene_digest import scene_digest
from romdam.core.system import History
from romdam.core.threads import one_thread
from romdam.effects.full_order import assemble_full
from romdam.error.comparison import ComparedRun, compared_openings
from romdam.error.discretisation import MeshRun, SiblingRun, discretisation
from romdam.error.histories import read_reference
from romdam.error.statement import ErrorStatement, write_verification
from romdam.error.verification import STRESS, against_stored, full_order_step, verification
from romdam.fem.stress import observing_stress
from romdam.pipelines.automatic_spacing import automatic_joints
from romdam.pipelines.check import full_order_seconds
from romdam.pipelines.error.sibling import run_with_stress, sibling_jobs, with_stress
from romdam.pipelines.job_warnings import log_scene_warnings, log_warnings
from romdam.pipelines.jobs import load_config
from romdam.pipelines.moving_supports import refuse_drifting
from romdam.pipelines.run import (
    Clock,
    Stage,
    build_model,
    choose_mesh_and_modes,
    silent,
    with_modes_chosen,
    with_spacing_chosen,
)
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


@one_thread()
@naming_lines
def verify_mesh(
    job: Source,
    out: str | Path,
    duration: float | None = None,
    *,
    finer: bool = True,
    show: Stage = silent,
) -> Verified:
    """Run a job on its mesh and on a sibling, on the first record, and state what the mesh changes.

    Parameters
    ----------
    job : a configuration, as `romdam.load_config` takes one
    out : folder for discretisation.json and the figure; results there get the statement too
    duration : seconds of the record from its start [s]; all that the job runs of it if None
    finer : whether elements of the sibling have half the size, else twice
    show : told of every stage and its progress

    Raises
    ------
    RomdamError
        for bad input, a scene without joints, a mesh without a sibling, and steps that do not converge.
    """
    job = load_config(job)
    refuse_without_joints(job)
    sibling_jobs(job, finer=finer)  # refused before records are read
    folder, clock = prepare_folder(Path(out)), Clock(show)
    motions = load_motions(job.config.records, job.folder)[:1]
    refuse_drifting(job, motions)
    log_warnings(job, motions)
    motion = as_run(job, motions[0], duration)
    seconds = motion.duration if duration is None else min(duration, motion.duration)
    refuse_lengths(job, [motion], seconds)
    if job.config.transient.total_accuracy is not None:
        job, _ = choose_mesh_and_modes(job, motions, clock)
    elif automatic_joints(job):
        job = with_spacing_chosen(job, motions, clock)  # the same on both meshes
    siblings = sibling_jobs(job, finer=finer)
    if job.config.model.order != "full":
        job = with_modes_chosen(job, motions, clock)
        siblings = [
            replace(sibling, job=with_modes_chosen(sibling.job, motions, clock)) for sibling in siblings
        ]
    run, scene = run_on_mesh(job, motion, seconds, clock, "run")
    others = list[SiblingRun]()
    try:
        for sibling in siblings:
            other, _ = run_on_mesh(sibling.job, motion, seconds, clock, f"sibling, {sibling.direction}")
            others.append(SiblingRun(sibling.direction, sibling.times, other))
    except (ConfigError, MeshError, ReductionError) as error:
        instead = "coarser" if finer else "finer"
        raise ConfigError(
            f"on the {'finer' if finer else 'coarser'} mesh: {error}; or compare with `--mesh {instead}`"
        ) from None
    size = "half" if finer else "twice"
    about = labels(job, motions[0], scene) | {
        "seconds": seconds,
        "cpu_seconds_run": clock.cpu["run"],
        "cpu_seconds_sibling": sum(clock.cpu[f"sibling, {each.direction}"] for each in siblings),
    }
    runs = {
        f"{name}, {each.unknowns} unknowns": each
        for name, each in (("mesh", run), (f"{'finer' if finer else 'coarser'} mesh", other))
    }
    title = f"The mesh and elements of {size} the size  ·  {motion.name}"
    return write_statement(folder, discretisation(run, others, finer=finer, about=about), runs, title)


def run_on_mesh(
    job: Job, motion: GroundMotion, seconds: float, clock: Clock, stage: str
) -> tuple[MeshRun, Scene]:
    """Build a job's model and run it.

    Parameters
    ----------
    seconds : of the motion from its start [s]
    stage : what the clock calls model and run together
    """
    with clock.stage(stage, f"{stage} on {job.path.name}") as progress:
        model = with_stress(build_model(job, Clock(silent)))
        log_scene_warnings(model.scene, job)
        history = simulate_motion(job, model.prepared, motion, seconds, progress)
    return run_with_stress(model, history), model.scene


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
