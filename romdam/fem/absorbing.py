"""Viscous boundary of a rock mass: dashpots that take waves up, and springs for the rock that is left out.

A plane wave that meets a face along its normal feels no boundary where the face answers with the tractions
rho c_p and rho c_s times the velocity. What lies beyond also carries static load: a source at a distance R
inside an infinite body is held by 4/3 G/R along the normal and 2/3 G/R across it.

Displacement of the rock is relative to the ground's own waves, which it would carry without the dam and which
the record is taken to show all along the contact. They satisfy the rock's equations by themselves, so
that the ground's acceleration acts on the dam's mass alone, and what is left in the rock are waves that the
dam sends out: the boundary acts on those. (A column that is shaken itself, relative to an outcrop, gives the
same: the tractions which send a wave in cancel those of the dashpots for the outcrop's motion.)

References
----------
Lysmer, Kuhlemeyer, J. Eng. Mech. Div. ASCE 95 (1969) 859; Liu, Du, Du, Wang, Wu, Earthq. Eng. Eng. Vib. 5
(2006) 93 (springs).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import Absorbing, Block
from romdam.fem.material import lame
from romdam.geometry.elements import facet_element
from romdam.geometry.facets import area_elements
from romdam.geometry.meshes.kinds import facets_by_kind

_ALONG, _ACROSS = 4.0 / 3.0, 2.0 / 3.0  # springs, in units of G / R


def boundary_springs(block: Block) -> csr_matrix:
    """Stiffness of what lies beyond a block's absorbing faces, (3 n, 3 n) [N/m]."""
    total = csr_matrix((3 * len(block.points),) * 2)
    shear = lame(block.material)[1]
    for face in block.absorbing:
        unit = shear / face.distance
        total = total + _face_matrix(block, face, _ALONG * unit, _ACROSS * unit)
    return csr_matrix(total)


def boundary_dashpots(block: Block) -> csr_matrix:
    """Damping of a block's absorbing faces, (3 n, 3 n) [N s/m]."""
    total = csr_matrix((3 * len(block.points),) * 2)
    lam, mu = lame(block.material)
    rho = block.material.rho
    for face in block.absorbing:
        total = total + _face_matrix(block, face, np.sqrt(rho * (lam + 2.0 * mu)), np.sqrt(rho * mu))
    return csr_matrix(total)


def _face_matrix(block: Block, face: Absorbing, along: float, across: float) -> csr_matrix:
    """int N_a N_b (along n n^T + across (I - n n^T)) dA over a face."""
    size = 3 * len(block.points)
    total = csr_matrix((size, size))
    for _, facets, _ in facets_by_kind(face.facets):
        element = facet_element(facets)
        xi, weight = element.rule_of(3 if element.box else 4)
        shape = element.shape(xi)
        vectors = area_elements(block.points, facets, xi)
        area = np.linalg.norm(vectors, axis=2)
        normal = vectors / area[..., None]
        projector = normal[..., :, None] * normal[..., None, :]
        traction = across * np.eye(3) + (along - across) * projector
        blocks = np.einsum("fq,qa,qb,fqij->faibj", weight * area, shape, shape, traction, optimize=True)
        dof = 3 * facets[:, :, None] + np.arange(3)
        rows = np.broadcast_to(dof[:, :, :, None, None], blocks.shape)
        columns = np.broadcast_to(dof[:, None, None], blocks.shape)
        total = total + csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
    return csr_matrix(total)
