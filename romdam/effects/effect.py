"""The protocol of a physical effect, and the unknowns that it is added over.

A system begins as its blocks, `M u'' + K u = force - load a_g`. Each effect of the scene adds what it has:
mass, damping, unknowns of its own, loads that follow named motions (`romdam.core.motion.Motion`). None of
them knows whether the unknowns are those of the mesh or of a reduced basis, unless it has a reduced form.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.system import PseudoStatic, System
from romdam.reduction.basis import Turn, over_coordinates


class EffectCoordinates(Protocol):
    """Unknowns that give the displacement of every block."""

    def observe(self, operators: Mapping[str, csr_matrix]) -> csr_matrix | Floats:
        """Sum of operators (k, 3 nodes) on blocks, (k, unknowns)."""
        ...

    def press(self, forces: Mapping[str, csr_matrix | Floats]) -> csr_matrix | Floats:
        """Forces (3 nodes, k) on blocks, (unknowns, k)."""
        ...


@dataclass(frozen=True)
class MeshCoordinates:
    """The free DOFs of a mesh.

    Attributes
    ----------
    maps : block name -> (3 nodes, unknowns) matrix that takes its DOFs from the unknowns, zero where held
    rigid : (unknowns, r) rigid motions of parts that joints alone hold
    """

    maps: Mapping[str, csr_matrix]
    rigid: csr_matrix

    def observe(self, operators: Mapping[str, csr_matrix]) -> csr_matrix:
        """See `EffectCoordinates`."""
        return csr_matrix(sum(operator @ self.maps[name] for name, operator in operators.items()))

    def press(self, forces: Mapping[str, csr_matrix | Floats]) -> csr_matrix | Floats:
        """See `EffectCoordinates`."""
        return sum(self.maps[name].T @ force for name, force in forces.items())


@dataclass(frozen=True)
class ModalCoordinates:
    """Reduced coordinates.

    Attributes
    ----------
    basis : of every block
    size : number of coordinates
    finer : whether the basis is one that estimates compare with
    reservoir : (n, m) basis of the unknowns that compressible water has on the mesh; None without
    turns : changes of all coordinates that effects have made, in their order
    """

    basis: dict[str, BlockBasis]
    size: int
    finer: bool = False
    reservoir: Floats | None = None
    turns: tuple[Turn, ...] = ()

    def observe(self, operators: Mapping[str, csr_matrix]) -> Floats:
        """See `EffectCoordinates`."""
        return over_coordinates(operators, self.basis, self.size)

    def press(self, forces: Mapping[str, csr_matrix | Floats]) -> Floats:
        """See `EffectCoordinates`."""
        total = np.zeros((self.size, next(iter(forces.values())).shape[1]))
        for name, force in forces.items():
            columns, vectors = self.basis[name].columns, self.basis[name].vectors
            total[columns] += (
                vectors.project(force) if isinstance(force, np.ndarray) else vectors.under(force.T).T
            )
        return total


class Effect(Protocol):
    """A physical effect of a scene."""

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """The system with this effect, and the coordinates that it then has.

        Parameters
        ----------
        system : with the effects that act before this one, moving supports first (`System.pseudo_static`)
        coordinates : the first unknowns of `system`
        """
        ...

    def static_loads(self, moving: PseudoStatic | None) -> Mapping[str, Floats]:
        """Forces (3 nodes, k) on blocks while all moves slowly, which a reduced basis answers exactly."""
        ...
