"""The faces of a joint against the surface that it is to follow."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import MeshError
from romdam.geometry.cutting.mesh import Facets, Mesh
from romdam.geometry.cutting.moving import NEAR, shift_onto, with_shift
from romdam.geometry.cutting.surfaces import CuttingSurface
from romdam.geometry.facets import facet_element, facet_normals

_REMEDY = {
    False: "cut `through: elements`, mesh with element faces along the surface",
    True: "the surface bends too much for these elements: mesh finer",
}


class Step(NamedTuple):
    """One cut: its surface, whether elements are cut, teeth allowed in edges of a facet, file and key."""

    surface: CuttingSurface
    through_elements: bool
    teeth: float
    location: str


def joint_facets(mesh: Mesh, facets: Facets, labels: Ints, steps: list[Step]) -> list[Ints]:
    """Numbers of the facets between blocks, for every surface; of each two that coincide, the first.

    A facet is of the surface that parts its cells; where several do, of the nearest.

    Parameters
    ----------
    labels : (nc,) block of every cell
    """
    first_facet = facets.pairs[:, 0]
    a, b = facets.cell[facets.pairs].T
    first_facet, a, b = (each[labels[a] != labels[b]] for each in (first_facet, a, b))
    parting = mesh.sides[a] != mesh.sides[b]
    away = np.full(parting.shape, np.inf)
    for k, step in enumerate(steps):
        corners, _ = _corners(mesh, facets.rows[first_facet[parting[:, k]]])
        far = np.abs(step.surface.distance(corners.reshape(-1, 3))).reshape(corners.shape[:2])
        away[parting[:, k], k] = far.max(axis=1)
    owner = np.argmin(away, axis=1)
    return [first_facet[owner == k] for k in range(len(steps))]


def refuse_teeth(mesh: Mesh, joint: Ints, step: Step) -> None:
    """Raise if facets of a joint are farther from its surface than a share of their size.

    Parameters
    ----------
    joint : (nf, nodes per facet)

    Raises
    ------
    MeshError
        with the position of the worst, its distance, and the largest angle between a facet and the surface.
    """
    corners, size = _corners(mesh, joint)
    samples = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
    beyond = step.surface.beyond(samples.reshape(-1, 3)).reshape(len(size), -1)
    share = beyond.max(axis=1) / size
    if share.max() > step.teeth:
        worst = int(np.argmax(share))
        at = ", ".join(f"{x:.6g}" for x in samples[worst, np.argmax(beyond[worst])])
        raise MeshError(
            f"{step.location}: the surface ends within the block: the joint at ({at}) m lies "
            f"{beyond[worst].max():.4g} m beyond its rim, limit {step.teeth:g} of an edge = "
            f"{step.teeth * size[worst]:.4g} m ({np.count_nonzero(share > step.teeth)} of {len(size)} "
            "faces); make the surface reach through the block"
        )
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
        f"{step.location}: the joint would be saw-toothed, and its teeth act as keys: "
        f"{np.count_nonzero(share > step.teeth)} of its {len(joint)} faces are off the surface by more than "
        f"{step.teeth:g} of their edges, the worst by {off[worst].max():.4g} m = {share[worst]:.3g} edges, "
        f"at ({at}) m; faces stand at up to {angle.max():.3g} degrees to it; "
        f"{_REMEDY[step.through_elements]}, or allow more `teeth`"
    )


def _corners(mesh: Mesh, joint: Ints) -> tuple[Floats, Floats]:
    """Corners of facets (nf, corners, 3), and the mean length of their edges (nf,) [m]."""
    corners = mesh.points[joint[:, : facet_element(joint).corners]]
    return corners, np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)


def smoothed(mesh: Mesh, joint: Ints, kept: Ints, step: Step) -> Mesh:
    """Move the nodes of a joint onto its surface, along other joints and the faces of the block.

    Parameters
    ----------
    joint : (nf, nodes per facet)
    kept : (nf, nodes per facet) facets of other joints and of the boundary
    """
    corners = facet_element(joint).corners
    reach = np.full(len(mesh.points), np.inf)
    np.minimum.at(reach, joint, NEAR * _corners(mesh, joint)[1][:, None])
    shift = shift_onto(mesh, step.surface, np.unique(joint[:, :corners]), kept, reach)
    moved = with_shift(mesh, shift)
    more = shift_onto(moved, step.surface, np.unique(joint[:, corners:]), kept, reach)
    return replace(moved, points=moved.points + more)
