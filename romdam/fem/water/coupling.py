"""Walls of a reservoir on solids, whose meshes need not match: segments couple them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import Block, WetFace
from romdam.fem.material import lame
from romdam.fem.water.body import vector_operator
from romdam.geometry.elements import Floats
from romdam.scene.mortar.segments import integrand_degree, samples
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.reservoir.walls import lying_on

_CHUNK = 4096  # triangles at a time


def wall_couplings(
    walls: MortarSurface, faces: Iterable[WetFace], blocks: Mapping[str, Block]
) -> dict[str, csr_matrix]:
    """(nodes, 3 * nodes of the block) of every block: int N n . N_u dA, with n into the water [m2].

    Parameters
    ----------
    walls : of the water, outward
    faces : of solids that the walls may lie on
    """
    couplings: dict[str, csr_matrix] = {}
    for face in faces:
        solid = MortarSurface(face.block, blocks[face.block].points, face.facets)
        degree = integrand_degree(walls, solid, walls.element.name)
        at = samples(walls, solid, lying_on(walls, solid), degree)
        shape = len(walls.points), len(solid.points)
        total = csr_matrix((shape[0], 3 * shape[1]))
        for first in range(0, len(at.slave), _CHUNK):
            some = slice(first, first + _CHUNK)
            rows, nodes = walls.facets[at.slave[some]], solid.facets[at.master[some]]
            xi, xi_solid = at.xi_slave[some], at.xi_master[some]
            pressure = walls.element.shape(xi.reshape(-1, 2)).reshape(*xi.shape[:2], -1)
            motion = solid.element.shape(xi_solid.reshape(-1, 2)).reshape(*xi_solid.shape[:2], -1)
            slope = walls.element.gradient(xi.reshape(-1, 2)).reshape(*xi.shape[:2], 2, -1)
            tangents = np.einsum("nqda,nak->nqdk", slope, walls.points[rows], optimize=True)
            normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
            into = -np.asarray(normal / np.linalg.norm(normal, axis=2, keepdims=True))
            values = np.einsum("nq,nqa,nqb,nqk->nabk", at.weight[some], pressure, motion, into, optimize=True)
            total = total + vector_operator(rows[:, :, None], nodes[:, None, :], values, shape)
        Q = csr_matrix(total)
        couplings[face.block] = csr_matrix(couplings[face.block] + Q) if face.block in couplings else Q
    return couplings


def yielding_of_rock(walls: MortarSurface, rock: Iterable[WetFace], blocks: Mapping[str, Block]) -> Floats:
    """Mean of 1 / (rho c_p) over each wall (nf,), by which rock without end gives way to pressure [m2 s/kg].

    It is 0 where the wall does not lie on rock, and where that has no mass.
    """
    total = np.zeros(len(walls.facets))
    for face in rock:
        block = blocks[face.block]
        lam, mu = lame(block.material)
        impedance = np.sqrt(block.material.rho * (lam + 2.0 * mu))
        if impedance > 0.0:
            between = lying_on(walls, MortarSurface(face.block, block.points, face.facets))
            total += np.bincount(between.slave, between.area, len(total)) / impedance
    return np.asarray(total / walls.areas)
