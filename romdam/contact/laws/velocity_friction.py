"""Friction that falls, or rises, with the speed of sliding."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.law import MU_J, MU_K, Law, Parameter, Past, Row

STATIC, DYNAMIC, SPEED = range(3)
RATE, LAST = range(2)


class VelocityFriction(Law):
    """mu = mu_d + (mu_s - mu_d) exp(-|v| / v_c) on the resultant, in place of `friction`.

    v is the speed that the last two steps lead to in the middle of the next, if it is as long: within a step
    the bound is constant, which leaves the problem of the step as easy as Coulomb's. The speed of the last
    step alone would leave an error of first order in the step.

    References
    ----------
    Constantinou, Mokha, Reinhorn, J. Struct. Eng. 116 (1990) 455: the law of sliding bearings, there rising.
    """

    section = "velocity_friction"
    parameters = (
        Parameter("mu_s", "", most=2.0, meaning="Coefficient of friction at rest."),
        Parameter("mu_d", "", most=2.0, meaning="Coefficient of friction of fast sliding."),
        Parameter("v_c", "m/s", above=True, meaning="Velocity over which friction falls."),
    )
    memory = ("rate", "last")
    shear = True

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        if any(joint["friction"]) or joint["friction_static"] is not None:
            return "velocity_friction stands in place of `friction` and `friction_static`; leave these out"
        return None

    @classmethod
    def resumed(cls, parameters: Row, past: Past) -> tuple[float, ...]:
        rate = past.rate if past.sliding else 0.0
        return (rate, rate)

    @staticmethod
    def limit(parameters: Any, memory: Any, limit: Any) -> None:
        fall = math.exp(-max(2.0 * memory[RATE] - memory[LAST], 0.0) / parameters[SPEED])
        mu = parameters[DYNAMIC] + (parameters[STATIC] - parameters[DYNAMIC]) * fall
        limit[MU_J], limit[MU_K] = mu, mu

    @staticmethod
    def commit(
        parameters: Any, memory: Any, opening: float, sliding: bool, rate_j: float, rate_k: float
    ) -> None:
        memory[LAST] = memory[RATE] if sliding else 0.0
        memory[RATE] = math.sqrt(rate_j**2 + rate_k**2) if sliding else 0.0
