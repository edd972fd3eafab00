"""Added mass of the water that moves with a dam, as B^T F B of the displacement normal to its wet faces.

The force of the water on the structure is -M_a (u'' + r a_g) for u relative to the base. Two models:

- Westergaard's pressure 7/8 rho sqrt(H y) a_n, at y below the surface of water of depth H, taken with the
  local normal acceleration a_n (Kuo's generalisation) and integrated with the element's own shape functions.
- Incompressible water: the Laplace equation for the pressure in a reservoir of its own mesh, or a prismatic
  one, extruded upstream from the wet faces' own mesh, so that it conforms to any face; zero pressure at the
  surface, rigid floor, banks and far end. M_a = rho Q^T H^-1 Q with Q the coupling and H the Laplacian.

With incompressible water the ground shakes the floor and the banks of the reservoir too, but not its far end:
vertical motion presses with rho a_g (level - z), though the dam's face be vertical.

A reduced system is diagonalised again: the water couples the modes, of one block and across blocks. With B
the water's operator on the modes, (I + B^T F B) q'' + Omega^2 q is a small dense eigenproblem, solved once
for each reduction. The Craig-Bampton basis is left as it is: it holds the joints' static motions exactly, and
modes with water are combinations of those without.

References
----------
Westergaard, Trans. ASCE 98 (1933) 418; Kuo, UCB/EERC-82/09 (1982); Zienkiewicz, Bettess, Int. J. Numer.
Methods Eng. 13 (1978) 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from romdam.core.errors import ReductionError
from romdam.core.motion import Motion
from romdam.core.scene import Block, Reservoir, Scene
from romdam.core.system import PseudoStatic, System
from romdam.effects.effect import EffectCoordinates, ModalCoordinates
from romdam.effects.moving_supports import applied
from romdam.effects.turned import NewUnknowns, turned
from romdam.fem.water.body import WaterBody, vector_operator
from romdam.fem.water.own_mesh import water_body
from romdam.geometry.elements import Floats
from romdam.linalg.dense import soft_and_stiff_modes
from romdam.scene.reservoir.wet_mesh import WetMesh, wet_mesh

MOST_WET = 40_000_000  # entries of incompressible water's added mass: 0.5 GB, and as much in its factors
_WESTERGAARD = 7.0 / 8.0  # factor of Westergaard's pressure
_MOST = 3000  # modes that take the water; higher ones, which answer as flexibilities, stay dry


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

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """Pressure that unit accelerations of the base and of supports make."""
        rows = self.ground
        if moving is not None:
            rows = np.hstack([rows, self.times(applied(self.coupling, moving.shapes))])
        return {name: np.asarray(coupling.T @ rows) for name, coupling in self.coupling.items()}

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add the water's mass, and its pressure where base and supports move; reduced, diagonalise again.

        Unknowns of a reduced system that move no wet face stay as they are, behind the new ones.

        Raises
        ------
        ReductionError
            where the eigenproblem of a reduced system fails, and for a full matrix that is too large.
        """
        B = coordinates.observe(self.coupling)
        if isinstance(coordinates, ModalCoordinates):
            # the lowest of the unknowns of parts that the water touches
            touched = np.zeros(system.size, dtype=bool)
            for part in system.parts.values():
                touched[part] = np.abs(B[:, part]).max(initial=0.0) > 0.0
            massless = system.M.diagonal() == 0.0  # they are pressed, and take part in no inertia
            wet = np.flatnonzero(touched & ~massless)
            k = system.K.diagonal()[wet]
            wet = np.sort(wet[np.argsort(k, kind="stable")[:_MOST]])
            B = np.where(np.isin(np.arange(system.size), wet) | massless, B, 0.0)
        shaken = {Motion.BASE: np.asarray(B.T @ self.ground)}
        if system.pseudo_static is not None:
            pressed = self.times(applied(self.coupling, system.pseudo_static.shapes))
            shaken[Motion.SUPPORTS] = np.asarray(B.T @ pressed)
        if isinstance(coordinates, ModalCoordinates):
            return _diagonalised(system.loaded(shaken), coordinates, B, wet, self)
        mass = system.M + added_mass_matrix(self, csr_matrix(B))
        return replace(system, M=csr_matrix(mass)).loaded(shaken), coordinates


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
    water = scene.find(Reservoir)
    if water is None or water.sound is not None:
        return None
    if water.solved:
        return _incompressible(water_body(water, scene.blocks), water.density)
    return _westergaard(scene.blocks, water, wet_mesh(scene.blocks, water))


def added_mass_matrix(water: AddedMass, B: csr_matrix, limit: int = MOST_WET) -> csr_matrix:
    """Added mass (N, N) of a full-order system [kg].

    Parameters
    ----------
    B : (r, N) the water's operator on the unknowns
    limit : entries that the matrix may have; incompressible water couples all wet DOFs

    Raises
    ------
    ReductionError
        above the limit.
    """
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
    return csr_matrix((M + M.T) / 2.0)


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


def _diagonalised(
    system: System, coordinates: ModalCoordinates, B: Floats, wet: NDArray[np.int64], water: AddedMass
) -> tuple[System, ModalCoordinates]:
    """A diagonal system in its modes with the water, whose operator on its wet unknowns is B[:, wet]."""
    k = system.K.diagonal()[wet]
    omega2, V = wet_modes(k, B[:, wet], water)
    return turned(system, coordinates, NewUnknowns("water", wet, V, omega2, np.ones(len(wet))))


def wet_modes(k: Floats, B: Floats, water: AddedMass) -> tuple[Floats, Floats]:
    """Squared frequencies (m,) and vectors (m, m) of modes of unit mass with the water's mass.

    Parameters
    ----------
    k : (m,) squared frequencies of the modes without water [1/s2]
    B : (r, m) the water's operator on the modes

    Raises
    ------
    ReductionError
        where the mass is not positive definite.
    """
    M = np.eye(len(k)) + B.T @ water.times(B)
    try:
        return soft_and_stiff_modes(np.diag(k), 0.5 * (M + M.T), int((k == 0.0).sum()))
    except LinAlgError as error:
        raise ReductionError(f"water: the modes' mass is not positive definite ({error})") from error
