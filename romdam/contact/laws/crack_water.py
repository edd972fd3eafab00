"""Water that enters a gap when it opens."""

from __future__ import annotations

from typing import Any

from romdam.contact.laws.law import OPENING, PULLED, WATER, Law, Past, Row

(EXCESS,) = range(1)
(OPEN,) = range(1)


class CrackWater(Law):
    """The reservoir's pressure in an open gap: more than the diagram's, at once, until the gap closes.

    Its parameter is the force by which it exceeds the diagram's [N]; `loads.joint_water` says where.
    """

    memory = ("open",)
    strength = False

    @classmethod
    def key_names(cls) -> tuple[str, ...]:
        return ("loads.joint_water.crack",)

    @classmethod
    def initial(cls, parameters: Row, gap: float) -> tuple[float, ...]:
        return (1.0 if gap > 0.0 else 0.0,)

    @classmethod
    def resumed(cls, parameters: Row, past: Past) -> tuple[float, ...]:
        return (1.0 if past.opening > 0.0 and (past.has_moved or past.gap > 0.0) else 0.0,)

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        if memory[OPEN] > 0.0:
            limit[WATER] = parameters[EXCESS]

    @staticmethod
    def release(parameters: Any, memory: Any, step: Any) -> bool:
        if memory[OPEN] == 0.0 and step[PULLED] > 0.0:
            memory[OPEN] = 1.0
            return True
        return False

    @staticmethod
    def commit(parameters: Any, memory: Any, step: Any) -> None:
        if step[OPENING] <= 0.0:
            memory[OPEN] = 0.0
