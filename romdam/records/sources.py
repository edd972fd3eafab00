"""From an entry of the configuration to recorded channels: one file, a folder, a manifest, a P-695 set."""

from __future__ import annotations

import glob
import hashlib
import itertools
import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from romdam.config.sections.motions.records import RecordConfig, manifest_rows, read_row
from romdam.core.errors import RecordError, listed, quote
from romdam.records.channel import Channel, NoAccelerationError, one_record
from romdam.records.formats.columns import Layout
from romdam.records.formats.knet import BOREHOLE, SURFACE, is_component, missing_files, of_one_record
from romdam.records.formats.registry import FORMATS, Declared, read_channels
from romdam.records.formats.text import NUMBER, read_bytes

log = logging.getLogger(__name__)

MOST_FILES = 10_000  # of one folder or glob
_OF_COLUMNS = {"time_column", "layout", "header_lines", "delimiter", "decimal"}  # keys for them alone
NOT_RECORDS = {".md", ".yaml", ".yml", ".csv", ".json", ".xml", ".py", ".pdf", ".png"}


@dataclass(frozen=True)
class ReadRecord:
    """The channels of one record and where they came from.

    Attributes
    ----------
    name : identifier, from the configuration or the file
    location : how errors name the record: its file, or its suite and number
    channels : what was recorded, in recorded units
    config : what is to be done with them
    files : name and SHA-256 of each file
    about : what a manifest says of it
    picked : channel of each axis where every axis has its own file
    """

    name: str
    location: str
    channels: list[Channel]
    config: RecordConfig
    files: dict[str, str] = field(default_factory=dict)
    about: dict[str, object] = field(default_factory=dict)
    picked: dict[str, Channel] = field(default_factory=dict)


@dataclass(frozen=True)
class Source:
    """A record of an entry, or the records of one that are read together, before it is read.

    Attributes
    ----------
    name : what it is called where it cannot be read
    read : reads it; raises RecordError or ConfigError
    is_record : whether it is one record of that name
    """

    name: str
    read: Callable[[], list[ReadRecord]]
    is_record: bool = False


def sources_of(entry: RecordConfig, folder: Path) -> list[Source]:
    """Every record that an entry asks for, each to be read on its own, in the order of names.

    Parameters
    ----------
    entry : of `records:`
    folder : where its relative paths start

    Raises
    ------
    RecordError, ConfigError
        for a folder or manifest that cannot be listed, and globs that match nothing.
    """
    if entry.suite is not None:
        return [Source(entry.suite, partial(_from_suite, entry))]
    if entry.manifest is not None:  # a row's own mistakes are those of its record
        manifest = folder / entry.manifest
        sources = []
        for number, row in enumerate(manifest_rows(manifest), start=1):
            stated = row if isinstance(row, dict) else {}
            name = stated.get("name") or Path(str(stated.get("file", f"{manifest.stem}_{number}"))).stem
            sources.append(
                Source(str(name), partial(_from_row, manifest, entry, number, row), is_record=True)
            )
        return sources
    if entry.files is not None:
        paths = _files(folder / str(entry.files), str(entry.files))
        if entry.group != "file":
            return [Source(str(entry.files), partial(_from_stations, paths, entry, folder))]
        records = of_one_record(paths)
        holes = [name for name, _ in records if name.endswith(BOREHOLE)]
        if holes and any(name.endswith(SURFACE) for name, _ in records):  # no table tells them apart
            log.warning(
                "%s: KiK-net records of boreholes (%s) and of the surface are each a record of its own; take "
                "one kind by its suffix, such as files: '*.EW2'",
                entry.files,
                ", ".join(holes[:5]),
            )
    elif entry.file is not None:
        records = [files_of_record(folder / entry.file)]
    else:
        return [Source("record", partial(_from_component_files, entry, folder))]
    return [Source(name, partial(_from_files, name, paths, entry, folder), True) for name, paths in records]


def files_of_record(path: Path) -> tuple[str, list[Path]]:
    """Name of the record of a file, and the files of K-NET and KiK-net that belong to it, itself first.

    Raises
    ------
    RecordError
        for a name without suffix under which there are records of a borehole and of the surface.
    """
    every: list[Path] = []
    with suppress(OSError, ValueError):  # the reader of the file says what is wrong with it
        every = [path] if path.exists() else []
        every += sorted(file for file in path.parent.glob(f"{glob.escape(path.stem)}.*") if file != path)
    records = of_one_record(every)
    if path in every:
        return next(record for record in records if path in record[1])
    known = [record for record in records if is_component(record[1][0])]
    if len(known) > 1:
        names = " or ".join(paths[0].name for _, paths in known)
        raise RecordError(
            f"{path}: there are records of the borehole and of the surface; name a file of one, {names}"
        )
    return known[0] if known else (path.stem, [path])


def _from_files(name: str, paths: list[Path], entry: RecordConfig, folder: Path) -> list[ReadRecord]:
    """One record of one or several files, whose channels stand in their order."""
    first, *others = [_from_file(path, entry, folder) for path in paths]
    channels = [channel for recorded in (first, *others) for channel in recorded.channels]
    files = {key: value for recorded in (first, *others) for key, value in recorded.files.items()}
    if len(paths) > 1:
        log.info("%s: read as one record with %s", paths[0], ", ".join(path.name for path in paths[1:]))
    if gone := missing_files(paths):
        said = f"{', '.join(gone)} is not there, it would belong to the record"
        channels[0] = replace(channels[0], warnings=(*channels[0].warnings, said))
    return [replace(first, name=name, channels=channels, files=files)]


def _files(pattern: Path, stated: str) -> list[Path]:
    """Files of a folder or pattern, without PEER's velocity and displacement where the acceleration is there.

    Raises
    ------
    RecordError
        where there is none.
    """
    paths = matching_files(pattern)
    stems = {path.with_suffix("") for path in paths if path.suffix.upper() == ".AT2"}
    companions = [
        path for path in paths if path.suffix.upper() in (".VT2", ".DT2") and path.with_suffix("") in stems
    ]
    if companions:
        names = listed([path.name for path in companions])
        log.warning("%s: left out %s, velocity and displacement of .AT2 files", stated, names)
    paths = [path for path in paths if path not in companions]
    if not paths:
        raise RecordError(f"{pattern}: no record files found; check the path or the pattern")
    return paths


def _from_stations(paths: list[Path], entry: RecordConfig, folder: Path) -> list[ReadRecord]:
    """Records of one station and event each; files that are no acceleration are left out with a word.

    Raises
    ------
    RecordError
        for a record that is damaged: its station would lack a component.
    """
    every: list[ReadRecord] = []
    left_out: list[str] = []
    for path in paths:
        try:
            every.append(_from_file(path, entry, folder))
        except NoAccelerationError as error:
            left_out.append(path.name)
            if len(left_out) == len(paths):
                raise RecordError(
                    f"{entry.files}: none of {len(paths)} files is a record ({error})"
                ) from None
    if left_out:
        names = ", ".join(left_out[:5]) + (" ..." if len(left_out) > 5 else "")
        said = f"{len(left_out)} files of {entry.files} are no record of acceleration, left out: {names}"
        first = every[0].channels[0]
        noted = replace(first, warnings=(*first.warnings, said))
        every[0] = replace(every[0], channels=[noted, *every[0].channels[1:]])
    groups: dict[tuple[str, str, str], list[ReadRecord]] = {}  # event, network, station
    for recorded in every:
        for channel in recorded.channels:
            event, network, station = (
                str(channel.meta.get(key, "")) for key in ("event", "network", "station")
            )
            if not station:
                raise RecordError(
                    f"{recorded.location}: the file names no station to group it by; set `group: file`"
                )
            groups.setdefault((event, network, station), []).append(replace(recorded, channels=[channel]))
    records = []
    for (event, *where), parts in groups.items():
        name = ".".join(word.replace(" ", "_").replace("/", "-") for word in where if word)
        events = sorted({key[0] for key in groups if list(key[1:]) == where})
        if len(events) > 1:
            name += f"_{events.index(event) + 1}"
        files = {file: digest for part in parts for file, digest in part.files.items()}
        channels = [channel for part in parts for channel in part.channels]
        records.append(ReadRecord(name, ", ".join(files), channels, parts[0].config, files))
    return records


def _from_file(path: Path, config: RecordConfig, folder: Path) -> ReadRecord:
    channels = _read(path, config, folder)
    digest = hashlib.sha256(read_bytes(path)).hexdigest()
    return ReadRecord(config.name or path.stem, str(path), channels, config, {path.name: digest})


def _read(path: Path, config: RecordConfig, folder: Path) -> list[Channel]:
    """The channels of a file; what only some formats can use is not passed over in silence."""
    response = None if config.response is None else folder / config.response
    layout = Layout(config.layout, config.header_lines, config.delimiter, config.decimal)
    declared = Declared(
        config.dt, config.time_column, response, config.unit, None if layout == Layout() else layout
    )
    with one_record(str(path)):
        channels = read_channels(path, declared)
    kind = str(channels[0].meta.get("format", ""))
    if kind != "columns" and (keys := sorted(_OF_COLUMNS & config.model_fields_set)):
        raise RecordError(f"{path}: `{keys[0]}` is for plain columns, the file is {kind}; remove it")
    if config.response is not None and kind in (*FORMATS, "columns"):
        raise RecordError(f"{path}: `response` is for counts that ObsPy reads, the file is {kind}; remove it")
    return channels


def _from_component_files(config: RecordConfig, folder: Path) -> list[ReadRecord]:
    """One file per axis; where a file holds several channels, `channel` picks one."""
    picked: dict[str, Channel] = {}
    files: dict[str, str] = {}
    for axis, component in config.components.items():
        path = folder / str(component.file)
        channels = _read(path, config, folder)
        picked[axis] = pick(channels, component.channel, str(path), axis)
        files[path.name] = hashlib.sha256(read_bytes(path)).hexdigest()
    location = ", ".join(files)
    name = config.name or Path(next(iter(files))).stem
    return [ReadRecord(name, location, list(picked.values()), config, files, {}, picked)]


def pick(channels: list[Channel], wanted: int | str | None, location: str, axis: str) -> Channel:
    """Return the channel of an axis by code, or by number from 1; None is right only where there is one.

    Raises
    ------
    RecordError
        listing the channels, when it is not there or ambiguous.
    """
    codes = [channel.code for channel in channels]
    if wanted is None and len(channels) == 1:
        return channels[0]
    if str(wanted) in codes and codes.count(str(wanted)) == 1:
        return channels[codes.index(str(wanted))]
    meant = {index for index, channel in enumerate(channels) if _is_azimuth(channel, wanted)}
    numbered = isinstance(wanted, int) and 1 <= wanted <= len(channels)
    if numbered and all(not c.code.isdigit() or _is_azimuth(c, c.code) for c in channels):
        meant.add(int(str(wanted)) - 1)
    if len(meant) == 1:
        return channels[meant.pop()]
    asked = "no channel named" if wanted is None else f"no channel {wanted!r}"
    if len(meant) > 1:
        asked = f"channel {wanted} is the number of one and the azimuth of another"
    rises = [text for text in channels[0].warnings if text.startswith(f"column {wanted} ")]
    aside = f"; {rises[0]}" if rises else ""
    text = f"{location}: {asked}; it has {', '.join(codes)}; name one under `components`{aside}"
    raise RecordError(text, f"components.{axis}.channel")


def _is_azimuth(channel: Channel, wanted: int | str | None) -> bool:
    """Tell whether a code is an azimuth in degrees, and the wanted one: 90 is that of channel 090."""
    where = channel.orientation
    if where is None or where.azimuth is None or not (channel.code.isdigit() and str(wanted).isdigit()):
        return False
    return float(channel.code) % 360.0 == where.azimuth == float(str(wanted)) % 360.0


def matching_files(pattern: Path) -> list[Path]:
    """Return the record files of a folder or a glob, sorted, without hidden files and other kinds.

    Raises
    ------
    RecordError
        for a folder that cannot be listed, and for more files than anybody means.
    """
    try:
        if pattern.is_dir():
            every = (  # without tables, pictures and PEER's _readME.txt
                path
                for path in pattern.iterdir()
                if path.suffix.lower() not in NOT_RECORDS and "readme" not in path.stem.lower()
            )
        else:
            every = (Path(match) for match in glob.iglob(str(pattern), recursive=True))
        paths = list(itertools.islice(every, MOST_FILES + 1))
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise RecordError(f"{quote(str(pattern))}: cannot be listed ({error})") from None
    if len(paths) > MOST_FILES:
        raise RecordError(f"{pattern}: more than {MOST_FILES} files; name fewer of them")
    return sorted(path for path in paths if path.is_file() and not path.name.startswith("."))


def _from_row(manifest: Path, entry: RecordConfig, number: int, row: object) -> list[ReadRecord]:
    """Read the record of one row of a manifest, which must be the one that the manifest means."""
    config, about = read_row(manifest, entry, number, row)
    recorded = _from_file(manifest.parent / str(config.file), config, manifest.parent)
    stated = about.get("sha256")
    if stated and stated not in recorded.files.values():
        raise RecordError(
            f"{recorded.location}: SHA-256 is {next(iter(recorded.files.values()))}, {manifest} says "
            f"{stated}; the file has changed"
        )
    for channel in recorded.channels:
        azimuth = None if channel.orientation is None else channel.orientation.azimuth
        for key, value in (("samples", channel.data.size), ("azimuth", azimuth)):
            word = str(about.get(key, ""))
            if value is None or NUMBER.fullmatch(word) is None:
                continue
            if (float(word) - value) % (360.0 if key == "azimuth" else np.inf):
                raise RecordError(
                    f"{recorded.location}, channel {channel.code}: {key} {value:g}, {manifest} says {word}; "
                    "one is wrong"
                )
    return [replace(recorded, about=about)]


def _from_suite(config: RecordConfig) -> list[ReadRecord]:
    from romdam.records.p695 import read_p695  # here: needs the extra `suites`

    return [
        ReadRecord(name, f"suite {name}", channels, config)
        for name, channels in read_p695(str(config.suite)).items()
    ]
