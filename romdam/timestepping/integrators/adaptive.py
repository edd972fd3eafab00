"""Exact modal propagation with steps cut where contact changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from romdam.core.final_state import FinalState
from romdam.core.system import History
from romdam.timestepping.modal.integrator import ModalIntegrator
from romdam.timestepping.modal.symmetry import expand, merge_equivalent_contacts, merged_final, merged_start
from romdam.timestepping.prepared import Outcome, Prepared, Progress, Simulation
from romdam.timestepping.settings import Settings, Start
from romdam.timestepping.steps import Steps, cut_steps

if TYPE_CHECKING:
    from romdam.config.sections.transient import TransientConfig


@dataclass(frozen=True)
class Adaptive(ModalIntegrator):
    """The integrator of damped reduced models.

    Attributes
    ----------
    force_change, shear_change, midpoint : see `ModalIntegrator`
    merge_contacts : whether gaps that provably move alike are integrated as one
    """

    name: ClassVar[str] = "adaptive"
    force_change: float = 0.003
    shear_change: float = 0.00001
    midpoint: bool = True
    merge_contacts: bool = True

    @classmethod
    def configured(cls, transient: TransientConfig) -> Self:
        """Let joint forces change less within a step where more accuracy is asked for than usual."""
        return cls(force_change=min(transient.step_accuracy or 1.0, cls.force_change))

    def steps(self, finest: float, coarse: float, interval: float | None) -> Steps:
        """Cut a coarse step down to the finest."""
        return cut_steps(finest, coarse, interval)

    def advance(
        self, simulations: Sequence[Simulation], settings: Settings, progress: Progress
    ) -> list[Outcome]:
        """Integrate with equivalent contacts merged where there are some, and expand the histories."""
        smaller, settings_of_smaller = self._smaller(simulations, settings)
        outcomes = super().advance(smaller, settings_of_smaller, progress)
        for i, ((prepared, _), outcome) in enumerate(zip(smaller, outcomes, strict=True)):
            if prepared.symmetry is not None and isinstance(outcome, History):
                outcomes[i] = expand(outcome, prepared.symmetry)
            elif prepared.symmetry is not None:  # the message has to name a gap of the whole
                outcomes[i] = super().advance([simulations[i]], settings, progress)[0]
        return outcomes

    def _smaller(
        self, simulations: Sequence[Simulation], settings: Settings
    ) -> tuple[Sequence[Simulation], Settings]:
        """The simulations to integrate, and settings; a start that does not mirror itself merges none."""
        smaller = [Simulation(self._merged(one, settings), one.ground) for one in simulations]
        if settings.start is None:
            return smaller, settings
        first, kept = smaller[0].prepared, settings.start
        symmetry, whole = first.symmetry, first.whole
        if symmetry is None or whole is None or any(one.prepared is not first for one in smaller):
            return simulations, settings
        if isinstance(kept, FinalState):
            start: Start | FinalState | None = merged_final(kept, symmetry)
        else:
            start = merged_start(kept, symmetry, whole.system)
        return (simulations, settings) if start is None else (smaller, replace(settings, start=start))

    def _merged(self, simulation: Simulation, settings: Settings) -> Prepared:
        """The system to integrate: with merged contacts where some are equivalent under the ground motion."""
        prepared, ground = simulation
        added = settings.shift is not None or prepared.system.pseudo_static is not None
        if not self.merge_contacts or added:
            return prepared
        shaken = ground.any(axis=1)
        key = shaken.tobytes()
        if key not in prepared.merged:
            active = np.flatnonzero(shaken)
            symmetry = merge_equivalent_contacts(prepared.system, active, prepared.symmetries)
            prepared.merged[key] = None if symmetry is None else prepared.smaller(symmetry)
        return prepared.merged[key] or prepared
