"""Joints: gap elements between the coinciding faces of two blocks, with their local axes and areas."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from romdam.config.sections.joints import GapTable, JointConfig
from romdam.contact.laws import LAWS
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.coulomb import Coulomb
from romdam.contact.laws.law import Law
from romdam.core.arrays import Bools, Ints
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Joint
from romdam.core.system import LawRows
from romdam.scene.elements import Floats, facet_element
from romdam.scene.facets import gap_weights, node_normals
from romdam.scene.gap_table import table_gap
from romdam.scene.pairing import coincident_facets
from romdam.scene.ties import Part

_log = logging.getLogger(__name__)

_NOTHING = 1e-12  # weights and cosines below it are rounding
_STEEP = np.cos(np.pi / 4) + 1e-6  # above rounding, so that a flat face at 45 degrees gets one rule


def build_joint(
    name: str,
    joint: JointConfig,
    blocks: dict[str, Block],
    fixed: dict[str, Bools],
    folder: Path,
    source: str,
    parts: Collection[Part] = (),
) -> Joint:
    """Find the coinciding faces of two blocks and put a gap on every node pair.

    Parameters
    ----------
    blocks, fixed : of the scene, see `Scene`
    folder : where relative paths start
    source : the configuration's file name, for messages
    parts : of the scene, see `romdam.scene.ties.scene_parts`

    Raises
    ------
    ConfigError
        when the blocks do not touch, for a wrong normal or gap table, and when supports or ties leave no gap.
    MeshError
        when the two meshes do not conform on the common face.
    """
    place = f"{source}: joints.{name}"
    whole = _all_gaps(name, joint, blocks, folder, place)
    merged = any(set(whole.blocks) <= set(part.blocks) for part in parts)
    by = "supports or ties" if merged else "supports"
    return _without_held_gaps(whole, _free_components(whole, fixed, parts), by, place)


def _all_gaps(name: str, joint: JointConfig, blocks: dict[str, Block], folder: Path, place: str) -> Joint:
    block_I, block_J = (blocks[b] for b in joint.between)
    facets, partner = coincident_facets(block_I, block_J, joint.tolerance, place)
    nodes, area, weights = gap_weights(block_I.points, facets, joint.gaps == "corners")
    at = nodes if len(area) == len(nodes) else np.unique(facets[:, : facet_element(facets).corners])
    position = block_I.points[at]
    outward = node_normals(block_I.points, facets)[at]
    normal = _normals(joint, position, block_J.points[partner[at]], outward, place)
    return Joint(
        name=name,
        blocks=joint.between,
        nodes=(nodes, partner[nodes]),
        position=position,
        area=area,
        axes=local_axes(normal),
        weights=weights,
        **_properties(joint, area, position, folder, place),
    )


def with_properties(joint: Joint, config: JointConfig, folder: Path, source: str) -> Joint:
    """The same gaps with the stiffness, friction, initial gap and further laws of another configuration.

    Raises
    ------
    ConfigError
        for a wrong gap table.
    """
    place = f"{source}: joints.{joint.name}"
    return replace(joint, **_properties(config, joint.area, joint.position, folder, place))


def _properties(
    joint: JointConfig, area: Floats, position: Floats, folder: Path, place: str
) -> dict[str, Any]:
    """Fields of a `Joint` that depend on its parameters alone."""
    keys = joint.law_keys
    return {
        "gap": _initial_gap(joint, position, folder, place),
        **{law.array: _rows(law, keys, area)[:, 0] for law in LAWS if law.array and law is not Coulomb},
        "mu": _rows(Coulomb, keys, area),
        "laws": tuple(_further(law, keys, area) for law in joint.every_law if not law.array),
    }


def _further(law: type[Law], keys: Mapping[str, Any], area: Floats) -> LawRows:
    on = np.ones(len(area), dtype=np.bool_)
    return LawRows(source_of(law), _rows(law, keys, area), on, law.needs_shear(keys))


def _rows(law: type[Law], keys: Mapping[str, Any], area: Floats) -> Floats:
    """Parameters of a law at every gap, (n, p)."""
    return np.array([law.row(keys, float(each)) for each in area])


def local_axes(normal: Floats) -> Floats:
    """Right-handed axes i, j, k at every gap, (n, 3, 3), from the unit normals i (n, 3).

    k is the projection of global z on the joint (so k is "up" on a vertical joint and j is
    horizontal), or of global x where the normal is within 45 degrees of z; j = k x i. Swapping the
    two blocks reverses i and j and keeps k.
    """
    up = np.zeros_like(normal)
    steep = np.abs(normal[:, 2]) > _STEEP
    up[~steep, 2] = 1.0
    up[steep, 0] = 1.0
    k = up - np.einsum("nk,nk->n", up, normal)[:, None] * normal
    k /= np.linalg.norm(k, axis=1, keepdims=True)
    return np.stack([normal, np.cross(k, normal), k], axis=1)


def _normals(joint: JointConfig, points_I: Floats, points_J: Floats, outward: Floats, place: str) -> Floats:
    if joint.normal == "face":
        return outward
    if joint.normal == "nodes":
        return _normals_from_nodes(points_I, points_J, place)
    vector = np.array(joint.normal)
    length = np.linalg.norm(vector)
    if length == 0.0:
        raise ConfigError(
            f"{place}.normal must have a length above 0, got [0, 0, 0]; give its direction from I to J"
        )
    cosine = outward @ vector / length
    if cosine.min() <= 0.0:
        raise ConfigError(
            f"{place}.normal must point from block {joint.between[0]!r} to {joint.between[1]!r}, but at "
            f"{np.count_nonzero(cosine <= 0.0)} of {len(cosine)} gaps its cosine with the face normal is "
            f"{cosine.min():.3g} or more, limit above 0; reverse it, or use normal: face"
        )
    return np.tile(vector / length, (len(outward), 1))


def _normals_from_nodes(points_I: Floats, points_J: Floats, place: str) -> Floats:
    apart = points_J - points_I
    distance = np.linalg.norm(apart, axis=1)
    least = 1e-9 * np.ptp(points_I, axis=0).max()
    if distance.min() <= least:
        worst = ", ".join(f"{x:.6g}" for x in points_I[np.argmin(distance)])
        raise ConfigError(
            f"{place}.normal = nodes needs a distance between the nodes of a pair, but "
            f"{np.count_nonzero(distance <= least)} of {len(distance)} pairs coincide (distance "
            f"{distance.min():.3g} m at ({worst})); move the blocks apart by the gap, or use normal: face"
        )
    return apart / distance[:, None]


def _initial_gap(joint: JointConfig, position: Floats, folder: Path, place: str) -> Floats:
    if isinstance(joint.gap, GapTable):
        return table_gap(folder / joint.gap.table, position, f"{place}.gap.table")
    return np.full(len(position), joint.gap)


def _free_components(joint: Joint, fixed: dict[str, Bools], parts: Collection[Part]) -> Bools:
    """(2, k, 3) components that can change the jump at each node pair, on either side.

    Supports hold some; a pair that ties make one node, or let follow the same ones alike, has no jump at all.
    """
    free = np.stack([~fixed[block][nodes] for block, nodes in zip(joint.blocks, joint.nodes, strict=True)])
    for part in parts:
        if set(joint.blocks) <= set(part.blocks):
            free[:, part.together(joint.blocks, joint.nodes)] = False
    return free


def _without_held_gaps(joint: Joint, free: Bools, by: str, place: str) -> Joint:
    """Drop the gaps whose opening supports or ties keep at zero.

    Gaps that stay may see nodes that do not move: their weight is left out.
    """
    keep = _moves(joint, free[0]) | _moves(joint, free[1])
    if not keep.any():
        raise ConfigError(
            f"{place}: {by} hold all {len(keep)} gaps on both sides, so the joint can do nothing; "
            "remove the joint, or free one of its faces"
        )
    if not keep.all():
        _log.info(
            "%s: %d of %d gaps are held by %s on both sides and dropped", place, (~keep).sum(), len(keep), by
        )
    return _select(joint, np.flatnonzero(keep))


def _moves(joint: Joint, free: Bools) -> Bools:
    """Gaps whose normal sees a free component of a node with weight on this side."""
    seen = abs(joint.weights) @ free.astype(float) > _NOTHING
    return (seen & (np.abs(joint.axes[:, 0]) > _NOTHING)).any(axis=1)


def _select(joint: Joint, keep: Ints) -> Joint:
    """The joint with some of its gaps; where every node pair has one, with their node pairs only."""
    if len(keep) == len(joint.area):
        return joint
    pairs = keep if len(joint.nodes[0]) == len(joint.area) else np.arange(len(joint.nodes[0]))
    return Joint(
        name=joint.name,
        blocks=joint.blocks,
        nodes=(joint.nodes[0][pairs], joint.nodes[1][pairs]),
        position=joint.position[keep],
        area=joint.area[keep],
        axes=joint.axes[keep],
        weights=joint.weights[keep][:, pairs],
        gap=joint.gap[keep],
        K_n=joint.K_n[keep],
        K_nz=joint.K_nz[keep],
        K_s=joint.K_s[keep],
        mu=joint.mu[keep],
        viscosity=joint.viscosity[keep],
        laws=tuple(replace(rows, values=rows.values[keep], on=rows.on[keep]) for rows in joint.laws),
    )
