"""Joints: gap elements between the faces of two blocks, with their local axes, areas and laws."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags_array, eye_array, hstack

from romdam.config.sections.joints import GapTable, JointConfig
from romdam.contact.laws import LAWS
from romdam.contact.laws.catalogue import find_law, source_of
from romdam.contact.laws.coulomb import Coulomb
from romdam.contact.laws.law import Law
from romdam.core.arrays import Bools, Ints
from romdam.core.errors import ConfigError, MeshError
from romdam.core.scene import Block, Joint, JointFace
from romdam.core.system import LawRows
from romdam.geometry.elements import Floats, facet_element, facet_frame
from romdam.geometry.facets import gap_weights, node_normals, second_moments
from romdam.geometry.meshes.kinds import facets_by_kind
from romdam.geometry.nearest import nearest
from romdam.scene.gap_table import table_gap
from romdam.scene.joint_stiffness import automatic_keys, element_stiffness, with_automatic_stiffness
from romdam.scene.mortar.gaps import FaceGaps, mortar_gaps
from romdam.scene.mortar.interface import mortar_interface
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.pairing import coincident_facets
from romdam.scene.patches import coarsen_gaps, mean_normal
from romdam.scene.strength_field import field_factors, scaled_keys
from romdam.scene.ties import Part

_log = logging.getLogger(__name__)

_TURNS = 0.25  # of a joint's stiffness against rotation, that its gaps may miss without a word
_PARTLY = 0.999  # share of both faces that is covered, below which it is said
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
    """Find the faces of two blocks that lie on each other and put gaps between them.

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
    location = f"{source}: joints.{name}"
    block_I, block_J = (blocks[b] for b in joint.between)
    face, surface = _face_gaps(joint, block_I, block_J, location)

    # compare the gaps of a narrow face with their bedding in stiffness against rotation
    side = joint.between.index(surface.block)
    exact, middle = second_moments(surface.points, surface.facets)
    away = face.weights[side] @ surface.points[face.nodes[side]] - middle
    inertia = away.T @ (face.area[:, None] * away)
    across = np.linalg.eigh(exact)[1][:, 1]  # of the face's plane, the narrow way
    share = float(across @ inertia @ across / (across @ exact @ across))
    if abs(share - 1.0) > _TURNS:
        _log.info(
            "%s: closed, the gaps have %.2f times the stiffness of their bedding against rotation over the "
            "narrow side of the face; more elements across it come nearer to 1",
            location, share,
        )  # fmt: skip

    axes = local_axes(_normals(joint, face, location))
    of_elements = (0.0, 0.0)
    if keys := automatic_keys(joint):
        mean = axes[:, 0].mean(axis=0)
        of_elements = element_stiffness(
            (block_I, block_J), face.nodes, mean / np.linalg.norm(mean), f"{location}.{keys[0]}"
        )
    every_gap = Joint(
        name=name,
        blocks=joint.between,
        nodes=face.nodes,
        position=face.position,
        area=face.area,
        share=np.zeros(len(face.area)),
        axes=axes,
        weights=face.weights,
        at_point=face.at_point,
        water=np.zeros(len(face.area)),
        face=_linear_face(surface, face.corner),
        corner=face.corner,
        element_stiffness=of_elements,
        **_properties(name, joint, face.area, face.position, folder, location, of_elements),
    )
    joint_of_nodes = _without_held_gaps(every_gap, fixed, parts, location)
    if not isinstance(joint.spacing, float):
        return joint_of_nodes
    # axes and a node that the order of the names does not change
    first = blocks[min(joint.between)]
    outward = mean_normal(joint_of_nodes) * (1.0 if joint.between[0] == first.name else -1.0)
    along = local_axes(outward[None])[0, 1:]
    at_first = joint_of_nodes.nodes[joint.between.index(first.name)]
    origin = first.points[int(at_first.min())]
    coarse = coarsen_gaps(joint_of_nodes, surface, joint.spacing, along, origin, location)
    nodes, gaps = len(joint_of_nodes.area), len(coarse.area)
    _log.info("%s: spacing %g m: %d gaps for %d nodes", location, joint.spacing, gaps, nodes)
    return replace(
        coarse, **_properties(name, joint, coarse.area, coarse.position, folder, location, of_elements)
    )


def _linear_face(surface: MortarSurface, corner: Ints) -> JointFace:
    """The facets of a surface, in the pieces that the nodes with gaps cut them into."""
    every, facets = bool(np.isin(surface.facets, corner).all()), []
    for _, facet_nodes, _ in facets_by_kind(surface.facets):
        element = facet_element(facet_nodes)
        pieces = element.pieces if every else (tuple(range(element.corners)),)
        kinds = {len(piece): [other for other in pieces if len(other) == len(piece)] for piece in pieces}
        facets += [np.concatenate([facet_nodes[:, list(p)] for p in kind]) for kind in kinds.values()]
    return JointFace(surface.block, tuple(facets))


def _face_gaps(
    joint: JointConfig, block_I: Block, block_J: Block, location: str
) -> tuple[FaceGaps, MortarSurface]:
    """Put gaps between two blocks as the joint's `discretization` has it; and the face that they stand on."""
    pairs = None
    if joint.discretization != "mortar":
        try:
            pairs = coincident_facets(block_I, block_J, joint.tolerance, location)
        except (ConfigError, MeshError):
            if joint.discretization == "node_to_node":
                raise
            _log.info("%s: the nodes of the two faces do not coincide; discretization: mortar", location)
    if pairs is not None:
        facets, partner = pairs
        quadratic = facet_frame(facets).quadratic
        # mortar takes facets of one kind
        prefers_mortar = quadratic and joint.gaps == "nodes" and len(facets_by_kind(facets)) == 1
        if joint.discretization == "auto" and prefers_mortar:
            _log.info("%s: the faces are quadratic; discretization: mortar", location)
        else:
            nodes, area, weights = gap_weights(block_I.points, facets, joint.gaps == "corners")
            corner = nodes
            if len(area) != len(nodes):
                corner = np.unique(facets[:, : facet_frame(facets).corners])
            at_point = csr_matrix(eye_array(len(nodes)))[np.searchsorted(nodes, corner)]
            gaps = FaceGaps(
                nodes=(nodes, partner[nodes]),
                position=block_I.points[corner],
                opposite=block_J.points[partner[corner]],
                normal=node_normals(block_I.points, facets)[corner],
                area=area,
                corner=corner,
                weights=(weights, weights),
                at_point=(at_point, at_point) if quadratic else None,
            )
            return gaps, MortarSurface(block_I.name, block_I.points, facets)

    interface = mortar_interface(block_I, block_J, joint.tolerance, joint.overlap, location)
    gaps = mortar_gaps(interface)
    slave, master = interface.slave, interface.master
    covered, faces = float(gaps.area.sum()), (float(slave.areas.sum()), float(master.areas.sum()))
    _log.info(
        "%s: mortar, %d gaps at the corners of %r against %r over %.6g m2, at most %.3g m apart",
        location, len(gaps.area), slave.block, master.block, covered, interface.apart,
    )  # fmt: skip
    if covered < _PARTLY * max(faces):
        _log.info(
            "%s: the faces lie on each other over %.6g m2, of facets of %.6g m2 of %r and %.6g m2 of %r",
            location, covered, faces[0], slave.block, faces[1], master.block,
        )  # fmt: skip
    return gaps, slave


def with_properties(joint: Joint, config: JointConfig, folder: Path, source: str) -> Joint:
    """The same gaps with the stiffness, friction, initial gap and further laws of another configuration.

    Raises
    ------
    ConfigError
        for a wrong gap table.
    """
    location = f"{source}: joints.{joint.name}"
    properties = _properties(
        joint.name, config, joint.area, joint.position, folder, location, joint.element_stiffness
    )
    loads = tuple(rows for rows in joint.laws if not find_law(rows.law).parameters)  # as water in cracks
    return replace(joint, **properties | {"laws": (*properties["laws"], *loads)})


def _properties(
    name: str,
    joint: JointConfig,
    area: Floats,
    position: Floats,
    folder: Path,
    location: str,
    of_elements: tuple[float, float],
) -> dict[str, Any]:
    """Fields of a `Joint` that depend on its parameters, and on the stiffness of the elements beside it."""
    automatic, joint = automatic_keys(joint), with_automatic_stiffness(joint, of_elements)
    keys = joint.law_keys
    for law in joint.every_law if automatic else ():  # what a number would have been asked before
        if wrong := law.wrong(keys):
            raise ConfigError(f"{location}: {wrong}")
    if isinstance(joint.gap, GapTable):
        gap = table_gap(folder / joint.gap.table, position, f"{location}.gap.table")
    else:
        gap = np.full(len(position), joint.gap)
    rows = partial(_rows, keys=keys, area=area)
    if joint.field is not None:
        at_gaps = _keys_at_gaps(name, joint, keys, position, location)
        rows = partial(_rows_of_gaps, at_gaps=at_gaps, area=area)
    everywhere = np.ones(len(area), dtype=np.bool_)
    return {
        "gap": gap,
        **{law.array: rows(law)[:, 0] for law in LAWS if law.array and law is not Coulomb},
        "mu": rows(Coulomb),
        "laws": tuple(
            LawRows(source_of(law), rows(law), everywhere, law.needs_shear(keys))
            for law in joint.every_law
            if not law.array
        ),
    }


def _rows(law: type[Law], keys: Mapping[str, Any], area: Floats) -> Floats:
    """Parameters of a law at every gap, (n, p)."""
    areas, which = np.unique(area, return_inverse=True)  # most gaps of a regular mesh have the same few
    return np.array([law.row(keys, float(each)) for each in areas])[which]


def _keys_at_gaps(
    name: str, joint: JointConfig, keys: Mapping[str, Any], position: Floats, location: str
) -> list[dict[str, Any]]:
    """Keys of the joint's laws at every gap, some of them a random field.

    Raises
    ------
    ConfigError
        for a field of what the joint has not, and where its laws do not take what a gap gets.
    """
    assert joint.field is not None
    at_gaps = []
    for place, factor in zip(position, field_factors(joint.field, position, name), strict=True):
        scaled = scaled_keys(keys, joint.field.of, float(factor), location)
        if wrong := next(filter(None, (law.wrong(scaled) for law in joint.every_law)), None):
            at = ", ".join(f"{x:.6g}" for x in place)
            raise ConfigError(
                f"{location}.field: the factor is {factor:.4g} at ({at}), where {wrong}; name both keys in "
                "field.of, or take a smaller coefficient_of_variation"
            )
        at_gaps.append(scaled)
    return at_gaps


def _rows_of_gaps(law: type[Law], at_gaps: Sequence[Mapping[str, Any]], area: Floats) -> Floats:
    """Parameters of a law at every gap, (n, p), from the keys of each."""
    return np.array([law.row(keys, float(each)) for keys, each in zip(at_gaps, area, strict=True)])


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


def _normals(joint: JointConfig, face: FaceGaps, location: str) -> Floats:
    """Unit normals (n, 3) from I to J, as the key `normal` asks for them."""
    if joint.normal == "face":
        return face.normal
    if joint.normal == "nodes":
        apart = face.opposite - face.position
        distance = np.linalg.norm(apart, axis=1)
        least = 1e-9 * np.ptp(face.position, axis=0).max()
        if distance.min() <= least:
            worst = ", ".join(f"{x:.6g}" for x in face.position[np.argmin(distance)])
            raise ConfigError(
                f"{location}.normal = nodes needs a distance between the nodes of a pair, but "
                f"{np.count_nonzero(distance <= least)} of {len(distance)} pairs coincide (distance "
                f"{distance.min():.3g} m at ({worst})); move the blocks apart by the gap, or use normal: face"
            )
        return apart / distance[:, None]
    vector = np.array(joint.normal)
    length = np.linalg.norm(vector)
    if length == 0.0:
        raise ConfigError(
            f"{location}.normal must have a length above 0, got [0, 0, 0]; give its direction from I to J"
        )
    cosine = face.normal @ vector / length
    if cosine.min() <= 0.0:
        raise ConfigError(
            f"{location}.normal must point from block {joint.between[0]!r} to {joint.between[1]!r}, but at "
            f"{np.count_nonzero(cosine <= 0.0)} of {len(cosine)} gaps its cosine with the face normal is "
            f"{cosine.min():.3g} or more, limit above 0; reverse it, or use normal: face"
        )
    return np.tile(vector / length, (len(face.normal), 1))


def _without_held_gaps(
    joint: Joint, fixed: dict[str, Bools], parts: Collection[Part], location: str
) -> Joint:
    """Drop the gaps that cannot open, since supports or ties keep what they see of both sides together.

    The nearest gap that can has their share of the joint's area: a gap that cannot open bears no load
    that moves anything.
    """
    keep = _moves(joint, fixed, parts)
    by = "supports or ties" if any(set(joint.blocks) <= set(part.blocks) for part in parts) else "supports"
    if not keep.any():
        raise ConfigError(
            f"{location}: {by} hold all {len(keep)} gaps on both sides, so the joint can do nothing; "
            "remove the joint, or free one of its faces"
        )
    if not keep.all():
        _log.info(
            "%s: %d of %d gaps are held by %s on both sides and dropped",
            location, (~keep).sum(), len(keep), by,
        )  # fmt: skip
    taker = nearest(joint.position[keep], joint.position[~keep])[1]
    share = np.zeros(int(keep.sum()))
    np.add.at(share, taker, joint.area[~keep])
    return replace(_select(joint, np.flatnonzero(keep)), share=share)


def _moves(joint: Joint, fixed: dict[str, Bools], parts: Collection[Part]) -> Bools:
    """Gaps whose normal jump a free component of some node changes, as ties let the nodes move."""
    parts_of = [next((part for part in parts if block in part.blocks), None) for block in joint.blocks]
    spread = []  # matrices that take the DOFs of either block from independent ones
    for block, part in zip(joint.blocks, parts_of, strict=True):
        held = fixed[block] if part is None else part.fixed(fixed)
        matrix = eye_array(held.size, format="csr") if part is None else part.spread(block)
        spread.append(csr_matrix(matrix @ diags_array((~held.ravel()).astype(float))))
    same = parts_of[0] is not None and parts_of[0] is parts_of[1]  # independent DOFs of both blocks
    moves = np.zeros(len(joint.area), dtype=bool)
    for axis in range(3):
        seen_I, seen_J = (
            weights @ csr_matrix(rows[3 * nodes + axis])
            for weights, rows, nodes in zip(joint.weights, spread, joint.nodes, strict=True)
        )
        seen = seen_J - seen_I if same else hstack([seen_I, seen_J])
        changes = abs(seen).max(axis=1).toarray().ravel()
        moves |= (changes > _NOTHING) & (np.abs(joint.axes[:, 0, axis]) > _NOTHING)
    return moves


def _select(joint: Joint, keep: Ints) -> Joint:
    """The joint with some of its gaps, and with the nodes that these see."""
    if len(keep) == len(joint.area):
        return joint
    operators = [joint.weights, *([] if joint.at_point is None else [joint.at_point])]
    rows = [[csr_matrix(side[keep]) for side in operator] for operator in operators]
    seen = [np.unique(np.concatenate([side.indices for side in sides])) for sides in zip(*rows, strict=True)]
    cut = [tuple(side[:, s] for side, s in zip(sides, seen, strict=True)) for sides in rows]
    laws = tuple(replace(each, values=each.values[keep], on=each.on[keep]) for each in joint.laws)
    of_gaps = (
        "position", "corner", "area", "share", "axes", "gap", "K_n", "K_nz", "K_s", "mu", "viscosity",
        "grout", "water",
    )  # fmt: skip
    return replace(
        joint,
        nodes=(joint.nodes[0][seen[0]], joint.nodes[1][seen[1]]),
        weights=cut[0],
        at_point=None if joint.at_point is None else cut[1],
        laws=laws,
        **{name: getattr(joint, name)[keep] for name in of_gaps},
    )
