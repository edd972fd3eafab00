"""Counts of instruments become the motion that they were put through: poles and zeros integrated in time."""

import numpy as np
import pytest
from linear_filter import filtered

from romdam.config.sections.motions.records import read_entry
from romdam.records.processing.response import remove_response
from romdam.records.record_set import load_motions

FINER = 16
FREQUENCIES = (0.1, 1.0, 10.0, 40.0)


def pair(freq, damping):
    """Two poles of an oscillator [rad/s]."""
    return [2 * np.pi * freq * (-damping + sign * 1j * np.sqrt(1 - damping**2)) for sign in (1, -1)]


# zeros and poles [rad/s], unit of input, counts over it at 5 Hz, samples a second
INSTRUMENTS = {
    "servo accelerometer": ([], pair(200.0, 0.707), "M/S**2", 8.2e5, 100.0),
    "film's accelerometer": ([], pair(20.0, 0.6), "M/S**2", 4.0e4, 200.0),
    "accelerometer with a pole": ([], [*pair(90.0, 0.7), -2 * np.pi * 150.0], "M/S**2", 2.1e5, 100.0),
    "broadband of 120 s": ([0, 0], [*pair(1 / 120, 0.707), *pair(150.0, 0.6)], "M/S", 6.0e8, 100.0),
    "broadband of 30 s": ([0, 0], pair(1 / 30, 0.707), "M/S", 1.2e9, 200.0),
    "geophone of 1 Hz": ([0, 0], pair(1.0, 0.7), "M/S", 4.0e8, 100.0),
}


def burst(time, freq, peak, middle):
    """A sine under a bell that ends at rest: the second derivative of one [m/s2]."""
    width, x = max(1.5 / freq, 0.6), time - middle
    omega, bell = 2 * np.pi * freq, np.exp(-((x / width) ** 2))
    slope, bend = -2 * x / width**2, 4 * x**2 / width**4 - 2 / width**2
    acc = (bend - omega**2) * np.sin(omega * x) + 2 * slope * omega * np.cos(omega * x)
    return peak * bell * acc / np.abs(bell * acc).max()


def recorded(folder, name, acc, rate):
    """Write the counts (nt,) of acc, at FINER times the rate, as miniSEED with its StationXML."""
    import obspy
    from obspy.core.inventory import Channel, Inventory, Network, Station
    from obspy.core.inventory.response import Response

    zeros, poles, unit, sensitivity, _ = INSTRUMENTS[name]
    s = 2j * np.pi * 5.0
    norm = abs(np.prod([s - p for p in poles]) / np.prod([s - z for z in zeros]))
    response = Response.from_paz(
        zeros, poles, sensitivity, 5.0, input_units=unit, output_units="COUNTS", normalization_frequency=5.0,
        normalization_factor=norm,
    )  # fmt: skip
    # velocity is the integral of acceleration: one zero at 0 less
    zeros = zeros[1:] if unit == "M/S" else zeros
    counts = filtered(zeros, poles, sensitivity * norm, acc, 1 / (rate * FINER))
    counts = np.round(counts[::FINER]).astype(np.int32)
    header = {"network": "XX", "station": "STA", "channel": "HNE", "delta": 1 / rate}
    trace = obspy.Trace(counts, header | {"starttime": obspy.UTCDateTime(2020, 1, 1)})
    trace.write(str(folder / "x.mseed"), format="MSEED")
    begin = obspy.UTCDateTime(2000, 1, 1)
    where = {"latitude": 0.0, "longitude": 0.0, "elevation": 0.0}
    channel = Channel(
        "HNE", "", depth=0.0, azimuth=90.0, dip=0.0, sample_rate=rate, start_date=begin, response=response,
        **where,
    )  # fmt: skip
    station = Station("STA", channels=[channel], start_date=begin, **where)
    network = Network("XX", stations=[station])
    Inventory([network], source="t").write(str(folder / "x.xml"), format="STATIONXML")
    entry = read_entry(
        {"file": "x.mseed", "response": "x.xml", "components": {"x": "HNE"}}, str(folder / "entry")
    )
    (motion,) = load_motions([entry], folder)
    return motion


@pytest.mark.parametrize("freq", FREQUENCIES)
@pytest.mark.parametrize("name", INSTRUMENTS)
def test_motion_through_an_instrument_comes_back(tmp_path, name, freq):
    """PGA and Arias intensity within 0.5 %, in a long record that shakes from its first seconds on."""
    rate = INSTRUMENTS[name][-1]
    time = np.arange(round(150.0 * rate) * FINER) / (rate * FINER)
    middle = 1.0 + 3.0 * max(1.5 / freq, 0.6)
    acc = burst(time, freq, 0.5, middle)
    motion = recorded(tmp_path, name, acc, rate)
    true, found = acc[::FINER], motion.acc[0]
    low, high = motion.provenance["channels"][0]["response_band_hz"]
    assert low <= 0.1 and high >= 40.0
    assert np.abs(found).max() == pytest.approx(np.abs(true).max(), rel=5e-3)
    assert (found**2).sum() == pytest.approx((true**2).sum(), rel=5e-3)
    assert any(f"divided out from {low:.3g} to {high:.3g} Hz" in text for text in motion.warnings)


def test_what_lies_beyond_the_band_is_told_and_nothing_is_printed(tmp_path, capfd):
    """5 mHz through a broadband sensor of 120 s, below the band."""
    rate = INSTRUMENTS["broadband of 120 s"][-1]
    time = np.arange(round(4000.0 * rate) * 2) / (rate * 2)
    acc = np.repeat(burst(time, 0.004, 1e-4, 1800.0), FINER // 2)
    motion = recorded(tmp_path, "broadband of 120 s", acc, rate)
    assert any("of the recorded energy, which is beyond, is left out" in text for text in motion.warnings)
    assert capfd.readouterr().err == ""


def test_a_record_cut_amid_its_motion_is_not_tapered(tmp_path):
    """A sine of 2 Hz from the first sample to the last keeps its amplitude at both ends."""
    rate = 100.0
    time = np.arange(round(20.0 * rate) * FINER) / (rate * FINER)
    acc = 0.3 * np.sin(2 * np.pi * 2.0 * time)
    motion = recorded(tmp_path, "servo accelerometer", acc, rate)
    ends = np.r_[20:100, -100:-20]
    np.testing.assert_allclose(motion.acc[0, ends], acc[::FINER][ends], atol=3e-3)


def test_a_record_that_ends_while_it_moves_comes_back_to_its_last_sample():
    """A flat response divided out: counts over 50, mean and ends too; beyond its ends it goes on to zero."""
    t = 0.01 * np.arange(2000)
    counts = 400.0 * np.cos(0.5 * np.pi * t) + 20.0 * t
    acc, _, _ = remove_response(counts, 0.01, lambda freq, *, native: np.full(freq.shape, 50.0 + 0j))
    assert abs(counts[-1] - counts.mean()) > 200.0
    np.testing.assert_allclose(acc, counts / 50.0, atol=2e-3 * np.abs(counts).max() / 50.0)
