"""Nodes where stress is wanted, and the cantilever and arch directions there."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from romdam.config.sections.stress import StressConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import MOST_RING, Block, Bools, Ints, Joint, StressFace, StressNodes, StressSites, Tie
from romdam.geometry.facets import gap_weights, node_normals
from romdam.scene.select import nearest_node, select_facets
from romdam.scene.stress.ring import near_contacts, near_edges, singular_edges
from romdam.scene.stress.sections import build_section

_log = logging.getLogger(__name__)

_NO_NODES = np.zeros(0, dtype=np.int64)
_UP = np.array([0.0, 0.0, 1.0])
_LEVEL = 1e-6  # length of a unit normal's horizontal part below which it has no direction


@dataclass(frozen=True)
class Structure:
    """Structure: blocks and joints by name, ties, and block name -> (n, 3) True where a support holds."""

    blocks: dict[str, Block]
    joints: dict[str, Joint]
    ties: tuple[Tie, ...]
    fixed: dict[str, Bools]


def stress_sites(config: StressConfig | None, structure: Structure, location: str) -> StressSites | None:
    """Find the nodes where stress is wanted.

    Parameters
    ----------
    location : file and key, for messages

    Raises
    ------
    ConfigError
        for faces and points that catch no node, and a face given twice.
    """
    if config is None:
        return None
    blocks, joints = structure.blocks, structure.joints
    whole = list(blocks) if config.blocks == "all" else list(config.blocks)
    faces = []
    for k, face in enumerate(config.faces):
        facets = select_facets(blocks[face.block], face.face, f"{location}.faces[{k}].face")
        plane = face.face if isinstance(face.face, str) else f"{face.face.axis}={face.face.at:g}"
        faces.append((face.block, f"{face.block}.{plane}", facets))
    names = [name for _, name, _ in faces]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"{location}.faces: face {name} is given {names.count(name)} times, limit 1")
    probes = {
        name: (p.block, nearest_node(blocks[p.block], p.at, p.tolerance, f"{location}.nodes.{name}.at"))
        for name, p in config.nodes.items()
    }
    sections = tuple(
        build_section(name, section, blocks, structure.ties, f"{location}.sections.{name}")
        for name, section in config.sections.items()
    )
    sites = {}
    for name, block in blocks.items():
        wanted = [np.arange(len(block.points))] if name in whole else []
        wanted += [facets.ravel() for owner, _, facets in faces if owner == name]
        wanted += [np.array([node]) for owner, node in probes.values() if owner == name]
        if wanted or any(name in section.step for section in sections):
            block_facets = [facets for owner, _, facets in faces if owner == name]
            sites[name] = _with_axes(
                block, np.unique(np.concatenate([_NO_NODES, *wanted])), block_facets, joints
            )

    # nodes in the rings around singular edges and contacts
    links: list[Joint | Tie] = [*joints.values(), *structure.ties]
    ends, depth = singular_edges(blocks, links, structure.fixed)
    radius = depth if config.ring.edges is None else np.full(len(depth), config.ring.edges)
    for name, nodes in sites.items():
        held = np.asarray(structure.fixed[name].any(axis=1))
        contact = near_contacts(blocks[name], nodes.nodes, joints.values(), held, config.ring.contacts)
        ring = near_edges(blocks[name].points[nodes.nodes], ends, radius) | contact
        sites[name] = replace(nodes, ring=ring, contact=contact)

    stress_faces = []
    for owner, name, facets in faces:
        face_nodes, *_, area, _ = gap_weights(blocks[owner].points, facets)
        stress_faces.append(StressFace(name, owner, np.searchsorted(sites[owner].nodes, face_nodes), area))
    stress = StressSites(
        blocks=sites,
        faces=tuple(stress_faces),
        probes={name: (b, int(np.searchsorted(sites[b].nodes, n))) for name, (b, n) in probes.items()},
        strength=config.strength,
        sections=sections,
        ring_ends=ends,
        ring_radius=radius,
    )
    shares = zip(stress.faces, stress.ring_shares, strict=True)
    mostly = [f"{face.name} ({100 * share:.3g} %)" for face, share in shares if share > MOST_RING]
    if mostly and config.strength is not None:
        _log.warning(
            "%s.ring: it leaves out more than %g %% of the area of %s, so that no acceptance is stated "
            "there; refine the mesh, or give ring.edges a smaller length",
            location, 100 * MOST_RING, ", ".join(mostly),
        )  # fmt: skip
    return stress


def _with_axes(block: Block, nodes: Ints, faces: list[Ints], joints: dict[str, Joint]) -> StressNodes:
    """Axes from the stress faces' normals; off them the vertical, and across the nearest joints.

    Across the joints are their horizontal normals, weighted by the inverse distance to each joint's mean
    plane. Between two radial joints that turns evenly from one normal to the other.
    """
    up = np.tile(_UP, (len(nodes), 1))
    total = np.zeros((len(nodes), 3))
    for joint in joints.values():
        if block.name not in joint.blocks:
            continue
        normal = joint.axes[:, 0].mean(axis=0) * [1.0, 1.0, 0.0]
        if np.linalg.norm(normal) <= _LEVEL:
            continue  # a horizontal joint
        normal /= np.linalg.norm(normal)
        if total.any() and normal @ total.sum(axis=0) < 0.0:
            normal = -normal
        distance = np.abs((block.points[nodes] - joint.position.mean(axis=0)) @ normal)
        total += normal / (distance + 1e-6 * np.ptp(block.points, axis=0).max())[:, None]
    length = np.linalg.norm(total, axis=1, keepdims=True)
    arch = np.divide(total, length, out=np.full_like(total, np.nan), where=length > 0.0)

    for facets in faces:
        rows = np.searchsorted(nodes, np.unique(facets))
        normal = node_normals(block.points, facets)[nodes[rows]]
        tangent = np.cross(_UP, normal)
        steep = np.linalg.norm(tangent, axis=1) > _LEVEL  # a horizontal face has no arch direction
        rows, normal, tangent = rows[steep], normal[steep], tangent[steep]
        arch[rows] = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
        up[rows] = np.cross(normal, arch[rows])
    return StressNodes(nodes, up, arch)
