"""A normal dashpot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.law import Law, Parameter


class Dashpot(Law):
    """Normal dashpot per area of the closed gap; it never pulls."""

    parameters = (Parameter("viscosity", "N*s/m^3", per_area=True, default=0.0),)
    array = "viscosity"

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        if joint["normal_stiffness"] == "rigid":
            return "viscosity needs a finite `normal_stiffness`, not rigid; give a stiffness, or leave it out"
        return None
