"""Nodal forces of the static loads."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.scene.elements import Floats
from romdam.scene.facets import area_vectors
from romdam.scene.model import Ints, Scene


def static_force(scene: Scene, block: str, M: csr_matrix) -> Floats:
    """Nodal force of pressure, weight and point forces on a block, (n, 3) [N].

    Parameters
    ----------
    M : (3 n, 3 n) mass of the block [kg]
    """
    points = scene.blocks[block].points
    return np.asarray((M @ np.tile(scene.gravity, len(points))).reshape(-1, 3) + surface_force(scene, block))


def surface_force(scene: Scene, block: str) -> Floats:
    """Nodal force of pressure and point forces on a block, without weight, (n, 3) [N]."""
    points = scene.blocks[block].points
    force = np.zeros_like(points)
    for load in scene.pressures:
        if load.block == block:
            force += pressure_force(points, load.facets, load.value)
    for point_force in scene.forces:
        if point_force.block == block:
            force[point_force.node] += point_force.force
    return force


def pressure_force(points: Floats, facets: Ints, pressure: float) -> Floats:
    """Consistent nodal force -p int N n dA of a pressure into the block, (n, 3) [N]; n is outward."""
    force = np.zeros_like(points)
    np.add.at(force, facets, -pressure * area_vectors(points, facets))
    return force
