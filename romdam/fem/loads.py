"""Nodal forces of the static loads."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import LOAD_KINDS, Block, Hydrostatic, Ints, Scene
from romdam.fem.assembly import assemble_mass, inertia
from romdam.geometry.elements import ELEMENTS, Floats, Rule, facet_element, jacobians, simplex_rule
from romdam.geometry.facets import area_elements, area_vectors, below
from romdam.geometry.meshes.kinds import facets_by_kind, kinds_of

_CUTS = 6  # parts of an edge of a facet that the water's level cuts


def static_force(scene: Scene, block: str) -> Floats:
    """Nodal force on a block of the static loads that act with the joints as they are, (n, 3) [N]."""
    force = surface_force(scene, block)
    if scene.gravity.any() and weight_acts(scene, block):
        force = force + weight_force(scene, block, assemble_mass(scene.blocks[block]))
    return force


def weight_acts(scene: Scene, block: str) -> bool:
    """Tell whether a block's weight acts with the joints as they are, not before they were grouted."""
    return not scene.staged_weight and block not in scene.excluded_from_gravity


def weight_force(scene: Scene, block: str, M: csr_matrix) -> Floats:
    """Nodal force of a block's weight, (n, 3) [N]; zero where it has acted before."""
    if block in scene.excluded_from_gravity:
        return np.zeros_like(scene.blocks[block].points)
    return np.asarray(inertia(scene.blocks[block], M) @ scene.gravity).reshape(-1, 3)


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
    if thermal and block in scene.warmed:
        kinds["temperature"] += thermal_force(scene.blocks[block], scene.warmed[block])
    for water in scene.water:
        if water.block == block:
            kinds["water"] += hydrostatic_force(points, water)
    for load in scene.pressures:
        if load.block == block:
            kinds["forces"] += pressure_force(points, load.facets, load.value)
    for point_force in scene.forces:
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


def force_below(points: Floats, facets: Ints, level: float, pressure: Callable[[Floats], Floats]) -> Floats:
    """Nodal force of a pressure into the block on the part of facets below a level, (n, 3) [N].

    Parameters
    ----------
    pressure : depths below the level [m] -> pressures there [Pa]
    """
    force, (xi, weight) = np.zeros_like(points), simplex_rule(5, 2)
    for _, of_kind, _ in facets_by_kind(facets):
        element = facet_element(of_kind)
        top = points[of_kind, 2].max(axis=1)
        bottom = points[of_kind, 2].min(axis=1)
        whole = of_kind[top <= level]
        if len(whole):
            np.add.at(force, whole, -_pressed(points, whole, level, pressure, element.rule))
        for facet in of_kind[(top > level) & (bottom < level)]:
            # points and weights on the part below the level: the facet is cut into small triangles, and the
            # water's edge is taken as straight in each of them
            triangles, shape = _small_triangles(element.name)
            height = shape @ points[facet][:, 2] - level
            wet = [*triangles[(height <= 0.0).all(axis=1)]]
            for k in np.flatnonzero((height < 0.0).any(axis=1) & (height > 0.0).any(axis=1)):
                wet += below(triangles[k], height[k])
            corners = np.array(wet).reshape(-1, 3, 2)
            edges = corners[:, 1:] - corners[:, :1]
            wet_xi = (corners[:, :1] + xi @ edges).reshape(-1, 2)
            rule = wet_xi, np.outer(np.abs(np.linalg.det(edges)), weight).ravel()
            np.add.at(force, facet, -_pressed(points, facet[None], level, pressure, rule)[0])
    return force


def _pressed(
    points: Floats, facets: Ints, level: float, pressure: Callable[[Floats], Floats], rule: Rule
) -> Floats:
    """int p N n dA of the facets' nodes, (nf, nodes per facet, 3) [N]; n is outward."""
    element = facet_element(facets)
    xi, weight = rule
    shape, normal = element.shape(xi), area_elements(points, facets, xi)
    depth = np.maximum(level - points[facets][..., 2] @ shape.T, 0.0)
    return np.einsum("q,fq,qj,fqk->fjk", weight, pressure(depth), shape, normal, optimize=True)


@cache
def _small_triangles(name: str) -> tuple[Floats, Floats]:
    """Triangles (t, 3, 2) that fill a reference facet, and its functions at their corners (t, 3, n)."""
    element = ELEMENTS[name]
    n = _CUTS
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    lower = np.stack([np.c_[i, j], np.c_[i + 1, j], np.c_[i, j + 1]], axis=1)
    upper = np.stack([np.c_[i + 1, j], np.c_[i + 1, j + 1], np.c_[i, j + 1]], axis=1)
    if element.box:
        triangles = 2.0 * np.vstack([lower, upper]) / n - 1.0
    else:
        triangles = np.vstack([lower[i + j < n], upper[i + j < n - 1]]) / n
    return triangles, element.shape(triangles.reshape(-1, 2)).reshape(len(triangles), 3, -1)
