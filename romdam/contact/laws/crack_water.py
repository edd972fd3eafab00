"""Water that enters a gap when it opens, or is lost from it."""

from __future__ import annotations

from typing import Any

from romdam.contact.laws.law import NORMAL_FORCE, OPENING, PULLED, WATER, Law, Past, Row

(EXCESS,) = range(1)
(OPEN,) = range(1)


class CrackWater(Law):
    """Another pressure in an open gap than in a closed one, at once, until the gap closes.

    Its parameter is the force by which it exceeds that of the closed gap [N], below zero where water is lost;
    `loads.joint_water` says where. Lost water is back when the closed gap can carry it: before, it would open
    the gap again, and be lost.
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
        if step[OPENING] <= 0.0 and step[NORMAL_FORCE] >= -parameters[EXCESS]:
            memory[OPEN] = 0.0
