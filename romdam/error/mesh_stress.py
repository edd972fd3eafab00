"""What the mesh changes in the stress on faces, and in the forces on sections.

A face is compared by the values of its envelopes that PERCENTILES of its area do not exceed, those that users
quote. Stress at re-entrant edges has no limit, so both meshes leave the same region out: the ring of the mesh
whose error is stated, which keeps its length in metres where that is one element.

Outside the ring, stress recovered at nodes is nearly as accurate as displacement, so its error is the
multiple of the difference that `romdam.error.discretisation` takes for all quantities. But a percentile is
the stress of one node, and jumps to another where the mesh changes: those of two meshes may agree by chance.
So the error of the HEADLINE % value is stated as no less than that of all values in L2.

A section is the same plane in both meshes, whether or not their elements end there, see
`romdam.scene.stress.sections`. Its forces balance loads and inertia, and so they converge as displacements.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from romdam.core.arrays import Bools, Floats
from romdam.core.scene import Scene
from romdam.error.metrics import FLOOR, RelativeError, from_rest, magnitude_error, relative_l2, scaled
from romdam.postprocess.stress.faces import HEADLINE, PERCENTILES, area_percentiles
from romdam.postprocess.stress.summary import MEASURES, StressSummary
from romdam.scene.stress.ring import near_edges

COMPARED = PERCENTILES[PERCENTILES < 100.0]  # the largest value is that of a node, whose position moves


@dataclass(frozen=True)
class FaceStress:
    """Envelope of the stress at the k nodes of a face.

    Attributes
    ----------
    points : (k, 3) [m]
    area : (k,) that each stands for [m2]
    contact : (k,) True where the node is left out for a contact nearby
    largest : measure -> (k,) largest stress over time [Pa]
    """

    points: Floats
    area: Floats
    contact: Bools
    largest: Mapping[str, Floats]


@dataclass(frozen=True)
class MeshStress:
    """Stress of a run on one mesh.

    Attributes
    ----------
    faces : name -> its stress
    ring_ends, ring_radius : (s, 2, 3), (s,) of the ring around singular edges [m]
    sections : name -> (nt, 6) forces along the section's axes and moments about them [N], [N m]
    """

    faces: Mapping[str, FaceStress]
    ring_ends: Floats
    ring_radius: Floats
    sections: Mapping[str, Floats]


def mesh_stress(scene: Scene, summary: StressSummary | None) -> MeshStress | None:
    """Put together what is compared of the stress of a run; None without stress."""
    sites = scene.stress
    if sites is None or summary is None:
        return None
    counts = [len(nodes.nodes) for nodes in sites.blocks.values()]
    first = dict(zip(sites.blocks, np.cumsum([0, *counts[:-1]]), strict=True))
    faces = {}
    for face in sites.faces:
        nodes, rows = sites.blocks[face.block], first[face.block] + face.rows
        contact = np.zeros(len(nodes.nodes), dtype=bool) if nodes.contact is None else nodes.contact
        faces[face.name] = FaceStress(
            points=scene.blocks[face.block].points[nodes.nodes[face.rows]],
            area=face.area,
            contact=contact[face.rows],
            largest={measure: summary.largest[measure][rows] for measure in MEASURES},
        )
    sections = {section.name: summary.sections[:, k] for k, section in enumerate(sites.sections)}
    return MeshStress(faces, sites.ring_ends, sites.ring_radius, sections)


def face_errors(
    judged: MeshStress, better: MeshStress, ring: MeshStress, factor: float
) -> tuple[dict[str, RelativeError], dict[str, dict[str, dict[str, object]]]]:
    """Compare the percentiles of faces.

    Parameters
    ----------
    ring : the one of the two whose ring both leave out
    factor : of the error over the difference

    Returns
    -------
    errors : quantity -> error of all faces: `l2` of the values of COMPARED, `peak` that of the HEADLINE %
        values, the largest of all faces relative to the largest value, and `l2` at least
    faces : face -> quantity -> the same of the face, and under `percentiles` each value of COMPARED; without
        quantities where the ring covers the face in either mesh. A face with less than FLOOR of the largest
        HEADLINE % value is measured by that
    """
    errors = dict[str, RelativeError]()
    faces = {name: dict[str, dict[str, object]]() for name in judged.faces}
    headline = int(np.flatnonzero(COMPARED == HEADLINE)[0])
    for measure in MEASURES:
        tables = {}
        for name, face in judged.faces.items():
            pair = [_percentiles(one, measure, ring) for one in (face, better.faces[name])]
            if np.isfinite(pair).all():
                tables[name] = pair
        if not tables:
            continue
        values, wanted = np.moveaxis(np.array(list(tables.values())), 1, 0)  # (faces, percentiles) each
        largest, off = float(np.abs(wanted[:, headline]).max()), factor * np.abs(values - wanted)
        size = np.maximum(np.abs(wanted), FLOOR * largest)
        each = np.divide(off, size, out=np.zeros_like(size), where=size > 0.0)
        quantity = f"{measure}_stress"
        for k, name in enumerate(tables):
            l2 = factor * relative_l2(values[k], wanted[k], FLOOR * largest)
            faces[name][quantity] = {
                "l2": l2,
                "peak": max(float(each[k, headline]), l2),
                "percentiles": {f"{p:g}": float(error) for p, error in zip(COMPARED, each[k], strict=True)},
            }
        peak = float(off[:, headline].max()) / largest if largest > 0.0 else 0.0
        l2 = factor * relative_l2(values, wanted)
        errors[quantity] = RelativeError(l2, max(peak, l2))
    return errors, faces


def _percentiles(face: FaceStress, measure: str, ring: MeshStress) -> Floats:
    """Values of COMPARED outside a ring and away from contacts; NaN where nothing is left [Pa]."""
    counted = ~(face.contact | near_edges(face.points, ring.ring_ends, ring.ring_radius))
    return area_percentiles(face.largest[measure][counted], face.area[counted], COMPARED)


def section_errors(
    judged: MeshStress, better: MeshStress, factor: float
) -> tuple[dict[str, RelativeError], dict[str, dict[str, dict[str, object]]]]:
    """Compare the histories of forces and moments on sections.

    Parameters
    ----------
    factor : of the error over the difference

    Returns
    -------
    errors : "section_force" and "section_moment" -> error of all sections, each a vector of three components
    sections : section -> "normal_force", "shear_force" and "moment" -> the same of the section. A component
        that is less than FLOOR of all of them is measured by that
    """
    if not judged.sections:
        return {}, {}
    names = list(judged.sections)
    values, wanted = (
        np.stack([stress.sections[name] for name in names], axis=1) for stress in (judged, better)
    )
    values, wanted = from_rest(values, wanted)
    components = {"section_force": slice(0, 3), "section_moment": slice(3, 6)}
    errors = {
        quantity: scaled(magnitude_error(values[..., c], wanted[..., c], peaks=True), factor)
        for quantity, c in components.items()
    }
    sections: dict[str, dict[str, dict[str, object]]] = {name: {} for name in names}
    # what each is measured by where it is less than FLOOR of that
    parts = {"normal_force": (slice(0, 1), slice(0, 3)), "shear_force": (slice(1, 3), slice(0, 3))}
    parts["moment"] = (slice(3, 6), slice(3, 6))
    for k, name in enumerate(names):
        for quantity, (c, scale) in parts.items():
            error = magnitude_error(values[:, k, c], wanted[:, k, c], wanted[:, k, scale], peaks=True)
            sections[name][quantity] = scaled(error, factor).plain
    return errors, sections
