"""Added mass of the water that moves with a dam, as B^T F B of the displacement normal to its wet faces.

The force of the water on the structure is -M_a (u'' + r a_g) for u relative to the base. Two models:

- Westergaard's pressure 7/8 rho sqrt(H y) a_n, at y below the surface of water of depth H, taken with the
  local normal acceleration a_n (Kuo's generalisation) and integrated with the element's own shape functions.
- Incompressible water: the Laplace equation for the pressure in a reservoir of its own mesh, or a prismatic
  one, extruded upstream from the wet faces' own mesh, so that it conforms to any face; zero pressure at the
  surface, rigid floor, banks and far end. M_a = rho Q^T H^-1 Q with Q the coupling and H the Laplacian.

With incompressible water the ground shakes the floor and the banks of the reservoir too, but not its far end:
vertical motion presses with rho a_g (level - z), though the dam's face be vertical.

References
----------
Westergaard, Trans. ASCE 98 (1933) 418; Kuo, UCB/EERC-82/09 (1982); Zienkiewicz, Bettess, Int. J. Numer.
Methods Eng. 13 (1978) 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from romdam.core.errors import ReductionError
from romdam.core.scene import Block, Reservoir, Scene
from romdam.fem.water.body import WaterBody, vector_operator
from romdam.fem.water.own_mesh import water_body
from romdam.scene.elements import Floats
from romdam.scene.reservoir.wet_mesh import WetMesh, wet_mesh

_WESTERGAARD = 7.0 / 8.0


@dataclass(frozen=True)
class AddedMass:
    """M_a = sum over blocks of B_b^T F B_b'.

    Attributes
    ----------
    coupling : block name -> B (r, 3 n) sparse
    flexibility : F (r, r) dense, symmetric, positive definite; None is the identity
    ground : (r, 3) what unit ground acceleration along x, y, z makes of it: the force is -B^T ground
    """

    coupling: dict[str, csr_matrix]
    flexibility: Floats | None
    ground: Floats

    def times(self, motion: Floats) -> Floats:
        """F times (r, m)."""
        return motion if self.flexibility is None else self.flexibility @ motion

    def on(self, maps: Mapping[str, csr_matrix | Floats]) -> csr_matrix | Floats:
        """B (r, m) of coordinates that give each block's displacement by a (3 n, m) map."""
        return sum(self.coupling[name] @ maps[name] for name in self.coupling)


@dataclass(frozen=True)
class WetMass:
    """Added mass on some unknowns, B^T F B.

    Attributes
    ----------
    operator : B (r, n) sparse
    flexibility : F as `AddedMass` has it
    """

    operator: csr_matrix
    flexibility: Floats | None

    def over(self, unknowns: csr_matrix) -> WetMass:
        """The same on the unknowns that give these by a (n, m) matrix."""
        return WetMass(csr_matrix(self.operator @ unknowns), self.flexibility)

    def inertia(self, motion: Floats) -> Floats:
        """Its mass times motions (n, m)."""
        return np.asarray(self.operator.T @ self._times(self.operator @ motion))

    def of(self, normal: Floats) -> Floats:
        """(m, m) added mass of coordinates on which the operator is (r, m)."""
        return np.asarray(normal.T @ self._times(normal))

    def _times(self, normal: Floats) -> Floats:
        return normal if self.flexibility is None else self.flexibility @ normal


def added_mass(scene: Scene) -> AddedMass | None:
    """The added mass of a scene's reservoir; None without one, and where its water is compressible.

    Raises
    ------
    ReductionError
        where the reservoir's equations cannot be factored.
    """
    if scene.reservoir is None or scene.reservoir.sound is not None:
        return None
    if scene.reservoir.solved:
        return _incompressible(water_body(scene.reservoir, scene.blocks), scene.reservoir.density)
    return _westergaard(scene.blocks, scene.reservoir, wet_mesh(scene.blocks, scene.reservoir))


def sparse_added_mass(
    water: AddedMass, maps: Mapping[str, csr_matrix], limit: int
) -> tuple[csr_matrix, Floats]:
    """Added mass and its ground load over the unknowns of a full-order system.

    Parameters
    ----------
    maps : block name -> (3 n, N) sparse, the block's displacement from the system's unknowns
    limit : entries that the matrix may have; incompressible water couples all wet DOFs

    Returns
    -------
    M_a : (N, N) sparse [kg]
    load : (N, 3) [kg]

    Raises
    ------
    ReductionError
        above the limit.
    """
    B = csr_matrix(water.on(maps))
    wet = int((np.diff(csr_matrix(B.T).indptr) > 0).sum())
    if water.flexibility is not None and wet**2 > limit:
        raise ReductionError(
            f"water: incompressible water couples {wet} wet DOFs, {wet**2:.2g} entries of the full-order "
            f"mass, limit {limit:.2g}; use model.order: reduced, or water.model: westergaard"
        )
    columns = np.unique(B.indices)
    part = B[:, columns]
    block = csr_matrix(part.T @ (part if water.flexibility is None else csr_matrix(water.flexibility @ part)))
    block = block.tocoo()
    N = B.shape[1]
    M = csr_matrix((block.data, (columns[block.row], columns[block.col])), shape=(N, N))
    return csr_matrix((M + M.T) / 2.0), np.asarray(B.T @ water.ground)


def _westergaard(blocks: dict[str, Block], water: Reservoir, mesh: WetMesh) -> AddedMass:
    """One row for each quadrature point: sqrt(7/8 rho sqrt(H y) dA) times the normal displacement there."""
    first, rows = 0, dict[str, list[csr_matrix]]()
    counts = [len(p.facets) * len(p.quadrature(blocks[p.block].points)[0]) for p in mesh.pieces]
    for piece, count in zip(mesh.pieces, counts, strict=True):
        points = blocks[piece.block].points
        _, shape, area, x = piece.quadrature(points)
        size = np.linalg.norm(area, axis=2)
        below = np.maximum(water.level - x[..., 2], 0.0)
        pressure = _WESTERGAARD * water.density * np.sqrt(water.depth * below)
        weight = np.sqrt(pressure / size)[..., None] * area
        values = shape[..., None] * weight[:, :, None, :]
        number = first + np.arange(count).reshape(size.shape)
        shape_of = (number[:, :, None], piece.facets[:, None, :], values, (sum(counts), len(points)))
        rows.setdefault(piece.block, []).append(vector_operator(*shape_of))
        first += count
    coupling = {name: csr_matrix(sum(parts[1:], parts[0])) for name, parts in rows.items()}
    ground = sum(B @ np.tile(np.eye(3), (B.shape[1] // 3, 1)) for B in coupling.values())
    return AddedMass(coupling, None, np.asarray(ground))


def _incompressible(body: WaterBody, density: float) -> AddedMass:
    """Solve the reservoir once for a unit flux at every wet node below the surface."""
    size = len(body.rigid)
    try:
        factor = splu(
            body.H.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )  # fmt: skip
    except RuntimeError as error:
        raise ReductionError(
            f"water: the reservoir's {size} equations are singular ({error}); the wet faces must reach "
            "the level, so that the water has a surface"
        ) from error
    unit = np.zeros((size, len(body.wet)))
    unit[body.wet, np.arange(len(body.wet))] = 1.0
    flexibility = density * factor.solve(unit)[body.wet]
    ground = density * factor.solve(np.ascontiguousarray(body.rigid))[body.wet]
    return AddedMass(body.coupling, (flexibility + flexibility.T) / 2.0, ground)
