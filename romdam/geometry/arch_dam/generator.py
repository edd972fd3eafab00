"""An arch dam meshed by structured hexahedra: cantilevers, perimeter and rock on one grid.

The dam is a grid (a along the arc, b through the thickness, c up). Its contact with the ground, down the
left end face, along the feet and up the right end face, is a path p; perimeter and rock are a grid (p, b, l)
with l the layers outward from the path along rays from the middle of the crest, and b continued up- and
downstream.
The perimeter fills the first layers below the dam, the rock the rest. All blocks take their nodes from one
numbering, so that every contact conforms; tetrahedra are mirrored on the left bank, which lets their
diagonals agree around the corners of the path.

Nodes in the middle of edges, facets and cells stand where the surfaces are: halfway between the corners'
angles, shares of the thickness and elevations, not halfway between their positions. So quadratic elements
follow the arcs and the crown's curve, and the rock its contact; at the rock's outer faces edges are straight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from romdam.config.sections.geometry.arch_dam import JOINT, PERIMETER, ROCK, ArchDamConfig
from romdam.config.sections.geometry.refinement import Divisions
from romdam.config.sections.ground import ViscousConfig
from romdam.core.scene import Block, Bools, Ints, Material, Tie
from romdam.geometry.arch_dam.rock import Ground, ground_grid
from romdam.geometry.arch_dam.shape import ArchShape
from romdam.geometry.boxes import hexahedra, split_into_tets, with_middle_nodes
from romdam.geometry.divisions import GridElements, refuse_divisions
from romdam.geometry.elements import ELEMENTS, Floats
from romdam.geometry.facets import boundary_facets
from romdam.geometry.meshes.quality import refuse_bad_cells

_TO_MIRROR = [1, 0, 3, 2, 5, 4, 7, 6]
_ON = 1e-6  # of the rock's size: distance from a plane that counts as on it


@dataclass(frozen=True)
class Dam:
    """Blocks, ties and supports that a dam of a few keys adds to a scene.

    Attributes
    ----------
    blocks : of concrete, then of rock
    ties : contacts (and joints, where they are tied)
    held : block -> (n, 3) True where the ground holds a component
    excluded_from_gravity : blocks whose weight has acted before the dam is built
    viscous : outer faces of the rock that take waves up
    """

    blocks: dict[str, Block]
    ties: tuple[Tie, ...]
    held: dict[str, Bools]
    excluded_from_gravity: frozenset[str]
    viscous: tuple[ViscousConfig, ...] = ()


@dataclass(frozen=True)
class _Grid:
    """All hexahedra: nodes, block of each, whether its tetrahedra are mirrored; positions and tags of nodes.

    A tag is a node's indices in a grid: (a, b, c) in the dam, (p, b, l) in the ground. `halves` has the
    positions at all indices and halfway between them, by whether the grid is the dam's.
    """

    points: Floats
    cells: Ints
    owner: Ints
    mirrored: Bools
    tags: dict[bool, Floats]
    halves: dict[bool, Floats]


def arch_dam(config: ArchDamConfig, materials: dict[str, Material], location: str, *, absorbs: bool) -> Dam:
    """Mesh an arch dam.

    Parameters
    ----------
    materials : by name
    location : file and key, for messages
    absorbs : whether a viscous boundary takes up waves, so that rock has mass unless told otherwise

    Raises
    ------
    ConfigError
        for a valley that cuts the arcs, a thickness of 0, joints that would cross, divisions that leave
        elements inside out or too slender, rock smaller than the dam, and a zone that covers nothing.
    MeshError
        for elements turned inside out.
    """
    stated = config.divisions

    def mesh_of(divisions: Divisions) -> GridElements:
        other = config.model_copy(update={"divisions": divisions.refined})
        halves = _dam_points(ArchShape(other, location))
        ground = ground_grid(other, halves, location)
        grid = _grid(other, halves, ground)
        return _grid_elements(other, grid, ground, *_elements(grid, other.element)[:2])

    config = config.model_copy(update={"divisions": stated.refined})
    halves = _dam_points(ArchShape(config, location))
    ground = ground_grid(config, halves, location)
    grid = _grid(config, halves, ground)
    points, cells, tags = _elements(grid, config.element)
    mesh = _grid_elements(config, grid, ground, points, cells)
    refuse_divisions(stated, mesh, mesh_of, config.block_names, location)
    owner = np.repeat(grid.owner, len(cells) // len(grid.owner))
    zones = config.rock.zones if config.rock else {}
    material_of = dict.fromkeys(config.cantilever_names, materials[config.material])
    if config.perimeter:
        material_of[PERIMETER] = materials[config.perimeter.material]
    for zone, rock in zones.items():
        material_of[f"{ROCK}_{zone}"] = materials[rock.material].with_mass(
            absorbs if rock.mass is None else rock.mass
        )
    blocks, numbers = {}, {}
    for k, name in enumerate(config.block_names):
        numbers[name], local = np.unique(cells[owner == k], return_inverse=True)
        cell_nodes = local.reshape(-1, cells.shape[1]).astype(np.int64)
        block = Block(name, config.element, points[numbers[name]], cell_nodes, material_of[name], {})
        where = tags[k < config.cantilevers][numbers[name]]
        blocks[name] = replace(block, faces=_faces(config, block, where, ground))
        refuse_bad_cells(blocks[name], location)
    excluded = frozenset(f"{ROCK}_{zone}" for zone, rock in zones.items() if not rock.weight)
    held, ties = _held(config, blocks), _ties(config, blocks, numbers)
    return Dam(blocks, ties, held, excluded, _viscous(config, blocks))


def _dam_points(shape: ArchShape) -> Floats:
    """(2 na + 1, 2 nb + 1, 2 nc + 1, 3) corners of the dam's hexahedra and what lies halfway between them.

    Feet are straight between joints, so that refining the mesh does not change the dam.
    """
    config, d = shape.config, shape.config.divisions
    joints = np.linspace(-shape.end, shape.end, config.cantilevers + 1)
    theta = np.linspace(-shape.end, shape.end, config.cantilevers * 2 * d.along + 1)
    foot = np.interp(theta, joints, shape.foot(joints))
    b = np.linspace(0.0, 1.0, 2 * d.through + 1)[None, :, None]
    c = np.linspace(0.0, 1.0, 2 * d.up + 1)[None, None, :]
    z = foot[:, None, None] + (config.crest - foot)[:, None, None] * c
    return shape.point(theta[:, None, None], b, z)


def _grid(config: ArchDamConfig, halves: Floats, ground: Ground | None) -> _Grid:
    """Number the nodes and collect the hexahedra."""
    dam = halves[::2, ::2, ::2]
    na, nb, nc = (n - 1 for n in dam.shape[:3])
    number = np.arange(dam[..., 0].size).reshape(dam.shape[:3])
    a = np.repeat(np.arange(na), nb * nc)
    inner = _Grid(
        points=dam.reshape(-1, 3),
        cells=hexahedra(number),
        owner=a // config.divisions.along,
        mirrored=2 * a < na,
        tags={True: _tags(number, number.size)},
        halves={True: halves},
    )
    if ground is None:
        return inner
    first = len(inner.points)
    ground_number = ground.node_numbers(number, first)
    fresh = ground_number >= first
    count = first + int(fresh.sum())
    # layers run outward, so that cells are taken with them reversed
    shape = tuple(n - 1 for n in ground_number.shape)
    cells = hexahedra(ground_number[:, :, ::-1]).reshape(*shape, 8)[:, :, ::-1]
    block_of = ground.blocks_of_cells(list(config.block_names))
    filled = block_of >= 0
    left = np.broadcast_to(2 * np.arange(len(block_of))[:, None, None] < len(block_of), block_of.shape)
    rest = np.full((count - first, 3), np.nan)
    return _Grid(
        points=np.vstack([inner.points, ground.points[fresh]]),
        cells=np.vstack([inner.cells, cells[filled]]),
        owner=np.concatenate([inner.owner, block_of[filled]]),
        mirrored=np.concatenate([inner.mirrored, left[filled]]),
        tags={True: np.vstack([inner.tags[True], rest]), False: _tags(ground_number, count)},
        halves={True: halves, False: ground.halves},
    )


def _tags(number: Ints, count: int) -> Floats:
    """Indices in a grid of node numbers of every node 0 to count, nan where it is not in it."""
    tags = np.full((count, 3), np.nan)
    there = number >= 0
    tags[number[there]] = np.argwhere(there)
    return tags


def _elements(grid: _Grid, element: str) -> tuple[Floats, Ints, dict[bool, Floats]]:
    """Points, cells of the element wanted (in the order of the hexahedra), and the tags of all points."""
    cells = grid.cells
    if element.startswith("tet"):
        turned = np.where(grid.mirrored[:, None], cells[:, _TO_MIRROR], cells)
        cells = split_into_tets(turned)
        inside_out = np.repeat(grid.mirrored, len(cells) // len(turned))
        cells = np.where(inside_out[:, None], cells[:, [0, 2, 1, 3]], cells)
    whole = np.hstack([grid.points, *grid.tags.values()])
    whole, cells = with_middle_nodes(whole, cells, ELEMENTS[element])
    points, *of_grids = np.ascontiguousarray(whole.reshape(len(whole), -1, 3).transpose(1, 0, 2))
    tags = dict(zip(grid.tags, of_grids, strict=True))
    middle = np.arange(len(points)) >= len(grid.points)
    for is_dam, tag in reversed(tags.items()):  # on the contact, which both have, the dam's
        here = middle & np.isfinite(tag).all(axis=1)
        points[here] = grid.halves[is_dam][tuple(np.rint(2.0 * tag[here]).astype(int).T)]
    return points, cells, tags


def _grid_elements(
    config: ArchDamConfig, grid: _Grid, ground: Ground | None, points: Floats, cells: Ints
) -> GridElements:
    """The elements with the division that counts them along each axis of the grids."""
    axes = np.tile(np.array(["along", "through", "up"], dtype="<U10"), (len(grid.cells), 1))
    if ground is not None:
        p, b, l = np.nonzero(ground.blocks_of_cells(list(config.block_names)) >= 0)
        first, last = ground.under
        on_foot = (ground.contact[p, 1] == 0) & (ground.contact[p + 1, 1] == 0)
        axes[len(axes) - len(p) :] = np.stack(
            [
                np.where(on_foot, "along", "up"),
                np.where(b < first, "upstream", np.where(b >= last, "downstream", "through")),
                np.where(l < ground.layers, "perimeter", "rock"),
            ],
            axis=1,
        )
    return GridElements(points, cells, config.element, grid.cells, grid.owner, axes)


def _faces(config: ArchDamConfig, block: Block, tags: Floats, ground: Ground | None) -> dict[str, Ints]:
    """Named facets of a block, from the tags (n, 3) of its nodes."""
    facets = boundary_facets(block.cells, block.element)

    def on(coordinate: Floats, value: float, tolerance: float = 0.0) -> Bools:
        return np.asarray((np.abs(coordinate - value) <= tolerance).all(axis=1))

    if block.name in config.cantilever_names:
        d, k = config.divisions, config.cantilever_names.index(block.name)
        a, b, c = np.moveaxis(tags[facets], -1, 0)
        sides = {k: k * d.along, k + 1: (k + 1) * d.along}
        ends = [i for i in sides if i in (0, config.cantilevers)]
        contact = on(c, 0)
        for i in ends:
            contact |= on(a, sides[i])
        faces = {
            "upstream": on(b, 0),
            "downstream": on(b, d.through),
            "crest": on(c, d.up),
            "contact": contact,
        }
        faces |= {f"{JOINT}{i}": on(a, side) for i, side in sides.items() if i not in ends}
        return {name: facets[which] for name, which in faces.items() if which.any()}

    assert ground is not None
    p, b, l = np.moveaxis(tags[facets], -1, 0)
    first, last = ground.under
    path_ends = on(p, 0) | on(p, ground.last_p)
    if block.name == PERIMETER:
        faces = {
            "dam": on(l, 0),
            "contact": on(l, ground.layers),
            "upstream": on(b, first),
            "downstream": on(b, last),
            "crest": path_ends,
        }
    else:
        rock = config.rock
        assert rock is not None
        x, y, z = np.moveaxis(block.points[facets], -1, 0)
        tolerance = _ON * rock.half_width
        contact = ((b >= first) & (b <= last) & (l <= ground.layers)).all(axis=1)
        faces = {
            "base": on(z, config.base - rock.depth, tolerance),
            "side_left": on(x, -rock.half_width, tolerance),
            "side_right": on(x, rock.half_width, tolerance),
            "side_upstream": on(y, -rock.upstream, tolerance),
            "side_downstream": on(y, rock.downstream, tolerance),
            "contact": contact,
            "surface": (path_ends | on(l, 0)) & ~contact,
        }
    return {name: facets[which] for name, which in faces.items() if which.any()}


def _viscous(config: ArchDamConfig, blocks: dict[str, Block]) -> tuple[ViscousConfig, ...]:
    """Outer faces of the rock that take waves up, with their distance from the dam."""
    rock = config.rock
    if rock is None or rock.boundary == "fixed":
        return ()
    distance = {"base": rock.depth, "side_left": rock.half_width, "side_right": rock.half_width}
    distance |= {"side_upstream": rock.upstream, "side_downstream": rock.downstream}
    return tuple(
        ViscousConfig(block=name, faces=(face,), distance=away)
        for name, block in blocks.items()
        if name.startswith(f"{ROCK}_")
        for face, away in distance.items()
        if face in block.faces
    )


def _ties(config: ArchDamConfig, blocks: dict[str, Block], numbers: dict[str, Ints]) -> tuple[Tie, ...]:
    """Merged interfaces: cantilevers and ground, the ground's blocks, tied joints."""
    cantilevers = config.cantilever_names
    ground = [name for name in blocks if name not in cantilevers]
    pairs = [(c, g) for c in cantilevers for g in ground]
    pairs += [(g, h) for i, g in enumerate(ground) for h in ground[i + 1 :]]
    if config.joints == "tied":
        pairs += list(pairwise(cantilevers))
    ties = []
    for I, J in pairs:
        _, at_I, at_J = np.intersect1d(numbers[I], numbers[J], assume_unique=True, return_indices=True)
        if len(at_I):
            ties.append(Tie(f"{I} - {J}", (I, J), (at_I, at_J)))
    return tuple(ties)


def _held(config: ArchDamConfig, blocks: dict[str, Block]) -> dict[str, Bools]:
    """Components that the ground holds: the rock's base, its sides normal to themselves, or the contact."""
    held = {name: np.zeros(block.points.shape, dtype=bool) for name, block in blocks.items()}
    if config.rock and config.rock.boundary == "viscous":
        return held
    if config.rock:
        faces = {"base": [0, 1, 2], "side_left": [0], "side_right": [0]}
        faces |= {"side_upstream": [1], "side_downstream": [1]}
    else:
        faces = {"contact": [0, 1, 2]}
    for name, block in blocks.items():
        if config.perimeter and not config.rock and name != PERIMETER:
            continue
        for face, components in faces.items():
            if face in block.faces:
                nodes = np.unique(block.faces[face])
                held[name][nodes[:, None], components] = True
    return held
