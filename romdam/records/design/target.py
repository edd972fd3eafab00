"""Spectra that records are scaled to.

References
----------
ASCE/SEI 7-16 (2017), Minimum design loads, 11.4.6. EN 1998-1:2004, Eurocode 8, 3.2.2.2, tables 3.2 and 3.3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.motions.records import unit_in_si
from romdam.config.sections.motions.target import MOST_POINTS, SpectrumConfig, TargetConfig
from romdam.core.csv_table import plain_number, read_cells
from romdam.core.errors import ConfigError

Array = NDArray[np.float64]
PER_DECADE = 150  # periods that count, evenly in the logarithm
_MOST_BYTES = 5e6  # of a table
_EUROCODE8 = {  # type, ground: S, TB, TC, TD [s], tables 3.2 and 3.3
    (1, "A"): (1.0, 0.15, 0.4, 2.0),
    (1, "B"): (1.2, 0.15, 0.5, 2.0),
    (1, "C"): (1.15, 0.2, 0.6, 2.0),
    (1, "D"): (1.35, 0.2, 0.8, 2.0),
    (1, "E"): (1.4, 0.15, 0.5, 2.0),
    (2, "A"): (1.0, 0.05, 0.25, 1.2),
    (2, "B"): (1.35, 0.05, 0.25, 1.2),
    (2, "C"): (1.5, 0.1, 0.25, 1.2),
    (2, "D"): (1.8, 0.1, 0.3, 1.2),
    (2, "E"): (1.6, 0.05, 0.25, 1.2),
}


@dataclass(frozen=True)
class Target:
    """A target spectrum at the periods that count.

    Attributes
    ----------
    periods, sa : (np,) [s] and pseudo-acceleration [m/s2]
    damping : ratio
    of : what of the components is held against it
    """

    periods: Array
    sa: Array
    damping: float
    of: str

    def with_midpoints(self) -> Target:
        """Return this target with a period more between each two, where spectra are held against it too."""
        periods = np.geomspace(self.periods[0], self.periods[-1], 2 * self.periods.size - 1)
        sa = np.exp(np.interp(np.log(periods), np.log(self.periods), np.log(self.sa)))
        return replace(self, periods=periods, sa=sa)


def read_target(config: TargetConfig, folder: Path) -> Target:
    """Evaluate a target over its range.

    Parameters
    ----------
    config : `target:` of an entry of `records:`
    folder : where its table's path starts

    Raises
    ------
    ConfigError
        for a table that cannot be read, and one that does not reach over the range.
    """
    first, last = config.periods
    count = max(2, 1 + int(np.ceil(PER_DECADE * np.log10(last / first))))
    periods = np.geomspace(first, last, count)
    return Target(
        periods, evaluate(config.spectrum, periods, config.damping, folder), config.damping, config.of
    )


def evaluate(
    spectrum: SpectrumConfig,
    periods: Array,
    damping: float,
    folder: Path,
    key: str = "target.spectrum",
    asked: str = "target.periods",
    remedy: str = "narrow target.periods, or give more of the spectrum",
) -> Array:
    """Pseudo-acceleration of a spectrum at periods (np,) [s], in m/s2; raises as `read_target` does.

    Parameters
    ----------
    periods : rising
    key, asked, remedy : for messages: where the spectrum stands, what the periods are, and what helps where
        it does not reach over them
    """
    if spectrum.asce7 is not None:
        asce7 = spectrum.asce7
        ts = asce7.SD1 / asce7.SDS
        t0 = 0.2 * ts
        rising = asce7.SDS * (0.4 + 0.6 * periods / t0)
        falling = np.where(periods > asce7.TL, asce7.SD1 * asce7.TL / periods**2, asce7.SD1 / periods)
        return np.where(periods < t0, rising, np.where(periods <= ts, asce7.SDS, falling))
    if spectrum.eurocode8 is not None:  # equations 3.2 to 3.6
        code = spectrum.eurocode8
        parameters = (code.S, code.TB, code.TC, code.TD)
        s, tb, tc, td = (
            _EUROCODE8[code.type, code.ground] if code.type and code.ground else np.array(parameters, float)
        )
        plateau = 2.5 * max(np.sqrt(10.0 / (5.0 + 100.0 * damping)), 0.55)
        shape = np.where(periods < tb, 1.0 + periods / tb * (plateau - 1.0), plateau)
        shape = np.where(periods > tc, plateau * tc / periods, shape)
        return code.ag * s * np.where(periods > td, plateau * tc * td / periods**2, shape)
    if spectrum.table is not None:
        path = folder / spectrum.table
        location, points = str(path), _read_table(path, unit_in_si(str(spectrum.unit)))
    else:
        location, points = f"{key}.points", np.array(spectrum.points)
    first, last = points[0, 0], points[-1, 0]
    if periods[0] < first * (1.0 - 1e-9) or periods[-1] > last * (1.0 + 1e-9):
        raise ConfigError(
            f"{location}: the spectrum goes from {first:g} to {last:g} s, {asked} from "
            f"{periods[0]:.6g} to {periods[-1]:.6g} s; {remedy}"
        )
    return np.exp(np.interp(np.log(periods), *np.log(points).T))


def _read_table(path: Path, unit: float) -> Array:
    """(n, 2) periods [s] and spectral accelerations [m/s2] of a CSV file; a first line may be a heading."""
    points = []
    for k, (number, row) in enumerate(read_cells(path, most=_MOST_BYTES)):
        if k == 0 and not any(character.isdigit() for character in row[0]):
            continue  # the heading
        values = [plain_number(text) for text in (row if any(row[2:]) else row[:2])]
        if len(values) != 2 or values[0] is None or values[1] is None:
            raise ConfigError(
                f"{path}: line {number}: expected a period in s and a spectral acceleration, separated by a "
                f"comma, got {','.join(row)[:60]!r}"
            )
        period, sa = values[0], values[1]
        if not (0.0 <= period < np.inf and 0.0 < sa < np.inf):
            raise ConfigError(f"{path}: line {number}: period and spectral acceleration must be positive")
        if period > 0.0:
            points.append((period, sa))
    spectrum = np.array(points).reshape(-1, 2) * [1.0, unit]
    if not 2 <= len(spectrum) <= MOST_POINTS:
        raise ConfigError(f"{path}: has {len(spectrum)} periods above 0, expected 2 to {MOST_POINTS}")
    if np.any(np.diff(spectrum[:, 0]) <= 0.0):
        at = int(np.argmax(np.diff(spectrum[:, 0]) <= 0.0))
        raise ConfigError(f"{path}: periods must rise, {spectrum[at + 1, 0]:g} s after {spectrum[at, 0]:g} s")
    return spectrum
