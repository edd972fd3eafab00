"""Grouting of a joint under pressure."""

from __future__ import annotations

from romdam.contact.laws.law import Law, Parameter


class Grouting(Law):
    """Compression that stays in the joint from its grouting, before all other loads."""

    parameters = (Parameter("grouting_pressure", "Pa", most=1e8, per_area=True, default=0.0),)
    array = "grout"
