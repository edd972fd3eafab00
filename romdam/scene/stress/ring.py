"""Nodes whose stress is that of the mesh: near edges where elasticity has infinite stress, and on contacts.

At a re-entrant edge, and where a support, another material or the end of a contact meets a free face, the
exact stress is infinite, so that what a mesh gives there grows without limit as it is refined (Williams,
J. Appl. Mech. 19 (1952) 526). Headlines leave a ring around such edges out, and say so.

The edges are found on the outline of all blocks together: their free facets, without those of joints, ties
and wholly fixed supports. Blocks that meet flush continue each other there. An edge counts where only one
facet ends (something else begins), where the two facets are of different materials, and where they enclose
more than 180 degrees of material.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from romdam.core.scene import Block, Bools, Ints, Joint, Tie
from romdam.geometry.elements import ELEMENTS, Floats, facet_element
from romdam.geometry.facets import (
    area_vectors,
    boundary_facets,
    facet_areas,
    facet_keys,
    facet_normals,
    row_numbers,
)
from romdam.geometry.meshes.kinds import facets_by_kind, frame
from romdam.geometry.nearest import merge_near, tree

_FLAT = 20.0  # degrees beyond 180 that a curved face of straight facets may enclose
_SAME = 1e-6  # of the scene's size: nodes as near as that are the same
_ROUNDING = 1e-6  # of a ring's radius


@dataclass(frozen=True)
class Outline:
    """Free facets of all blocks: nodes are numbered over all of them, those at one place alike.

    Attributes
    ----------
    points : (n, 3) [m]
    edges : (m, 2) ascending node numbers, one row for each edge of each facet
    normal, middle : (m, 3) of the facet
    depth : (m,) of the facet behind its edge [m]
    material : (m,) number of the facet's material
    """

    points: Floats
    edges: Ints
    normal: Floats
    middle: Floats
    depth: Floats
    material: Ints


def singular_edges(
    blocks: Mapping[str, Block], links: Iterable[Joint | Tie], fixed: Mapping[str, Bools]
) -> tuple[Floats, Floats]:
    """Edges of a scene's outline near which stress is that of the mesh.

    Parameters
    ----------
    links : joints and ties of the blocks
    fixed : block name -> (n, 3) True where a support holds the component

    Returns
    -------
    ends : (s, 2, 3) [m]
    depth : (s,) of the shallowest facet behind each [m]
    """
    outline = _outline(blocks, list(links), fixed)
    order = np.lexsort(outline.edges.T)
    edges = outline.edges[order]
    first = np.flatnonzero(np.r_[True, (np.diff(edges, axis=0) != 0).any(axis=1)][: len(edges)])
    count = np.diff(np.r_[first, len(edges)])
    pair = np.stack([order[first], order[first + np.minimum(count, 2) - 1]])
    first_facet, other = pair
    # two facets enclose more than 180 degrees of material, more than those of a curved face do
    turn = (outline.normal[first_facet] * outline.normal[other]).sum(axis=1)
    away = outline.middle[other] - outline.middle[first_facet]
    towards = (outline.normal[first_facet] * away).sum(axis=1)
    reentrant = (towards > 0.0) & (turn < np.cos(np.deg2rad(_FLAT)))
    counts = (count != 2) | (outline.material[first_facet] != outline.material[other]) | reentrant
    depth = np.minimum.reduceat(outline.depth[order], first) if len(first) else np.zeros(0)
    return outline.points[edges[first[counts]]], depth[counts]


def near_edges(points: Floats, ends: Floats, radius: Floats) -> Bools:
    """(n,) True for points within `radius` (s,) of segments `ends` (s, 2, 3) [m]."""
    near = np.zeros(len(points), dtype=bool)
    if not len(points) or not len(ends):
        return near
    radius = radius * (1.0 + _ROUNDING)
    along = ends[:, 1] - ends[:, 0]
    reach = radius + 0.5 * np.linalg.norm(along, axis=1)
    hits = tree(points).query_ball_point(ends.mean(axis=1), reach)
    which = np.repeat(np.arange(len(ends)), [len(hit) for hit in hits])
    at = np.concatenate([np.asarray(hit, dtype=np.int64) for hit in hits])
    off = points[at] - ends[which, 0]
    share = (off * along[which]).sum(axis=1) / (along[which] ** 2).sum(axis=1)
    distance = np.linalg.norm(off - np.clip(share, 0.0, 1.0)[:, None] * along[which], axis=1)
    near[at[distance <= radius[which]]] = True
    return near


def near_contacts(block: Block, nodes: Ints, joints: Iterable[Joint], held: Bools, radius: float) -> Bools:
    """(k,) True for nodes of a block within `radius` of its contact faces' nodes, with gaps or held [m].

    Parameters
    ----------
    held : (n,) True where a support holds any component
    """
    links: list[Joint | Tie] = [joint for joint in joints if block.name in joint.blocks]
    if not links or not len(nodes):
        return np.zeros(len(nodes), dtype=bool)
    facets = boundary_facets(block.cells, block.element)
    seen = [side for k in links for name, side in zip(k.blocks, k.nodes, strict=True) if name == block.name]
    on = np.unique(np.concatenate([*seen, facets[_linked(block, facets, links, held)].ravel()]))
    distance = tree(block.points[on]).query(block.points[nodes])[0]
    return np.isin(nodes, on) | (distance <= radius * (1.0 + _ROUNDING))


def _outline(blocks: Mapping[str, Block], links: list[Joint | Tie], fixed: Mapping[str, Bools]) -> Outline:
    points = np.concatenate([block.points for block in blocks.values()])
    numbers = merge_near(points, _SAME * float(np.ptp(points, axis=0).max()))
    number = np.split(numbers, np.cumsum([len(block.points) for block in blocks.values()])[:-1])
    facets = [boundary_facets(block.cells, block.element) for block in blocks.values()]
    corners = [
        block_facets[:, : ELEMENTS[frame(block.element).facet].corners]
        for block_facets, block in zip(facets, blocks.values(), strict=True)
    ]

    # block after block, True for boundary facets that coincide with those of another block
    widest = max(block_corners.shape[1] for block_corners in corners)
    padded = [
        np.pad(block_number[at], ((0, 0), (0, widest - at.shape[1])), mode="edge")
        for block_number, at in zip(number, corners, strict=True)
    ]
    keys = row_numbers(facet_keys(np.concatenate(padded)))
    _, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    covered = np.split(counts[inverse] > 1, np.cumsum([len(at) for at in corners])[:-1])

    elastic = {
        name: (block.material.E, block.material.sustained.E, block.material.nu)
        for name, block in blocks.items()
    }
    stiffness = list(dict.fromkeys(elastic.values()))
    edges, normals, middles, depths, materials = [], [], [], [], []
    for k, (name, block) in enumerate(blocks.items()):
        held = np.asarray(fixed[name].all(axis=1))[corners[k]].all(axis=1)
        free = ~(covered[k] | held | _linked(block, facets[k], links, np.asarray(fixed[name].any(axis=1))))
        for _, kind_facets, _ in facets_by_kind(facets[k][free]):
            sides = facet_element(kind_facets).corners
            ring = kind_facets[:, :sides]
            pairs = np.stack([ring, np.roll(ring, -1, axis=1)], axis=2)  # (nf, sides, 2)
            length = np.linalg.norm(block.points[pairs[..., 1]] - block.points[pairs[..., 0]], axis=2)
            normal = area_vectors(block.points, kind_facets).sum(axis=1)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            area = facet_areas(block.points, kind_facets)[:, None]
            edges.append(np.sort(number[k][pairs.reshape(-1, 2)], axis=1))
            normals.append(np.repeat(normal, sides, axis=0))
            middles.append(np.repeat(block.points[ring].mean(axis=1), sides, axis=0))
            depths.append((area * (2.0 if sides == 3 else 1.0) / length).ravel())
            material = stiffness.index(elastic[name])
            materials.append(np.full(len(edges[-1]), material))
    merged = np.zeros((int(numbers.max()) + 1, 3))
    merged[numbers] = points
    return Outline(
        merged,
        np.concatenate(edges),
        np.concatenate(normals),
        np.concatenate(middles),
        np.concatenate(depths),
        np.concatenate(materials),
    )


def _linked(block: Block, facets: Ints, links: list[Joint | Tie], held: Bools) -> Bools:
    """Tell whether a facet belongs to a joint or a tie, with all its corners.

    Corners that supports hold have no gaps: then the facet's normal must be that of the gaps nearby.
    """
    corners = facets[:, : ELEMENTS[frame(block.element).facet].corners]
    linked = np.zeros(len(facets), dtype=bool)
    for link in links:
        for owner, nodes in zip(link.blocks, link.nodes, strict=True):
            if owner != block.name:
                continue
            on = np.isin(corners, nodes)
            linked |= on.all(axis=1)
            partly = np.flatnonzero(on.any(axis=1) & ~on.all(axis=1) & (on | held[corners]).all(axis=1))
            if isinstance(link, Joint) and len(partly):
                nearest = tree(link.position).query(block.points[corners[partly]].mean(axis=1))[1]
                normal = facet_normals(block.points, facets[partly])
                along = np.abs((normal * link.axes[nearest, 0]).sum(axis=1))
                linked[partly[along > np.cos(np.deg2rad(_FLAT))]] = True
    return linked
