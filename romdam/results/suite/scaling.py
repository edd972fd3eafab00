"""Factors that a suite scales its records with."""

from __future__ import annotations

import numpy as np

from romdam.config.sections.suite import SuiteConfig
from romdam.core.arrays import Floats
from romdam.core.errors import RecordError
from romdam.core.motion import GroundMotion
from romdam.postprocess.record_measures import intensity


def scale_count(suite: SuiteConfig) -> int:
    """Number of scales that each record is run at."""
    return len(suite.scales if suite.intensities is None else suite.intensities.values)


def no_factors(suite: SuiteConfig) -> Floats:
    """(scales,) NaN, of a record that cannot be used."""
    return np.full(scale_count(suite), np.nan)


def scale_factors(suite: SuiteConfig, motion: GroundMotion) -> tuple[Floats, str]:
    """Multipliers (scales,) of a record, and why it cannot be scaled; the text is empty where it can."""
    target = suite.intensities
    if target is None:
        return np.array(suite.scales), ""
    try:
        measured = intensity(motion, target.period, target.damping, target.of)
    except RecordError as error:
        return no_factors(suite), f"{motion.name}: suite.intensities: {error}"
    if measured <= 0.0:
        return no_factors(suite), f"{motion.name}: cannot be scaled to {target.measure}, it does not move"
    with np.errstate(over="ignore"):
        factors = np.array(target.values) / measured
    if not np.isfinite(factors).all():
        why = f"{motion.name}: cannot be scaled to {target.measure}, it has {measured:g} m/s2"
        return no_factors(suite), why
    return factors, ""
