"""More friction until a gap slides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from romdam.contact.laws.law import MU_J, MU_K, SLIDING, Law, Parameter, Past, Row

STATIC_J, STATIC_K, DYNAMIC_J, DYNAMIC_K = range(4)
(SLIDES,) = range(1)


class StaticFriction(Law):
    """Friction of a gap until it slides, and again once it sticks; `friction` is then the dynamic one."""

    parameters = (Parameter("friction_static", "", most=2.0, both=True),)
    memory = ("slides",)
    shear = True

    @classmethod
    def row(cls, joint: Mapping[str, Any], area: float) -> tuple[float, ...]:
        return (*joint["friction_static"], *joint["friction"])

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        static, friction = joint["friction_static"], joint["friction"]
        if min(s - d for s, d in zip(static, friction, strict=True)) < 0.0:
            return f"friction_static {static} must be at least friction {friction}; raise it, or leave it out"
        return None

    @classmethod
    def resumed(cls, parameters: Row, past: Past) -> tuple[float, ...]:
        return (1.0 if past.sliding else 0.0,)

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        if memory[SLIDES] == 0.0:
            limit[MU_J] = max(limit[MU_J], parameters[STATIC_J])
            limit[MU_K] = max(limit[MU_K], parameters[STATIC_K])

    @staticmethod
    def release(parameters: Any, memory: Any, step: Any) -> bool:
        more = parameters[STATIC_J] > parameters[DYNAMIC_J] or parameters[STATIC_K] > parameters[DYNAMIC_K]
        if memory[SLIDES] == 0.0 and step[SLIDING] > 0.0 and more:
            memory[SLIDES] = 1.0
            return True
        return False

    @staticmethod
    def commit(parameters: Any, memory: Any, step: Any) -> None:
        memory[SLIDES] = step[SLIDING]
