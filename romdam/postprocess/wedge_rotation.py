"""Rotation of rigid rock wedges: overturning about a line, and sliding that turns on one plane.

**Overturning.** A wedge can turn about a line through two corners of its planes, in a sense in which no
corner of a plane moves into the rock; mostly that is an edge. Each force drives or resists by its moment
about the line, and the planes carry no tension: FS is the sum of the moments that resist over that of those
that drive.

**Turning while it slides.** A wedge on one plane with the normal n slides with the velocity
v(x) = v_0 + w n x (x - x_0). Its normal force N presses where the active forces meet the plane, with a
pressure s(x) that is linear without tension. The strength mu s + c resists against v(x) everywhere, and of
all motions that of the least factor takes place:

    FS = min over v_0, w of  int (mu s + c) |v(x)| dA / (T . v_0 + M_n w).

w = 0 is the sliding of `slide`, so it is never more. The minimum is found by reweighting: with |v| of the
iterate before in int (mu s + c) |v|^2 / |v| dA it is a linear problem in v_0 and w.

References
----------
Mauldon and Goodman, J. Geotech. Eng. 122 (1996) 976: rotations of blocks of rock.
Goyal, Ruina and Papadopoulos, Wear 143 (1991) 307: limit surfaces of bodies that slide and turn.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from romdam.config.sections.wedges import WedgeConfig
from romdam.core.arrays import Floats
from romdam.postprocess.wedge_loads import WedgeLoads
from romdam.postprocess.wedges import WedgeGeometry, WedgeSliding, area_and_middle

_NEAR = 1e-9  # of the wedge's size: corners so near are one, and what moves so little stays
_NOTHING = 1e-9  # of the largest moment or force: less than that drives nothing
_DIVISIONS = 6  # of each edge of a triangle, for integrals over a plane
_MOST = 200  # iterations
_AGREES = 1e-7  # of the factor, of the pressure: change of an iterate that is none
_LEAST = 1e-9  # of the largest velocity: less counts as that


@dataclass(frozen=True)
class Axis:
    """A line about which a wedge can overturn: name, point (3,) [m], and unit vector (3,) of the turn."""

    name: str
    point: Floats
    direction: Floats


def overturning_axes(geometry: WedgeGeometry, planes: int) -> list[Axis]:
    """Find the lines about which no corner of the first `planes` sides moves into the rock."""
    polygons, near = geometry.polygons[:planes], _NEAR * geometry.size
    corners = list[Floats]()
    for corner in np.concatenate(polygons):
        if all(np.linalg.norm(corner - other) > near for other in corners):
            corners.append(corner)
    axes = list[Axis]()
    for k, first in enumerate(corners):
        for second in corners[k + 1 :]:
            along = (second - first) / np.linalg.norm(second - first)
            for direction in (along, -along):
                opens = np.concatenate(
                    [np.cross(direction, polygon - first) @ geometry.normals[p]
                     for p, polygon in enumerate(polygons)]
                )  # fmt: skip
                known = any(
                    np.linalg.norm(np.cross(direction, axis.point - first)) <= near
                    and direction @ axis.direction > 1.0 - _NEAR
                    for axis in axes
                )
                if opens.min() >= -near and opens.max() > near and not known:
                    axes.append(Axis(_name(geometry, first, second), first, direction))
    return axes


def overturning_moments(axes: list[Axis], loads: WedgeLoads, centroid: Floats) -> tuple[Floats, Floats]:
    """Moments about each axis that drive and that resist, (nt, axes) each [N m]."""
    shape = (len(loads.force), len(axes))
    driving, resisting = np.zeros(shape), np.zeros(shape)
    for k, axis in enumerate(axes):
        of_forces = loads.about(axis.point, centroid) @ axis.direction
        driving[:, k] = np.maximum(of_forces, 0.0).sum(axis=1)
        resisting[:, k] = np.maximum(-of_forces, 0.0).sum(axis=1)
    return driving, resisting


def overturning_factor(driving: Floats, resisting: Floats) -> Floats:
    """Factor against overturning; infinite where nothing drives."""
    drives = driving > _NOTHING * (driving + resisting)
    return np.where(drives, resisting / np.where(drives, driving, 1.0), np.inf)


def turning_factor(
    geometry: WedgeGeometry, wedge: WedgeConfig, loads: WedgeLoads, sliding: WedgeSliding
) -> Floats:
    """Factor (nt,) against sliding that turns on one plane.

    NaN where nothing drives, where several planes are pressed or none, where the pressure's resultant is off
    the plane, so that the wedge overturns, and where another plane stops the turn.
    """
    count = len(wedge.planes)
    pressed = sliding.normal_force > _NOTHING * np.linalg.norm(loads.force.sum(axis=1), axis=1)[:, None]
    factor = np.full(len(pressed), np.nan)
    for k, plane in enumerate(wedge.planes.values()):
        rows = np.flatnonzero(pressed[:, k] & (pressed.sum(axis=1) == 1))
        if not len(rows):
            continue
        normal, polygon = geometry.normals[k], geometry.polygons[k]
        _, middle = area_and_middle(polygon)
        points, weight = _rule(polygon)
        first = polygon[1] - polygon[0]
        first = first / np.linalg.norm(first)
        axes = np.stack([first, np.cross(normal, first)])
        y = (points - middle) @ axes.T
        force = loads.force[rows].sum(axis=1)
        moment = loads.about(middle, geometry.centroid)[rows].sum(axis=1)
        push = -force @ normal
        pressed_at = -np.cross(normal, moment) @ axes.T / push[:, None]
        pressure = _linear_pressure(y, weight, push, pressed_at)
        strength = (plane.friction * pressure + plane.cohesion) * weight
        drive = np.column_stack([force @ axes.T, moment @ normal])
        least, motion = _least_factor(y, strength, drive)
        others = [p for p in range(count) if p != k]
        for p in others:
            arm = geometry.polygons[p] - middle
            velocity = (motion[:, :2] @ axes)[:, None] + motion[:, 2, None, None] * np.cross(normal, arm)
            largest = np.linalg.norm(velocity, axis=2).max(axis=1)
            stopped = (velocity @ geometry.normals[p]).min(axis=1) < -_AGREES * largest
            least = np.where(stopped, np.nan, least)
        factor[rows] = np.where(np.isnan(pressure).any(axis=1), np.nan, least)
    return np.where(np.isfinite(factor), factor, np.nan)


def _name(geometry: WedgeGeometry, first: Floats, second: Floats) -> str:
    """The sides that meet along a line, or the corners that it joins."""
    near = _NEAR * geometry.size
    meet = [
        name
        for name, normal, polygon in zip(geometry.names, geometry.normals, geometry.polygons, strict=True)
        if max(abs(normal @ (first - polygon[0])), abs(normal @ (second - polygon[0]))) <= near
    ]
    if len(meet) > 1:
        return f"edge of {' and '.join(meet)}"
    ends = ("(" + ", ".join(f"{x:.4g}" for x in end) + ")" for end in (first, second))
    return f"line {' to '.join(ends)}"


def _rule(polygon: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) and weights (n,) of integrals over a convex polygon [m, m2]."""
    points, weights = list[Floats](), list[float]()
    for k in range(1, len(polygon) - 1):
        corners = polygon[[0, k, k + 1]]
        area = 0.5 * float(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])))
        for small in _triangles():
            # three points, exact for quadratic functions
            for share in (np.full((3, 3), 1.0 / 6.0) + 0.5 * np.eye(3)) @ small:
                points.append(share @ corners)
                weights.append(area / (3.0 * _DIVISIONS**2))
    return np.array(points), np.array(weights)


def _triangles() -> Iterator[Floats]:
    """Barycentric corners (3, 3) of the equal triangles of a triangle."""
    n = _DIVISIONS

    def corner(i: int, j: int) -> list[float]:
        return [(n - i - j) / n, i / n, j / n]

    for i in range(n):
        for j in range(n - i):
            yield np.array([corner(i, j), corner(i + 1, j), corner(i, j + 1)])
            if i + j < n - 1:
                yield np.array([corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)])


def _linear_pressure(y: Floats, weight: Floats, push: Floats, at: Floats) -> Floats:
    """Pressure (nt, points) that is linear without tension, with its resultant `push` at `at` (nt, 2) [Pa].

    NaN where there is none: the resultant is off the plane.
    """
    shape = np.column_stack([np.ones(len(y)), y])
    wanted = push[:, None] * np.column_stack([np.ones(len(at)), at])
    scale = np.append(1.0, np.full(2, np.abs(y).max()))
    stiffness = np.einsum("q,qi,qj->ij", weight, shape, shape)
    value = np.linalg.solve(stiffness, wanted.T).T
    open_rows = np.arange(len(push))
    for _ in range(_MOST):
        linear = value[open_rows] @ shape.T
        active = np.maximum(linear, 0.0) * weight
        left = (active @ shape - wanted[open_rows]) / scale
        off = np.abs(left).max(axis=1) > _AGREES * push[open_rows]
        if not off.any():
            return np.maximum(value @ shape.T, 0.0)
        open_rows, left = open_rows[off], left[off] * scale
        tangent = np.einsum("tq,qi,qj->tij", (linear[off] > 0.0) * weight, shape, shape)
        tangent += 1e-12 * np.diag(np.diag(stiffness))
        value[open_rows] -= np.linalg.solve(tangent, left[..., None])[..., 0]
    pressure = np.maximum(value @ shape.T, 0.0)
    pressure[open_rows] = np.nan
    return pressure


def _least_factor(y: Floats, strength: Floats, drive: Floats) -> tuple[Floats, Floats]:
    """Least factor (nt,) over all motions (v_1, v_2, w), and that motion (nt, 3).

    Parameters
    ----------
    y : (points, 2) places in the plane [m]
    strength : (nt, points) [N]
    drive : (nt, 3) forces along the axes of the plane, and the moment about its middle [N, N m]
    """
    radius = np.abs(y).max()
    scaled = drive / np.array([1.0, 1.0, radius])
    size = np.linalg.norm(scaled, axis=1)
    drives = size > 0.0
    scaled = np.where(drives[:, None], scaled / np.where(drives, size, 1.0)[:, None], [1.0, 0.0, 0.0])
    motion, factor = scaled.copy(), np.full(len(drive), np.inf)
    arms = np.column_stack([-y[:, 1], y[:, 0]]) / radius
    for _ in range(_MOST):
        velocity = motion[:, None, :2] + motion[:, 2, None, None] * arms
        speed = np.linalg.norm(velocity, axis=2)
        now = np.einsum("tq,tq->t", strength, speed) / np.einsum("ti,ti->t", scaled, motion)
        change = np.abs(factor - now) > _AGREES * now
        factor = now
        if not change.any():
            break
        share = strength / np.maximum(speed, _LEAST * speed.max(axis=1, keepdims=True))
        matrix = np.zeros((len(drive), 3, 3))
        matrix[:, 0, 0] = matrix[:, 1, 1] = share.sum(axis=1)
        matrix[:, :2, 2] = matrix[:, 2, :2] = share @ arms
        matrix[:, 2, 2] = share @ (arms**2).sum(axis=1)
        largest = np.einsum("tii->t", matrix)[:, None, None]
        matrix += (1e-14 * largest + 1e-300) * np.eye(3)
        motion = np.linalg.solve(matrix, scaled[..., None])[..., 0]
        motion /= np.abs(motion).max(axis=1, keepdims=True)
    held = np.where(drives, factor / np.where(drives, size, 1.0), np.inf)
    return held, motion / np.array([1.0, 1.0, radius])
