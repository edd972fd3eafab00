"""Friction that falls, or rises, with the speed of sliding."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.coulomb import refuse_other_friction
from romdam.contact.laws.law import DT, MU_J, MU_K, Law, Parameter, Past, Row
from romdam.contact.laws.law import RATE as STEP_RATE

STATIC, DYNAMIC, SPEED = range(3)
(RATE,) = range(1)


class VelocityFriction(Law):
    """mu = mu_d + (mu_s - mu_d) exp(-|v| / v_c) on the resultant, in place of `friction`.

    v is the speed over the step that is solved. The speed of steps before would do for a rigid block; where
    the joint gives, slip follows the force at once, and the shear would alternate from step to step.

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
    memory = ("rate",)
    shear = True
    follows_step = True

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        return refuse_other_friction(cls.section, joint)

    @classmethod
    def resumed(cls, parameters: Row, past: Past) -> tuple[float, ...]:
        return (past.rate if past.sliding else 0.0,)

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        rate = step[STEP_RATE] if step[DT] > 0.0 else memory[RATE]
        mu = parameters[DYNAMIC] + (parameters[STATIC] - parameters[DYNAMIC]) * math.exp(
            -rate / parameters[SPEED]
        )
        limit[MU_J], limit[MU_K] = mu, mu

    @staticmethod
    def commit(parameters: Any, memory: Any, step: Any) -> None:
        memory[RATE] = step[STEP_RATE]
