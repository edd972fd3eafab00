"""The protocol of an integrator, which owns its options, its choice of steps and its step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, Protocol, Self

from romdam.core.arrays import Floats
from romdam.core.errors import ConvergenceError
from romdam.core.system import History, System
from romdam.timestepping.prepared import Simulation
from romdam.timestepping.settings import Settings
from romdam.timestepping.steps import Steps

if TYPE_CHECKING:
    from romdam.config.sections.transient import TransientConfig

Outcome = History | ConvergenceError
Progress = Callable[[int, int], None]  # of (steps done, steps in all)


class Integrator(Protocol):
    """An integrator and its options: a frozen dataclass whose fields are the options.

    Attributes
    ----------
    name : its key in `romdam.core.integrators.INTEGRATORS`
    shifts : whether it honours `shift` of the settings, on which certificates rest
    resumes : whether it honours `start`, without which estimates begin where the record does: from a row that
        a run has written it gives the run's own rows, to round-off, where nothing that it takes from the
        whole record differs. `simulate` refuses what an integrator does not honour. `only_jumps` is leave to
        write less, which any integrator may pass over. A `start` that is a `FinalState` goes only to the
        integrator that has made it, as `History.final`, and gives the run of both parts, to round-off
    """

    name: ClassVar[str]
    shifts: ClassVar[bool]
    resumes: ClassVar[bool]

    @classmethod
    def configured(cls, transient: TransientConfig) -> Self:
        """Read the options from a configuration."""
        ...

    def supports(self, system: System) -> None:
        """Refuse a system that it does not suit.

        Raises
        ------
        ConfigError
            saying why, and what to take instead.
        """
        ...

    def steps(self, finest: float, coarse: float, interval: float | None) -> Steps:
        """Choose the steps of a run.

        Parameters
        ----------
        finest : step where contact changes [s]
        coarse : longest step that is worth taking, the record's own [s]
        interval : of the written rows; every base step is written where None [s]
        """
        ...

    def compared(self, history: History) -> Floats:
        """Values that two runs at different steps are compared by: histories (nt, n), or (nt, ng, d) of
        openings and slips, or (n,) peaks."""
        ...

    def advance(
        self, simulations: Sequence[Simulation], settings: Settings, progress: Progress
    ) -> list[Outcome]:
        """Integrate each simulation from its initial state to its end; they may be taken together.

        Parameters
        ----------
        simulations : all prepared for this integrator
        progress : called with (base steps done, base steps in all), of all simulations

        Returns
        -------
        list, in their order: the history, or why there is none
        """
        ...


def not_converged(step: int, settings: Settings, residual: float, place: str) -> str:
    """Message for a step whose gap-space problem did not converge."""
    asked = settings.to_accuracy
    remedy = "give transient.finest_step in place of accuracy" if asked else "halve transient.finest_step"
    return (
        f"step {step}, t = {step * settings.steps.base:.6g} s: the gap-space problem stopped at a relative "
        f"residual of {residual:.2g}, limit {settings.tolerance:.2g}, farthest at {place}; "
        f"{remedy}, or lower the friction"
    )
