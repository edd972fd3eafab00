"""The faces of a joint against the surface that it is to follow."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import MeshError
from romdam.scene.cutting.mesh import Facets, Mesh
from romdam.scene.cutting.moving import kept_facets, shift_onto, with_shift
from romdam.scene.cutting.surfaces import Surface
from romdam.scene.facets import facet_element, facet_normals

log = logging.getLogger(__name__)

_REMEDY = {
    False: "cut `through: elements`, mesh with element faces along the surface",
    True: "the surface bends too much for these elements: mesh finer",
}


class Step(NamedTuple):
    """One cut: its surface, whether elements are cut, teeth allowed in edges of a facet, file and key."""

    surface: Surface
    through_elements: bool
    teeth: float
    place: str


def joint_facets(facets: Facets, mesh: Mesh, labels: Ints, number: int) -> Ints:
    """Numbers of the facets between blocks that a surface parts; of each two that are one, the first.

    Parameters
    ----------
    labels : (nc,) block of every cell
    number : of the surface, a column of the sides
    """
    one, other = facets.pairs.T
    a, b = facets.cell[one], facets.cell[other]
    return one[(labels[a] != labels[b]) & (mesh.sides[a, number] != mesh.sides[b, number])]


def refuse_teeth(mesh: Mesh, joint: Ints, step: Step) -> None:
    """Raise if facets of a joint are farther from its surface than a share of their size.

    Parameters
    ----------
    joint : (nf, nodes per facet)

    Raises
    ------
    MeshError
        with the worst place, its distance, and the largest angle between a facet and the surface.
    """
    corners = mesh.points[joint[:, : facet_element(joint).corners]]
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    samples = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
    _refuse_rim(step, samples, size)
    off = np.abs(step.surface.distance(samples.reshape(-1, 3))).reshape(len(joint), -1)
    share = off.max(axis=1) / size
    if share.max() <= step.teeth:
        return
    worst = int(np.argmax(share))
    cosine = np.abs(
        np.einsum("fk,fk->f", facet_normals(mesh.points, joint), step.surface.normal(samples[:, -1]))
    )
    angle = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
    at = ", ".join(f"{x:.6g}" for x in samples[worst, np.argmax(off[worst])])
    raise MeshError(
        f"{step.place}: the joint would be saw-toothed, and its teeth act as keys: "
        f"{np.count_nonzero(share > step.teeth)} of its {len(joint)} faces are off the surface by more than "
        f"{step.teeth:g} of their edges, the worst by {off[worst].max():.4g} m = {share[worst]:.3g} edges, "
        f"at ({at}) m; faces stand at up to {angle.max():.3g} degrees to it; "
        f"{_REMEDY[step.through_elements]}, or allow more `teeth`"
    )


def _refuse_rim(step: Step, samples: Floats, size: Floats) -> None:
    beyond = step.surface.beyond(samples.reshape(-1, 3)).reshape(len(size), -1)
    share = beyond.max(axis=1) / size
    if share.max() > step.teeth:
        worst = int(np.argmax(share))
        at = ", ".join(f"{x:.6g}" for x in samples[worst, np.argmax(beyond[worst])])
        raise MeshError(
            f"{step.place}: the surface ends within the block: the joint at ({at}) m lies "
            f"{beyond[worst].max():.4g} m beyond its rim, limit {step.teeth:g} of an edge = "
            f"{step.teeth * size[worst]:.4g} m ({np.count_nonzero(share > step.teeth)} of {len(size)} faces)"
            "; make the surface reach through the block"
        )


def smoothed(mesh: Mesh, facets: Facets, joint: Ints, number: int, step: Step) -> Mesh:
    """Move the nodes of a joint onto its surface, along other joints and the faces of the block.

    Parameters
    ----------
    joint : (nf, nodes per facet)
    number : of the surface, a column of the sides
    """
    kept = kept_facets(mesh, facets, but=number)
    shift = shift_onto(mesh, step.surface, np.unique(joint[:, : facets.corners]), kept)
    moved = with_shift(mesh, shift)
    more = shift_onto(moved, step.surface, np.unique(joint[:, facets.corners :]), kept)
    far = np.linalg.norm(shift + more, axis=1)
    if far.any():
        log.info(
            "%s: %d of %d nodes of the joint moved onto the surface, by up to %.3g m",
            step.place, np.count_nonzero(far), len(np.unique(joint)), far.max(),
        )  # fmt: skip
    return replace(moved, points=moved.points + more)
