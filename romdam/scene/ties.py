"""Ties, the merged interfaces of blocks: which nodes are one, and the parts that result."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array, csr_matrix
from scipy.sparse.csgraph import connected_components

from romdam.config.sections.joints import TieConfig
from romdam.core.scene import Block, Bools, Ints, Scene, Tie
from romdam.scene.pairing import coincident_facets

_NAMED = 3  # blocks of a part that its name lists


@dataclass(frozen=True)
class Part:
    """Blocks that hang together without a joint: one substructure, with one node where blocks meet.

    Attributes
    ----------
    name : of its blocks
    blocks : names, in the scene's order
    number : block name -> (n,) its nodes' numbers in the part
    nodes : of the part
    """

    name: str
    blocks: tuple[str, ...]
    number: dict[str, Ints]
    nodes: int

    def spread(self, block: str) -> csr_matrix:
        """(3 n, 3 nodes) matrix that takes a block's DOFs from the part's."""
        number = self.number[block]
        columns = (3 * number[:, None] + np.arange(3)).ravel()
        return csr_matrix(
            (np.ones(len(columns)), (np.arange(len(columns)), columns)), shape=(len(columns), 3 * self.nodes)
        )

    def fixed(self, held: dict[str, Bools]) -> Bools:
        """(nodes, 3) components that a support of any of its blocks holds."""
        found = np.zeros((self.nodes, 3), dtype=bool)
        for name in self.blocks:
            np.logical_or.at(found, self.number[name], held[name])
        return found

    def mesh(self, blocks: dict[str, Block]) -> Block:
        """All its cells over its own nodes, as a block of the first one's material."""
        points = np.zeros((self.nodes, 3))
        for name in self.blocks:
            points[self.number[name]] = blocks[name].points
        cells = np.vstack([self.number[name][blocks[name].cells] for name in self.blocks])
        first = blocks[self.blocks[0]]
        absorbing = tuple(
            replace(face, facets=self.number[name][face.facets])
            for name in self.blocks
            for face in blocks[name].absorbing
        )
        return Block(self.name, first.element, points, cells, first.material, {}, absorbing)


def build_tie(name: str, tie: TieConfig, blocks: dict[str, Block], source: str) -> Tie:
    """Pair the nodes of two blocks' coinciding faces.

    Raises
    ------
    ConfigError
        when the blocks do not touch.
    MeshError
        when the two meshes do not conform on the common face.
    """
    I, J = (blocks[b] for b in tie.between)
    facets, partner = coincident_facets(I, J, tie.tolerance, f"{source}: ties.{name}")
    nodes = np.unique(facets)
    return Tie(name, tie.between, (nodes, partner[nodes]))


def scene_parts(scene: Scene) -> dict[str, Part]:
    """The parts of a scene by name; without ties every block is one."""
    return merged_parts({name: len(block.points) for name, block in scene.blocks.items()}, scene.ties)


def merged_parts(nodes: dict[str, int], ties: tuple[Tie, ...]) -> dict[str, Part]:
    """Parts of blocks with so many nodes each, merged by ties."""
    names = list(nodes)
    first = dict(zip(names, np.cumsum([0, *nodes.values()][:-1]), strict=True))
    total = sum(nodes.values())
    pairs = np.array([(names.index(t.blocks[0]), names.index(t.blocks[1])) for t in ties]).reshape(-1, 2)
    group = _components(pairs, len(names))
    both = [first[b] + n for t in ties for b, n in zip(t.blocks, t.nodes, strict=True)]
    links = np.stack([np.concatenate([np.zeros(0, dtype=int), *both[side::2]]) for side in (0, 1)], axis=1)
    node = _components(links, total)
    parts = {}
    for k in dict.fromkeys(group.tolist()):
        members = [name for name, g in zip(names, group, strict=True) if g == k]
        own = [node[first[name] : first[name] + nodes[name]] for name in members]
        found, inverse = np.unique(np.concatenate(own), return_inverse=True)
        ends = np.cumsum([len(n) for n in own])[:-1]
        number = dict(zip(members, np.split(inverse.astype(np.int64), ends), strict=True))
        part = Part(_part_name(members), tuple(members), number, len(found))
        parts[part.name] = part
    return parts


def _components(pairs: Ints, count: int) -> Ints:
    """Component of each of `count` things linked by pairs (n, 2)."""
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _part_name(members: list[str]) -> str:
    if len(members) <= _NAMED:
        return "+".join(members)
    return f"{members[0]}+...+{members[-1]}"
