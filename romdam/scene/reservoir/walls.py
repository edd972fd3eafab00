"""Walls of a reservoir: where they lie on solids, how steep they are, and which move with the rock."""

from __future__ import annotations

import logging

import numpy as np

from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Reservoir, WetFace
from romdam.geometry.facets import row_numbers
from romdam.scene.mortar.interface import STEEPEST
from romdam.scene.mortar.segments import Segments, segments
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.reservoir.wet_mesh import WetMesh, wet_mesh

log = logging.getLogger(__name__)

UPRIGHT = np.sin(np.radians(10.0))  # vertical part of a wall's normal, up to which it stands upright
TOUCH = 1e-3  # distance of faces that lie on each other [m], as of joints
_COVERED = 0.95  # least share of floor and leaning banks that lies on the rock, where no key says another


def lying_on(water: MortarSurface, solid: MortarSurface) -> Segments:
    """Places where facets of the water and of a solid look at each other and lie on each other."""
    between = segments(water, solid, TOUCH)
    return between.only(between.cosine < -np.cos(np.radians(STEEPEST)))


def wall_edges(mesh: WetMesh, upstream: Floats) -> tuple[Ints, Bools]:
    """Edges (n, 2) of the wet mesh's rim, without seams, and whether the walls that they sweep lean.

    The normal of each wall, its edge times `upstream`, points out of the water.
    """
    rim, seams = mesh.rim, mesh.seams
    number = row_numbers(np.concatenate([rim, seams]))
    rim = rim[~np.isin(number[: len(rim)], number[len(rim) :])]
    edges, middles = [], []  # of every piece, towards whose middle the water is
    for piece in mesh.pieces:
        sides = np.stack([piece.nodes, np.roll(piece.nodes, -1, axis=1)], axis=2)
        edges.append(sides.reshape(-1, 2))
        middles.append(np.repeat(mesh.points[piece.nodes].mean(axis=1), sides.shape[1], axis=0))
    every = np.sort(np.concatenate(edges), axis=1)
    number = row_numbers(np.concatenate([np.sort(rim, axis=1), every]))
    order = np.argsort(number[len(rim) :], kind="stable")
    owner = order[np.searchsorted(number[len(rim) :], number[: len(rim)], sorter=order)]
    normal = np.cross(mesh.points[rim[:, 1]] - mesh.points[rim[:, 0]], upstream)
    outward = mesh.points[rim].mean(axis=1) - np.concatenate(middles)[owner]
    turned = np.einsum("nk,nk->n", normal, outward) < 0.0
    rim = np.where(turned[:, None], rim[:, ::-1], rim)
    return rim, np.asarray(np.abs(normal[:, 2]) > UPRIGHT * np.linalg.norm(normal, axis=1))


def refuse_prism_beside_rock(water: Reservoir, blocks: dict[str, Block], location: str) -> None:
    """Refuse a prismatic reservoir whose floor and leaning banks do not lie on its rock.

    Raises
    ------
    ConfigError
        with the share that does, and the faces that no wall lies on.
    """
    if not water.rock or water.mesh is not None:
        return
    mesh = wet_mesh(blocks, water)
    edges, leans = wall_edges(mesh, water.upstream)
    along = mesh.points @ water.upstream
    far = mesh.points + np.outer(along.max() + water.length - along, water.upstream)
    k = len(mesh.points)
    walls = MortarSurface(
        "reservoir", np.concatenate([mesh.points, far]), np.hstack([edges, edges[:, ::-1] + k])
    )
    refuse_uncovered(walls, leans, water.rock, blocks, _COVERED, location)


def refuse_uncovered(
    walls: MortarSurface,
    leans: Bools,
    rock: tuple[WetFace, ...],
    blocks: dict[str, Block],
    least: float,
    location: str,
) -> Bools:
    """Tell which walls lie on the rock, with any of their area.

    Parameters
    ----------
    walls : of the water, outward
    leans : (nf,) True for floor and banks that lean, which the rock must cover
    least : share of their area

    Raises
    ------
    ConfigError
        where it covers less, and for a face that nothing lies on.
    """
    touched = np.zeros(len(walls.facets))
    for k, face in enumerate(rock):
        between = lying_on(walls, MortarSurface(face.block, blocks[face.block].points, face.facets))
        if not between.area.sum() > 0.0:
            raise ConfigError(
                f"{location}.rock[{k}]: no wall of the reservoir lies on the face (0 m2 of it within 1 mm); "
                "name the rock's surface below the water, and let the reservoir's floor and banks be that "
                "surface, or leave the face out"
            )
        touched += np.bincount(between.slave, between.area, len(touched))
    area = float(walls.areas[leans].sum())
    covered = float(touched[leans].sum())
    if covered < least * area:
        raise ConfigError(
            f"{location}.rock: {covered:.6g} of the {area:.6g} m2 of the reservoir's floor and leaning banks "
            f"lie on the rock, limit {least:g} of them: the rest would move as the record does; let the rock "
            "reach as far upstream as the reservoir and follow its section, shorten `length`, or leave "
            "`rock` out"
        )
    log.info(
        "%s.rock: %.4g of the %.6g m2 of floor and leaning banks lie on rock, and %.6g m2 of upright walls",
        location, covered / area if area else 1.0, area, touched[~leans].sum(),
    )  # fmt: skip
    return np.asarray(touched > 0.0)
