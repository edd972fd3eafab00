"""Ice, silt and lines of force as forces on the nodes of blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from romdam.config.sections.loads import IceConfig, LineLoadConfig, LoadsConfig, SiltConfig
from romdam.config.sections.places import BlockFace
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError, Faults
from romdam.core.scene import Block, PointForce
from romdam.geometry.pressed_facets import force_below
from romdam.scene.points import point_weights
from romdam.scene.reservoir.build import refuse_level
from romdam.scene.select import refuse_selected_twice, select_facets

_PIECES = 24  # of a line, each with two points of Gauss: elements along it are rarely that many
_HORIZONTAL = np.array([1.0, 1.0, 0.0])


def ice_silt_and_lines(
    loads: LoadsConfig, blocks: Mapping[str, Block], source: str, faults: Faults
) -> list[PointForce]:
    """Forces on nodes of `loads.ice`, `loads.silt` and `loads.line`.

    Parameters
    ----------
    source : name of the configuration file, for messages
    faults : gathers what is wrong with any of them
    """
    forces = list[PointForce]()
    for section, entries in (("ice", loads.ice), ("silt", loads.silt), ("line", loads.line)):
        for k, entry in enumerate(entries):
            key = f"loads.{section}[{k}]"
            with faults.gathered():
                for name, force in _ON_BLOCKS[section](entry, blocks, f"{source}: {key}", loads):
                    loaded = np.flatnonzero(force.any(axis=1))
                    forces += [PointForce(name, int(node), force[node], key) for node in loaded]
    return forces


def _of_ice(
    ice: IceConfig, blocks: Mapping[str, Block], location: str, _: LoadsConfig
) -> list[tuple[str, Floats]]:
    """Forces (n, 3) on blocks [N]: the pressure below the top of the ice less that below its foot."""
    pressure, foot = ice.thrust / ice.thickness, ice.level - ice.thickness

    def pressed(points: Floats, facets: Ints, level: float) -> Floats:
        return force_below(points, facets, level, lambda depth: np.full_like(depth, pressure))

    faces = _faces(ice.faces, ice.level, blocks, location, "the ice")
    bottom = min(float(points[facets, 2].min()) for _, points, facets in faces)
    if foot < bottom:
        raise ConfigError(
            f"{location}.thickness: the ice reaches below the foot of its faces, to {foot:g} m, and they "
            f"begin at {bottom:g} m; lower it to {ice.level - bottom:g} m at most"
        )
    return [
        (name, (pressed(points, facets, ice.level) - pressed(points, facets, foot)) * _HORIZONTAL)
        for name, points, facets in faces
    ]


def _of_silt(
    silt: SiltConfig, blocks: Mapping[str, Block], location: str, loads: LoadsConfig
) -> list[tuple[str, Floats]]:
    """Forces (n, 3) on blocks [N]."""
    weight, ratios = silt.density * loads.gravity_of_water, np.array([silt.pressure_ratio] * 2 + [1.0])
    return [
        (name, force_below(points, facets, silt.level, lambda depth: weight * depth) * ratios)
        for name, points, facets in _faces(silt.faces, silt.level, blocks, location, "the silt")
    ]


def _faces(
    faces: Sequence[BlockFace], level: float, blocks: Mapping[str, Block], location: str, load: str
) -> list[tuple[str, Floats, Ints]]:
    """Block, its points and facets of each face; refused if named twice, or if the level is off them."""
    seen = dict[tuple[str, tuple[int, ...]], str]()
    every = list[tuple[str, Floats, Ints]]()
    for i, face in enumerate(faces):
        facets = select_facets(blocks[face.block], face.face, f"{location}.faces[{i}].face")
        refuse_selected_twice(seen, face.block, facets, f"{location}.faces[{i}]")
        every.append((face.block, blocks[face.block].points, facets))
    refuse_level(level, [points[facets, 2] for _, points, facets in every], location, load)
    return every


def _of_line(
    line: LineLoadConfig, blocks: Mapping[str, Block], location: str, _: LoadsConfig
) -> list[tuple[str, Floats]]:
    """Forces (n, 3) on the block [N], with the line's sum and moment to round-off."""
    block, start, along = blocks[line.block], np.array(line.start), np.subtract(line.end, line.start)
    for key, at in (("start", line.start), ("end", line.end)):
        point_weights(block, at, line.tolerance, f"{location}.{key}")
    force, share = np.zeros_like(block.points), np.array(line.force) * np.linalg.norm(along) / (2 * _PIECES)
    for piece in range(_PIECES):
        for gauss in (0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0)):
            x, y, z = start + (piece + gauss) / _PIECES * along
            nodes, weights = point_weights(block, (x, y, z), line.tolerance, location)
            np.add.at(force, nodes, np.outer(weights, share))
    return [(line.block, force)]


_ON_BLOCKS: dict[str, Callable[..., list[tuple[str, Floats]]]] = {
    "ice": _of_ice,
    "silt": _of_silt,
    "line": _of_line,
}
