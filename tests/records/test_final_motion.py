"""What corrections and matching leave is told: ends beyond the limits, and measures that change."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from romdam.config.sections.motions.records import read_entry
from romdam.core.errors import RecordError
from romdam.records.processing.final_motion import said_of_changes
from romdam.records.record_set import load_motions
from romdam.records.spectra import response_spectra

DT = 0.01
CHAINS = {
    "none": [],
    "mean": ["mean"],
    "mean before": [{"mean": {"until": 2.0}}],
    "line": ["detrend"],
    "parabola of velocity": [{"detrend": {"of": "velocity", "order": 2}}],
    "taper": ["mean", {"taper": {"fraction": 0.05}}],
    "knots": [{"velocity_baseline": {"knots": [4.0, 12.0]}}],
    "baseline": [{"displacement_baseline": {"order": 4}}],
    "band": ["mean", {"butterworth": {"highpass": 0.1, "lowpass": 30.0}}],
    "causal": ["mean", {"pad": {"length": 20.0}}, {"butterworth": {"highpass": 0.2, "causal": True}}],
    "peer": "peer",
    "prism": "prism",
}


def raw(seed):
    """Noise as a raw record has it: quiet, shaking, a tilt of the sensor and a slow wave (nt,) [m/s2]."""
    random = np.random.default_rng(seed)
    time = np.arange(2501) * DT
    envelope = np.where(time > 2.0, (time - 2.0) * np.exp(-(time - 2.0) / 3.0), 0.0)
    acc = random.uniform(0.5, 3.0) * envelope * random.standard_normal(time.size)
    acc += random.choice([0.0, 1e-3, 1e-2]) * (time > random.uniform(3.0, 8.0))
    return acc + random.choice([0.0, 2e-3]) * np.sin(2 * np.pi * time / random.uniform(15.0, 60.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    home = tmp_path_factory.mktemp("raw")
    for seed in range(12):
        np.savetxt(home / f"r{seed}.txt", raw(seed), fmt="%.7e")
    return home


@pytest.mark.parametrize("chain", CHAINS)
def test_every_motion_that_ends_beyond_the_limits_is_told(folder, chain):
    """Twelve raw records: velocity 1 %, displacement 10 % of their peaks, by Simpson's rule."""
    used = 0
    for seed in range(12):
        entry = {"file": f"r{seed}.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}
        try:
            (motion,) = load_motions([read_entry(entry | {"correction": CHAINS[chain]}, "entry")], folder)
        except RecordError as error:
            assert "at least 50 % must stay" in str(error)
            continue
        used += 1
        time = motion.time
        fine = np.linspace(0.0, time[-1], 2 * (time.size - 1) + 1)
        vel = cumulative_simpson(np.interp(fine, time, motion.acc[1]), x=fine, initial=0.0)
        disp = cumulative_simpson(vel, x=fine, initial=0.0)
        for name, row, limit in (("velocity", vel, 0.01), ("displacement", disp, 0.1)):
            share = abs(row[-1]) / np.abs(row).max()
            told = any(f"the {name} ends at" in text for text in motion.warnings)
            if abs(share - limit) > 1e-3 * limit:
                assert told == (share > limit), (seed, name, share)
    assert used >= 6


def test_changed_spectral_accelerations_are_told():
    """A component without its slow wave of 3 s: the value at 3 s, not that at 0.2 s."""
    time = np.arange(4001) * DT
    window = np.sin(np.pi * time / time[-1]) ** 2
    quick, slow = (window * np.sin(2 * np.pi * time / period) for period in (0.2, 3.0))
    before, after = (np.stack([quick + part * slow, 0 * quick]) for part in (1.0, 0.5))
    (said,) = said_of_changes(before, after, DT, "xy", "the correction")
    sa = [response_spectra(rows[0], DT, np.array([3.0])).psa[0, 0, 0] for rows in (before, after)]
    assert f"Sa(3 s) from {sa[0]:.3g} to {sa[1]:.3g} m/s2 ({100 * (sa[1] / sa[0] - 1):+.0f} %)" in said
    assert "along x" in said and "Sa(0.2 s)" not in said
    assert said_of_changes(before, 1.04 * before, DT, "xy", "the correction") == ()


def test_matching_tells_what_it_changes_beyond_its_periods(folder):
    """A record that is matched from 0.2 to 1 s."""
    target = {
        "spectrum": {"points": [[0.1, "8 m/s2"], [0.5, "8 m/s2"], [4.0, "1 m/s2"]]},
        "periods": [0.2, 1.0],
        "of": "y",
    }
    entry = {"file": "r1.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}, "correction": "prism"}
    entry |= {"target": target, "match": {"tolerance": 0.1}}
    (motion,) = load_motions([read_entry(entry, "entry")], folder)
    (changed,) = [text for text in motion.warnings if text.startswith("matching changes, along y")]
    before = motion.provenance["target"]["matched"]["y"]["before"]["pgv [m/s]"]
    after = motion.provenance["target"]["matched"]["y"]["after"]["pgv [m/s]"]
    assert (abs(after / before - 1.0) > 0.1) == ("PGV" in changed)
    assert "Sa(0.5 s)" in changed
