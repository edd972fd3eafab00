"""Check that the cells of a mesh can carry an integration."""

from __future__ import annotations

import logging

import numpy as np

from romdam.core.errors import MeshError
from romdam.core.scene import Block, Ints
from romdam.geometry.elements import Element, Floats, jacobians
from romdam.geometry.facets import facet_keys, row_numbers
from romdam.geometry.meshes.bodies import bodies_text, number_bodies
from romdam.geometry.meshes.closed import refuse_bad_faces
from romdam.geometry.meshes.kinds import chunks_of, frame, kinds_of
from romdam.geometry.nearest import tree

log = logging.getLogger(__name__)

_CHUNK = 4096  # cells at a time
_COINCIDENT = 1e-6  # distance of two nodes relative to the block's diagonal
_TOGETHER = 1e-3  # the same relative to the shortest edge at either node: else it is a small element
_FLAT = 1e-12  # Jacobian determinant relative to the cube of the element's size, below which it is flat


def refuse_bad_cells(block: Block, location: str) -> None:
    """Raise if the cells do not make one sound body.

    A cell is turned inside out or flat, occurs twice or has its nodes in another format's order; nodes
    coincide; faces do not pair, or one lies inside the block. What is odd and may be meant is logged.

    Parameters
    ----------
    location : start of the message

    Raises
    ------
    MeshError
    """
    unique = np.unique(row_numbers(facet_keys(block.cells)))
    if len(unique) < len(block.cells):
        raise MeshError(
            f"{location}: {len(block.cells) - len(unique)} of {len(block.cells)} elements of block "
            f"{block.name!r} occur twice, limit 0; remove duplicates, or select one `group` of the file"
        )
    refuse_loose_nodes(block, location)
    for element, rows, cells in kinds_of(block.element, block.cells):
        if element.quadratic:
            _refuse_stray_middles(block, element, rows, cells, location)
    volume = sound_volume(block, location)

    # two nodes at the same position are a crack that no joint knows of
    shortest = _shortest_edges(block)
    usual = float(np.median(shortest[np.isfinite(shortest)]))
    reach = min(_COINCIDENT * float(np.linalg.norm(np.ptp(block.points, axis=0))), _TOGETHER * usual)
    pairs = tree(block.points).query_pairs(reach, output_type="ndarray")
    if len(pairs):
        apart = np.linalg.norm(np.diff(block.points[pairs], axis=1)[:, 0], axis=1)
        pairs = pairs[apart <= _TOGETHER * shortest[pairs].min(axis=1)]
    if len(pairs):
        first, second = pairs[np.lexsort(pairs.T[::-1])][0]
        at = ", ".join(f"{x:.6g}" for x in block.points[second])
        boxes = number_bodies(block.points, [block.cells])[1]
        apart_by = "make it two blocks with a joint or a tie"
        if len(boxes) > 1:
            apart_by = (
                f"make its {len(boxes)} bodies blocks of their own by `mesh.bodies: auto`, with joints or "
                f"ties: {bodies_text(boxes)} [m]"
            )
        raise MeshError(
            f"{location}: {len(pairs)} pairs of nodes of block {block.name!r} coincide (nodes {first} and "
            f"{second} at ({at}) are the first, counted from 0; within {reach:.1g} m), limit 0: the block is "
            f"cut there; merge duplicate nodes, or {apart_by}"
        )

    pieces = refuse_bad_faces(block, volume, location)
    if pieces > 1:
        log.warning(
            "%s: block %r is in %d pieces that share no face (at most edges or nodes); make them blocks of "
            "their own (those that share no node by `mesh.bodies: auto`), or mesh them together",
            location, block.name, pieces,
        )  # fmt: skip


def sound_volume(block: Block, location: str) -> float:
    """Volume of the cells [m3]; raises where one is turned inside out, at a Gauss point or at a corner."""
    total = 0.0
    for element, rows, cells in chunks_of(block, _CHUNK):
        xi, weight = element.rule
        both = np.vstack([xi, element.nodes[: element.corners]])
        matrices = jacobians(block.points, cells, element, both)
        # determinants by the rule of Sarrus: LAPACK is slow on small matrices
        (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(matrices, (-2, -1), (0, 1))
        determinant = a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)
        size = np.ptp(block.points[cells], axis=1).max(axis=1)
        not_flat = determinant > (_FLAT * size**3)[:, None]
        refuse_inverted(block, np.where(not_flat, determinant, np.minimum(determinant, 0.0)), rows, location)
        total += float((determinant[:, : len(xi)] @ weight).sum())
    return total


def refuse_loose_nodes(block: Block, location: str = "mesh") -> None:
    """Raise if a node belongs to no element: nothing holds it, and no matrix has its row.

    Matrices that a block brings are checked as they are read.

    Raises
    ------
    MeshError
        naming the first.
    """
    if block.matrices is not None:
        return
    loose = np.flatnonzero(np.bincount(block.cells.ravel(), minlength=len(block.points)) == 0)
    if len(loose):
        at = ", ".join(f"{x:.6g}" for x in block.points[loose[0]])
        raise MeshError(
            f"{location}: node {loose[0]} at ({at}) of block {block.name!r} belongs to no element "
            f"({len(loose)} such nodes, limit 0): remove it, or mesh what it was meant for"
        )


def _shortest_edges(block: Block) -> Floats:
    """Length of the shortest edge at every node (n,) [m]; inf at mid-edge nodes."""
    ends = block.cells[:, np.array(frame(block.element).edges)]
    length = np.linalg.norm(np.diff(block.points[ends], axis=2)[:, :, 0], axis=2)
    length[ends[:, :, 0] == ends[:, :, 1]] = np.inf  # collapsed
    shortest = np.full(len(block.points), np.inf)
    for side in (0, 1):
        np.minimum.at(shortest, ends[:, :, side], length)
    return shortest


def _refuse_stray_middles(block: Block, element: Element, rows: Ints, cells: Ints, location: str) -> None:
    """Raise where a node is nearer to another node's position than to the right one: a wrong node order.

    That is half an edge away for a node of an edge. Nodes of facets and of the whole may be a quarter of the
    shortest edge from where the edges' nodes would have them.

    Parameters
    ----------
    rows : (nc,) numbers of the cells in the block
    cells : (nc, nodes of the element)
    """
    corners, edges = element.corners, len(element.edges)
    nodes = block.points[cells]
    ends = nodes[:, np.array(element.edges)]
    length = np.maximum(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2), np.finfo(float).tiny)
    off = np.linalg.norm(nodes[:, corners : corners + edges] - ends.mean(axis=2), axis=2) / length
    checks = [(corners, "mid-edge", "of its edge", 0.5, off)]
    if not element.on_edges:
        first = corners + edges
        inner = nodes[:, first:] - element.skeleton.shape(element.nodes[first:]) @ nodes[:, :first]
        off = np.linalg.norm(inner, axis=2) / length.min(axis=1)[:, None]
        checks.append((first, "middle", "of its corners", 0.25, off))
    for first, kind, where, limit, off in checks:
        if off.max() >= limit:
            cell, node = np.unravel_index(np.argmax(off), off.shape)
            raise MeshError(
                f"{location}: {kind} node {first + node} of element {rows[cell]} of block {block.name!r} "
                f"({block.element}, both counted from 0) is {off[cell, node]:.3g} edge lengths off the "
                f"middle {where}, limit {limit:g}: the file's node order is not that of its format; export "
                "the mesh anew"
            )


def refuse_inverted(block: Block, determinant: Floats, cells: Ints, location: str = "mesh") -> None:
    """Raise if a determinant of dx/dxi is not positive; (nc, nq) of the cells of these numbers (nc,) [m3].

    Raises
    ------
    MeshError
    """
    lowest = determinant.min(axis=1)
    if lowest.min() > 0.0:
        return
    worst = int(np.argmin(lowest))
    cell = cells[worst]
    centre = ", ".join(f"{x:.6g}" for x in block.points[block.cells[cell]].mean(axis=0))
    raise MeshError(
        f"{location}: element {cell} of block {block.name!r} ({block.element}, counted from 0, around "
        f"({centre})) has a Jacobian determinant of {lowest[worst]:.4g} m3, limit above 0 "
        f"({np.count_nonzero(lowest <= 0.0)} such elements here): its nodes are in the "
        "wrong order or it is turned inside out; repair the mesh"
    )
