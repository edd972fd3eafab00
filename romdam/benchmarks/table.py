"""The table of the benchmark set as a file: CSV, JSON or Markdown."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, astuple, fields
from importlib import resources
from math import isfinite
from pathlib import Path

from romdam.core.benchmark_row import BenchmarkRow
from romdam.core.errors import ConfigError
from romdam.core.files import prepare_folder, replacing
from romdam.core.version import SOURCE, VERSION
from romdam.postprocess.variant_tables import markdown_table
from romdam.results.table import write_csv

SUFFIXES = (".csv", ".json", ".md")
SHIPPED = "figures.json"  # all cases as `romdam benchmarks --out` wrote them for this version
_SIGNS = 6  # significant digits of a number in Markdown, as sources print at most


def refuse_format(path: Path) -> None:
    """Refuse a file of no known format, before anything is computed.

    Raises
    ------
    ConfigError
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(
            f"--out: {path}: the table is written as {', '.join(SUFFIXES)}; end the name in one of them"
        )


def write_rows(rows: Sequence[BenchmarkRow], path: Path) -> Path:
    """Write the rows whole or not at all; what failed has no number.

    Raises
    ------
    WriteError
        where the folder or the disk refuses the file.
    """
    prepare_folder(path.parent)
    if path.suffix.lower() == ".csv":
        cells = (
            ["" if isinstance(value, float) and not isfinite(value) else value for value in astuple(row)]
            for row in rows
        )
        return write_csv([field.name for field in fields(BenchmarkRow)], cells, path)
    text = _json(rows) if path.suffix.lower() == ".json" else _markdown(rows)
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
    return path


def shipped_rows() -> list[BenchmarkRow]:
    """The rows that came with the package, computed when it was released."""
    text = (resources.files("romdam.benchmarks") / SHIPPED).read_text(encoding="utf-8")
    return [BenchmarkRow(**row) for row in json.loads(text)["rows"]]


def _json(rows: Sequence[BenchmarkRow]) -> str:
    listed = [
        {
            name: None if isinstance(value, float) and not isfinite(value) else value
            for name, value in asdict(row).items()
        }
        for row in rows
    ]
    document = {"romdam": VERSION, "command": "benchmarks", "rows": listed}
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _markdown(rows: Sequence[BenchmarkRow]) -> str:
    """The table, and below it the reasons of known differences and the errors."""
    lines = [
        (
            row.case,
            row.quantity,
            row.unit,
            f"{row.ours:.{_SIGNS}g}",
            f"{row.published:.{_SIGNS}g}",
            f"{100.0 * row.difference:.2g}",
            row.verdict,
            f"{row.source} ({row.kind})",
        )
        for row in rows
    ]
    head = ("case", "quantity", "unit", "romdam", "published", "difference %", "verdict", "source")
    notes = "".join(f"{note}\n" for note in dict.fromkeys(f"- {r.case}: {r.note}" for r in rows if r.note))
    table = markdown_table(head, lines)
    return f"{SOURCE}, `romdam benchmarks`\n\n{table}" + (f"\n{notes}" if notes else "")
