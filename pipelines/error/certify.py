"""The certificate: what leaving out modes has changed in a result, from its own joint forces.

Only the joints are nonlinear. With the joint forces of a run held as known loads the model is linear, and the
motion of the unreduced mesh under them can be computed without solving for contact. Its difference from that
of the reduced model is the defect. A finer reduced model is then integrated with contact, and with the defect
added to its jumps; the difference between its openings and the run's is the error that is stated. This may be
repeated with the corrected joint forces.

The command reads a result, rebuilds its scene from the configuration, and does this for the whole record, or
for windows of it, from which bounds for the whole record follow.
"""

from __future__ import annotations

import json
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from romdam.config.effects import refuse_unknown_effects
from romdam.config.load import Job, parse_config
from romdam.config.parameters import vary
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, ResultError, quote
from romdam.core.final_state import InitialState
from romdam.core.fingerprint import code_digest
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.scene_digest import scene_digest
from romdam.core.system import History, System
from romdam.core.threads import one_thread
from romdam.effects.full_order import assemble_full
from romdam.error.certificate import (
    Correction,
    certificate,
    ready_to_replay,
    replay_forces,
    replay_substeps,
    replayed_models,
)
from romdam.error.estimate import WINDOW
from romdam.error.replay import Defect, Replayed, corrected_run, measure_defect
from romdam.error.sampled import SHORTEST, Sampling, sampled_certificate
from romdam.error.statement import ErrorStatement, write_certificate
from romdam.pipelines.jobs import load_config
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.run import Clock, Stage, reduced_model, silent
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.postprocess.responses import PARAMETER
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import mode_choice
from romdam.reduction.refinement import embedding, mesh_basis, much_finer
from romdam.reduction.synthesis import reduce_scene
from romdam.results.stored_run import FOLDER, StoredRun, read_run
from romdam.results.suite.design import varied_keys
from romdam.timestepping.integrators.registry import integrator_class
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Certified:
    """The error of a result: `statement` as written to `path`, and the corrected run."""

    statement: ErrorStatement
    path: Path
    corrected: History


@one_thread()
def certify(
    result: str | Path,
    config: str | Path | None = None,
    passes: int | None = None,
    show: Stage = silent,
    tell: Callable[[str], None] = log.info,
) -> Certified:
    """State the reduction error of a result.

    Parameters
    ----------
    result : a NetCDF file that `romdam run` wrote
    config : its YAML file; the one that the result names if None
    passes : how often the defect of the whole record is fed back; the change in the last of several is stated
        too. If None, the mesh is solved in windows of the record and the error stated as an interval; once
        throughout where the record is no longer than two windows, without damping, and where supports move or
        the integrator cannot go on from a row
    show : told of every stage and its progress
    tell : told what the mesh's solutions are going to cost, before they begin

    Raises
    ------
    RomdamError
        for a result that cannot be certified, another configuration or record, and steps that fail.
    """
    run = read_run(Path(result))
    job, clock = _of_sample(job_of(run, config), run), Clock(show)
    named = job.config.transient.integrator
    if named is not None and not integrator_class(named).shifts:
        raise ConfigError(
            f"{job.path}: transient.integrator: a certificate adds jumps to a run, and {named} cannot take "
            "them; leave the integrator out, or take `romdam verify`, which runs the mesh itself"
        )
    refuse_unknown_effects(job.config, "certificate", str(job.path))
    motion = _motion(job, run)
    scene = _scene(job, run, clock)
    with clock.stage("model", "reducing the blocks"):
        model = reduced_model(job, scene, None, estimated=False)
    run.refuse_other(scene.gap_position, model.system.size)
    with clock.stage("finer", "reducing a finer model"):
        fine = reduce_scene(scene, much_finer(mode_choice(job.config.model)), job.config.damping)
    with clock.stage("full", "assembling and factoring the full model"):
        full = ready_to_replay(assemble_full(scene, job.config.damping), run.interval)
    settings = settings_for(job, model.prepared, motion, run.steps)
    damped = run.attributes.get("integrator") != "conserving"  # else histories part within a window
    sampled = passes is None and damped and begins_at_rows(model.system)
    sampled = sampled and model.prepared.integrator.resumes and float(run.time[-1]) > SHORTEST
    rows = 2 * round(WINDOW / run.interval) if sampled else (passes or 1) * (len(run.time) - 1)
    with clock.stage("cost", "timing a solution"):
        tell(_cost(full, run, rows))
    finer, joints = prepare(job, fine.system), model.system.law.joints
    if sampled:
        sampling = _sampling(run, motion, finer, full, mesh_basis(scene, fine), settings, clock)
        with clock.stage("replay", "solving the mesh in windows") as progress:
            statement, history = sampled_certificate(run, sampling, joints, progress), sampling.history
    else:
        assert model.reduced is not None
        coarse = Replayed(model.system, run.q[0], mesh_basis(scene, model.reduced))
        embed, static = embedding(scene, model.reduced, fine), job.config.loads.begins == "static"
        models = replayed_models(run, full, coarse, fine.system, embed, static=static)
        correction = _correct(run, motion, models, finer, settings, passes or 1, clock)
        statement, history = certificate(run, correction, joints), correction.corrected
    cpu = {f"cpu_seconds_{name}": seconds for name, seconds in clock.cpu.items()}
    statement = replace(statement, details={**statement.details, **cpu})
    return Certified(statement, write_certificate(run.path, statement), history)


def _scene(job: Job, run: StoredRun, clock: Clock) -> Scene:
    """Build the scene; refuse one that is not the run's, or that cannot be replayed, before it is reduced."""
    with clock.stage("scene", "building the scene"):
        scene = scene_of(job)
    run.refuse_other(scene.gap_position, run.q.shape[1])
    stated = run.attributes.get("scene_sha256")
    if _of_this_code(run) and stated is not None and stated != scene_digest(scene):
        raise ResultError(
            f"{run.path}: was made of another scene than {job.path} is now: a mesh, matrices or "
            "a gap table have changed since; run the configuration again"
        )
    initial = scene.find(InitialState)
    if initial is not None and initial.going_on is not None:
        raise ConfigError(
            f"{job.path}: loads.initial_state.result: the run goes on from the motion in which another one "
            "ended, which is known in that run's modes, and neither the mesh nor the finer model of a "
            "certificate has it; run both records as one with records[].after, and certify that"
        )
    return scene


def _of_this_code(run: StoredRun) -> bool:
    """Tell whether this version of the code made the run: digests of another one need not agree."""
    return run.attributes.get("code_sha256") == code_digest()


def _cost(full: Replayed, run: StoredRun, rows: int) -> str:
    """Say how often the mesh will be solved, and estimate the time by that of one solution."""
    assert full.factor is not None
    begun = time.process_time()
    full.factor.solve(full.start)
    seconds, solutions = time.process_time() - begun, 2 * replay_substeps(run.interval) * rows
    share = min(1.0, rows / (len(run.time) - 1))
    return (
        f"{run.path}: {solutions} solutions with the mesh's {full.system.size} unknowns, about "
        f"{solutions * seconds:.2g} s, over {100 * share:.0f} % of the record; beside it runs of a finer "
        "model"
    )


def begins_at_rows(system: System) -> bool:
    """Whether a run can begin at any row: moving supports and force histories are not in one."""
    return system.pseudo_static is None and not system.signals


def _sampling(
    run: StoredRun,
    motion: GroundMotion,
    finer: Prepared,
    full: Replayed,
    basis: Floats,
    settings: Settings,
    clock: Clock,
) -> Sampling:
    """Run the finer model over the whole record; the mesh is then solved in windows with its joint forces."""
    end = float(run.time[-1])
    ground = ground_at_steps(motion, settings.steps.base, end)
    with clock.stage("finer_run", "running the finer model") as progress:
        history = simulate_one(finer, ground, settings, progress)
    forces = replay_forces(run, history.mean_traction, partial(ground_at_steps, motion, duration=end))
    return Sampling(finer, history, full, basis, forces, ground, settings)


def job_of(run: StoredRun, config: str | Path | None) -> Job:
    """The configuration a result was made with.

    Raises
    ------
    ResultError
        where the record was given as arrays, and where the stored configuration is not the one it states.
    ConfigError
        where the named configuration is another one.
    """
    raw = json.loads(str(run.attributes["configuration"]))
    if isinstance(raw, dict) and not raw.get("records"):
        raise ResultError(
            f"{run.path}: its record was given as arrays in Python, and a certificate reads records again; "
            "write it to a file, name that under `records`, and run it"
        )
    stored = parse_config(raw, f"{run.path}: configuration", si=True)
    folder = run.path.parent / str(run.attributes.get(FOLDER, "."))
    job = Job(stored, folder / str(run.attributes["configuration_file"]))
    if _of_this_code(run) and job.digest != run.attributes["configuration_sha256"]:
        raise ResultError(
            f"{run.path}: its attribute configuration is not the one of SHA-256 "
            f"{quote(run.attributes['configuration_sha256'])} that it states; run it again"
        )  # by other code: keys may have come since
    if config is None:
        return job
    named = load_config(config)
    if named.digest != job.digest:
        raise ConfigError(
            f"{config}: is not the configuration that {run.path} was made with (SHA-256 {named.digest[:12]}, "
            f"there {job.digest[:12]}); give that one, or run this one again"
        )
    return named


def _of_sample(job: Job, run: StoredRun) -> Job:
    """The job with the joints and the damping of the sample that a suite's run is of."""
    suite = job.config.suite
    if suite is None or not any(name.startswith(PARAMETER) for name in run.attributes):
        return job
    config, source = job.config, str(job.path)
    places = varied_keys(job, suite)
    values = {name: float(str(run.attributes[PARAMETER + name])) for name in places}
    return replace(job, config=vary(config, places, values, source).config)


def _motion(job: Job, run: StoredRun) -> GroundMotion:
    """The record of a run, at its scale where it is a suite's."""
    about = json.loads(str(run.attributes["record_provenance"]))
    name, factor = about.get("suite_record", run.attributes["record"]), about.get("suite_scale", 1.0)
    for motion in load_motions(job.config.records, job.folder):
        if motion.name == name:
            motion = replace(motion, acc=factor * motion.acc)
            stored = float(str(run.attributes["record_peak_acceleration"]))
            stated = run.attributes.get("record_sha256", motion.digest)
            if stated != motion.digest or not math.isclose(motion.peak, stored, rel_tol=1e-9):
                raise ResultError(
                    f"{run.path}: was made with another record {name!r}, its samples have changed (peak "
                    f"{stored:.6g} m/s2, now {motion.peak:.6g} m/s2); run the configuration again"
                )
            return motion
    raise ResultError(f"{run.path}: its record {name!r} is not among those of {job.path}")


def _correct(
    run: StoredRun,
    motion: GroundMotion,
    models: tuple[Replayed, Replayed, Replayed],
    finer: Prepared,
    settings: Settings,
    passes: int,
    clock: Clock,
) -> Correction:
    """Feed the full order's defect back into the finer model, `passes` times.

    Parameters
    ----------
    models : the full, the reduced and the finer one
    finer : the last, ready to be integrated
    """
    ground_at = partial(ground_at_steps, motion, duration=float(run.time[-1]), system=finer.system)
    ground = ground_at(settings.steps.base)
    defects, mean, before, corrected = list[Defect](), run.mean, run.jump, None
    for number in range(1, passes + 1):
        if corrected is not None:
            mean, before = corrected.mean_traction, corrected.jump
        forces = replay_forces(run, mean, ground_at)
        with clock.stage(f"replay_{number}", "replaying the joint forces through the full order") as progress:
            defects.append(measure_defect(models, forces, progress))
        with clock.stage(f"correction_{number}", "correcting the run") as progress:
            corrected = corrected_run(finer, ground, settings, defects[-1].jump_fine, progress)
    assert corrected is not None
    return Correction(defects[0], defects[-1], corrected, before)
