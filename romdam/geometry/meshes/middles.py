"""Middle nodes that elements leave out: their edges and faces are straight there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.geometry.elements import ELEMENT_OF_CELL
from romdam.geometry.meshes.cells import Cells

_NONE = 0  # number that stands for a node that is left out


def with_middles(
    tags: Ints, points: Floats, cells: Sequence[Cells]
) -> tuple[Ints, Floats, list[Cells], tuple[str, ...]]:
    """Elements with all their middle nodes; those left out stand in the middle of their corners.

    Where another element has a node between the same corners, it is taken, so that both conform.

    Parameters
    ----------
    tags, points : numbers (n,) and positions (n, 3) of the nodes
    cells : with the file's numbers of nodes, 0 for one that is left out

    Returns
    -------
    numbers, positions and elements with the nodes that were added, and a remark if there are any
    """
    lacking = {
        k: block.nodes == _NONE
        for k, block in enumerate(cells)
        if block.kind in ELEMENT_OF_CELL
        and ELEMENT_OF_CELL[block.kind].quadratic
        and (block.nodes[:, ELEMENT_OF_CELL[block.kind].corners :] == _NONE).any()
    }
    if not lacking or (tags == _NONE).any():
        return tags, points, list(cells), ()
    # corners between which each middle node stands, over all elements that have some: key, node, where
    keys, owner = [], []
    for k, block in enumerate(cells):
        element = ELEMENT_OF_CELL.get(block.kind)
        if element is None or not element.quadratic:
            continue
        for j, between in enumerate(element.middles, element.corners):
            key = np.zeros((len(block.nodes), 8), np.int64)
            key[:, : len(between)] = block.nodes[:, list(between)]
            keys.append(np.sort(key, axis=1))
            owner += [(k, j)]
    number = np.unique(np.concatenate(keys), axis=0, return_inverse=True)[1]
    ends = np.cumsum([len(key) for key in keys])[:-1]
    number_of = dict(zip(owner, np.split(number, ends), strict=True))
    node_between = np.zeros(number.max() + 1, np.int64)
    for (k, j), numbers in number_of.items():
        np.maximum.at(node_between, numbers, cells[k].nodes[:, j])
    order = np.argsort(tags, kind="stable")

    full, added, after = list(cells), list[Floats](), int(tags.max(initial=0))
    elements = middles = 0
    for k, absent in lacking.items():
        block, element = cells[k], ELEMENT_OF_CELL[cells[k].kind]
        nodes = block.nodes.copy()
        for j, between in enumerate(element.middles, element.corners):
            rows = np.flatnonzero(absent[:, j])
            corners = nodes[np.ix_(rows, np.array(between))]
            at = np.minimum(np.searchsorted(tags[order], corners), len(tags) - 1)
            rows = rows[(tags[order][at] == corners).all(axis=1)]  # else corners are not given
            unknown, first = np.unique(number_of[k, j][rows], return_index=True)
            fresh = node_between[unknown] == _NONE
            unknown, first = unknown[fresh], first[fresh]
            node_between[unknown] = after + 1 + np.arange(len(unknown))
            after += len(unknown)
            ends_of = nodes[np.ix_(rows[first], np.array(between))]
            added.append(points[order[np.searchsorted(tags[order], ends_of)]].mean(axis=1))
            nodes[rows, j] = node_between[number_of[k, j][rows]]
        elements += int(absent[:, element.corners :].any(axis=1).sum())
        middles += int(absent[:, element.corners :].sum())
        full[k] = replace(block, nodes=nodes)
    k = next(iter(lacking))
    number_of_first = cells[k].ids[np.argmax(lacking[k].any(axis=1))]
    remark = (
        f"{elements} elements leave out {middles} of their middle nodes (the first is element "
        f"{number_of_first}, {cells[k].kind}); there they take the node of an element beside them, or one "
        "halfway between the corners, so that their edges are straight"
    )
    new = np.arange(int(tags.max(initial=0)) + 1, after + 1)
    return np.concatenate([tags, new]), np.concatenate([points, *added]), full, (remark,)
