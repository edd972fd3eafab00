"""Put the configuration's water into the joints of a scene."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from romdam.config.sections.joint_water import JointWaterConfig
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.crack_water import CrackWater
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Joint
from romdam.core.system import LawRows
from romdam.scene.joint_water.diagram import Diagram, Outline
from romdam.scene.joint_water.faces import mean_pressure

_log = logging.getLogger(__name__)

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
            f"{location}.level: the water is not above the foot of joint {joint.name!r}: {water.level:g} "
            "m, and "
            f"it begins at {bottom:g} m; raise it, or leave the joint out"
        )
    outline = _outline(joint, water, points, location) if water.downstream is not None else None
    diagram = Diagram(water, water.density * gravity, outline)
    if outline is not None:
        _refuse_outside(joint, water, outline, points, location)
    pressure = mean_pressure(points, joint.face, diagram)[joint.corner]
    wet = replace(joint, water=pressure * joint.area)
    if water.crack == "full":
        full = mean_pressure(points, joint.face, replace(diagram, outline=None))[joint.corner]
        wet = replace(wet, laws=(*joint.laws, _entering((full - pressure) * joint.area)))
    force = ", ".join(f"{f / 1e6:.6g}" for f in wet.water_resultant)
    _log.info(
        "%s: joint %s: up to %.4g kPa; on %s: (%s) MN",
        location, joint.name, pressure.max() / 1e3, joint.blocks[1], force,
    )  # fmt: skip
    return wet


def _entering(excess: Floats) -> LawRows:
    return LawRows(source_of(CrackWater), excess[:, None], excess > 0.0, shear=False)


def _outline(joint: Joint, water: JointWaterConfig, points: Floats, location: str) -> Outline:
    assert joint.face is not None and water.downstream is not None
    downstream = np.array(water.downstream) / np.linalg.norm(water.downstream)
    across = np.cross(joint.axes[:, 0].mean(axis=0), downstream)
    size = float(np.linalg.norm(across))
    if size < _LEAST:
        raise ConfigError(
            f"{location}.downstream: {list(water.downstream)} is normal to joint {joint.name!r} (sine "
            f"{size:.2g}, limit {_LEAST:g}); give the direction from its heel to its toe"
        )
    return Outline.of(points, joint.face, downstream, across / size)


def _refuse_outside(
    joint: Joint, water: JointWaterConfig, outline: Outline, points: Floats, location: str
) -> None:
    key, at = ("waterstop", water.waterstop) if water.drains is None else ("drains.at", water.drains.at)
    if at is None:
        return
    heel, toe, _ = outline.lines(points[joint.corner])
    shortest = int(np.argmin(toe - heel))
    length = float((toe - heel)[shortest])
    if at >= length:
        where = ", ".join(f"{x:.6g}" for x in points[joint.corner[shortest]])
        raise ConfigError(
            f"{location}.{key}: {at:g} m from the heel is outside joint "
            f"{joint.name!r}, which is {length:.6g} m long on the line through ({where}); lower it, or give "
            "the joint an entry of its own"
        )
