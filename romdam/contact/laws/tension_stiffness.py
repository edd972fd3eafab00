"""Stiffness of an open gap."""

from __future__ import annotations

from romdam.contact.laws.law import Law, Parameter


class TensionStiffness(Law):
    """Stiffness K_nz of the open gap; the closed gap has K_n."""

    parameters = (Parameter("tension_stiffness", "N/m^3", per_area=True, per_gap="N/m", default=0.0),)
    array = "K_nz"
