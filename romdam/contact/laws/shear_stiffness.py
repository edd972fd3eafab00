"""Stick stiffness, and that of joints that are elastic."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.law import COHESION_J, COHESION_K, Law, Parameter


class ShearStiffness(Law):
    """Stiffness K_s while the gap sticks, from the accumulated slip; friction, cohesion or a key limit it.

    A joint whose tension_stiffness is its normal_stiffness is elastic: there K_s acts without a bound unless
    another law bounds it. "auto" is ten times the shear stiffness of the elements beside the joint.
    """

    parameters = (
        Parameter("shear_stiffness", "N/m^3", per_area=True, per_gap="N/m", auto=True, default=0.0),
    )
    array = "K_s"


class ElasticShear(Law):
    """Shear without a bound, closed or open, of a joint that is elastic along its normal."""

    parameters = ShearStiffness.parameters
    shear = True

    @classmethod
    def is_on(cls, joint: Mapping[str, Any]) -> bool:
        """Tell whether K_nz is K_n, both as numbers of one kind, and there is a K_s."""
        K_n, K_s = joint["normal_stiffness"], joint["shear_stiffness"]
        return bool(K_n == joint["tension_stiffness"] and K_s not in (0.0, {"per_gap": 0.0}))

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        limit[COHESION_J], limit[COHESION_K] = math.inf, math.inf
