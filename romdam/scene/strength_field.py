"""Strengths and friction that vary along a joint at random, alike on every mesh."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from romdam.config.sections.joints import StrengthField
from romdam.core.errors import ConfigError
from romdam.geometry.elements import Floats

_WAVES = 2048  # of a field: its kurtosis at a point is 3 - 1.5 / 2048


def field_factors(field: StrengthField, position: Floats, joint: str) -> Floats:
    """Factor of the strengths at every gap, (n,): lognormal, of mean 1.

    Its logarithm is a sum of waves whose numbers have the spectrum of the correlation exp(-distance / length)
    in three dimensions, a Cauchy distribution. So a place has the same factor whatever gaps there are.

    Parameters
    ----------
    position : (n, 3) of the gaps [m]
    joint : its name; joints with the same seed have independent fields

    References
    ----------
    Shinozuka, Deodatis, Applied Mechanics Reviews 44 (1991) 191; Rahimi, Recht, NIPS 20 (2007).
    """
    seeds = np.frombuffer(np.float64(field.seed).tobytes(), dtype=np.uint32)
    random = np.random.default_rng([zlib.crc32(joint.encode()), *seeds.tolist()])
    direction, size = random.standard_normal((_WAVES, 3)), random.standard_normal((_WAVES, 1))
    waves = direction / np.abs(size) / field.length
    phases = random.uniform(0.0, 2.0 * np.pi, _WAVES)
    normal = np.sqrt(2.0 / _WAVES) * np.cos(position @ waves.T + phases).sum(axis=1)
    variance = np.log1p(field.coefficient_of_variation**2)
    return np.asarray(np.exp(np.sqrt(variance) * normal - 0.5 * variance))


def scaled_keys(keys: Mapping[str, Any], of: tuple[str, ...], factor: float, location: str) -> dict[str, Any]:
    """The keys of a joint's laws at a gap, those that the field is of times its factor.

    Raises
    ------
    ConfigError
        for a key that the joint has not, or of zero.
    """
    scaled = dict(keys)
    for path in of:
        section, _, key = path.rpartition(".")
        within = dict(scaled[section] or {}) if section else scaled
        value: Any = within.get(key)
        if not np.any(value or 0.0):
            raise ConfigError(
                f"{location}.field.of: {path} is {'not given' if value is None else '0'} in this joint; give "
                "it a value, or leave it out of the field"
            )
        both = isinstance(value, list | tuple)
        within[key] = tuple(factor * each for each in value) if both else factor * value
        if section:
            scaled[section] = within
    return scaled
