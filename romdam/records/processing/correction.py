"""Correction of a record: the steps of a configuration applied in order, with a log of what each did.

All components of a record go through together, so that corners and pads are common to them. A correction is
refused where most of the motion is gone; of the pads that it added only those samples are kept in which the
ground still moves.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from romdam.config.base import Model
from romdam.config.sections.motions.correction import (
    ButterworthStep,
    CornersStep,
    DetrendStep,
    DisplacementBaselineStep,
    MeanStep,
    PadStep,
    TaperStep,
    VelocityBaselineStep,
)
from romdam.core.errors import RecordError
from romdam.core.motion import MOST_SAMPLES
from romdam.records.measures import measure
from romdam.records.processing import correction_steps as steps
from romdam.records.processing.corners import search_highpass, signal_to_noise_band
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.processing.offset import moving_average

Array = NDArray[np.float64]
NYQUIST_SHARE = 0.75  # gmprocess' cap of the low-pass
LEFT = 0.5  # of a measure, at least
NOISE = 0.01  # of the strongest component's peak; a weaker component is not judged by itself
COMPARED = {"pga": ("PGA", "m/s2"), "pgv": ("PGV", "m/s"), "arias": ("Arias intensity", "m/s")}
REST = 1e-3  # of the peaks: the ground is at rest below
LONG = 2.0  # times the record's duration: what pads cost is said


@dataclass(frozen=True)
class Signal:
    """A record on its way through the steps.

    Attributes
    ----------
    acc : (k, nt) components [m/s2], pads included
    dt : [s]
    before, after : samples of padding at the ends
    corners : highpass and lowpass chosen so far [Hz]
    magnitude : of the earthquake; None where the record does not say it
    log : one entry per step done, plain JSON values
    warnings : sentences
    """

    acc: Array
    dt: float
    before: int = 0
    after: int = 0
    corners: tuple[float | None, float | None] = (None, None)
    magnitude: float | None = None
    log: tuple[dict[str, object], ...] = ()
    warnings: tuple[str, ...] = field(default=())

    @property
    def record(self) -> slice:
        """The samples of the record between its pads."""
        return slice(self.before, self.acc.shape[-1] - self.after)

    @property
    def duration(self) -> float:
        """Time of the record's last sample, without pads [s]."""
        return (self.acc[..., self.record].shape[-1] - 1) * self.dt

    def noted(self, acc: Array, **entry: object) -> Signal:
        """Return this signal with new values and one more entry in its log."""
        return replace(self, acc=acc, log=(*self.log, entry))

    def noted_between_pads(self, record_acc: Array, **entry: object) -> Signal:
        """Return this signal with new values between its pads, (k, nt without pads), and a log entry."""
        acc = self.acc.copy()
        acc[..., self.record] = record_acc
        return self.noted(acc, **entry)


def correct(acc: Array, dt: float, chain: Sequence[Model], magnitude: float | None = None) -> Signal:
    """Apply the steps of `chain` in order.

    Parameters
    ----------
    acc : (k, nt) components [m/s2]
    dt : [s]
    chain : steps of romdam.config.sections.motions.correction
    magnitude : of the earthquake, if it is known; corners from signal to noise ask for it

    Returns
    -------
    Signal; its pads stay.

    Raises
    ------
    RecordError
        when a step cannot do what it is asked.
    """
    signal = Signal(acc, dt, magnitude=magnitude)
    for number, step in enumerate(chain):
        location = f"correction[{number}].{getattr(step, 'step', '')}"
        try:
            signal = STEPS[type(step)](signal, step)
        except RecordError as error:
            raise RecordError(f"{location}: {str(error).removeprefix('correction: ')}") from None
        if isinstance(step, CornersStep) and not any(
            isinstance(later, PadStep | ButterworthStep) for later in chain[number + 1 :]
        ):
            said = f"{location}: nothing uses its corners; put `butterworth` after it"
            signal = replace(signal, warnings=(*signal.warnings, said))
    return signal


def _mean(signal: Signal, step: MeanStep) -> Signal:
    acc = signal.acc[..., signal.record]
    if step.until is None:
        samples = acc.shape[-1]
    elif step.until == "onset":
        samples = steps.pick_onset(acc, signal.dt) or acc.shape[-1]
    else:
        samples = max(1, round(step.until / signal.dt))
        if samples > acc.shape[-1]:
            raise RecordError(
                f"until {step.until:g} s lies behind the record's end at {signal.duration:g} s; leave it out "
                "for the mean of all samples"
            )
    acc = steps.subtract_mean(acc, samples)
    return signal.noted_between_pads(acc, step="mean", seconds=samples * signal.dt)


def _detrend(signal: Signal, step: DetrendStep) -> Signal:
    acc = signal.acc[..., signal.record]
    if step.of == "acceleration":
        acc = steps.subtract_trend(acc, step.order)
    else:
        acc = steps.subtract_velocity_trend(acc, signal.dt, step.order)
    return signal.noted_between_pads(acc, step="detrend", of=step.of, order=step.order)


def _taper(signal: Signal, step: TaperStep) -> Signal:
    acc = signal.acc[..., signal.record]
    n = acc.shape[-1]
    count = round(step.fraction * n) if step.fraction is not None else round((step.length or 0.0) / signal.dt)
    if not 0 < count <= n // 2:
        half = f"longer than half the record ({0.5 * signal.duration:g} s)"
        wrong = half if count else "shorter than a sample"
        raise RecordError(
            f"correction: a taper of {count * signal.dt:g} s is {wrong}; change `fraction` or `length`"
        )
    first, last = (count if step.side in ("both", side) else 0 for side in ("start", "end"))
    acc = steps.taper(acc, first, last)
    return signal.noted_between_pads(acc, step="taper", start_s=first * signal.dt, end_s=last * signal.dt)


def _corners(signal: Signal, step: CornersStep) -> Signal:
    acc = signal.acc[..., signal.record]
    highpass, lowpass = step.highpass, step.lowpass
    if step.method == "ridder":
        highpass = search_highpass(acc, signal.dt, step.target, (step.lowest, step.highest))
    elif step.method == "snr":
        onset = steps.pick_onset(acc, signal.dt)
        highpass, upper = signal_to_noise_band(acc, signal.dt, onset, step.threshold, signal.magnitude)
        lowpass = min(upper, NYQUIST_SHARE * 0.5 / signal.dt, lowpass or np.inf)
    noted = signal.noted(
        signal.acc, step="corners", method=step.method, highpass_hz=highpass, lowpass_hz=lowpass
    )
    return replace(noted, corners=(highpass, lowpass))


def _pad(signal: Signal, step: PadStep) -> Signal:
    if step.length is not None:
        count = round(step.length / signal.dt)
    elif signal.corners[0] is not None:
        count = steps.pad_samples(step.order, signal.corners[0], signal.dt)
    else:
        raise RecordError(
            "correction: pad needs a high-pass corner; put `corners` before it or give `length`"
        )
    if count < 1:
        raise RecordError(
            f"a pad of {step.length:g} s is shorter than a sample, {signal.dt:g} s; lengthen it"
        )
    samples = signal.acc.shape[-1] + 2 * count
    if samples > MOST_SAMPLES:
        raise RecordError(
            f"correction: a pad of {count * signal.dt:g} s on each side makes {samples:.3g} samples, at most "
            f"{MOST_SAMPLES:.3g} are made; raise the high-pass corner or give `length`"
        )
    noted = signal.noted(steps.pad(signal.acc, count, count), step="pad", each_side_s=count * signal.dt)
    return replace(noted, before=signal.before + count, after=signal.after + count)


def _butterworth(signal: Signal, step: ButterworthStep) -> Signal:
    highpass, lowpass = step.highpass or signal.corners[0], step.lowpass or signal.corners[1]
    nyquist = 0.5 / signal.dt
    if highpass is None and lowpass is None:
        raise RecordError("correction: butterworth has no corner; give `highpass` or put `corners` before it")
    remarks = [
        f"butterworth.{name} {corner:g} Hz counts, not the {chosen:g} Hz chosen before"
        for name, corner, chosen in zip(
            ("highpass", "lowpass"), (step.highpass, step.lowpass), signal.corners, strict=True
        )
        if corner is not None and chosen is not None and corner != chosen
    ]
    if highpass is not None and highpass * signal.duration < 1.0:
        remarks.append(
            f"high-pass at {highpass:g} Hz has a period of {1.0 / highpass:g} s, the record lasts "
            f"{signal.duration:g} s: it takes out the mean at most; raise `highpass`"
        )
    if lowpass is not None and lowpass >= 0.95 * nyquist:
        said = f"low-pass at {lowpass:g} Hz left out, Nyquist is {nyquist:g} Hz"
        if highpass is None:
            raise RecordError(f"{said}: nothing is filtered; lower `lowpass`, or leave the step out")
        remarks.append(said)
        lowpass = None
    if highpass is not None and highpass >= min(0.95 * nyquist, lowpass or np.inf):
        limit = f"low-pass at {lowpass:g} Hz" if lowpass else f"Nyquist is {nyquist:g} Hz"
        raise RecordError(f"correction: high-pass at {highpass:g} Hz, {limit}; lower `highpass`")
    acc = steps.butterworth(signal.acc, signal.dt, step.order, (highpass, lowpass), step.causal)
    noted = signal.noted(
        acc,
        step="butterworth",
        order=step.order,
        causal=step.causal,
        highpass_hz=highpass,
        lowpass_hz=lowpass,
    )
    return replace(noted, warnings=(*signal.warnings, *remarks), corners=(highpass, lowpass))


def _displacement_baseline(signal: Signal, step: DisplacementBaselineStep) -> Signal:
    acc = steps.subtract_displacement_baseline(signal.acc, signal.dt, step.order)
    return signal.noted(acc, step="displacement_baseline", order=step.order)


def _velocity_baseline(signal: Signal, step: VelocityBaselineStep) -> Signal:
    acc, dt, duration = signal.acc[..., signal.record], signal.dt, signal.duration
    knots = step.knots
    if not knots:  # the onset and the later time that leave the least velocity, as PRISM's adaptive baseline
        first = max(steps.pick_onset(acc, dt) * dt, 0.01 * duration)
        choices = [(first, later) for later in np.linspace(first, duration, 42)[1:-1]]
        energy = [np.sum(velocity(steps.subtract_velocity_baseline(acc, dt, k), dt) ** 2) for k in choices]
        knots = tuple(float(knot) for knot in choices[int(np.argmin(energy))])
    if max(knots) >= duration or any(b <= a for a, b in itertools.pairwise(knots)):
        raise RecordError(f"correction: knots {knots} must rise and lie within the record's {duration:g} s")
    acc = steps.subtract_velocity_baseline(acc, dt, knots)
    return signal.noted_between_pads(acc, step="velocity_baseline", knots_s=list(knots))


# a new step is one model in romdam.config.sections.motions.correction and one entry here
STEPS: dict[type, Callable[..., Signal]] = {
    MeanStep: _mean,
    DetrendStep: _detrend,
    TaperStep: _taper,
    CornersStep: _corners,
    PadStep: _pad,
    ButterworthStep: _butterworth,
    DisplacementBaselineStep: _displacement_baseline,
    VelocityBaselineStep: _velocity_baseline,
}


def refuse_lost_motion(before: Array, after: Array, dt: float, names: Sequence[str]) -> None:
    """Refuse a correction that leaves less than `LEFT` of PGA, PGV or Arias intensity.

    Drift is no motion: both are compared without their average over some seconds.

    Parameters
    ----------
    before : (k, nt) [m/s2]
    after : (k, nt with pads) [m/s2]
    names : of the components, k

    Raises
    ------
    RecordError
        naming component and measure.
    """
    had, has = (measure(acc - moving_average(acc, dt), dt) for acc in (before, after))
    judged = had["pga"] > NOISE * np.max(had["pga"], initial=0.0)
    for name, (text, unit) in COMPARED.items():
        for row in np.flatnonzero(judged & (has[name] < LEFT * had[name])).tolist():
            raise RecordError(
                f"correction: it leaves {100 * has[name][row] / had[name][row]:.0f} % of the {text} of "
                f"{names[row]} ({had[name][row]:.3g} to {has[name][row]:.3g} {unit}), at least "
                f"{100 * LEFT:g} % must stay; lower the high-pass, raise the low-pass, or take another chain"
            )


def moving_samples(acc: Array, dt: float, before: int, after: int) -> slice:
    """Find the samples that must be kept of a padded record, so that its histories stay.

    Pads are kept as far as the filter's transients reach: cutting them would bring back the drift (Boore
    2005). Further out nothing moves. A start that is cut away leaves out its velocity for the rest of the
    record and its displacement; together they stay below `REST` of the largest displacement. After the end,
    acceleration, velocity and displacement are below `REST` of their peaks.

    Parameters
    ----------
    acc : (k, nt) [m/s2]
    before, after : samples of padding

    Returns
    -------
    slice of the samples
    """
    count = acc.shape[-1]
    vel, disp = velocity(acc, dt), displacement(acc, dt)
    pga, pgv, pgd = (np.max(np.abs(rows)) for rows in (acc, vel, disp))
    left = dt * (count - np.arange(count))
    rests = np.all(np.abs(acc) <= REST * pga, axis=0) & np.all(np.abs(vel) <= REST * pgv, axis=0)
    starts = rests & np.all(np.abs(disp) + np.abs(vel) * left <= REST * pgd, axis=0)
    ends = rests & np.all(np.abs(disp) <= REST * pgd, axis=0)
    moves_first, moves_last = np.flatnonzero(~starts), np.flatnonzero(~ends)
    first = min(before, moves_first[0] - 1 if moves_first.size else before)
    last = max(count - after, moves_last[-1] + 2 if moves_last.size else count - after)
    return slice(max(0, int(first)), min(count, int(last)))


def doubt_pads(samples: int, before: int, after: int, dt: float) -> str:
    """Say what pads cost where they make a record of `samples`, pads included, much longer; else ""."""
    record = samples - before - after
    if samples <= LONG * record:
        return ""
    return (
        f"pads of {before * dt:.4g} s before and {after * dt:.4g} s after make {samples * dt:.4g} s of a "
        f"record of {record * dt:.4g} s, and a run takes {samples / record:.2g} times as long; they hold the "
        "transients of the filter, and a higher high-pass makes them shorter"
    )
