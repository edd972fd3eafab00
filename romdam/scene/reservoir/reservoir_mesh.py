"""The mesh of a reservoir, and which of its faces lies where: on the dam, at the level, on rock, at the end.

Faces against the dam are found as those of mortar joints are: facets that look at each other and lie on each
other, whose meshes need not match. The free surface is what lies at the level.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from romdam.config.sections.places import FaceRef
from romdam.config.sections.water import CLOSED, ReservoirMeshConfig
from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Material, Reservoir
from romdam.geometry.elements import ELEMENTS
from romdam.geometry.facets import area_vectors, boundary_facets, facet_areas, facet_normals, row_numbers
from romdam.geometry.meshes.files import MeshFiles
from romdam.geometry.meshes.kinds import refuse_wedges
from romdam.geometry.nearest import tree
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.reservoir.walls import TOUCH, UPRIGHT, lying_on, refuse_uncovered
from romdam.scene.reservoir.wet_mesh import wet_mesh
from romdam.scene.select import select_facets

log = logging.getLogger(__name__)

PER_WAVE = 10.0  # nodes in a wave's length at the cut-off, where linear elements are 1.6 % off
_TOUCHED, _MOSTLY = 1e-6, 0.5  # of a facet on the dam: above it is pressed on, above it is no bottom
_LEVEL = 1e-4  # of the mesh's height: nodes so near to the level are on it
_CEILING = np.cos(np.radians(45.0))  # vertical part of the normal of what would be a free surface
_PLANE = 1e-3  # of the end's size, and of its normal: how far it may be off an upright plane


def reservoir_mesh(
    config: ReservoirMeshConfig, water: Reservoir, blocks: dict[str, Block], files: MeshFiles, location: str
) -> Block:
    """Read the water's mesh and find its faces `dam`, `surface`, `bottom` and `end`.

    Parameters
    ----------
    water : without its mesh
    location : file and key, for messages

    Raises
    ------
    MeshError
        for a file that cannot be read, and elements that are no sound body.
    ConfigError
        for water whose surface is not level at the level, that does not touch the dam or only some of its wet
        faces, whose end is no upright plane, for faces that are two things at once, and for rock that leaves
        floor or banks out.
    """
    mesh = files.block("reservoir", config, Material(0.0, 0.0, water.density), location)
    refuse_wedges(mesh, "the water's own mesh is not made of", location)
    walls = boundary_facets(mesh.cells, mesh.element)
    z = mesh.points[:, 2]
    slack = _LEVEL * float(np.ptp(z))
    at_level = np.asarray((np.abs(z[walls] - water.level) <= slack).all(axis=1))
    if z.max() > water.level + slack or not at_level.any():
        raise ConfigError(
            f"{location}: the water's mesh reaches from {z.min():.6g} to {z.max():.6g} m, and its free "
            f"surface must lie at water.level, {water.level:g} m (within {slack:.2g} m; "
            f"{int(at_level.sum())} of its facets do); mesh the water up to the level, or correct `level` "
            "or `unit`"
        )
    _refuse_confined(mesh, np.unique(walls[at_level]), location)
    share = _share_on_dam(
        MortarSurface(mesh.name, mesh.points, walls), water, blocks, config.overlap, location
    )
    is_on = {
        "surface": at_level,
        "dam": share > _MOSTLY,
        "end": _end(mesh, walls, config.end, f"{location}.end"),
    }
    rest: Bools = ~np.logical_or.reduce(list(is_on.values()))
    normal_z = facet_normals(mesh.points, walls)[:, 2]
    if config.bottom is not None:
        named = [select_facets(mesh, f, f"{location}.bottom[{k}]") for k, f in enumerate(config.bottom)]
        is_on["bottom"] = _among(walls, np.concatenate([walls[:0], *named]))
    else:
        is_on["bottom"] = rest & (np.abs(normal_z) > UPRIGHT)
        upright = rest & ~is_on["bottom"]
        log.info(
            "%s.bottom: %d walls that lean more than 10 degrees, %.6g m2, reflect as `bottom_reflection` "
            "says, and %d upright ones all",
            location, is_on["bottom"].sum(), facet_areas(mesh.points, walls[is_on["bottom"]]).sum(),
            upright.sum(),
        )  # fmt: skip
    for name, other in combinations(is_on, 2):
        both = int((is_on[name] & is_on[other]).sum())
        if both:
            raise ConfigError(
                f"{location}: {both} facets are both on the {name} and on the {other}, limit 0; correct the "
                "groups of the file"
            )
    # a wall that looks up is a surface that is not level, or that does not reach the level
    ceiling = (rest & ~is_on["bottom"] if config.bottom else rest) & (normal_z > _CEILING)
    if ceiling.any():
        at = ", ".join(f"{x:.6g}" for x in mesh.points[walls[ceiling][0]].mean(axis=0))
        raise ConfigError(
            f"{location}: the free surface is not level: {int(ceiling.sum())} facets look up and are not at "
            f"water.level, one about ({at}), limit 0; mesh it flat, or name rock over the water in `bottom`"
        )
    if water.sound is not None:
        element = ELEMENTS[mesh.element]
        ends = mesh.points[mesh.cells[:, np.array(element.edges)]]
        longest = float(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max())
        resolved = water.sound.speed / (PER_WAVE * longest) * (2.0 if element.quadratic else 1.0)
        if resolved < water.sound.cutoff:
            log.warning(
                "%s: edges are up to %.3g m long, so that waves up to %.3g Hz have %g nodes in their length, "
                "and water.cutoff is %g Hz; mesh finer, or lower water.cutoff",
                location, longest, resolved, PER_WAVE, water.sound.cutoff,
            )  # fmt: skip
    is_on["dam"] = share > _TOUCHED
    is_on["rock"] = np.zeros(len(walls), dtype=bool)
    if water.rock:
        leans: Bools = rest & (np.abs(normal_z) > UPRIGHT)
        surface = MortarSurface(mesh.name, mesh.points, walls)
        is_on["rock"] = refuse_uncovered(
            surface, leans, water.rock, blocks, config.overlap, location.removesuffix(".mesh")
        )
    return replace(mesh, faces={name: walls[some] for name, some in is_on.items()})


def _refuse_confined(mesh: Block, surface: Ints, location: str) -> None:
    """Refuse water without a free surface, whose pressure nothing tells."""
    first = np.broadcast_to(mesh.cells[:, :1], mesh.cells.shape)
    links = coo_array(
        (np.ones(mesh.cells.size), (first.ravel(), mesh.cells.ravel())), shape=(len(mesh.points),) * 2
    )
    count, piece = connected_components(links, directed=False)
    lost = np.setdiff1d(np.arange(count), piece[surface])
    if len(lost):
        at = ", ".join(f"{x:.6g}" for x in mesh.points[piece == lost[0]].mean(axis=0))
        raise ConfigError(
            f"{location}: {len(lost)} of the {count} parts of the water's mesh that share no node have no "
            f"free surface, limit 0, the first about ({at}); join the parts' nodes, or leave these out by "
            "`group`"
        )


def _share_on_dam(
    walls: MortarSurface, water: Reservoir, blocks: dict[str, Block], overlap: float, location: str
) -> Floats:
    """Share of each facet that lies on the dam; each block's wet faces must be covered."""
    wet: dict[str, float] = {}  # of every block's faces below the level [m2]
    for piece in wet_mesh(blocks, water).pieces:
        vectors = piece.quadrature(blocks[piece.block].points)[2]
        wet[piece.block] = wet.get(piece.block, 0.0) + float(np.linalg.norm(vectors, axis=2).sum())
    covered, apart = dict.fromkeys(blocks, 0.0), 0.0
    touching = np.zeros(len(walls.facets))
    for face in water.faces:
        between = lying_on(walls, MortarSurface(face.block, blocks[face.block].points, face.facets))
        touching += np.bincount(between.slave, between.area, len(touching))
        covered[face.block] += float(between.area.sum())
        apart = max(apart, float(np.abs(between.distance).max(initial=0.0)))
    for name, area in wet.items():
        if covered[name] == 0.0:
            distance, nearest = tree(blocks[name].points).query(walls.points)
            closest = int(np.argmin(distance))
            ends = walls.points[closest], blocks[name].points[nearest[closest]]
            a, b = (", ".join(f"{x:.6g}" for x in end) for end in ends)
            raise ConfigError(
                f"{location}: the water's mesh does not touch the wet faces of block {name!r}: the smallest "
                f"distance of their nodes is {distance[closest]:.6g} m, from ({a}) to ({b}), limit "
                f"{TOUCH:g} m; correct `unit`, or mesh the water up to the dam"
            )
        if covered[name] < overlap * area:
            raise ConfigError(
                f"{location}: the water's mesh lies on {covered[name]:.6g} of the {area:.6g} m2 of the wet "
                f"faces of block {name!r} below the level, limit {overlap:g}; mesh the water up to the "
                "dam, leave dry faces out of water.faces, or lower `overlap` where rock covers the rest"
            )
    log.info(
        "%s: the water's mesh lies on %.4g of the %.6g m2 of the dam's wet faces, at most %.3g m apart",
        location, sum(covered.values()) / sum(wet.values()), sum(wet.values()), apart,
    )  # fmt: skip
    return np.asarray(touching / walls.areas)


def _end(mesh: Block, walls: Ints, face: FaceRef, location: str) -> Bools:
    if face == CLOSED:
        return np.zeros(len(walls), dtype=bool)
    facets = select_facets(mesh, face, location)
    vectors = area_vectors(mesh.points, facets).sum(axis=(0, 1))
    normal = vectors / np.linalg.norm(vectors)
    away = mesh.points[facets] - mesh.points[facets].mean(axis=(0, 1))
    off = float(np.abs(away @ normal).max() / np.linalg.norm(away, axis=2).max())
    if max(off, abs(float(normal[2]))) > _PLANE:
        direction = ", ".join(f"{x:.3g}" for x in normal)
        raise ConfigError(
            f"{location}: the end must be an upright plane, beyond which the channel goes on: its normal is "
            f"({direction}), and its nodes are up to {off:.2g} of its size off that plane, limit "
            f"{_PLANE:g}; cut the mesh off by an upright plane"
        )
    return _among(walls, facets)


def _among(walls: Ints, facets: Ints) -> Bools:
    """True for walls that are one of some facets."""
    number = row_numbers(np.sort(np.concatenate([walls, facets]), axis=1))
    return np.asarray(np.isin(number[: len(walls)], number[len(walls) :]))
