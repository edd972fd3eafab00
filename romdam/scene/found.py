"""What a job says in general: all bodies of a mesh, all blocks that touch, all blocks of like names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from romdam.config.job import Config
from romdam.config.patterns import with_matching_names
from romdam.config.sections.joints import TOUCHING
from romdam.config.sections.places import PlaneRef
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, MeshError
from romdam.core.scene import Block
from romdam.geometry.meshes.bodies import bodies_text, extent_text
from romdam.geometry.meshes.files import MeshFiles
from romdam.scene.blocks import dam_of, materials_of, named_blocks
from romdam.scene.mortar.clearance import sagittas
from romdam.scene.mortar.interface import STEEPEST
from romdam.scene.mortar.segments import REACH, segments
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.pairing import do_not_touch
from romdam.scene.select import select_facets

MOST = 500  # bodies that become blocks
_EDGE = 1e-3  # share of a facet below which blocks only meet at an edge
_ROUNDING = 1e-9  # of the tolerance


@dataclass(frozen=True)
class NamedBodies:
    """Bodies of a section of `blocks`, which become blocks.

    Attributes
    ----------
    section : its name
    boxes : (bodies, 2, 3) lowest and highest corner of each, in the file's unit
    """

    section: str
    boxes: Floats

    @property
    def names(self) -> list[str]:
        """Names of the blocks: `<section>.1`, `<section>.2`, ..."""
        return [f"{self.section}.{number}" for number in range(1, len(self.boxes) + 1)]

    def explained(self, message: str) -> str:
        """A message, with where the bodies are if it is of a name that is like those of the bodies."""
        wrong = re.search(rf"no '{re.escape(self.section)}(\.\d+)?' is defined", message)
        if wrong is None:
            return message
        meant = "" if wrong[1] else f"; {self.section}.* stands for all of them"
        count = f"{len(self.boxes)} {'body' if len(self.boxes) == 1 else 'bodies'}"
        where = f"{count}, {bodies_text(self.boxes)}, in the file's unit"
        return f"{message}; {self.section!r} has {where}{meant}"


def named_bodies(config: Config, folder: Path, source: str) -> list[NamedBodies]:
    """The bodies of all sections of `blocks` with `bodies: auto`.

    Parameters
    ----------
    folder : where relative paths in the configuration start
    source : name of the configuration file, for messages

    Raises
    ------
    MeshError
        for mesh files that cannot be read, missing groups, and more bodies than blocks can be.
    """
    files, every = MeshFiles(folder), list[NamedBodies]()
    for name, block in config.blocks.items():
        if block.mesh is None or block.mesh.bodies != "auto":
            continue
        location = f"{source}: blocks.{name}.mesh"
        bodies = files.bodies(block.mesh, location)
        if len(bodies.boxes) > MOST:
            raise MeshError(
                f"{location}.bodies: {folder / block.mesh.file} has {bodies.counted} in this block, limit "
                f"{MOST}: its elements hardly share nodes ({bodies_text(bodies.boxes)}, in the file's unit); "
                "merge the nodes that coincide within each body, or name a group"
            )
        every.append(NamedBodies(name, bodies.boxes))
    return every


def extents_of_bodies(config: Config, blocks: Mapping[str, Block]) -> list[str]:
    """A sentence for each block that is a body of a mesh, or a piece of one: where it is."""
    return [
        f"block {name}: {extent_text(np.array([points.min(axis=0), points.max(axis=0)]))} [m]"
        for section, block in config.blocks.items()
        if block.mesh is not None and block.mesh.names
        for name in config.made_of(section)
        for points in (blocks[name].points,)
    ]


class Found:
    """The blocks of a configuration whose bodies are known, and what follows from where they are.

    Parameters
    ----------
    folder : where relative paths in the configuration start
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError, MeshError
        for blocks that cannot be meshed or read.
    """

    def __init__(self, config: Config, folder: Path, source: str) -> None:
        self._config, self._source = config, source
        materials = materials_of(config)
        self._dam = dam_of(config, materials, source)
        named = named_blocks(config, materials, MeshFiles(folder), self._dam.blocks, source)
        self._blocks = self._dam.blocks | named

    def fill(self, raw: dict[str, Any]) -> None:
        """Put pairs that touch, and names in the place of patterns, into the mapping of the configuration.

        Raises
        ------
        ConfigError
            where nothing touches, and for patterns that no block, or no joint, is like.
        """
        touching = self._config.touching
        if touching is not None and touching.pairs is None:
            raw["joints"][TOUCHING]["pairs"] = self._pairs(touching.tolerance)
        joints = (
            *self._config.every_joint,
            *((raw.get("joints") or {}).get(TOUCHING, {}).get("pairs") or ()),
        )
        with_matching_names(raw, tuple(self._blocks), tuple(dict.fromkeys(joints)), self._entry, self._source)

    def _pairs(self, tolerance: float) -> dict[str, tuple[str, str]]:
        """Names of joints between blocks that touch and that nothing is between yet, and the two blocks."""
        location = f"{self._source}: joints.{TOUCHING}"
        joined = {frozenset(joint.between) for joint in self._config.every_joint.values()}
        ties = (*(tie.between for tie in self._config.ties.values()), *(tie.blocks for tie in self._dam.ties))
        joined |= set(map(frozenset, ties))
        meeting, pairs = touching_pairs(self._blocks, tolerance), dict[str, tuple[str, str]]()
        for a, b in meeting:
            if frozenset((a, b)) in joined:
                continue
            if (name := f"{a}-{b}") in pairs or name in self._config.every_joint:
                raise ConfigError(
                    f"{location}: two joints get the name {name!r}; rename a joint, or a block that holds a -"
                )
            pairs[name] = (a, b)
        if pairs:
            return pairs
        if meeting:
            raise ConfigError(
                f"{location}: every pair of blocks that touch ({len(meeting)}) has a joint or a tie of its "
                "own, so nothing is left for it; remove it"
            )
        if len(self._blocks) < 2:
            only = next(iter(self._blocks))
            raise ConfigError(f"{location}: {only!r} is the only block, limit two blocks; remove it")
        nearest = min(combinations(self._blocks.values(), 2), key=lambda pair: _apart(*pair))
        raise ConfigError(do_not_touch(*nearest, tolerance, location))

    def _entry(self, name: str, entry: Mapping[str, Any]) -> dict[str, Any] | None:
        """An entry with a face for a block that is like its pattern; None where it has no such face."""
        block = self._blocks[name]
        if "faces" in entry:
            faces = [face for face in entry["faces"] if _has_face(block, face)]
            return {**entry, "block": name, "faces": faces} if faces else None
        return {**entry, "block": name} if _has_face(block, entry["face"]) else None


def touching_pairs(blocks: Mapping[str, Block], tolerance: float) -> list[tuple[str, str]]:
    """Pairs of blocks whose faces lie on each other over some area, in the order of the blocks.

    Parameters
    ----------
    tolerance : distance of two faces that touch, besides their curvature [m]
    """
    surfaces = {name: MortarSurface.boundary(block) for name, block in blocks.items()}
    pairs = []
    for a, b in combinations(blocks, 2):
        reach = tolerance + 2.0 * REACH * min(surfaces[name].pieces.radius.max() for name in (a, b))
        if _apart(blocks[a], blocks[b]) > reach:
            continue
        between = segments(surfaces[a], surfaces[b], tolerance)
        allowed = tolerance * (1.0 + _ROUNDING) + sagittas(surfaces[a], surfaces[b], between)
        on = (np.abs(between.distance) <= allowed) & (between.cosine < -np.cos(np.radians(STEEPEST)))
        if float(between.area[on].sum()) > _EDGE * min(surfaces[name].areas.min() for name in (a, b)):
            pairs.append((a, b))
    return pairs


def _apart(a: Block, b: Block) -> float:
    """The largest distance of two blocks' boxes along an axis [m]; negative where they overlap."""
    low = np.maximum(a.points.min(axis=0), b.points.min(axis=0))
    high = np.minimum(a.points.max(axis=0), b.points.max(axis=0))
    return float((low - high).max())


def _has_face(block: Block, face: str | Mapping[str, Any]) -> bool:
    named = face if isinstance(face, str) else PlaneRef.model_validate(face, context={"si": True})
    if isinstance(named, str) and named in block.unsound_faces:
        return True  # which selecting it says
    try:
        return len(select_facets(block, named, "")) > 0
    except ConfigError:
        return False
