"""Friction that is lost with the path of the slip."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.coulomb import refuse_other_friction
from romdam.contact.laws.law import MU_J, MU_K, SLIP_J, SLIP_K, Law, Parameter

STATIC, DYNAMIC, LENGTH = range(3)
(PATH,) = range(1)


class SlipWeakening(Law):
    """mu = mu_d + (mu_s - mu_d) exp(-s / d_c) on the resultant, in place of `friction`.

    s is the path of the slip so far, with that of the step that is solved; it never falls.

    References
    ----------
    Ida, J. Geophys. Res. 77 (1972) 3796: friction that depends on the slip; the exponential decay in place of
    the linear one has no kink.
    """

    section = "slip_weakening"
    parameters = (
        Parameter("mu_s", "", most=2.0, meaning="Coefficient of friction before any slip."),
        Parameter("mu_d", "", most=2.0, meaning="Coefficient of friction after much slip."),
        Parameter("d_c", "m", above=True, meaning="Path of the slip over which friction falls."),
    )
    memory = ("path",)
    shear = True
    follows_step = True

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        return refuse_other_friction(cls.section, joint)

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        path = memory[PATH] + math.hypot(step[SLIP_J], step[SLIP_K])
        mu = parameters[DYNAMIC] + (parameters[STATIC] - parameters[DYNAMIC]) * math.exp(
            -path / parameters[LENGTH]
        )
        limit[MU_J], limit[MU_K] = mu, mu

    @staticmethod
    def commit(parameters: Any, memory: Any, step: Any) -> None:
        memory[PATH] += math.hypot(step[SLIP_J], step[SLIP_K])
