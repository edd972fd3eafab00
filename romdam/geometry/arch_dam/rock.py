"""The ground of an arch dam: perimeter and rock as one grid (p, b, l) around the contact.

The dam is a grid (a along the arc, b through the thickness, c up), see `romdam.geometry.arch_dam.generator`.
Its contact with the ground is a path p: down the left end face, along the feet and up the right end face.
From the middle of the crest a ray in x and z goes through each point of the contact, and on into the ground.
The layers l lie along the rays outward: l = 0 is the contact, the first layers are the perimeter below the
dam, and those of the rock grow from there to the side and bottom faces of a box.

The rows b run downstream. Those below the dam are its own; others continue every line along y to the up- and
downstream faces of the box. There l = 0 is the surface of the ground, and all layers are rock.

The contact is curved between the corners of its facets. The grid of half steps follows it, and what it
deviates from straight edges fades towards the faces of the box, which are planes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from romdam.config.sections.geometry.arch_dam import PERIMETER, ROCK, ArchDamConfig, RockConfig
from romdam.config.sections.geometry.refinement import Divisions
from romdam.core.errors import ConfigError
from romdam.core.scene import Bools, Ints
from romdam.geometry.elements import Floats

_THIN = 1e-4  # least share that the first one may have of all layers that grow
_FLAT = 0.3  # least cosine between a ray and the contact's normal for which the thickness is corrected


@dataclass(frozen=True)
class Ground:
    """The grid (p, b, l) of the ground, of np x nb x nl cells.

    Attributes
    ----------
    points : (np + 1, nb + 1, nl + 1, 3) [m]
    halves : (2 np + 1, 2 nb + 1, 2 nl + 1, 3) the same and what lies halfway between them [m]
    under : first and last b below the dam
    layers : how many of the nl are the perimeter's; 0 without
    zone : (np, nb, nl) number of the zone of each cell, -1 where there is no rock
    perimeter : (np, nb, nl) whether a cell is the perimeter's
    zones : names of the zones
    contact : (np + 1, 2) the dam's (a, c) of every p
    """

    points: Floats
    halves: Floats
    under: tuple[int, int]
    layers: int
    zone: Ints
    perimeter: Bools
    zones: tuple[str, ...]
    contact: Ints

    @property
    def last_p(self) -> int:
        """The end of the path, at the crest on the right bank."""
        return len(self.contact) - 1

    def node_numbers(self, dam: Ints, first: int) -> Ints:
        """Numbers of the grid's points (np + 1, nb + 1, nl + 1), -1 where no cell has them.

        Parameters
        ----------
        dam : (na + 1, nb of the dam + 1, nc + 1) numbers of the dam's nodes, which those on the contact share
        first : number of the first new node
        """
        filled = self.perimeter | (self.zone >= 0)
        used = np.zeros(tuple(n + 1 for n in filled.shape), dtype=bool)
        for shift in np.ndindex(2, 2, 2):
            corner = tuple(slice(s, s + n) for s, n in zip(shift, filled.shape, strict=True))
            used[corner] |= filled
        number = np.full(used.shape, -1)
        shared = np.zeros_like(used)
        shared[:, self.under[0] : self.under[1] + 1, 0] = True
        fresh = used & ~shared
        number[fresh] = first + np.arange(int(fresh.sum()))
        a, c = self.contact.T
        number[:, self.under[0] : self.under[1] + 1, 0] = dam[a, :, c]
        return number

    def blocks_of_cells(self, names: list[str]) -> Ints:
        """(np, nb, nl) place of each cell's block in a list of names, -1 where there is no block."""
        block = np.full(self.zone.shape, -1)
        if self.perimeter.any():
            block[self.perimeter] = names.index(PERIMETER)
        for k, zone in enumerate(self.zones):
            block[self.zone == k] = names.index(f"{ROCK}_{zone}")
        return block


def ground_grid(config: ArchDamConfig, dam_halves: Floats, location: str) -> Ground | None:
    """Lay the ground around a dam; None without any.

    Parameters
    ----------
    dam_halves : (2 na + 1, 2 nb + 1, 2 nc + 1, 3) the dam's grid, every other point a corner [m]
    location : file and key, for messages

    Raises
    ------
    ConfigError
        for rock smaller than the dam, layers without thickness, and zones that cover nothing, overlap or
        leave cells out.
    """
    if config.perimeter is None and config.rock is None:
        return None
    dam = dam_halves[::2, ::2, ::2]
    na, nb, nc = (n - 1 for n in dam.shape[:3])
    contact = np.array(
        [(0, c) for c in range(nc, 0, -1)]
        + [(a, 0) for a in range(na + 1)]
        + [(na, c) for c in range(1, nc + 1)]
    )
    inner = dam[contact[:, 0], :, contact[:, 1]]  # (np + 1, nb + 1, 3)

    # unit vectors in x and z from the middle of the crest through the contact's points
    away = inner - np.array([0.0, 0.0, config.crest])
    away[..., 1] = 0.0
    rays = away / np.linalg.norm(away, axis=-1, keepdims=True)
    layers = [inner]
    if config.perimeter:
        thickness = config.perimeter.thickness * _stretch(inner, rays)[:, None, None]
        share = np.linspace(0.0, 1.0, config.divisions.perimeter + 1)[1:]
        layers += [inner + s * thickness * rays for s in share]
    count = len(layers) - 1
    rock, d, bulge = config.rock, config.divisions, _bulge(dam_halves, inner, contact)
    if rock is None:
        points = np.stack(layers, axis=2)
        shape = tuple(n - 1 for n in points.shape[:3])
        return Ground(
            points=points,
            halves=_halved(points, 3) + bulge[:, :, None],
            under=(0, nb),
            layers=count,
            zone=np.full(shape, -1),
            perimeter=np.ones(shape, dtype=bool),
            zones=(),
            contact=contact,
        )

    # layers of rock, from the last of the perimeter (or the contact) to the box
    last = layers[-1]
    extents = {
        "half_width": (rock.half_width, float(np.abs(last[..., 0]).max())),
        "upstream": (rock.upstream, float(-last[..., 1].min())),
        "downstream": (rock.downstream, float(last[..., 1].max())),
        "depth": (rock.depth, float(config.base - last[..., 2].min())),
    }
    for key, (extent, needed) in extents.items():
        if extent <= needed:
            raise ConfigError(
                f"{location}.rock.{key}: the rock is smaller than the dam: {extent:g} m, but dam and "
                f"perimeter reach {needed:.4g} m; make it larger, commonly by one or two heights of the dam"
            )
    outer = _box(config, rock, last, rays)
    for key in ("rock", "upstream", "downstream"):
        refuse_thin(d, key, f"{location}.divisions.{key}")
    below, up, down = (layer_shares(d, key) for key in ("rock", "upstream", "downstream"))
    layers += [last + s * (outer - last) for s in below[1:]]
    points, first, after = np.stack(layers, axis=2), len(up) - 1, len(down) - 1
    under = (first, first + points.shape[1] - 1)

    # rows up- and downstream of the dam, to the ends of the box; they ascend in y
    rows = []
    for start, end, share in (
        (points[:, :1], -rock.upstream, up[:0:-1]),
        (points[:, -1:], rock.downstream, down[1:]),
    ):
        row = np.repeat(start, len(share), axis=1)
        row[..., 1] += share[None, :, None] * (end - start[..., 1])
        rows.append(row)
    points = np.concatenate([rows[0], points, rows[1]], axis=1)

    # the bulge of the contact goes on in every layer and row, and fades towards the box
    outward = np.concatenate([np.ones(count), 1.0 - below])
    across = np.concatenate([1.0 - up[:0:-1], np.ones(nb + 1), 1.0 - down[1:]])
    bulge = np.pad(bulge, ((0, 0), (2 * first, 2 * after), (0, 0)), mode="edge")
    fading = _halved(across[:, None] * outward, 2)

    perimeter = np.zeros(tuple(n - 1 for n in points.shape[:3]), dtype=bool)
    perimeter[:, under[0] : under[1], :count] = True
    return Ground(
        points=points,
        halves=_halved(points, 3) + bulge[:, :, None] * fading[None, :, :, None],
        under=under,
        layers=count,
        zone=_zones(rock, points, ~perimeter, location),
        perimeter=perimeter,
        zones=tuple(rock.zones),
        contact=contact,
    )


def _halved(grid: Floats, axes: int) -> Floats:
    """A grid with the means between neighbours inserted along its first axes."""
    for axis in range(axes):
        lines = np.moveaxis(grid, axis, 0)
        finer = np.empty((2 * len(lines) - 1, *lines.shape[1:]))
        finer[::2], finer[1::2] = lines, 0.5 * (lines[1:] + lines[:-1])
        grid = np.moveaxis(finer, 0, axis)
    return grid


def _bulge(dam_halves: Floats, inner: Floats, contact: Ints) -> Floats:
    """What the contact lies off the means of its corners `inner` (np + 1, nb + 1, 3).

    Returns
    -------
    (2 np + 1, 2 nb + 1, 3) [m], zero at the corners
    """
    path = np.rint(2.0 * _halved(contact.astype(float), 1)).astype(int)
    return dam_halves[path[:, 0], :, path[:, 1]] - _halved(inner, 2)


def _stretch(inner: Floats, rays: Floats) -> Floats:
    """Length along each ray per thickness across the contact, (np + 1,): 1 / cos of ray and normal.

    A point lies between two edges of the path, whose normals differ; the greater length is taken.
    """
    middle = inner.mean(axis=1)
    along = np.diff(middle, axis=0)
    # outward: to the left going down, down going right
    normal = np.stack([along[:, 2], -along[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    ray = rays.mean(axis=1)[:, [0, 2]]
    # of each edge with the rays at its start and at its end
    cosine = np.abs(np.stack([(normal * ray[:-1]).sum(axis=1), (normal * ray[1:]).sum(axis=1)]))
    least = np.minimum(np.append(cosine[0], np.inf), np.insert(cosine[1], 0, np.inf))
    return 1.0 / np.maximum(least, _FLAT)


def _box(config: ArchDamConfig, rock: RockConfig, inner: Floats, rays: Floats) -> Floats:
    """Points (np + 1, nb + 1, 3) where the rays through `inner` leave the box through its sides or bottom.

    The two rays nearest to the lower edges of the box are turned to meet them, so that cells fill it. Rays of
    one point of the contact differ along y: one that leaves on the other side of an edge than its point does
    is turned to lie evenly between its neighbours.
    """
    half, drop = rock.half_width, config.crest - config.base + rock.depth
    with np.errstate(divide="ignore"):
        to_side, to_bottom = half / np.abs(rays[..., 0]), drop / np.maximum(-rays[..., 2], 1e-300)
    reach = np.minimum(to_side, to_bottom)
    outer = inner.copy()
    outer[..., 0], outer[..., 2] = reach * rays[..., 0], config.crest + reach * rays[..., 2]
    middle = rays.mean(axis=1)
    edges = [np.array([side * half, 0.0, -drop]) / np.hypot(half, drop) for side in (-1.0, 1.0)]
    left, right = (int(np.argmax(middle @ edge)) for edge in edges)
    outer[: left + 1, :, 0], outer[right:, :, 0] = -half, half
    outer[left : right + 1, :, 2] = config.crest - drop
    path = np.arange(len(outer))
    at_bottom = (path >= left) & (path <= right)
    strays = (to_bottom < to_side) != at_bottom[:, None]
    strays[[left, right]] = False
    for b in np.flatnonzero(strays.any(axis=0)):
        astray, good = path[strays[:, b]], path[~strays[:, b]]
        for axis in (0, 2):
            outer[astray, b, axis] = np.interp(astray, good, outer[good, b, axis])
    return outer


def graded(count: int, growth: float) -> Floats:
    """(count + 1,) ascending shares from 0 to 1, whose steps grow by a ratio."""
    sizes = growth ** np.arange(count)
    return np.concatenate([[0.0], np.cumsum(sizes) / sizes.sum()])


def layer_shares(divisions: Divisions, name: str) -> Floats:
    """Ascending shares from 0 to 1 of layers or rows of rock, which grow; those next to the dam are halved.

    A halved layer is as two of twice as many layers that grow by the root.
    """
    shares = graded(getattr(divisions, name), divisions.growth)
    halved = min(divisions.halved, len(shares) - 1)
    middle = shares[:halved] + np.diff(shares[: halved + 1]) / (1.0 + np.sqrt(divisions.growth))
    return np.sort(np.concatenate([shares, middle]))


def refuse_thin(divisions: Divisions, name: str, location: str) -> None:
    """Refuse layers that grow so fast that the first ones have no thickness: their nodes would coincide.

    Raises
    ------
    ConfigError
    """
    first = float(layer_shares(divisions, name)[1])
    if first < _THIN:
        raise ConfigError(
            f"{location}: {getattr(divisions, name)} layers that grow by {divisions.growth:g} make the first "
            f"one {first:.2g} of the whole, limit {_THIN:g}; take fewer layers, or a growth nearer to 1"
            f"{', or leave `halved` out' if divisions.halved else ''}"
        )


def _zones(rock: RockConfig, points: Floats, rock_cells: Bools, location: str) -> Ints:
    """Number of the zone of every cell, -1 where there is no rock.

    Of the zones that have a cell's centre, that with limits along most axes takes it, in whatever order they
    stand.

    Raises
    ------
    ConfigError
        for zones that cover nothing, two with as many limits that cover one cell, and cells in no zone.
    """
    shape = rock_cells.shape
    corners = [
        points[i : i + shape[0], j : j + shape[1], k : k + shape[2]] for i, j, k in np.ndindex(2, 2, 2)
    ]
    centre = np.mean(corners, axis=0)
    names, zone = list(rock.zones), np.full(shape, -1)
    limits = [sum(limit is not None for limit in (z.x, z.y, z.z)) for z in rock.zones.values()]
    for k in sorted(range(len(names)), key=lambda k: -limits[k]):
        inside, limits_of = rock_cells.copy(), rock.zones[names[k]]
        for axis, limit in enumerate((limits_of.x, limits_of.y, limits_of.z)):
            if limit is not None:
                inside &= (centre[..., axis] >= limit[0]) & (centre[..., axis] < limit[1])
        both = inside & np.isin(zone, [j for j in range(len(names)) if j != k and limits[j] == limits[k]])
        if both.any():
            x, y, z = centre[both][0]
            other = names[int(zone[both][0])]
            raise ConfigError(
                f"{location}.rock.zones: {int(both.sum())} cells, the first around ({x:.4g}, {y:.4g}, "
                f"{z:.4g}), are in {other!r} and in {names[k]!r}, which have limits along as many axes "
                f"({limits[k]}), limit one zone; let their ranges meet, or give the smaller one a range "
                "along a further axis"
            )
        covered = inside & (zone < 0)
        if not covered.any():
            raise ConfigError(
                f"{location}.rock.zones.{names[k]}: covers nothing: none of the {int(rock_cells.sum())} "
                "cells of rock has its centre in it (or zones with limits along more axes took them); "
                "widen it, or remove it"
            )
        zone[covered] = k
    left_out = (zone < 0) & rock_cells
    if left_out.any():
        x, y, z = centre[left_out][0]
        raise ConfigError(
            f"{location}.rock.zones: {int(left_out.sum())} of {int(rock_cells.sum())} cells of rock are "
            f"in no zone, the first around ({x:.4g}, {y:.4g}, {z:.4g}); let one zone have no limits: it "
            "takes the rest"
        )
    return zone
