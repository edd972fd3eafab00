"""Ground motions from the `records:` part of a configuration."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from romdam.config.records import ComponentConfig, RecordConfig, unit_in_si
from romdam.errors import RecordError
from romdam.records.channel import Channel, check_channel
from romdam.records.format_columns import read_columns
from romdam.records.motion import GroundMotion

AXES = ("x", "y", "z")


def load_motions(records: Sequence[RecordConfig], folder: Path) -> list[GroundMotion]:
    """Read every record that the configuration asks for.

    Parameters
    ----------
    records : entries of `records:`
    folder : where relative paths start (the folder of the YAML file)

    Raises
    ------
    RecordError
        for a record that cannot be used, or two records with one name.
    """
    motions = [_load_motion(record, folder) for record in records]
    names = [motion.name for motion in motions]
    for name in names:
        if names.count(name) > 1:
            raise RecordError(
                f"records: {names.count(name)} records are named {name!r}; give each its own `name`"
            )
    return motions


def _load_motion(record: RecordConfig, folder: Path) -> GroundMotion:
    assert record.file is not None
    path = folder / record.file
    channels = {c.code: c for c in read_columns(path, record.unit or "", record.dt, record.time_column)}
    if record.unit is None:
        raise RecordError(f'{path}: the file does not say its unit; give `unit`, for example "g" or "cm/s2"')
    picked = {axis: _pick(channels, wanted, path) for axis, wanted in record.components.items()}
    for channel in picked.values():
        check_channel(channel, str(path))
    first = next(iter(picked.values()))
    acc = np.zeros((3, first.data.size))
    for axis, channel in picked.items():
        sign = -1.0 if record.components[axis].reverse else 1.0
        acc[AXES.index(axis)] = sign * unit_in_si(record.unit) * channel.data
    provenance: dict[str, object] = {
        "file": path.name,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "unit": record.unit,
        "unit_m_s2": unit_in_si(record.unit),
        "dt_recorded": first.dt,
    }
    return GroundMotion(record.name or path.stem, acc, first.dt, provenance)


def _pick(channels: dict[str, Channel], wanted: ComponentConfig, path: Path) -> Channel:
    code = "1" if wanted.channel is None else str(wanted.channel)
    if code not in channels:
        raise RecordError(f"{path}: no channel {code!r}; it has {', '.join(channels)}")
    return channels[code]
