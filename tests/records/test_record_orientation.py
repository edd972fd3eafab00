"""Azimuths: what component codes say, what is declared, which channel a number or an azimuth means."""

import numpy as np
import obspy
import pytest
import samples
from test_record_suites import at2

from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RecordError
from romdam.records.channel import Channel, Orientation, parse_orientation
from romdam.records.record_set import load_motions
from romdam.records.sources import pick

UP, DOWN = Orientation(None, 1), Orientation(None, -1)


@pytest.mark.parametrize(
    ("code", "where"),
    [
        ("WE", 90.0), ("W-E", 90.0), ("EW", 90.0), ("SN", 0.0), ("S-N", 0.0), ("NS", 0.0),
        ("NORTH", 0.0), ("East", 90.0), ("SOUTH", 180.0), ("West", 270.0), ("EAS", 90.0), ("WES", 270.0),
        ("N", 0.0), ("E", 90.0), ("S", 180.0), ("W", 270.0), ("0", 0.0), ("90", 90.0), ("5 deg", 5.0),
        ("S90E", 90.0), ("N00E", 0.0), ("N 35 E", 35.0), ("S10.5W", 190.5), ("BNE", 90.0), ("HHN", 0.0),
    ],
)  # fmt: skip
def test_codes_that_say_an_azimuth(code, where):
    assert parse_orientation(code) == Orientation(where)


@pytest.mark.parametrize(
    "code", ["1", "2", "3", "9", "HN1", "HHW", "HHU", "THE", "ONE", "L", "T", "H1", "V2", "N95E", "365"]
)
def test_codes_that_say_nothing(code):
    assert parse_orientation(code) is None


def test_we_and_ns_are_turned_to_the_dam(tmp_path):
    """North and east alike are a motion towards N45E: sqrt(2) along an x of azimuth 45, none along y."""
    for component in ("NS", "WE"):
        at2(tmp_path, f"{component}.AT2")
        path = tmp_path / f"{component}.AT2"
        path.write_text(path.read_text().replace(", 090", f", {component}"))
    entry = {"files": "*.AT2", "group": "station", "x_azimuth": 45}
    (motion,) = load_motions([RecordConfig.model_validate(entry)], tmp_path)
    np.testing.assert_allclose(motion.acc[0], np.sqrt(2.0) * samples.motion(), atol=1e-6)
    np.testing.assert_allclose(motion.acc[1], 0.0, atol=1e-12)


@pytest.fixture
def hn12(tmp_path):
    traces = [
        obspy.Trace(samples.motion(seed), {"delta": samples.DT, "channel": code, "station": "DAM"})
        for seed, code in enumerate(("HN1", "HN2", "HNZ"), start=1)
    ]
    obspy.Stream(traces).write(str(tmp_path / "r.mseed"), "MSEED")
    return {"file": "r.mseed", "unit": "m/s2", "x_azimuth": 35}


def test_azimuths_are_declared(tmp_path, hn12):
    entry = RecordConfig.model_validate(hn12 | {"azimuths": {"HN1": "35 deg", "HN2": 305}})
    (motion,) = load_motions([entry], tmp_path)  # y is 90 degrees to the left of x
    np.testing.assert_allclose(motion.acc, [samples.motion(seed) for seed in (1, 2, 3)], atol=1e-12)
    assert [one["azimuth"] for one in motion.provenance["channels"]] == [35.0, 305.0, None]


@pytest.mark.parametrize(
    ("azimuths", "message"),
    [
        ({}, r"HN1: the file does not say its azimuth; give it, `azimuths: \{HN1: 90 deg"),
        ({"HN3": 0}, r"`azimuths` names HN3, the channels are HN1, HN2, HNZ"),
        ({"HN1": 0, "HN2": 90, "HNZ": "down"}, r"HNZ: the file says up, `azimuths` down"),
    ],
)
def test_azimuths_that_contradict(tmp_path, hn12, azimuths, message):
    with pytest.raises(RecordError, match=message):
        load_motions([RecordConfig.model_validate(hn12 | {"azimuths": azimuths})], tmp_path)


def test_columns_have_azimuths_too(tmp_path):
    rows = zip(*(samples.motion(seed) for seed in (1, 2, 3)), strict=True)
    (tmp_path / "r.csv").write_text("".join(f"{a:.8f},{b:.8f},{c:.8f}\n" for a, b, c in rows))
    entry = {"file": "r.csv", "dt": samples.DT, "unit": "m/s2", "layout": "columns", "x_azimuth": 90}
    azimuths = {"azimuths": {2: 90, 3: 0}}
    (motion,) = load_motions([RecordConfig.model_validate(entry | azimuths)], tmp_path)
    np.testing.assert_allclose(motion.acc[0], samples.motion(2), atol=1e-7)
    np.testing.assert_allclose(motion.acc[1], samples.motion(3), atol=1e-7)
    assert "channel 1 is left out, it is not among `azimuths`" in motion.warnings


def channels(*codes):
    return [Channel(code, np.zeros(3), 0.01, "g", parse_orientation(code)) for code in codes]


@pytest.mark.parametrize(
    ("codes", "wanted", "picked"),
    [
        (("360", "UP", "090"), 90, "090"), (("360", "UP", "090"), 360, "360"),
        (("360", "UP", "090"), 0, "360"), (("360", "UP", "090"), 1, "360"),
        (("360", "UP", "090"), 3, "090"), (("090",), 1, "090"),
        (("2", "3"), 2, "2"), (("HNE", "HNN"), 2, "HNN"), (("0", "90"), "90", "90"),
    ],
)  # fmt: skip
def test_a_number_is_a_code_an_azimuth_or_a_position(codes, wanted, picked):
    assert pick(channels(*codes), wanted, "r", "y").code == picked


@pytest.mark.parametrize(
    ("codes", "wanted"),
    [(("2", "3"), 1), (("13", "14"), 3), (("090", "002", "360"), 4), (("000", "002"), 9)],
)
def test_a_number_that_is_none_of_them_is_refused(codes, wanted):
    with pytest.raises(RecordError, match=f"no channel {wanted}"):
        pick(channels(*codes), wanted, "r", "y")


def test_a_number_of_two_meanings_is_refused():
    with pytest.raises(RecordError, match="the number of one and the azimuth of another"):
        pick(channels("280", "010", "002"), 2, "r", "y")
