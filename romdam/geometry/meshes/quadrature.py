"""Quadrature on the reference elements: points and weights."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np

from romdam.core.arrays import Floats
from romdam.geometry.meshes.simplex_rules import TABLE

Rule = tuple[Floats, Floats]


@cache
def gauss_rule(n: int, dimension: int) -> Rule:
    """Tensor-product Gauss rule with n points per direction on [-1, 1]^dimension."""
    x, w = np.polynomial.legendre.leggauss(n)
    points = np.array(list(product(x, repeat=dimension)))
    weights = np.prod(np.array(list(product(w, repeat=dimension))), axis=1)
    return points, weights


@cache
def simplex_rule(degree: int, dimension: int) -> Rule:
    """Rule on the unit triangle or tetrahedron, exact to `degree` or more, all weights positive."""
    table = _simplex_rules()
    table = table[(table[:, 0] == dimension) & (table[:, 1] >= degree)]
    assert len(table), f"no rule of degree {degree} on a simplex of {dimension} dimensions"
    rows = table[table[:, 1] == table[:, 1].min()]
    return np.ascontiguousarray(rows[:, 2 : 2 + dimension]), rows[:, 5].copy()


@cache
def _simplex_rules() -> Floats:
    return np.loadtxt(TABLE.strip().splitlines(), delimiter=",")


@cache
def wedge_rule(order: int) -> Rule:
    """A triangle's rule times Gauss points along the axis, exact to `order` in the triangle and along it."""
    (xi, w), (z, w_z) = simplex_rule(order, 2), gauss_rule(order // 2 + 1, 1)
    points = np.c_[np.tile(xi, (len(z), 1)), np.repeat((1.0 + z[:, 0]) / 2.0, len(xi))]
    return points, np.outer(w_z / 2.0, w).ravel()


@cache
def pyramid_rule(n: int) -> Rule:
    """Conical product rule with n points per direction; to it a pyramid's rational functions are polynomials.

    With x = s (1 - z) and y = t (1 - z), dx dy dz = (1 - z)^2 ds dt dz: Gauss-Legendre in s and t, and
    Gauss-Jacobi of that weight in z.

    References
    ----------
    Stroud, Approximate calculation of multiple integrals, 1971, ch. 2.5; Bedrosian, Int. J. Numer. Methods
    Eng. 35 (1992) 95.
    """
    from scipy.special import roots_jacobi

    (s, w), (z, w_z) = gauss_rule(n, 2), roots_jacobi(n, 2.0, 0.0)
    below = np.repeat((1.0 - z) / 2.0, len(s))
    return np.c_[np.tile(s, (n, 1)) * below[:, None], 1.0 - below], np.outer(w_z / 8.0, w).ravel()
