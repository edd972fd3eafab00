"""List records: one row for each component, and one for what a target or scale is of; failures included."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from romdam.config.sections.motions.records import RecordConfig, is_manifest, manifest_rows, read_entry
from romdam.config.sections.motions.target import NAMED
from romdam.config.yaml_text import read_yaml
from romdam.core.errors import ConfigError, RecordError
from romdam.core.motion import GroundMotion
from romdam.records.components import measures
from romdam.records.design.selection import Candidate
from romdam.records.formats.columns import first_row, is_columns
from romdam.records.formats.knet import is_component
from romdam.records.formats.registry import HEAD
from romdam.records.formats.text import decode, read_bytes
from romdam.records.p695 import SETS
from romdam.records.record_set import EACH, Loaded, load_records
from romdam.records.sources import files_of_record, matching_files

GRAVITY = 9.80665
AXES = "xyz"
HEADINGS = (
    "record",
    "component",
    "channel",
    "dt [s]",
    "time [s]",
    "PGA [g]",
    "PGV [m/s]",
    "PGD [m]",
    "Arias [m/s]",
    "CAV [m/s]",
    "D5-95 [s]",
)


TARGET_HEADINGS = ("record", "scale factor", "misfit [ln]", "target")
_KEYS = {  # measure -> key with its unit
    "pga": "pga_m_s2",
    "pgv": "pgv_m_s",
    "pgd": "pgd_m",
    "arias": "arias_m_s",
    "cav": "cav_m_s",
    "d5_95": "d5_95_s",
}


@dataclass(frozen=True)
class Listed:
    """One record of a list.

    Attributes
    ----------
    name : its identifier, or its source where it could not be read
    motion : as the structure will feel it; None where it could not be read
    recorded : before it was matched, or corrected where it was not, scaled alike; None where neither is done
    of : what of the components its scale or target is of; "" where there is none
    candidate : how it stands to its target; None where there is none
    error : why it could not be read
    no_source : whether what was asked for is no source of records at all
    """

    name: str
    motion: GroundMotion | None = None
    recorded: GroundMotion | None = None
    of: str = ""
    candidate: Candidate | None = None
    error: str = ""
    no_source: bool = False

    @property
    def passed_over(self) -> bool:
        """Whether the record can be used, and its target passes it over."""
        return self.motion is None and self.candidate is not None and bool(self.candidate.why)

    @property
    def scaled_to(self) -> str:
        """What the scale brings the record to; "" where it says nothing."""
        return str(self.motion.provenance.get("scaled_to", "")) if self.motion else ""


def list_records(
    sources: Sequence[str], common: RecordConfig | Mapping[str, object] | None = None
) -> list[Listed]:
    """Read every record that the sources name; one that fails becomes a row with its error.

    Parameters
    ----------
    sources : each a job's YAML file, a manifest (CSV or YAML), a folder, a glob, a record file, or a
        P-695 set ("farfield", "nearfield_pulse", "nearfield_no_pulse")
    common : unit, dt, correction, target and the like for sources that are not a job; its own source is
        ignored
    """
    rows: list[Listed] = []
    seen: set[Path] = set()  # files of K-NET that belong to a record which is listed already
    for source in sources:
        path = Path(source)
        if path in seen:
            continue
        if is_component(path):
            with suppress(RecordError):
                seen |= set(files_of_record(path)[1])
        try:
            entries = list(_entries(source, common))
        except (RecordError, ConfigError) as error:
            rows.append(Listed(source, error=str(error), no_source=True))
            continue
        for entry, entry_folder in entries:
            rows += _load(entry, entry_folder)
    return rows


def read_settings(path: Path | None, select: int | None) -> dict[str, object]:
    """Keys of an entry of `records:` from a YAML file, with so many to be selected.

    Raises
    ------
    ConfigError
        for what is no mapping of them; what they hold is checked with the source.
    """
    if path is None and select is not None:
        raise ConfigError("--select: needs --target FILE, what the records are to be near to")
    read = {} if path is None else read_yaml(path)
    if not isinstance(read, dict):
        raise ConfigError(f"{path}: expected keys of an entry of `records:`, such as `target`")
    settings: dict[str, object] = dict(read)
    tables = settings.get("target")
    spectrum = tables.get("spectrum") if isinstance(tables, dict) else None
    if path is not None and isinstance(spectrum, dict) and "table" in spectrum:
        spectrum["table"] = str(path.parent.resolve() / str(spectrum["table"]))
    if select is not None:
        settings = {"scale": "target"} | settings | {"select": select}
    if "match" in settings and settings.get("scale") == "target":
        del settings["scale"]
    return settings


def _entries(
    source: str, common: RecordConfig | Mapping[str, object] | None
) -> Iterator[tuple[RecordConfig, Path]]:
    """The entries of `records:` that a source stands for, each with the folder where its paths start."""
    from romdam.config.load import load_config

    if isinstance(common, RecordConfig):
        common = common.model_dump(exclude_unset=True, exclude={"file", "files", "manifest", "suite"})
    settings = dict(common or {})
    if "components" not in settings and "x_azimuth" not in settings:
        settings["components"] = {"y": EACH}  # where nothing is said, each channel is a motion along y
    path = Path(source)
    is_plain_record = False  # a CSV file that holds samples, not one that lists records
    if path.suffix.lower() == ".csv":
        with suppress(RecordError):
            head = decode(read_bytes(path, HEAD))
            is_plain_record = is_columns(head) or first_row(head) is not None
    if source in SETS:
        yield read_entry(settings | {"suite": source}, source), Path()
    elif path.suffix.lower() not in (".yaml", ".yml", ".csv") or is_plain_record:
        is_file = any(file.exists() for file in files_of_record(path)[1]) and not path.is_dir()
        if not is_file and not matching_files(path):
            raise RecordError(f"{source}: no such file, folder, pattern or P-695 set ({', '.join(SETS)})")
        key = "file" if is_file else "files"
        yield read_entry(settings | {key: str(path.resolve())}, source), Path()
    elif is_manifest(path):
        manifest_rows(path)  # its own mistakes are those of the source, not of a record
        yield read_entry(settings | {"manifest": path.resolve()}, source), Path()
    else:
        if common:
            raise RecordError(f"{source}: a job says itself what is done to its records; leave --target out")
        job = load_config(path)
        yield from ((entry, job.folder) for entry in job.config.records)


def _load(entry: RecordConfig, folder: Path) -> Iterator[Listed]:
    """The records of an entry, each with its motion before it was matched, or corrected where none is.

    Those that follow others in a sequence are listed by themselves.
    """
    entry = entry.model_copy(update={"after": None, "rest": None})
    before: dict[str, GroundMotion | None] = {}
    if entry.correction or entry.match:
        undone: dict[str, object] = {"keep": {}, "target": None, "select": None, "match": None}
        undone |= {} if entry.match else {"correction": ()}
        undone |= {"scale": None} if entry.target else {}
        unchanged = entry.model_copy(update=undone)
        before = {record.name: record.motion for record in load_records([unchanged], folder)}
    every: list[Loaded] = []
    passing = load_records(
        [entry], folder, lambda record: None if record.passes else every.append(record), ""
    )
    every += passing
    of = ""
    if entry.target:
        of = entry.target.of
    elif entry.scale is not None and (entry.scale.pga or entry.scale.sa):
        of = entry.scale.of
    for record in every:
        recorded = before.get(record.name)
        if recorded is not None and record.candidate is not None:
            recorded = replace(recorded, acc=record.candidate.factor * recorded.acc)
        yield Listed(record.name, record.motion, recorded, of, record.candidate, str(record.error or ""))


def format_table(listed: Sequence[Listed]) -> str:
    """Lay the components out in aligned columns; targets and warnings follow, one a line.

    What failed is counted; `failures` has the messages.
    """
    read = [record for record in listed if record.motion is not None]
    rows: list[tuple[str, ...]] = [HEADINGS]
    warnings = []
    for record in read:
        motion = record.motion
        assert motion is not None
        moves = _moving(motion)
        target = motion.provenance.get("target")
        matched = target.get("matched") if isinstance(target, dict) else None
        for axis in moves:
            rows.append(_row(record.name, motion, axis))
            if isinstance(matched, dict) and axis in matched and record.recorded is not None:
                rows.append(_row(record.name, record.recorded, axis, ", scaled alone"))
        if record.of and record.of not in AXES and len(moves) > 1:
            rows.append(_row(record.name, motion, record.of))
        warnings += [f"warning: {record.name}: {text}" for text in motion.warnings]
    lines = _aligned(rows, (0, 1, 2))
    if any(record.candidate for record in listed):
        table: list[tuple[str, ...]] = [TARGET_HEADINGS]
        for record in (*read, *(record for record in listed if record.passed_over)):
            if candidate := record.candidate:
                about = candidate.why or f"of {NAMED[record.of]}"
                numbers = f"{candidate.factor:.3f}", f"{candidate.misfit:.3f}"
                table.append((record.name, *numbers, about))
            else:
                table.append((record.name, "", "", ""))
        lines += ["", *_aligned(table, (0, 3))]
    failed = failures(listed)
    counted = f"{len(read)} record{'s' * (len(read) != 1)}"
    lines += ["", counted + (f", {len(failed)} failed" if failed else "")]
    lines += [f"scaled: {text}" for text in dict.fromkeys(record.scaled_to for record in read) if text]
    return "\n".join([*lines, *warnings])


def failures(listed: Sequence[Listed]) -> dict[str, str]:
    """Name -> why it could not be read."""
    return {
        record.name: record.error for record in listed if record.motion is None and not record.passed_over
    }


def as_document(listed: Sequence[Listed]) -> dict[str, object]:
    """The list as plain values, whose keys have units."""
    read: list[dict[str, object]] = []
    for record in listed:
        motion = record.motion
        if motion is None:
            continue
        components = {}
        for axis in _moving(motion):
            values = _measures(motion, axis)
            measured = {key: values[name] for name, key in _KEYS.items()}
            components[axis] = {"channel": _channel(motion, axis)} | measured
        read.append(
            {
                "name": record.name,
                "dt_s": motion.dt,
                "duration_s": motion.duration,
                "components": components,
                "scale_factor": motion.provenance.get("scale"),
                "scaled_to": record.scaled_to or None,
                "target": _candidate_values(record) if record.candidate else None,
                "warnings": list(motion.warnings),
            }
        )
    passed = [record for record in listed if record.passed_over]
    return {
        "records": read,
        "passed_over": [_candidate_values(record) | {"name": record.name} for record in passed],
        "failed": failures(listed),
    }


def _candidate_values(listed: Listed) -> dict[str, object]:
    """How a record stands to its target, as plain values."""
    candidate = listed.candidate
    assert candidate is not None
    return {
        "factor": candidate.factor,
        "misfit_ln": candidate.misfit,
        "of": listed.of,
        "passed_over": candidate.why or None,
    }


def _aligned(rows: Sequence[tuple[str, ...]], texts: tuple[int, ...]) -> list[str]:
    """Lines of columns, those numbered in `texts` to the left and the others, of numbers, to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(
            word.ljust(width) if i in texts else word.rjust(width)
            for i, (word, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _moving(motion: GroundMotion) -> list[str]:
    """Axes along which it shakes, one where it does not."""
    return [axis for axis, row in zip(AXES, motion.acc, strict=True) if np.any(row != 0.0)] or ["x"]


def _measures(motion: GroundMotion, of: str) -> dict[str, float]:
    """Measures of what `of` names of the components; zeros where the record does not move."""
    if not np.any(motion.acc != 0.0):
        return dict.fromkeys(_KEYS, 0.0)
    return measures(motion.acc, motion.dt, of)


def _row(name: str, motion: GroundMotion, of: str, about: str = "") -> tuple[str, ...]:
    """Cells under `HEADINGS`."""
    has = _measures(motion, of)
    return (
        name,
        NAMED[of] + about,
        _channel(motion, of),
        f"{motion.dt:g}",
        f"{motion.duration:.2f}",
        f"{has['pga'] / GRAVITY:.3f}",
        *(f"{has[name]:.3g}" for name in ("pgv", "pgd", "arias", "cav")),
        f"{has['d5_95']:.2f}",
    )


def _channel(motion: GroundMotion, axis: str) -> str:
    """Codes of the channels that a component is made of."""
    matrix, channels = motion.provenance.get("to_axes"), motion.provenance.get("channels")
    if axis not in AXES or not isinstance(matrix, list) or not isinstance(channels, list):
        return ""
    row = matrix[AXES.index(axis)]
    return "+".join(
        channel["code"] for channel, share in zip(channels, row, strict=True) if abs(share) > 1e-9
    )
