"""Facets of two blocks that coincide, and what is wrong when they do not."""

from __future__ import annotations

import numpy as np

from romdam.core.errors import ConfigError, MeshError
from romdam.core.scene import Block, Bools, Ints
from romdam.geometry.elements import Floats, facet_frame
from romdam.geometry.facets import boundary_facets, facet_keys, facet_normals
from romdam.geometry.nearest import nearest, tree

_OPPOSED = -0.5  # cosine: faces that touch look at each other
_SHOWN = 3


def coincident_facets(block_I: Block, block_J: Block, tolerance: float, location: str) -> tuple[Ints, Ints]:
    """Boundary facets of I whose nodes all coincide with those of a facet of J, and I's partners in J.

    Parameters
    ----------
    tolerance : largest distance of two nodes of a pair [m]
    location : file and key of the joint, for messages

    Returns
    -------
    facets : (nf, nodes per facet) of block I, outward
    partner : (nodes of I,) node number in J, -1 where there is none

    Raises
    ------
    ConfigError
        when the blocks do not touch.
    MeshError
        when faces lie on each other but their meshes do not conform.
    """
    sides = [_Side(block) for block in (block_I, block_J)]
    partner = _mutual_partners(sides[0], sides[1], tolerance)
    matched = _matched_facets(sides[0], sides[1], partner)
    _refuse_nonconforming(sides, matched, partner, tolerance, location)
    if not matched[0].any():
        raise ConfigError(do_not_touch(block_I, block_J, tolerance, location))
    return sides[0].facets[matched[0]], partner


class _Side:
    """The boundary of one of the two blocks."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self.points = block.points
        self.facets = boundary_facets(block.cells, block.element)
        self.nodes = np.unique(self.facets)
        self.normals = facet_normals(block.points, self.facets)


def _mutual_partners(side_I: _Side, side_J: _Side, tolerance: float) -> Ints:
    """Partner in J of every node of I: each is the other's nearest, within the tolerance."""
    points_I, points_J = side_I.points[side_I.nodes], side_J.points[side_J.nodes]
    distance, forth = nearest(points_J, points_I, tolerance * (1 + 1e-9))
    within = np.isfinite(distance)
    back = nearest(points_I, points_J[forth[within]])[1]
    mutual = np.flatnonzero(within)[back == np.flatnonzero(within)]
    partner = np.full(len(side_I.points), -1)
    partner[side_I.nodes[mutual]] = side_J.nodes[forth[mutual]]
    return partner


def _matched_facets(side_I: _Side, side_J: _Side, partner: Ints) -> tuple[Bools, Bools]:
    """Facets of I and of J that have the same nodes and look at each other."""
    matched = np.zeros(len(side_I.facets), dtype=bool), np.zeros(len(side_J.facets), dtype=bool)
    width = max(side.facets.shape[1] for side in (side_I, side_J))
    facets_I, other = (
        np.pad(s.facets, ((0, 0), (0, width - s.facets.shape[1])), mode="edge") for s in (side_I, side_J)
    )
    number = {tuple(key): f for f, key in enumerate(facet_keys(other).tolist())}
    images = facet_keys(partner[facets_I])
    for f in np.flatnonzero(images[:, 0] >= 0):
        facing = number.get(tuple(images[f].tolist()))
        if facing is not None and side_I.normals[f] @ side_J.normals[facing] < _OPPOSED:
            matched[0][f] = matched[1][facing] = True
    return matched


def _refuse_nonconforming(
    sides: list[_Side], matched: tuple[Bools, Bools], partner: Ints, tolerance: float, location: str
) -> None:
    """Raise if a facet without a partner lies on a facet of the other block."""
    left, right = (np.flatnonzero(~m) for m in matched)
    over_I = left[_overlaps(sides[0], left, sides[1], right, tolerance)]
    over_J = right[_overlaps(sides[1], right, sides[0], left, tolerance)]
    if not len(over_I) and not len(over_J):
        return
    has_partner = np.zeros(len(sides[1].points), dtype=bool)
    has_partner[partner[partner >= 0]] = True
    nodes_I = np.unique(sides[0].facets[over_I])
    nodes_J = np.unique(sides[1].facets[over_J])
    lonely = nodes_I[partner[nodes_I] < 0], nodes_J[~has_partner[nodes_J]]
    raise MeshError(_does_not_conform(sides, (over_I, over_J), lonely, tolerance, location))


def _does_not_conform(
    sides: list[_Side], over: tuple[Ints, Ints], lonely: tuple[Ints, Ints], tolerance: float, location: str
) -> str:
    names = [side.block.name for side in sides]
    counts = " and ".join(
        f"{len(nodes)} of block {name!r}" for name, nodes in zip(names, lonely, strict=True) if len(nodes)
    )
    where = np.vstack([side.points[nodes] for side, nodes in zip(sides, lonely, strict=True)])
    if not len(where):
        where = np.vstack([s.points[s.facets[f]].mean(axis=1) for s, f in zip(sides, over, strict=True)])
        counts = f"none, but {len(over[0])} facets of {names[0]!r} are cut otherwise than those they touch"
    kinds = {side.block.element for side in sides}
    elements = f" ({' against '.join(s.block.element for s in sides)})" if len(kinds) > 1 else ""
    return (
        f"{location}: the meshes of {names[0]!r} and {names[1]!r} do not conform{elements}: nodes on the "
        "common "
        f"face without a partner within {tolerance:g} m: {counts}; {_positions(where)}; mesh both blocks "
        f"with the same nodes on the common face, raise its `tolerance` if they are the same, or couple the "
        f"faces by discretization: mortar"
    )


def _positions(points: Floats) -> str:
    texts = ", ".join("(" + ", ".join(f"{x:.6g}" for x in p) + ")" for p in points[:_SHOWN])
    low, high = points.min(axis=0), points.max(axis=0)
    extent = ", ".join(f"{a} {x:.6g}..{y:.6g}" for a, x, y in zip("xyz", low, high, strict=True))
    return f"at {texts}{', ...' if len(points) > _SHOWN else ''} (within {extent} m)"


def do_not_touch(block_I: Block, block_J: Block, tolerance: float, location: str) -> str:
    """Say how far from each other two blocks are."""
    sides = [_Side(block) for block in (block_I, block_J)]
    points_I, points_J = (side.points[side.nodes] for side in sides)
    distance, forth = nearest(points_J, points_I)
    closest = int(np.argmin(distance))
    at_I, at_J = (", ".join(f"{x:.6g}" for x in p) for p in (points_I[closest], points_J[forth[closest]]))
    return (
        f"{location}: blocks {sides[0].block.name!r} and {sides[1].block.name!r} do not touch: no facets "
        f"coincide within {tolerance:g} m; the smallest distance between their nodes is "
        f"{distance[closest]:.6g} m, from ({at_I}) to ({at_J}); move a block, "
        f"or raise {location.split(': ')[-1]}.tolerance"
    )


def _overlaps(side: _Side, which: Ints, other: _Side, among: Ints, tolerance: float) -> Bools:
    """True for facets `which` of a side that lie on facets `among` of the other, by points inside them.

    Mid-edge nodes are left out: corners suffice to tell whether flat or mildly curved facets overlap.
    """
    on = np.zeros(len(which), dtype=bool)
    if not len(which) or not len(among):
        return on
    samples = _inner_points(side.points, side.facets[which])
    triangles, owner = _triangles(other.points, other.facets[among])
    near = _inside_box(samples, triangles, tolerance)
    if not near.any():
        return on
    normals = facet_normals(other.points, other.facets)[among][owner]
    centres = triangles.mean(axis=1)
    reach = np.linalg.norm(triangles - centres[:, None], axis=2).max() + tolerance
    by_centre = tree(centres)
    for f in np.flatnonzero(near):
        candidates = np.unique(np.concatenate(by_centre.query_ball_point(samples[f], reach)).astype(int))
        candidates = candidates[normals[candidates] @ side.normals[which[f]] < _OPPOSED]
        on[f] = _any_inside(samples[f], triangles[candidates], tolerance)
    return on


def _inner_points(points: Floats, facets: Ints) -> Floats:
    """Centroid and a point near each corner, inside every facet, (nf, corners + 1, 3)."""
    corner = points[facets[:, : facet_frame(facets).corners]]
    centre = corner.mean(axis=1, keepdims=True)
    return np.concatenate([centre, centre + 0.95 * (corner - centre)], axis=1)


def _triangles(points: Floats, facets: Ints) -> tuple[Floats, Ints]:
    """Corner triangles of facets, (nt, 3, 3), and the facet of each."""
    corner = points[facets[:, : facet_frame(facets).corners]]
    if corner.shape[1] == 3:
        return corner, np.arange(len(facets))
    rest = np.flatnonzero(facets[:, 2] != facets[:, 3])  # of quadrilaterals
    halves = np.concatenate([corner[:, [0, 1, 2]], corner[rest][:, [0, 2, 3]]])
    return halves, np.r_[np.arange(len(facets)), rest]


def _inside_box(samples: Floats, triangles: Floats, tolerance: float) -> Bools:
    low = triangles.min(axis=(0, 1)) - tolerance
    high = triangles.max(axis=(0, 1)) + tolerance
    return ((samples >= low) & (samples <= high)).all(axis=2).any(axis=1)


def _any_inside(points: Floats, triangles: Floats, tolerance: float) -> bool:
    """True where a point lies on a triangle: over its inside and within the tolerance of its plane."""
    if not len(triangles):
        return False
    origin, a, b = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(a, b)
    square = np.einsum("tk,tk->t", normal, normal)
    away = points[:, None] - origin[None]
    s = np.einsum("ptk,tk->pt", np.cross(away, b[None]), normal) / square
    t = np.einsum("ptk,tk->pt", np.cross(a[None], away), normal) / square
    height = np.abs(np.einsum("ptk,tk->pt", away, normal)) / np.sqrt(square)
    inside = (s > 1e-6) & (t > 1e-6) & (s + t < 1 - 1e-6) & (height <= tolerance)
    return bool(inside.any())
