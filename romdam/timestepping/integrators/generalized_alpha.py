"""Generalised-alpha integration of a sparse system, the gaps condensed: what error is measured against.

The effective matrix is factored once, the gaps' flexibility H = B A^-1 B^T is made once, and a step is one
back-substitution. The joint force follows the gaps' springs within the step (`romdam.contact.problem`) and
acts over the whole of it, not averaged as in textbooks: averaged, it is wrong by 2.4 times at the record's
own step (the manual, "Why the force is constant over a step"). It follows them no earlier than the scheme
weighs the blocks' own springs, 1 - a_f of the way: half of the way makes energy (at rho_inf 0 forty times the
input of two masses that pound), and is of first order.

References
----------
Chung, Hulbert, J. Appl. Mech. 60 (1993) 371.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags_array

from romdam.contact.components import NORMAL
from romdam.contact.problem import GapMemory, GapProblem, gap_memory
from romdam.contact.softening import failed_law
from romdam.contact.solvers.state import iterations
from romdam.contact.step import commit_gaps, solve_gaps
from romdam.contact.strength import shear_strength
from romdam.core.arrays import Floats, Record, put, rows_like
from romdam.core.errors import ConvergenceError
from romdam.core.final_state import FinalState
from romdam.core.motion import Motion
from romdam.core.recorded import GAP_QUANTITIES, GapArrays, gap_fields, new_gap_arrays
from romdam.core.system import Complex, Coordinates, History, Rates, System
from romdam.core.threads import cpu_time
from romdam.linalg.factor import Factor
from romdam.timestepping.energy import ENERGIES, ledger
from romdam.timestepping.equilibrium import (
    GapState,
    ended_gaps,
    initial_state,
    system_gap_problem,
    take_over,
    with_water,
)
from romdam.timestepping.peaks import first_peaks, named_peaks, raise_peaks
from romdam.timestepping.prepared import Outcome, Progress, Simulation
from romdam.timestepping.settings import Settings, not_converged
from romdam.timestepping.steps import Steps, fixed_steps
from romdam.timestepping.support_motion import Carried

if TYPE_CHECKING:
    from romdam.config.sections.transient import TransientConfig


@dataclass(frozen=True)
class Scheme:
    """Coefficients of generalised-alpha: a_m, a_f weigh the old state; beta, gamma as Newmark's."""

    a_m: float
    a_f: float
    beta: float
    gamma: float


def scheme(rho_inf: float) -> Scheme:
    """Second-order scheme with a spectral radius rho_inf at infinite frequency."""
    a_m, a_f = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0), rho_inf / (rho_inf + 1.0)
    return Scheme(a_m, a_f, 0.25 * (1.0 - a_m + a_f) ** 2, 0.5 - a_m + a_f)


def scheme_rates(s: Scheme, dt: float, angle: Floats) -> tuple[Complex, Complex]:
    """Inertia over mass [1/s2] and velocity [1/s] of a unit displacement that turns by angles (nf,) a step.

    With them M a + C v + K u = f holds for the scheme's own motion, whose force is weighed as u and v are.
    """
    z = np.exp(1j * angle)
    rate = 1.0 - s.gamma + s.gamma * z
    moved = (rate + (z - 1.0) * (0.5 - s.beta + s.beta * z)) * dt
    weight = ((1.0 - s.a_m) * z + s.a_m) / ((1.0 - s.a_f) * z + s.a_f)
    return weight * (z - 1.0) ** 2 / (moved * dt), (z - 1.0) * rate / moved


@dataclass(slots=True)
class _Works:
    """Works since the start and energy stored in the gaps, as `ENERGIES`, and what the scheme took [J]."""

    input: float = 0.0
    damping: float = 0.0
    joint_work: float = 0.0
    friction: float = 0.0
    stored: float = 0.0
    numerical: float = 0.0

    def record(self) -> Record:
        """The `ENERGIES` of them."""
        return np.array(tuple(getattr(self, name) for name in ENERGIES.names or ()), ENERGIES)


class _State:
    """Displacement, velocity and acceleration, gaps and works at the last accepted step.

    Beside them stand the elastic force K u, the inertia M a and the load of the ground's motion, which the
    next step begins with.
    """

    def __init__(self, system: System, q: Floats, gaps: GapState, motion: Floats) -> None:
        self.u = q
        self.v = np.zeros_like(q)
        self.gaps, self.works = gaps.recorded(), _Works(stored=gaps.stored)
        self.carried = Carried.at_rest(system)
        self.elastic, self.load = system.K @ q, np.asarray(system.load @ motion)
        rest = system.force - self.load + system.B.T @ gaps.acting.ravel() - self.elastic
        massless = system.M.diagonal() == 0.0  # they follow by their stiffness, at once
        self.a = Factor(system.M + diags_array(massless.astype(float))).solve(np.where(massless, 0.0, rest))
        self.inertia = system.M @ self.a

    def begin(self) -> None:
        """Count works and means from here on."""
        self.works = _Works(stored=self.works.stored)
        for name, of in GAP_QUANTITIES.items():
            if of.adds_up:
                getattr(self.gaps, name)[:] = 0.0


@dataclass(frozen=True)
class _Stepper:
    """Constants of the scheme, and its step.

    A = (1-a_m) M + (1-a_f)(gamma dt C + beta dt^2 K) is factored, and X = A^-T B^T. H is symmetric with a
    gyroscopic C too, whose transpose has the signs of the water changed.

    The scheme takes energy from the motion besides the work of damping. The balance of a step times its
    displacement du, less the changes of the energies and the work of the mean ground acceleration g, is that
    energy. With d = 1/2 - a_f and k = beta - gamma/2, the balance holds M (dv/dt + d da), K (u_mean + d du)
    and load (g_mean + d dg), and dt v_mean = du - k dt^2 da; so it is d du.(K du + M da + load dg) +
    k dt dv.M da.
    """

    system: System
    scheme: Scheme
    dt: float
    factor: Factor
    X: Floats
    operator: csr_matrix
    transposed: csc_matrix
    problem: GapProblem

    @classmethod
    def factored(cls, system: System, s: Scheme, dt: float, midpoint: bool) -> Self:
        """Factor A, and make the gaps' problem of a step of dt [s]."""
        A = (1.0 - s.a_m) * system.M + (1.0 - s.a_f) * (s.gamma * dt * system.C + s.beta * dt**2 * system.K)
        less = None if system.drag is None else np.sqrt((1.0 - s.a_f) * s.gamma * dt) * system.drag
        factor = Factor(A, less)
        X = factor.solve(system.B.T.toarray(), transposed=system.gyroscopic)
        H = s.beta * dt**2 * np.asarray(system.B @ X)
        problem = system_gap_problem(system, H, dt, s.a_f / (1.0 - s.a_f) if midpoint else 0.0)
        operator = csr_matrix(system.B)
        return cls(system, s, dt, factor, X, operator, operator.T, problem)

    def advance(
        self,
        memory: GapMemory,
        state: _State,
        motion: Floats,
        carried: Carried,
        tolerance: float,
        interval: float,
    ) -> float:
        """Advance one step in place; the relative residual of the gap-space problem.

        Parameters
        ----------
        motion : (k,) what the columns of the load follow, at the step's end
        carried : jumps that moving supports make at its end
        interval : of the written rows [s]
        """
        s, dt, system = self.scheme, self.dt, self.system
        new, old = 1.0 - s.a_f, s.a_f  # weights of the step's end and start
        u_old, v_old, elastic_old, inertia_old, load_old = (
            state.u, state.v, state.elastic, state.inertia, state.load,
        )  # fmt: skip
        u_star = u_old + dt * v_old + dt**2 * (0.5 - s.beta) * state.a
        v_star = v_old + dt * (1.0 - s.gamma) * state.a
        load = np.asarray(system.load @ motion)
        right = system.force - new * load - old * load_old - s.a_m * inertia_old
        right -= system.damping_force(new * v_star + old * v_old)
        right -= system.K @ (new * u_star + old * u_old)
        w_free = self.operator @ u_star + s.beta * dt**2 * (self.X.T @ right) + carried.jump
        y = np.empty(len(w_free))
        residual = float(solve_gaps(self.problem, memory, state.gaps.state > 0, w_free, y, tolerance, False))
        if not residual <= tolerance:
            return residual
        gaps, works = state.gaps, state.works
        jump_old = gaps.jump.copy()
        works.stored, friction, fed = commit_gaps(self.problem, memory, y, gaps)
        acting = with_water(memory.force.reshape(gaps.jump.shape), memory.water)
        acting[:, NORMAL] -= self.problem.tension * gaps.jump[:, NORMAL]
        right += self.transposed @ acting.ravel()
        state.a = self.factor.solve(right)
        gaps.mean_traction[:] += dt / interval * acting
        state.u = u_star + s.beta * dt**2 * state.a
        state.v = v_star + s.gamma * dt * state.a
        state.elastic, state.inertia, state.load = system.K @ state.u, system.M @ state.a, load
        moved, rate = state.u - u_old, new * state.v + old * v_old
        damping = system.damping_force(rate)
        works.input += float((system.force - 0.5 * (load_old + load)) @ moved) + fed
        works.damping += dt * float(rate @ damping)
        works.joint_work += float((acting * (gaps.jump - jump_old)).sum()) - fed
        if carried is not state.carried:
            works.input -= float(acting.ravel() @ (carried.jump - state.carried.jump))
            state.carried = carried
        works.friction += friction
        # taken by the scheme: d du.(K du + M da + load dg) + k dt dv.M da, see the class
        M_da, dv = state.inertia - inertia_old, state.v - v_old
        force = state.elastic - elastic_old + M_da + load - load_old
        taken = (0.5 - s.a_f) * (moved @ force) + (s.beta - 0.5 * s.gamma) * dt * (dv @ M_da)
        works.numerical += float(taken) + float((moved - dt * rate) @ damping)
        return residual


class _Recorded(NamedTuple):
    """What a row of the histories holds.

    Attributes
    ----------
    gaps : of the gaps, the jumps at their positions
    memory : (L, n, s) what the gaps' further laws keep
    disp, vel, acc : (3 * number of probes,)
    u, v : (n,) unknowns and their rates; empty at full order
    energies : `romdam.timestepping.energy.ENERGIES` [J]
    kinetic, strain, numerical : energies of the blocks, and taken by the scheme since the start [J]
    """

    gaps: GapArrays
    memory: Floats
    disp: Floats
    vel: Floats
    acc: Floats
    u: Floats
    v: Floats
    energies: Record
    kinetic: Floats
    strain: Floats
    numerical: Floats


class _Rows:
    """Histories at the written steps, and peaks over all steps."""

    def __init__(
        self,
        system: System,
        state: _State,
        steps: Steps,
        samples: int,
        problem: GapProblem,
        memory: GapMemory,
    ) -> None:
        self.system, self.steps, self.problem, self.gap_memory = system, steps, problem, memory
        self.rows = rows_like(self._recorded(state), (samples - 1) // steps.stride + 1)
        self.peaks = first_peaks(self._at_points(state), state.gaps.traction)
        kept = samples if steps.stride > 1 else 0
        self.base_disp = np.zeros((kept, system.observe.shape[0]))
        if kept:
            self.base_disp[0] = system.observe @ state.u
        self._write(state, 0)

    def keep(self, state: _State, step: int) -> None:
        """Update the peaks, and write the row if the step has one."""
        raise_peaks(self.peaks, self._at_points(state), state.gaps.traction, step * self.steps.base)
        if len(self.base_disp):
            self.base_disp[step] = self.system.observe @ state.u
        if step % self.steps.stride == 0:
            self._write(state, step // self.steps.stride)

    def _at_points(self, state: _State) -> Floats:
        """Jumps at the gaps' very positions (ng, d)."""
        jump = state.gaps.jump
        if self.system.at_point is None:
            return jump
        more = self.system.more_at_points(state.u) + state.carried.more
        return np.asarray(jump + more.reshape(jump.shape))

    def _recorded(self, state: _State) -> _Recorded:
        system, works = self.system, state.works
        unknowns = slice(None) if system.reduced else slice(0)
        disp, vel, acc = (system.observe @ np.stack([state.u, state.v, state.a], axis=1)).T
        gaps = state.gaps
        if system.at_point is not None:
            gaps = GapArrays(**gap_fields(gaps) | {"jump": self._at_points(state)})
        return _Recorded(
            gaps=gaps,
            memory=self.gap_memory.history,
            disp=disp,
            vel=vel,
            acc=acc,
            u=state.u[unknowns],
            v=state.v[unknowns],
            energies=works.record(),
            kinetic=0.5 * (state.v @ (system.M @ state.v)),
            strain=0.5 * (state.u @ state.elastic),
            numerical=np.array(works.numerical),
        )

    def _write(self, state: _State, row: int) -> None:
        put(self.rows, row, self._recorded(state))
        state.gaps.mean_traction[:] = 0.0

    def history(self, stats: dict[str, float]) -> History:
        """The finished history."""
        rows, gaps = self.rows, self.rows.gaps
        strength, bonded = shear_strength(
            self.system.law.mu, self.problem.laws, rows.memory, gaps.jump[..., NORMAL], gaps.traction
        )
        return History(
            **gap_fields(gaps),
            strength=strength,
            bonded=bonded,
            time=np.arange(len(gaps.jump), dtype=np.float64) * self.steps.interval,
            disp=rows.disp,
            vel=rows.vel,
            acc=rows.acc,
            coordinates=Coordinates.of(rows.u, rows.v) if self.system.reduced else None,
            energy=ledger(rows.energies, rows.kinetic, rows.strain, rows.numerical),
            peaks=named_peaks(self.peaks),
            base_disp=self.base_disp,
            stats=stats,
            integrator=GeneralizedAlpha.name,
        )


@dataclass(frozen=True)
class GeneralizedAlpha:
    """The integrator of the unreduced mesh, and of modes that dashpots couple.

    Attributes
    ----------
    rho_inf : spectral radius at infinite frequency
    midpoint : whether joint forces follow their springs within the step, see above; else at its end
    """

    name: ClassVar[str] = "generalized_alpha"
    shifts: ClassVar[bool] = True
    resumes: ClassVar[bool] = False  # a row does not hold the acceleration that the scheme goes on from
    rho_inf: float = 0.9
    midpoint: bool = True

    @classmethod
    def configured(cls, transient: TransientConfig) -> Self:
        """Read `rho_inf`."""
        return cls(transient.rho_inf)

    def supports(self, system: System) -> None:
        """Take any system."""

    def steps(self, finest: float, coarse: float, interval: float | None) -> Steps:
        """Take the finest step throughout: another one is another factor."""
        return fixed_steps(finest, interval, coarse)

    def compared(self, history: History) -> Floats:
        """(nt, ng) openings, or displacements where there are no gaps."""
        return history.jump[..., NORMAL].copy() if history.jump.size else history.disp

    def advance(
        self, simulations: Sequence[Simulation], settings: Settings, progress: Progress
    ) -> list[Outcome]:
        """Integrate one simulation after another."""
        outcomes: list[Outcome] = []
        for one in simulations:
            try:
                outcomes.append(self._integrate(one, settings, progress))
            except ConvergenceError as error:
                outcomes.append(error)
        return outcomes

    def rates(self, dt: float) -> Rates:
        """See `scheme_rates`."""
        return partial(scheme_rates, scheme(self.rho_inf), dt)

    def _integrate(self, simulation: Simulation, settings: Settings, progress: Progress) -> History:
        start = cpu_time()
        (prepared, ground), tolerance = simulation, settings.tolerance
        dt, system = settings.steps.base, prepared.system
        stepper = prepared.cache.get_or_compute(
            ("stepper", dt), lambda: _Stepper.factored(system, scheme(self.rho_inf), dt, self.midpoint)
        )
        memory = gap_memory(stepper.problem)
        kept = None
        if isinstance(settings.start, FinalState):
            kept = settings.start.arrays
            q, gaps = kept["q"], ended_gaps(kept)
        else:
            q, gaps = initial_state(prepared, settings)
        take_over(memory, gaps)
        histories = system.histories(ground, dt, self.rates(dt))
        motion, lead, added = system.followed(histories.rows), histories.lead, settings.shift
        supports = histories.rows.get(Motion.SUPPORTS_DISPLACEMENT, np.zeros((0, motion.shape[1])))
        state = _State(system, q, gaps, motion.T[0])
        if kept is not None:
            state.v, state.a = kept["v"].copy(), kept["a"].copy()
            state.inertia = system.M @ state.a
            memory.spring[:], memory.last_step[:] = kept["spring"].ravel(), kept["last_step"]
        # an unloaded step, so that a first start compiles here and not in the timed loop
        n, N, unloaded = len(system.law), len(stepper.problem.W), gap_memory(stepper.problem)
        y = np.zeros(N)
        solve_gaps(stepper.problem, unloaded, np.zeros(n, dtype=np.bool_), np.zeros(N), y, 1.0, False)
        commit_gaps(stepper.problem, unloaded, y, new_gap_arrays(n, N // max(n, 1)))
        setup, loop = cpu_time() - start, cpu_time()
        total = ground.shape[1] - 1

        def advance(n: int) -> float:
            end = None if added is None else added[max(n + 1, 0)]
            carried = state.carried.after(supports[:, lead + n + 1], end)
            now, interval = motion[:, lead + n + 1], settings.steps.interval
            residual = stepper.advance(memory, state, now, carried, tolerance, interval)
            if not residual <= tolerance or memory.failure.law > 0:
                gap = system.law.gap_name(int(memory.failure.gap))
                failed = failed_law(stepper.problem.laws, memory, gap)
                raise ConvergenceError(failed or not_converged(n + 1, settings, residual, gap))
            return residual

        worst = max((advance(n) for n in range(-lead, 0)), default=0.0)
        state.begin()
        rows = _Rows(system, state, settings.steps, ground.shape[1], stepper.problem, memory)
        for n in range(total):
            worst = max(worst, advance(n))
            rows.keep(state, n + 1)
            if (n + 1) % 100 == 0 or n + 1 == total:
                progress(n + 1, total)
        all_iterations, most_iterations = iterations(memory.solver)
        stats = {
            "steps": float(total),
            "base_step": dt,
            "finest_step": dt,
            "solver_iterations": all_iterations,
            "largest_iterations": most_iterations,
            "largest_residual": worst,
            "setup_cpu_seconds": setup,
            "loop_cpu_seconds": cpu_time() - loop,
        }
        final = _final_state(state, memory, self.name)
        return replace(rows.history(stats), warnings=histories.warnings, final=final)


def _final_state(state: _State, memory: GapMemory, integrator: str) -> FinalState:
    """The state at the end of a run."""
    gaps, shape = state.gaps, state.gaps.jump.shape
    kept = {
        "q": state.u,
        "v": state.v,
        "a": state.a,
        "jump": gaps.jump,
        "traction": gaps.traction,
        "unilateral": memory.force.reshape(shape),
        "spring": memory.spring.reshape(shape),
        "accumulated_slip": memory.accumulated_slip,
        "contact": gaps.state,
        "memory": memory.history,
        "last_step": memory.last_step,
        "water": memory.water,
        "stored": np.array([state.works.stored]),
    }
    return FinalState({name: np.array(values) for name, values in kept.items()}, integrator, {})
