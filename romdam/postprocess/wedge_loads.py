"""Forces on a rock wedge over time, each with its moment: weight, inertia, water on its sides, thrust."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from romdam.config.sections.wedges import (
    MotionOfNodesConfig,
    ThrustConfig,
    WaterLevelConfig,
    WaterOfJointConfig,
    WedgeConfig,
    WedgesConfig,
    WedgeSurfaceConfig,
)
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, listed
from romdam.postprocess.wedges import WedgeGeometry, area_and_middle

Levels = Mapping[str, tuple[Floats, Floats]]
_OLD = "the result has no joint_moment, as those of earlier versions; run it again"


@dataclass(frozen=True)
class WedgeLoads:
    """Forces on a wedge.

    Attributes
    ----------
    names : of the forces
    force : (nt, n, 3) [N]
    moment : (nt, n, 3) of each about the wedge's centroid [N m]
    water : (nt, sides) force of the water on each side [N]
    """

    names: tuple[str, ...]
    force: Floats
    moment: Floats
    water: Floats

    def about(self, point: Floats, centroid: Floats) -> Floats:
        """Moment (nt, n, 3) of each force about a point [N m]."""
        return np.asarray(self.moment + np.cross(centroid - point, self.force))


def wedge_loads(
    name: str,
    geometry: WedgeGeometry,
    wedges: WedgesConfig,
    time: Floats,
    *,
    run: xr.Dataset | None,
    levels: Levels,
    source: str,
) -> WedgeLoads:
    """Collect the forces on a wedge.

    Parameters
    ----------
    time : (nt,) of the run [s]
    run : a result; None for constant forces and water by tables alone
    levels : tables of water levels by their keys
    source : the file of the wedges, for messages

    Raises
    ------
    ConfigError
        for forces and motions that the result does not have.
    """
    wedge, location = wedges.wedges[name], f"{source}: wedges.{name}"
    mass, count = wedge.density * geometry.volume, len(time)
    zero = np.zeros((count, 3))
    loads = {"weight": (zero + np.array([0.0, 0.0, -mass * wedges.gravity]), zero)}
    if wedge.inertia is not False and (run is not None or wedge.inertia is not True):
        loads["inertia"] = (-mass * _acceleration(wedge, run, f"{location}.inertia"), zero)
    sides: dict[str, WedgeSurfaceConfig] = {**wedge.planes, **wedge.surfaces}
    water = np.zeros((count, len(sides)))
    for k, (side, surface) in enumerate(sides.items()):
        if surface.water is None:
            continue
        kind = "planes" if side in wedge.planes else "surfaces"
        key = f"wedges.{name}.{kind}.{side}.water"
        pressure = _water(
            surface, geometry.polygons[k], wedges, time, run, levels.get(key), f"{source}: {key}"
        )
        water[:, k] = pressure[:, 0]
        force = pressure[:, :1] * geometry.normals[k]
        moment = np.cross(pressure[:, 1:] - pressure[:, :1] * geometry.centroid, geometry.normals[k])
        loads[f"water on {side}"] = (force, moment)
    for thrust, force, moment, at in _thrusts(wedge.thrust, run, geometry, count, f"{location}.thrust"):
        loads[thrust] = (force, moment + np.cross(at - geometry.centroid, force))
    forces, moments = zip(*loads.values(), strict=True)
    return WedgeLoads(tuple(loads), np.stack(forces, axis=1), np.stack(moments, axis=1), water)


def _acceleration(wedge: WedgeConfig, run: xr.Dataset | None, location: str) -> Floats:
    """Acceleration of the ground at the wedge's place, (nt, 3) [m/s2]."""
    if run is None:
        raise ConfigError(f"{location}: nodes have their motion from a result; name one, or write false")
    ground: Floats = run.ground_acceleration.transpose("time", "component").values
    if not isinstance(wedge.inertia, MotionOfNodesConfig):
        return ground
    known = [str(node) for node in run.node.values] if "node" in run else []
    for node in wedge.inertia.nodes:
        if node not in known:
            raise ConfigError(
                f"{location}.nodes: the result has no node {node!r}; it has {listed(known) or 'none'}; name "
                "one in `outputs.nodes` of the job, and run it again"
            )
    of_nodes = run.acceleration.sel(node=list(wedge.inertia.nodes)).transpose("time", "node", "component")
    return np.asarray(ground + of_nodes.values.mean(axis=1))


def _water(
    surface: WedgeSurfaceConfig,
    polygon: Floats,
    wedges: WedgesConfig,
    time: Floats,
    run: xr.Dataset | None,
    table: tuple[Floats, Floats] | None,
    location: str,
) -> Floats:
    """Force of the water on a side, and its first moment, (nt, 4) [N, N m]: it pushes along the normal."""
    water = surface.water
    area, middle = area_and_middle(polygon)
    if isinstance(water, float):
        return np.tile(np.append(1.0, middle) * water * area, (len(time), 1))
    if isinstance(water, WaterOfJointConfig):
        pressure = water.share * _pressure_in_joint(water.joint, run, location)
        return np.asarray(pressure[:, None] * np.append(1.0, middle) * area)
    assert water is not None
    if isinstance(water, WaterLevelConfig):
        level = np.full(1, water.level)
    else:
        assert table is not None
        level = np.interp(time, *table)
    distinct, rows = np.unique(level, return_inverse=True)
    unit = water.share * wedges.water_density * wedges.gravity
    of_levels = unit * np.array([_hydrostatic(polygon, float(each)) for each in distinct])
    return np.asarray(np.broadcast_to(of_levels[rows], (len(time), 4)))


def _pressure_in_joint(name: str, run: xr.Dataset | None, location: str) -> Floats:
    """Mean pressure of the water in a joint of a result, (nt,) [Pa]."""
    if run is None:
        raise ConfigError(
            f"{location}.joint: water in a joint is that of a result; name one, or give `level`"
        )
    known = [str(joint) for joint in run.joint.values] if "joint_water_force" in run else []
    if name not in known:
        raise ConfigError(
            f"{location}.joint: the result has no water in a joint {name!r}; it has it in "
            f"{listed(known) or 'none'}; give `level`, or loads.joint_water in the job"
        )
    gaps = run.gap_joint.values == name
    projected = np.linalg.norm(run.gap_area.values[gaps] @ run.gap_normal.values[gaps])
    force = run.joint_water_force.sel(joint=name).transpose("time", "component").values
    return np.asarray(np.linalg.norm(force, axis=1) / projected)


def _hydrostatic(polygon: Floats, level: float) -> Floats:
    """Integrals of the depth below a level, and of depth times place, over the wet part of a polygon (4,).

    Depth is linear, so over a triangle of area A they are A sum(d) / 3 and A (sum(d) sum(x) + sum(d x)) / 12.
    """
    below = list[Floats]()
    for here, there in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if here[2] <= level:
            below.append(here)
        if (here[2] - level) * (there[2] - level) < 0.0:
            below.append(here + (level - here[2]) / (there[2] - here[2]) * (there - here))
    total = np.zeros(4)
    for k in range(1, len(below) - 1):
        corners = np.array([below[0], below[k], below[k + 1]])
        area = 0.5 * float(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])))
        depth = level - corners[:, 2]
        total[0] += area * depth.sum() / 3.0
        total[1:] += area * (depth.sum() * corners.sum(axis=0) + depth @ corners) / 12.0
    return total


def _thrusts(
    thrust: ThrustConfig, run: xr.Dataset | None, geometry: WedgeGeometry, count: int, location: str
) -> Iterator[tuple[str, Floats, Floats, Floats]]:
    """Names, forces (nt, 3), moments (nt, 3) about points, and these points (3,)."""
    if thrust.force is not None:
        at = geometry.centroid if thrust.at is None else np.array(thrust.at)
        yield "force", np.tile(thrust.force, (count, 1)), np.zeros((count, 3)), at
    if run is None:
        if thrust.needs_result:
            raise ConfigError(
                f"{location}: joints and sections press by forces of a result; name one, or give `force`"
            )
        return
    for name in thrust.joints or ():
        known = [str(joint) for joint in run.joint.values] if "joint" in run else []
        if name not in known:
            raise ConfigError(f"{location}.joints: the result has no joint {name!r}; it has {listed(known)}")
        between = [str(block) for block in run.joint_blocks.sel(joint=name).values]
        if thrust.on not in between:
            raise ConfigError(
                f"{location}.on: joint {name!r} is between {between[0]!r} and {between[1]!r}, not on "
                f"{thrust.on!r}; name one of these, or another joint"
            )
        if "joint_moment" not in run:
            raise ConfigError(f"{location}.joints: {_OLD}")
        joint, sign = run.sel(joint=name), 1.0 if thrust.on == between[1] else -1.0
        force, moment = (
            sign * joint[key].transpose("time", "component").values for key in ("joint_force", "joint_moment")
        )
        yield f"joint {name}", force, moment, joint.joint_middle.values
    for name in thrust.sections or ():
        known = [str(section) for section in run.section.values] if "section" in run else []
        if name not in known:
            raise ConfigError(
                f"{location}.sections: the result has no section {name!r}; it has {listed(known)}"
            )
        section = run.sel(section=name)
        force, moment = (
            section[key].transpose("time", ...).values @ section.section_axes.values
            for key in ("section_force", "section_moment")
        )
        yield f"section {name}", force, moment, section.section_centroid.values
