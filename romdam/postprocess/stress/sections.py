"""Forces on sections over time, and the stress that is linear over them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.scene import Section

AXES = ("normal", "first", "second")
SIDES = ("first low", "first high", "second low", "second high")


def section_forces(blocks: Iterable[tuple[Floats, Floats, Floats]]) -> Floats:
    """Forces on all sections over time, (nt, sections, 6) [N], [N m].

    Parameters
    ----------
    blocks : of each its coordinates (nt, m), their forces (sections, 6, m) and the offset (sections, 6)
    """
    shares = (np.tensordot(q, forces, axes=(1, 2)) + offset for q, forces, offset in blocks)
    return np.asarray(sum(shares))


def gap_section_forces(operator: Floats, contact: Floats, water: Iterable[Floats]) -> Floats:
    """Share of the joints in the forces on all sections over time, (nt, sections, 6) [N], [N m].

    Parameters
    ----------
    operator : (6 sections, d * ng) of all forces in the gaps
    contact : (nt, ng, d) along normal and tangents, on side J [N]
    water : each (nt, ng) or (ng,), along the normals; or empty [N]
    """
    forces = contact.copy()
    for force in water:
        if force.size:
            forces[..., 0] += force
    return np.asarray(forces.reshape(len(forces), -1) @ operator.T).reshape(len(forces), -1, 6)


def linearised_stress(section: Section, forces: Floats) -> Floats:
    """Normal stress N/A + k . y at a section's sides, where y lies in the plane, from the centroid.

    With J = int y y^T dA the moments are M_1 = int y_2 sigma dA = (J k)_2 and M_2 = -int y_1 sigma dA =
    -(J k)_1, whatever the directions of the axes.

    Parameters
    ----------
    forces : (nt, 6) forces along, then moments about the section's axes [N], [N m]

    Returns
    -------
    (nt, 4) tension positive [Pa]
    """
    moments = np.stack([-forces[:, 5], forces[:, 4]])
    slope = np.linalg.solve(section.inertia, moments)
    y = (section.sides - section.centroid) @ section.axes[1:].T
    return np.asarray(forces[:, :1] / section.area + (y @ slope).T)
