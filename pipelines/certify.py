"""The reduction error of a result, from its own joint forces and the full-order linear model."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import romdam
from romdam.config.load import Job, load_config, parse_config
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, ResultError, shown
from romdam.core.motion import GroundMotion
from romdam.core.system import History, System
from romdam.error.comparison import peak_error
from romdam.error.replay import (
    Defect,
    Forces,
    Replayed,
    corrected_run,
    measure_defect,
    replay_start,
)
from romdam.fem.parts import basis_over_unknowns
from romdam.fem.unreduced import assemble_full
from romdam.pipelines.run import Clock, Model, Stage, build_model, silent
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.records.record_set import load_motions
from romdam.reduction.refinement import embedding, much_finer
from romdam.reduction.synthesis import ReducedModel, mode_choice, reduce_scene
from romdam.results.certificate import (
    FOLDER,
    Figures,
    StoredRun,
    as_plain,
    figures,
    read_run,
    write_certificate,
)
from romdam.timestepping.settings import Settings

REPLAY_STEP = (
    0.0025  # [s] longest step of the replay; at twice it the main job's defect doubles, the error stays
)


@dataclass(frozen=True)
class Certificate:
    """What was found: `statement` as written to `path`, and the corrected run."""

    statement: dict[str, object]
    path: Path
    corrected: History


def certify(
    result: str | Path, config: str | Path | None = None, passes: int = 1, show: Stage = silent
) -> Certificate:
    """State the reduction error of a result.

    Parameters
    ----------
    result : a NetCDF file that `romdam run` wrote
    config : its YAML file; found through the result if not given
    passes : how often the defect is fed back; the change in the last of several is stated too
    show : told of every stage and its progress

    Raises
    ------
    RomdamError
        for a result that cannot be certified, another configuration or record, and steps that fail.
    """
    run = read_run(Path(result))
    job, clock = job_of(run, config), Clock(show)
    motion = _motion(job, run)
    model = build_model(job, clock)
    assert model.reduced is not None
    _check_same(run, model)
    with clock.stage("finer", "reducing a finer model"):
        fine = reduce_scene(model.scene, much_finer(mode_choice(job.config.model)), job.config.damping)
    with clock.stage("full", "assembling the full model"):
        full = assemble_full(model.scene, job.config.damping)
    settings = settings_for(job, model.prepared, motion, float(str(run.attributes["solver_finest_step"])))
    ground = ground_at_steps(motion, settings.steps.base, float(run.time[-1]))
    case = _Case(job, model, fine, full, motion)
    found = _correct(case, run, (ground, settings), passes, clock)
    statement = _statement(run, found) | {f"cpu_seconds_{name}": s for name, s in clock.cpu.items()}
    return Certificate(statement, write_certificate(run.path, statement), found.corrected)


def job_of(run: StoredRun, config: str | Path | None) -> Job:
    """The configuration a result was made with.

    Raises
    ------
    ConfigError
        where the given configuration is another one.
    """
    stored = parse_config(json.loads(str(run.attributes["configuration"])), f"{run.path}: configuration")
    folder = run.path.parent / str(run.attributes.get(FOLDER, "."))
    job = Job(stored, folder / str(run.attributes["configuration_file"]))
    ours = (
        str(run.attributes.get("source")) == f"romdam {romdam.__version__}"
    )  # else keys may have come since
    if ours and job.digest != run.attributes["configuration_sha256"]:
        raise ResultError(
            f"{run.path}: its attribute configuration is not the one of SHA-256 "
            f"{shown(run.attributes['configuration_sha256'])} that it states; run it again"
        )
    if config is None:
        return job
    given = load_config(config)
    if given.digest != job.digest:
        raise ConfigError(
            f"{config}: is not the configuration that {run.path} was made with (SHA-256 {given.digest[:12]}, "
            f"there {job.digest[:12]}); give that one, or run this one again"
        )
    return given


def _motion(job: Job, run: StoredRun) -> GroundMotion:
    name = run.attributes["record"]
    for motion in load_motions(job.config.records, job.folder):
        if motion.name == name:
            peak, stored = (
                float(np.abs(motion.acc).max()),
                float(str(run.attributes["record_peak_acceleration"])),
            )
            if not math.isclose(peak, stored, rel_tol=1e-9):
                raise ResultError(
                    f"{run.path}: was made with another record {name!r} (peak {stored:.6g} m/s2, now "
                    f"{peak:.6g} m/s2); run the configuration again"
                )
            return motion
    raise ResultError(f"{run.path}: its record {name!r} is not among those of {job.path}")


def _check_same(run: StoredRun, model: Model) -> None:
    position = np.concatenate([joint.position for joint in model.scene.joints.values()])
    same = run.q.shape[1] == model.system.size and run.position.shape == position.shape
    if not (same and np.allclose(run.position, position, atol=1e-9)):
        raise ResultError(
            f"{run.path}: its {len(run.position)} gaps and {run.q.shape[1]} reduced coordinates are not the "
            f"{len(position)} and {model.system.size} of the scene as it is now; run it again"
        )


@dataclass(frozen=True)
class _Case:
    """The models of one certificate."""

    job: Job
    model: Model
    fine: ReducedModel
    full: System
    motion: GroundMotion


@dataclass(frozen=True)
class _Found:
    """Defect of the run's own forces, corrected histories, and what the last pass still changed."""

    defect: Defect
    corrected: History
    jump: Floats
    disp: Floats
    changed: float


def _correct(
    case: _Case, run: StoredRun, shaking: tuple[Floats, Settings], passes: int, clock: Clock
) -> _Found:
    """Feed the full order's defect back into the finer model."""
    (ground, settings), fine = shaking, prepare(case.job, case.fine.system)
    mean, first, jump, changed = run.mean, None, run.jump, math.nan
    for number in range(1, passes + 1):
        with clock.stage(f"replay_{number}", "replaying the joint forces through the full order") as progress:
            defect = measure_defect(_replayed(case, run), _forces(case, run, mean), progress)
        with clock.stage(f"correction_{number}", "correcting the run") as progress:
            corrected = corrected_run(fine, ground, settings, defect.jump_fine, progress)
        first = first or defect
        changed = figures(jump[..., 0], corrected.jump[..., 0]).l2
        jump, mean = corrected.jump, corrected.mean_traction
    return _Found(first, corrected, jump, corrected.disp + defect.disp_fine, changed)  # type: ignore[arg-type]


def _forces(case: _Case, run: StoredRun, mean: Floats) -> Forces:
    interval = float(run.time[1] - run.time[0])
    substeps = math.ceil(interval / REPLAY_STEP * (1.0 - 1e-9))
    ground = ground_at_steps(case.motion, interval / substeps, float(run.time[-1]))
    return Forces(ground, mean.reshape(len(mean), -1), interval, substeps)


def _replayed(case: _Case, run: StoredRun) -> tuple[Replayed, Replayed, Replayed]:
    assert case.model.reduced is not None
    coarse, scene = case.model.reduced, case.model.scene
    basis = basis_over_unknowns(scene, coarse.basis, coarse.system.size)
    into = embedding(scene, coarse, case.fine)
    static = case.job.config.loads.initial_state == "static"
    q, force = run.q[0], run.traction[0].ravel()
    guesses = (basis @ q, q, into @ q)
    systems = (case.full, coarse.system, case.fine.system)
    starts = [replay_start(s, g, force, static) for s, g in zip(systems, guesses, strict=True)]
    full, reduced, fine = (Replayed(s, u) for s, u in zip(systems, starts, strict=True))
    return full, replace(reduced, basis=basis), fine


def _statement(run: StoredRun, found: _Found) -> dict[str, object]:
    defect, corrected = found.defect, found.corrected
    linear = {
        "opening": _difference(defect.jump_full[:, _normals(run)], defect.jump[:, _normals(run)]),
        "displacement": _difference(defect.disp_full, defect.disp),
        "energy": _energy(defect),
    }
    error = {
        "opening": figures(run.jump[..., 0], found.jump[..., 0]),
        "displacement": figures(run.disp, found.disp),
        "energy": figures(run.strain, corrected.energy["strain"]),
    }
    opening = run.jump[..., 0].max(), found.jump[..., 0].max()
    error["opening"] = replace(error["opening"], peak=peak_error(run.jump[..., 0], found.jump[..., 0]))
    return {
        "statement": _sentence(run, error, linear),
        "record": run.attributes["record"],
        "result": run.path.name,
        "error": as_plain(error),
        "defect_for_the_same_forces": as_plain(linear),
        "last_pass_changed": found.changed,
        "peak_opening": float(opening[0]),
        "peak_opening_corrected": float(opening[1]),
        "configuration_sha256": run.attributes["configuration_sha256"],
    }


def _normals(run: StoredRun) -> slice:
    return slice(None, None, run.jump.shape[2])


def _difference(full: Floats, defect: Floats) -> Figures:
    return figures(full - defect, full)


def _energy(defect: Defect) -> Figures:
    """Strain-energy norm of the difference relative to that of the full-order motion."""
    whole = float(np.sqrt(defect.energy_full.sum()))
    peak = float(np.sqrt(defect.energy_full.max(initial=0.0)))
    if whole == 0.0:
        return Figures(0.0, 0.0)
    return Figures(
        float(np.sqrt(defect.energy.sum())) / whole, float(np.sqrt(defect.energy.max(initial=0.0))) / peak
    )


def _sentence(run: StoredRun, error: dict[str, Figures], linear: dict[str, Figures]) -> str:
    undamped = " Without damping histories part in time; the peak is what counts."
    parting = undamped if run.attributes.get("integrator") == "conserving" else ""
    return (
        f"Certificate, {run.time[-1]:g} s of {run.attributes['record']}: leaving out modes changes "
        f"the openings by {_percent(error['opening'].l2)} in L2 and {_percent(error['opening'].peak)} at "
        f"the peak, displacements by {_percent(error['displacement'].l2)}, strain energy by "
        f"{_percent(error['energy'].l2)}; for the same joint forces the openings differ by "
        f"{_percent(linear['opening'].l2)}. The step's own error is not in it.{parting}"
    )


def _percent(value: float) -> str:
    return f"{100.0 * value:.2g} %"
