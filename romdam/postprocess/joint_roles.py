"""Which block of a joint stands on the other: what tells bases and lifts from contraction joints."""

from __future__ import annotations

import json
from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from romdam.core.arrays import Floats

if TYPE_CHECKING:  # workers write no file
    import xarray as xr

_UPRIGHT = 1e-3  # of a joint's normal, its part along the vertical, from which on one block is the upper one
_BEARS = 0.5  # the same from which on it is a base or a lift; contraction joints are nearly vertical


def upward(dataset: xr.Dataset) -> Floats:
    """Unit vector against gravity, (3,); z where a result has no gravity."""
    stated = json.loads(str(dataset.attrs.get("configuration", "{}")))
    gravity = np.array(stated.get("loads", {}).get("gravity") or (0.0, 0.0, 0.0), dtype=float)
    size = float(np.linalg.norm(gravity))
    return np.array([0.0, 0.0, 1.0]) if size == 0.0 else -gravity / size


def rock_of(dataset: xr.Dataset) -> set[str]:
    """Names of the blocks of rock."""
    return set(json.loads(str(dataset.attrs.get("rock_blocks", "[]"))))


def mean_normal(gaps: xr.Dataset) -> Floats:
    """Unit normal of a joint's mean plane from block I to J, (3,), from its gaps."""
    normal = gaps.gap_area.values @ gaps.gap_normal.values
    return np.asarray(normal / np.linalg.norm(normal))


def bears(normal: Floats, blocks: Collection[str], rock: Collection[str], up: Floats) -> bool:
    """Tell whether a joint is a base or a lift, in which one block stands on the other or on rock."""
    return len(set(blocks) & set(rock)) == 1 or abs(float(normal @ up)) >= _BEARS


def bearing_first(dataset: xr.Dataset) -> xr.Dataset:
    """The dataset with its joints in the order of a report: bases and lifts before contraction joints."""
    first = bearing_joints(dataset)
    if not first:
        return dataset
    return dataset.isel(joint=np.argsort(~np.isin(dataset.joint.values, first), kind="stable"))


def bearing_joints(dataset: xr.Dataset) -> list[str]:
    """Names of the bases and lifts."""
    names = list(map(str, dataset.joint.values)) if "gap_normal" in dataset.variables else []
    rock, up, bearing = rock_of(dataset), upward(dataset), list[str]()
    for name in names:
        normal = mean_normal(dataset.isel(gap=dataset.gap_joint.values == name))
        if bears(normal, list(map(str, dataset.joint_blocks.sel(joint=name).values)), rock, up):
            bearing.append(name)
    return bearing


def upper_is_J(normal: Floats, blocks: tuple[str, str], rock: Collection[str], up: Floats) -> bool:
    """Tell whether block J is the one that stands on the other.

    Of blocks beside each other that is J, unless J alone is rock.
    """
    upright = float(normal @ up)
    if abs(upright) > _UPRIGHT:
        return upright > 0.0
    return not (blocks[1] in rock and blocks[0] not in rock)
