"""Rock wedges under the forces of a result: histories of the factor of safety, and the table of them."""

from __future__ import annotations

import numpy as np
import xarray as xr

from romdam.config.sections.wedges import ThrustConfig, WedgesConfig
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, listed
from romdam.postprocess.sliding import row_seconds
from romdam.postprocess.wedges import permanent_displacement, slide, trend_and_plunge, wedge_geometry

Row = tuple[str, ...]
HEAD: Row = (
    "wedge", "volume [m3]", "weight [MN]", "factor at rest", "moves on", "least factor", "at [s]", "moves on",
    "trend [deg]", "plunge [deg]", "x", "y", "z", "below 1 [s]", "slides [mm]",
)  # fmt: skip
HELD, LIFTS = "held", "lifts off"


def wedge_dataset(wedges: WedgesConfig, run: xr.Dataset | None, source: str) -> xr.Dataset:
    """Sliding of every wedge at every written time of a run, or at rest without one.

    Parameters
    ----------
    run : a result; None for constant forces alone
    source : the file of the wedges, for messages

    Raises
    ------
    ConfigError
        for a wedge that is open, and for forces that the result does not have.
    """
    time = np.zeros(1) if run is None else np.asarray(run.time.values, dtype=float)
    most = max(len(wedge.planes) for wedge in wedges.wedges.values())
    names, planes = list(wedges.wedges), np.full((len(wedges.wedges), most), "", dtype=object)
    areas, water = np.full((2, len(names), most), np.nan)
    volume, factor, driving, resisting, displacement = [], [], [], [], []
    direction, normal_force = [], np.full((len(time), len(names), most), np.nan)
    contact = np.zeros((len(time), len(names), most), dtype=np.int8)
    for k, (name, wedge) in enumerate(wedges.wedges.items()):
        location = f"{source}: wedges.{name}"
        geometry = wedge_geometry(wedge, wedges, location)
        mass, count = wedge.density * geometry.volume, len(wedge.planes)
        force = _thrust(wedge.thrust, run, len(time), f"{location}.thrust")
        force = force + geometry.water @ geometry.normals + mass * np.array([0.0, 0.0, -wedges.gravity])
        if wedge.inertia and run is not None:
            force = force - mass * run.ground_acceleration.transpose("time", "component").values
        sliding = slide(geometry, wedge, force)
        planes[k, :count], areas[k, :count] = geometry.names[:count], geometry.areas[:count]
        water[k, :count] = geometry.water[:count]
        volume.append(geometry.volume)
        factor.append(np.where(np.isfinite(sliding.factor), sliding.factor, np.nan))
        driving.append(sliding.driving)
        resisting.append(sliding.resisting)
        displacement.append(permanent_displacement(sliding, mass, time))
        direction.append(sliding.direction)
        normal_force[:, k, :count], contact[:, k, :count] = sliding.normal_force, sliding.contact
    of_time, of_planes = ("time", "wedge"), ("time", "wedge", "plane")
    density = np.array([wedge.density for wedge in wedges.wedges.values()])
    variables = {
        "wedge_volume": (("wedge",), np.array(volume), "m3", "volume of the wedge"),
        "wedge_weight": (("wedge",), density * volume * wedges.gravity, "N", "weight of the wedge"),
        "wedge_plane": (("wedge", "plane"), planes.astype(str), "", "name of the plane"),
        "wedge_plane_area": (("wedge", "plane"), areas, "m2", "area of the plane"),
        "wedge_plane_water": (("wedge", "plane"), water, "N", "force of the water on the plane"),
        "wedge_factor_of_safety": (
            of_time,
            np.array(factor).T,
            "1",
            "resisting over driving force of the wedge; NaN where its planes leave no direction free",
        ),
        "wedge_driving_force": (of_time, np.array(driving).T, "N", "force along the direction of sliding"),
        "wedge_resisting_force": (
            of_time,
            np.array(resisting).T,
            "N",
            "friction and cohesion of the planes in contact",
        ),
        "wedge_displacement": (
            of_time,
            np.array(displacement).T,
            "m",
            "permanent displacement while the factor is below 1, of a rigid block (Newmark)",
        ),
        "wedge_slip_direction": (
            (*of_time, "component"),
            np.stack(direction, axis=1),
            "1",
            "unit vector in which the wedge would slide or lift off; 0 where no direction is free",
        ),
        "wedge_plane_normal_force": (
            of_planes,
            -normal_force,
            "N",
            "effective normal force on the plane, compression negative",
        ),
        "wedge_plane_in_contact": (
            of_planes,
            contact,
            "1",
            "1 where the plane stays in contact, 0 where it opens",
        ),
    }
    dataset = xr.Dataset(
        {
            name: (dims, values, {"long_name": text} | ({"units": units} if units else {}))
            for name, (dims, values, units, text) in variables.items()
        },
        {
            "time": ("time", time, {"long_name": "time since the start of the record", "units": "s"}),
            "wedge": ("wedge", np.array(names, dtype=str), {"long_name": "name of the wedge"}),
            "component": ("component", np.array(["x", "y", "z"]), {"long_name": "global axis"}),
        },
    )
    dataset.attrs = {"wedges_file": source, "north": np.array(wedges.north)}
    if run is not None:
        dataset.attrs |= {key: run.attrs[key] for key in ("title", "record", "configuration_sha256")}
    return dataset


def _thrust(thrust: ThrustConfig, run: xr.Dataset | None, count: int, location: str) -> Floats:
    """Force on the wedge out of a result and of the file, (count, 3) [N]."""
    force = np.zeros((count, 3)) + (0.0 if thrust.force is None else np.array(thrust.force))
    if run is None:
        if thrust.needs_result:
            raise ConfigError(
                f"{location}: joints and sections press by forces of a result; name one, or give `force`"
            )
        return force
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
        if "joint_force" not in run:
            raise ConfigError(
                f"{location}.joints: the result of an earlier version has no joint_force; run it again"
            )
        on_J = run.joint_force.sel(joint=name).transpose("time", "component").values
        force += on_J if thrust.on == between[1] else -on_J
    for name in thrust.sections or ():
        known = [str(section) for section in run.section.values] if "section" in run else []
        if name not in known:
            raise ConfigError(
                f"{location}.sections: the result has no section {name!r}; it has {listed(known)}"
            )
        section = run.sel(section=name)
        force += section.section_force.transpose("time", ...).values @ section.section_axes.values
    return force


def wedge_rows(dataset: xr.Dataset) -> list[Row]:
    """The table under `HEAD`: a row for each wedge, at rest (the first time) and at its least factor."""
    rows = []
    time, north = dataset.time.values, dataset.attrs["north"]
    seconds = row_seconds(time) if len(time) > 1 else np.zeros(1)
    for name in map(str, dataset.wedge.values):
        wedge = dataset.sel(wedge=name)
        factor = wedge.wedge_factor_of_safety.values
        # without a free direction nothing moves, whatever the forces
        known = np.where(np.isnan(factor), np.inf, factor)
        least = int(known.argmin())
        trend, plunge = trend_and_plunge(wedge.wedge_slip_direction.values[least], north)
        moves = np.isfinite(known[least])
        vector = wedge.wedge_slip_direction.values[least]
        below = f"{seconds[known < 1.0].sum():.3g}" if len(time) > 1 else "-"
        rows.append(
            (
                name,
                f"{float(wedge.wedge_volume):.6g}",
                f"{1e-6 * float(wedge.wedge_weight):.6g}",
                _factor_text(known[0]),
                _moves_on(wedge, 0),
                _factor_text(known[least]),
                f"{time[least]:.3f}",
                _moves_on(wedge, least),
                *((f"{trend:.1f}", f"{plunge:.1f}") if moves else ("-", "-")),
                *(f"{x:.3f}" if moves else "-" for x in vector),
                below,
                f"{1e3 * float(wedge.wedge_displacement[-1]):.4g}" if len(time) > 1 else "-",
            )
        )
    return rows


def _factor_text(factor: float) -> str:
    return f"{factor:.4g}" if np.isfinite(factor) else HELD


def _moves_on(wedge: xr.Dataset, row: int) -> str:
    """The planes that it slides on at a time, in words."""
    if np.isnan(float(wedge.wedge_factor_of_safety[row])):
        return HELD
    touching = wedge.wedge_plane.values[wedge.wedge_plane_in_contact.values[row] > 0]
    return ", ".join(map(str, touching)) or LIFTS
