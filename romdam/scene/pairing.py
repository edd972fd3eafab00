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
    I, J = _Side(block_I), _Side(block_J)

    # partner in J of every node of I: each is the other's nearest, within the tolerance
    points_I, points_J = I.points[I.nodes], J.points[J.nodes]
    distance, forth = nearest(points_J, points_I, tolerance * (1 + 1e-9))
    within = np.isfinite(distance)
    back = nearest(points_I, points_J[forth[within]])[1]
    mutual = np.flatnonzero(within)[back == np.flatnonzero(within)]
    partner = np.full(len(I.points), -1)
    partner[I.nodes[mutual]] = J.nodes[forth[mutual]]

    # facets that have the same nodes and look at each other
    matched_I, matched_J = np.zeros(len(I.facets), dtype=bool), np.zeros(len(J.facets), dtype=bool)
    width = max(side.facets.shape[1] for side in (I, J))
    facets_I, facets_J = (
        np.pad(s.facets, ((0, 0), (0, width - s.facets.shape[1])), mode="edge") for s in (I, J)
    )
    number = {tuple(key): f for f, key in enumerate(facet_keys(facets_J).tolist())}
    images = facet_keys(partner[facets_I])
    for f in np.flatnonzero(images[:, 0] >= 0):
        facing = number.get(tuple(images[f].tolist()))
        if facing is not None and I.normals[f] @ J.normals[facing] < _OPPOSED:
            matched_I[f] = matched_J[facing] = True

    _refuse_nonconforming((I, J), (matched_I, matched_J), partner, tolerance, location)
    if not matched_I.any():
        raise ConfigError(do_not_touch(block_I, block_J, tolerance, location))
    return I.facets[matched_I], partner


class _Side:
    """The boundary of one of the two blocks."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self.points = block.points
        self.facets = boundary_facets(block.cells, block.element)
        self.nodes = np.unique(self.facets)
        self.normals = facet_normals(block.points, self.facets)


def _refuse_nonconforming(
    sides: tuple[_Side, _Side], matched: tuple[Bools, Bools], partner: Ints, tolerance: float, location: str
) -> None:
    """Raise if a facet without a partner lies on a facet of the other block."""
    I, J = sides
    left_I, left_J = (np.flatnonzero(~m) for m in matched)
    over_I = left_I[_overlaps(I, left_I, J, left_J, tolerance)]
    over_J = left_J[_overlaps(J, left_J, I, left_I, tolerance)]
    if not len(over_I) and not len(over_J):
        return
    name_I, name_J = I.block.name, J.block.name
    has_partner = np.zeros(len(J.points), dtype=bool)
    has_partner[partner[partner >= 0]] = True
    nodes_I, nodes_J = np.unique(I.facets[over_I]), np.unique(J.facets[over_J])
    lonely_I, lonely_J = nodes_I[partner[nodes_I] < 0], nodes_J[~has_partner[nodes_J]]
    where = np.vstack([I.points[lonely_I], J.points[lonely_J]])
    lonely = (name_I, lonely_I), (name_J, lonely_J)
    counts = " and ".join(f"{len(nodes)} of block {name!r}" for name, nodes in lonely if len(nodes))
    if not len(where):
        where = np.vstack([s.points[s.facets[f]].mean(axis=1) for s, f in ((I, over_I), (J, over_J))])
        counts = f"none, but {len(over_I)} facets of {name_I!r} are cut otherwise than those they touch"
    kinds = I.block.element, J.block.element
    elements = f" ({' against '.join(kinds)})" if kinds[0] != kinds[1] else ""
    first = ", ".join("(" + ", ".join(f"{x:.6g}" for x in p) + ")" for p in where[:_SHOWN])
    low, high = where.min(axis=0), where.max(axis=0)
    extent = ", ".join(f"{a} {x:.6g}..{y:.6g}" for a, x, y in zip("xyz", low, high, strict=True))
    more = ", ..." if len(where) > _SHOWN else ""
    raise MeshError(
        f"{location}: the meshes of {name_I!r} and {name_J!r} do not conform{elements}: nodes on the common "
        f"face without a partner within {tolerance:g} m: {counts}; at {first}{more} (within {extent} m); "
        "mesh both blocks with the same nodes on the common face, raise its `tolerance` if they are the "
        "same, or couple the faces by discretization: mortar"
    )


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
    # centroid and a point near each corner, inside every facet, (nf, corners + 1, 3)
    facets = side.facets[which]
    corner = side.points[facets[:, : facet_frame(facets).corners]]
    centre = corner.mean(axis=1, keepdims=True)
    samples = np.concatenate([centre, centre + 0.95 * (corner - centre)], axis=1)

    # corner triangles of the other's facets, (nt, 3, 3), and the facet of each
    facets = other.facets[among]
    triangles, owner = other.points[facets[:, : facet_frame(facets).corners]], np.arange(len(facets))
    if triangles.shape[1] == 4:
        halved = np.flatnonzero(facets[:, 2] != facets[:, 3])  # in a triangle the last node stands twice
        triangles = np.concatenate([triangles[:, [0, 1, 2]], triangles[halved][:, [0, 2, 3]]])
        owner = np.r_[owner, halved]

    low = triangles.min(axis=(0, 1)) - tolerance
    high = triangles.max(axis=(0, 1)) + tolerance
    near = ((samples >= low) & (samples <= high)).all(axis=2).any(axis=1)
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
