"""A job as every finite-element code knows it: points, solids, supports, masses, forces, gaps, a record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import block_diag, csr_matrix, diags_array

from romdam.contact.laws.catalogue import find_law
from romdam.contact.laws.shear_stiffness import ElasticShear
from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.scene import Material
from romdam.core.system import GapLaw

_NO_WEIGHT = 1e-12  # of a point in a jump: a rounding error
_NO_MASS = 1e-9  # of a point's largest added mass: on a plane face, the rounding of the two others


@dataclass(frozen=True)
class Solid:
    """Cells (nc, nodes per cell) of one block, numbers of points in the VTK order.

    `damping` is alpha [1/s] and beta [s] of its own mass and stiffness.
    """

    name: str
    element: str
    cells: Ints
    material: Material
    damping: tuple[float, float]


@dataclass(frozen=True)
class Gaps:
    """Gap elements of all joints, one after another.

    Attributes
    ----------
    joint : (ng,) its name
    points : (ng, 2) on the sides I and J
    axes : (ng, 3, 3) rows i (normal, from I to J), j, k
    law : stiffness, friction and initial gap; nothing is rigid
    """

    joint: tuple[str, ...]
    points: Ints
    axes: Floats
    law: GapLaw

    def __len__(self) -> int:
        return len(self.joint)

    @property
    def friction(self) -> Floats:
        """(ng,) coefficient for both tangential directions, the smaller one; inf where shear has no bound."""
        return np.where(elastic(self.law), np.inf, self.law.mu.min(axis=1))

    @property
    def sticks(self) -> Bools:
        """(ng,) True for gaps that carry shear."""
        return np.asarray((self.friction > 0.0) & (self.law.K_s > 0.0))


def elastic(law: GapLaw) -> Bools:
    """(ng,) True for gaps that are linear springs along all three axes: shear has no bound of any law."""
    springs, bounded = np.zeros(len(law), dtype=bool), law.mu.any(axis=1)
    for rows in law.laws:
        if find_law(rows.law) is ElasticShear:
            springs |= rows.on
        else:
            bounded |= rows.on
    return np.asarray(springs & ~bounded & (law.K_n == law.K_nz))


@dataclass(frozen=True)
class DeckMotion:
    """Ground acceleration at every step.

    Attributes
    ----------
    name : of the record
    acc : (3, nt) along x, y, z [m/s2]
    dt : step [s]
    stride : steps to a written row
    """

    name: str
    acc: Floats
    dt: float
    stride: int

    @property
    def steps(self) -> int:
        """Number of steps, whole rows of them."""
        return (self.acc.shape[1] - 1) // self.stride * self.stride


@dataclass(frozen=True)
class Deck:
    """One job and one record.

    Attributes
    ----------
    title : for a script's head
    points : (n, 3) [m]
    solids : blocks
    fixed : (n, 3) True where a support holds the component
    follows : (3 n, 3 n) sparse; a row for each DOF that follows others, empty elsewhere
    mass : of all solids [kg]
    added_mass : (n, 3, 3) of the water that moves with the dam, lumped at the points [kg]
    force : (n, 3) static: weight, water on faces and in joints, pressures, point forces, temperature [N]
    gaps : of all joints
    alpha, beta : Rayleigh damping of added mass, and of solids whose material has none of its own [1/s], [s]
    static : whether equilibrium under `force` comes first; else it acts from the record's start
    motion : the record
    probes : name -> point
    stated : what differs from romdam's model, one sentence each
    averaged : key of every joint and tie whose points follow several nodes -> why
    """

    title: str
    points: Floats
    solids: tuple[Solid, ...]
    fixed: Bools
    follows: csr_matrix
    mass: float
    added_mass: Floats
    force: Floats
    gaps: Gaps
    alpha: float
    beta: float
    static: bool
    motion: DeckMotion
    probes: dict[str, int]
    stated: tuple[str, ...]
    averaged: Mapping[str, str]

    def stating(self, *sentences: str) -> Deck:
        """The same with what one code cannot express."""
        return replace(self, stated=(*self.stated, *(sentence for sentence in sentences if sentence)))

    def elements(self, known: Mapping[str, str], code: str) -> list[str]:
        """Name of every solid's element in a code.

        Raises
        ------
        ConfigError
            for an element that is not known there.
        """
        for solid in self.solids:
            if solid.element not in known:
                raise ConfigError(
                    f"blocks.{solid.name}: element {solid.element} is not written for {code}, known are "
                    f"{', '.join(known)}; mesh the block with one of these"
                )
        return [known[solid.element] for solid in self.solids]

    @property
    def leads(self) -> csr_matrix:
        """(3 n, 3 n) every DOF from those that follow none."""
        independent = diags_array((np.diff(self.follows.indptr) == 0).astype(float))
        return csr_matrix(self.follows + independent)

    @property
    def meshed(self) -> Bools:
        """(n,) True for points of solids; the others are gaps' own."""
        there = np.zeros(len(self.points), dtype=bool)
        for solid in self.solids:
            there[solid.cells] = True
        return there

    @property
    def jump_points(self) -> Ints:
        """(ng,) numbers behind those of the deck, for points whose displacement is the jump of a gap."""
        return len(self.points) + np.arange(len(self.gaps))

    def jumps(self) -> csr_matrix:
        """(3 ng, 3 n) opening without the initial gap, slips along j and k, from DOFs that follow none."""
        leads, dofs = self.leads, 3 * self.gaps.points[..., None] + np.arange(3)
        axes = block_diag([csr_matrix((0, 0)), *self.gaps.axes], format="csr")
        rows = csr_matrix(axes @ (leads[dofs[:, 1].ravel()] - leads[dofs[:, 0].ravel()]))
        # weights are near one at most; whether a term is exactly zero depends on the machine
        rows.data[np.abs(rows.data) < _NO_WEIGHT] = 0.0
        rows.eliminate_zeros()
        return rows

    def wet(self) -> Iterator[tuple[int, float, Floats]]:
        """Added mass as masses that move along one direction each: point, mass [kg], unit direction (3,)."""
        for point in np.flatnonzero(self.added_mass.any(axis=(1, 2))).tolist():
            mass, axes = np.linalg.eigh(self.added_mass[point])
            for k in np.flatnonzero(mass > _NO_MASS * mass.max()).tolist():
                yield point, float(mass[k]), axes[:, k]


def as_written(values: Floats) -> Floats:
    """Values to the 12 digits that a deck has, so that gaps of one law are one group on every machine."""
    return np.array([float(f"{value:.11e}") for value in np.ravel(values)]).reshape(np.shape(values))
