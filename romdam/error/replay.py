"""Replay of joint forces through linear models, and the run corrected by what that shows.

The joint forces p of a reduced run, replayed through the *linear* full-order model, give the full-order
motion for those forces. At the joints it differs from the reduced motion for the same forces by the defect

    delta = B (u_full[p] - T q_red[p]).

The defect is no error bound: joints react to openings, and on the two-cantilever model an error 10 to 100
times the defect comes of it. But the full-order openings g solve the *reduced* nonlinear problem with the
defect of their own forces added to its free jumps,

    g = gap + B T q_red[p] + delta[p],   p = law(g, history),

because B u_full[p] = B T q_red[p] + delta[p] for any p. So delta[p] of the forces at hand, added to the free
jumps (`Settings.shift`), gives openings nearer to the full order by one order in (full - reduced);
repeated it converges, if it does, to the full-order nonlinear solution (defect correction: Stetter, Numer.
Math. 29 (1978) 425). The correction is made in a finer reduced model, whose own defect is small: the
error statement is the difference of the run to that corrected run.

The replay is integrated by a two-stage L-stable scheme (Alexander, SIAM J. Numer. Anal. 14 (1977) 1006) for
the full and the reduced matrices alike, so that most of its time error cancels in the difference, and modes
that the step cannot resolve answer statically.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.sparse import csr_matrix, spmatrix

from romdam.core.arrays import Floats
from romdam.core.system import Complex, History, System
from romdam.linalg.factor import Factor
from romdam.timestepping.equilibrium import rest_shift
from romdam.timestepping.prepared import Prepared, Progress
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one

_GAMMA = 1.0 - np.sqrt(0.5)


@dataclass(frozen=True)
class Forces:
    """Joint forces of a run, and what shakes it, for a replay.

    Attributes
    ----------
    ground : (3, (nt - 1) * substeps + 1) ground acceleration at every substep, followed by what moving
        supports do, see `romdam.core.motion.ground_rows` [m/s2]
    mean : (nt, N) joint force, its mean over the interval that ends at each row; row 0 is not used [N]
    first : (N,) joint force in row 0 [N]
    interval : time between two rows [s]
    substeps : steps of the replay in one interval
    """

    ground: Floats
    mean: Floats
    first: Floats
    interval: float
    substeps: int


@dataclass(frozen=True)
class Replayed:
    """A system to replay, and the state that it starts from.

    Attributes
    ----------
    system : full or reduced
    start, rate : (n,) displacement and velocity in the first row; at rest where there is no `rate`
    basis : of a reduced one, (n_full, n)
    factor : see `step_factor`, where it is there already
    """

    system: System
    start: Floats
    basis: spmatrix | Floats | None = None
    rate: Floats | None = None
    factor: Factor | None = None


def step_factor(system: System, h: float) -> Factor:
    """Factor what both stages of a replay's step solve with."""
    less = None if system.drag is None else np.sqrt(h * _GAMMA) * system.drag
    return Factor(system.M + h * _GAMMA * system.C + (h * _GAMMA) ** 2 * system.K, less)


def replay(model: Replayed, forces: Forces) -> Iterator[Floats]:
    """Displacement of a linear system with open joints under given joint forces, row after row.

    Parameters
    ----------
    model : full or reduced
    forces : constant over each interval
    """
    system, h = model.system, forces.interval / forces.substeps
    factor = model.factor or step_factor(system, h)
    K, lift = csr_matrix(system.K), csr_matrix(system.B.T)
    load = system.load if isinstance(system.load, csr_matrix) else np.ascontiguousarray(system.load)
    histories = system.histories(forces.ground, h, partial(_exact_rates, h))
    motion, lead = system.followed(histories.rows), histories.lead
    u, v = model.start.astype(float), np.zeros(system.size) if model.rate is None else model.rate

    def step(n: int, constant: Floats) -> tuple[Floats, Floats]:
        a_0, a_1 = motion[:, lead + n], motion[:, lead + n + 1]
        stages = (constant - load @ (a_0 + _GAMMA * (a_1 - a_0)), constant - load @ a_1)
        return _two_stages(system, factor, K, (u, v), stages, h)

    rest = system.force + lift @ forces.first
    for n in range(-lead, 0):  # waves that are on their way before the record begins
        u, v = step(n, rest)
    yield u
    for row in range(1, len(forces.mean)):
        constant = system.force + lift @ forces.mean[row]
        for n in range((row - 1) * forces.substeps, row * forces.substeps):
            u, v = step(n, constant)
        yield u


def _exact_rates(dt: float, angle: Floats) -> tuple[Complex, Complex]:
    """Acceleration and velocity of a unit displacement that turns by angles a step."""
    rate = np.asarray(1j * angle / dt, dtype=np.complex128)
    return rate**2, rate


def _two_stages(
    system: System,
    factor: Factor,
    K: csr_matrix,
    state: tuple[Floats, Floats],
    force: tuple[Floats, Floats],
    h: float,
) -> tuple[Floats, Floats]:
    """One step of the scheme from displacement and velocity; force at its two stages."""
    u, v = state
    hg, hc = h * _GAMMA, h * (1.0 - _GAMMA)
    a = factor.solve(force[0] - system.damping_force(v) - K @ (u + hg * v))
    v_1 = v + hg * a
    u_2, v_2 = u + hc * v_1, v + hc * a
    a = factor.solve(force[1] - system.damping_force(v_2) - K @ (u_2 + hg * v_2))
    v_2 = v_2 + hg * a
    return u_2 + hg * v_2, v_2


def replay_start(system: System, guess: Floats, force: Floats, static: bool) -> Floats:
    """Displacement that a replay starts from: equilibrium under the first joint forces, or the guess.

    Parameters
    ----------
    guess : (n,) the reduced run's first displacement; rigid motion, which no force decides, stays as it is
    force : (N,) joint force in the first row [N]
    static : whether the run started in equilibrium
    """
    if not static:
        return guess
    residual = system.force + system.B.T @ force - system.K @ guess
    return guess + Factor(system.K + rest_shift(system) * system.M).solve(residual)


@dataclass(frozen=True)
class Defect:
    """Full-order minus reduced motion for the same joint forces.

    Attributes
    ----------
    jump_full, jump : (nt, N) jumps of the full-order replay, and the reduced model's defect [m]
    jump_fine : (nt, N) defect of the finer reduced model [m]
    point_fine : (nt, N) defect of the finer model in what jumps at the gaps' positions are more [m]
    disp_full, disp, disp_fine : (nt, 3 * probes) the same at the probes [m]
    energy_full, energy : (nt,) strain energy of the full-order motion and of the difference [J]
    """

    jump_full: Floats
    jump: Floats
    jump_fine: Floats
    point_fine: Floats
    disp_full: Floats
    disp: Floats
    disp_fine: Floats
    energy_full: Floats
    energy: Floats


def measure_defect(
    models: tuple[Replayed, Replayed, Replayed], forces: Forces, progress: Progress | None = None
) -> Defect:
    """Replay the same forces through the full, the reduced and the finer reduced model.

    Parameters
    ----------
    models : full order, the reduced model with its basis (n_full, m), the finer reduced model
    forces : see `Forces`
    progress : called with (rows done, rows in all)
    """
    full, coarse, _ = models
    rows, n = len(forces.mean), full.system.solids
    K = csr_matrix(full.system.K[:n, :n])
    probes = full.system.observe[full.system.of_probes].shape[0]
    jump, disp = np.zeros((3, rows, full.system.B.shape[0])), np.zeros((3, rows, probes))
    point, energy = np.zeros_like(jump[0]), np.zeros((2, rows))
    runs = zip(*(replay(model, forces) for model in models), strict=True)
    for row, (u, q, z) in enumerate(runs):
        for k, (model, motion) in enumerate(zip(models, (u, q, z), strict=True)):
            jump[k, row] = model.system.B @ motion
            disp[k, row] = (model.system.observe @ motion)[model.system.of_probes]
        point[row] = _more_at_points(full.system, u) - _more_at_points(models[2].system, z)
        e = u - coarse.basis @ q
        energy[0, row], energy[1, row] = 0.5 * u[:n] @ (K @ u[:n]), 0.5 * e[:n] @ (K @ e[:n])
        if progress is not None and (row % 50 == 0 or row + 1 == rows):
            progress(row + 1, rows)
    if full.system.pseudo_static is not None:  # exact in all of them
        by = full.system.pseudo_static
        carried = by.motion(forces.ground)[2][:, :: forces.substeps].T
        jump += carried @ by.jump.T
        disp += carried @ by.observe[full.system.of_probes].T
    jumps, disps = ((values[0], values[0] - values[1], values[0] - values[2]) for values in (jump, disp))
    return Defect(*jumps, point, *disps, *energy)


def _more_at_points(system: System, motion: Floats) -> Floats | float:
    return 0.0 if system.at_point is None else system.at_point @ motion


def corrected_run(
    fine: Prepared, ground: Floats, settings: Settings, defect: Floats, progress: Progress | None = None
) -> History:
    """Run the finer reduced model with the full order's defect added to its free jumps.

    Parameters
    ----------
    fine : the finer reduced model
    ground : (3, nt) ground acceleration at every base step [m/s2]
    settings : those of the run that is judged
    defect : (rows, N) at the written rows [m]
    """
    steps, rows = np.arange(ground.shape[1]), np.arange(len(defect)) * settings.steps.stride
    shift = np.stack([np.interp(steps, rows, column) for column in defect.T], axis=1)
    return simulate_one(fine, ground, replace(settings, shift=shift), progress)
