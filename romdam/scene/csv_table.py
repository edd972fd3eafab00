"""Tables of numbers in CSV files, with named columns."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError
from romdam.core.files import check_file

_LARGEST = 100e6  # bytes
_COUNTS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five"}


def read_columns(
    path: Path, columns: Sequence[str], location: str, row: str, optional: str = ""
) -> dict[str, Floats]:
    """Columns of a CSV file: name -> (rows,), all finite; others in the file are passed over.

    Parameters
    ----------
    columns : names that the first line must have
    location : file and key, for messages
    row : what a line holds and in which unit, such as "one point per line in m", for messages
    optional : name of a column that is read where the first line has it

    Raises
    ------
    ConfigError
        for a file that cannot be read, lacks a column or a row, or holds something else than numbers.
    """
    names = ",".join(columns)
    try:
        check_file(path, _LARGEST, ConfigError)
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.DictReader(stream, skipinitialspace=True))
    except (ConfigError, OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(
            f"{location}: {path} cannot be read ({error}); give a CSV file with {names}"
        ) from None
    missing = [column for column in columns if not rows or column not in rows[0]]
    if missing:
        what = f"lacks column {', '.join(missing)}" if rows else "has no rows"
        raise ConfigError(f"{location}: {path} {what}; its first line must be {names}, then {row}")
    read = [*columns, optional] if optional in rows[0] else list(columns)
    table = []
    for number, words in enumerate(rows, start=2):
        try:
            values = [float(words[column] or "") for column in read]
        except ValueError:
            values = [np.nan]
        if not np.all(np.isfinite(values)):
            raise ConfigError(
                f"{location}: {path} line {number}: expected {_COUNTS[len(read)]} finite numbers "
                f"{','.join(read)}, got {','.join(str(words[column]) for column in read)!r}"
            )
        table.append(values)
    return dict(zip(read, np.array(table).T, strict=True))
