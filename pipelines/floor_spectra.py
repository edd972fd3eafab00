"""Floor spectra of a run, and their error, from a run with more modes and half the steps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from romdam.config.coupling import couplings
from romdam.config.load import Job
from romdam.config.sections.floor_spectra import FloorSpectraConfig
from romdam.core.errors import ConfigError, describe_error, recoverable
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.pipelines.simulation import RunModel, ground_at_steps, settings_for
from romdam.postprocess.floor_spectra import (
    FloorSpectra,
    broadened,
    concerns,
    floor_spectra,
    relative_difference,
)
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.steps import grid_steps

_SLACK = 1.0 + 1e-6  # of a frequency over half of the sampling rate


def refuse_fast_oscillators(job: Job, motions: Iterable[GroundMotion]) -> None:
    """Refuse oscillators faster than half of the rate at which a run samples the motion of its nodes.

    Raises
    ------
    ConfigError
        with the record, the frequency and the limit.
    """
    outputs, finest = job.config.outputs, job.config.transient.finest_step
    asked = outputs.floor_spectra
    if asked is None:
        return
    config, fixed = job.config, {"modal", "generalized_alpha"}  # one step throughout, the finest
    one_step = config.transient.integrator in fixed or config.model.order == "full" or bool(couplings(config))
    for motion in motions:
        step = grid_steps(motion.dt, outputs.output_interval).base
        if finest is not None and (finest > motion.dt * _SLACK or one_step):
            step = finest
        most, highest = 0.5 / step, asked.frequencies[-1]
        if highest > most * _SLACK:
            raise ConfigError(
                f"{job.path}: outputs.floor_spectra.frequencies: oscillators of {highest:g} Hz on the "
                f"motion of {motion.name}, which is computed every {step:g} s, limit {most:g} Hz (half of "
                "the sampling rate); end the frequencies there, or set outputs.output_interval to "
                f"{0.5 / highest:.3g} s or less"
            )


def floors_of(
    job: Job, model: RunModel, motion: GroundMotion, history: History
) -> tuple[History, FloorSpectra | None]:
    """Compute the floor spectra that a job asks for, and their error where estimates are wanted.

    The run gets their warnings, and lets go of its motion at every step.
    """
    asked = job.config.outputs.floor_spectra
    if asked is None or history.every_step is None:
        return history, None
    spectra = _spectra(asked, model.scene, history)
    spectra = replace(spectra, highest_mode=_highest_mode(model))
    if asked.broadening is not None:
        wide = broadened(spectra.ordinates, spectra.frequencies, asked.broadening)
        spectra = replace(spectra, broadened=wide)
    warnings = list[str]()
    if job.config.outputs.error_estimate:
        try:
            better, words = _better_run(job, model, motion, history)
            error = relative_difference(spectra.ordinates, _spectra(asked, model.scene, better).ordinates)
            spectra = replace(spectra, error=error, error_of=words)
        except recoverable() as failure:
            warnings = [f"the error of its floor spectra is not estimated: {describe_error(failure)}"]
    warnings = [*history.warnings, *warnings, *concerns(spectra)]
    return replace(history, every_step=None, warnings=tuple(warnings)), spectra


def _spectra(asked: FloorSpectraConfig, scene: Scene, history: History) -> FloorSpectra:
    numbers = {probe.name: k for k, probe in enumerate(scene.probes)}
    places: dict[str, tuple[int, ...]] = {name: (k,) for name, k in numbers.items()}
    if asked.places is not None:
        places = {name: tuple(numbers[node] for node in nodes) for name, nodes in asked.places.items()}
    assert history.every_step is not None
    return floor_spectra(history.every_step, places, asked.dampings, asked.frequencies)


def _highest_mode(model: RunModel) -> float | None:
    """Frequency of the highest mode kept of the block that keeps fewest [Hz]; None where all are kept."""
    if model.reduced is None:
        return None
    highest = []
    for report in model.reduced.report.values():
        if isinstance(report, dict) and report.get("fixed_interface_modes"):
            highest.append(float(report["highest_fixed_interface_hz"]))
    return min(highest, default=None)


def _better_run(job: Job, model: RunModel, motion: GroundMotion, history: History) -> tuple[History, str]:
    """The same run with half the steps, and with the finer basis where there is one; what it has more."""
    prepared, words = model.prepared, "Halving the steps"
    if model.finer is not None and not model.finer.not_finer:
        prepared, words = model.finer.prepared, "Halving the steps and adding modes"
    chosen = history.stats["finest_step"], history.stats["base_step"]
    settings = settings_for(job, prepared, motion, chosen)
    steps = settings.steps
    halved = prepared.integrator.steps(0.5 * chosen[0], 0.5 * chosen[1], steps.interval)
    settings = replace(settings, steps=halved, shear_share=0.5)
    ground = ground_at_steps(motion, halved.base, job.config.transient.duration, prepared.system)
    return simulate_one(prepared, ground, settings), words
