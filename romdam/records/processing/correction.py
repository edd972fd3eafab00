"""Correction of a record: the steps of a configuration applied in order, with a log of what each did.

All components of a record go through together, so that corners and pads are common to them.
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
from romdam.records.processing import correction_steps as steps
from romdam.records.processing.corners import search_highpass, signal_to_noise_band
from romdam.records.processing.integrate import displacement, velocity

NYQUIST_SHARE = 0.75  # gmprocess' cap of the low-pass


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

    acc: NDArray[np.float64]
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

    def noted(self, acc: NDArray[np.float64], **entry: object) -> Signal:
        """Return this signal with new values and one more entry in its log."""
        return replace(self, acc=acc, log=(*self.log, entry))


def correct(
    acc: NDArray[np.float64], dt: float, chain: Sequence[Model], magnitude: float | None = None
) -> Signal:
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


def check_processed(acc: NDArray[np.float64], dt: float) -> tuple[str, ...]:
    """Say where a record that is used as it is still drifts.

    A velocity above 1 % of its peak or a displacement above 10 % of its peak at the end is what is left of
    a baseline, or a permanent offset; the structure sees the first as a constant acceleration.
    """
    vel, disp = velocity(acc, dt), displacement(acc, dt)
    remarks = []
    for name, history, limit, unit in (("velocity", vel, 0.01, "m/s"), ("displacement", disp, 0.1, "m")):
        peak, last = np.max(np.abs(history), axis=-1), np.abs(history[..., -1])
        share = np.max(np.where(peak > 0.0, last / np.where(peak > 0.0, peak, 1.0), 0.0))
        if share > limit:
            remarks.append(
                f"the {name} ends at {np.max(last):.3g} {unit}, {100 * share:.1f} % of its peak "
                f"(limit {100 * limit:g} %); correct the record, or take the offset for real"
            )
    return tuple(remarks)


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
                f"until {step.until:g} s lies behind the record's end at {_length(signal):g} s; leave it out "
                "for the mean of all samples"
            )
    acc = steps.subtract_mean(acc, samples)
    return signal.noted(_with(signal, acc), step="mean", seconds=samples * signal.dt)


def _with(signal: Signal, record_acc: NDArray[np.float64]) -> NDArray[np.float64]:
    acc = signal.acc.copy()
    acc[..., signal.record] = record_acc
    return acc


def _detrend(signal: Signal, step: DetrendStep) -> Signal:
    acc = signal.acc[..., signal.record]
    if step.of == "acceleration":
        acc = steps.subtract_trend(acc, step.order)
    else:
        acc = steps.subtract_velocity_trend(acc, signal.dt, step.order)
    return signal.noted(_with(signal, acc), step="detrend", of=step.of, order=step.order)


def _taper(signal: Signal, step: TaperStep) -> Signal:
    acc = signal.acc[..., signal.record]
    n = acc.shape[-1]
    count = round(step.fraction * n) if step.fraction is not None else round((step.length or 0.0) / signal.dt)
    if not 0 < count <= n // 2:
        raise RecordError(
            f"correction: a taper of {count * signal.dt:g} s is "
            + (
                f"longer than half the record ({0.5 * _length(signal):g} s)"
                if count
                else "shorter than a sample"
            )
            + "; change `fraction` or `length`"
        )
    first, last = (count if step.side in ("both", side) else 0 for side in ("start", "end"))
    acc = steps.taper(acc, first, last)
    return signal.noted(_with(signal, acc), step="taper", start_s=first * signal.dt, end_s=last * signal.dt)


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
    warnings = (*signal.warnings, *_corner_warnings(signal, step))
    if lowpass is not None and lowpass >= 0.95 * nyquist:
        said = f"low-pass at {lowpass:g} Hz left out, Nyquist is {nyquist:g} Hz"
        if highpass is None:
            raise RecordError(f"{said}: nothing is filtered; lower `lowpass`, or leave the step out")
        warnings, lowpass = (*warnings, said), None
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
    return replace(noted, warnings=warnings, corners=(highpass, lowpass))


def _corner_warnings(signal: Signal, step: ButterworthStep) -> tuple[str, ...]:
    """Say where a corner is chosen twice, and where the record is too short for one."""
    remarks = [
        f"butterworth.{name} {corner:g} Hz counts, not the {chosen:g} Hz chosen before"
        for name, corner, chosen in zip(
            ("highpass", "lowpass"), (step.highpass, step.lowpass), signal.corners, strict=True
        )
        if corner is not None and chosen is not None and corner != chosen
    ]
    highpass = step.highpass or signal.corners[0]
    if highpass is not None and highpass * _length(signal) < 1.0:
        remarks.append(
            f"high-pass at {highpass:g} Hz has a period of {1.0 / highpass:g} s, the record lasts "
            f"{_length(signal):g} s: it takes out the mean at most; raise `highpass`"
        )
    return tuple(remarks)


def _length(signal: Signal) -> float:
    """Time of the record's last sample, without pads [s]."""
    return (signal.acc[..., signal.record].shape[-1] - 1) * signal.dt


def _displacement_baseline(signal: Signal, step: DisplacementBaselineStep) -> Signal:
    acc = steps.subtract_displacement_baseline(signal.acc, signal.dt, step.order)
    return signal.noted(acc, step="displacement_baseline", order=step.order)


def _velocity_baseline(signal: Signal, step: VelocityBaselineStep) -> Signal:
    acc = signal.acc[..., signal.record]
    knots = step.knots or _best_knots(acc, signal.dt)
    duration = (acc.shape[-1] - 1) * signal.dt
    if max(knots) >= duration or any(b <= a for a, b in itertools.pairwise(knots)):
        raise RecordError(f"correction: knots {knots} must rise and lie within the record's {duration:g} s")
    acc = steps.subtract_velocity_baseline(acc, signal.dt, knots)
    return signal.noted(_with(signal, acc), step="velocity_baseline", knots_s=list(knots))


def _best_knots(acc: NDArray[np.float64], dt: float) -> tuple[float, ...]:
    """The onset and the later time that leave the least velocity (as PRISM's adaptive baseline searches)."""
    duration = (acc.shape[-1] - 1) * dt
    first = max(steps.pick_onset(acc, dt) * dt, 0.01 * duration)
    choices = [(first, later) for later in np.linspace(first, duration, 42)[1:-1]]
    left = [np.sum(velocity(steps.subtract_velocity_baseline(acc, dt, knots), dt) ** 2) for knots in choices]
    return tuple(float(knot) for knot in choices[int(np.argmin(left))])


# the visible list: a new step is one model in config/correction.py and one entry here
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
