"""Shear keys."""

from __future__ import annotations

import math
from typing import Any

from romdam.contact.laws.law import COHESION_J, COHESION_K, OPENING, Law, Parameter, Past, Row

DEPTH, HOLDS_J, HOLDS_K = range(3)
(OUT,) = range(1)


class ShearKey(Law):
    """No sliding while the opening is less than the depth, closed or open, along the local axes named.

    A key that comes back in holds where it then is.
    """

    section = "shear_key"
    parameters = (
        Parameter("depth", "m", above=True, meaning="Opening from which the keys let the joint slide."),
        Parameter("directions", "axes", default=("j", "k"), meaning="Local axes along which they hold."),
    )
    memory = ("out",)
    shear = True

    @classmethod
    def initial(cls, parameters: Row, gap: float) -> tuple[float, ...]:
        return (1.0 if gap > parameters[DEPTH] else 0.0,)

    @classmethod
    def resumed(cls, parameters: Row, past: Past) -> tuple[float, ...]:
        return (1.0 if past.opening > parameters[DEPTH] else 0.0,)

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        if memory[OUT] == 0.0:
            if parameters[HOLDS_J] > 0.0:
                limit[COHESION_J] = math.inf
            if parameters[HOLDS_K] > 0.0:
                limit[COHESION_K] = math.inf

    @staticmethod
    def release(parameters: Any, memory: Any, step: Any) -> bool:
        if memory[OUT] == 0.0 and step[OPENING] > parameters[DEPTH]:
            memory[OUT] = 1.0
            return True
        return False

    @staticmethod
    def commit(parameters: Any, memory: Any, step: Any) -> None:
        if step[OPENING] <= parameters[DEPTH]:
            memory[OUT] = 0.0
