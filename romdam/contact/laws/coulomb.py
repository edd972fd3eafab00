"""Coulomb friction."""

from __future__ import annotations

from typing import Any

from romdam.contact.components import ALONG_J, ALONG_K
from romdam.contact.laws.law import MU_J, MU_K, Law, Parameter


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
