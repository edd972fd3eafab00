"""Seismic hazard, and the annual frequency at which a dam exceeds a threshold.

The frequency is the integral of the fragility over the hazard, lambda = int P(x) |dH(x)|. Between the rows of
its table the hazard is a power law H = k0 x^-k, straight in logarithms, and beyond them it goes on as in its
first and last interval. With a lognormal fragility each interval then has a closed form; one power law alone
gives H(theta) exp(k^2 beta^2 / 2).

References
----------
Cornell, Jalayer, Hamburger, Foutch (2002), Probabilistic basis for 2000 SAC FEMA steel moment frame
guidelines, J. Struct. Eng. 128(4), 526-533.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from romdam.core.arrays import Floats


@dataclass(frozen=True)
class HazardCurve:
    """Annual frequency (n,) [1/year] at which ascending intensities (n,) are exceeded, in SI."""

    intensity: Floats
    frequency: Floats

    def annual_frequency(self, theta: float, beta: float) -> tuple[float, float]:
        """Annual frequency at which a lognormal capacity is exceeded, and the share from outside the table.

        Parameters
        ----------
        theta, beta : median [SI] and standard deviation of the logarithm of the fragility; above 0

        Returns
        -------
        frequency [1/year], and the share of it that intensities below the first and above the last row give
        """
        x, m = np.log(self.intensity), math.log(theta)
        slopes = -np.diff(np.log(self.frequency)) / np.diff(x)
        ends = np.concatenate([[-np.inf], x[1:-1], [np.inf]])  # where each power law holds
        total = inside = 0.0
        for i, k in enumerate(slopes):
            at = math.log(self.frequency[i]) + k * x[i]  # ln k0
            total += _integral(ends[i], ends[i + 1], m, beta, k, at)
            inside += _integral(x[i], x[i + 1], m, beta, k, at)
        return total, 1.0 - inside / total if total > 0.0 else 0.0


def _integral(a: float, b: float, m: float, beta: float, k: float, log_k0: float) -> float:
    """int Phi((u - m) / beta) k exp(log_k0 - k u) du from a to b, by parts."""
    whole = _phi((b - m) / beta + k * beta) - _phi((a - m) / beta + k * beta)
    return math.exp(log_k0 - k * m + 0.5 * (k * beta) ** 2) * whole - sum(
        sign * _phi((u - m) / beta) * math.exp(log_k0 - k * u)
        for sign, u in ((1.0, b), (-1.0, a))
        if math.isfinite(u)  # the product is zero at both ends
    )


def _phi(z: float) -> float:
    """Standard normal distribution function, precise in its lower tail."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
