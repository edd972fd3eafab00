"""Linear vibration with hysteretic damping, solved in the frequency domain.

The stiffness is complex, K + i sgn(omega) K_h with K_h = sum_b 2 xi_b K_b, so that a cycle of a given
amplitude loses the same energy at every frequency. A record a_g(t), followed by rest until the slowest mode
has died away, has the discrete spectrum A(omega), and

    q(omega) = -(K + i K_h - omega^2 M)^-1 L A(omega).

As K_h does not depend on the frequency, the complex modes (K + i K_h) V = M V Lambda make the equations
diagonal at every frequency, whether or not K_h is. Such damping is not causal: the structure moves a little
before the record does, by a few thousandths of its peak at ratios of dams.

The energy balance closes to round-off: power is integrated as the trigonometric polynomial that it is.

References
----------
Clough, Penzien, Dynamics of Structures, 2nd ed. (1993), section 3-7 (complex stiffness), chapter 6.
Crandall, J. Sound Vib. 11 (1970) 3: hysteretic damping in the time domain is not causal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError
from romdam.core.motion import Motion
from romdam.core.recorded import gap_fields, new_gap_arrays
from romdam.core.system import Complex, Coordinates, History, System
from romdam.core.threads import cpu_time
from romdam.timestepping.energy import ENERGIES, ledger
from romdam.timestepping.equilibrium import initial_state
from romdam.timestepping.peaks import first_peaks, named_peaks
from romdam.timestepping.prepared import Outcome, Progress, Simulation
from romdam.timestepping.settings import Settings
from romdam.timestepping.steps import Steps, fixed_steps

if TYPE_CHECKING:
    from romdam.config.sections.transient import TransientConfig

_STILL, _FASTEST = 0, -1  # lines of a spectrum: frequency zero, and half that of the samples
_DECAY = 14.0  # of free vibration until the record comes round again: exp(-14) is 1e-6
_LEAST = 1e-3  # damping ratio of the least damped mode, below which rest would take too long
_REST = 3.0  # lengths of the record that rest follows it for at least: what is not causal falls as 1 / time


@dataclass(frozen=True)
class ComplexModes:
    """Modes with complex stiffness.

    Attributes
    ----------
    eigenvalues : (n,) of M^-1 (K + i K_h) [1/s2]
    vectors, inverse : (n, n) of the unknowns, and M^-1 times its inverse
    """

    eigenvalues: Complex
    vectors: Complex
    inverse: Complex

    @classmethod
    def of(cls, system: System) -> Self:
        """Those of a reduced system."""
        assert system.hysteretic is not None
        mass = system.M.diagonal()
        stiffness = system.K.toarray() + 1j * system.hysteretic.toarray()
        eigenvalues, vectors = np.linalg.eig(stiffness / mass[:, None])
        return cls(eigenvalues, vectors, np.linalg.inv(vectors) / mass)

    def seconds_to_rest(self) -> float:
        """Time after which free vibration is below exp(-`_DECAY`) of its start [s].

        Raises
        ------
        ConfigError
            for a mode that is hardly damped.
        """
        root = np.sqrt(self.eigenvalues)
        ratio = root.imag / np.abs(root)
        if not ratio.min() >= _LEAST:
            k = int(np.argmin(ratio))
            raise ConfigError(
                f"linear_stage.damping: hysteretic: the mode at {root.real[k] / (2.0 * np.pi):.4g} Hz has a "
                f"damping ratio of {max(ratio[k], 0.0):.2g}, limit {_LEAST:g}, and would not come to rest; "
                "give its material a ratio, or set linear_stage.damping: viscous"
            )
        return float(_DECAY / root.imag.min())


@dataclass(frozen=True)
class FrequencyDomain:
    """The integrator of a linear reduced system with hysteretic damping; no job names it."""

    name: ClassVar[str] = "frequency_domain"
    shifts: ClassVar[bool] = False
    resumes: ClassVar[bool] = False

    @classmethod
    def configured(cls, transient: TransientConfig) -> Self:
        """It has no options."""
        return cls()

    def supports(self, system: System) -> None:
        """Refuse what is not linear, or driven by more than the base.

        Raises
        ------
        ConfigError
        """
        lacking = {
            "a system with joints": len(system.law) > 0,
            "viscous damping": system.C.count_nonzero() > 0,
            "a motion besides that of the base": {*system.motions} != {Motion.BASE},
            "blocks without mass": not (system.M.diagonal() > 0.0).all(),
            "no hysteretic damping": system.hysteretic is None,
        }
        for what, there in lacking.items():
            if there:
                raise ConfigError(
                    f"linear_stage.damping: hysteretic is not for {what}; set it to viscous, or leave "
                    "that out"
                )

    def steps(self, finest: float, coarse: float, interval: float | None) -> Steps:
        """Take the finest step throughout."""
        return fixed_steps(finest, interval, coarse)

    def compared(self, history: History) -> Floats:
        """Displacements of the output nodes (nt, n)."""
        return history.disp

    def advance(
        self, simulations: Sequence[Simulation], settings: Settings, progress: Progress
    ) -> list[Outcome]:
        """Solve one simulation after another."""
        total, done, outcomes = sum(one.ground.shape[1] - 1 for one in simulations), 0, list[Outcome]()
        for one in simulations:
            outcomes.append(_response(one, settings))
            done += one.ground.shape[1] - 1
            progress(done, total)
        return outcomes


def _response(simulation: Simulation, settings: Settings) -> History:
    """The history of one record."""
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq  # here: few jobs ask for it

    start = cpu_time()
    (prepared, ground), dt, stride = simulation, settings.steps.base, settings.steps.stride
    system, count = prepared.system, ground.shape[1]
    rest, _ = initial_state(prepared, settings)
    modes = prepared.cache.get_or_compute("complex modes", lambda: ComplexModes.of(system))
    setup, loop = cpu_time() - start, cpu_time()
    seconds = max(modes.seconds_to_rest(), _REST * count * dt)
    size = 2 * next_fast_len(math.ceil((count + seconds / dt) / 2.0), real=True)
    omega = 2.0 * np.pi * rfftfreq(size, dt)
    shaking = rfft(system.shaking(ground), size)
    shaking[:, _FASTEST] = 0.0  # the line at the sampling's limit has no derivative
    load = -np.asarray(system.load)
    q = modes.vectors @ (modes.inverse @ load @ shaking / (modes.eigenvalues[:, None] - omega**2))
    q[:, _STILL] = (
        load @ shaking[:, _STILL]
    ).real / system.K.diagonal()  # at frequency zero stiffness is real
    moved, rate, acc = (irfft(each, size)[:, :count] for each in (q, 1j * omega * q, -(omega**2) * q))
    taken = _damping_power(system, q, omega, size)
    power = -(_upsampled(load.T @ (1j * omega * q), size) * _upsampled(-shaking, size)).sum(axis=0)
    work_in, work_damping = (_integral(each, dt / 2.0)[: 2 * count : 2] for each in (power, taken))
    rows, u = slice(None, None, stride), rest[:, None] + moved
    works = np.zeros(len(range(0, count, stride)), ENERGIES)
    works["input"] = (work_in + system.force @ (moved - moved[:, :1]))[rows]
    works["damping"] = work_damping[rows]
    disp, vel, acceleration = (np.asarray(system.observe @ each).T for each in (u, rate, acc))
    gaps = new_gap_arrays(0, 1)
    none: dict[str, Any] = {
        name: np.zeros((len(works), *value.shape), value.dtype) for name, value in gap_fields(gaps).items()
    }
    stats = dict.fromkeys(("solver_iterations", "largest_iterations", "largest_residual"), 0.0)
    stats |= {
        "steps": float(count - 1),
        "base_step": dt,
        "finest_step": dt,
        "seconds_of_rest": size * dt - count * dt,
        "setup_cpu_seconds": setup,
        "loop_cpu_seconds": cpu_time() - loop,
    }
    return History(
        **none,
        time=np.arange(len(works), dtype=np.float64) * settings.steps.interval,
        disp=disp[rows],
        vel=vel[rows],
        acc=acceleration[rows],
        coordinates=Coordinates.of(u.T[rows], rate.T[rows]),
        energy=ledger(
            works,
            0.5 * (system.M.diagonal() @ rate**2)[rows],
            0.5 * (system.K.diagonal() @ u**2)[rows],
        ),
        peaks=named_peaks(first_peaks(gaps.jump, gaps.traction)),
        base_disp=disp if stride > 1 else disp[:0],
        stats=stats,
        integrator=FrequencyDomain.name,
    )


def _damping_power(system: System, q: Complex, omega: Floats, size: int) -> Floats:
    """(2 size,) power that the imaginary stiffness takes, at half steps [W]."""
    assert system.hysteretic is not None
    force = 1j * (system.hysteretic @ q)
    force[:, _STILL] = 0.0
    taken = np.zeros(2 * size)
    for of_unknown, rate in zip(force, 1j * omega * q, strict=True):  # one at a time, for memory
        taken += _upsampled(of_unknown, size) * _upsampled(rate, size)
    return taken


def _upsampled(spectrum: Complex, size: int) -> Floats:
    """Values at half steps, (..., 2 size), of spectra of `size` values."""
    from scipy.fft import irfft

    return np.asarray(2.0 * irfft(spectrum, 2 * size))


def _integral(values: Floats, dt: float) -> Floats:
    """Integral since the first of the trigonometric polynomial through values at steps dt."""
    from scipy.fft import irfft, rfft, rfftfreq

    spectrum, omega = rfft(values), 2.0 * np.pi * rfftfreq(len(values), dt)
    wave = np.zeros_like(spectrum)
    wave[1:] = spectrum[1:] / (1j * omega[1:])
    varying = irfft(wave, len(values))
    return np.asarray(values.mean() * dt * np.arange(len(values)) + varying - varying[0])
