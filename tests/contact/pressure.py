"""Friction that falls with pressure."""

from typing import Any

from romdam.contact.laws.law import MU_J, MU_K, NORMAL_FORCE, Law, Parameter

MU, AT_FORCE, POWER = range(3)


class PressureFriction(Law):
    """mu = mu_0 (p / p_0)^-power, p the normal stress: at most twice mu_0."""

    section = "pressure_friction"
    parameters = (
        Parameter("mu_0", "", most=1.0),
        Parameter("p_0", "Pa", above=True, per_area=True),
        Parameter("power", "", most=0.9),
    )
    shear = True
    follows_step = True

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        pressed = max(step[NORMAL_FORCE] / parameters[AT_FORCE], 1e-6)
        mu = parameters[MU] * min(pressed ** -parameters[POWER], 2.0)
        limit[MU_J], limit[MU_K] = mu, mu
