"""The arrays that the hot loop works on; tuples of arrays, because that is what the kernel can take.

Runs that march together share the model; the leading axis of everything that moves is the run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from romdam.contact.problem import GapMemory, GapProblem
from romdam.core.arrays import Floats, Ints
from romdam.timestepping.modal.propagator import Propagator


class ModalModel(NamedTuple):
    """A diagonal system in arrays for the loop: what all runs share.

    Attributes
    ----------
    static : (m,) static force [N/sqrt(kg)]
    load : (components, m) inertia force per unit ground acceleration, negative sign included
    tiles : (nt, 5) row start and end, column start and end of each non-zero block of G, offset of its values
    values : G's blocks, row-major, one after another
    R : (N, N) flexibility of the modes that are no states, or (0, 0) [m/N]
    conserving : True where the joint force acts with its mean over the step, so that no energy is lost, else
        None (see `GapProblem.frictional`)
    shift : (nt, N) added to the jumps at every base step, linear in between, or (0, 0) [m]
    """

    static: Floats
    load: Floats
    tiles: Ints
    values: Floats
    R: Floats
    conserving: bool | None
    shift: Floats


class Levels(NamedTuple):
    """Step coefficients and gap-space problems of every step size, the base step first.

    Every array of `step` and `problem` has a leading axis of variants
    (runs may differ in damping and in the joints' parameters), then, unless it is the same at every step,
    one of levels.

    Attributes
    ----------
    size : (levels,) finest steps in a step
    step : stacked Propagator
    problem : stacked GapProblem
    decay : (variants, levels) exp(-step / tau), tau the relaxation time of R
    half : (variants, levels, N, N) half the states' flexibility over a step (conserving), else empty [m/N]
    """

    size: Ints
    step: Propagator
    problem: GapProblem
    decay: Floats
    half: Floats


class Runs(NamedTuple):
    """What each run is, and where it stands.

    Attributes
    ----------
    variant : (2, runs) its variant of the step coefficients, and of the gap-space problem
    samples, rows : (runs,) its first column of the ground acceleration, its first row of the track
    last : (runs,) its number of base steps
    impulse : (runs,) largest gap velocity that the change of a joint force over a step may stand for [m/s]
    clock : (runs, 4) base steps done, finest steps done in the one under way, level of the next step,
        accepted steps since the closed set changed
    failed : (runs,) whether a step did not converge at the finest level
    acc : (components, samples) ground acceleration at every base step, the runs one after another [m/s2]
    memory : of the gap-space problems; all but `work` has a leading axis of runs, and `active`, `inverse`,
        `order` and `counts` then one of levels
    """

    variant: Ints
    samples: Ints
    rows: Ints
    last: Ints
    impulse: Floats
    clock: Ints
    failed: NDArray[np.bool_]
    acc: Floats
    memory: GapMemory


class ModalState(NamedTuple):
    """State at the last accepted step; changed in place. The leading axis of runs is left out below.

    Attributes
    ----------
    q, v : (m,) modal displacement and velocity
    f : (m,) external modal force
    s, u_r : (N,) relaxed joint force and the jump it makes, R s [N], [m]
    jump, force : (n, d) of the gaps
    mean : (N,) joint force that acted over the last step [N]
    w : (N,) jump of the states, G q (conserving only) [m]
    state : (n,) of the gaps
    closed : (n,) closed gaps
    impulse : (n, d) time integral of the joint force since the last row [N s]
    works : (4,) see `romdam.timestepping.energy.ACCUMULATED` [J]
    stored : (1,) energy in the gaps [J]
    counts : (3,) steps accepted, steps refused, largest gap residual
    peaks : (4, n) largest opening, its time, largest compression, largest slip, over every step
    """

    q: Floats
    v: Floats
    f: Floats
    s: Floats
    u_r: Floats
    jump: Floats
    force: Floats
    mean: Floats
    w: Floats
    state: NDArray[np.uint8]
    closed: NDArray[np.bool_]
    impulse: Floats
    works: Floats
    stored: Floats
    counts: Floats
    peaks: Floats


class Work(NamedTuple):
    """Vectors of the loop, one row per run.

    Attributes
    ----------
    f_0, f_end : (runs, m) external force at the ends of the base step under way
    f_1, q_free, r : (runs, m) external force and displacement without joint force at the step's end; joint
        force on the modes
    w, y, old_force : (runs, N) jumps, the gap-space problem's solution, joint force at the step's start
    ends : (runs, 2, N) added jumps at both ends of the base step, (runs, 2, 0) where none are added
    shift : (runs, N) or (runs, 0) added jumps at the step's end
    underway, accepted : (runs,) numbers of the runs that are not done, and whose step was accepted
    """

    f_0: Floats
    f_end: Floats
    f_1: Floats
    q_free: Floats
    r: Floats
    w: Floats
    y: Floats
    old_force: Floats
    ends: Floats
    shift: Floats
    underway: Ints
    accepted: Ints


class Track(NamedTuple):
    """What is written: one row per kept base step, the runs one after another.

    Attributes
    ----------
    stride : base steps per row
    q, v : (rows, m)
    s : (rows, N)
    jump, force, impulse : (rows, n, d)
    state : (rows, n)
    works : (rows, 4)
    stored : (rows,)
    """

    stride: int
    q: Floats
    v: Floats
    s: Floats
    jump: Floats
    force: Floats
    impulse: Floats
    state: NDArray[np.uint8]
    works: Floats
    stored: Floats
