"""A system made ready for an integrator, and the protocol of an integrator.

An integrator owns its options, its choice of steps and its step. What a system needs once for all its runs is
kept with the two of them.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol, Self

from romdam.core.arrays import Floats
from romdam.core.errors import ConvergenceError
from romdam.core.final_state import FinalState
from romdam.core.system import History, System
from romdam.timestepping.modal.symmetry import Symmetry
from romdam.timestepping.operator_cache import OperatorCache
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


@dataclass(frozen=True, eq=False)
class Prepared:
    """A system, its integrator, and the operators that their runs share.

    Attributes
    ----------
    system : the open-joint system
    integrator : with its options
    cache : factors, mode splits, propagators and flexibilities, by what they depend on beside the system
    merged : the same with equivalent contacts merged, by the components that are shaken; None where they
        differ
    symmetries : which contacts are equivalent, see `merge_equivalent_contacts`; shared with systems that
        differ in damping and in their joints' parameters at most
    propagators : of modes over a step, by their frequencies and damping; shared as `symmetries` are
    symmetry, whole : how this system with merged contacts stands for a whole one, and that one
    compares_orders : whether the state at rest is found for the reversed order of loads too, and a wide range
        warned of; not worth its time where nobody reads the warnings
    """

    system: System
    integrator: Integrator
    cache: OperatorCache = field(default_factory=OperatorCache)
    merged: dict[bytes, Prepared | None] = field(default_factory=dict)
    symmetries: dict[Hashable, Symmetry | None] = field(default_factory=dict)
    propagators: OperatorCache = field(default_factory=OperatorCache)
    symmetry: Symmetry | None = None
    whole: Prepared | None = None
    compares_orders: bool = True

    @property
    def goes_on_from(self) -> FinalState | None:
        """The state of another run that the scene's runs go on from; None where they begin at rest."""
        return None if self.system.initial is None else self.system.initial.going_on

    def smaller(self, symmetry: Symmetry) -> Prepared:
        """Prepare the system with merged contacts for the same integrator."""
        shared = self.propagators
        return Prepared(symmetry.system, self.integrator, propagators=shared, symmetry=symmetry, whole=self)


class Simulation(NamedTuple):
    """One run: a prepared system and its ground motion, see `romdam.timestepping.simulate.simulate`."""

    prepared: Prepared
    ground: Floats
