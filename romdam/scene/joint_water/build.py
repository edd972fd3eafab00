"""Put the configuration's water into the joints of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from romdam.config.sections.joint_water import JointWaterConfig
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.crack_water import CrackWater
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Joint
from romdam.core.system import LawRows
from romdam.scene.joint_water.cracked_base import CrackedBase
from romdam.scene.joint_water.diagram import Diagram, PressureOutline, mean_pressure

_LEAST = 0.1  # of the direction that must lie in the joint's plane


def with_water(
    joint: Joint, water: JointWaterConfig, blocks: Mapping[str, Block], gravity: float, location: str
) -> Joint:
    """The joint with the force of the water on every gap.

    Parameters
    ----------
    gravity : [m/s2]
    location : of the entry in the configuration, for messages

    Raises
    ------
    ConfigError
        for water below the joint, a direction across it, and drains or a waterstop outside.
    """
    assert joint.face is not None
    points = blocks[joint.face.block].points
    bottom = float(points[np.concatenate([f.ravel() for f in joint.face.facets]), 2].min())
    if water.level <= bottom:
        raise ConfigError(
            f"{location}.level: the water is not above the foot of joint {joint.name!r}: {water.level:g} m, "
            f"and it begins at {bottom:g} m; raise it, or leave the joint out"
        )
    outline = None
    if water.downstream is not None:
        downstream = np.array(water.downstream) / np.linalg.norm(water.downstream)
        across = np.cross(joint.axes[:, 0].mean(axis=0), downstream)
        size = float(np.linalg.norm(across))
        if size < _LEAST:
            raise ConfigError(
                f"{location}.downstream: {list(water.downstream)} is normal to joint {joint.name!r} (sine "
                f"{size:.2g}, limit {_LEAST:g}); give the direction from its heel to its toe"
            )
        outline = PressureOutline.of(points, joint.face, downstream, across / size)
        key, at = ("waterstop", water.waterstop) if water.drains is None else ("drains.at", water.drains.at)
        heel, toe, _ = outline.lines(points[joint.corner])
        shortest = int(np.argmin(toe - heel))
        length = float((toe - heel)[shortest])
        if at is not None and at >= length:
            where = ", ".join(f"{x:.6g}" for x in points[joint.corner[shortest]])
            raise ConfigError(
                f"{location}.{key}: {at:g} m from the heel is outside joint {joint.name!r}, which is "
                f"{length:.6g} m long on the line through ({where}); lower it, or give the joint an entry "
                "of its own"
            )
    diagram = Diagram(water, water.density * gravity, outline)
    pressure = joint.of_corners(mean_pressure(points, joint.face, diagram))
    wet = replace(joint, water=pressure * joint.area)
    if water.needs_rest:
        assert outline is not None and joint.face is not None
        wet = replace(wet, uplift=CrackedBase.of(joint, water, points, diagram, location))
        if water.earthquake in ("zero", "full"):  # which gaps are open at rest is known then
            rows = LawRows(source_of(CrackWater), np.zeros((len(pressure), 1)), pressure > 0.0, shear=False)
            wet = replace(wet, laws=(*joint.laws, rows))
    elif water.crack == "full":
        full = joint.of_corners(mean_pressure(points, joint.face, replace(diagram, outline=None)))
        excess = (full - pressure) * joint.area
        rows = LawRows(source_of(CrackWater), excess[:, None], excess > 0.0, shear=False)
        wet = replace(wet, laws=(*joint.laws, rows))
    return wet
