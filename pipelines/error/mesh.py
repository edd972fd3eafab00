"""The error of the mesh by `romdam verify --mesh`: a job is run on its own mesh and on a sibling of it.

A sibling has elements of half or of twice the size. Both runs take the same record and the same steps, so
that their difference is due to the mesh alone. The error follows from the difference and an order of
convergence.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from romdam.config.load import Job, Source, naming_lines
from romdam.core.errors import ConfigError, MeshError, ReductionError
from romdam.core.files import prepare_folder
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.threads import one_thread
from romdam.error.discretisation import MeshRun, SiblingRun, discretisation
from romdam.pipelines.automatic_spacing import automatic_joints
from romdam.pipelines.error.sibling import run_with_stress, sibling_jobs, with_stress
from romdam.pipelines.error.verify import Verified, labels, refuse_without_joints, write_statement
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
from romdam.pipelines.simulation import as_run, simulate_motion
from romdam.pipelines.sizes import refuse_lengths
from romdam.records.record_set import load_motions


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
