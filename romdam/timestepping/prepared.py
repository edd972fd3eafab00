"""A system made ready for an integrator: what is made once, and used by every run."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from romdam.core.arrays import Floats
from romdam.core.final_state import FinalState
from romdam.core.system import System
from romdam.timestepping.operator_cache import OperatorCache

if TYPE_CHECKING:
    from romdam.timestepping.integrators.protocol import Integrator
    from romdam.timestepping.modal.symmetry import Symmetry


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
    symmetry, whole : how this system with merged contacts stands for a whole one, and that one
    """

    system: System
    integrator: Integrator
    cache: OperatorCache = field(default_factory=OperatorCache)
    merged: dict[bytes, Prepared | None] = field(default_factory=dict)
    symmetries: dict[Hashable, Symmetry | None] = field(default_factory=dict)
    symmetry: Symmetry | None = None
    whole: Prepared | None = None

    @property
    def goes_on_from(self) -> FinalState | None:
        """The state of another run that the scene's runs go on from; None where they begin at rest."""
        return None if self.system.initial is None else self.system.initial.going_on

    def smaller(self, symmetry: Symmetry) -> Prepared:
        """Prepare the system with merged contacts for the same integrator."""
        return Prepared(symmetry.system, self.integrator, symmetry=symmetry, whole=self)


class Simulation(NamedTuple):
    """One run: a prepared system and its ground motion, see `romdam.timestepping.simulate.simulate`."""

    prepared: Prepared
    ground: Floats
