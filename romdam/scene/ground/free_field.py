"""The layers of rock that a free field comes up through, as its mesh has them along the sides."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from romdam.config.sections.ground import GroundConfig, IncidenceConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, FreeField, Material
from romdam.geometry.elements import ELEMENTS, Floats
from romdam.geometry.facets import boundary_facets, facet_normals
from romdam.geometry.meshes.kinds import refuse_wedges

log = logging.getLogger(__name__)

_VERTICAL = 1e-3  # vertical component of the normal of a side; mesh files round to five digits
_GRAZING = 0.98  # sine of the angle of P waves up to which they still come up
_SAME = 1e-4  # of the rock's depth: elevations that are the same


def free_field(
    blocks: Mapping[str, Block], rock: frozenset[str], ground: GroundConfig, source: str
) -> FreeField:
    """Find the layers of the rock.

    Parameters
    ----------
    rock : names of its blocks
    ground : elevation of the level surface, the highest point of the sides if not given; angle of the waves

    Raises
    ------
    ConfigError
        where the viscous faces are not vertical sides and one level bottom, and for rock that differs along
        a level of its sides; for an angle at which P waves do not come up through every layer.
    """
    surface = ground.surface
    location = f"{source}: ground.input"
    rock_blocks = {name: blocks[name] for name in sorted(rock)}
    for block in rock_blocks.values():
        refuse_wedges(block, "the rock of a free field is not made of", location)
    bottom = _bottom(rock_blocks, location)
    ends_of = _side_ends(rock_blocks)
    ends = np.concatenate(list(ends_of.values()))
    top = float(ends.max(initial=bottom)) if surface is None else surface
    if top - bottom <= 0.0:
        raise ConfigError(
            f"{location}: the rock's surface, {top:g} m, must be above its bottom, {bottom:g} m; correct "
            "`ground.surface`, or give the rock sides"
        )
    levels = _levels(ends, top, bottom, location)
    materials = _materials(rock_blocks, ends_of, levels, location)
    order = max(2 if ELEMENTS[block.element].quadratic else 1 for block in rock_blocks.values())
    log.info("%s: free field of %d layers of elements, surface at %g m", location, len(materials), top)
    field = FreeField(levels, materials, order, rock)
    if ground.incidence is None:
        return field
    points = np.vstack([block.points for block in rock_blocks.values()])
    return _inclined(field, ground.incidence, points, f"{source}: ground.incidence")


def _inclined(field: FreeField, incidence: IncidenceConfig, points: Floats, location: str) -> FreeField:
    """The field of waves at an angle.

    Parameters
    ----------
    points : (n, 3) of the rock [m]
    """
    shear, pressure = np.array([material.wave_speeds for material in field.materials]).T
    speed = (shear if incidence.wave == "s" else pressure)[-1]
    slowness = float(np.sin(np.radians(incidence.angle)) / speed)
    worst = int(pressure.argmax())
    if slowness * pressure[worst] >= _GRAZING:
        most = np.degrees(np.arcsin(min(_GRAZING * speed / pressure[worst], 1.0)))
        raise ConfigError(
            f"{location}.angle: {incidence.angle:g} degrees of {incidence.wave.upper()} waves make an "
            f"apparent velocity of {1.0 / slowness:.4g} m/s, and P waves of the rock between "
            f"{field.levels[worst]:.4g} and {field.levels[worst + 1]:.4g} m have {pressure[worst]:.4g} m/s, "
            f"with which they graze: limit {most:.4g} degrees; take a smaller angle"
        )
    axis = incidence.axis
    along = np.eye(2)["xy".index(axis)] if isinstance(axis, str) else np.array(axis[:2], dtype=float)
    along = along / np.linalg.norm(along)
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    middle = 0.5 * (low + high)
    if incidence.at is not None:
        middle = middle + (incidence.at - middle @ along) * along
    x, y = (slowness * along).tolist()
    return replace(field, slowness=(x, y), origin=(float(middle[0]), float(middle[1])))


def _bottom(rock: Mapping[str, Block], location: str) -> float:
    """Elevation of the viscous faces that are no sides [m]."""
    faces = []
    for block in rock.values():
        for face in block.absorbing:
            up = facet_normals(block.points, face.facets)[:, 2]
            faces.append(block.points[face.facets[np.abs(up) > _VERTICAL], 2].ravel())
    levels = np.concatenate(faces)
    low, high = levels.min(initial=np.inf), levels.max(initial=-np.inf)
    lowest, highest = (float(f([f(b.points[:, 2]) for b in rock.values()])) for f in (np.min, np.max))
    if not len(levels):
        raise ConfigError(
            f"{location}: free_field comes up through a viscous face at the bottom, and there is none (0 of "
            f"{sum(len(block.absorbing) for block in rock.values())} faces); name it in ground.viscous"
        )
    if max(high - lowest, high - low) > _SAME * (highest - lowest):
        raise ConfigError(
            f"{location}: free_field takes viscous faces that are vertical, and one level bottom; those that "
            f"are not vertical reach from {low:g} to {high:g} m, the rock's lowest point is {lowest:g} m; "
            "mesh a level bottom, or take ground.input: uniform"
        )
    return lowest


def _side_ends(rock: Mapping[str, Block]) -> dict[str, Floats]:
    """Lowest and highest elevation of each vertical facet of a block, (nf, 2) [m].

    The facets are those that are viscous, or, where no viscous one is vertical, those of the boundary.
    """
    none = {name: np.zeros((0, 2)) for name in rock}
    viscous = {n: np.vstack([face.facets for face in b.absorbing]) for n, b in rock.items() if b.absorbing}
    boundary = {name: boundary_facets(block.cells, block.element) for name, block in rock.items()}
    for facets_of in (viscous, boundary):
        ends = {}
        for name, facets in facets_of.items():
            points = rock[name].points
            sides = facets[np.abs(facet_normals(points, facets)[:, 2]) <= _VERTICAL]
            if len(sides):
                z = points[sides, 2]
                ends[name] = np.stack([z.min(axis=1), z.max(axis=1)], axis=1)
        if ends:
            return none | ends
    return none


def _levels(ends: Floats, top: float, bottom: float, location: str) -> Floats:
    """Ends of the column's elements from the top down, each as high as the sides' facets are there.

    Parameters
    ----------
    ends : (nf, 2) lowest and highest elevation of each facet [m]

    Raises
    ------
    ConfigError
        where the sides leave a level out.
    """
    levels_kept, just = [top], _SAME * (top - bottom)
    while levels_kept[-1] > bottom:
        here = ends[(ends[:, 0] < levels_kept[-1] - just) & (ends[:, 1] > levels_kept[-1] - just)]
        if not len(here):
            raise ConfigError(
                f"{location}: free_field comes up along the rock's sides from {bottom:g} to {top:g} m, and "
                f"they have no facets (0) below {levels_kept[-1]:.4g} m; correct `ground.surface`, or name "
                "all rock in ground.rock"
            )
        height = float(np.diff(here, axis=1).mean())
        left = levels_kept[-1] - height - bottom
        levels_kept.append(bottom if left < 0.5 * height else bottom + left)
    return np.array(levels_kept)


def _materials(
    rock: Mapping[str, Block], ends_of: Mapping[str, Floats], levels: Floats, location: str
) -> tuple[Material, ...]:
    """The material of each layer.

    Parameters
    ----------
    ends_of : block name -> (nf, 2) lowest and highest elevation of its facets on the sides [m]

    Raises
    ------
    ConfigError
        where the sides have several along one level, or none.
    """
    within: list[dict[Material, str]] = [{} for _ in levels[1:]]
    for name, ends in ends_of.items():
        for k, (high, low) in enumerate(pairwise(levels)):
            middle = 0.5 * (high + low)
            if ((ends[:, 0] < middle) & (ends[:, 1] > middle)).any():
                within[k].setdefault(rock[name].material, name)
    for k, here in enumerate(within):
        if len(here) != 1:
            what = f"of {' and of '.join(map(repr, here.values()))}" if here else "of no block"
            raise ConfigError(
                f"{location}: free_field takes rock whose layers are level: between {levels[k]:.4g} and "
                f"{levels[k + 1]:.4g} m the sides are {what} ({len(here)} materials, limit 1); give the "
                "sides one material at each level (its damping too), or take ground.input: uniform"
            )
    return tuple(next(iter(here)) for here in within)
