"""Forces of what is attached to blocks, from a result: those of anchors, for example."""

from __future__ import annotations

from typing import NamedTuple

import xarray as xr

from romdam.config.effects import EFFECTS


class AttachedForce(NamedTuple):
    """Force of an attachment over a run: at rest, least and largest, tension positive [N]."""

    of: str
    name: str
    rest: float
    least: float
    largest: float


def attached_forces(dataset: xr.Dataset) -> list[AttachedForce]:
    """The forces of all attachments of a result, effect after effect."""
    dims = [entry.records for entry in EFFECTS.values() if f"{entry.records}_force_least" in dataset]
    return [
        AttachedForce(
            dim,
            str(name),
            float(dataset[f"{dim}_force"][0, k]),
            float(dataset[f"{dim}_force_least"][k]),
            float(dataset[f"{dim}_force_largest"][k]),
        )
        for dim in dims
        for k, name in enumerate(dataset[dim].values)
    ]
