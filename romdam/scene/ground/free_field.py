"""The layers of rock that a free field comes up through, as its mesh has them along the sides."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Bools, FreeField, Ints, Material
from romdam.scene.elements import ELEMENTS, Floats, facet_element
from romdam.scene.facets import boundary_facets, facet_normals

log = logging.getLogger(__name__)

_VERTICAL = 1e-6  # vertical component of the normal of a side
_SAME = 1e-6  # of the rock's depth: elevations that are one
_FINE = 0.1  # of the median element's height: levels of an irregular mesh that are nearer are one


def free_field(
    blocks: Mapping[str, Block], rock: frozenset[str], surface: float | None, source: str
) -> FreeField:
    """Find the layers of the rock.

    Parameters
    ----------
    rock : names of its blocks
    surface : elevation of the level surface; the highest point of the sides where None [m]

    Raises
    ------
    ConfigError
        where the viscous faces are not vertical sides and one level bottom, and for rock that differs along
        a level of its sides.
    """
    place = f"{source}: ground.input"
    own = {name: blocks[name] for name in sorted(rock)}
    bottom = _bottom(own, place)
    sides = {name: _sides(block) for name, block in own.items()}
    corners = np.concatenate([_corner_levels(own[name], facets).ravel() for name, facets in sides.items()])
    top = float(corners.max(initial=bottom)) if surface is None else surface
    if top - bottom <= 0.0:
        raise ConfigError(
            f"{place}: the rock's surface, {top:g} m, must be above its bottom, {bottom:g} m; correct "
            "`ground.surface`, or give the rock sides"
        )
    levels = _levels(corners, top, bottom)
    materials = _materials(own, sides, levels, place)
    order = max(2 if ELEMENTS[block.element].quadratic else 1 for block in own.values())
    log.info("%s: free field of %d layers of elements, surface at %g m", place, len(materials), top)
    return FreeField(levels, materials, order, rock)


def _normals(block: Block, facets: Ints) -> Floats:
    return facet_normals(block.points, facets)[:, 2] if len(facets) else np.zeros(0)


def _bottom(rock: Mapping[str, Block], place: str) -> float:
    """Elevation of the viscous faces that are no sides [m]."""
    found = []
    for block in rock.values():
        for face in block.absorbing:
            up = _normals(block, face.facets)
            found.append(block.points[face.facets[np.abs(up) > _VERTICAL], 2].ravel())
    levels = np.concatenate(found)
    low, high = levels.min(initial=np.inf), levels.max(initial=-np.inf)
    lowest, highest = (float(f([f(b.points[:, 2]) for b in rock.values()])) for f in (np.min, np.max))
    if not len(levels):
        raise ConfigError(
            f"{place}: free_field comes up through a viscous face at the bottom, and there is none (0 of "
            f"{sum(len(block.absorbing) for block in rock.values())} faces); name it in ground.viscous"
        )
    if max(high - lowest, high - low) > _SAME * (highest - lowest):
        raise ConfigError(
            f"{place}: free_field takes viscous faces that are vertical, and one level bottom; those that "
            f"are not vertical reach from {low:g} to {high:g} m, the rock's lowest point is {lowest:g} m; "
            "mesh a level bottom, or take ground.input: uniform"
        )
    return lowest


def _sides(block: Block) -> Ints:
    """Vertical facets of a block that are viscous, or, without any, on its boundary."""
    viscous = [face.facets for face in block.absorbing]
    for facets in (*([np.vstack(viscous)] if viscous else ()), boundary_facets(block.cells, block.element)):
        vertical: Bools = np.abs(_normals(block, facets)) <= _VERTICAL
        if vertical.any():
            return facets[vertical]
    return facets[:0]


def _corner_levels(block: Block, facets: Ints) -> Floats:
    """Elevations of the corners of facets, (nf, corners)."""
    return block.points[facets, 2][:, : facet_element(facets).corners]


def _levels(corners: Floats, top: float, bottom: float) -> Floats:
    """Ends of the column's elements from the top down: those of the sides' elements."""
    inside = np.unique(corners)[::-1]
    inside = inside[(inside < top) & (inside > bottom)]
    distinct = np.abs(np.diff(np.concatenate([[top], inside, [bottom]])))
    distinct = distinct[distinct > _SAME * (top - bottom)]
    least = max(_FINE * float(np.median(distinct)), _SAME * (top - bottom))
    found = [top]
    for level in inside:
        if found[-1] - level > least and level - bottom > least:
            found.append(float(level))
    return np.array([*found, bottom])


def _materials(
    rock: Mapping[str, Block], sides: Mapping[str, Ints], levels: Floats, place: str
) -> tuple[Material, ...]:
    """The material of each layer.

    Raises
    ------
    ConfigError
        where the sides have several along one level, or none.
    """
    within: list[dict[Material, str]] = [{} for _ in levels[1:]]
    for name, facets in sides.items():
        heights = _corner_levels(rock[name], facets)
        for k, (high, low) in enumerate(pairwise(levels)):
            middle = 0.5 * (high + low)
            if ((heights.min(axis=1) < middle) & (heights.max(axis=1) > middle)).any():
                within[k].setdefault(rock[name].material, name)
    for k, here in enumerate(within):
        if len(here) != 1:
            what = f"of {' and of '.join(map(repr, here.values()))}" if here else "of no block"
            raise ConfigError(
                f"{place}: free_field takes rock whose layers are level: between {levels[k]:.4g} and "
                f"{levels[k + 1]:.4g} m the sides are {what} ({len(here)} materials, limit 1); give the "
                "sides one material at each level, or take ground.input: uniform"
            )
    return tuple(next(iter(here)) for here in within)
