"""Ties, the merged interfaces of blocks: nodes that are the same, nodes that follow others, and the parts.

Where two meshes have the same nodes on their common face, each pair becomes a single node. Where they have
not, a mortar tie makes every node of its slave face a weighted mean of nodes of the master's: it follows them
and is no unknown. What a node follows may follow others in turn. A node that follows in several ties takes
the mean of what they say by tributary area, so that slave faces that share nodes count as one face. A
component that a support holds stays held and does not follow: there the support carries what the tie would
have.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array, csr_matrix, diags_array, eye_array, hstack, kron, vstack
from scipy.sparse.csgraph import connected_components

from romdam.config.sections.joints import JointConfig, TieConfig
from romdam.core.errors import ConfigError, MeshError
from romdam.core.scene import Block, Bools, Ints, Scene, Tie
from romdam.scene.mortar.interface import mortar_interface
from romdam.scene.mortar.ties import tie_weights
from romdam.scene.pairing import coincident_facets
from romdam.scene.supports import has_no_rigid_body_mode

_log = logging.getLogger(__name__)

_NAMED = 3  # blocks of a part that its name lists, and nodes that a message does
_ROUNDING = 1e-12  # of weights whose sum is 1


@dataclass(frozen=True)
class Part:
    """Blocks that hang together without a joint: one substructure, with one node where blocks meet.

    Attributes
    ----------
    name : of its blocks
    blocks : names, in the scene's order
    number : block name -> (n,) its nodes' numbers in the part, slave nodes of mortar ties behind the others
    nodes : of the part that are independent
    slaves : (3 s, 3 nodes) sparse, the slave nodes' displacement from that of the independent ones, with zero
        rows where supports hold it; None without mortar ties
    """

    name: str
    blocks: tuple[str, ...]
    number: dict[str, Ints]
    nodes: int
    slaves: csr_matrix | None = None

    @property
    def every_node(self) -> int:
        """Number of nodes, independent or not."""
        return self.nodes + (0 if self.slaves is None else self.slaves.shape[0] // 3)

    def spread(self, block: str) -> csr_matrix:
        """(3 n, 3 nodes) matrix that takes a block's DOFs from the part's."""
        columns = (3 * self.number[block][:, None] + np.arange(3)).ravel()
        picked = csr_matrix(
            (np.ones(len(columns)), (np.arange(len(columns)), columns)),
            shape=(len(columns), 3 * self.every_node),
        )
        if self.slaves is None:
            return picked
        return csr_matrix(picked @ csr_matrix(vstack([eye_array(3 * self.nodes), self.slaves])))

    def together(self, blocks: tuple[str, str], nodes: tuple[Ints, Ints]) -> Bools:
        """(k,) True for pairs of nodes of two blocks that can only move alike."""
        I, J = (self.number[block][rows] for block, rows in zip(blocks, nodes, strict=True))
        if self.slaves is None:
            return np.asarray(I == J)
        I, J = (
            self.spread(block)[(3 * rows[:, None] + np.arange(3)).ravel()]
            for block, rows in zip(blocks, nodes, strict=True)
        )
        return np.asarray(abs(I - J).max(axis=1).toarray().reshape(-1, 3).max(axis=1) < _ROUNDING)

    def fixed(self, held: Mapping[str, Bools]) -> Bools:
        """(nodes, 3) components that a support of any of its blocks holds."""
        return self._fixed_everywhere(held)[: self.nodes]

    def _fixed_everywhere(self, held: Mapping[str, Bools]) -> Bools:
        is_fixed = np.zeros((self.every_node, 3), dtype=bool)
        for name in self.blocks:
            np.logical_or.at(is_fixed, self.number[name], held[name])
        return is_fixed

    def stands_free(self, scene: Scene) -> bool:
        """True where supports alone stop every rigid motion."""
        held = self._fixed_everywhere(scene.fixed)
        ties = (
            None
            if self.slaves is None
            else hstack([self.slaves, -eye_array(self.slaves.shape[0])], format="csr")
        )
        return has_no_rigid_body_mode(self.mesh(scene.blocks), held, ties)

    def mesh(self, blocks: dict[str, Block]) -> Block:
        """All its cells over all its nodes, as a block of the first one's material."""
        points = np.zeros((self.every_node, 3))
        for name in self.blocks:
            points[self.number[name]] = blocks[name].points
        every = [self.number[name][blocks[name].cells] for name in self.blocks]
        width = max(cells.shape[1] for cells in every)
        cells = np.vstack([np.pad(c, ((0, 0), (0, width - c.shape[1])), mode="edge") for c in every])
        first = blocks[self.blocks[0]]
        absorbing = tuple(
            replace(face, facets=self.number[name][face.facets])
            for name in self.blocks
            for face in blocks[name].absorbing
        )
        matrices = first.matrices if len(self.blocks) == 1 else None  # which no tie takes
        return Block(self.name, first.element, points, cells, first.material, {}, absorbing, matrices)


def build_tie(name: str, tie: TieConfig, blocks: dict[str, Block], location: str) -> Tie:
    """Pair the nodes of two blocks' coinciding faces, or let one face follow the other.

    Parameters
    ----------
    location : file and key, for messages

    Raises
    ------
    ConfigError
        when the blocks do not touch, over too little, or at too large an angle.
    MeshError
        when node_to_node is asked for and the two meshes do not conform.
    """
    I, J = (blocks[b] for b in tie.between)
    refuse_tied((I, J), location)
    if tie.discretization != "mortar":
        try:
            facets, partner = coincident_facets(I, J, tie.tolerance, location)
        except (ConfigError, MeshError):
            if tie.discretization == "node_to_node":
                raise
            _log.info("%s: the nodes of the two faces do not coincide; discretization: mortar", location)
        else:
            nodes = np.unique(facets)
            distance = np.linalg.norm(I.points[nodes] - J.points[partner[nodes]], axis=1)
            return Tie(name, tie.between, (nodes, partner[nodes]), apart=float(distance.max()))
    interface = mortar_interface(I, J, tie.tolerance, tie.overlap, location)
    weights = tie_weights(interface)
    slave, master = interface.slave, interface.master
    _log.info(
        "%s: mortar, %d nodes of %r follow those of %r over %.6g m2, at most %.3g m apart",
        location, len(weights.slave), slave.block, master.block, interface.covered, interface.apart,
    )  # fmt: skip
    sides = slave.block, master.block
    followed = weights.slave, weights.master
    return Tie(name, sides, followed, weights.weights, weights.area, interface.apart)


def refuse_tied(blocks: tuple[Block, Block], location: str) -> None:
    """Raise where one of two blocks has matrices of its own, whose unknowns no part of several blocks has.

    Raises
    ------
    ConfigError
    """
    for block in blocks:
        if block.matrices is not None:
            raise ConfigError(
                f"{location}: block {block.name!r} has matrices of its own, which no tie can have, limit 0 "
                "such blocks; give it a joint, or tie the meshes before the matrices are made"
            )


def tie_joints(scene: Scene, names: Collection[str], joints: Mapping[str, JointConfig], source: str) -> Scene:
    """The scene with some joints closed for good: their faces are one, whatever gap lay between them.

    Parameters
    ----------
    names : of the joints to tie
    joints : of the configuration, by name
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError, MeshError
        as `build_tie`, and where nodes would follow each other round in a circle.
    """
    keys = set(TieConfig.model_fields) - {"discretization"}  # what coincides is one, for mortar joints too
    tied = []
    for name in names:
        tie = TieConfig(**{key: getattr(joints[name], key) for key in keys})
        tied.append(build_tie(name, tie, scene.blocks, f"{source}: joints.{name}"))
    rest = {name: joint for name, joint in scene.joints.items() if name not in names}
    return replace(scene, joints=rest, ties=(*scene.ties, *tied))


def scene_parts(scene: Scene) -> dict[str, Part]:
    """The parts of a scene by name; without ties every block is one."""
    return merged_parts({name: scene.fixed[name] for name in scene.blocks}, scene.ties)


def merged_parts(fixed: Mapping[str, Bools], ties: tuple[Tie, ...]) -> dict[str, Part]:
    """Parts of blocks, merged by ties.

    Parameters
    ----------
    fixed : block name -> (n, 3) components that supports hold

    Raises
    ------
    ConfigError
        where nodes follow each other round in a circle.
    """
    names, nodes = list(fixed), {name: len(held) for name, held in fixed.items()}
    if not ties:
        return {name: Part(name, (name,), {name: np.arange(count)}, count) for name, count in nodes.items()}
    first = dict(zip(names, np.cumsum([0, *nodes.values()][:-1]), strict=True))
    total = sum(nodes.values())
    pairs = np.array([(names.index(t.blocks[0]), names.index(t.blocks[1])) for t in ties]).reshape(-1, 2)
    group = _components(pairs, len(names))
    merged = [t for t in ties if t.weights is None]
    both = [first[b] + n for t in merged for b, n in zip(t.blocks, t.nodes, strict=True)]
    links = np.stack([np.concatenate([np.zeros(0, dtype=int), *both[side::2]]) for side in (0, 1)], axis=1)
    node = _components(links, total)
    parts = {}
    for k in dict.fromkeys(group.tolist()):
        members = [name for name, g in zip(names, group, strict=True) if g == k]
        numbers = [node[first[name] : first[name] + nodes[name]] for name in members]
        distinct, inverse = np.unique(np.concatenate(numbers), return_inverse=True)
        ends = np.cumsum([len(n) for n in numbers])[:-1]
        number = dict(zip(members, np.split(inverse.astype(np.int64), ends), strict=True))
        name = "+".join(members) if len(members) <= _NAMED else f"{members[0]}+...+{members[-1]}"
        part = Part(name, tuple(members), number, len(distinct))
        mortar = [t for t in ties if t.weights is not None and t.blocks[0] in members]
        parts[part.name] = _with_slaves(part, mortar, fixed) if mortar else part
    return parts


def _with_slaves(part: Part, ties: list[Tie], fixed: Mapping[str, Bools]) -> Part:
    """A part whose nodes are all independent with those that follow behind the others."""
    means = _means(part, ties)
    circle = connected_components(means, directed=True, connection="strong")[1]
    within = np.flatnonzero(np.bincount(circle)[circle] > 1)
    if len(within):
        names = [t.name for t in ties if np.isin(part.number[t.blocks[0]][t.nodes[0]], within).any()]
        listed = [
            f"node {node} of block {name!r}"
            for name in part.blocks
            for node in np.flatnonzero(np.isin(part.number[name], within))
        ]
        more = f" and {len(listed) - _NAMED} more" if len(listed) > _NAMED else ""
        raise ConfigError(
            f"ties.{', ties.'.join(names)}: {len(within)} slave nodes follow each other round in a circle "
            f"({', '.join(listed[:_NAMED])}{more}), limit 0; give two of the faces the same nodes, or mesh "
            "one so finely that its nodes follow in both of its ties"
        )

    follows = np.diff(means.indptr) > 0
    order, nodes = np.argsort(follows, kind="stable"), int((~follows).sum())
    position = np.empty(len(order), dtype=np.int64)
    position[order] = np.arange(len(order))
    held = part.fixed(fixed)[order[nodes:]].ravel()
    rows = diags_array((~held).astype(float)) @ kron(
        means[order[nodes:]][:, order], eye_array(3), format="csr"
    )
    rows = csr_matrix(rows)
    # what slave DOFs follow in the end: with rows [D, C] it is (I - C)^-1 D = ... (I + C^2) (I + C) D
    direct, chained = rows[:, : 3 * nodes], rows[:, 3 * nodes :]
    while chained.nnz:
        direct, chained = direct + chained @ direct, chained @ chained
    number = {name: position[numbers] for name, numbers in part.number.items()}
    return replace(part, number=number, nodes=nodes, slaves=csr_matrix(direct))


def _means(part: Part, ties: list[Tie]) -> csr_matrix:
    """Weights by which slave nodes follow others, (nodes, nodes); no entry in the rows of the others.

    A slave node that is one with a node of its master's face hangs there already.
    """
    total, area = csr_matrix((part.nodes,) * 2), np.zeros(part.nodes)
    for tie in ties:
        slaves, masters = (part.number[b][n] for b, n in zip(tie.blocks, tie.nodes, strict=True))
        weights = csr_matrix(tie.weights).tocoo()
        share = np.ones(len(slaves)) if tie.area is None else tie.area.copy()
        share[np.isin(slaves, masters[weights.col])] = 0.0
        weights.data = weights.data * share[weights.row]
        entries = (weights.data, (slaves[weights.row], masters[weights.col]))
        total = total + csr_matrix(entries, shape=total.shape)
        np.add.at(area, slaves, share)
    total = csr_matrix(diags_array(1.0 / np.where(area > 0.0, area, 1.0)) @ total)
    total.eliminate_zeros()
    return total


def _components(pairs: Ints, count: int) -> Ints:
    """Component of each of `count` things linked by pairs (n, 2)."""
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
