"""Ground motions from the `records:` part of a configuration."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from romdam.config.names import misnamed_file, same_file
from romdam.config.sections.records import MEASURES, RecordConfig
from romdam.core.errors import RecordError, shown
from romdam.core.motion import GroundMotion
from romdam.records.assemble import build_motion
from romdam.records.channel import Channel
from romdam.records.measures import measure
from romdam.records.sources import Found, find_records, pick

EACH = "each"


def load_motions(records: Sequence[RecordConfig], folder: Path) -> list[GroundMotion]:
    """Read, correct, orient and scale every record that the configuration asks for.

    Parameters
    ----------
    records : entries of `records:`
    folder : where relative paths start (the folder of the YAML file)

    Raises
    ------
    RecordError
        for a record that cannot be used, two records with one name, or a filter that keeps none.
    """
    motions: list[GroundMotion] = []
    for config in records:
        motions += kept_motions(find_records(config, folder), config)
    check_names(motions)
    return motions


def kept_motions(records: Iterable[Found], config: RecordConfig) -> list[GroundMotion]:
    """The motions of records that pass the entry's `keep`.

    Raises
    ------
    RecordError
        for a record that cannot be used, or where none passes.
    """
    found = [motion for one in records for motion in _motions(one)]
    kept = [motion for motion in found if passes(motion, config)]
    if not kept:
        limits = {name: limit.model_dump(exclude_none=True) for name, limit in config.keep.items()}
        source = config.file or config.files or config.manifest or config.suite or "components"
        raise RecordError(
            f"records: {source}: none of {len(found)} records passes `keep` {shown(limits)}; widen its limits"
        )
    return kept


def _motions(found: Found) -> Iterator[GroundMotion]:
    """One motion per record, or one per channel where an axis asks for each."""
    components = found.config.components
    axes = [axis for axis, component in components.items() if component.channel == EACH]
    if not axes:
        yield build_motion(found, _axes(found))
        return
    if len(components) > 1:
        raise RecordError(f"{found.place}: `{EACH}` takes one axis, not {', '.join(components)}")
    for channel in found.channels:
        suffix = re.sub(r"[^\w.+-]", "_", channel.code)  # the name becomes a file's
        name = f"{found.name}_{suffix}" if len(found.channels) > 1 else found.name
        yield build_motion(replace(found, name=name), {axes[0]: channel})


def _axes(found: Found) -> dict[str, Channel]:
    """Channel of each axis; empty means: rotate all channels by their azimuths."""
    if found.picked:
        return found.picked
    if found.config.components:
        return {
            axis: pick(found.channels, component.channel, found.place)
            for axis, component in found.config.components.items()
        }
    if found.config.x_azimuth is None:
        codes = ", ".join(channel.code for channel in found.channels)
        raise RecordError(
            f"{found.place}: which axis does it shake? Give `components` "
            f"(for example {{y: {found.channels[0].code}}}) or `x_azimuth`; its channels are {codes}"
        )
    return {}


def passes(motion: GroundMotion, config: RecordConfig) -> bool:
    """Whether the largest component's measures lie in the limits."""
    if not config.keep:
        return True
    used = motion.acc[np.any(motion.acc != 0.0, axis=-1)]
    values = measure(used if used.size else motion.acc, motion.dt)
    for name, limits in config.keep.items():
        low, high = limits.in_unit(MEASURES[name])
        if not low <= float(np.nanmax(values[name])) <= high:
            return False
    return True


def check_names(motions: Sequence[GroundMotion]) -> None:
    """Refuse names that name no file, and two records whose results would overwrite each other.

    Raises
    ------
    RecordError
        which names the places.
    """
    first: dict[str, GroundMotion] = {}
    for motion in motions:
        place = str(motion.provenance.get("place", ""))
        if wrong := misnamed_file(motion.name):
            raise RecordError(
                f"{place}: the record's name {shown(motion.name)} {wrong}, or give the record a `name`"
            )
        other = first.setdefault(same_file(motion.name), motion)
        if other is not motion:
            alike = "" if other.name == motion.name else f" and {other.name!r}, one file's to some systems,"
            raise RecordError(
                f"records: 2 records are named {motion.name!r}{alike} "
                f"({other.provenance.get('place', '')}; {place}); give each its own `name`"
            )
