"""One ground motion on one system, with the step and scheme that configuration and scene ask for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from romdam.config.load import Job
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, ConvergenceError, placed
from romdam.core.motion import GroundMotion
from romdam.core.system import History, System
from romdam.pipelines.sizes import refuse_bytes, refuse_steps, run_bytes
from romdam.records.processing.resampling import cut_or_extended, resample_motion
from romdam.timestepping.modal.runs import Case, Progress
from romdam.timestepping.options import TransientOptions
from romdam.timestepping.simulate import integrate, integrate_cases
from romdam.timestepping.step_control import integrate_cases_to, integrate_to, refined_step


def shake(
    job: Job, system: System, motion: GroundMotion, duration: float | None, progress: Progress | None = None
) -> History:
    """Integrate one ground motion as the configuration says.

    Parameters
    ----------
    duration : seconds from the record's start, or its whole length [s]

    Raises
    ------
    ConfigError
        where steps and output interval do not fit, or the integrator does not suit the scene.
    ConvergenceError
        where a step does not converge.
    """
    options = transient_options(job, system, motion)
    refuse_large(job, [(system, motion, options)], duration)
    accuracy = job.config.transient.accuracy
    if accuracy is None:
        with placed(job.path):
            return integrate(system, ground_at_steps(motion, options.dt, duration), options, progress)

    def ground(dt: float) -> Floats:
        return ground_at_steps(motion, dt, duration)

    with placed(job.path):
        return integrate_to(system, ground, options, accuracy, progress)


def shake_together(
    job: Job, systems: Sequence[System], motions: Sequence[GroundMotion]
) -> list[History | ConvergenceError]:
    """Integrate ground motions of one time step together, each on its system, over their whole lengths.

    Parameters
    ----------
    systems : as many as motions; they differ in damping and in the joints' parameters at most

    Returns
    -------
    list, in their order: the history, or why there is none

    Raises
    ------
    ConfigError
        as `shake` does.
    """
    duration, accuracy = job.config.transient.duration, job.config.transient.accuracy
    options = [transient_options(job, *case) for case in zip(systems, motions, strict=True)]
    refuse_large(job, list(zip(systems, motions, options, strict=True)), duration)
    outcomes: dict[int, History | ConvergenceError] = {}
    for one in dict.fromkeys(options):
        group = [i for i, other in enumerate(options) if other == one]
        alike = [systems[i] for i in group]
        grounds = [partial(ground_at_steps, motions[i], duration=duration) for i in group]
        if accuracy is None:
            cases = [Case(system, ground(one.dt)) for system, ground in zip(alike, grounds, strict=True)]
            found = integrate_cases(cases, one)
        else:
            found = integrate_cases_to(alike, grounds, one, accuracy)
        outcomes.update(zip(group, found, strict=True))
    return [outcomes[i] for i in range(len(systems))]


def refuse_large(
    job: Job, cases: Sequence[tuple[System, GroundMotion, TransientOptions]], duration: float | None
) -> None:
    """Refuse runs that together do not fit in memory, before anything of them is made.

    Raises
    ------
    ConfigError
        with the sizes and the limit.
    """
    need = steps = rows = 0.0
    for system, motion, options in cases:
        own = (motion.duration if duration is None else duration) / options.dt
        need += run_bytes(system, own, own / options.stride)
        steps, rows = steps + own, rows + own / options.stride
    names = ", ".join(motion.name for _, motion, _ in cases[:3])
    refuse_bytes(need, steps, rows, f"{job.path}: {names}")


def choose_integrator(job: Job, system: System) -> str:
    """The configured integrator, or the one that suits the scene.

    A reduced scene with plain joints but no damping at all gets the scheme that conserves energy; any
    other reduced scene the one that cuts its steps where contact changes; full order, and modes
    that the dashpots of absorbing faces couple, generalised-alpha.
    """
    transient = job.config.transient
    if transient.integrator is not None:
        return transient.integrator
    if job.config.model.order == "full" or not system.diagonal:
        return "generalized_alpha"
    undamped = system.C.nnz == 0 or not system.C.diagonal().any()
    plain = len(system.law) > 0 and not system.law.laws
    return "conserving" if undamped and plain else "adaptive"


def transient_options(job: Job, system: System, motion: GroundMotion) -> TransientOptions:
    """Integration settings of a job for one ground motion.

    Raises
    ------
    ConfigError
        where `outputs.every` is no whole multiple of `transient.dt`.
    """
    transient, integrator = job.config.transient, choose_integrator(job, system)
    base, cuts, stride = _steps(job, motion, integrator)
    return TransientOptions(
        dt=base,
        stride=stride,
        integrator=integrator,
        rho_inf=transient.rho_inf,
        tolerance=transient.tolerance,
        initial_state=job.config.loads.initial_state,
        cuts=cuts,
        force_change=transient.accuracy or TransientOptions.force_change,
        coordinates=_needs_coordinates(job),
    )


def _needs_coordinates(job: Job) -> bool:
    """Whether anything is made of the histories' coordinates; of a suite that keeps peaks, often not."""
    outputs, suite = job.config.outputs, job.config.suite
    peaks = job.config.pipeline == "suite" and suite is not None and suite.keep == "peaks"
    return not peaks or outputs.error_estimate or outputs.stress is not None


def options_at(job: Job, system: System, motion: GroundMotion, finest: float) -> TransientOptions:
    """Settings of a run that was made already, whose finest step is known."""
    options = transient_options(job, system, motion)
    if job.config.transient.accuracy is None:
        return options
    every = options.dt * options.stride
    adaptive = options.integrator == "adaptive"
    base, cuts = refined_step(finest, options.dt, every) if adaptive else (finest, ())
    return replace(options, dt=base, cuts=cuts, stride=round(every / base))


def _steps(job: Job, motion: GroundMotion, integrator: str) -> tuple[float, tuple[int, ...], int]:
    """Base step, how it is cut, base steps per written row."""
    dt, every = job.config.transient.dt, job.config.outputs.every
    if dt is None:  # an accuracy is given: start from the record's step, or what fits the rows
        interval = every or motion.dt
        parts = math.ceil(interval / motion.dt * (1.0 - 1e-9))
        return interval / parts, (), parts
    check_interval(job)
    base, cuts = refined_step(dt, motion.dt, every) if integrator == "adaptive" else (dt, ())
    return base, cuts, 1 if every is None else round(every / base)


def check_interval(job: Job) -> None:
    """Refuse an output interval that the step does not divide.

    Raises
    ------
    ConfigError
        where `outputs.every` is no whole multiple of `transient.dt`.
    """
    dt, every = job.config.transient.dt, job.config.outputs.every
    if dt is None or every is None:
        return
    ratio = every / dt
    stride = round(ratio)
    if stride < 1 or abs(ratio - stride) > 1e-6 * ratio:
        raise ConfigError(
            f"{job.path}: outputs.every must be a whole multiple of transient.dt ({dt:g} s), "
            f"got {every:g} s; {max(1, stride) * dt:g} s is the nearest"
        )


def fixed_step(options: TransientOptions, dt: float, every: float, integrator: str) -> TransientOptions:
    """The same settings at a fixed step of another integrator."""
    return replace(options, dt=dt, cuts=(), stride=round(every / dt), integrator=integrator)


def ground_at_steps(motion: GroundMotion, dt: float, duration: float | None) -> Floats:
    """(3, nt) ground acceleration at every step, cut to `duration` or followed by rest up to it."""
    refuse_steps(motion.duration if duration is None else duration, dt, motion.name)
    acc = resample_motion(motion, dt)
    if duration is None:
        return acc
    return cut_or_extended(acc, round(duration / dt) + 1)
