"""Forces that vary in time, as a configuration names them: tables, and where they act."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from romdam.config.quantities import to_si
from romdam.config.sections.loads import ForceHistoryConfig
from romdam.core.arrays import Bools, Floats
from romdam.core.csv_table import read_table
from romdam.core.errors import ConfigError
from romdam.core.motion import ForceSignal
from romdam.core.scene import Block, ForceHistory
from romdam.geometry.facets import area_vectors
from romdam.scene.points import face_weights
from romdam.scene.select import nearest_node, select_facets

_LOST = 1e-6  # of a force, that supports may take at once


def build_force_histories(
    entries: Sequence[ForceHistoryConfig],
    blocks: Mapping[str, Block],
    fixed: Mapping[str, Bools],
    folder: Path,
    source: str,
) -> tuple[ForceHistory, ...]:
    """Read the tables of `loads.force_history` and find where they act.

    Parameters
    ----------
    fixed : block name -> (n, 3) components that supports hold
    folder : where relative paths start
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError
        for tables that cannot be read or whose times do not rise, places that are not there, and forces that
        supports take at once.
    """
    histories = []
    for k, entry in enumerate(entries):
        name = f"loads.force_history[{k}]"
        location, block = f"{source}: {name}", blocks[entry.block]
        nodal, area = _pattern(entry, block, location)
        taken = float(np.abs(nodal[fixed[entry.block]]).sum() / np.abs(nodal).sum())
        if taken > 1.0 - _LOST:
            raise ConfigError(
                f"{location}: supports hold all {int(nodal.any(axis=1).sum())} nodes of block "
                f"{entry.block!r} that it acts on, limit some that move: it would do nothing; name another "
                "place"
            )
        time, force = _table(entry, folder, f"{location}.table")
        signal = ForceSignal(name, time + entry.start, force * entry.scale * area, entry.after == "hold")
        histories.append(ForceHistory(entry.block, nodal, signal))
    return tuple(histories)


def _table(entry: ForceHistoryConfig, folder: Path, location: str) -> tuple[Floats, Floats]:
    """Times [s] and forces [N], or pressures [Pa], of a table."""
    path = folder / entry.table
    table = read_table(path, location=location)
    columns = table.columns(("time", "force"), f"one time in s and force in {entry.unit} a line")
    time, force = columns["time"], columns["force"]
    if len(time) < 2:
        raise ConfigError(f"{location}: {path} has {len(time)} rows, at least 2 make a history; add rows")
    if time[0] < 0.0:
        raise ConfigError(
            f"{table.at(0)}: the first time is {time[0]:g} s, limit 0 s or more; "
            "take `start` to shift the table"
        )
    falls = np.flatnonzero(np.diff(time) <= 0.0)
    if len(falls):
        i = int(falls[0])
        raise ConfigError(
            f"{table.at(i + 1)}: the time {time[i + 1]:g} s does not rise over "
            f"{time[i]:g} s before it; sort the rows, and give a jump two times that differ a little"
        )
    if not force.any():
        raise ConfigError(f"{location}: {path} has no force but zero, so nothing would act; leave it out")
    one = to_si(f"1 {entry.unit}", "Pa" if entry.direction is None else "N")
    return time, force * one


def _pattern(entry: ForceHistoryConfig, block: Block, location: str) -> tuple[Floats, float]:
    """Nodal forces (n, 3) per newton [1], and the newtons of one unit of the table: 1, or the area [m2]."""
    nodal = np.zeros_like(block.points)
    axis = None if entry.direction is None else np.array(entry.direction) / np.linalg.norm(entry.direction)
    if entry.at is not None:
        assert axis is not None
        nodal[nearest_node(block, entry.at, entry.tolerance, f"{location}.at")] = axis
        return nodal, 1.0
    assert entry.face is not None
    facets = select_facets(block, entry.face, f"{location}.face")
    share, area = face_weights(block, facets)
    if axis is not None:
        return share[:, None] * axis, 1.0
    np.add.at(nodal, facets, -area_vectors(block.points, facets) / area)
    return nodal, area
