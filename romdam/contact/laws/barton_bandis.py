"""Friction of a rough rock joint, which falls with the normal stress."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.coulomb import refuse_other_friction
from romdam.contact.laws.law import MU_J, MU_K, NORMAL_FORCE, Law, Parameter

ROUGHNESS, STRENGTH, BASIC = range(3)
_STEEPEST = 70.0  # degrees: largest angle of friction, at low stress


class BartonBandis(Law):
    """mu = tan(phi_b + JRC log10(JCS / p)) on the resultant, in place of `friction`.

    The angle is phi_b = atan(mu_b) where the normal stress p exceeds JCS, and at most 70 degrees.

    References
    ----------
    Barton, Choubey, Rock Mech. 10 (1977) 1: the shear strength of rock joints, with the limit of 70 degrees
    at low stress.
    """

    section = "barton_bandis"
    parameters = (
        Parameter("JRC", "", most=20.0, meaning="Joint roughness coefficient."),
        Parameter("JCS", "Pa", above=True, per_area=True, meaning="Compressive strength of the joint wall."),
        Parameter("mu_b", "", most=2.0, meaning="Tangent of the basic friction angle."),
    )
    shear = True
    follows_step = True

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        return refuse_other_friction(cls.section, joint)

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        basic, p = math.degrees(math.atan(parameters[BASIC])), step[NORMAL_FORCE]
        angle = max(_STEEPEST, basic)
        if p > 0.0:
            rough = parameters[ROUGHNESS] * max(math.log10(parameters[STRENGTH] / p), 0.0)
            angle = min(basic + rough, angle)
        mu = math.tan(math.radians(angle))
        limit[MU_J], limit[MU_K] = mu, mu
