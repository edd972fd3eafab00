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
from romdam.error.replay import Replayed, corrected_run, measure_defect
from romdam.error.sampled import SHORTEST, Sampling, sampled_certificate
from romdam.error.statement import ErrorStatement, write_certificate
from romdam.pipelines.jobs import load_config
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.run import Clock, Stage, reduced_model, silent
from romdam.pipelines.simulation import RunModel, ground_at_steps, prepare, settings_for
from romdam.postprocess.responses import PARAMETER
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import mode_choice
from romdam.reduction.refinement import embedding, mesh_basis, much_finer
from romdam.reduction.synthesis import ReducedModel, reduce_scene
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
    _refuse_without_added_jumps(job)
    refuse_unknown_effects(job.config, "certificate", str(job.path))
    motion = _motion(job, run)
    scene = _scene(job, run, clock)
    _refuse_going_on(job, scene)
    with clock.stage("model", "reducing the blocks"):
        model = reduced_model(job, scene, None, estimated=False)
    run.refuse_other(scene.gap_position, model.system.size)
    with clock.stage("finer", "reducing a finer model"):
        fine = reduce_scene(scene, much_finer(mode_choice(job.config.model)), job.config.damping)
    with clock.stage("full", "assembling and factoring the full model"):
        full = ready_to_replay(assemble_full(scene, job.config.damping), _interval(run))
    settings = settings_for(job, model.prepared, motion, run.steps)
    damped = run.attributes.get("integrator") != "conserving"  # else histories part within a window
    sampled = passes is None and damped and begins_at_rows(model.system)
    sampled = sampled and model.prepared.integrator.resumes and float(run.time[-1]) > SHORTEST
    with clock.stage("cost", "timing a solution"):
        tell(_cost(full, run, 2 * round(WINDOW / _interval(run)) if sampled else (passes or 1) * _rows(run)))
    if sampled:
        statement, history = _sampled(job, run, motion, model, fine, full, settings, clock)
    else:
        models = _replayed(job, run, model, fine, full)
        correction = _correct(
            _Certified(run, motion, models, prepare(job, fine.system)), settings, passes or 1, clock
        )
        statement, history = certificate(run, correction, model.system.law.joints), correction.corrected
    cpu = {f"cpu_seconds_{name}": seconds for name, seconds in clock.cpu.items()}
    statement = replace(statement, details={**statement.details, **cpu})
    return Certified(statement, write_certificate(run.path, statement), history)


def _scene(job: Job, run: StoredRun, clock: Clock) -> Scene:
    """The scene, if it is the run's: refused before anything is reduced."""
    with clock.stage("scene", "building the scene"):
        scene = scene_of(job)
    run.refuse_other(scene.gap_position, run.q.shape[1])
    stated = run.attributes.get("scene_sha256")
    if _of_this_code(run) and stated is not None and stated != scene_digest(scene):
        raise ResultError(
            f"{run.path}: was made of another scene than {job.path} is now: a mesh, matrices or "
            "a gap table have changed since; run the configuration again"
        )
    return scene


def _refuse_going_on(job: Job, scene: Scene) -> None:
    """Raise where the run began in the motion in which another one ended."""
    initial = scene.find(InitialState)
    if initial is not None and initial.going_on is not None:
        raise ConfigError(
            f"{job.path}: loads.initial_state.result: the run goes on from the motion in which another one "
            "ended, which is known in that run's modes, and neither the mesh nor the finer model of a "
            "certificate has it; run both records as one with records[].after, and certify that"
        )


def _of_this_code(run: StoredRun) -> bool:
    return run.attributes.get("code_sha256") == code_digest()


def _interval(run: StoredRun) -> float:
    return float(run.time[1] - run.time[0])


def _rows(run: StoredRun) -> int:
    return len(run.time) - 1


def _cost(full: Replayed, run: StoredRun, rows: int) -> str:
    """Say how often the mesh is solved, and how long that is about to take by one solution."""
    assert full.factor is not None
    begun = time.process_time()
    full.factor.solve(full.start)
    seconds, solutions = time.process_time() - begun, 2 * replay_substeps(_interval(run)) * rows
    share = min(1.0, rows / _rows(run))
    return (
        f"{run.path}: {solutions} solutions with the mesh's {full.system.size} unknowns, about "
        f"{solutions * seconds:.2g} s, over {100 * share:.0f} % of the record; beside it runs of a finer "
        "model"
    )


def begins_at_rows(system: System) -> bool:
    """Whether a run can begin at any row: moving supports and force histories are not in one."""
    return system.pseudo_static is None and not system.signals


def _sampled(
    job: Job,
    run: StoredRun,
    motion: GroundMotion,
    model: RunModel,
    fine: ReducedModel,
    full: Replayed,
    settings: Settings,
    clock: Clock,
) -> tuple[ErrorStatement, History]:
    """The statement from windows of the record, and the finer model's run over all of it."""
    finer, end = prepare(job, fine.system), float(run.time[-1])
    ground = ground_at_steps(motion, settings.steps.base, end)
    with clock.stage("finer_run", "running the finer model") as progress:
        history = simulate_one(finer, ground, settings, progress)
    basis = mesh_basis(model.scene, fine)
    forces = replay_forces(run, history.mean_traction, partial(ground_at_steps, motion, duration=end))
    sampling = Sampling(finer, history, full, basis, forces, ground, settings)
    with clock.stage("replay", "solving the mesh in windows") as progress:
        return sampled_certificate(run, sampling, model.system.law.joints, progress), history


def _refuse_without_added_jumps(job: Job) -> None:
    named = job.config.transient.integrator
    if named is not None and not integrator_class(named).shifts:
        raise ConfigError(
            f"{job.path}: transient.integrator: a certificate adds jumps to a run, and {named} cannot take "
            "them; leave the integrator out, or take `romdam verify`, which runs the mesh itself"
        )


def job_of(run: StoredRun, config: str | Path | None) -> Job:
    """The configuration a result was made with.

    Raises
    ------
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


@dataclass(frozen=True)
class _Certified:
    """A run, its ground motion, the models that it is replayed through, and the one it is corrected in.

    The models are the full, the reduced and the finer one; `finer` is the last, ready to be integrated.
    """

    run: StoredRun
    motion: GroundMotion
    models: tuple[Replayed, Replayed, Replayed]
    finer: Prepared


def _replayed(
    job: Job, run: StoredRun, model: RunModel, fine: ReducedModel, full: Replayed
) -> tuple[Replayed, Replayed, Replayed]:
    """The models that a run is replayed through, from its start."""
    assert model.reduced is not None
    basis = mesh_basis(model.scene, model.reduced)
    embed = embedding(model.scene, model.reduced, fine)
    static = job.config.loads.begins == "static"
    mesh, coarse, finer = replayed_models(run, (full.system, model.system, fine.system), basis, embed, static)
    return replace(mesh, factor=full.factor), coarse, finer


def _correct(case: _Certified, settings: Settings, passes: int, clock: Clock) -> Correction:
    """Feed the full order's defect back into the finer model, `passes` times."""
    run, end = case.run, float(case.run.time[-1])
    ground_at = partial(ground_at_steps, case.motion, duration=end, system=case.finer.system)
    ground = ground_at(settings.steps.base)
    correction: Correction | None = None
    for number in range(1, passes + 1):
        mean = run.mean if correction is None else correction.corrected.mean_traction
        forces = replay_forces(run, mean, ground_at)
        with clock.stage(f"replay_{number}", "replaying the joint forces through the full order") as progress:
            defect = measure_defect(case.models, forces, progress)
        with clock.stage(f"correction_{number}", "correcting the run") as progress:
            corrected = corrected_run(case.finer, ground, settings, defect.jump_fine, progress)
        first = defect if correction is None else correction.first
        correction = Correction(
            first, defect, corrected, run.jump if correction is None else correction.corrected.jump
        )
    assert correction is not None
    return correction
