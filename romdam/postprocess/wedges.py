"""Sliding of rigid rock wedges on one to three planes: geometry, forces on the planes, factor of safety.

A wedge that translates; `wedge_rotation` has its rotation, `wedge_displacement` how far it goes. Without
friction its planes push it along their normals alone; the part of the active force R that they cannot take
drives it. That part is the projection of R on the directions d with d . n_i >= 0 for all planes (n_i the
normals into the wedge):

    R + sum_i N_i n_i = S d,   N_i >= 0,   N_i (d . n_i) = 0.

Least squares with N >= 0 give all N_i. Friction and cohesion of the planes in contact resist along -d:
FS = sum_i (mu_i N_i + c_i A_i) / S.

References
----------
Londe, Vigier and Vormeringer, J. Soil Mech. Found. Div. ASCE 95 (1969) 235: wedges in the abutments of dams.
Warburton, Rock Mech. Rock Eng. 14 (1981) 1: the vector solution for any number of planes.
Hoek and Bray, Rock Slope Engineering (1981), appendix 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from romdam.config.sections.wedges import WedgeConfig, WedgesConfig, WedgeSurfaceConfig
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConfigError

_ON_PLANE = 1e-9  # of the wedge's size: a corner so near to a plane is on it
_HELD = 1e-9  # of the active force: less than that drives nothing
_LARGEST = 1e6  # [m] across: a wedge beyond it counts as open


@dataclass(frozen=True)
class WedgeGeometry:
    """A convex wedge.

    Attributes
    ----------
    names : of its planes, then of its surfaces
    normals : (n, 3) into the wedge
    polygons : corners (m, 3) of each, around its middle [m]
    areas : (n,) [m2]
    volume : [m3]
    centroid : (3,) of the volume [m]
    """

    names: tuple[str, ...]
    normals: Floats
    polygons: tuple[Floats, ...]
    areas: Floats
    volume: float
    centroid: Floats

    @property
    def size(self) -> float:
        """Largest extent along an axis [m]."""
        return float(np.ptp(np.concatenate(self.polygons), axis=0).max())


@dataclass(frozen=True)
class WedgeSliding:
    """What moves a wedge, over time.

    Attributes
    ----------
    factor : (nt,) factor of safety; infinite where no direction is free
    driving, resisting : (nt,) [N]
    direction : (nt, 3) unit vector in which it would slide or lift off; 0 where no direction is free
    normal_force : (nt, planes) compression positive, effective (water has been subtracted) [N]
    contact : (nt, planes) whether the plane stays in contact
    """

    factor: Floats
    driving: Floats
    resisting: Floats
    direction: Floats
    normal_force: Floats
    contact: Bools


def upward_normal(dip: float, dip_direction: float, north: Sequence[float]) -> Floats:
    """Upward unit normal (3,) of a plane by dip and dip direction [degrees], clockwise from north."""
    ahead = np.array(north) / np.linalg.norm(north)
    east = np.cross(ahead, [0.0, 0.0, 1.0])
    slope, azimuth = np.radians(dip), np.radians(dip_direction)
    along = np.sin(azimuth) * east + np.cos(azimuth) * ahead
    return np.asarray(np.sin(slope) * along + np.cos(slope) * np.array([0.0, 0.0, 1.0]))


def wedge_geometry(wedge: WedgeConfig, common: WedgesConfig, location: str) -> WedgeGeometry:
    """Cut the wedge out by its planes and surfaces.

    Parameters
    ----------
    location : file and key, for messages

    Raises
    ------
    ConfigError
        where `inside` is on a plane, the planes leave the wedge open, or one of them does not bound it.
    """
    from scipy.spatial import HalfspaceIntersection

    sides: dict[str, WedgeSurfaceConfig] = {**wedge.planes, **wedge.surfaces}
    if len(sides) < len(wedge.planes) + len(wedge.surfaces):
        twice = sorted(set(wedge.planes) & set(wedge.surfaces))
        raise ConfigError(f"{location}: {twice[0]!r} names a plane and a surface; give each its own name")
    inside = np.array(wedge.inside)
    normals, distances = np.zeros((len(sides), 3)), np.zeros(len(sides))
    for k, (name, side) in enumerate(sides.items()):
        normal = upward_normal(side.dip, side.dip_direction, common.north)
        distance = float(normal @ (inside - np.array(side.through)))
        if distance == 0.0:
            raise ConfigError(f"{location}.inside: is on {name!r}; give a point within the wedge")
        normals[k], distances[k] = np.sign(distance) * normal, abs(distance)
    if not _closes(normals):
        raise ConfigError(
            f"{location}: the {len(sides)} planes and surfaces leave the wedge open, so it has no volume; "
            "name the surfaces that bound it (the ground, a cut, a crack behind it), or check `inside`"
        )
    # all relative to the point inside: x with normal . x + distance >= 0
    corners = HalfspaceIntersection(np.column_stack([-normals, -distances]), np.zeros(3)).intersections
    size = float(np.ptp(corners, axis=0).max())
    if size > _LARGEST:
        raise ConfigError(
            f"{location}: the wedge is {size:.3g} m across, limit {_LARGEST:g} m; check its planes"
        )
    areas, volume, first_moment, polygons = np.zeros(len(sides)), 0.0, np.zeros(3), list[Floats]()
    for k, name in enumerate(sides):
        on_plane = corners[np.abs(corners @ normals[k] + distances[k]) < _ON_PLANE * size]
        polygon = _polygon(on_plane, normals[k])
        areas[k], middle = area_and_middle(polygon)
        if areas[k] <= (_ON_PLANE * size) ** 2:
            raise ConfigError(
                f"{location}: {name!r} does not bound the wedge, the other planes meet before it; leave it "
                "out, or check `through` and `inside`"
            )
        pyramid = areas[k] * distances[k] / 3.0  # from the point inside, its centroid at 3/4 of the way
        volume += pyramid
        first_moment += 0.75 * pyramid * middle
        polygons.append(polygon + inside)
    return WedgeGeometry(
        tuple(sides), normals, tuple(polygons), areas, volume, inside + first_moment / volume
    )


def slide(planes: WedgeGeometry, wedge: WedgeConfig, force: Floats) -> WedgeSliding:
    """Solve the equilibrium of a wedge for every active force.

    Parameters
    ----------
    force : (nt, 3) on the wedge: weight, thrust, inertia and water on planes and surfaces [N]
    """
    from scipy.optimize import nnls

    count = len(wedge.planes)
    normals = planes.normals[:count]
    pushes = np.array([nnls(normals.T, -active)[0] for active in force]).reshape(len(force), count)
    left = force + pushes @ normals
    driving = np.linalg.norm(left, axis=1)
    held = driving <= _HELD * np.linalg.norm(force, axis=1)
    direction = np.where(held[:, None], 0.0, left / np.where(held, 1.0, driving)[:, None])
    contact = (np.abs(direction @ normals.T) < _HELD) | (pushes > 0.0)
    strengths = wedge.planes.values()
    friction, cohesion = (np.array([getattr(p, key) for p in strengths]) for key in ("friction", "cohesion"))
    resisting = pushes @ friction + contact @ (cohesion * planes.areas[:count])
    with np.errstate(divide="ignore"):
        factor = np.where(held, np.inf, resisting / np.where(held, 1.0, driving))
    return WedgeSliding(factor, np.where(held, 0.0, driving), resisting, direction, pushes, contact)


def trend_and_plunge(direction: Floats, north: Sequence[float]) -> tuple[float, float]:
    """Azimuth clockwise from north and angle below the horizontal of a unit vector (3,) [degrees]."""
    ahead = np.array(north) / np.linalg.norm(north)
    east = np.cross(ahead, [0.0, 0.0, 1.0])
    trend = np.degrees(np.arctan2(direction @ east, direction @ ahead)) % 360.0
    return float(trend), float(np.degrees(np.arcsin(np.clip(-direction[2], -1.0, 1.0))))


def _closes(normals: Floats) -> bool:
    """Whether planes with these normals into it can close a volume: 0 is within the hull of the normals."""
    from scipy.spatial import ConvexHull, QhullError

    if len(normals) < 4:
        return False
    try:
        hull = ConvexHull(normals)
    except QhullError:  # all normals in one plane
        return False
    return bool((hull.equations[:, 3] < -_ON_PLANE).all())


def _polygon(corners: Floats, normal: Floats) -> Floats:
    """Corners (n, 3) of a convex polygon around its middle."""
    if len(corners) < 3:
        return np.zeros((0, 3))
    away = corners - corners.mean(axis=0)
    first = away[np.linalg.norm(away, axis=1).argmax()]
    angle = np.arctan2(away @ np.cross(normal, first), away @ first)
    return np.asarray(corners[np.argsort(angle)])


def area_and_middle(polygon: Floats) -> tuple[float, Floats]:
    """Area [m2] and centroid (3,) [m] of a convex polygon (n, 3)."""
    if len(polygon) < 3:
        return 0.0, np.zeros(3)
    first, second = polygon[1:-1] - polygon[0], polygon[2:] - polygon[0]
    areas = 0.5 * np.linalg.norm(np.cross(first, second), axis=1)
    area = float(areas.sum())
    if area == 0.0:
        return 0.0, polygon[0]
    return area, np.asarray(polygon[0] + areas @ (first + second) / (3.0 * area))
