"""Where a node stands between the upstream and the downstream face, in the horizontal plane through it.

Arches of a dam, and the lifts of a monolith, are horizontal sections; temperatures of the faces are given by
elevation. So the distance to a face is that to the line along which the node's horizontal plane cuts it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.geometry.elements import facet_element
from romdam.geometry.facets import small_triangles
from romdam.geometry.meshes.kinds import facets_by_kind

_CUTS = {True: 4, False: 2}  # parts of an edge of a curved facet, and of one with straight edges
_PAIRS = 2_000_000  # node and triangle, at a time: some 200 MB
_ROUND_OFF = 1e-9  # of the size of the faces
_EDGE = 0.5  # of the thickness: a node farther above or below its block's face has no thickness to stand in


@dataclass(frozen=True)
class UpstreamSurface:
    """Triangles of one face of several blocks.

    Attributes
    ----------
    corners : (nt, 3, 3) [m]
    span : block -> lowest and highest elevation of its part [m]
    """

    corners: Floats
    span: Mapping[str, tuple[float, float]]

    @classmethod
    def of(cls, facets: Mapping[str, tuple[Floats, Ints]]) -> Self:
        """Of blocks' points (n, 3) and facets (nf, nodes per facet)."""
        corners = np.concatenate([_triangles(points, rows) for points, rows in facets.values()])
        heights = {name: points[rows, 2] for name, (points, rows) in facets.items()}
        return cls(corners, {name: (float(z.min()), float(z.max())) for name, z in heights.items()})


def share_of_thickness(
    block: str, points: Floats, upstream: UpstreamSurface, downstream: UpstreamSurface, location: str
) -> tuple[Floats, Floats]:
    """Distance of a block's nodes from the upstream face as a share of the thickness, and the thickness [m].

    Both are horizontal: (n,), (n,). A node above or below its block's face is taken at the face's edge.

    Parameters
    ----------
    points : (n, 3) of the block [m]
    location : file and key, for messages

    Raises
    ------
    ConfigError
        where a node does not stand between the faces, or half the thickness above or below them.
    """
    size = float(np.ptp(np.concatenate([upstream.corners, downstream.corners]).reshape(-1, 3), axis=0).max())
    ways, beyond = [], np.zeros(len(points))
    for surface in (upstream, downstream):
        low, high = surface.span[block]
        level = np.clip(points[:, 2], low, high)
        beyond = np.maximum(beyond, np.abs(points[:, 2] - level))
        ways.append(_way_to(points[:, :2], level, surface.corners, _ROUND_OFF * size))
    up, down = (np.linalg.norm(way, axis=1) for way in ways)
    thickness = up + down
    # of a node on a face, or on the edge where both meet, one of the ways has no direction
    same_side = (ways[0] * ways[1]).sum(axis=1) > _ROUND_OFF * size * size
    far = beyond > _EDGE * thickness + _ROUND_OFF * size
    uncut = np.isnan(thickness)
    for bad, what in (
        (uncut, "have no point of a face at their elevation"),
        (same_side, "see both faces on the same side"),
        (far, "lie above or below the faces by more than half the thickness"),
    ):
        if bad.any():
            node = int(np.flatnonzero(bad)[0])
            x, y, z = points[node]
            raise ConfigError(
                f"{location}: {bad.sum()} of {len(points)} nodes of block {block!r} {what}, limit 0, so "
                f"their place between them cannot be told; the first is at ({x:.6g}, {y:.6g}, {z:.6g}) m, "
                f"{up[node]:.4g} m from upstream, {down[node]:.4g} m from downstream and "
                f"{beyond[node]:.4g} m above or below; name the right `upstream` and `downstream`, or "
                "give temperatures of `points`"
            )
    return np.divide(up, thickness, out=np.full_like(up, 0.5), where=thickness > 0.0), thickness


def _way_to(places: Floats, level: Floats, corners: Floats, tolerance: float) -> Floats:
    """Horizontal way (n, 2) from places (n, 2) to the nearest cut of triangles with planes at levels (n,)."""
    lowest, highest = corners[..., 2].min(axis=1), corners[..., 2].max(axis=1)
    steep = highest - lowest > tolerance
    corners, lowest, highest = corners[steep], lowest[steep], highest[steep]
    way, per = np.full((len(places), 2), np.nan), max(_PAIRS // max(len(corners), 1), 1)
    for first in range(0, len(places), per):
        z, at = level[first : first + per], places[first : first + per]
        cut = (lowest - tolerance <= z[:, None]) & (z[:, None] <= highest + tolerance)
        node, triangle = np.nonzero(cut)
        if not len(node):
            continue
        around = corners[triangle]
        height = np.clip(z[node], lowest[triangle], highest[triangle])
        ends = np.full((len(node), 3, 2), np.nan)  # of the edges 0-1, 1-2, 2-0, where the plane cuts them
        for edge in range(3):
            a, b = around[:, edge], around[:, (edge + 1) % 3]
            rise = b[:, 2] - a[:, 2]
            with np.errstate(divide="ignore", invalid="ignore"):
                share = (height - a[:, 2]) / rise
            on = (share >= -_ROUND_OFF) & (share <= 1.0 + _ROUND_OFF)
            ends[on, edge] = a[on, :2] + np.clip(share[on, None], 0.0, 1.0) * (b - a)[on, :2]
        best, square = np.full((len(node), 2), np.nan), np.full(len(node), np.inf)
        for edge in range(3):
            start, end = ends[:, edge], ends[:, (edge + 1) % 3]
            along, off = end - start, start - at[node]
            length = (along**2).sum(axis=1)
            t = np.clip(-(along * off).sum(axis=1) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
            step = off + t[:, None] * along
            nearer = (step**2).sum(axis=1) < square  # not where an end is none
            best[nearer], square[nearer] = step[nearer], (step[nearer] ** 2).sum(axis=1)
        order = np.lexsort((square, node))
        node, best = node[order], best[order]
        starts = np.flatnonzero(np.r_[True, node[1:] != node[:-1]])
        way[first + node[starts]] = best[starts]
    return way


def _triangles(points: Floats, facets: Ints) -> Floats:
    """Flat triangles (nt, 3, 3) that follow facets, curved ones as well; the nodes are corners of them."""
    parts = [np.zeros((0, 3, 3))]
    for _, rows, _ in facets_by_kind(facets):
        element = facet_element(rows)
        _, shape = small_triangles(element.name, _CUTS[len(element.nodes) > element.corners])
        parts.append(np.einsum("tca,fak->ftck", shape, points[rows]).reshape(-1, 3, 3))
    return np.concatenate(parts)
