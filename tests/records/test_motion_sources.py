"""Ground motions from what Python has: arrays with units, DataArrays with times, ObsPy's streams."""

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from romdam import GroundMotion, RecordError

VALUES = np.array([0.0, 1.0, -2.0, 0.5])
G = 9.80665  # m/s2, standard gravity (CGPM 1901)


@pytest.mark.parametrize(
    ("units", "factor"),
    [
        (None, 1.0), ("m/s2", 1.0), ("m/s^2", 1.0), ("m s-2", 1.0), ("m/s**2", 1.0), ("m/s²", 1.0),
        ("g", G), ("cm/s2", 0.01), ("gal", 0.01), ("Gal", 0.01), ("mm/s2", 1e-3),
        ("9.81 m/s2", 9.81), ("4.7e-6 m/s2", 4.7e-6), ("0.5g", 0.5 * G),
    ],
)  # fmt: skip
def test_units_as_text(units, factor):
    motion = GroundMotion.from_arrays("pulse", {"y": VALUES}, 0.01, units=units)
    assert np.allclose(motion.acc, [0.0 * VALUES, factor * VALUES, 0.0 * VALUES], rtol=1e-15, atol=0.0)


@pytest.mark.parametrize("units", ["G", "kg", "m/s", "cm", "-1 g", "0 g", "counts"])
def test_what_is_no_acceleration_is_refused(units):
    with pytest.raises(RecordError, match=r"pulse: units .* is no acceleration; known are m/s2, cm/s2"):
        GroundMotion.from_arrays("pulse", {"y": VALUES}, 0.01, units=units)


def test_a_data_array_brings_its_times_components_and_units():
    times = 3.0 + 0.02 * np.arange(4)
    array = xr.DataArray(
        np.array([VALUES, 3.0 * VALUES]).T,
        {"time": times, "component": ["z", "x"]},
        ("time", "component"),
        attrs={"units": "cm s-2"},
    )
    motion = GroundMotion.from_arrays("pulse", array)
    assert motion.dt == pytest.approx(0.02, rel=1e-12)
    assert np.allclose(motion.acc, [0.03 * VALUES, 0.0 * VALUES, 0.01 * VALUES], rtol=1e-14)
    assert np.allclose(GroundMotion.from_arrays("pulse", array, units="g").acc[2], G * VALUES)
    again = GroundMotion.from_arrays("again", motion.to_xarray())
    assert np.array_equal(again.acc, motion.acc) and again.dt == pytest.approx(motion.dt, rel=1e-12)
    dated = array.assign_coords(
        time=np.datetime64("2020-01-01", "ns") + (1e9 * times).astype("timedelta64[ns]")
    )
    assert GroundMotion.from_arrays("pulse", dated).dt == pytest.approx(0.02, rel=1e-9)
    assert GroundMotion.from_arrays("x", array.sel(component="x")).acc[0, 1] == pytest.approx(0.03)


def test_times_that_are_uneven_missing_or_others_are_refused():
    array = xr.DataArray(
        VALUES[None], {"time": [0.0, 0.01, 0.03, 0.04], "component": ["y"]}, ("component", "time")
    )
    with pytest.raises(RecordError, match=r"time is not even: steps are .* off .*; resample it"):
        GroundMotion.from_arrays("pulse", array)
    even = array.assign_coords(time=0.01 * np.arange(4))
    with pytest.raises(
        RecordError, match=r"dt is 0\.02 s, and the coordinate time has 0\.01 s; leave dt out"
    ):
        GroundMotion.from_arrays("pulse", even, 0.02)
    with pytest.raises(RecordError, match="no coordinate time; give dt"):
        GroundMotion.from_arrays("pulse", array.drop_vars("time"))
    with pytest.raises(RecordError, match="dt is missing"):
        GroundMotion.from_arrays("pulse", {"y": VALUES})


@pytest.fixture
def stream():
    obspy = pytest.importorskip("obspy")
    about = {"network": "CI", "station": "MUL", "delta": 0.01, "starttime": obspy.UTCDateTime(1994, 1, 17)}
    return obspy.Stream(
        [
            obspy.Trace(factor * VALUES, about | {"channel": channel})
            for factor, channel in ((1.0, "HNE"), (2.0, "HNN"), (3.0, "HNZ"))
        ]
    )


def test_a_stream_gives_its_channels_in_their_units(stream):
    motion = GroundMotion.from_stream(stream, {"x": "HNN", "z": "CI.MUL..HNZ"}, units="cm/s2")
    assert np.allclose(motion.acc, [0.02 * VALUES, 0.0 * VALUES, 0.03 * VALUES])
    assert motion.name == "CI.MUL" and motion.dt == 0.01
    assert motion.provenance["channels"] == {"x": "CI.MUL..HNN", "z": "CI.MUL..HNZ"}
    alone = GroundMotion.from_stream(stream[0], {"y": "HNE"}, units="g", name="east")
    assert alone.name == "east" and np.allclose(alone.acc[1], G * VALUES)


def test_a_stream_that_does_not_fit_is_refused(stream):
    with pytest.raises(RecordError, match=r"0 traces are of channel 'BHZ'.*its traces are CI\.MUL\.\.HNE"):
        GroundMotion.from_stream(stream, {"x": "BHZ"}, units="g")
    with pytest.raises(RecordError, match=r"2 traces are of channel 'HNE', limit 1; merge or select"):
        GroundMotion.from_stream(stream + stream[:1], {"x": "HNE"}, units="g")
    stream[1].stats.starttime += 0.02
    with pytest.raises(RecordError, match=r"do not fit together: .* 0\.02 s apart.*trim and resample"):
        GroundMotion.from_stream(stream, {"x": "HNE", "y": "HNN"}, units="g")
    with pytest.raises(RecordError, match="components is empty"):
        GroundMotion.from_stream(stream, {}, units="g")


def test_obspy_is_loaded_by_nobody_but_its_user():
    code = "import sys, romdam; romdam.GroundMotion; assert 'obspy' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
