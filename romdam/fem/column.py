"""A column of rock in which plane waves travel vertically: shape functions, and its motion from its top's.

The column's elements are as high as those of the rock's mesh and of their order, so that a box of such rock
carries its waves exactly as the column does, at the mesh's and the integrator's own speed. Motion w is
relative to the free surface. Unknowns from the surface down satisfy, one element after the other,

    M w'' + C w' + K w = -M r a_g,   w = 0 at the surface, C = alpha M + beta K,

for each frequency, alpha and beta those of the element's material; what is left over at the last node is the
traction that the rock below exerts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.scene import FreeField, Material
from romdam.core.system import Complex
from romdam.fem.material import lame

_XI, _WEIGHT = (1.0 + np.polynomial.legendre.leggauss(3)[0]) / 2.0, np.array([5.0, 8.0, 5.0]) / 18.0


def wave_moduli(material: Material) -> Floats:
    """Moduli of vertical waves that move along x, y, z: shear twice, then compression [Pa]."""
    lam, mu = lame(material)
    return np.array([mu, mu, lam + 2.0 * mu])


def shapes(field: FreeField, z: Floats) -> csr_matrix:
    """Shape functions of the column's nodes but the surface's at elevations, (k, nodes)."""
    values, _ = _lagrange(field.order, _local(field, z)[1])
    return _over_nodes(field, z, values)


def slopes(field: FreeField, z: Floats) -> csr_matrix:
    """Derivatives of the shape functions by elevation, (k, nodes) [1/m]; none above the surface."""
    element, s = _local(field, z)
    gradient = _lagrange(field.order, s)[1] * (z <= field.levels[0])[:, None]
    return _over_nodes(field, z, -gradient / -np.diff(field.levels)[element, None])


def _local(field: FreeField, z: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Element at each elevation, and how far down in it, 0 to 1."""
    top = field.levels[:-1]
    element = np.clip(np.searchsorted(-top, -z, side="right") - 1, 0, len(top) - 1)
    return element, np.clip((top[element] - z) / -np.diff(field.levels)[element], 0.0, 1.0)


def _lagrange(order: int, s: Floats) -> tuple[Floats, Floats]:
    """Shape functions (k, order + 1) on [0, 1], and their derivatives."""
    if order == 1:
        return np.stack([1.0 - s, s], axis=1), np.stack([-np.ones_like(s), np.ones_like(s)], axis=1)
    values = np.stack([(1.0 - s) * (1.0 - 2.0 * s), 4.0 * s * (1.0 - s), s * (2.0 * s - 1.0)], axis=1)
    return values, np.stack([4.0 * s - 3.0, 4.0 - 8.0 * s, 4.0 * s - 1.0], axis=1)


def _over_nodes(field: FreeField, z: Floats, values: Floats) -> csr_matrix:
    element, _ = _local(field, z)
    nodes = field.order * element[:, None] + np.arange(field.order + 1)
    rows = np.broadcast_to(np.arange(len(z))[:, None], nodes.shape)
    size = (len(z), field.order * len(field.materials) + 1)
    return csr_matrix((values.ravel(), (rows.ravel(), nodes.ravel())), shape=size)[:, 1:]


@dataclass(frozen=True)
class ColumnResponse:
    """Answer of the column to a unit acceleration of its surface at some frequencies.

    Attributes
    ----------
    motion : (nf, nodes) of the nodes below the surface, relative to it [s2]
    traction : (nf,) on the column's lower end [Pa s2/m]
    """

    motion: Complex
    traction: Complex


def respond(
    field: FreeField, component: int, rates: tuple[Complex, Complex], damping: tuple[float, float]
) -> ColumnResponse:
    """Find the column's motion under its surface's, frequency by frequency.

    Parameters
    ----------
    component : of motion, 0 to 2
    rates : acceleration and velocity (nf,) of a unit displacement
    damping : alpha [1/s], beta [s] of materials without damping of their own
    """
    (acc, vel), p = rates, field.order
    values, gradient = _lagrange(p, _XI)
    top, above, motion = np.zeros_like(acc), np.zeros_like(acc), []
    for height, material in zip(-np.diff(field.levels), field.materials, strict=True):
        M = material.rho * height * (values.T * _WEIGHT) @ values
        K = wave_moduli(material)[component] / height * (gradient.T * _WEIGHT) @ gradient
        alpha, beta = material.damping or damping
        D = (acc + alpha * vel)[:, None, None] * M + (1.0 + beta * vel)[:, None, None] * K
        load = M.sum(axis=1)
        known = D[:, :p, 0] * top[:, None] + load[:p]
        known[:, 0] += above
        below = -np.linalg.solve(D[:, :p, 1:], known[..., None])[..., 0]
        above = D[:, p, 0] * top + (D[:, p, 1:] * below).sum(axis=1) + load[p]
        motion.append(below)
        top = below[:, -1]
    return ColumnResponse(np.hstack(motion), above)


def layer_motion(field: FreeField, component: int, omega: Floats, damping: tuple[float, float]) -> Complex:
    """Total motion of the column's nodes below the surface for a unit motion of it, in continuous layers.

    Waves of complex moduli G (1 + i beta omega); alpha acts on the motion against the surface alone. Neither
    elements nor steps take part, so that this is what the column should do. With c = omega^2 / (omega^2 -
    i alpha omega) the sum of w and c satisfies the wave equation of its layer.

    Parameters
    ----------
    omega : (nf,) above zero [rad/s]
    damping : alpha [1/s], beta [s] of materials without damping of their own

    Returns
    -------
    (nf, nodes)
    """
    motion, traction = np.zeros(len(omega), dtype=complex), np.zeros(len(omega), dtype=complex)
    nodes = []
    for height, material in zip(-np.diff(field.levels), field.materials, strict=True):
        alpha, beta = material.damping or damping
        inertia = omega**2 - 1j * alpha * omega
        constant, modulus = omega**2 / inertia, wave_moduli(material)[component] * (1.0 + 1j * beta * omega)
        wave = np.sqrt(material.rho * inertia / modulus)
        step = height / field.order
        cosine, sine = np.cos(wave * step), np.sin(wave * step)
        for _ in range(field.order):
            moved = motion + constant
            motion, traction = (
                moved * cosine + traction * sine / (modulus * wave) - constant,
                traction * cosine - moved * modulus * wave * sine,
            )
            nodes.append(motion)
    return np.asarray(1.0 + np.stack(nodes, axis=1))
