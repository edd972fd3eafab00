"""Statistics of records that count unequally."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from romdam.core.arrays import Floats

if TYPE_CHECKING:  # workers write no file
    import xarray as xr

WEIGHT = "weight_of_record"  # coordinate of a summary along its records; they sum to 1


def weights_of(dataset: xr.Dataset | xr.DataArray) -> Floats | None:
    """Weights of the records, (record,); None where all count alike."""
    return np.asarray(dataset.coords[WEIGHT].values, dtype=float) if WEIGHT in dataset.coords else None


def effective_number(weights: Floats) -> float:
    """How many equal observations scatter as little as weighted ones: Kish's (sum w)^2 / sum w^2.

    References
    ----------
    Kish, Survey sampling (Wiley, 1965), 11.7.
    """
    squares = float(weights @ weights)
    return float(weights.sum()) ** 2 / squares if squares > 0.0 else 0.0


def weighted_quantiles(values: Floats, shares: Sequence[float], weights: Floats | None = None) -> Floats:
    """Quantiles over the first axis, (shares, ...); with equal weights those of `numpy.quantile`.

    Parameters
    ----------
    values : (n, ...)
    shares : 0 is the least of the values with a weight, 1 the largest
    weights : (n,), not all zero; None for equal ones

    References
    ----------
    Akinshin, Weighted quantile estimators, arXiv:2304.07265 (2023), section 4: Hyndman and Fan's type 7 with
    Kish's effective number of values.
    """
    values = np.asarray(values, dtype=float)
    if weights is None or np.ptp(weights) == 0.0:
        return np.asarray(np.quantile(values, shares, axis=0))
    values, weights = values[weights > 0.0], weights[weights > 0.0]
    flat = values.reshape(len(values), -1)
    order = np.argsort(flat, axis=0, kind="stable")
    ordered = np.take_along_axis(flat, order, axis=0)
    ends = np.cumsum(weights[order], axis=0) / weights.sum()
    ends = np.vstack([np.zeros((1, flat.shape[1])), ends])
    number, quantiles = effective_number(weights), np.empty((len(shares), flat.shape[1]))
    for row, share in zip(quantiles, shares, strict=True):
        if share in (0.0, 1.0):
            row[:] = ordered[int(share) * (len(ordered) - 1)]
            continue
        # each value counts by what lies of its stretch of [0, 1] within the window of one effective value
        begin = share * (number - 1.0) / number
        row[:] = (np.diff(np.clip(number * (ends - begin), 0.0, 1.0), axis=0) * ordered).sum(axis=0)
    return quantiles.reshape(len(shares), *values.shape[1:])
