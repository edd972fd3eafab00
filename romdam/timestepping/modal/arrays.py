"""The data of the time loop, as NamedTuples of arrays, which compiled code can take.

The loop integrates m modes and the joint force p in N = directions * n components of n gaps,

    q'' + C q' + K q = f(t) + G^T p,      tau s' + s = p,      u = G q + R s + x(t),      p = law(u).

G has the gaps' jumps in unit modal displacements. Modes with mass are states q. Modes without mass follow the
joint force through one flexibility R, with the relaxation time tau: they are the quasi-static modes, and s is
the relaxed joint force. (Where there are several relaxation times, modes of another one are states too, see
`romdam.timestepping.modal.mode_split`.) x are jumps that no state and no force makes: what is fed back
(`shift`), what the ground's acceleration makes by the quasi-static modes (`ground_jump`), and what moving
supports make (`carried`).

Several runs of one model are integrated together. They share the model (`ModalModel`) and the coefficients of
every step size (`StepHierarchy`). A base step may be cut into smaller ones: level 0 is the base step, and
every further level has a smaller step. What moves has the run as its leading axis: the clock and the memory
of each run (`Batch`), the state at the last accepted step (`ModalState`), vectors of the step at hand
(`Work`) and the rows that are written (`HistoryBuffer`). Numbers that change together are the fields of one
record (`CLOCK`, `TRIES`, `REFUSALS`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from romdam.contact.problem import GapMemory, GapProblem
from romdam.contact.solvers.state import SolverState
from romdam.core.arrays import Floats, Ints, Record, record_type
from romdam.core.recorded import GapArrays
from romdam.timestepping.modal.propagator import Propagator

BASE = 0  # the level of the base step
CLOCK = record_type(base_steps=int, fine_steps=int, level=int, calm_steps=int, evolving=int, last_step=float)
TRIES = record_type(accepted=int, refused=int, residual=float)
REFUSALS = record_type(refused=int, passed=int)
VARIANT = record_type(step=int, problem=int)


class ModalModel(NamedTuple):
    """A diagonal system in arrays for the loop: what all runs share.

    Attributes
    ----------
    static : (m,) static force on the modes [N]
    load : (components, m) force on the modes per unit of each row of `Batch.acc`: minus the columns of
        `System.load`
    tiles : (blocks, 5) row start and end, column start and end of each non-zero block of G, offset of its
        values
    values : G's blocks, row-major, one after another
    R : (N, N) flexibility of the quasi-static modes, or (0, 0) [m/N]
    conserving : True where the mean joint force over the step does the work that the gaps store, see
        `romdam.timestepping.modal.massless_boundary`; else None, which is a type of its own to numba: what is
        not called is not compiled either
    shift : (base steps + 1, N) added to the jumps at every base step, linear in between, or (0, 0) [m]
    ground_jump : (components, N) jump of the quasi-static modes per unit of `Batch.acc`, or (0, 0) [s2]
    carried : (N, k) jumps that unit displacements of the k moving supports make, or (0, 0)
    """

    static: Floats
    load: Floats
    tiles: Ints
    values: Floats
    R: Floats
    conserving: bool | None
    shift: Floats
    ground_jump: Floats
    carried: Floats


class StepHierarchy(NamedTuple):
    """Step coefficients and gap-space problems of every step size, the base step first.

    Every array of `step` and `problem` has a leading axis of variants (runs may differ in damping and in the
    joints' parameters), then one of levels.

    Attributes
    ----------
    size : (levels,) length of each level's step, in finest steps
    step : stacked Propagator
    problem : stacked GapProblem
    decay : (variants, levels) exp(-step / tau), tau the relaxation time of R; 0 where R follows at once
    half : (variants, levels, N, N) half of the jump of the states at the step's end per constant joint force
        over the step, as a conserving step needs it; else (variants, 1, 0, 0) [m/N]
    """

    size: Ints
    step: Propagator
    problem: GapProblem
    decay: Floats
    half: Floats


class Batch(NamedTuple):
    """Runs that are integrated together: what each is, and where it stands.

    Attributes
    ----------
    variant : (runs,) `VARIANT`: its variant of the step coefficients, and of the gap-space problem
    samples, rows : (runs,) its first column of the ground acceleration, its first row of the history buffer
    last : (runs,) its number of base steps
    impulse : (runs,) a step is cut where the change of a gap's normal force over it moves that gap by more
        than this velocity times the step [m/s]
    shear_impulse : (runs,) the same of the shear of all closed gaps together, and the speed at which a gap
        that slides may turn back within the step [m/s]
    clock : (runs,) `CLOCK`: base steps done, finest steps done in the present one, level of the next step,
        accepted steps since the closed set changed, whether what the laws keep moved in the last step, its
        length [s]
    failed : (runs,) whether a step did not converge at the finest level
    acc : (components, samples) what the columns of the load follow, at every base step, the runs one after
        another: ground acceleration [m/s2], and forces that vary in time
    supports : (3 k, samples) acceleration, velocity and displacement of the k moving supports
    memory : (runs,) of the gap-space problems, without the solver's part
    solver : (runs, levels) what the solver has learnt, see `romdam.contact.solvers.state`
    """

    variant: Record
    samples: Ints
    rows: Ints
    last: Ints
    impulse: Floats
    shear_impulse: Floats
    clock: Record
    failed: NDArray[np.bool_]
    acc: Floats
    supports: Floats
    memory: GapMemory
    solver: SolverState


class Recorded(NamedTuple):
    """What a row of the histories holds; every array of it is copied into the row.

    Attributes
    ----------
    q, v : (m,) modal displacement and velocity
    s : (N,) relaxed joint force, or empty [N]
    gaps : of the gaps; `mean_traction` is the mean so far over the writing interval, of which what is still
        to come counts as zero
    memory : (L, n, s) what the gaps' further laws keep, the `history` of `GapMemory` itself
    energies : `romdam.timestepping.energy.ENERGIES` [J]
    """

    q: Floats
    v: Floats
    s: Floats
    gaps: GapArrays
    memory: Floats
    energies: Record


class ModalState(NamedTuple):
    """State at the last accepted step; changed in place. The leading axis of runs is left out below.

    Attributes
    ----------
    recorded : what is written
    f : (m,) external modal force
    u_r : (N,) jump that the relaxed joint force makes, R s [m]
    mean : (N,) joint force that acted over the last step [N]
    w : (N,) jump of the states, G q; kept where the step is conserving only [m]
    closed : (n,) closed gaps
    slip_rate : (n, 2) mean over the last step along j and k; empty without shear [m/s]
    tries : `TRIES`: steps accepted and refused, largest relative residual of the gap-space problem
    refusals : (levels,) `REFUSALS`: steps of the level refused since one was accepted, and how often since
        the last refusal the run could have gone back to this longer step
    peaks : (n,) `romdam.timestepping.peaks.PEAKS`, over every step
    """

    recorded: Recorded
    f: Floats
    u_r: Floats
    mean: Floats
    w: Floats
    closed: NDArray[np.bool_]
    slip_rate: Floats
    tries: Record
    refusals: Record
    peaks: Record


class Work(NamedTuple):
    """Vectors of the loop, one row per run.

    Attributes
    ----------
    f_0, f_end : (runs, m) external force at the ends of the present base step
    f_1, q_free, r : (runs, m) external force and displacement without joint force at the step's end; joint
        force on the modes, G^T p
    w : (runs, N) jumps at the step's end without joint force; once the step is accepted R p
    y, old_force : (runs, N) the gap-space problem's solution; unilateral force at the step's start
    moved : (runs, N) what the change of the shear moves the jumps by
    start_shift, end_shift : (runs, N) x at both ends of the base step, without what moving supports make;
        (runs, 0) where no jumps are added
    shift, last_shift : (runs, N) or (runs, 0) x at the step's end, and at the last accepted one's
    active, accepted : (runs,) numbers of the runs that are not done, and whose step was accepted
    """

    f_0: Floats
    f_end: Floats
    f_1: Floats
    q_free: Floats
    r: Floats
    w: Floats
    y: Floats
    old_force: Floats
    moved: Floats
    start_shift: Floats
    end_shift: Floats
    shift: Floats
    last_shift: Floats
    active: Ints
    accepted: Ints


class HistoryBuffer(NamedTuple):
    """The histories' rows.

    Attributes
    ----------
    stride : base steps per row
    rows : one per written base step, the runs one after another
    by_states, by_forces : (p, m), (p, N) displacement of the output nodes per modal displacement q, and per
        relaxed joint force s; (0, 0) where there are none
    node_disp : (samples, p) at every base step, the runs as in `Batch.acc`; (0, p) where each is a row
    """

    stride: int
    rows: Recorded
    by_states: Floats
    by_forces: Floats
    node_disp: Floats


class Arrays(NamedTuple):
    """All that the loop is called with, see `romdam.timestepping.modal.loop.integrate`."""

    model: ModalModel
    levels: StepHierarchy
    runs: Batch
    states: ModalState
    work: Work
    buffer: HistoryBuffer


def new_work(states: ModalState, shifted: bool) -> Work:
    """Make the vectors of the loop; `shifted` where jumps are added."""
    (runs, m), N = states.f.shape, states.mean.shape[1]
    f_0, f_end, f_1, q_free, r = np.zeros((5, runs, m))
    w, y, old_force, moved = np.zeros((4, runs, N))
    return Work(
        f_0=f_0,
        f_end=f_end,
        f_1=f_1,
        q_free=q_free,
        r=r,
        w=w,
        y=y,
        old_force=old_force,
        moved=moved,
        start_shift=np.zeros((runs, N if shifted else 0)),
        end_shift=np.zeros((runs, N if shifted else 0)),
        shift=np.zeros((runs, N if shifted else 0)),
        last_shift=np.zeros((runs, N if shifted else 0)),
        active=np.zeros(runs, dtype=np.int64),
        accepted=np.zeros(runs, dtype=np.int64),
    )
