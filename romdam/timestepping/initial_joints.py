"""Joints that begin with what they remember of another run, under any loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.contact.laws.law import Law
from romdam.contact.problem import every_law, law_memory
from romdam.core.arrays import Floats
from romdam.core.model_signature import law_key
from romdam.core.system import System


def with_joint_state(system: System) -> System:
    """The system whose joints have slipped, and lost, what they had in the state that its runs begin with.

    A law that the joints had not got then starts afresh, or as construction and grouting have left it.
    """
    if system.initial is None:
        return system
    law, kept = system.law, system.initial.final
    slipped: Floats = np.zeros((0, 2))
    if law.directions > 1 and kept.arrays["accumulated_slip"].any():
        slipped = np.array(kept.arrays["accumulated_slip"])

    def fresh(each: type[Law], values: Floats, gap: int) -> tuple[float, ...]:
        return each.initial(values, law.gap[gap])

    memory = law.memory.copy() if law.memory.size else law_memory(law, fresh)
    start, rows_then = memory.copy(), {name: k for k, name in enumerate(kept.laws)}
    for k, rows in enumerate(every_law(law)):
        key = law_key(rows.law)
        if key in rows_then:
            then, both = kept.arrays["memory"][rows_then[key]], rows.on & kept.laws[key]
            memory[k, both, : then.shape[1]] = then[both, : memory.shape[2]]
    changed = bool(law.memory.size or (memory != start).any())
    remembered = replace(law, slipped=slipped, memory=memory if changed else np.zeros((0, 0, 0)))
    return replace(system, law=remembered, load_steps={})  # the loads act since that run began
