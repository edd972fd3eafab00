"""Sizes of a run before it is made; what nobody can have meant is refused."""

from __future__ import annotations

from collections.abc import Iterable

from romdam.config.load import Job
from romdam.core.errors import ConfigError
from romdam.core.motion import GroundMotion
from romdam.core.system import System
from romdam.linalg.solvers import Solving
from romdam.postprocess.record_measures import analysed_share, peak_time
from romdam.records.processing.sequence import members_of

MOST_STEPS = 10**8  # of a run: a record of 300 s in steps of 3 us
LEAST_LEFT = 1e-6  # of a record's peak acceleration, below which what is run of it is a pad
_STEP = 120.0  # bytes while a record is resampled: its three components, times, places and weights
_HISTORY = 32.0  # of every history of a free field: itself, its spectrum and their copies
_SLACK = 1.0 + 1e-9


def refuse_steps(seconds: float, dt: float, location: str) -> None:
    """Refuse a number of steps that no run can have meant.

    Raises
    ------
    ConfigError
        beginning with `location`, a file and what asks for the steps.
    """
    steps = seconds / dt
    if not steps * _SLACK >= 1.0:
        raise ConfigError(
            f"{location}: {seconds:g} s are shorter than one step of {dt:g} s; shorten "
            "transient.finest_step, "
            "or lengthen transient.duration"
        )
    if steps > MOST_STEPS:
        raise ConfigError(
            f"{location}: {seconds:g} s at {dt:g} s a step are {steps:.2g} steps, limit {MOST_STEPS:.0e}; "
            "lengthen transient.finest_step (1 to 5 ms suit most dams), or shorten transient.duration"
        )


def refuse_lengths(job: Job, motions: Iterable[GroundMotion], seconds: float | None = None) -> None:
    """Refuse steps and rows that do not fit the lengths of the records, before any model is made.

    Parameters
    ----------
    seconds : of every record that are run, if not those of `transient.duration`

    Raises
    ------
    ConfigError
        for no step or too many of them, an output interval longer than the run, and a part of a record that
        is rest.
    """
    transient, every = job.config.transient, job.config.outputs.output_interval
    for motion in motions:
        length = seconds or transient.duration or motion.duration
        dt = transient.finest_step or min(every or motion.dt, motion.dt)
        key = "finest_step" if transient.finest_step else "duration"
        for span in (length, motion.duration):  # the whole record is resampled, whatever is run of it
            refuse_steps(span, dt, f"{job.path}: transient.{key}: {motion.name}")
        if every is not None and every > length * _SLACK:
            raise ConfigError(
                f"{job.path}: outputs.output_interval: nothing but the start would be written of "
                f"{motion.name}, {length:g} s at intervals of {every:g} s; 0.01 s suits most dams"
            )
        for member in members_of(motion):
            if not length > float(str(member["start"])):
                key = "transient.duration" if seconds is None else "duration"
                raise ConfigError(
                    f"{job.path}: {key}: {length:g} s of {motion.name} end before its record "
                    f"{member['record']} starts, at {member['start']:g} s; make it longer, or leave it out"
                )
        share, _ = analysed_share(motion, length)
        if share < LEAST_LEFT:
            raise ConfigError(
                f"{job.path}: {'transient.duration' if seconds is None else 'duration'}: the first "
                f"{length:g} s of {motion.name} have a peak of "
                f"{share * motion.peak:.3g} m/s2, all {motion.duration:g} s of it {motion.peak:.3g} m/s2, "
                f"limit {LEAST_LEFT:g} of that: nothing but rest would be run; leave the duration out, or "
                f"make it longer than {peak_time(motion):g} s, when that peak is (the step `pad` of a "
                "correction puts zeros before a record)"
            )


def run_bytes(system: System, steps: float, rows: float) -> float:
    """Memory of a run while it is made and written [bytes].

    Parameters
    ----------
    steps, rows : base steps and rows written
    """
    jumps, coordinates = system.B.shape[0], system.size if system.reduced else 0
    row = 6 * jumps + 2 * len(system.law) + 5 * coordinates + 6 * system.observe.shape[0] + 30
    histories = system.load.shape[1] if system.drives else 0
    histories += 0 if system.pseudo_static is None else 9 * len(system.pseudo_static.motions)
    histories += len(system.signals)
    return (_STEP + _HISTORY * histories) * steps + 8.0 * row * rows


def refuse_bytes(need: float, steps: float, rows: float, location: str) -> None:
    """Refuse a run that does not fit in four fifths of the machine's memory.

    Raises
    ------
    ConfigError
        beginning with `location`, a file and record.
    """
    limit = Solving().limit
    if need > limit:
        raise ConfigError(
            f"{location}: {steps:.3g} steps and {rows:.3g} written rows would take {need / 1e9:.3g} GB of "
            f"memory, limit {limit / 1e9:.3g} GB (four fifths of this machine's); lengthen "
            "outputs.output_interval, name fewer outputs.nodes, or shorten transient.duration"
        )
