"""What CF 1.11 asks of a NetCDF file of ours, read with the netCDF library; and its checker, where it is.

pip install compliance-checker    # in an environment of its own, on PATH; it works offline
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

CHECKER = shutil.which("compliance-checker")
TERM = r"(m|s|kg|N|Pa|J|Hz|K)(-?[1-9])?"
UNITS = re.compile(rf"1|%|{TERM}( {TERM})*")  # of which UDUNITS takes "kg0.5" for kg0 times 0.5
STAMP = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00: written by romdam \d.*")
# The checker (5.4.2, 6.1) goes by the name: it wants `time` to count since a date, which records need not
# state. CF knows a time coordinate by its units alone (4.4) and standardises no names of variables (1.3).
BY_NAME = "Coordinate variable 'time' should have standard_name='time', found: 'None'"


def flaws(path: Path) -> Iterator[str]:
    """What CF would have otherwise, one sentence each."""
    with netCDF4.Dataset(path) as file:
        for name in ("Conventions", "title", "source", "history", "references", "comment"):
            if not str(getattr(file, name, "")).strip():
                yield f"no attribute {name}"
        if file.Conventions != "CF-1.11" or not STAMP.fullmatch(file.history.splitlines()[0]):
            yield f"{file.Conventions}: {file.history}"
        named = {
            n for one in (file, *file.variables.values()) for n in getattr(one, "coordinates", "").split()
        }
        for name, variable in file.variables.items():
            yield from (f"{name}: {flaw}" for flaw in _flaws(file, name, variable, named))


def _flaws(file: netCDF4.Dataset, name: str, variable: Any, named: set[str]) -> Iterator[str]:
    if not getattr(variable, "long_name", "").strip():
        yield "no long_name"
    is_text = variable.dtype is str or variable.dtype.kind == "S"
    units = getattr(variable, "units", None)
    if is_text is (units is not None) and not hasattr(variable, "flag_values"):
        yield f"units {units}"
    if units is not None and not UNITS.fullmatch(units):
        yield f"units {units}"
    is_coordinate = name in named or name in file.dimensions
    if is_coordinate and {"_FillValue", "missing_value"} & set(variable.ncattrs()):
        yield "a coordinate with a fill value"
    if variable.dimensions == (name,):
        step = np.zeros(0) if is_text else np.diff(variable[:])
        if is_text or np.ma.is_masked(step) or not ((step > 0).all() or (step < 0).all()):
            yield "no coordinate variable: its values are not numbers in order"
    if hasattr(variable, "flag_values"):
        values = np.atleast_1d(variable.flag_values)
        if values.dtype != variable.dtype or len(values) != len(variable.flag_meanings.split()):
            yield f"flags {values} {variable.flag_meanings}"
    for one in getattr(variable, "coordinates", "").split():
        if not set(file[one].dimensions) <= {*variable.dimensions}:
            yield f"{one} is no coordinate of it"


def errors_of_the_checker(path: Path, report: Path) -> list[str]:
    """What the IOOS compliance checker calls errors, but for that of the name `time`."""
    assert CHECKER is not None
    command = [CHECKER, "--test=cf:1.11", "--format=json", f"--output={report}", str(path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert "exceptions occurred" not in done.stdout + done.stderr, done.stdout + done.stderr
    found = json.loads(report.read_text())["cf:1.11"]["high_priorities"]
    return sorted({text for one in found for text in one["msgs"]} - {BY_NAME})
