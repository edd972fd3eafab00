"""What is in a list of records: one row each, failures included."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from romdam.config.records import RecordConfig, is_manifest, read_manifest
from romdam.errors import ConfigError, RecordError
from romdam.records.measures import measure
from romdam.records.motion import GroundMotion
from romdam.records.p695 import SETS
from romdam.records.sources import matching_files
from romdam.records.suite import EACH, load_motions

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
    """

    name: str
    motion: GroundMotion | None = None
    recorded: GroundMotion | None = None
    error: str = ""


def list_records(sources: Sequence[str], common: RecordConfig | None = None) -> list[Listed]:
    """Read every record that the sources name; one that fails becomes a row with its error.

    Parameters
    ----------
    sources : each a job's YAML file, a manifest (CSV or YAML), a folder, a glob, a record file, or a
        P-695 set ("farfield", "nearfield_pulse", "nearfield_no_pulse")
    common : unit, dt, correction and the like for sources that are not a job; its own source is ignored
    """
    return [
        row
        for source in sources
        for entry, folder in _entries(source, common)
        for row in _load(entry, folder)
    ]


def _entries(source: str, common: RecordConfig | None) -> Iterator[tuple[RecordConfig | Listed, Path]]:
    settings: dict[str, object] = {"components": {"y": EACH}}
    if common is not None:
        settings |= common.model_dump(exclude_unset=True, exclude={"file", "files", "manifest", "suite"})
    path = Path(source)
    try:
        if source in SETS:
            yield RecordConfig.model_validate(settings | {"suite": source}), Path()
        elif path.suffix.lower() in (".yaml", ".yml", ".csv"):
            yield from _listed_in(path, settings)
        else:
            files = matching_files(path)
            if not files:
                raise RecordError(f"{source}: no such file, folder, pattern or P-695 set ({', '.join(SETS)})")
            for file in files:
                yield RecordConfig.model_validate(settings | {"file": file.resolve()}), Path()
    except (RecordError, ConfigError) as error:
        yield Listed(source, error=str(error)), Path()


def _listed_in(path: Path, settings: dict[str, object]) -> Iterator[tuple[RecordConfig, Path]]:
    """Records of a job's YAML file, or the rows of a manifest."""
    from romdam.config.load import load_config

    if not is_manifest(path):
        job = load_config(path)
        for entry in job.config.records:
            yield entry, job.folder
        return
    common = RecordConfig.model_validate(settings | {"manifest": path})
    for row, _ in read_manifest(path, common):
        yield row, path.parent


def _load(entry: RecordConfig | Listed, folder: Path) -> list[Listed]:
    if isinstance(entry, Listed):
        return [entry]
    try:
        motions = load_motions([entry], folder)
        if not entry.correction:
            return [Listed(motion.name, motion) for motion in motions]
        raw = load_motions([entry.model_copy(update={"correction": (), "keep": {}})], folder)
        before = {motion.name: motion for motion in raw}
        return [Listed(motion.name, motion, before.get(motion.name)) for motion in motions]
    except (RecordError, ConfigError) as error:
        return [Listed(str(entry.file or entry.files or entry.manifest or entry.suite), error=str(error))]


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
    found = measure(motion.acc[shaken] if shaken.any() else motion.acc[:1], motion.dt)
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
