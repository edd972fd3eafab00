"""Distributions of uncertain parameters, their correlation, and samples of them.

Parameters that depend on each other have a Gaussian copula: their normal scores z_i = Phi^-1(F_i(x_i)) are
jointly normal. A correlation of the values x_i is turned into one of the scores, as Nataf's model does, by
Gauss-Hermite quadrature of E[x_i x_j]. In a Latin hypercube the strata of each parameter are reordered by the
ranks of correlated scores, so that each keeps one sample in every stratum.

References
----------
Liu, Der Kiureghian (1986), Multivariate distribution models with prescribed marginals and covariances,
Probabilistic Engineering Mechanics 1(2), 105-112; Iman, Conover (1982), A distribution-free approach to
inducing rank correlation among input variables, Communications in Statistics B11(3), 311-334.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from romdam.core.arrays import Floats

_LEAST = 1e-9  # probability that bounds leave at least: below it the samples are those of a tail nobody knows
_EDGE = 2.0**-53  # least probability that a score is taken of, so that it is finite
_ORDER = 40  # of the quadrature over each score: 1e-10 of the correlation up to a cov of 1
_STRONGEST = 0.9999  # correlation of scores up to which one of the values is sought
_CLOSE = 1e-12  # width of the interval in which bisection leaves it
_BITS = 30  # of a number of Sobol's sequence
_DEFINITE = 1e-9  # least eigenvalue of a correlation matrix


def ndtr(z: Floats | float) -> Floats:
    """Standard normal distribution function."""
    return np.asarray(import_module("scipy.special").ndtr(z))  # few jobs need it, and it takes time to load


def ndtri(u: Floats | float) -> Floats:
    """Inverse of the standard normal distribution function."""
    return np.asarray(import_module("scipy.special").ndtri(u))


@dataclass(frozen=True)
class Marginal:
    """Distribution of one parameter.

    Attributes
    ----------
    kind : uniform, loguniform, normal or lognormal
    center, spread : mean and standard deviation, of the logarithm if lognormal, before bounds cut it
    low, high : bounds; of uniform and loguniform finite
    """

    kind: str
    center: float
    spread: float
    low: float
    high: float

    def value(self, u: Floats) -> Floats:
        """Value below which the distribution lies with probability u, of any shape."""
        if self.kind == "uniform":
            return np.asarray(self.low + u * (self.high - self.low))
        if self.kind == "loguniform":
            return np.asarray(self.low * (self.high / self.low) ** u)
        if self.spread == 0.0:
            z = np.zeros_like(u)
        else:
            a, b = self._scores()
            if a > 0.0:  # in the upper tail, whose probabilities are precise from above
                z = -ndtri(np.maximum(ndtr(-b) + (1.0 - u) * (ndtr(-a) - ndtr(-b)), np.finfo(float).tiny))
            else:
                z = ndtri(np.clip(ndtr(a) + u * (ndtr(b) - ndtr(a)), np.finfo(float).tiny, 1.0 - _EDGE))
        x = self.center + self.spread * z
        return np.asarray(np.clip(np.exp(x) if self.kind == "lognormal" else x, self.low, self.high))

    @property
    def inside(self) -> float:
        """Probability that the bounds leave."""
        if self.kind in ("uniform", "loguniform"):
            return 1.0
        if self.spread == 0.0:
            x = math.exp(self.center) if self.kind == "lognormal" else self.center
            return float(self.low <= x <= self.high)
        a, b = self._scores()
        return float(ndtr(-a) - ndtr(-b) if a > 0.0 else ndtr(b) - ndtr(a))

    @property
    def problem(self) -> str:
        """What is wrong with the bounds; empty where nothing is."""
        if self.inside >= _LEAST:
            return ""
        return (
            f"`low` and `high` leave a probability of {self.inside:.2g} of the {self.kind} distribution, "
            f"limit {_LEAST:g}; widen them, or correct its mean and spread"
        )

    def _scores(self) -> tuple[float, float]:
        """The bounds as scores of the distribution that they cut."""
        low, high = self.low, self.high
        if self.kind == "lognormal":
            low, high = (math.log(x) if x > 0.0 else -math.inf for x in (low, high))
        return (low - self.center) / self.spread, (high - self.center) / self.spread


def lognormal_spread(*, cov: float | None = None, std_of_median: float | None = None) -> float:
    """Standard deviation of ln x of a lognormal x.

    Parameters
    ----------
    cov : standard deviation over mean
    std_of_median : standard deviation over median, instead
    """
    if cov is not None:
        return math.sqrt(math.log1p(cov**2))
    assert std_of_median is not None
    return math.sqrt(math.log((1.0 + math.sqrt(1.0 + 4.0 * std_of_median**2)) / 2.0))


def score_correlation(a: Marginal, b: Marginal, correlation: float) -> float:
    """Correlation of the normal scores of two parameters whose values have a given one.

    Raises
    ------
    ValueError
        where no Gaussian copula gives it; with the range that there is.
    """
    if a.kind == b.kind == "normal" and a.inside == b.inside == 1.0:
        return correlation
    z, w = np.polynomial.hermite_e.hermegauss(_ORDER)
    w = w / w.sum()
    of_a, of_b = _standard(a, z, w), b.value(ndtr(z))
    mean_b = float(w @ of_b)
    std_b = math.sqrt(float(w @ (of_b - mean_b) ** 2))

    def of_values(rho: float) -> float:
        other = rho * z[:, None] + math.sqrt(1.0 - rho**2) * z
        inner = (b.value(ndtr(other)) - mean_b) @ w / std_b
        return float(w @ (of_a * inner))

    least, most = of_values(-_STRONGEST), of_values(_STRONGEST)
    if not least <= correlation <= most:
        raise ValueError(f"no correlation of these values is outside {least:.4g} to {most:.4g}")

    low, high = -_STRONGEST, _STRONGEST
    while high - low > _CLOSE:  # it grows with that of the scores
        middle = 0.5 * (low + high)
        low, high = (middle, high) if of_values(middle) < correlation else (low, middle)
    return 0.5 * (low + high)


def _standard(marginal: Marginal, z: Floats, w: Floats) -> Floats:
    """Values at scores z, less their mean and over their standard deviation."""
    x = marginal.value(ndtr(z))
    x = x - w @ x
    return np.asarray(x / math.sqrt(float(w @ x**2)))


def least_eigenvalue(correlation: Floats) -> float:
    """The least eigenvalue of a correlation matrix; 0 where it is not positive definite."""
    least = float(np.linalg.eigvalsh(correlation)[0])
    return least if least > _DEFINITE else 0.0


def correlated(unit: Floats, correlation: Floats, *, strata: bool) -> Floats:
    """Samples (n, k) between 0 and 1 with correlated normal scores.

    Parameters
    ----------
    unit : (n, k) independent ones
    correlation : (k, k) of the scores, positive definite
    strata : whether each column keeps its numbers in another order, as a Latin hypercube has to
    """
    L = np.linalg.cholesky(correlation)
    n, k = unit.shape
    z = ndtri(np.clip(unit, _EDGE, 1.0 - _EDGE))
    if not strata:
        return np.asarray(ndtr(z @ L.T))
    if n > k + 1:  # what the sample is correlated by chance is taken off
        z = z - z.mean(axis=0)
        z = np.linalg.solve(np.linalg.cholesky(np.corrcoef(z.T).reshape(k, k)), (z / z.std(axis=0)).T).T
    ranks = np.argsort(np.argsort(z @ L.T, axis=0), axis=0)
    return np.take_along_axis(np.sort(unit, axis=0), ranks, axis=0)


def latin_hypercube(samples: int, parameters: int, seed: int) -> Floats:
    """(samples, parameters) between 0 and 1, one in each of as many strata of every parameter.

    To the bit those of `scipy.stats.qmc.LatinHypercube`, which takes half a second to load.
    """
    random = np.random.default_rng(seed).spawn(1)[0]
    within = random.uniform(size=(samples, parameters))
    strata = np.tile(np.arange(1, samples + 1), (parameters, 1))
    for stratum in strata:
        random.shuffle(stratum)
    return np.asarray((strata.T - within) / samples)


def monte_carlo(samples: int, parameters: int, seed: int) -> Floats:
    """(samples, parameters) independent numbers between 0 and 1."""
    return np.random.default_rng(seed).random((samples, parameters))


def sobol_matrices(base: int, parameters: int, seed: int) -> Floats:
    """(base (parameters + 2), parameters) numbers between 0 and 1: A, B, and A with each column of B in turn.

    A and B are the halves of a scrambled Sobol' sequence of twice as many dimensions.

    Parameters
    ----------
    base : rows of A, a power of 2

    References
    ----------
    Saltelli et al. (2010), Variance based sensitivity analysis of model output, Computer Physics
    Communications 181(2), 259-270, section 5.
    """
    qmc = import_module("scipy.stats.qmc")  # half a second
    sequence = qmc.Sobol(2 * parameters, bits=_BITS, seed=np.random.default_rng(seed)).random(base)
    sequence = sequence + 0.5 ** (_BITS + 1)  # in the middle of its cell: no number is 0
    A, B = sequence[:, :parameters], sequence[:, parameters:]
    mixed = [np.where(np.arange(parameters) == i, B, A) for i in range(parameters)]
    return np.concatenate([A, B, *mixed])


def correlation_matrix(names: Sequence[str], pairs: Sequence[tuple[str, str, float]]) -> Floats:
    """(k, k) of the pairs, and zero of all others."""
    matrix = np.eye(len(names))
    for a, b, value in pairs:
        i, j = names.index(a), names.index(b)
        matrix[i, j] = matrix[j, i] = value
    return matrix
