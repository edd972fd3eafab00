"""Every record of a suite, or why it cannot be used: one bad file must not stop the others."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from romdam.config.names import misnamed_file, same_file
from romdam.config.sections.records import RecordConfig, manifest_rows, read_row
from romdam.core.errors import ConfigError, RecordError, shown
from romdam.core.motion import GroundMotion
from romdam.records.plausible import DOUBTED_UNIT
from romdam.records.record_set import kept_motions, passes
from romdam.records.sources import Found, find_records, matching_files, record_of_row


@dataclass(frozen=True)
class Loaded:
    """One record of a suite.

    Attributes
    ----------
    name : unique in the suite; letters, digits, "_", ".", "+" and "-" only, so that it can name a file
    motion : its ground motion; None where it cannot be used
    error : why not
    """

    name: str
    motion: GroundMotion | None = None
    error: str = ""


def load_each(records: Sequence[RecordConfig], folder: Path) -> list[Loaded]:
    """Read every record on its own; what fails, and what has a name that is taken, is a row with its error.

    Parameters
    ----------
    records : entries of `records:`; folders, globs and manifests are taken file by file
    folder : where relative paths start

    Returns
    -------
    In the order of the entries. A motion whose unit is doubted counts as failed: nobody reads a warning among
    hundreds of records, and a unit taken wrongly is a factor of ten or a thousand.
    """
    found: list[Loaded] = []
    places: dict[str, str] = {}
    for entry in records:
        for one in load_entry(entry, folder):
            one = _doubted(one)
            name = re.sub(r"[^\w.+-]", "_", one.name)
            if wrong := misnamed_file(name):
                error = one.error or f"the record's name {shown(name)} {wrong}; give it a `name`"
                found.append(Loaded(_free_name("record", places), None, f"{_place(one)}: {error}"))
            elif other := places.get(same_file(name)):
                error = one.error or (
                    f"a record named {name!r} is there already ({other}); give each its own `name`"
                )
                found.append(Loaded(_free_name(name, places), None, f"{_place(one)}: {error}"))
            else:
                found.append(Loaded(name, one.motion, one.error))
            places[same_file(found[-1].name)] = _place(one)
    return found


def _place(one: Loaded) -> str:
    return one.name if one.motion is None else str(one.motion.provenance.get("place", one.name))


def _free_name(name: str, taken: dict[str, str]) -> str:
    number = 2
    while same_file(f"{name}.{number}") in taken:
        number += 1
    return f"{name}.{number}"


def _doubted(one: Loaded) -> Loaded:
    """The record, failed where its unit is doubted."""
    doubts = [text for text in one.motion.warnings if DOUBTED_UNIT in text] if one.motion else []
    return Loaded(one.name, None, "; ".join(doubts)) if doubts else one


def load_entry(entry: RecordConfig, folder: Path) -> Iterator[Loaded]:
    """Read the records of one entry, each on its own; those that its `keep` leaves out are no failures.

    Parameters
    ----------
    entry : of `records:`
    folder : where its relative paths start
    """
    if entry.files is not None and entry.group == "file":
        try:
            paths = matching_files(folder / entry.files)
        except RecordError as error:
            yield Loaded(entry.name or entry.files, None, str(error))
            return
        if not paths:
            yield Loaded(entry.name or entry.files, None, f"{folder / entry.files}: no record files found")
        for path in paths:
            one = entry.model_copy(update={"files": None, "file": path.absolute()})
            yield from _load(path.stem, partial(find_records, one, folder), entry)
    elif entry.manifest is not None:
        yield from _manifest(entry, folder)
    else:
        source = entry.file.stem if entry.file is not None else str(entry.suite or entry.files or "record")
        yield from _load(entry.name or source, partial(find_records, entry, folder), entry)


def _manifest(entry: RecordConfig, folder: Path) -> Iterator[Loaded]:
    path = folder / str(entry.manifest)
    try:
        rows = manifest_rows(path)
    except ConfigError as error:
        yield Loaded(entry.name or path.stem, None, str(error))
        return
    for number, row in enumerate(rows, start=1):
        stated = row if isinstance(row, dict) else {}
        name = str(stated.get("name") or Path(str(stated.get("file", f"{path.stem}_{number}"))).stem)
        try:
            one, about = read_row(path, entry, number, row)
        except ConfigError as error:
            yield Loaded(name, None, str(error))
            continue
        yield from _load(name, partial(_row_record, path, one, about), one)


def _row_record(path: Path, row: RecordConfig, about: dict[str, object]) -> list[Found]:
    return [record_of_row(path, row, about)]


def _load(name: str, find: Callable[[], Iterable[Found]], entry: RecordConfig) -> Iterator[Loaded]:
    try:
        motions = kept_motions(find(), entry.model_copy(update={"keep": {}}))
    except (RecordError, ConfigError) as error:
        yield Loaded(name, None, str(error))
        return
    yield from (Loaded(motion.name, motion) for motion in motions if passes(motion, entry))
