"""Coulomb friction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from romdam.contact.components import ALONG_J, ALONG_K
from romdam.contact.laws.law import MU_J, MU_K, Law, Parameter
from romdam.core.errors import listed


class Coulomb(Law):
    """|t| <= mu p: on the resultant where mu is equal along j and k, else along each.

    References
    ----------
    Zivkovic et al., "Using of gap element for contraction joints modeling in seismic analysis of concrete
    arch dams": mu_y, mu_z. The accumulated slip that the force is measured from is ours: the source writes
    the slip force along the total shear displacement, which dissipates wrongly in cycles; on first loading
    both agree.
    """

    parameters = (Parameter("friction", "", most=2.0, both=True, default=(0.0, 0.0)),)
    shear = True
    array = "mu"

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        limit[MU_J], limit[MU_K] = parameters[ALONG_J], parameters[ALONG_K]


IN_PLACE_OF_FRICTION = ("velocity_friction", "slip_weakening", "barton_bandis")  # sections of laws


def refuse_other_friction(section: str, joint: Mapping[str, Any]) -> str | None:
    """Say that a law that stands in place of friction meets another friction; None where it is alone.

    Parameters
    ----------
    section : of that law
    joint : every key of every law
    """
    others = [name for name in ("friction", "friction_static") if any(joint[name] or (0.0,))]
    others += [name for name in IN_PLACE_OF_FRICTION if name != section and joint[name]]
    if not others:
        return None
    return f"{section} stands in place of {listed([f'`{name}`' for name in others])}; leave one of them out"
