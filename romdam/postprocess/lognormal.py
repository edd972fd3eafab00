"""A lognormal distribution fitted by maximum likelihood to values that are known or only bounded.

With the predictor `eta = (ln x - ln theta) / beta = slope (ln x - centre) + level` the log-likelihood is
concave, so Newton's method finds its one maximum, and profiles over one parameter are as easy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from romdam.core.arrays import Floats
from romdam.postprocess.weights import effective_number

_ITERATIONS, _SMALL = 60, 1e-9
_HALF_LOG_2PI = 0.5 * float(np.log(2.0 * np.pi))
_EXACT = 1e-4  # of a bound
_FARTHEST = 40.0  # [standard deviations; e-foldings] a bound is looked for; beyond it there is none


@dataclass(frozen=True)
class Observations:
    """Logarithms of what is known of each value.

    Attributes
    ----------
    known : of values that are known
    below : limits that values lie at or below (left-censored)
    above : limits that values lie above (right-censored)
    weights : of all of them, above 0; None where all count alike
    """

    known: Floats
    below: Floats
    above: Floats
    weights: Floats | None = None

    @property
    def count(self) -> int:
        """Number of observations."""
        return len(self.known) + len(self.below) + len(self.above)

    @cached_property
    def counts(self) -> Floats:
        """(n,) how many observations each counts as: together as many as scatter as little."""
        if self.weights is None:
            return np.ones(self.count)
        return self.weights * (effective_number(self.weights) / self.weights.sum())

    @property
    def all(self) -> Floats:
        """(n,) known, below, above."""
        return np.concatenate([self.known, self.below, self.above])


class Peak(NamedTuple):
    """The highest log-likelihood over some parameters, and where it is."""

    height: float
    at: Floats


@dataclass(frozen=True)
class LognormalFit:
    """A lognormal distribution with what it was fitted to.

    Attributes
    ----------
    observations : what it was fitted to
    centre : ln value that `slope` turns about
    slope, level : of the predictor; 1 / beta, and its value at the centre
    height : the highest log-likelihood
    """

    observations: Observations
    centre: float
    slope: float
    level: float
    height: float

    @property
    def theta(self) -> float:
        """The median."""
        return float(np.exp(self.centre - self.level / self.slope))

    @property
    def beta(self) -> float:
        """The standard deviation of the logarithm."""
        return 1.0 / self.slope

    def theta_bounds(self, confidence: float = 0.95) -> tuple[float, float]:
        """Bounds of the median from the profile likelihood; 0 or infinity where the data set none."""
        start, step = float(np.log(self.theta)), self.beta / np.sqrt(self.observations.counts.sum())
        low, high = (
            self._crossing(lambda x: self._through(x, 0.0), start, sign * step, confidence)
            for sign in (-1.0, 1.0)
        )
        return float(np.exp(low)), float(np.exp(high))

    def beta_bounds(self, confidence: float = 0.95) -> tuple[float, float]:
        """Bounds of beta from the profile likelihood; 0 or infinity where the data set none."""
        start, step = float(np.log(self.beta)), 1.0 / np.sqrt(2.0 * self.observations.counts.sum())
        low, high = (self._crossing(self._with_beta, start, sign * step, confidence) for sign in (-1.0, 1.0))
        return float(np.exp(low)), float(np.exp(high))

    def probability(self, values: Floats) -> Floats:
        """The distribution function."""
        from scipy.special import ndtr

        return np.asarray(ndtr(self._eta(np.log(values))))

    def probability_bounds(self, values: Floats, confidence: float = 0.95) -> Floats:
        """(n, 2) pointwise bounds of the distribution function from the profile likelihood."""
        from scipy.special import ndtr

        x = np.log(values)
        bounds = [
            [
                self._crossing(lambda z, x=value: self._through(x, z), eta, sign * 0.2, confidence)  # type: ignore[misc]
                for sign in (-1.0, 1.0)
            ]
            for value, eta in zip(x, self._eta(x), strict=True)
        ]
        return np.asarray(ndtr(np.array(bounds)))

    def _eta(self, x: Floats) -> Floats:
        return np.asarray(self.slope * (x - self.centre) + self.level)

    def _through(self, x: float, eta: float) -> float:
        """Highest log-likelihood of the distributions whose predictor is `eta` at `x`."""
        design = (self.observations.all - x)[:, None]
        offset = np.full(len(design), eta)
        climbed = _climb(self.observations, design, offset, np.array([self.slope]), slopes=True)
        # slopes do not fall
        return climbed.height if climbed.at[0] >= 0.0 else _height(self.observations, offset)

    def _with_beta(self, log_beta: float) -> float:
        """Highest log-likelihood of the distributions with one beta."""
        slope = np.exp(-log_beta)
        offset = slope * (self.observations.all - self.centre)
        climbed = _climb(self.observations, np.ones((len(offset), 1)), offset, np.array([self.level]))
        known = float(self.observations.counts[: len(self.observations.known)].sum())
        return climbed.height + known * float(np.log(slope))

    def _crossing(
        self, profile: Callable[[float], float], start: float, step: float, confidence: float
    ) -> float:
        """Find where, going from `start` by steps that double, the profile has fallen by the quantile."""
        from scipy.optimize import brentq
        from scipy.special import ndtri

        lowest = self.height - 0.5 * float(ndtri(0.5 + 0.5 * confidence)) ** 2
        near, far = start, start + step
        while profile(far) > lowest:
            near, step = far, 2.0 * step
            far = start + step
            if abs(step) > _FARTHEST:
                return float(np.copysign(np.inf, step))
        return float(brentq(lambda x: profile(x) - lowest, near, far, xtol=_EXACT * (1.0 + abs(start))))


def fit_lognormal(observations: Observations) -> LognormalFit:
    """Fit median and logarithmic standard deviation by maximum likelihood.

    Parameters
    ----------
    observations : logarithms of known values and of limits

    Raises
    ------
    ValueError
        where no maximum exists; the message says why, such as that all values lie on one side of the limits.

    References
    ----------
    Baker, Efficient analytical fragility function fitting using dynamic structural analysis, Earthquake
    Spectra 31(1), 2015, eqs. 8 (truncated analyses) and 11 (stripes, where every value is only bounded).
    Burridge, A note on maximum likelihood estimation for regression models using grouped data, JRSS B 43
    (1981): the likelihood is concave in 1 / beta and ln(theta) / beta.
    """
    reason = why_not(observations)
    if reason:
        raise ValueError(reason)
    x = observations.all
    centre, spread = float(x.mean()), float(x.std())
    design = np.column_stack([x - centre, np.ones(len(x))])
    start = np.array([1.0 / spread, 0.0])
    climbed = _climb(observations, design, np.zeros(len(x)), start, slopes=True)
    if climbed.at[0] <= 0.0:
        raise ValueError("the share above the threshold does not grow with the intensity")
    return LognormalFit(observations, centre, float(climbed.at[0]), float(climbed.at[1]), climbed.height)


def why_not(seen: Observations) -> str:
    """The reason why these observations have no fit; empty where they have one."""
    known, below, above = seen.known, seen.below, seen.above
    if len(known) + len(below) == 0:
        return "no run exceeds the threshold" if len(above) else "there are no runs"
    if len(known) + len(above) == 0:
        return "every run exceeds the threshold"
    if len(np.unique(known)) > 1:
        return ""
    if len(known):
        consistent = (below >= known[0]).all() and (above <= known[0]).all()
        return "one intensity at the threshold is not enough for a dispersion" if consistent else ""
    if above.max() <= below.min():
        between = f"{np.exp(above.max()):.4g} and {np.exp(below.min()):.4g}"
        return (
            "runs above and below the threshold do not overlap in intensity: the median lies between "
            f"{between}, and the dispersion cannot be told from zero"
        )
    return "" if below.max() > above.min() else "the share above the threshold falls with the intensity"


def _climb(seen: Observations, design: Floats, offset: Floats, start: Floats, slopes: bool = False) -> Peak:
    """Maximise the log-likelihood of the predictor `design @ parameters + offset` by Newton's method.

    `slopes` says that the first parameter is the slope, whose logarithm every known value adds.
    """
    many = float(seen.counts[: len(seen.known)].sum()) if slopes else 0.0

    def height_of(at: Floats) -> float:
        if many and at[0] <= 0.0:
            return -np.inf
        return _height(seen, design @ at + offset) + (many * float(np.log(at[0])) if many else 0.0)

    at, height = start, height_of(start)
    for _ in range(_ITERATIONS):
        first, second = _derivatives(seen, design @ at + offset)
        gradient, curvature = design.T @ first, -(design.T * second) @ design
        if many:
            gradient[0] += many / at[0]
            curvature[0, 0] += many / at[0] ** 2
        step = np.linalg.solve(curvature + 1e-12 * np.trace(curvature) * np.eye(len(at)), gradient)
        while not height_of(at + step) >= height and np.abs(step).max() > _SMALL * (1.0 + np.abs(at).max()):
            step = 0.5 * step
        at, height = at + step, height_of(at + step)
        if np.abs(step).max() <= _SMALL * (1.0 + np.abs(at).max()):
            break
    return Peak(height, at)


def _height(seen: Observations, eta: Floats) -> float:
    """Log-likelihood of the predictor, without what known values add for the slope."""
    from scipy.special import log_ndtr

    n, m = len(seen.known), len(seen.known) + len(seen.below)
    w = seen.counts
    density = -float(w[:n] @ (0.5 * eta[:n] ** 2 + _HALF_LOG_2PI))
    return density + float(w[n:m] @ log_ndtr(eta[n:m]) + w[m:] @ log_ndtr(-eta[m:]))


def _derivatives(seen: Observations, eta: Floats) -> tuple[Floats, Floats]:
    """First and second derivatives of the log-likelihood by the predictor of each observation."""
    from scipy.special import log_ndtr

    n, m = len(seen.known), len(seen.known) + len(seen.below)
    sign = np.ones(len(eta))
    sign[m:] = -1.0
    bounded = sign * eta
    ratio = np.exp(-0.5 * bounded**2 - _HALF_LOG_2PI - log_ndtr(bounded))
    first, second = sign * ratio, -ratio * (bounded + ratio)
    first[:n], second[:n] = -eta[:n], -1.0
    return seen.counts * first, seen.counts * second
