"""The base class of the integrators that propagate uncoupled modes exactly.

A diagonal system needs no equation solver in time: each mode is propagated by its own exact step, and only
the joint force couples the modes. What the integrators of this family choose differently is which modes are
dynamic, how steps are cut, and where within a step the joint force is taken. `ModalIntegrator` has the common
answers, a fixed step with every mode dynamic, and sorts simulations into batches that the time loop
(`romdam.timestepping.modal.loop`) takes together.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError
from romdam.core.system import History, System
from romdam.timestepping.modal.mode_split import ModeSplit, split_by_mass
from romdam.timestepping.modal.runs import integrate_batch
from romdam.timestepping.prepared import Outcome, Prepared, Progress, Simulation
from romdam.timestepping.settings import Settings
from romdam.timestepping.steps import Steps, fixed_steps

if TYPE_CHECKING:
    from romdam.config.sections.transient import TransientConfig

_CACHE_BYTES = 0.4e6  # of a run's matrix over its gaps: with more, several runs crowd a core's cache


class ModalIntegrator:
    """Exact modal propagation at a fixed step, every mode dynamic; a subclass changes what it does otherwise.

    Attributes
    ----------
    name, shifts, resumes : see `romdam.timestepping.prepared.Integrator`
    midpoint : whether joint forces follow their springs at a point within the step, see
        `romdam.contact.problem`; else at its end
    force_change : a step is cut where the change of a gap's normal force over it moves the gap faster than
        this share of the peak ground velocity; inf cuts none
    shear_change : the same of the shear of all closed gaps together, and of the speed at which a gap that
        slides over a step may move back at its end
    conserving : whether the mean joint force over a step does the work that the gaps store, see
        `romdam.timestepping.modal.massless_boundary`
    """

    name: ClassVar[str]
    shifts: ClassVar[bool] = True
    resumes: ClassVar[bool] = True
    midpoint: bool = False
    force_change: float = math.inf
    shear_change: float = math.inf
    conserving: bool = False

    @classmethod
    def configured(cls, transient: TransientConfig) -> Self:
        """Take the options that there are: none."""
        return cls()

    def supports(self, system: System) -> None:
        """Refuse modes that something couples.

        Raises
        ------
        ConfigError
            for a system that is not diagonal.
        """
        if not system.diagonal:
            raise ConfigError(
                f"transient.integrator: {self.name} needs a reduced model whose modes nothing "
                "couples; use generalized_alpha, or model.order: reduced, rock without viscous faces and "
                "incompressible water"
            )

    def steps(self, finest: float, coarse: float, interval: float | None) -> Steps:
        """Take the finest step throughout."""
        return fixed_steps(finest, interval, coarse)

    def compared(self, history: History) -> Floats:
        """(nt, ng, d) openings and slips, or displacements where there are no gaps."""
        return history.jump.copy() if history.jump.size else history.disp

    def split(self, prepared: Prepared, step: float) -> ModeSplit:
        """Choose the dynamic modes for a base step [s]."""
        return prepared.cache.get_or_compute("split", lambda: split_by_mass(prepared.system))

    def advance(
        self, simulations: Sequence[Simulation], settings: Settings, progress: Progress
    ) -> list[Outcome]:
        """Integrate the simulations in batches whose systems have the same dynamic modes and kind of gaps."""
        outcomes: dict[int, Outcome] = {}
        total = sum(one.ground.shape[1] - 1 for one in simulations)
        for batch in _batches(simulations, settings.steps.base):
            before = sum(simulations[i].ground.shape[1] - 1 for i in outcomes)

            def report(done: int, _: int, before: int = before) -> None:
                progress(before + done, total)

            results = integrate_batch([simulations[i] for i in batch], self, settings, report)
            outcomes.update(zip(batch, results, strict=True))
        return [outcomes[i] for i in range(len(simulations))]


def _batches(simulations: Sequence[Simulation], step: float) -> Iterator[list[int]]:
    """Numbers of the simulations to take together: their arrays can stand side by side, and runs gain by it.

    Arrays stand side by side where the modes are the same (stiffness, load, static force, and which are
    dynamic) and the gaps are of one kind (directions, laws, tension, merged by symmetry). The systems may
    differ in damping and in the joints' parameters. The samples of a suite differ in these, but also in
    materials and water levels, which change the modes.

    The products with the modes gain by a batch, little since those of a lone run take four rows at a time.
    What the gaps carry from step to step (an inverse, or the gathered Delassus operator) is each run's own,
    and beyond a core's cache runs crowd each other out (`tests/benchmarks/bench_batch.py`): then every run is
    a batch by itself.

    Parameters
    ----------
    step : base step, by which integrators choose the dynamic modes [s]
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, (prepared, _) in enumerate(simulations):
        system, law, symmetry = prepared.system, prepared.system.law, prepared.symmetry
        integrator = prepared.integrator
        assert isinstance(integrator, ModalIntegrator)
        dynamic = integrator.split(prepared, step).dynamic
        modes = (system.K.diagonal(), np.asarray(system.load), system.force, dynamic)
        laws = law.has_memory, tuple(rows.law for rows in law.laws), bool(law.has_memory and law.mu.any())
        merged = b"" if symmetry is None else symmetry.gaps.tobytes()
        gaps = (law.directions, *laws, bool(law.K_nz.any()), merged)
        groups.setdefault((*(array.tobytes() for array in modes), *gaps), []).append(i)
    for group in groups.values():
        law = simulations[group[0]].prepared.system.law
        matrix_bytes = 8.0 * (law.directions * len(law)) ** 2
        most = len(group) if matrix_bytes < _CACHE_BYTES else 1
        for first in range(0, len(group), most):
            yield group[first : first + most]
