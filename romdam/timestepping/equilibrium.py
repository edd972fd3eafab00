"""Nonlinear static equilibrium under the static loads, by the gap-space problem.

**The path.** Friction, bonds and cracks remember, so a state at rest depends on how the loads came. They are
applied kind by kind in the order of the scene (`System.load_steps`), each in one increment from the state
before. Over an increment the joints' memory stands still: slip is the return to the cone of the whole
increment, and is committed at its end. So the state depends on the loads and their order, and not on axes, on
the order of blocks and joints, on masses, or on how the solver gets there. An increment whose equilibrium is
not found is halved.

**The solver.** K q = f + B^T p with p the gaps' law at B q. Where nothing but joints holds a block K is
singular; then the proximal point iteration (K + s M)(q' - q) = f + B^T p' - K q is taken until q rests. Its
fixed points are the equilibria, each iteration is the same gap-space problem with the memory of the
increment's start, and motion that no force drives stays put. s grows where a step does not converge, and
shrinks where several have.

Gaps that are rigid in meeting planes determine each other (where three blocks meet, two jumps give the
third), and W is singular. Then the iteration is proximal in the forces too: W + c I, with -c p of the last
iteration on the other side, water that entered included: a compliance against changes of the force alone.
At rest every law holds exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from romdam.contact.components import NORMAL
from romdam.contact.laws.law import NORMAL_FORCE, OPENING
from romdam.contact.problem import GapMemory, GapProblem, gap_memory, gap_problem
from romdam.contact.softening import law_energies, put_limits, refuse_failed_law
from romdam.contact.solvers.state import forget_product, make_hasty, solver_state
from romdam.contact.step import commit_gaps, solve_gaps
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, ConvergenceError, NoEquilibriumError
from romdam.core.recorded import GapArrays, new_gap_arrays
from romdam.core.system import System
from romdam.linalg.factor import Factor
from romdam.timestepping.limit_analysis import find_collapse
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings, Start

_SHIFT = (2.0 * np.pi * 0.5) ** 2  # [1/s2] proximal term: far below the bonded structure, far above round-off
_GROWTH, _CALM, _SHRINK = 16.0, 4, 0.25  # of it: where a step fails, and after so many that did not
_MOST_SHIFT = (2.0 * np.pi * 1000.0) ** 2  # [1/s2] where the blocks no longer move
_BALANCED = 1e-10  # of the largest load: less, left unbalanced, is round-off
_MAX_ITERATIONS = 500  # of the static iteration in an increment; limit
_HALVINGS = 4  # of an increment whose equilibrium is not found
_MOST_WATER = 200  # equilibria of an increment, until the gaps keep the water that has entered
_DOUBTFUL = 30  # iterations, most scenes rest within 10, after which limit analysis is asked
_REST = 1e-9  # relative change of q that counts as rest, or 10 times the gaps' tolerance
_NO_MOTION = 1e-12  # [m] largest coordinate of q below which rest is not relative to it
_HISTORY = 1  # of what an increment commits: where the memory of the further laws stands
_ROUND_OFF = 1e-13  # of the displacement without joint force, of which q is a small difference
_SINGULAR = 1e-9  # of W's diagonal: a smaller part of W does not tell forces apart
_YIELDING = 1e-4  # of W's mean diagonal, the proximal compliance where W is singular
_TIGHT = 1e-12  # residual asked of the gap-space problem, so that the iteration can converge


@dataclass(frozen=True)
class GapState:
    """The gaps at one instant.

    Attributes
    ----------
    jump : (n, d) opening (with the initial gap) and slip [m]
    force : (n, d) compression and shear on side J [N]
    state : (n,) open, stick or slip
    p_c : (N,) the solver's force, its warm start [N]
    accumulated_slip : (n, 2) [m]; empty without friction
    stored : energy in the gaps [J]
    history : (L, n, s) see `romdam.contact.problem.GapMemory`; empty where it is that of unloaded gaps
    water : (n,) force of the water that laws put into the gaps; empty without further laws [N]
    """

    jump: Floats
    force: Floats
    state: NDArray[np.uint8]
    p_c: Floats
    accumulated_slip: Floats
    stored: float
    history: Floats = field(default_factory=lambda: np.zeros((0, 0, 0)))
    water: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def acting(self) -> Floats:
        """(n, d) force on side J of contact and of that water [N]."""
        return with_water(self.force, self.water)

    @property
    def yielding_force(self) -> Floats:
        """(n, d) the solver's force with that water, to which the proximal compliance yields [N]."""
        return with_water(self.p_c.reshape(self.jump.shape), self.water)

    def recorded(self) -> GapArrays:
        """What a run that starts here records of the gaps at its start."""
        arrays = new_gap_arrays(*self.jump.shape)
        arrays.jump[:], arrays.traction[:], arrays.state[:] = self.jump, self.force, self.state
        arrays.water[: len(self.water)] = self.water
        return arrays


def with_water(force: Floats, water: Floats) -> Floats:
    """Joint forces (..., n, d) with water (..., n) along the normals, or without where it is empty [N]."""
    total = force.copy()
    if water.shape[-1]:
        total[..., NORMAL] += water
    return total


def system_gap_problem(
    system: System,
    H: Floats,
    dt: float = np.inf,
    most_ratio: float = 0.0,
    single_flexibility: Floats | None = None,
) -> GapProblem:
    """Make the gap-space problem for one flexibility H; see `romdam.contact.problem.gap_problem`."""
    return gap_problem(H, system.law, dt, most_ratio, single_flexibility)


def take_over(memory: GapMemory, gaps: GapState) -> None:
    """Give a solver's memory the gaps of a state to start from."""
    memory.force[:], memory.accumulated_slip[:] = gaps.p_c, gaps.accumulated_slip
    spring = memory.spring.reshape(gaps.jump.shape)
    spring[:, NORMAL] = np.minimum(gaps.jump[:, NORMAL], 0.0)
    if len(gaps.accumulated_slip):
        spring[:, 1:] = gaps.jump[:, 1:] - gaps.accumulated_slip
    if len(gaps.history):
        memory.history[:] = gaps.history


def undeformed(system: System) -> tuple[Floats, GapState]:
    """The undeformed state at rest; an initial penetration carries its force from the first step on.

    Raises
    ------
    ConfigError
        where a rigid gap starts pressed in: it would hold no finite energy, and the first step make some.
    """
    law = system.law
    pressed = np.isinf(law.K_n) & (law.gap < 0.0)
    if pressed.any():
        i = int(np.argmax(pressed))
        raise ConfigError(
            f"joints: a rigid gap cannot start pressed in, got an initial gap of {law.gap[i]:.4g} m "
            f"at gap {i}, limit 0; set loads.initial_state: static, or give a finite normal_stiffness"
        )
    return _unloaded(system)


def _unloaded(system: System) -> tuple[Floats, GapState]:
    """Zero displacement (n,), and the gaps with their initial openings and slips, without force."""
    law = system.law
    n, d = len(law), law.directions
    jump = np.zeros((n, d))
    jump[:, NORMAL] = law.gap
    slipped = np.zeros((n if d == 3 else 0, 2))
    if d == 3 and len(law.slip):
        jump[:, 1:] = law.slip
    if d == 3 and len(law.slipped):
        slipped = law.slipped.copy()
    stiffness = np.where(law.gap < 0.0, np.where(np.isinf(law.K_n), 0.0, law.K_n), law.K_nz)
    water: Floats = np.zeros(0)
    if law.has_memory:  # laws may put water into gaps that carry no load
        problem = system_gap_problem(system, np.zeros((n * d, n * d)))
        memory = gap_memory(problem)
        put_limits(problem, memory)
        water = memory.water
    empty = GapState(
        jump=jump,
        force=np.zeros((n, d)),
        state=np.zeros(n, dtype=np.uint8),
        p_c=np.zeros(n * d),
        accumulated_slip=slipped,
        stored=float((0.5 * stiffness * law.gap**2).sum()),
        history=law.memory.copy(),
        water=water,
    )
    return np.zeros(system.size), empty


def _rests_unloaded(system: System) -> bool:
    """Tell whether joints with further laws rest undeformed: nothing presses, pulls or remembers.

    Their strengths would leave forces of the solver's tolerance, and those displacements that never rest.
    """
    law = system.law
    acts = (law.gap < 0.0) | ((law.gap > 0.0) & (law.K_nz > 0.0))  # presses, or pulls the joint shut
    if system.force.any() or not law.has_memory or law.remembers or acts.any():
        return False
    return not _unloaded(system)[1].water.any()


def initial_state(
    prepared: Prepared, settings: Settings, steps: dict[float, ProximalStep] | None = None
) -> tuple[Floats, GapState]:
    """The state at rest that a run starts from, made once for all of them; not to be changed.

    Parameters
    ----------
    steps : as in `static_equilibrium`

    Raises
    ------
    ConfigError, ConvergenceError
        as `undeformed` and `static_equilibrium` do.
    """
    system, static, tolerance = prepared.system, settings.initial_state == "static", settings.tolerance
    return prepared.cache.get_or_compute(
        ("initial", static, tolerance if static else 0.0),
        lambda: static_equilibrium(system, tolerance, steps) if static else undeformed(system),
    )


def resumed(system: System, start: Start) -> GapState:
    """The gaps of a state to go on from; the accumulated slip follows from its shear force."""
    law, d = system.law, system.law.directions
    tension = law.K_nz * start.jump[:, NORMAL]
    p_c, slip = start.traction.copy(), np.zeros((0, 2))
    history = np.zeros((0, 0, 0)) if start.memory is None else start.memory
    problem = system_gap_problem(system, np.zeros((len(law) * d, len(law) * d)))
    memory = gap_memory(problem)
    if len(history):
        memory.trial[:] = memory.history[:] = history
        memory.step[:, OPENING], memory.step[:, NORMAL_FORCE] = start.jump[:, NORMAL], p_c[:, NORMAL]
    put_limits(problem, memory)
    bonded = memory.limits.tension > 0.0
    p_c[:, NORMAL] = np.where(bonded, p_c[:, NORMAL], np.maximum(p_c[:, NORMAL] + tension, 0.0))
    compliance = problem.compliance.reshape(-1, d)
    if d == 3:
        slip = start.jump[:, 1:] + compliance[:, 1:] * start.traction[:, 1:]
    stored = 0.5 * (compliance * p_c**2).sum() + 0.5 * (tension * start.jump[:, NORMAL]).sum()
    if problem.laws is not None:
        stored += sum(law_energies(problem.laws, memory, i)[0] for i in range(len(law)))
    closed = (p_c[:, NORMAL] > 0.0).astype(np.uint8)
    return GapState(
        start.jump.copy(),
        start.traction.copy(),
        closed,
        p_c.ravel(),
        slip,
        float(stored),
        history,
        memory.water.copy(),
    )


def ended_gaps(kept: Mapping[str, NDArray[Any]]) -> GapState:
    """The gaps of a final state; `kept` are its arrays."""
    return GapState(
        jump=kept["jump"],
        force=kept["traction"],
        state=kept["contact"].astype(np.uint8),
        p_c=kept["unilateral"].ravel(),
        accumulated_slip=kept["accumulated_slip"],
        stored=float(kept["stored"][0]),
        history=kept["memory"],
        water=kept["water"],
    )


def rest_shift(system: System) -> float:
    """Share of M that is added to K so that it can be factored; 0 where supports hold every block [1/s2]."""
    return _SHIFT if system.floating else 0.0


def static_equilibrium(
    system: System, tolerance: float, steps: dict[float, ProximalStep] | None = None, *, reverse: bool = False
) -> tuple[Floats, GapState]:
    """Find the equilibrium under the static loads, applied in their order from the undeformed state on.

    Parameters
    ----------
    steps : factored for a system that differs in its static force at most; gains those of this one
    reverse : whether the loads come in the reversed order

    Returns
    -------
    (q, gaps) : (n,) displacement and the gaps in equilibrium

    Raises
    ------
    NoEquilibriumError
        where no forces of the joints can hold a block.
    ConvergenceError
        where no equilibrium is found.
    """
    system = system.under_lasting_loads
    if _rests_unloaded(system):
        return _unloaded(system)
    search = _Search(system, tolerance, {} if steps is None else steps)
    before = np.zeros(system.size)
    for force in load_path(system, reverse=reverse):
        try:
            search.load(before, force)
        except NoEquilibriumError:
            if force is system.force:
                raise
            continue  # held only with the loads that follow: they come together
        before = force
    return search.q, search.gaps


def load_path(system: System, *, reverse: bool = False) -> list[Floats]:
    """Static forces (n,) at the ends of the increments; one where the state depends on no path."""
    parts = list(system.load_steps.values())
    if len(parts) < 2 or (system.law.directions == 1 and not system.law.has_memory):
        return [system.force]
    sums = np.cumsum(parts[::-1] if reverse else parts, axis=0)
    return [*sums[:-1], system.force]


class _Search:
    """The equilibrium of a system as its loads grow, and the memory of its gaps at the last increment's end.

    Attributes
    ----------
    q, gaps : displacement and gaps at the end of the last increment
    """

    def __init__(self, system: System, tolerance: float, steps: dict[float, ProximalStep]) -> None:
        self.system, self.tolerance, self._steps = system, tolerance, steps
        self._least = rest_shift(system)
        self.q, self.gaps = _unloaded(system)
        first = self._factored(self._least)
        self._memory = gap_memory(first.problem)
        if system.law.remembers:
            take_over(self._memory, self.gaps)
            if first.shift > 0.0:
                self.q = first.displaced(self.gaps)

    def load(self, before: Floats, force: Floats, halvings: int = _HALVINGS) -> None:
        """Go from the last increment's loads to others, in halves where their equilibrium is not found."""
        kept = self._committed(), self._memory.force.copy()
        try:
            self._increment(force)
        except NoEquilibriumError:
            self._take_back(*kept)
            raise
        except ConvergenceError:
            self._take_back(*kept)
            if halvings == 0 or not (force != before).any():
                raise
            middle = 0.5 * (before + force)
            self.load(before, middle, halvings - 1)
            self.load(middle, force, halvings - 1)

    def _increment(self, force: Floats) -> None:
        """Find the equilibrium under a load, and again while water that has entered moves it."""
        for _ in range(_MOST_WATER):
            problem = self._settle(force)
            if _keeps_water(problem, self._memory, self.gaps):
                return
        raise ConvergenceError(
            f"initial state: after {_MOST_WATER} equilibria gaps still open and close with the water that "
            "enters them; set loads.joint_water[].crack: redrawn, or loads.initial_state: undeformed"
        )

    def _settle(self, force: Floats) -> GapProblem:
        """Find the equilibrium from the memory of the last increment; its problem of the gaps."""
        system, memory, least = self.system, self._memory, self._least
        rest, calm, step = max(_REST, 10.0 * self.tolerance), 0, self._factored(least)
        committed, q, gaps = self._committed(), self.q, self.gaps
        moved = np.zeros_like(q)
        memory = self._memory = memory._replace(solver=_fresh_solver(gaps))
        for iteration in range(_MAX_ITERATIONS):
            if iteration == _DOUBTFUL:
                _refuse_collapse(replace(system, force=force), step.problem, committed[_HISTORY])
            free = step.factor.solve(force + step.shift * (system.M @ q))
            shift, hasty = step.shift, step.shift < _MOST_SHIFT
            self._take_back(committed)
            try:
                gaps, unsettled = step.solve(memory, gaps, np.asarray(system.B @ free), self.tolerance, hasty)
            except ConvergenceError:
                if not hasty:
                    _refuse_collapse(replace(system, force=force), step.problem, committed[_HISTORY])
                    raise
                calm, shift = 0, max(_GROWTH * step.shift, _SHIFT)
            else:
                moved = free + step.X @ gaps.acting.ravel() - q
                q, calm = q + moved, calm + 1
                slowed, size = max(step.shift / _SHIFT, 1.0), max(np.abs(q).max(), _NO_MOTION)
                least_move = max(rest * size, _ROUND_OFF * np.abs(free).max())
                rests = step.shift == 0.0 or slowed * np.abs(moved).max() <= least_move
                # where nothing holds it, what is left of the loads by round-off moves it for ever
                left = step.shift * np.abs(system.M @ moved).max()
                rests = rests or (iteration > _DOUBTFUL and left <= _BALANCED * np.abs(force).max())
                if rests and unsettled <= rest:
                    self.q, self.gaps = q, gaps
                    return step.problem
                if calm % _CALM == 0 and step.shift > max(least, _SHIFT):
                    shift = max(_SHRINK * step.shift, least, _SHIFT)
            if shift != step.shift:  # another flexibility: go on from the last state with a fresh solver
                step = self._factored(shift)
                memory.force[:] = gaps.p_c
                memory = self._memory = memory._replace(solver=_fresh_solver(gaps))
        _refuse_collapse(replace(system, force=force), step.problem, committed[_HISTORY])
        raise ConvergenceError(
            f"initial state: no equilibrium was found in {_MAX_ITERATIONS} iterations (the last still moved "
            f"{np.abs(moved).max():.3g} of {np.abs(q).max():.3g}), which does not say that there is none; "
            "add a support or friction to what joints alone hold, lower the loads, or set "
            "loads.initial_state: undeformed"
        )

    def _factored(self, shift: float) -> ProximalStep:
        if shift not in self._steps:
            self._steps[shift] = ProximalStep.factored(self.system, shift)
        return self._steps[shift]

    def _committed(self) -> tuple[Floats, ...]:
        """What an increment's end commits, as it is now."""
        return tuple(values.copy() for values in self._committed_arrays)

    def _take_back(self, committed: tuple[Floats, ...], force: Floats | None = None) -> None:
        """Put back what an iteration has committed; and the force that the next one starts with."""
        for values, kept in zip(self._committed_arrays, committed, strict=True):
            values[:] = kept
        if force is not None:
            self._memory.force[:] = force

    @property
    def _committed_arrays(self) -> tuple[Floats, ...]:
        memory = self._memory
        # the history stands at `_HISTORY`
        return memory.accumulated_slip, memory.history, memory.step, memory.last_step, memory.spring


def _fresh_solver(gaps: GapState) -> Any:
    return solver_state(len(gaps.jump), gaps.jump.shape[1] > 1)


def _refuse_collapse(system: System, problem: GapProblem, history: Floats) -> None:
    """Refuse loads on what floats that no forces of the joints balance, before the iteration is given up."""
    collapse = find_collapse(system, problem, history)
    if collapse is None:
        return
    names = ", ".join(collapse.parts)
    if collapse.kind == "slides":
        factor = f"{collapse.strength:.4g} times" if np.isfinite(collapse.strength) else "many times"
        bounded = problem.mu.any() or (problem.laws is not None)
        why = (
            f"that would take {factor} the shear strength of its joints"
            if bounded
            else ("its joints carry no shear")
        )
        remedy = "add friction, cohesion, keys or a support"
    elif collapse.kind == "overturns":
        why = "its joints would have to pull, and no friction helps"
        remedy = "add a support, a tensile_strength, or weight"
    else:
        why = (
            "its loads pull it from its joints, and no friction helps; is gravity missing, or uplift too high"
        )
        remedy = "add weight, a support or a tensile_strength"
    raise NoEquilibriumError(
        f"initial state: no static equilibrium can be: {names}, held by joints alone, {collapse.kind}: "
        f"{why}; {remedy}, lower the loads, or set loads.initial_state: undeformed"
    )


@dataclass(frozen=True)
class ProximalStep:
    """One step of the iteration.

    Attributes
    ----------
    shift : s [1/s2]
    factor : of K + s M
    X : (n, N) (K + s M)^-1 B^T
    problem : of the gaps, W with the proximal compliance on its diagonal
    compliance : c, 0 where W is not singular [m/N]
    """

    shift: float
    factor: Factor
    X: Floats
    problem: GapProblem
    compliance: float

    @classmethod
    def factored(cls, system: System, shift: float) -> Self:
        """Factor K + s M, and make the gaps' problem."""
        factor = Factor(system.K + shift * system.M)
        X = factor.solve(system.B.T.toarray())
        problem = system_gap_problem(system, np.asarray(system.B @ X))
        diagonal, compliance = problem.W.diagonal(), 0.0
        if len(problem.slip) and not (problem.compliance >= _SINGULAR * diagonal).all():
            try:  # do gaps with shear, rigid or nearly, determine each other?
                np.linalg.cholesky(problem.W - np.diag(_SINGULAR * diagonal))
            except np.linalg.LinAlgError:
                compliance = _YIELDING * float(diagonal.mean())
        if compliance > 0.0:
            problem = problem._replace(W=problem.W + compliance * np.eye(len(problem.W)))
        return cls(shift, factor, X, problem, compliance)

    def displaced(self, gaps: GapState) -> Floats:
        """Displacement (n,) of closed gaps that have slipped as these have.

        The proximal term holds blocks where the iteration begins: from elsewhere it would push back what has
        slid.
        """
        jump = np.zeros_like(gaps.jump)
        if len(gaps.accumulated_slip):
            jump[:, 1:] = gaps.accumulated_slip - self.problem.slip
        W = self.problem.W + _SINGULAR * np.diag(self.problem.W.diagonal())
        return np.asarray(self.X @ np.linalg.solve(W, jump.ravel()))

    def solve(
        self, memory: GapMemory, gaps: GapState, w_free: Floats, tolerance: float, hasty: bool
    ) -> tuple[GapState, float]:
        """Solve for the gaps; and by how much the force to which it yields changes, of the largest.

        Parameters
        ----------
        gaps : of the last iteration
        w_free : (N,) jumps without joint force [m]
        hasty : whether to give up where Newton does not converge
        """
        if self.compliance == 0.0:
            return _solve(self.problem, memory, w_free, tolerance, hasty), 0.0
        last = gaps.yielding_force
        new = _solve(self.problem, memory, w_free - self.compliance * last.ravel(), tolerance, hasty)
        gives = self.compliance * (new.yielding_force - last)
        jump = new.jump - gives
        slip = jump[:, 1:] + self.problem.compliance.reshape(jump.shape)[:, 1:] * new.force[:, 1:]
        memory.accumulated_slip[:] = slip
        change, size = np.abs(new.yielding_force - last).max(), np.abs(new.yielding_force).max()
        return replace(new, jump=jump, accumulated_slip=slip), float(change / max(size, 1e-300))


def _keeps_water(problem: GapProblem, memory: GapMemory, gaps: GapState) -> bool:
    """Tell whether the gaps as they are now have the water that brought them there."""
    memory.trial[:] = memory.history
    put_limits(problem, memory)
    return bool(np.array_equal(memory.water, gaps.water))


def _solve(problem: GapProblem, memory: GapMemory, w_free: Floats, tolerance: float, hasty: bool) -> GapState:
    """Solve for the gaps; `hasty`: whether to give up where Newton does not converge."""
    n, N = len(problem.gap), len(problem.W)
    make_hasty(memory.solver, hasty)
    d = N // n if n else 1  # a scene of grown-together blocks has no gaps
    y = np.zeros(N)
    forget_product(memory.solver)
    closed = memory.force[::d] > 0.0
    residual = solve_gaps(problem, memory, closed, w_free.copy(), y, min(tolerance, _TIGHT), False)
    if not residual <= _TIGHT:  # round-off forbids as much: take what was asked
        residual = solve_gaps(problem, memory, closed, w_free, y, tolerance, False)
    refuse_failed_law(problem, memory)
    if not residual <= tolerance:
        raise ConvergenceError(
            f"initial state: the solver of the gaps did not converge, relative residual {residual:.2g} "
            f"above {tolerance:.2g}, which does not say that there is no equilibrium; lower the "
            "friction, give rigid joints a stiffness, or set loads.initial_state: undeformed"
        )
    ends = new_gap_arrays(n, d)
    stored = commit_gaps(problem, memory, y, ends)[0]
    refuse_failed_law(problem, memory)
    p_c, slip, history = memory.force.copy(), memory.accumulated_slip.copy(), memory.history.copy()
    return GapState(ends.jump, ends.traction, ends.state, p_c, slip, stored, history, memory.water.copy())
