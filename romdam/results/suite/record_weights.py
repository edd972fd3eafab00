"""Weights of the records that a configuration states, found for each record by its name."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence

import numpy as np

from romdam.config.patterns import is_pattern
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, listed, quote


def record_weights(stated: Mapping[str, float], names: Sequence[str], source: str) -> Floats:
    """Weights of records, (record,), scaled so that they sum to 1.

    Parameters
    ----------
    stated : name of a record, or a pattern of names, to its weight
    names : of the records
    source : of the configuration, for messages

    Raises
    ------
    ConfigError
        for a name that no record has, a record without a weight, with two, and where all weights are 0.
    """
    where, weights = f"{source}: suite.weights", np.zeros(len(names))
    fits = {key: {name for name in names if fnmatch.fnmatchcase(name, key)} if is_pattern(key) else {key}
            for key in stated}  # fmt: skip
    for key, of_key in fits.items():
        if not of_key & set(names):
            raise ConfigError(f"{where}: no record is {quote(key)}; the records are {listed(names)}")
    for k, name in enumerate(names):
        keys = [name] if name in stated else [key for key, of_key in fits.items() if name in of_key]
        if not keys:
            raise ConfigError(
                f"{where}: the record {quote(name)} has no weight; give it one (0 leaves it out of "
                "the statistics), or a pattern such as '*'"
            )
        if len(keys) > 1:
            raise ConfigError(
                f"{where}: the record {quote(name)} has several weights, by the patterns {quote(keys)}; "
                "name it itself, or leave one of them out"
            )
        weights[k] = stated[keys[0]]
    if not weights.sum() > 0.0:
        raise ConfigError(f"{where}: all weights are 0; give a record that counts more than 0")
    return weights / weights.sum()
