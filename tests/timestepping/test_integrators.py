"""The seam of integrators: what is declared is true, and one more is one file and one line."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hand_systems import gap_law, ground, modal_twin, sparse_system
from simulating import prepared_for, simulated

from romdam.config.load import Job, load_config, parse_config
from romdam.config.plausible import check_assumptions
from romdam.core import integrators
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.integrators import INTEGRATORS, IntegratorEntry
from romdam.core.motion import GroundMotion
from romdam.core.system import Coordinates, History
from romdam.error.estimate import start_at
from romdam.pipelines.error.estimate import can_estimate
from romdam.pipelines.job_warnings import job_warnings
from romdam.pipelines.simulation import prepare, settings_for, simulate_motion
from romdam.records.processing.resampling import resample_motion
from romdam.timestepping import simulate as at_steps
from romdam.timestepping.integrators.registry import integrator_class, suitable_integrator
from romdam.timestepping.settings import Settings, not_converged
from romdam.timestepping.steps import Steps, cut_steps, fixed_steps, grid_steps, holds_samples

EXAMPLE = Path(__file__).parents[2] / "configs" / "two_cantilevers.yaml"


@dataclass(frozen=True)
class CentralDifferences:
    """A toy: explicit, without joints; `safety` times the critical step is the longest it takes."""

    name: ClassVar[str] = "central_differences"
    shifts: ClassVar[bool] = False
    resumes: ClassVar[bool] = False
    safety: float = 0.9

    @classmethod
    def configured(cls, transient):
        return cls()

    def supports(self, system):
        if not system.diagonal or len(system.law):
            raise ConfigError("central_differences is for uncoupled modes without joints")

    def steps(self, finest, coarse, interval):
        return fixed_steps(finest, interval)

    def compared(self, history):
        return history.disp

    def advance(self, simulations, settings, progress):
        return [self._integrate(one, settings, progress) for one in simulations]

    def _integrate(self, simulation, settings, progress):
        (prepared, acc), dt = simulation, settings.steps.base
        system = prepared.system
        limit = prepared.cache.get_or_compute("limit", lambda: 2.0 / np.sqrt(system.K.diagonal().max()))
        if dt > self.safety * limit:
            return ConvergenceError(not_converged(1, settings, np.inf, "the highest mode"))
        k, c = system.K.diagonal(), system.C.diagonal()
        force = (system.force[:, None] - system.load @ acc).T
        u = np.zeros((len(force), system.size))
        u[1] = 0.5 * dt**2 * force[0]
        for n in range(1, len(u) - 1):
            right = force[n] - k * u[n] + (2.0 * u[n] - u[n - 1]) / dt**2 + c * u[n - 1] / (2.0 * dt)
            u[n + 1] = right / (1.0 / dt**2 + c / (2.0 * dt))
        progress(len(u) - 1, len(u) - 1)
        rows = u[:: settings.steps.stride]
        disp, none = rows @ system.observe.toarray().T, np.zeros((len(rows), 0, 1))
        rest = dict.fromkeys(("input", "kinetic", "strain", "joint_stored", "residual"), np.zeros(len(rows)))
        time = np.arange(len(rows)) * settings.steps.interval
        stats = {"steps": float(len(u) - 1), "finest_step": dt, "loop_cpu_seconds": 0.0}
        return History(
            time, disp, 0.0 * disp, 0.0 * disp, Coordinates.of(rows, rows), rest, {}, stats, self.name,
            jump=none, traction=none, mean_traction=none, state=none[..., 0],
        )  # fmt: skip


@pytest.fixture
def registered(monkeypatch):
    """The one line."""
    monkeypatch.setitem(
        INTEGRATORS, CentralDifferences.name, IntegratorEntry(f"{__name__}:CentralDifferences")
    )


def oscillator(gaps=0):
    """A mass on a spring, 5 Hz, 3 % damping."""
    k = (2.0 * np.pi * 5.0) ** 2
    system = sparse_system(1.0, k, np.ones((gaps, 1)), gap_law(gaps), C=0.06 * np.sqrt(k), load=[1.0])
    return modal_twin(system)


def test_an_integrator_is_one_file_and_one_line(registered):
    """Named in a configuration, and run through `simulate` of the pipeline to the answer of the exact one."""
    config = load_config(EXAMPLE).config
    raw = config.model_dump(mode="json") | {
        "transient": {"finest_step": 1e-4, "integrator": "central_differences"}
    }
    job = Job(parse_config(raw, "dam.yaml"), EXAMPLE)
    system, time = oscillator(), np.arange(101) * 0.01
    motion = GroundMotion("sine", ground(np.sin(12.0 * time)), 0.01)
    prepared = prepare(job, system)
    assert isinstance(prepared.integrator, CentralDifferences)
    toy, exact = (simulate_motion(job, p, motion) for p in (prepared, prepare(job, system, "modal")))
    assert toy.integrator == "central_differences" and toy.stats["ledger_imbalance"] == 0.0
    assert np.abs(toy.disp - exact.disp).max() < 1e-3 * np.abs(exact.disp).max()
    with pytest.raises(ConfigError, match="without joints"):
        simulate_motion(job, prepare(job, oscillator(gaps=1)), motion)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_what_is_declared_is_what_the_integrator_says(name):
    entry, kind = INTEGRATORS[name], integrator_class(name)
    assert kind.name == name
    config = load_config(EXAMPLE).config.transient
    for key in entry.keys:
        other = config.model_copy(update={key: 0.25})
        assert kind.configured(other) != kind.configured(config), key
    free = replace(oscillator(gaps=1), C=0.0 * oscillator().C)
    free.C.eliminate_zeros()
    for system, suits in (
        (free, True),
        (oscillator(gaps=1), entry.damped),
        (replace(free, diagonal=False), not entry.uncoupled),
    ):
        if suits:
            kind().supports(system)
        else:
            with pytest.raises(ConfigError, match=f"transient.integrator: {name}"):
                kind().supports(system)


def test_options_are_the_integrators_own():
    """None of one integrator's options is one of `Settings`, and each has a default."""
    common = {field.name for field in fields(Settings)}
    for name in INTEGRATORS:
        kind = integrator_class(name)
        assert common.isdisjoint(field.name for field in fields(kind))
        assert kind() == kind()


def test_the_scene_decides_where_no_integrator_is_named():
    damped = oscillator(gaps=1)
    free = replace(damped, C=0.0 * damped.C)
    assert suitable_integrator(damped) == "adaptive"
    assert suitable_integrator(free) == "conserving"
    assert suitable_integrator(replace(free, law=gap_law(0))) == "adaptive"
    weak = replace(free.law, laws={"cohesion": np.ones(1)})
    assert suitable_integrator(replace(free, law=weak)) == "adaptive"
    assert suitable_integrator(replace(damped, diagonal=False)) == "generalized_alpha"


def test_keys_of_another_integrator_are_told():
    raw = load_config(EXAMPLE).config.model_dump(mode="json", exclude_defaults=True)
    raw["transient"] = {"finest_step": 0.001, "integrator": "modal", "rho_inf": 0.8}
    (line,) = check_assumptions(parse_config(raw, "dam.yaml"))
    assert line.startswith("transient.rho_inf: does nothing with modal") and "generalized_alpha" in line


def test_unequal_integrators_are_not_taken_together():
    both = [prepared_for(oscillator(), name) for name in ("modal", "adaptive")]
    with pytest.raises(AssertionError):
        at_steps.simulate(both, [ground(np.zeros(5))] * 2, Settings(Steps(0.01)))
    assert at_steps.simulate([], [], Settings(Steps(0.01))) == []


def test_steps_divide_the_written_rows():
    assert cut_steps(0.00125, 0.01, 0.01) == Steps(0.01, 1, (2, 4))
    assert cut_steps(0.0025, 0.01, None) == Steps(0.01, 1, (4,))
    assert fixed_steps(0.0025, 0.01) == Steps(0.0025, 4) and fixed_steps(0.1, None) == Steps(0.1)
    assert fixed_steps(0.003, 0.01, 0.01) == Steps(0.0025, 4)
    steps = Steps(0.01, 2, (2, 4))
    assert (steps.finest, steps.interval, steps.sizes) == (0.00125, 0.02, [0.01, 0.005, 0.00125])


@pytest.mark.parametrize(
    ("finest", "dt", "interval", "expected"),
    [
        (0.001, 0.01, None, Steps(0.01, 1, (2, 5))),
        (0.002, 0.01, 0.01, Steps(0.01, 1, (5,))),
        (0.01 / 3, 0.01, 0.02, Steps(0.01, 2, (3,))),
        (0.0006, 0.01, None, Steps(0.01, 1, (2, 3, 3))),
        (0.01 / 7, 0.01, None, Steps(0.01, 1, (2, 4))),
        (0.003, 0.01, 0.003, Steps(0.001, 3, ())),
        (0.001, 0.01, 0.008, Steps(0.002, 4, (2,))),
        (0.000625, 0.02, 0.02, Steps(0.02, 1, (2, 4, 4))),
        (0.0025, 0.0024, 0.02, Steps(0.0025, 8, ())),
    ],
)
def test_base_steps_hold_the_samples_of_the_record(finest, dt, interval, expected):
    found = cut_steps(finest, dt, interval)
    assert (found.stride, found.cuts) == (expected.stride, expected.cuts)
    assert found.base == pytest.approx(expected.base, rel=1e-12)
    assert found.finest <= finest * (1.0 + 1e-9)
    assert found.finest >= 0.75 * finest or found.base < dt
    assert holds_samples(found.base, dt) or finest > dt


def test_fixed_steps_hold_the_samples_too():
    assert fixed_steps(0.003, None, 0.01) == Steps(0.0025)
    assert fixed_steps(0.01 / 7, None, 0.01) == Steps(0.01 / 7)
    assert fixed_steps(0.02, None, 0.01) == Steps(0.02)


def test_a_grid_that_has_to_pass_by_the_samples_is_fine():
    found = grid_steps(0.01, 0.0317)
    assert not holds_samples(found.base, 0.01)
    assert found.base <= 0.01 / 8 and found.interval == pytest.approx(0.0317)
    assert grid_steps(0.0024, 0.02).base == pytest.approx(0.0008)
    assert grid_steps(0.01, 0.001) == Steps(0.001)


@pytest.mark.parametrize("integrator", ["adaptive", "modal"])
@pytest.mark.parametrize("finest", [0.001, 0.002, 0.003])
def test_a_linear_system_is_exact_at_any_finest_step(integrator, finest):
    """Steps of 8 ms, as `finest_step` 1 and 2 ms had with records of 10 ms, are off by 10 %."""
    dt, time = 0.01, np.arange(200) * 0.01
    motion = GroundMotion("m", ground(np.sin(60.0 * time) * (-1.0) ** np.arange(200)), dt)
    prepared = prepared_for(oscillator(), integrator)

    def at_rows(steps):
        acc = resample_motion(motion, steps.base)
        found = at_steps.simulate_one(prepared, acc, Settings(steps, initial_state="undeformed"))
        return found.q[:: round(dt / steps.interval)]

    exact = at_rows(Steps(dt / 64))
    found = at_rows(prepared.integrator.steps(finest, dt, None))
    rows = min(len(exact), len(found))
    assert rows >= 199
    assert np.abs(found[:rows] - exact[:rows]).max() < 1e-9 * np.abs(exact).max()


def to_accuracy(job, accuracy):
    transient = job.config.transient.model_copy(update={"finest_step": None, "accuracy": accuracy})
    return replace(job, config=job.config.model_copy(update={"transient": transient}))


def test_settings_of_a_job_and_of_a_run_that_an_accuracy_has_stepped():
    job, motion = load_config(EXAMPLE), GroundMotion("m", np.zeros((3, 50)), 0.01)
    prepared = prepare(job, oscillator(gaps=1))
    assert settings_for(job, prepared, motion).steps == Steps(0.01, 1, (4,))
    loose, tight = to_accuracy(job, 0.02), to_accuracy(job, 0.001)
    assert prepare(loose, oscillator(gaps=1)).integrator.force_change == 0.003  # never more than its own
    assert prepare(tight, oscillator(gaps=1)).integrator.force_change == 0.001
    assert settings_for(loose, prepared, motion).steps == Steps(0.01, 1)
    assert settings_for(loose, prepared, motion, (0.00125, 0.01)).steps == Steps(0.01, 1, (2, 4))
    assert settings_for(loose, prepared, motion, (0.00125, 0.005)).steps == Steps(0.005, 2, (4,))


def test_the_declaration_loads_no_integrator():
    assert not hasattr(integrators, "Adaptive")
    with pytest.raises(ConfigError, match="no integrator 'euler'"):
        integrator_class("euler")


@pytest.mark.parametrize(("interval", "told"), [(0.01, False), (0.008, False), (0.0317, True)])
def test_a_written_interval_that_passes_by_the_samples_is_told(interval, told):
    job = to_accuracy(load_config(EXAMPLE), 0.01)
    outputs = job.config.outputs.model_copy(update={"output_interval": interval})
    job = replace(job, config=job.config.model_copy(update={"outputs": outputs}))
    zigzag = GroundMotion("m", np.tile((-1.0) ** np.arange(3001), (3, 1)), 0.01)
    lines = [line for line in job_warnings(job, [zigzag]) if "pass by its samples" in line]
    assert len(lines) == told
    assert all("0.03 s loses nothing" in line and "0.089 of its acceleration in L2" in line for line in lines)


WHOLE_RECORD = {"adaptive": {"force_change": np.inf}}  # it cuts steps by the record's peak ground velocity


def _pounding(entry):
    """Four masses in a row, a gap with friction at the first three unknowns; 4 s of noise."""
    K = 60.0 * np.eye(4) + 40.0 * (2.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    law, C = gap_law(1, K_n=1e4, K_s=5e3, mu=0.5), (0.3 if entry.damped else 0.0) * np.eye(4)
    system = sparse_system(np.eye(4), K, np.eye(4)[:3], law, C=C, load=[1.0, 0.5, 1.0, 1.0])
    t, rng = np.arange(801) * 0.005, np.random.default_rng(0)
    return replace(modal_twin(system), reduced=True), ground(3.0 * np.sin(6.0 * t) + rng.standard_normal(801))


@pytest.mark.parametrize("name", INTEGRATORS)
def test_an_integrator_that_resumes_gives_the_rows_of_the_run_itself_and_any_other_is_refused(name):
    (system, shaking), kind = _pounding(INTEGRATORS[name]), integrator_class(name)
    options = {"initial_state": "undeformed", "tolerance": 1e-12} | WHOLE_RECORD.get(name, {})
    whole = simulated(system, shaking, 0.005, name, **options)
    assert set(np.unique(whole.state)) == {0, 1, 2}
    for row in (300, 500):
        start = start_at(whole, system.law, row, whole.jump[row])
        if not kind.resumes:
            with pytest.raises(ConfigError, match=f"integrator: {name} cannot go on.*Settings.start"):
                simulated(system, shaking[:, row:], 0.005, name, start=start, **options)
            continue
        rest = simulated(system, shaking[:, row:], 0.005, name, start=start, **options)
        assert np.abs(rest.jump - whole.jump[row:]).max() <= 1e-12 * np.abs(whole.jump).max()
        assert np.abs(rest.traction - whole.traction[row:]).max() <= 1e-10 * np.abs(whole.traction).max()


@pytest.mark.parametrize("name", INTEGRATORS)
def test_added_jumps_are_an_initial_gap_or_refused(name):
    (system, shaking), kind = _pounding(INTEGRATORS[name]), integrator_class(name)
    options = {"initial_state": "undeformed", "tolerance": 1e-12} | WHOLE_RECORD.get(name, {})
    shift = np.zeros((shaking.shape[1], 3))
    shift[:, 0] = 0.002
    if not kind.shifts:
        with pytest.raises(ConfigError, match=f"integrator: {name} cannot take.*Settings.shift"):
            simulated(system, shaking, 0.005, name, shift=shift, **options)
        return
    shifted = simulated(system, shaking, 0.005, name, shift=shift, **options)
    wider = replace(system, law=replace(system.law, gap=system.law.gap + 0.002))
    expected = simulated(wider, shaking, 0.005, name, **options)
    assert np.abs(shifted.jump - expected.jump)[1:].max() <= 1e-9 * np.abs(expected.jump).max()


def test_an_estimate_is_made_with_an_integrator_that_does_not_resume():
    raw = load_config(EXAMPLE)
    for name, made in ((None, True), ("adaptive", True), ("generalized_alpha", True)):
        transient = raw.config.transient.model_copy(update={"integrator": name, "accuracy": None})
        outputs = raw.config.outputs.model_copy(update={"error_estimate": True})
        config = raw.config.model_copy(update={"transient": transient, "outputs": outputs})
        assert can_estimate(replace(raw, config=config)) == made
