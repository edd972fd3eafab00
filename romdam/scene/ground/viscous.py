"""Viscous faces of blocks, by name, and how far they are from the dam."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from romdam.config.sections.ground import GroundConfig, ViscousConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import Absorbing, Block, Ints
from romdam.geometry.elements import Floats
from romdam.geometry.facets import area_vectors
from romdam.scene.select import refuse_selected_twice, select_facets

log = logging.getLogger(__name__)

_NONE = 1e-6  # of a block's size: a distance that is none


def rock_of(ground: GroundConfig, generated: Sequence[ViscousConfig]) -> frozenset[str]:
    """Names of the blocks of rock: those with viscous faces, and those named besides."""
    return frozenset([*(face.block for face in (*generated, *ground.viscous)), *ground.rock])


def with_viscous_faces(
    blocks: dict[str, Block], faces: Sequence[ViscousConfig], rock: frozenset[str], source: str
) -> dict[str, Block]:
    """Give blocks the faces that take waves up.

    Raises
    ------
    ConfigError
        for faces that a block has not, and blocks without mass.
    """
    # the middle of the foot of what stands on the rock; of rock alone, of its top (3,) [m]
    standing = [block.points for name, block in blocks.items() if name not in rock]
    points = np.vstack(standing or [block.points for block in blocks.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    foot = np.append((low + high)[:2] / 2.0, low[2] if standing else high[2])
    with_faces, seen = dict(blocks), dict[tuple[str, tuple[int, ...]], str]()
    for k, viscous in enumerate(faces):
        location, block = f"{source}: ground.viscous[{k}]", with_faces[viscous.block]
        if block.material.rho == 0.0:
            raise ConfigError(
                f"{location}.block: block {viscous.block!r} has no mass to carry waves (0 kg/m3); leave out "
                "`mass: false`, or hold the face by a support"
            )
        for i, face in enumerate(viscous.faces):
            facets = select_facets(block, face, f"{location}.faces[{i}]")
            refuse_selected_twice(seen, viscous.block, facets, f"{location}.faces[{i}]")
            away = viscous.distance or _distance(block.points, facets, foot, f"{location}.faces[{i}]")
            block = replace(block, absorbing=(*block.absorbing, Absorbing(facets, away)))
        with_faces[viscous.block] = block
    return with_faces


def _distance(points: Floats, facets: Ints, foot: Floats, location: str) -> float:
    """Mean distance of a face's planes from the foot [m].

    Raises
    ------
    ConfigError
        for a face that goes through the foot.
    """
    vectors = area_vectors(points, facets)
    area = np.linalg.norm(vectors.sum(axis=1), axis=1).sum()
    away = float((vectors * (points[facets] - foot)).sum() / area)
    if away <= _NONE * float(np.ptp(points, axis=0).max()):
        raise ConfigError(
            f"{location}: its springs follow from its distance from the dam's foot, which is {away:.4g} m, "
            "limit above 0; give `distance`"
        )
    log.info("%s: %.4g m from the dam's foot, which its springs follow from", location, away)
    return away
