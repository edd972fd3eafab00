"""Gravity dams meshed by structured hexahedra: monoliths and rock on one grid (i along x, j along y, k up).

The columns j follow the faces of the dam, and are vertical at the walls of a gallery. Rows k end at every
elevation where the shape changes. A slice is a range of x with one monolith, or with the rock of a bank. A
cell below the ground of its slice is rock, a cell above it and between the faces belongs to the monolith, and
other cells are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from romdam.config.sections.geometry.gravity_dam import GravityDamConfig
from romdam.config.sections.geometry.refinement import Divisions
from romdam.core.scene import Block, Bools, Ints, Material, Tie
from romdam.geometry.arch_dam.generator import Dam
from romdam.geometry.arch_dam.rock import layer_shares, refuse_thin
from romdam.geometry.boxes import hexahedra, split_into_tets, with_middle_nodes
from romdam.geometry.divisions import GridElements, refuse_divisions
from romdam.geometry.elements import ELEMENTS, Floats
from romdam.geometry.facets import boundary_facets, row_numbers
from romdam.geometry.meshes.quality import refuse_bad_cells


@dataclass(frozen=True)
class _Lines:
    """Coordinates of the grid lines [m].

    Attributes
    ----------
    x : (ni + 1,)
    y : (nj + 1, nk + 1) of every column line at every row line
    z : (nk + 1,)
    slices : (ni,) number of the slice of every cell along x
    dam : numbers of the column lines at the upstream and the downstream face
    gallery : (nj, nk) True for cells inside the gallery
    """

    x: Floats
    y: Floats
    z: Floats
    slices: Ints
    dam: tuple[int, int]
    gallery: Bools

    def row(self, elevation: float) -> int:
        """Number of the row line nearest to an elevation."""
        return int(np.abs(self.z - elevation).argmin())


def gravity_dam(
    config: GravityDamConfig, materials: dict[str, Material], location: str, *, absorbs: bool
) -> Dam:
    """Mesh a gravity dam.

    Parameters
    ----------
    materials : by name
    location : file and key, for messages
    absorbs : whether a viscous boundary takes up waves, so that rock has mass unless told otherwise

    Raises
    ------
    ConfigError
        for layers of rock that grow too fast, and divisions that leave elements inside out or too slender.
    MeshError
        for elements that are inside out.
    """

    def mesh_of(divisions: Divisions) -> GridElements:
        other = config.model_copy(update={"divisions": divisions})
        lines = _lines(other, location)
        owner = _owner(other, lines)
        return _grid_elements(other, lines, owner, *_elements(other, lines, owner)[:2])

    lines = _lines(config, location)
    owner = _owner(config, lines)
    points, cells, tags = _elements(config, lines, owner)
    mesh = _grid_elements(config, lines, owner, points, cells)
    refuse_divisions(config.divisions, mesh, mesh_of, config.block_names, location)
    owner = np.repeat(owner[owner >= 0], len(cells) // int((owner >= 0).sum()))
    facets = [boundary_facets(cells[owner == n], config.element) for n in range(len(config.block_names))]
    # for each block, True for its facets that another block has too
    key = row_numbers(np.sort(np.vstack(facets), axis=1))
    _, number, count = np.unique(key, return_inverse=True, return_counts=True)
    shared = np.split(count[number] > 1, np.cumsum([len(of_block) for of_block in facets])[:-1])

    blocks, numbers = {}, {}
    concrete = rock_material = materials[config.material]
    if config.rock is not None:
        rock_material = materials[config.rock.material].with_mass(
            absorbs if config.rock.mass is None else config.rock.mass
        )
    for n, name in enumerate(config.block_names):
        material = concrete if name in config.monolith_names else rock_material
        numbers[name], local = np.unique(cells[owner == n], return_inverse=True)
        cell_nodes = local.reshape(-1, cells.shape[1]).astype(np.int64)
        on = _faces(config, lines, name, tags[facets[n]], shared[n])
        faces = {
            face: np.searchsorted(numbers[name], facets[n][which])
            for face, which in on.items()
            if which.any()
        }
        blocks[name] = Block(name, config.element, points[numbers[name]], cell_nodes, material, faces)
        refuse_bad_cells(blocks[name], location)
    rock = frozenset(blocks) - set(config.monolith_names)
    settled = rock if config.rock and not config.rock.weight else frozenset()
    ties = []
    for I, J in config.tied_pairs:
        _, at_I, at_J = np.intersect1d(numbers[I], numbers[J], assume_unique=True, return_indices=True)
        ties.append(Tie(f"{I} - {J}", (I, J), (at_I, at_J)))
    return Dam(blocks, tuple(ties), _held(config, blocks), settled)


def _lines(config: GravityDamConfig, location: str) -> _Lines:
    z = _rows(config, location)
    walls = np.array([config.walls(max(level, config.lowest)) for level in z])
    columns = config.columns
    shares = [np.linspace(0.0, 1.0, count + 1)[1:] for count in columns]
    y = [walls[:, :1]]
    y += [a[:, None] + s * (b - a)[:, None] for a, b, s in zip(walls.T, walls.T[1:], shares, strict=False)]
    before, after = np.zeros((len(z), 0)), np.zeros((len(z), 0))
    if config.rock is not None:
        d, (heel, toe) = config.divisions.refined, (walls[0, 0], walls[0, -1])
        up, down = layer_shares(d, "upstream")[:0:-1], layer_shares(d, "downstream")[1:]
        before = walls[:, :1] + up * (heel - config.rock.upstream - walls[:, :1])
        after = walls[:, -1:] + down * (toe + config.rock.downstream - walls[:, -1:])
    first = before.shape[1]
    x, slices = _along(config)
    whole = np.hstack([before, *y, after]).T
    gallery = np.zeros((len(whole) - 1, len(z) - 1), dtype=bool)
    if config.gallery is not None:
        middle, floor = (z[1:] + z[:-1]) / 2.0, config.gallery.floor
        high = (middle > floor) & (middle < floor + config.gallery.height)
        gallery[first + columns[0] : first + columns[0] + columns[1]] = high
    return _Lines(x, whole, z, slices, (first, first + sum(columns)), gallery)


def _rows(config: GravityDamConfig, location: str) -> Floats:
    """Elevations of the row lines."""
    d = config.divisions.refined
    rows = [np.array([config.lowest])]
    for count, (a, b) in zip(config.rows, pairwise(config.levels), strict=True):
        rows.append(np.linspace(a, b, count + 1)[1:])
    if config.rock is not None:
        for key in ("depth", "upstream", "downstream", "banks"):
            refuse_thin(d, key, f"{location}.divisions")
        rows.insert(0, config.lowest - config.rock.depth * layer_shares(d, "depth")[:0:-1])
    return np.concatenate(rows)


def _along(config: GravityDamConfig) -> tuple[Floats, Ints]:
    """x of the grid lines, and the slice of every cell between them."""
    d, ends = config.divisions.refined, np.concatenate([[0.0], np.cumsum(config.monoliths)])
    x, counts = [np.zeros(1)], []
    for a, b in pairwise(ends):
        x.append(np.linspace(a, b, d.along + 1)[1:])
        counts.append(d.along)
    beside = layer_shares(d, "banks")
    if config.rock is not None and config.rock.left:
        x.insert(0, -config.rock.left * beside[:0:-1])
        counts.insert(0, len(beside) - 1)
    if config.rock is not None and config.rock.right:
        x.append(ends[-1] + config.rock.right * beside[1:])
        counts.append(len(beside) - 1)
    return np.concatenate(x), np.repeat(np.arange(len(counts)), counts)


def _owner(config: GravityDamConfig, lines: _Lines) -> Ints:
    """Number of the block of every cell (ni, nj, nk), -1 for cells that are left out."""
    number = {name: n for n, name in enumerate(config.block_names)}
    middle = (lines.z[1:] + lines.z[:-1]) / 2.0
    owner = np.full((len(lines.slices), *lines.gallery.shape), -1)
    first, last = lines.dam
    for n, (name, ground) in enumerate(config.slices.items()):
        below, here = middle < ground, lines.slices == n
        if config.rock is not None:
            owner[np.ix_(here, np.ones(owner.shape[1], dtype=bool), below)] = number[f"rock_{name}"]
        if name.isdecimal():
            lift = [number.get(config.monolith(int(name), config.lift_of(z)), -1) for z in middle]
            dam = np.where(below | lines.gallery[first:last], -1, lift)
            inner = owner[here, first:last]
            owner[here, first:last] = np.where(below, inner, dam)
    return owner


def _elements(config: GravityDamConfig, lines: _Lines, owner: Ints) -> tuple[Floats, Ints, Floats]:
    """Points, cells of the configured element in the order of the grid, and (i, j, k) of the points."""
    shape = tuple(n + 1 for n in owner.shape)
    number = np.arange(np.prod(shape)).reshape(shape)
    tags = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).astype(float)
    i, j, k = np.moveaxis(tags.astype(int), -1, 0)
    points = np.stack([lines.x[i], lines.y[j, k], lines.z[k]], axis=-1)
    cells = hexahedra(number)[owner.ravel() >= 0]
    if config.element.startswith("tet"):
        cells = split_into_tets(cells)
    both = np.concatenate([points, tags], axis=-1).reshape(-1, 6)
    both, cells = with_middle_nodes(both, cells, ELEMENTS[config.element])
    return np.ascontiguousarray(both[:, :3]), cells, both[:, 3:]


def _grid_elements(
    config: GravityDamConfig, lines: _Lines, owner: Ints, points: Floats, cells: Ints
) -> GridElements:
    """The elements with the division that counts them along each axis of the grid."""
    i, j, k = np.nonzero(owner >= 0)
    monolith = np.array([name.isdecimal() for name in config.slices])
    first, last = lines.dam
    axes = np.stack(
        [
            np.where(monolith[lines.slices[i]], "along", "banks"),
            np.where(j < first, "upstream", np.where(j >= last, "downstream", "through")),
            np.where(lines.z[k + 1] <= config.lowest, "depth", "up"),
        ],
        axis=1,
    )
    number = np.arange(np.prod([n + 1 for n in owner.shape])).reshape([n + 1 for n in owner.shape])
    corners = hexahedra(number)[owner.ravel() >= 0]
    return GridElements(points, cells, config.element, corners, owner[owner >= 0], axes)


def _faces(
    config: GravityDamConfig, lines: _Lines, name: str, where: Floats, shared: Bools
) -> dict[str, Bools]:
    """Name -> facets of every face; `where` (nf, nodes, 3) has (i, j, k) of their nodes."""
    i, j, k = np.moveaxis(where, -1, 0)

    def at(tag: Floats, line: int) -> Bools:
        return np.asarray((tag == line).all(axis=1))

    if name not in config.monolith_names:
        faces = {
            "base": at(k, 0),
            "side_upstream": at(j, 0),
            "side_downstream": at(j, len(lines.y) - 1),
            "side_left": at(i, 0),
            "side_right": at(i, len(lines.x) - 1),
        }
        return faces | {"surface": ~shared & ~np.any(list(faces.values()), axis=0)}
    low, high = k.min(), k.max()
    base = lines.row(config.bases[int(name.split("_")[1]) - 1])
    faces = {
        "upstream": at(j, lines.dam[0]),
        "downstream": at(j, lines.dam[1]),
        "crest" if high == len(lines.z) - 1 else "top": at(k, high),
        "base" if low == base else "bottom": at(k, low),
        "left": at(i, i.min()),
        "right": at(i, i.max()),
    }
    return faces | {"gallery": ~np.any(list(faces.values()), axis=0)}


def _held(config: GravityDamConfig, blocks: dict[str, Block]) -> dict[str, Bools]:
    """Components held at zero: the base of the rock and the normals of its sides; without rock the bases."""
    held = {name: np.zeros(block.points.shape, dtype=bool) for name, block in blocks.items()}
    faces = {"base": [0, 1, 2]}
    if config.rock is not None:
        faces |= {"side_left": [0], "side_right": [0], "side_upstream": [1], "side_downstream": [1]}
    for name, block in blocks.items():
        for face, components in faces.items():
            if face in block.faces and (name not in config.monolith_names or config.rock is None):
                nodes = np.unique(block.faces[face])
                held[name][nodes[:, None], components] = True
    return held
