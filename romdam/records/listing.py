"""List records: one row each, failures included."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from romdam.config.sections.motions.records import RecordConfig, is_manifest, manifest_rows
from romdam.core.errors import ConfigError, RecordError
from romdam.core.motion import GroundMotion
from romdam.records.measures import measure, moving
from romdam.records.p695 import SETS
from romdam.records.record_set import EACH, load_records
from romdam.records.sources import matching_files

GRAVITY = 9.80665
AXES = "xyz"
HEADINGS = (
    "record",
    "axes",
    "dt s",
    "time s",
    "PGA g",
    "PGV m/s",
    "PGD m",
    "Arias m/s",
    "CAV m/s",
    "D5-95 s",
)


@dataclass(frozen=True)
class Listed:
    """One record of a list.

    Attributes
    ----------
    name : its identifier, or its source where it could not be read
    motion : as the structure will feel it; None where it could not be read
    recorded : before its correction; None where nothing is corrected
    error : why it could not be read
    no_source : whether what was asked for is no source of records at all
    """

    name: str
    motion: GroundMotion | None = None
    recorded: GroundMotion | None = None
    error: str = ""
    no_source: bool = False


def list_records(sources: Sequence[str], common: RecordConfig | None = None) -> list[Listed]:
    """Read every record that the sources name; one that fails becomes a row with its error.

    Parameters
    ----------
    sources : each a job's YAML file, a manifest (CSV or YAML), a folder, a glob, a record file, or a
        P-695 set ("farfield", "nearfield_pulse", "nearfield_no_pulse")
    common : unit, dt, correction and the like for sources that are not a job; its own source is ignored
    """
    return [row for source in sources for row in _of_source(source, common)]


def _of_source(source: str, common: RecordConfig | None) -> Iterator[Listed]:
    try:
        entries = list(_entries(source, common))
    except (RecordError, ConfigError) as error:
        yield Listed(source, error=str(error), no_source=True)
        return
    for entry, folder in entries:
        yield from _load(entry, folder)


def _entries(source: str, common: RecordConfig | None) -> Iterator[tuple[RecordConfig, Path]]:
    from romdam.config.load import load_config

    settings: dict[str, object] = {"components": {"y": EACH}}
    if common is not None:
        settings |= common.model_dump(exclude_unset=True, exclude={"file", "files", "manifest", "suite"})
    path = Path(source)
    if source in SETS:
        yield RecordConfig.model_validate(settings | {"suite": source}), Path()
    elif path.suffix.lower() not in (".yaml", ".yml", ".csv"):
        files = matching_files(path)
        if not files:
            raise RecordError(f"{source}: no such file, folder, pattern or P-695 set ({', '.join(SETS)})")
        for file in files:
            yield RecordConfig.model_validate(settings | {"file": file.resolve()}), Path()
    elif is_manifest(path):
        manifest_rows(path)  # its own mistakes are those of the source, not of a record
        yield RecordConfig.model_validate(settings | {"manifest": path.resolve()}), Path()
    else:
        job = load_config(path)
        yield from ((entry, job.folder) for entry in job.config.records)


def _load(entry: RecordConfig, folder: Path) -> Iterator[Listed]:
    raw: dict[str, GroundMotion | None] = {}
    if entry.correction:
        uncorrected = entry.model_copy(update={"correction": (), "keep": {}})
        raw = {one.name: one.motion for one in load_records([uncorrected], folder)}
    for one in load_records([entry], folder):
        yield Listed(one.name, one.motion, raw.get(one.name), str(one.error or ""))


def format_table(listed: Sequence[Listed]) -> str:
    """Lay the records out in aligned columns; warnings and errors follow, one a line."""
    rows = [_row(one) for one in listed if one.motion is not None]
    columns = [HEADINGS, *rows]
    widths = [max(len(row[i]) for row in columns) for i in range(len(HEADINGS))]
    lines = [
        "  ".join(
            word.ljust(width) if i < 2 else word.rjust(width)
            for i, (word, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in columns
    ]
    notes = [f"{one.name}: {w}" for one in listed if one.motion is not None for w in one.motion.warnings]
    failed = [one.error for one in listed if one.motion is None]
    count = f"{len(rows)} records" + (f", {len(failed)} failed" if failed else "")
    return "\n".join(
        [*lines, "", count, *(f"warning: {note}" for note in notes), *(f"error: {f}" for f in failed)]
    )


def _row(listed: Listed) -> tuple[str, ...]:
    """The largest component's measures."""
    motion = listed.motion
    assert motion is not None
    shaken = np.any(motion.acc != 0.0, axis=-1)
    axes = "".join(axis for axis, moves in zip(AXES, shaken, strict=True) if moves) or "-"
    found = measure(moving(motion.acc), motion.dt)
    peak = {
        name: float(np.nanmax(values)) if np.isfinite(values).any() else 0.0 for name, values in found.items()
    }
    return (
        listed.name,
        axes,
        f"{motion.dt:g}",
        f"{motion.duration:.2f}",
        f"{peak['pga'] / GRAVITY:.3f}",
        *(f"{peak[name]:.3g}" for name in ("pgv", "pgd", "arias", "cav")),
        f"{peak['d5_95']:.2f}",
    )
