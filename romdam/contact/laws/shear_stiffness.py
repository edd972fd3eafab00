"""Stick stiffness."""

from __future__ import annotations

from romdam.contact.laws.law import Law, Parameter


class ShearStiffness(Law):
    """K_s acts from the accumulated slip while the gap sticks; what bounds it is other laws'."""

    parameters = (Parameter("shear_stiffness", "N/m^3", per_area=True, per_gap="N/m", default=0.0),)
    array = "K_s"
