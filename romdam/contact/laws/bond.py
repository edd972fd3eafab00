"""A bond with tensile strength and cohesion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.law import (
    COHESION_J,
    COHESION_K,
    PULLED,
    SLIDING,
    TENSION,
    Law,
    Parameter,
    Past,
    Row,
)

STRENGTH, COHESION = range(2)
(BROKEN,) = range(1)


class Bond(Law):
    """Mohr-Coulomb with a tension cut-off, lost as a whole and for good at the first opening or slip.

    The closed gap holds with `normal_stiffness` in tension too, up to this traction; the stuck gap holds
    c A + mu p of shear. Gaps with an initial gap have none.
    """

    parameters = (
        Parameter("tensile_strength", "Pa", per_area=True, default=0.0),
        Parameter("cohesion", "Pa", per_area=True, default=0.0),
    )
    memory = ("broken",)

    @classmethod
    def needs_shear(cls, joint: Mapping[str, Any]) -> bool:
        return bool(joint["cohesion"] > 0.0)

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        cohesion, friction = joint["cohesion"], max(*joint["friction"], *(joint["friction_static"] or (0.0,)))
        if friction * joint["tensile_strength"] > cohesion:
            return (
                f"cohesion {cohesion:g} Pa must be at least friction times tensile_strength, "
                f"{friction * joint['tensile_strength']:g} Pa, or the bond slips before it opens; "
                "raise cohesion, or lower tensile_strength"
            )
        return None

    @classmethod
    def initial(cls, parameters: Row, gap: float) -> tuple[float, ...]:
        return (1.0 if gap > 0.0 else 0.0,)

    @classmethod
    def resumed(cls, parameters: Row, past: Past) -> tuple[float, ...]:
        return (1.0 if past.has_moved or past.gap > 0.0 else 0.0,)

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        if memory[BROKEN] == 0.0:
            limit[TENSION] = parameters[STRENGTH]
            limit[COHESION_J], limit[COHESION_K] = parameters[COHESION], parameters[COHESION]

    @staticmethod
    def release(parameters: Any, memory: Any, step: Any) -> bool:
        if memory[BROKEN] == 0.0 and (step[SLIDING] > 0.0 or step[PULLED] > 0.0):
            memory[BROKEN] = 1.0
            return True
        return False
