"""Ground motions from the `records:` part of a configuration, every one read on its own."""

from __future__ import annotations

import csv
import difflib
import fnmatch
import io
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from romdam.config.names import misnamed_file, same_file
from romdam.config.sections.motions.records import MEASURES, RecordConfig, unit_in_si
from romdam.core.errors import ConfigError, RecordError, listed, quote
from romdam.core.files import replacing
from romdam.core.motion import GroundMotion
from romdam.core.printable import plain_cell
from romdam.records.assemble import build_motion
from romdam.records.channel import Channel
from romdam.records.components import measures
from romdam.records.design.selection import Candidate, select_motions
from romdam.records.plausible import DOUBTED_UNIT
from romdam.records.processing.offset import COUNTED_AS_MOTION
from romdam.records.processing.sequence import in_sequence
from romdam.records.sources import ReadRecord, pick, sources_of

EACH = "each"


@dataclass(frozen=True)
class Loaded:
    """One record of a configuration, or why it cannot be used.

    Attributes
    ----------
    name : of the record; of its source where it could not be read
    motion : read, corrected, oriented and scaled; None where it cannot be used
    error : why not; a RecordError's `key` says where its entry is to be mended, if it is
    passes : whether the entry's `keep` and `select` take it
    candidate : how it stands to its entry's target; None where there is none
    """

    name: str
    motion: GroundMotion | None = None
    error: RecordError | ConfigError | None = None
    passes: bool = True
    candidate: Candidate | None = None


def load_records(
    records: Sequence[RecordConfig],
    folder: Path,
    tell: Callable[[Loaded], None] | None = None,
    section: str = "records",
) -> Iterator[Loaded]:
    """Read, correct, orient and scale every record: one that cannot be used takes no other with it.

    Parameters
    ----------
    records : entries of `records:`
    folder : where relative paths start (the folder of the YAML file)
    tell : told of every record of an entry with a target, those that are passed over too
    section : where the entries stand in a configuration, for messages; empty where they stand in none

    Returns
    -------
    In the order of the entries; those that an entry's `keep` or `select` leaves out are not among them.
    """
    earlier: dict[str, GroundMotion] = {}
    for number, entry in enumerate(records):
        for record in _of_entry(entry, folder, f"{section}[{number}]" if section else "", earlier):
            if entry.target is not None and tell is not None:
                tell(record)
            if record.passes:
                yield record


def load_motions(records: Sequence[RecordConfig], folder: Path) -> list[GroundMotion]:
    """All of `load_records`, or the error of the first that cannot be used.

    Raises
    ------
    RecordError, ConfigError
        for a record that cannot be used, two records with one name, or a `keep` that takes none.
    """
    motions, earlier = list[GroundMotion](), dict[str, GroundMotion]()
    for number, entry in enumerate(records):
        loaded = list(_of_entry(entry, folder, f"records[{number}]", earlier))
        for record in loaded:
            if record.error is not None and record.passes:
                raise record.error
        passing = [record.motion for record in loaded if record.motion is not None and record.passes]
        if not passing:
            limits = {name: limit.model_dump(exclude_none=True) for name, limit in entry.keep.items()}
            source = entry.file or entry.files or entry.manifest or entry.suite or "components"
            raise RecordError(
                f"records: {source}: none of {len(loaded)} records passes `keep` {quote(limits)}; widen its "
                "limits"
            )
        motions += passing
    check_names(motions)
    return motions


def _of_entry(
    entry: RecordConfig, folder: Path, key: str, earlier: dict[str, GroundMotion]
) -> Iterator[Loaded]:
    """The records of an entry, whose errors name the key where there is one to be mended.

    Parameters
    ----------
    earlier : name -> motion of the entries above, of which `after` names one; gains those of this entry
    """
    of_entry: list[GroundMotion] = []
    try:
        for record in _candidates(entry, folder) if entry.target is not None else _read(entry, folder):
            below = getattr(record.error, "key", "") or next(
                (source for source in ("file", "files", "manifest", "suite") if getattr(entry, source)),
                "components",
            )
            if key and isinstance(record.error, RecordError):
                text = f"{key}.{below}: {record.error}"
                record = replace(record, error=RecordError(text, f"{key}.{below}"))
            if record.passes and record.motion is not None:
                if entry.after is not None:
                    record = _after_another(record, entry, key, earlier)
                of_entry += [] if record.motion is None else [record.motion]
            yield record
        earlier |= {motion.name: motion for motion in of_entry}
    except RecordError as error:  # of `only`, which is the entry's own
        raise RecordError(f"{key}.only: {error}".removeprefix("."), key and f"{key}.only") from None


def _after_another(record: Loaded, entry: RecordConfig, key: str, earlier: dict[str, GroundMotion]) -> Loaded:
    """The record with the one that shakes the model before it, and the rest between them."""
    assert entry.after is not None and entry.rest is not None and record.motion is not None
    try:
        first = earlier.get(entry.after)
        if first is None:
            near = difflib.get_close_matches(entry.after, earlier, n=1)
            meant = f"did you mean {near[0]}?" if near else "put the record it follows above it"
            known = f"there are {listed(list(earlier))}" if earlier else "there is none"
            raise RecordError(
                f"no record that can be used and stands above is named {quote(entry.after)}, {known}; {meant}"
            )
        return replace(record, motion=in_sequence(first, entry.rest, record.motion))
    except RecordError as error:
        text = f"{key}.after: {record.name}: {error}".removeprefix(".")
        return replace(record, motion=None, error=RecordError(text, key and f"{key}.after"))


def _read(entry: RecordConfig, folder: Path) -> Iterator[Loaded]:
    """The records of an entry as they stand; where one motion of a source cannot be used, none can."""
    try:
        sources = sources_of(entry, folder)
    except (RecordError, ConfigError) as error:
        yield Loaded(entry.name or str(entry.manifest or entry.files), error=error)
        return
    chosen = _Chosen(entry)
    several = not (len(sources) == 1 and sources[0].is_record) and bool(_list_of_records(entry))
    for source in sources:
        if source.is_record and not chosen.takes(source.name):
            continue
        loaded = []
        try:
            for recorded in source.read():
                if not chosen.takes(recorded.name):
                    continue
                recorded = replace(recorded, name=_named(entry, recorded.name, several=several))
                for motion in _motions(recorded):
                    passes = True  # whether the measures of the largest of x, y, z lie within `keep`
                    keep = recorded.config.keep
                    values = measures(motion.acc, motion.dt, "largest") if keep else {}
                    for name, limits in keep.items():
                        low, high = limits.in_unit(MEASURES[name])
                        passes = passes and low <= values[name] <= high
                    loaded.append(Loaded(motion.name, motion, passes=passes))
        except (RecordError, ConfigError) as error:
            loaded = [Loaded(_named(entry, source.name, several=several), error=error)]
        yield from loaded
    chosen.refuse_unmatched()


def _list_of_records(entry: RecordConfig) -> str | Path | None:
    """What names the records of an entry that may have several: a pattern, a manifest, a set."""
    return entry.files or entry.manifest or entry.suite


def _named(entry: RecordConfig, name: str, *, several: bool) -> str:
    """The name of a record: its entry's, before its own where the entry has several."""
    if entry.name is None:
        return name
    return f"{entry.name}_{name}" if several else entry.name


class _Chosen:
    """The records that the `only` of an entry takes, and what of it has matched none."""

    def __init__(self, entry: RecordConfig) -> None:
        self._patterns, self._source = entry.only, _list_of_records(entry)
        self._unmatched, self._names = dict.fromkeys(entry.only or ()), dict[str, None]()

    def takes(self, name: str) -> bool:
        """Whether a record of a name is taken."""
        self._names[name] = None
        matching = [pattern for pattern in self._patterns or () if fnmatch.fnmatchcase(name, pattern)]
        for pattern in matching:
            self._unmatched.pop(pattern, None)
        return self._patterns is None or bool(matching)

    def refuse_unmatched(self) -> None:
        """Refuse names that no record has.

        Raises
        ------
        RecordError
            with the names that are near, or all.
        """
        if not self._unmatched:
            return
        name, names = next(iter(self._unmatched)), list(self._names)
        near = difflib.get_close_matches(name.replace("*", ""), names, n=3)
        raise RecordError(
            f"{self._source}: no record of {len(names)} is named {quote(name)}; "
            + (f"near it are {', '.join(near)}" if near else f"there are {listed(names)}"),
            "only",
        )


def _candidates(entry: RecordConfig, folder: Path) -> list[Loaded]:
    """The records of an entry with a target; those that cannot be read are passed over where it selects."""
    loaded = list(_read(entry, folder))
    unread = [replace(record, passes=entry.select is None) for record in loaded if record.motion is None]
    motions = [record.motion for record in loaded if record.motion is not None and record.passes]
    if not motions:
        return [replace(record, passes=True) for record in unread]
    try:
        why_unread = [str(record.error) for record in unread if record.error]
        candidates = select_motions(entry, folder, motions, why_unread)
    except (RecordError, ConfigError) as error:
        source = entry.name or str(entry.files or entry.manifest or entry.suite or entry.file)
        return [Loaded(source, error=error)]
    compared = []
    for candidate in candidates:
        passes = candidate.error is not None or not candidate.why
        compared.append(Loaded(candidate.name, candidate.motion, candidate.error, passes, candidate))
    return compared + unread


def _motions(recorded: ReadRecord) -> Iterator[GroundMotion]:
    """One motion per record, or one per channel where an axis asks for each."""
    components, channels, location = recorded.config.components, recorded.channels, recorded.location
    axes = [axis for axis, component in components.items() if component.channel == EACH]
    if axes and len(components) > 1:
        raise RecordError(f"{location}: `{EACH}` takes one axis, not {', '.join(components)}", "components")
    if axes:
        channels = _accelerations(channels)
        for channel in channels:
            suffix = re.sub(r"[^\w.+-]", "_", channel.code)  # the name becomes a file's
            name = f"{recorded.name}_{suffix}" if len(channels) > 1 else recorded.name
            yield build_motion(replace(recorded, name=name), {axes[0]: channel})
    elif recorded.picked:
        yield build_motion(recorded, recorded.picked)
    elif components:
        yield build_motion(
            recorded,
            {axis: pick(channels, each.channel, location, axis) for axis, each in components.items()},
        )
    elif recorded.config.x_azimuth is not None:
        yield build_motion(recorded, {})  # rotates all channels by their azimuths
    else:
        codes = ", ".join(channel.code for channel in channels)
        raise RecordError(
            f"{location}: which axis does it shake? Give `components` "
            f"(for example {{y: {channels[0].code}}}) or `x_azimuth`; its channels are {codes}",
            "components",
        )


def _accelerations(channels: Sequence[Channel]) -> list[Channel]:
    """The channels that are accelerations, with a word of velocities beside them; all where none is."""
    kept, left_out = list[Channel](), list[str]()
    for channel in channels:
        try:
            if channel.unit:
                unit_in_si(channel.unit)
            kept.append(channel)
        except ValueError:
            left_out.append(f"channel {channel.code} is in {channel.unit}, no acceleration, and is left out")
    if not kept or not left_out:
        return list(channels)
    return [replace(channel, warnings=(*channel.warnings, *left_out)) for channel in kept]


def check_names(motions: Sequence[GroundMotion]) -> None:
    """Refuse names that name no file, and two records whose results would overwrite each other.

    Raises
    ------
    RecordError
        which names the places.
    """
    first: dict[str, GroundMotion] = {}
    for motion in motions:
        location = str(motion.provenance.get("place", ""))
        if wrong := misnamed_file(motion.name):
            raise RecordError(
                f"{location}: the record's name {quote(motion.name)} {wrong}, or give the record a `name`"
            )
        other = first.setdefault(same_file(motion.name), motion)
        if other is not motion:
            alike = "" if other.name == motion.name else f" and {other.name!r}, one file's to some systems,"
            raise RecordError(
                f"records: 2 records are named {motion.name!r}{alike} "
                f"({other.provenance.get('place', '')}; {location}); give each its own `name`"
            )


def usable_apart(
    records: Sequence[RecordConfig], folder: Path, tell: Callable[[Loaded], None] | None = None
) -> list[Loaded]:
    """Give every record of `load_records` a name of its own that can name a file, for runs by the hundred.

    A motion whose unit is doubted, or whose drift counts as motion, cannot be used: nobody reads a warning
    among hundreds of records, and each is a wrong factor. Nor can one whose name is taken.
    """
    loaded: list[Loaded] = []
    locations: dict[str, str] = {}  # of each name that is taken
    for record in load_records(records, folder, tell):
        location, motion = record.name, record.motion
        if motion is not None:
            doubts = [text for text in motion.warnings if DOUBTED_UNIT in text or COUNTED_AS_MOTION in text]
            if doubts:
                record = Loaded(record.name, error=RecordError("; ".join(doubts)))
            else:
                location = str(motion.provenance.get("place", record.name))
        name, why = re.sub(r"[^\w.+-]", "_", record.name), ""
        if wrong := misnamed_file(name):
            name, why = "record", f"the record's name {quote(name)} {wrong}; give it a `name`"
        elif other := locations.get(same_file(name)):
            why = f"a record named {name!r} is there already ({other}); give each its own `name`"
        if why:
            number = 2
            while same_file(f"{name}.{number}") in locations:
                number += 1
            record = Loaded(f"{name}.{number}", error=RecordError(f"{location}: {record.error or why}"))
        else:
            record = replace(record, name=name)
        loaded.append(record)
        locations[same_file(record.name)] = location
    return loaded


def write_choice(considered: Sequence[Loaded], folder: Path) -> None:
    """Write record_choice.csv: what was held against a target, taken or passed over, and why.

    Nothing is written where there is no target.
    """
    if not considered:
        return
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(("record", "used", "factor", "misfit_rms_ln", "of", "why_not"))
    for record in considered:
        used = "yes" if record.passes and record.motion is not None else "no"
        target = record.motion.provenance.get("target") if record.motion is not None else None
        of = str(target["of"]) if isinstance(target, dict) else ""
        factor, misfit, why_not = "", "", str(record.error or "")
        if candidate := record.candidate:
            factor, misfit = f"{candidate.factor:.6g}", f"{candidate.misfit:.6g}"
            why_not = str(record.error or candidate.why)
        writer.writerow(map(plain_cell, (record.name, used, factor, misfit, of, why_not)))
    with replacing(folder / "record_choice.csv") as unfinished:
        unfinished.write_text(text.getvalue(), encoding="utf-8")
