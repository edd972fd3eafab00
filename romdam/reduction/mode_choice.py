"""How many modes and residual vectors a reduced basis has."""

from __future__ import annotations

from dataclasses import dataclass, replace

from romdam.config.sections.job import ModelConfig
from romdam.core.errors import ReductionError
from romdam.linalg.solvers import AUTO, Solving
from romdam.reduction.methods.residual_vectors import FINER_VECTORS

_ALL = 2**62  # modes, more than any block has
_SOME = 30  # number of modes below a cut-off frequency that is assumed before it is known


@dataclass(frozen=True)
class ModeChoice:
    """Size of a reduced basis.

    Attributes
    ----------
    count : number of fixed-interface modes, in free-interface form of free modes; a block that has fewer
        takes all. None if `cutoff` is given
    cutoff : frequency below which all these modes are kept [Hz]; None if `count` is given
    residual_vectors : number of residual vectors
    solving : choice of the solver; it affects results by round-off only
    finer : whether it is the finer basis of the error estimate
    """

    count: int | None = None
    cutoff: float | None = None
    residual_vectors: int = 0
    solving: Solving = AUTO
    finer: bool = False

    @property
    def keeps_all(self) -> bool:
        """Whether all modes are kept."""
        return self.count == _ALL

    @property
    def expected_modes(self) -> int:
        """Number of modes, as far as it is known before they are computed."""
        return _SOME if self.count is None else self.count

    @property
    def columns(self) -> int:
        """Estimated number of solutions that modes and residual vectors need."""
        return 4 * self.expected_modes + self.residual_vectors

    def with_rigid_motions(self, number: int) -> ModeChoice:
        """Return a choice that keeps at least the lowest modes of a part that are rigid motions.

        Without one of them what joints alone hold would not be in balance, whatever the static answers.

        Parameters
        ----------
        number : of rigid motions that supports, and retained DOFs, leave
        """
        if self.count is None:  # they are below every cut-off
            return self
        return replace(self, count=max(self.count, number))

    def report(self) -> dict[str, object]:
        """Return what a report says of the choice, as plain values."""
        return {} if self.cutoff is None else {"cutoff_hz": self.cutoff}

    @property
    def stored(self) -> dict[str, object]:
        """What the basis depends on, for the keys of stored bases."""
        finer: dict[str, object] = {"finer": FINER_VECTORS} if self.finer else {}
        return finer | {
            "count": self.count,
            "cutoff": self.cutoff,
            "residual_vectors": self.residual_vectors,
        }


ALL_MODES = ModeChoice(count=_ALL)


def mode_choice(model: ModelConfig) -> ModeChoice:
    """Return the modes that a configuration asks for.

    Raises
    ------
    ReductionError
        where `model.modes` is auto and no number has been chosen yet.
    """
    if model.modes == "all":
        return ALL_MODES
    if model.modes == "auto":
        raise ReductionError("model.modes is auto, and none has been chosen yet; give a number or all")
    solving = Solving(model.solver, model.memory)
    return ModeChoice(model.modes, model.cutoff, model.residual_vectors, solving=solving)
