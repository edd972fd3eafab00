"""Normal stiffness of a closed gap, finite or rigid."""

from __future__ import annotations

from romdam.contact.laws.law import Law, Parameter


class Penalty(Law):
    """Stiffness K_n of the closed gap; "rigid" permits no overlap, "auto" is ten times the elements' own."""

    parameters = (
        Parameter(
            "normal_stiffness",
            "N/m^3",
            above=True,
            per_area=True,
            per_gap="N/m",
            rigid=True,
            auto=True,
            required=True,
        ),
    )
    array = "K_n"
