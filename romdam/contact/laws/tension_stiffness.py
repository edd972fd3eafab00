"""Stiffness of an open gap."""

from __future__ import annotations

from romdam.contact.laws.law import Law, Parameter


class TensionStiffness(Law):
    """K_nz acts in both signs of the opening; K_n beyond it acts in compression only."""

    parameters = (Parameter("tension_stiffness", "N/m^3", per_area=True, per_gap="N/m", default=0.0),)
    array = "K_nz"
