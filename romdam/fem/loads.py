"""Nodal forces of the static loads."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import LOAD_KINDS, Block, Hydrostatic, Ints, Scene
from romdam.fem.assembly import assemble_mass, inertia
from romdam.geometry.elements import Floats, jacobians
from romdam.geometry.facets import area_vectors
from romdam.geometry.meshes.kinds import kinds_of
from romdam.geometry.pressed_facets import force_below


def static_force(scene: Scene, block: str) -> Floats:
    """Nodal force on a block of the static loads that act with the joints as they are, (n, 3) [N]."""
    force = surface_force(scene, block)
    if scene.loads.gravity.any() and weight_acts(scene, block):
        force = force + weight_force(scene, block, assemble_mass(scene.blocks[block]))
    return force


def weight_acts(scene: Scene, block: str) -> bool:
    """Tell whether a block's weight acts with the joints as they are, not before they were grouted."""
    return not scene.loads.staged_weight and block not in scene.loads.excluded_from_gravity


def weight_force(scene: Scene, block: str, M: csr_matrix) -> Floats:
    """Nodal force of a block's weight, (n, 3) [N]; zero where it has acted before."""
    if block in scene.loads.excluded_from_gravity:
        return np.zeros_like(scene.blocks[block].points)
    return np.asarray(inertia(scene.blocks[block], M) @ scene.loads.gravity).reshape(-1, 3)


def surface_force(scene: Scene, block: str) -> Floats:
    """Nodal force of everything but weight on a block, (n, 3) [N]."""
    return np.asarray(sum(surface_forces(scene, block).values(), np.zeros_like(scene.blocks[block].points)))


def surface_forces(scene: Scene, block: str, *, thermal: bool = True) -> dict[str, Floats]:
    """Kind of load -> its nodal force on a block but for weight, (n, 3) [N].

    Pressure, still water, point forces, a change of temperature, and, as weight, what comes with the block's
    matrices; kinds without a load on the block are left out.
    """
    points, matrices = scene.blocks[block].points, scene.blocks[block].matrices
    kinds = {kind: np.zeros_like(points) for kind in LOAD_KINDS}
    if matrices is not None:
        kinds["weight"] += matrices.force.reshape(-1, 3)
    if thermal and block in scene.loads.warmed:
        kinds["temperature"] += thermal_force(scene.blocks[block], scene.loads.warmed[block])
    for water in scene.loads.water:
        if water.block == block:
            kinds["water"] += hydrostatic_force(points, water)
    for load in scene.loads.pressures:
        if load.block == block:
            kinds["forces"] += pressure_force(points, load.facets, load.value)
    for point_force in scene.loads.forces:
        if point_force.block == block:
            kinds["forces"][point_force.node] += point_force.force
    return {kind: force for kind, force in kinds.items() if force.any()}


def pressure_force(points: Floats, facets: Ints, pressure: float) -> Floats:
    """Consistent nodal force -p int N n dA of a pressure into the block, (n, 3) [N]; n is outward."""
    force = np.zeros_like(points)
    np.add.at(force, facets, -pressure * area_vectors(points, facets))
    return force


def thermal_force(block: Block, change: float | Floats) -> Floats:
    """Nodal force int B^T D alpha change dV of a change of temperature, (n, 3) [N].

    The expansion held back makes the stress -E alpha change / (1 - 2 nu) in all directions, with the E of
    loads that last.

    Parameters
    ----------
    change : of the whole block, or (n,) of its nodes, between which it follows the shape functions [K]
    """
    material, force = block.material.sustained, np.zeros_like(block.points)
    pressure = material.E * material.expansion * np.asarray(change) / (1.0 - 2.0 * material.nu)
    for element, _, cells in kinds_of(block.element, block.cells):
        xi, weight = element.rule
        jacobian = jacobians(block.points, cells, element, xi)
        gradient = np.linalg.solve(jacobian, element.gradient(xi)[None])
        volume = np.linalg.det(jacobian) * weight
        if pressure.ndim:
            volume = volume * (pressure[cells] @ element.shape(xi).T)
        nodal = np.einsum("cq,cqka->cak", volume, gradient, optimize=True)
        np.add.at(force, cells, nodal if pressure.ndim else pressure * nodal)
    return force


def hydrostatic_force(points: Floats, water: Hydrostatic) -> Floats:
    """Nodal force of still water on facets, (n, 3) [N]; those that the level cuts are integrated below it."""
    return force_below(points, water.facets, water.level, lambda depth: water.weight * depth)
