"""Surfaces that cut: signed distance of points, and the normal to the positive side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from romdam.core.arrays import Floats

_ROUNDING = 4e-16  # of the largest coordinate: a distance that is zero
_STEPS = 60  # of a search that gains digits in each


class CuttingSurface(Protocol):
    """A two-sided surface that goes on to infinity."""

    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) of points (n, 3) from the surface [m]."""

    def normal(self, points: Floats) -> Floats:
        """Unit gradient (n, 3) of the distance at points."""

    def beyond(self, points: Floats) -> Floats:
        """Distance of points outside of the rim of what is known of the surface (n,) [m]."""


@dataclass(frozen=True)
class Plane:
    """The plane through a point (3,) [m], its positive side along the unit normal (3,)."""

    point: Floats
    direction: Floats

    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) [m]."""
        return (points - self.point) @ self.direction

    def normal(self, points: Floats) -> Floats:
        """Unit normal (n, 3) at points."""
        return np.broadcast_to(self.direction, points.shape)

    def beyond(self, points: Floats) -> Floats:
        """Zero: it has no rim."""
        return np.zeros(len(points))


@dataclass(frozen=True)
class Cylinder:
    """The cylinder around an axis through a point (3,) [m] along a unit vector (3,); outside is positive."""

    point: Floats
    axis: Floats
    radius: float

    def _radial(self, points: Floats) -> Floats:
        away = points - self.point
        return away - np.outer(away @ self.axis, self.axis)

    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) [m]."""
        return np.linalg.norm(self._radial(points), axis=1) - self.radius

    def normal(self, points: Floats) -> Floats:
        """Unit normal (n, 3) at points; zero on the axis."""
        radial = self._radial(points)
        length = np.linalg.norm(radial, axis=1, keepdims=True)
        return np.divide(radial, length, out=np.zeros_like(radial), where=length > 0.0)

    def beyond(self, points: Floats) -> Floats:
        """Zero: it has no rim."""
        return np.zeros(len(points))


def unit(vector: Floats) -> Floats:
    """The unit vector along a vector."""
    return vector / np.linalg.norm(vector)


def crossing_shares(surface: CuttingSurface, start: Floats, end: Floats, middle: Floats) -> Floats:
    """Share of the way (n,) at which edges from `start` over `middle` to `end` (n, 3) meet the surface.

    The ends lie on two sides of it. By the false position method with halved weights, which is exact in its
    first step for planes and straight edges.

    References
    ----------
    Dowell and Jarratt, A modified regula falsi method, BIT 11 (1971), called the Illinois method.
    """
    a, b = np.zeros(len(start)), np.ones(len(start))
    f_a, f_b = surface.distance(start), surface.distance(end)
    small = _ROUNDING * np.abs(np.concatenate([start, end])).max(initial=0.0)
    for _ in range(_STEPS):
        share = a + (b - a) * f_a / (f_a - f_b)
        f = surface.distance(on_edges(share, start, end, middle))
        crossed = f * f_b < 0.0
        a, f_a = np.where(crossed, b, a), np.where(crossed, f_b, f_a / 2.0)
        b, f_b = share, f
        if (np.abs(f) <= small).all():
            break
    return b


def on_edges(share: Floats, start: Floats, end: Floats, middle: Floats) -> Floats:
    """Points (n, 3) of edges; exactly on the line where `middle` is the mean of the ends."""
    s = share[:, None]
    return (1.0 - s) * start + s * end + 4.0 * s * (1.0 - s) * (middle - (start + end) / 2.0)
