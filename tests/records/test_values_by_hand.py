"""Every measure and every step of a record's processing has a value that was worked out on paper."""

import numpy as np
import pytest
from scipy.signal import lsim

from romdam.records.components import measures, peak, spectrum
from romdam.records.measures import content_frequency, fourier_amplitude, measure, significant_duration
from romdam.records.processing import correction_steps as steps
from romdam.records.processing.corners import drift_ratio, signal_to_noise_band
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.processing.resampling import cut_or_extended, lost_between, resample, strongest_part
from romdam.records.spectra import response_spectra, rotated_psa

ACC, DT = np.array([0.0, 2.0, -1.0, 3.0]), 0.5


def test_velocity_and_displacement_of_four_samples():
    """v += dt (a0 + a1)/2; d += dt v + dt^2 (2 a0 + a1)/6."""
    np.testing.assert_allclose(velocity(ACC, DT), [0.0, 0.5, 0.75, 1.25], rtol=1e-15)
    np.testing.assert_allclose(displacement(ACC, DT), [0.0, 1 / 12, 11 / 24, 7 / 8], rtol=1e-14)


def test_measures_of_four_samples():
    """a^2 = 0, 4, 1, 9: its running integral is 0, 1, 2.25, 4.75; |a| = 0, 2, 1, 3: 2.25."""
    found = {name: values.item() for name, values in measure(ACC, DT).items()}
    assert found == pytest.approx(
        {
            "pga": 3.0,
            "pgv": 1.25,
            "pgd": 7 / 8,
            "arias": np.pi / (2 * 9.80665) * 4.75,
            "cav": 2.25,
            "d5_75": 1.2625 - 0.11875,  # 1 s + 1.3125/2.5 dt; 0.2375/1 dt
            "d5_95": 1.4525 - 0.11875,
            "duration": 1.5,
            "dt": 0.5,
        },
        rel=1e-12,
    )
    assert significant_duration(ACC, DT, 0.25, 0.5) == pytest.approx(1.025 - 0.575, rel=1e-12)
    assert np.isnan(significant_duration(0.0 * ACC, DT, 0.05, 0.95))


def test_fourier_amplitude_of_four_samples():
    """1 0 -1 0 at 4 Hz: |1 - (-1)| dt at 1 Hz, nothing at 0 and 2 Hz; 1 -1 1 -1: 4 dt at 2 Hz."""
    freq, amplitude = fourier_amplitude(np.array([[1.0, 0, -1, 0], [1, -1, 1, -1]]), 0.25)
    np.testing.assert_allclose(freq, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(amplitude, [[0.0, 0.5, 0.0], [0.0, 0.0, 1.0]], atol=1e-15)


def test_content_of_two_sines():
    """2 Hz with an amplitude of 1, 8 Hz with 1/2: 80 % and 20 % of the power."""
    time = np.arange(400) * 0.01
    acc = (np.sin(4 * np.pi * time) + 0.5 * np.sin(16 * np.pi * time))[None] + 7.0
    assert [content_frequency(acc, 0.01, share) for share in (0.79, 0.81)] == [2.0, 8.0]


def test_measures_of_components():
    """At one sample x = 3 and y = 4, at another z = 5 alone; the resultant of x and y is 5."""
    acc = np.zeros((3, 9))
    acc[0, 3], acc[1, 3], acc[2, 6] = 3.0, -4.0, 4.5
    values = {of: peak(acc, of) for of in ("largest", "larger_horizontal", "geometric_mean", "x", "y", "z")}
    assert values == pytest.approx(
        {"largest": 4.5, "larger_horizontal": 4, "geometric_mean": 12**0.5, "x": 3, "y": 4, "z": 4.5}
    )
    assert peak(acc, "rotd100") == pytest.approx(5.0, rel=2e-4)  # at a degree next to the resultant
    assert peak(acc, "rotd50") == pytest.approx(5.0 * 0.5**0.5, rel=0.01)
    assert measures(acc, 1.0, "geometric_mean")["cav"] == pytest.approx(12**0.5)
    with pytest.raises(Exception, match="needs motion along y"):
        peak(acc * [[1], [0], [1]], "geometric_mean")


def test_detrends():
    np.testing.assert_allclose(steps.subtract_mean(np.array([1.0, 3, 5, 9]), 2), [-1, 1, 3, 7])
    np.testing.assert_allclose(steps.subtract_mean(np.array([1.0, 3, 5, 7])), [-3, -1, 1, 3])
    np.testing.assert_allclose(steps.subtract_trend(np.array([1.0, 2, 4]), 1), [1 / 6, -1 / 3, 1 / 6])
    np.testing.assert_allclose(steps.subtract_trend(np.array([1.0, 2, 6]), 0), [-2, -1, 3])


@pytest.mark.parametrize("samples", [3, 4, 50])
def test_constants_of_integration(samples):
    """A constant is the slope of its velocity and half the curvature of its displacement: nothing is left."""
    constant = np.full((2, samples), [[0.3], [-2.0]])
    np.testing.assert_allclose(steps.subtract_velocity_trend(constant, 0.2, 1), 0.0, atol=1e-14)
    np.testing.assert_allclose(steps.subtract_displacement_baseline(constant, 0.2, 2), 0.0, atol=1e-13)
    np.testing.assert_allclose(steps.subtract_velocity_baseline(constant, 0.2, ()), 0.0, atol=1e-14)


def test_a_line_is_the_derivative_of_a_parabola():
    """a = 2 + 3 t: v = 2 t + 1.5 t^2; of order 1 it takes the line that fits v best."""
    time = np.arange(2001) * 1e-3
    acc = 2.0 + 3.0 * time
    np.testing.assert_allclose(steps.subtract_velocity_trend(acc, 1e-3, 2), 0.0, atol=1e-9)
    # a parabola t^2 on [0, T] is fitted best by T t - T^2/6: a slope of 1.5 T = 3 is taken from a
    np.testing.assert_allclose(steps.subtract_velocity_trend(acc, 1e-3, 1), 3.0 * time - 3.0, atol=2e-5)


def test_taper_and_pads():
    window = steps.taper(np.ones(8), 4, 2)
    half = 0.5 * (1.0 - np.cos(np.pi / 4))
    np.testing.assert_allclose(window, [0.0, half, 0.5, 1.0 - half, 1.0, 1.0, 0.5, 0.0], atol=1e-15)
    np.testing.assert_array_equal(steps.pad(np.ones((1, 2)), 1, 3), [[0, 1, 1, 0, 0, 0]])
    assert steps.pad_samples(4, 0.1, 0.02) == 3000  # 1.5 x 4 / 0.1 = 60 s


def test_gains_of_whole_periods():
    """Whole periods pass a zero-phase filter with its gain: 1/sqrt(1 + (fc/f)^2n) or (f/fc)."""
    time = np.arange(64) / 32.0
    for freq, corner, order in ((2.0, 1.0, 2), (4.0, 5.0, 3)):
        wave = np.cos(2 * np.pi * freq * time)
        for corners, ratio in (((corner, None), corner / freq), ((None, corner), freq / corner)):
            out = steps.butterworth(wave, 1 / 32.0, order, corners, causal=False)
            np.testing.assert_allclose(out, wave / np.sqrt(1.0 + ratio ** (2 * order)), atol=1e-14)
    level = steps.butterworth(np.ones(64), 1 / 32.0, 2, (1.0, None), causal=False)
    np.testing.assert_allclose(level, 0.0, atol=1e-15)


def test_onset_is_where_the_sum_of_log_variances_is_least():
    """Maeda (1985) by loops: k log var(x[:k]) + (n - k - 1) log var(x[k:]); here where the noise ends."""
    rng = np.random.default_rng(3)
    for quiet, loud in ((100, 80), (37, 200)):
        row = np.concatenate([0.01 * rng.normal(size=quiet), rng.normal(size=loud)])
        window = row[: int(np.argmax(np.abs(row))) + 1]
        n = window.size
        aic = {
            k: k * np.log(np.var(window[:k])) + (n - k - 1) * np.log(np.var(window[k:]))
            for k in range(2, n - 2)
        }
        assert steps.pick_onset(row[None], 0.01) == min(aic, key=aic.get)
        assert abs(min(aic, key=aic.get) - quiet) <= 2
    both = np.stack([np.roll(row, 5), row])
    assert steps.pick_onset(both, 0.01) == steps.pick_onset(row[None], 0.01)


def test_band_of_a_signal_between_half_and_twelve_hertz():
    """White noise of 0.01; after 20 s lines from 0.5 to 12 Hz stand out. Smoothed over 1/9 decade."""
    rng, dt = np.random.default_rng(5), 0.01
    noise = 0.01 * rng.normal(size=8000)
    spectrum_of = np.fft.rfft(rng.normal(size=6000))
    freq = np.fft.rfftfreq(6000, dt)
    signal = np.fft.irfft(np.where((freq > 0.5) & (freq < 12.0), spectrum_of, 0.0), 6000)
    noise[2000:] += signal
    low, high = signal_to_noise_band(noise[None], dt, 2000, 3.0)
    assert 0.5 / 10 ** (1 / 18) * 0.97 < low < 0.55 and 11.5 < high < 12.0 * 10 ** (1 / 18) * 1.03


def test_drift_of_a_cubic_and_of_a_fast_wave():
    """A displacement of many periods holds no cubic; a half wave as long as the record is one."""
    time = np.arange(4001) * 0.01
    fast = np.sin(2 * np.pi * 2.0 * time) * np.sin(np.pi * time / 40.0) ** 4
    assert drift_ratio(fast[None], 0.01, 0.5) < 1e-3
    assert drift_ratio(np.sin(2 * np.pi * time / 40.0)[None], 0.01, 0.01) > 0.5


def test_straight_lines_between_samples():
    np.testing.assert_allclose(resample(np.array([0.0, 2.0, 6.0]), 1.0, 0.5), [0, 1, 2, 4, 6])
    np.testing.assert_allclose(resample(np.array([0.0, 2.0, 6.0]), 1.0, 0.4), [0, 0.8, 1.6, 2.8, 4.4, 6.0])
    lost = lost_between(np.array([[0.0, 1.0, 0.0, -2.0, 0.0]]), 1.0, 2.0)
    assert lost == pytest.approx((1.0, 1.0))
    assert lost_between(np.array([[0.0, 3.0, 4.0]]), 1.0, 2.0) == pytest.approx((0.2, 0.25))


@pytest.mark.parametrize("finer", [2, 4])
def test_an_impulse_between_samples(finer):
    """Trigonometric interpolation of 2n = 16 samples: sin(pi x)/(16 tan(pi x/16)), half of the last line."""
    impulse = np.zeros(8)
    impulse[3] = 1.0
    x = np.arange(7 * finer + 1) / finer - 3.0
    with np.errstate(invalid="ignore", divide="ignore"):
        kernel = np.where(x == 0.0, 1.0, np.sin(np.pi * x) / (16.0 * np.tan(np.pi * x / 16.0)))
    np.testing.assert_allclose(resample(impulse, 1.0, 1.0 / finer, "fourier"), kernel, atol=1e-13)


def test_a_coarser_interval_carries_what_is_below_eight_tenths_of_its_nyquist():
    """At 5 Hz Nyquist: 2 Hz passes whole, 4.5 Hz, in the midst of the edge, by half, 6 Hz not at all."""
    time = np.arange(4001) * 0.01
    bell = np.exp(-(((time - 20.0) / 5.0) ** 2))
    for freq, gain in ((2.0, 1.0), (4.5, 0.5), (6.0, 0.0)):
        coarse = resample(bell * np.cos(2 * np.pi * freq * (time - 20.0)), 0.01, 0.1)
        assert coarse[200] == pytest.approx(gain, abs=5e-3)


def test_parts_of_a_record():
    from romdam.core.motion import GroundMotion

    motion = GroundMotion.from_arrays("m", {"x": [1.0, 0, 3, 4, 0, 2]}, 0.5)
    first, part = strongest_part(motion, 0.5)
    assert first == 1.0 and part.acc[0].tolist() == [3.0, 4.0]
    assert cut_or_extended(motion.acc, 2)[0].tolist() == [1.0, 0.0]
    assert cut_or_extended(motion.acc, 8)[0].tolist() == [1.0, 0, 3, 4, 0, 2, 0, 0]


def test_a_step_at_every_period():
    """1 + exp(-pi xi/sqrt(1 - xi^2)) of the static value, and v = exp(-xi acos(xi)/sqrt(1 - xi^2))/omega."""
    xi, periods = 0.05, np.geomspace(0.01, 1.0, 400)
    found = response_spectra(np.ones(1001), 0.01, periods, (xi,))
    root = np.sqrt(1.0 - xi**2)
    np.testing.assert_allclose(found.psa[0, 0], 1.0 + np.exp(-np.pi * xi / root), rtol=1e-4)
    largest = np.exp(-xi * np.arccos(xi) / root) / (2 * np.pi / periods)
    after = found.sv[0, 0] >= largest * (1.0 - 1e-3)  # the end of the step may make it larger
    assert after.all()


def test_spectra_of_components_turned():
    """Motion along 30 degrees: RotD100 is that of the line, RotD50 its part at 45 degrees from it."""
    rng = np.random.default_rng(2)
    line, periods = rng.normal(size=400), np.array([0.1, 0.5])
    acc = np.stack([np.cos(np.pi / 6) * line, np.sin(np.pi / 6) * line, 0.0 * line])
    single = response_spectra(line, 0.01, periods, (0.05,)).psa[0, 0]
    half, full = rotated_psa(acc[0], acc[1], 0.01, periods)
    np.testing.assert_allclose(full, single, rtol=1e-3)
    np.testing.assert_allclose(half, single * 0.5**0.5, rtol=0.01)
    mean = spectrum(acc, 0.01, periods, 0.05, "geometric_mean")
    np.testing.assert_allclose(mean, single * (0.75**0.5 * 0.5) ** 0.5, rtol=1e-9)


@pytest.mark.parametrize("damping", [0.02, 0.4])
def test_absolute_acceleration_has_the_force_of_the_damper_too(damping):
    """Largest |2 xi w v + w^2 u| of u'' + 2 xi w u' + w^2 u = -a, by scipy in 100 steps an interval."""
    dt, omega = 0.02, 2.0 * np.pi / 0.5
    acc = np.concatenate([np.sin(np.pi * np.arange(14) / 13), np.zeros(60)])
    fine = np.linspace(0.0, dt * (len(acc) - 1), 100 * (len(acc) - 1) + 1)
    ground = np.interp(fine, dt * np.arange(len(acc)), acc)
    force = [2.0 * damping * omega, omega**2]
    absolute = lsim(([-x for x in force], [1.0, *force]), ground, fine)[1]
    found = response_spectra(acc, dt, np.array([0.5]), (damping,)).sa
    assert found[0, 0, 0] == pytest.approx(np.abs(absolute).max(), rel=1e-3)


def test_absolute_acceleration_may_peak_where_the_force_of_the_spring_does_not():
    """A slow plateau has the larger w^2 u, a later fast pulse of 0.5 damping the larger 2 xi w v + w^2 u."""
    dt, damping, omega = 0.01, 0.5, 2.0 * np.pi / 0.5
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(200) / 199)
    pulse = 2.0 * np.sin(2.0 * np.pi * np.arange(80) / 16.0)
    acc = np.concatenate([rise, np.ones(200), rise[::-1], np.zeros(400), pulse, np.zeros(300)])
    fine = np.linspace(0.0, dt * (len(acc) - 1), 50 * (len(acc) - 1) + 1)
    ground = np.interp(fine, dt * np.arange(len(acc)), acc)
    poles = [1.0, 2.0 * damping * omega, omega**2]
    spring = np.abs(lsim(([-poles[2]], poles), ground, fine)[1])
    absolute = np.abs(lsim(([-poles[1], -poles[2]], poles), ground, fine)[1])
    assert spring[fine > 9.0].max() < 0.8 * spring.max() and absolute[fine > 9.0].max() == absolute.max()
    found = response_spectra(acc, dt, np.array([0.5]), (damping,)).sa
    assert found.item() == pytest.approx(absolute.max(), rel=1e-4)


@pytest.mark.parametrize("damping", [0.02, 0.4])
def test_a_long_period_peaks_after_the_record(damping):
    """Largest |u|, |v| and |2 xi w v + w^2 u| after a pulse of 0.26 s, at 4 s; by scipy over 8 s."""
    dt, omega = 0.02, 2.0 * np.pi / 4.0
    acc = np.sin(np.pi * np.arange(14) / 13)
    fine = np.linspace(0.0, 8.0, 40001)
    ground = np.interp(fine, dt * np.arange(len(acc)), acc, right=0.0)
    poles = [1.0, 2.0 * damping * omega, omega**2]
    u, v = (lsim((over, poles), ground, fine)[1] for over in ([-1.0], [-1.0, 0.0]))
    found = response_spectra(acc, dt, np.array([4.0]), (damping,))
    assert np.abs(u).argmax() * 8.0 / 40000 > 0.3  # s, after the pulse
    sizes = [np.abs(x).max() for x in (u, v, poles[1] * v + poles[2] * u)]
    assert [x.item() for x in (found.sd, found.sv, found.sa)] == pytest.approx(sizes, rel=1e-4)
