"""The steps of a record's correction, and the named chains made of them."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Discriminator, Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Dimensionless, Frequency, Time, Whole

Positive = Field(gt=0.0)
Order = Annotated[Whole, Field(ge=1, le=10)]


class MeanStep(Model):
    """Subtract the mean of the samples before `until` (a time, or the picked onset); none means of all."""

    step: Literal["mean"] = "mean"
    until: Annotated[Time, Positive] | Literal["onset"] | None = None
    """Time, or the picked onset, up to which the mean is taken; that of all samples if not given."""


class DetrendStep(Model):
    """Subtract the least-squares polynomial of acceleration, or the derivative of that of velocity."""

    step: Literal["detrend"] = "detrend"
    order: Annotated[Whole, Field(ge=0, le=10)] = 1
    """Order of the polynomial."""
    of: Literal["acceleration", "velocity"] = "acceleration"
    """Quantity that the polynomial is fitted to."""


class TaperStep(Model):
    """Cosine taper over a fraction of the record (each side), or over a length in seconds."""

    step: Literal["taper"] = "taper"
    fraction: Annotated[Dimensionless, Field(gt=0.0, le=0.5)] | None = None
    """Fraction of the record that is tapered, on each side."""
    length: Annotated[Time, Positive] | None = None
    """Length that is tapered on each side, in place of `fraction`."""
    side: Literal["both", "start", "end"] = "both"
    """Sides of the record that are tapered."""

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if (self.fraction is None) == (self.length is None):
            raise ValueError("a taper needs exactly one of `fraction` and `length`")
        return self


class CornersStep(Model):
    """Choose the corner frequencies that `pad` and `butterworth` use after this.

    given: as written; ridder: the lowest high-pass in [lowest, highest] that leaves the displacement less
    than `target` of drift; snr: the band where signal over pre-event noise exceeds `threshold`. The
    low-pass of ridder is `lowpass`; that of snr is capped by `lowpass` and by 0.75 of Nyquist.
    """

    step: Literal["corners"] = "corners"
    method: Literal["given", "ridder", "snr"] = "given"
    """Method by which the corners are found."""
    highpass: Annotated[Frequency, Positive] | None = None
    """Corner of the high-pass."""
    lowpass: Annotated[Frequency, Positive] | None = None
    """Corner of the low-pass; for snr the highest that it may be."""
    lowest: Annotated[Frequency, Positive] = 0.001
    """Least high-pass that ridder tries."""
    highest: Annotated[Frequency, Positive] = 0.5
    """Largest high-pass that ridder tries."""
    target: Annotated[Dimensionless, Positive] = 0.02
    """Drift of the displacement that ridder leaves, of its largest value."""
    threshold: Annotated[Dimensionless, Positive] = 3.0
    """Ratio of signal to noise before the onset, which snr asks for."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.method == "given" and self.highpass is None and self.lowpass is None:
            raise ValueError("corners that are given need `highpass` or `lowpass`")
        if self.highpass and self.lowpass and self.highpass >= self.lowpass:
            raise ValueError(f"highpass ({self.highpass:g} Hz) must lie below lowpass ({self.lowpass:g} Hz)")
        if self.lowest >= self.highest:
            raise ValueError(f"lowest ({self.lowest:g} Hz) must lie below highest ({self.highest:g} Hz)")
        used = {"step", "method", "lowpass", *_USED[self.method]}
        fields = type(self).model_fields
        if unused := [key for key in fields if key not in used and getattr(self, key) != fields[key].default]:
            raise ValueError(
                f"method {self.method} does not use {', '.join(unused)}; leave it out, or set another method"
            )
        return self


_USED = {  # keys of each method of finding corners
    "given": {"highpass"},
    "ridder": {"lowest", "highest", "target"},
    "snr": {"threshold"},
}


class PadStep(Model):
    """Add zeros on both sides: `length` each, or 1.5 order / corner seconds (after Boore 2005)."""

    step: Literal["pad"] = "pad"
    order: Order = 5
    """Order of the filter that follows."""
    length: Annotated[Time, Positive] | None = None
    """Length of the zeros on each side; 1.5 order / corner seconds if not given."""


class ButterworthStep(Model):
    """Butterworth filter at the given corners, or at those a `corners` step chose."""

    step: Literal["butterworth"] = "butterworth"
    order: Order = 5
    """Order of the filter."""
    causal: bool = False
    """Direction of the filter: true runs it once forwards; false forwards and backwards, without a shift of
    phase."""
    highpass: Annotated[Frequency, Positive] | None = None
    """Corner of the high-pass."""
    lowpass: Annotated[Frequency, Positive] | None = None
    """Corner of the low-pass."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.highpass and self.lowpass and self.highpass >= self.lowpass:
            raise ValueError(f"highpass ({self.highpass:g} Hz) must lie below lowpass ({self.lowpass:g} Hz)")
        return self


class DisplacementBaselineStep(Model):
    """Fit c2 t^2 + ... + c_order t^order to displacement and subtract its second derivative."""

    step: Literal["displacement_baseline"] = "displacement_baseline"
    order: Annotated[Whole, Field(ge=2, le=10)] = 6
    """Order of the polynomial."""


class VelocityBaselineStep(Model):
    """Fit a continuous piecewise-linear velocity with these knots and subtract its slope.

    Without knots it bends at the picked onset and at the later time that leaves the least velocity.
    """

    step: Literal["velocity_baseline"] = "velocity_baseline"
    knots: tuple[Annotated[Time, Positive], ...] = ()
    """Times at which the velocity bends."""


def bare_step(value: object) -> object:
    """Read "detrend" and {detrend: {order: 2}} as {step: detrend, order: 2}."""
    if isinstance(value, str):
        return {"step": value}
    if isinstance(value, dict) and len(value) == 1 and "step" not in value:
        name, options = next(iter(value.items()))
        if options is None or isinstance(options, dict):
            return {"step": name, **(options or {})}
    return value


Step = Annotated[
    Annotated[
        MeanStep
        | DetrendStep
        | TaperStep
        | CornersStep
        | PadStep
        | ButterworthStep
        | DisplacementBaselineStep
        | VelocityBaselineStep,
        Discriminator("step"),
    ],
    BeforeValidator(bare_step),
]

_PEER: tuple[object, ...] = (
    "mean",
    {"taper": {"fraction": 0.05}},
    {"corners": {"method": "ridder"}},
    "pad",
    "butterworth",
    "displacement_baseline",
)

CHAINS: dict[str, tuple[object, ...]] = {
    # the order of operations of PEER NGA-West2 (Ancheta et al. 2013); its analysts pick the corners by eye
    "peer": _PEER,
    # USGS gmprocess' default configuration (processing:), without its quality checks
    "gmprocess": (
        {"detrend": {"order": 1}},
        "mean",
        {"corners": {"method": "snr", "threshold": 3.0, "lowpass": 40.0}},
        {"taper": {"fraction": 0.05}},
        "pad",
        {"butterworth": {"order": 5}},
        {"mean": {"until": "onset"}},
        {"displacement_baseline": {"order": 6}},
    ),
    # PRISM 1.0 (OFR 2017-1008), with its corners for magnitudes of 5.5 and more
    "prism": (
        {"mean": {"until": "onset"}},
        {"detrend": {"of": "velocity", "order": 1}},
        "velocity_baseline",
        {"corners": {"highpass": 0.1, "lowpass": 40.0}},
        {"taper": {"fraction": 0.05}},
        {"pad": {"order": 4}},
        {"butterworth": {"order": 4}},
    ),
}


def named_chain(value: object) -> object:
    """Read the name of a chain, or "none", as its steps."""
    if value is None or value == "none":
        return ()
    if isinstance(value, str):
        if value not in CHAINS:
            raise ValueError(f"no such chain of corrections; known: none, {', '.join(CHAINS)}")
        return CHAINS[value]
    return value


Correction = Annotated[tuple[Step, ...], BeforeValidator(named_chain)]
