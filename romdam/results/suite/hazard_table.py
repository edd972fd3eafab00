"""The hazard that a suite names: its table, and the levels of the response."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from romdam.config.quantities import refuse_bare, to_si
from romdam.config.sections.suite import HazardConfig
from romdam.core.csv_table import read_table
from romdam.core.errors import ConfigError, listed, quote
from romdam.postprocess.hazard import HazardCurve
from romdam.results.suite.rows import ROWS

_MOST = 1e6  # bytes of a table
_FEWEST = 2  # rows


@dataclass(frozen=True)
class SuiteHazard:
    """Hazard of a suite: its curve, the measure it is of, the response, and its levels [SI] or None."""

    curve: HazardCurve
    measure: str
    response: str
    levels: tuple[float, ...] | None


def suite_hazard(config: HazardConfig, folder: Path, source: str) -> SuiteHazard:
    """Read the hazard of a suite.

    Parameters
    ----------
    folder : where its relative path starts
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError
        for a table that is none, a response that no run has, and levels that are none of it.
    """
    where = f"{source}: suite.hazard"
    known = [name for name in ROWS if not {"gap", "floor_frequency"} & {*ROWS[name].dims}]
    if config.response not in known:
        near = difflib.get_close_matches(config.response, known, n=3) or known
        raise ConfigError(
            f"{where}.response: {quote(config.response)} is no response of a run; take {listed(near)}"
        )
    curve = read_hazard(folder / config.table, "m/s" if config.measure == "pgv" else "m/s^2")
    levels = None
    if config.levels is not None:
        units, values = ROWS[config.response].units, list[float]()
        for k, level in enumerate(config.levels):
            try:
                values.append(to_si(level, units))
                if isinstance(level, str):
                    refuse_bare(level, units)
            except ValueError as error:
                raise ConfigError(f"{where}.levels[{k}]: {error}") from None
            if values[-1] <= 0.0 or values[-1] in values[:-1]:
                raise ConfigError(f"{where}.levels[{k}]: must be above 0 and once there, got {quote(level)}")
        levels = tuple(sorted(values))
    return SuiteHazard(curve, config.measure, config.response, levels)


def read_hazard(path: Path, units: str) -> HazardCurve:
    """Read a hazard curve from a CSV file with the columns `intensity [unit]` and `annual frequency`.

    Parameters
    ----------
    units : SI unit of the intensity, such as m/s^2

    Raises
    ------
    ConfigError
        for a file that is no such table, a unit of another kind, and rows that are not monotonic.
    """
    table = read_table(path, most=_MOST)
    head = table.names
    named = len(head) == 2 and head[0].startswith("intensity [") and head[0].endswith("]")
    if not named or head[1] != "annual frequency":
        raise ConfigError(
            f"{path}: line 1: columns must be `intensity [g]`, with its unit, and `annual frequency`, got "
            f"{quote(', '.join(head))}"
        )
    unit = head[0].removeprefix("intensity [").removesuffix("]")
    rows = list[tuple[float, float]]()
    for k, (x, frequency) in enumerate(zip(*(table.numbers(name) for name in head), strict=True)):
        cells = table.rows[k]
        try:
            x = to_si(f"{float(x)!r} {unit}", units)
        except ValueError as error:
            raise ConfigError(f"{table.at(k)}: must be an intensity in {unit} ({error})") from None
        if not (0.0 < x < math.inf and frequency > 0.0):
            raise ConfigError(f"{table.at(k)}: must be two numbers above 0, got {quote(', '.join(cells))}")
        if rows and not (x > rows[-1][0] and frequency < rows[-1][1]):
            raise ConfigError(
                f"{table.at(k)}: intensities must rise and frequencies fall, got {cells[0]} and "
                f"{cells[1]} after {table.rows[k - 1][0]} and {table.rows[k - 1][1]}; sort the table, or "
                "correct the row"
            )
        rows.append((x, frequency))
    if len(rows) < _FEWEST:
        raise ConfigError(f"{path}: a hazard curve has at least {_FEWEST} rows, got {len(rows)}")
    intensity, frequency = np.array(rows).T
    return HazardCurve(intensity, frequency)
