"""The arrays that the hot loop works on; tuples of arrays, because that is what the kernel can take."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from romdam.dynamics.propagator import Propagator
from romdam.joints.problem import GapMemory, GapProblem

Floats = NDArray[np.float64]

RATIO = 4  # between the steps of two levels: 2 refuses more steps, 8 takes more small ones; both cost more


class ModalModel(NamedTuple):
    """A diagonal system in arrays for the loop.

    Attributes
    ----------
    k, c : (m,) modal stiffness [1/s2] and damping [1/s]
    static : (m,) static force [N/sqrt(kg)]
    load : (components, m) inertia force per unit ground acceleration, negative sign included
    tiles : (nt, 5) row start and end, column start and end of each non-zero block of G, offset of its values
    values : G's blocks, row-major, one after another
    R : (N, N) flexibility of the modes that are no states, or (0, 0) [m/N]
    tau : their relaxation time [s]
    conserving : whether the joint force acts with its mean over the step, so that no energy is lost
    shift : (nt, N) added to the jumps at every base step, linear in between, or (0, 0) [m]
    """

    k: Floats
    c: Floats
    static: Floats
    load: Floats
    tiles: NDArray[np.int64]
    values: Floats
    R: Floats
    tau: float
    conserving: bool
    shift: Floats


class Levels(NamedTuple):
    """Step coefficients and gap-space problems of every step size, the base step first.

    Every array of `step`, `W`, `Z` and `lift` of the problem, `active`, `inverse`, `order` and `counts` of
    the memory have a leading axis of levels; level l has the step dt / RATIO^l.

    Attributes
    ----------
    step : stacked Propagator
    problem : stacked GapProblem
    memory : stacked GapMemory
    decay : (levels,) exp(-step / tau)
    half : (levels, N, N) half the states' flexibility over a step (conserving), else empty [m/N]
    """

    step: Propagator
    problem: GapProblem
    memory: GapMemory
    decay: Floats
    half: Floats


class Control(NamedTuple):
    """When a step is fine enough.

    Attributes
    ----------
    tolerance : of the gap-space problem, relative
    impulse : largest gap velocity that the change of a joint force over a step may stand for [m/s]
    """

    tolerance: float
    impulse: float


class ModalState(NamedTuple):
    """State at the last accepted step; changed in place.

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
    works : (4,) see `romdam.dynamics.energy.ACCUMULATED` [J]
    stored : (1,) energy in the gaps [J]
    level : (1,) level of the next step
    counts : (3,) steps accepted, steps refused, largest gap residual
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
    level: NDArray[np.int64]
    counts: Floats


class Track(NamedTuple):
    """What is written: one row per kept base step; peaks see every step.

    Attributes
    ----------
    stride : base steps per row
    q, v : (rows, m)
    s : (rows, N)
    jump, force, impulse : (rows, n, d)
    state : (rows, n)
    works : (rows, 4)
    stored : (rows,)
    peaks : (4, n) largest opening, its time, largest compression, largest slip
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
    peaks: Floats
