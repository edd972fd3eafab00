"""The triangle of a surface that is nearest to a point: all are tried, most by the sphere around them."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.jit import njit


@njit(cache=True)
def nearest_triangles(points: Floats, corners: Floats, spheres: Floats, first: Ints) -> Ints:
    """Number of the nearest of triangles, for every point.

    Parameters
    ----------
    points : (n, 3) [m]
    corners : (nt, 3, 3) [m]
    spheres : (nt, 4) centre and radius of a sphere around every triangle [m]
    first : (n,) a triangle that is near each point; the nearer, the fewer are looked at
    """
    nearest = first.copy()
    for i in range(len(points)):
        p = points[i]
        least = _apart(p, corners[first[i]])
        for t in range(len(corners)):
            x, y, z = p[0] - spheres[t, 0], p[1] - spheres[t, 1], p[2] - spheres[t, 2]
            if x * x + y * y + z * z < (least + spheres[t, 3]) ** 2:
                apart = _apart(p, corners[t])
                if apart < least:
                    least, nearest[i] = apart, t
    return nearest


@njit(cache=True)
def _apart(p: Floats, corner: Floats) -> float:
    """Distance of a point from a triangle (3, 3)."""
    a, u, v = corner[0], corner[1] - corner[0], corner[2] - corner[0]
    n = np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
    square = n[0] ** 2 + n[1] ** 2 + n[2] ** 2
    w = p - a
    s = _triple(w, v, n) / square
    t = _triple(u, w, n) / square
    if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
        return float(abs(w[0] * n[0] + w[1] * n[1] + w[2] * n[2]) / np.sqrt(square))
    least = np.inf
    for k in range(3):
        start, side = corner[k], corner[(k + 1) % 3] - corner[k]
        away = p - start
        length = side[0] ** 2 + side[1] ** 2 + side[2] ** 2
        share = (away[0] * side[0] + away[1] * side[1] + away[2] * side[2]) / length
        away = away - min(max(share, 0.0), 1.0) * side
        least = min(least, away[0] ** 2 + away[1] ** 2 + away[2] ** 2)
    return float(np.sqrt(least))


@njit(cache=True)
def _triple(a: Floats, b: Floats, c: Floats) -> float:
    """(a x b) . c."""
    return float(
        (a[1] * b[2] - a[2] * b[1]) * c[0]
        + (a[2] * b[0] - a[0] * b[2]) * c[1]
        + (a[0] * b[1] - a[1] * b[0]) * c[2]
    )
