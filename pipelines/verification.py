"""How far the reduced model is from the unreduced one: both run, in one go, on the same record."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from romdam.config.load import Job
from romdam.core.errors import ConfigError
from romdam.core.files import prepare_folder
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.error.comparison import (
    Difference,
    Openings,
    compare_openings,
    peak_error,
    read_reference,
    write_statement,
)
from romdam.fem.unreduced import assemble_full
from romdam.pipelines.doubts import tell_doubts
from romdam.pipelines.run import Clock, Model, Stage, build_model, settled, silent
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for, simulate_motion
from romdam.pipelines.sizes import refuse_lengths
from romdam.pipelines.stresses import observing_stress, stress_fields, stress_of
from romdam.postprocess.stress import StressSummary
from romdam.records.record_set import load_motions
from romdam.results.stress.file import StressFields
from romdam.timestepping.integrators.registry import FULL_ORDER
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.steps import whole_steps

REFINEMENT = 4  # the full order steps at the reduced model's finest step / 4, where its own error is about
# 0.3 of the reduced model's,
SAMPLE = 16  # but at no less than this part of the record's step, to end in minutes


@dataclass(frozen=True)
class Verification:
    """What was compared and what came out.

    Attributes
    ----------
    statement : everything as plain values, as written to verification.json
    path : that file
    figure : both opening histories
    """

    statement: dict[str, object]
    path: Path
    figure: Path


@dataclass(frozen=True)
class Marched:
    """One integration, its step where contact changes, its openings, its stress where that is asked for."""

    history: History
    dt: float
    openings: Openings
    stress: StressSummary | None


def verify(
    job: Job, out: str | Path, duration: float = 10.0, reference: Path | None = None, show: Stage = silent
) -> Verification:
    """Run the configured reduced model and the full order on the first record, and state the difference.

    Parameters
    ----------
    job : a configuration with model.order reduced
    out : folder for verification.json and the figure; results there get the statement too
    duration : seconds of the record [s]
    reference : an .npz to compare with as well, see `romdam.error.comparison.read_reference`
    show : told of every stage and its progress

    Raises
    ------
    RomdamError
        for bad input, a scene without joints, and steps that do not converge.
    """
    _refuse_what_cannot_be_verified(job)
    folder, clock = prepare_folder(Path(out)), Clock(show)
    stored = read_reference(reference) if reference else None
    motions = load_motions(job.config.records, job.folder)
    refuse_lengths(job, motions[:1], min(duration, motions[0].duration))
    tell_doubts(job, motions[:1])
    motion, job = motions[0], settled(job, motions, clock)
    model = build_model(job, clock)
    seconds = min(duration, motion.duration)
    reduced = _reduced(job, model, motion, seconds, clock)
    full = _full(job, model, (motion, seconds, reduced), clock)
    names = ("the reduced model", "the full order")
    statement = _statement(
        job, motion, (reduced, full), compare_openings(reduced.openings, full.openings, names)
    )
    statement["joints"] = _joint_peaks(model.system.law.joints, reduced.openings, full.openings)
    statement["cpu_seconds_reduction"] = clock.cpu["model"]
    if stored is not None and reference is not None:
        statement |= _against_reference(reference, stored, reduced, full)
    figure = _draw(folder, motion, reduced, full)
    return Verification(statement, write_statement(folder, statement), figure)


def _refuse_what_cannot_be_verified(job: Job) -> None:
    if job.config.model.order == "full":
        raise ConfigError(
            f"{job.path}: model.order is full, there is no reduced model to verify; set it to reduced"
        )
    if not job.config.every_joint:
        raise ConfigError(
            f"{job.path}: joints: there is none, and openings are what is compared; name at least one"
        )


def _reduced(job: Job, model: Model, motion: GroundMotion, seconds: float, clock: Clock) -> Marched:
    warm = max(10.0 * motion.dt, job.config.transient.finest_step or 0.0)
    simulate_motion(job, model.prepared, motion, warm)  # compiled kernels are not part of the time
    with clock.stage("reduced", "reduced model") as progress:
        history = simulate_motion(job, model.prepared, motion, seconds, progress)
    return _marched(model.scene, history, stress_fields(model.scene, model.reduced))


def _full(job: Job, model: Model, what: tuple[GroundMotion, float, Marched], clock: Clock) -> Marched:
    motion, seconds, reduced = what
    every = float(reduced.history.time[1])
    wanted = max(reduced.dt / REFINEMENT, motion.dt / SAMPLE)
    settings = replace(settings_for(job, model.prepared, motion), steps=whole_steps(every, wanted))
    system = observing_stress(model.scene, assemble_full(model.scene, job.config.damping))
    full, ground = prepare(job, system, FULL_ORDER), ground_at_steps(motion, settings.steps.base, seconds)
    with clock.stage("full", f"full order, {ground.shape[1] - 1} steps") as progress:
        history = simulate_one(full, ground, settings, progress)
    return _marched(model.scene, history, {})


def _marched(scene: Scene, history: History, fields: dict[str, StressFields]) -> Marched:
    position = np.concatenate([joint.position for joint in scene.joints.values()])
    history, stress = stress_of(scene, fields, history)
    openings = Openings(history.time, history.jump[:, :, 0], position)
    return Marched(history, history.stats["finest_step"], openings, stress)


def _joint_peaks(joints: dict[str, slice], reduced: Openings, full: Openings) -> dict[str, dict[str, float]]:
    """Joint -> its peak opening in both runs [m], and the relative difference."""
    found = {}
    for name, gaps in joints.items():
        peak, whole = (float(run.opening[:, gaps].max()) for run in (reduced, full))
        error = peak_error(reduced.opening[:, gaps], full.opening[:, gaps])
        found[name] = {"peak": peak, "peak_full": whole, "peak_error": error}
    return found


def _stress_difference(reduced: Marched, full: Marched) -> dict[str, object]:
    """How far the envelopes of the major principal stress are apart; empty where no stress is asked for."""
    if reduced.stress is None or full.stress is None:
        return {}
    a, b = (run.stress.largest["principal"] for run in (reduced, full) if run.stress is not None)
    peak = float(np.abs(b).max())
    return {
        "peak_principal_stress": float(a.max()),
        "peak_principal_stress_full": float(b.max()),
        "peak_principal_stress_error": abs(float(a.max() - b.max())) / peak,
        "principal_stress_worst_node_error": float(np.abs(a - b).max()) / peak,
    }


def _statement(
    job: Job, motion: GroundMotion, runs: tuple[Marched, Marched], difference: Difference
) -> dict[str, object]:
    reduced, full = runs
    cpu, cpu_full = (run.history.stats["loop_cpu_seconds"] for run in runs)
    per_step, per_step_full = (
        run.history.stats["loop_cpu_seconds"] / run.history.stats["steps"] for run in runs
    )
    return {
        "statement": _sentence(full.dt, motion.name, difference),
        "record": motion.name,
        **asdict(difference),
        **_stress_difference(reduced, full),
        "dt": reduced.dt,
        "dt_full": full.dt,
        "cpu_seconds": cpu,
        "cpu_seconds_full": cpu_full,
        "cpu_ratio": cpu_full / cpu,
        "cpu_seconds_per_step": per_step,
        "cpu_seconds_per_step_full": per_step_full,
        "cpu_ratio_per_step": per_step_full / per_step,
        "configuration_file": job.path.name,
        "configuration_sha256": job.digest,
    }


def _sentence(dt: float, record: str, difference: Difference) -> str:
    return (
        f"Against the unreduced mesh (generalised-alpha, dt {dt:g} s), {difference.seconds:g} s of {record}: "
        f"peak opening differs by {100 * difference.peak_error:.2g} %, "
        f"all openings by {100 * difference.l2_error:.2g} % in L2."
    )


def _against_reference(path: Path, stored: Openings, reduced: Marched, full: Marched) -> dict[str, object]:
    both = {"reduced": reduced, "full": full}
    return {
        f"{name}_against_reference": asdict(
            compare_openings(run.openings, stored, (f"the {name} model", str(path)))
        )
        for name, run in both.items()
    }


def _draw(folder: Path, motion: GroundMotion, reduced: Marched, full: Marched) -> Path:
    from romdam.visual.plots import opening_comparison, save_figure

    labels = (f"reduced, dt {reduced.dt:g} s", f"full order, dt {full.dt:g} s")
    histories = {
        label: (run.openings.time, run.openings.opening)
        for label, run in zip(labels, (reduced, full), strict=True)
    }
    figure = opening_comparison(histories, f"Reduced model against the unreduced mesh  ·  {motion.name}")
    return save_figure(figure, folder / "verification.png")
