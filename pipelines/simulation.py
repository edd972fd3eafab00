"""Ground motions on prepared systems, with the integrator and the steps that a configuration asks for."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from romdam.config.load import Job
from romdam.config.plausible import odd_at_rest
from romdam.core.arrays import Floats
from romdam.core.errors import ConvergenceError, placed
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History, System
from romdam.error.estimate import FinerModel
from romdam.pipelines.sizes import refuse_bytes, refuse_steps, run_bytes
from romdam.records.processing.force_rows import add_force_rows, force_warnings, step_of_signals
from romdam.records.processing.incoherence import incoherent_motions
from romdam.records.processing.resampling import cut_or_extended, resample_motion
from romdam.records.processing.support_motions import add_support_rows, late_warnings, lines_of
from romdam.reduction.synthesis import DryModel, ReducedModel
from romdam.results.stress.file import StressFields
from romdam.timestepping.construction import constructed
from romdam.timestepping.contact_resolution import resolution_warnings
from romdam.timestepping.grouting import grouted
from romdam.timestepping.hysteretic import FrequencyDomain
from romdam.timestepping.initial_joints import with_joint_state
from romdam.timestepping.integrators.registry import integrator_class, suitable_integrator
from romdam.timestepping.prepared import Outcome, Prepared, Progress
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import history_of, simulate
from romdam.timestepping.soundness import refuse_active_damping
from romdam.timestepping.step_control import simulate_to
from romdam.timestepping.steps import grid_steps
from romdam.timestepping.sustained import before_rest, rested
from romdam.timestepping.uplift import with_uplift_at_rest

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RunModel:
    """A scene and its prepared system; no `reduced` at full order, no `finer` without an error estimate.

    `stress` holds, block by block, the stress of the reduced coordinates where it is asked for; `finer_dry`
    is the finer model before effects act, where other materials and levels are made of it.
    """

    scene: Scene
    prepared: Prepared
    reduced: ReducedModel | None
    finer: FinerModel | None = None
    stress: dict[str, StressFields] = field(default_factory=dict)
    finer_dry: DryModel | None = None

    @property
    def system(self) -> System:
        """The open-joint system."""
        return self.prepared.system

    @property
    def reduced_at_rest(self) -> ReducedModel | None:
        """The reduced model with the system that is shaken; None at full order."""
        return None if self.reduced is None else replace(self.reduced, system=self.system)

    @property
    def mesh_unknowns(self) -> int:
        """Three for each node, held ones too."""
        return sum(block.points.size for block in self.scene.blocks.values())


def prepare(
    job: Job, system: System, integrator: str | None = None, like: Prepared | None = None
) -> Prepared:
    """Make a system ready for the configured integrator, or for the one that suits it.

    It goes through the stages of its construction, its joints are grouted, the uplift in them is that of
    their cracks at rest, and with moduli by duration it begins at rest under the sustained ones.

    Parameters
    ----------
    integrator : name of the one to take instead
    like : a system that differs in damping and in its joints' parameters at most: what is found out about
        one is not sought again
    """
    transient = job.config.transient
    name = integrator or transient.integrator or suitable_integrator(system)
    with placed(job.path):
        refuse_active_damping(system)
    ready = grouted(constructed(before_rest(system), transient.tolerance), transient.tolerance)
    if system.initial is not None and system.initial.take == "joints":  # whose cracks the uplift follows
        ready = with_uplift_at_rest(with_joint_state(ready), transient.tolerance)
    else:
        ready = with_joint_state(with_uplift_at_rest(ready, transient.tolerance))
    ready = rested(ready, transient.tolerance)
    kind = FrequencyDomain if system.hysteretic is not None else integrator_class(name)
    fresh = Prepared(ready, kind.configured(transient))
    if like is None:
        return fresh
    return replace(fresh, symmetries=like.symmetries, propagators=like.propagators)


def simulate_motions(
    job: Job,
    prepared: Sequence[Prepared],
    motions: Sequence[GroundMotion],
    duration: float | None = None,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Integrate ground motions as the configuration says, together those that have the same steps.

    Parameters
    ----------
    prepared : one for each motion; they differ in damping and in the joints' parameters at most
    duration : seconds from the records' start, or their whole lengths [s]
    progress : called with (steps done, steps in all) of every run

    Returns
    -------
    list, in the order of the motions: the history, or why there is none

    Raises
    ------
    ConfigError
        where the integrator does not suit the scene, and for runs too large.
    """
    settings = [
        replace(settings_for(job, ready, motion), start=ready.goes_on_from)
        for ready, motion in zip(prepared, motions, strict=True)
    ]
    refuse_large(job, list(zip(prepared, motions, settings, strict=True)), duration)
    accuracy, asked_step = job.config.transient.step_accuracy, job.config.transient.finest_step
    for finest in sorted({run_settings.steps.finest for run_settings in settings}):
        if asked_step is not None and finest < asked_step * (1.0 - 1e-6):
            text = "%s: transient.finest_step: %.6g s is taken, a whole part of the record's step, not %.6g s"
            log.info(text, job.path, finest, asked_step)
    kinds = [
        (member.integrator, run_settings) for member, run_settings in zip(prepared, settings, strict=True)
    ]
    outcomes: dict[int, Outcome] = {}
    for kind in dict.fromkeys(kinds):
        group = [i for i, other in enumerate(kinds) if other == kind]
        some, run_settings = [prepared[i] for i in group], kind[1]
        grounds = [
            partial(ground_at_steps, motions[i], duration=duration, system=prepared[i].system) for i in group
        ]
        if accuracy is None:
            histories = simulate(
                some, [ground(run_settings.steps.base) for ground in grounds], run_settings, progress
            )
        else:
            of_slips = job.config.transient.slip_accuracies
            histories = simulate_to(some, grounds, run_settings, accuracy, progress, of_slips)
        outcomes.update(zip(group, histories, strict=True))
    return [_with_run_warnings(job, outcomes[i], prepared[i].system, motions[i]) for i in range(len(motions))]


def with_odd_values(job: Job, error: ConvergenceError) -> ConvergenceError:
    """An error of the state at rest, with the values of the job that it may be of."""
    odd = odd_at_rest(job.config, job.scene_warnings) if str(error).startswith("initial state:") else ()
    return type(error)("; ".join((f"{error}", *odd))) if odd else error


def _with_run_warnings(job: Job, outcome: Outcome, system: System, motion: GroundMotion) -> Outcome:
    """The outcome, with what is lost of fast contact, forces that vary in time, and late supports."""
    if not isinstance(outcome, History):
        return with_odd_values(job, outcome)
    said, end = resolution_warnings(outcome, system), float(outcome.time[-1])
    if system.signals:
        said += force_warnings(system.signals, outcome.stats["base_step"], end)
    if system.pseudo_static is not None:
        said += late_warnings(system.pseudo_static.motions, motion, end)
    return replace(outcome, warnings=(*outcome.warnings, *said))


def source_step(motion: GroundMotion, system: System) -> float:
    """Longest step that is worth taking: the record's, or that of forces that vary in time [s]."""
    return step_of_signals(motion.dt, system.signals)


def simulate_motion(
    job: Job,
    prepared: Prepared,
    motion: GroundMotion,
    duration: float | None = None,
    progress: Progress | None = None,
) -> History:
    """Integrate one ground motion, as `simulate_motions`.

    Raises
    ------
    ConfigError
        as `simulate_motions` does.
    ConvergenceError
        where a step does not converge.
    """
    with placed(job.path):
        return history_of(simulate_motions(job, [prepared], [motion], duration, progress)[0])


def refuse_large(
    job: Job, cases: Sequence[tuple[Prepared, GroundMotion, Settings]], duration: float | None
) -> None:
    """Refuse runs that together do not fit in memory, before anything of them is made.

    Raises
    ------
    ConfigError
        with the sizes and the limit.
    """
    need = steps = rows = 0.0
    for prepared, motion, settings in cases:
        count = (motion.duration if duration is None else duration) / settings.steps.base
        stride = 1 if settings.every_step else settings.steps.stride
        need += run_bytes(prepared.system, count, count / stride)
        steps, rows = steps + count, rows + count / stride
    names = ", ".join(motion.name for _, motion, _ in cases[:3])
    refuse_bytes(need, steps, rows, f"{job.path}: {names}")


def settings_for(
    job: Job, prepared: Prepared, motion: GroundMotion, chosen: tuple[float, float] | None = None
) -> Settings:
    """Settings of a job for one ground motion.

    Parameters
    ----------
    chosen : finest and base step of a run that was made already; they are taken where an accuracy has chosen
        them [s]
    """
    transient, interval = job.config.transient, job.config.outputs.output_interval
    if transient.finest_step is not None:
        dt = source_step(motion, prepared.system)
        steps = prepared.integrator.steps(transient.finest_step, dt, interval)
    else:  # those that an accuracy starts from, or has come to
        steps = grid_steps(source_step(motion, prepared.system), interval)
        if chosen is not None:
            finest, base = chosen
            steps = prepared.integrator.steps(finest, base, steps.interval)
    return Settings(
        steps=steps,
        tolerance=transient.tolerance,
        initial_state=job.config.loads.begins,
        every_step=job.config.outputs.floor_spectra is not None,
    )


def as_run(job: Job, motion: GroundMotion, asked: float | None = None) -> GroundMotion:
    """The part of a motion that the job runs, up to its `duration`; all where some seconds are asked for."""
    seconds = job.config.transient.duration
    if seconds is None or seconds >= motion.duration or (asked is not None and math.isfinite(asked)):
        return motion
    return replace(motion, acc=motion.acc[:, : round(seconds / motion.dt) + 1])


def ground_at_steps(
    motion: GroundMotion, dt: float, duration: float | None, system: System | None = None
) -> Floats:
    """(3, nt) ground acceleration at every step, cut to `duration` or followed by rest up to it.

    With what supports move against the base, and forces that vary in time, where a system is given that has
    them; rows as `romdam.core.motion.ground_rows` has them.
    """
    refuse_steps(motion.duration if duration is None else duration, dt, motion.name)
    acc = resample_motion(motion, dt, band_limited=system is not None and system.needs_whole_record)
    if duration is not None:
        acc = cut_or_extended(acc, round(duration / dt) + 1)
    if system is None:
        return acc
    moving, ground = system.pseudo_static, acc
    if moving is not None:
        lines_at_steps = partial(lines_of, dt=dt, band_limited=system.needs_whole_record)
        at_stations = None
        if moving.incoherence is not None:
            at_stations = [
                lines_at_steps(replace(motion, acc=own))
                for own in incoherent_motions(motion, moving.incoherence)
            ]
        ground = add_support_rows(acc, dt, moving.motions, lines_at_steps(motion), at_stations)
    return add_force_rows(ground, dt, system.signals)
