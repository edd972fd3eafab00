"""Files of older and other agencies: each gives the motion it was written from, to its printed digits."""

import numpy as np
import obspy
import pytest
import samples
import vintages
from test_record_suites import at2
from test_record_trust import peer

from romdam.config.sections.motions.records import RecordConfig, unit_in_si
from romdam.core.errors import RecordError
from romdam.records.channel import NoAccelerationError, Orientation
from romdam.records.formats.registry import read_channels
from romdam.records.listing import list_records
from romdam.records.processing.align import delay
from romdam.records.record_set import load_motions

ACC = samples.motion()
TIMES = samples.DT * np.arange(ACC.size)
UP = Orientation(None, 1)


def read(folder, text):
    path = folder / "record.txt"
    path.write_text(text, encoding="latin-1")
    return read_channels(path)


def si(channel):
    return channel.data * unit_in_si(channel.unit)


def test_csmip_v1(tmp_path):
    first, second = read(tmp_path, vintages.csmip_v1(ACC))
    np.testing.assert_allclose(si(first), ACC, atol=0.5001e-6 * vintages.G)
    np.testing.assert_allclose(si(second), 0.5 * ACC, atol=0.5001e-6 * vintages.G)
    assert [c.orientation for c in (first, second)] == [Orientation(90.0), UP]
    assert (first.dt, first.meta["level"], first.meta["processed"]) == (samples.DT, "V1", False)


def test_a_csmip_file_cut_within_an_end_mark_is_refused(tmp_path):
    """What is left is a whole file of one channel, but for the rest of the mark."""
    whole = vintages.csmip_v1(ACC)
    mark = whole.index("End of Data for Channel  1")
    for length in (len("End of Data for Channel "), len("End of Data for Channel  1  ---")):
        with pytest.raises(RecordError, match="the end of the last channel is missing"):
            read(tmp_path, whole[: mark + length])


def test_csmip_v1_of_film_with_even_times_is_read_as_it_stands(tmp_path):
    first, second = read(tmp_path, vintages.csmip_pairs(TIMES, ACC))
    np.testing.assert_allclose(si(first), ACC, atol=0.5001e-4 * vintages.G)  # three decimals of g/10
    assert (first.dt, second.orientation, first.warnings) == (pytest.approx(samples.DT), UP, ())


def test_film_with_uneven_times_is_read_by_straight_lines(tmp_path):
    """A straight line stays one, whatever the times; the interval is at most the mean step."""
    steps = np.random.default_rng(3).uniform(0.003, 0.007, 400)
    times = np.round(np.cumsum(np.append(0.0, steps)), 3)
    line = 2.0 * times - 1.5
    (first, _) = read(tmp_path, vintages.csmip_pairs(times, line))
    assert first.dt == 0.005
    np.testing.assert_allclose(si(first), 2.0 * first.dt * np.arange(first.data.size) - 1.5, atol=1e-3)
    assert "the times are uneven" in first.warnings[0]
    (channel,) = read(tmp_path, vintages.smc_uneven(0.3 * times, line))
    assert channel.dt == 0.00125 and channel.orientation == Orientation(45.0)
    on_grid = 2.0 * channel.dt * np.arange(channel.data.size) / 0.3 - 1.5
    np.testing.assert_allclose(si(channel), on_grid, atol=5e-3)
    assert [
        said for said in channel.warnings if "behind the 802 values that are announced, is left out" in said
    ]
    fallen = vintages.csmip_pairs(np.where(np.arange(times.size) == 200, 0.5, times), line)
    with pytest.raises(RecordError, match=r"the times fall from .* to 0\.5 s; the file is damaged"):
        read(tmp_path, fallen)


@pytest.mark.parametrize("corrected", [False, True])
def test_geonet(tmp_path, corrected):
    channels = read(tmp_path, vintages.geonet(ACC, corrected))
    for channel, factor in zip(channels, (1.0, 0.5, 0.25), strict=True):
        np.testing.assert_allclose(si(channel), factor * ACC, atol=0.5001e-4)  # a tenth of mm/s2
    assert [c.orientation for c in channels] == [Orientation(332.0), Orientation(242.0), UP]
    assert channels[0].start == "2016-11-13T11:02:19.715000" and channels[0].dt == samples.DT
    assert channels[0].meta["level"] == ("V2A" if corrected else "V1A")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("Acceleration:  Peak", "Acceleration:  Peak 9000.0 mm/s/s at 1 s", "a peak of .* is stated"),
        ("Component S62W", "Component S30W", "component S30W is stated, the integer header says 242"),
        (
            "intervals of 0.005",
            "intervals of 0.010",
            "an interval of 0.010 s is stated, 0.005 s in the real header",
        ),
        (
            "     603       0       0     603",
            "     603       0       0     602",
            "603 points are stated, the integer header says 602|expected 2 numbers",
        ),
    ],
)
def test_geonet_that_contradicts_itself(tmp_path, old, new, message):
    text = vintages.geonet(ACC)
    assert old in text
    with pytest.raises(RecordError, match=message):
        read(tmp_path, text.replace(old, new, 1))


@pytest.mark.parametrize(("keys", "code"), [(64, "HNE"), (55, "HNE"), (43, "WE")])
def test_dyna_of_three_vintages(tmp_path, keys, code):
    (channel,) = read(tmp_path, vintages.dyna(ACC, keys))
    np.testing.assert_allclose(si(channel), ACC, atol=0.5001e-8)
    assert (channel.code, channel.orientation) == (code, Orientation(90.0))


def test_cosmos_counts(tmp_path):
    (channel,) = read(tmp_path, vintages.cosmos_v0(1e4 * ACC))
    np.testing.assert_array_equal(channel.data, np.round(1e4 * ACC))
    assert (channel.unit, channel.meta["level"]) == ("", "V1")
    entry = {"file": "record.txt", "components": {"y": 1}, "unit": "1e-4 m/s2"}
    (motion,) = load_motions([RecordConfig.model_validate(entry)], tmp_path)
    np.testing.assert_allclose(motion.acc[1], ACC, atol=0.5001e-4)


PROSE = "Data for El Centro\n603 points of 8F10.5\n{}The units are (g)\nNPTS=  603, DT= .00500 SEC\n"


@pytest.mark.parametrize("prose", ["", "a row with 5 decimal places\n*** Begin data ***\n"])
def test_at2_below_other_headers(tmp_path, prose):
    lines = "\n".join(peer("").split("\n")[4:])
    (channel,) = read(tmp_path, PROSE.format(prose) + lines)
    np.testing.assert_allclose(si(channel), ACC, atol=1e-6)
    assert (channel.unit, channel.dt, channel.orientation) == ("g", 0.005, None)


def test_at2_with_zeros_behind_it(tmp_path):
    text = peer("NPTS=   603, DT= .0050 SEC").rstrip("\n") + "  0.0000000E+00  0.0000000E+00\n"
    (channel,) = read(tmp_path, text)
    np.testing.assert_allclose(si(channel), ACC, atol=1e-6)
    assert channel.warnings == ("2 zeros behind the 603 values that the header announces are cut off",)
    with pytest.raises(RecordError, match="announces NPTS = 603, the file holds 605"):
        read(tmp_path, text.replace("0.0000000E+00\n", "1.0000000E-02\n"))


def test_a_fraction_of_a_step_is_interpolated(tmp_path):
    """A sine of an eighth of the sampling rate, 0.3 of a step later, is that sine at the other's times."""
    count = np.arange(400)
    moved = delay(np.sin(0.25 * np.pi * (count + 0.3)), 0.3)
    np.testing.assert_allclose(moved[20:-20], np.sin(0.25 * np.pi * count)[20:-20], atol=1e-4)
    traces = [
        obspy.Trace(np.sin(0.25 * np.pi * (count + lag)), {"delta": 0.01, "channel": code})
        for code, lag in (("HNN", 0.0), ("HNE", 0.3))
    ]
    traces[1].stats.starttime += 0.003
    obspy.Stream(traces).write(str(tmp_path / "r.mseed"), "MSEED")
    entry = {"file": "r.mseed", "unit": "m/s2", "x_azimuth": 90}
    (motion,) = load_motions([RecordConfig.model_validate(entry)], tmp_path)
    np.testing.assert_allclose(motion.acc[0, 20:-20], motion.acc[1, 20:-20], atol=1e-4)
    assert "channel HNE starts 0.3 of a step off the others' samples: interpolated there" in motion.warnings


def test_segments_are_joined_and_their_gap_is_filled_as_declared(tmp_path):
    whole = obspy.Trace(ACC.copy(), {"delta": samples.DT, "channel": "HNE"})
    start = whole.stats.starttime
    parts = [whole.slice(start, start + 1.0), whole.slice(start + 1.05, start + 3.01)]
    obspy.Stream(parts).write(str(tmp_path / "r.mseed"), "MSEED")
    entry = {"file": "r.mseed", "unit": "m/s2", "components": {"y": 1}}
    with pytest.raises(RecordError, match=r"9 of 603 samples are not finite, the first at t = 1\.005 s"):
        load_motions([RecordConfig.model_validate(entry)], tmp_path)
    (motion,) = load_motions([RecordConfig.model_validate(entry | {"gaps": "linear"})], tmp_path)
    right = ACC.copy()
    right[201:210] = np.interp(np.arange(201, 210), [200, 210], ACC[[200, 210]])
    np.testing.assert_allclose(motion.acc[1], right, atol=1e-12)
    assert any("2 segments are joined, 9 samples are missing" in said for said in motion.warnings)


@pytest.mark.parametrize(
    ("head", "name", "remedy"),
    [
        (
            "Response and Fourier amplitude spectra (78 periods,  .04 -  6.0 sec)",
            "CSMIP V3",
            "take the corrected",
        ),
        ("*****\nUNAM\nARCHIVO ESTANDAR DE ACELERACION:", "UNAM", "`unit: cm/s2`"),
        ("* VOL1DS FILE:  5520/01", "BHRC", "`layout: series`"),
        (
            "FILE     0 OF UNCORRECTED ACCELEROGRAM DATA OF VOLUME I:",
            "USC or CIT",
            "take the same record from",
        ),
        ("Dear reader,", "not a record of any known format", "romdam reads PEER AT2, COSMOS"),
    ],
)
def test_what_is_not_read_is_named_with_a_remedy(tmp_path, head, name, remedy):
    with pytest.raises(NoAccelerationError) as error:
        read(tmp_path, head + "\nmore text\n" * 20)
    assert name in str(error.value) and remedy in str(error.value)


def test_a_folder_of_peer_has_three_components(tmp_path):
    for seed, name in enumerate(("090", "000", "UP"), start=1):
        at2(tmp_path, f"RSN1_DAM{name}.AT2", seed)
        path = tmp_path / f"RSN1_DAM{name}.AT2"
        path.write_text(path.read_text().replace(", 090", f", {name}"))
        for suffix, what in (("VT2", "VELOCITY"), ("DT2", "DISPLACEMENT")):
            path.with_suffix(f".{suffix}").write_text(path.read_text().replace("ACCELERATION", what))
    (tmp_path / "_readME.txt").write_text("These records are from PEER.\n")
    (tmp_path / "notes.txt").write_text("Remarks.\n")
    (tmp_path / "_SearchResults.csv").write_text("PEER NGA\n")
    entry = {"files": ".", "group": "station", "x_azimuth": 90}
    (motion,) = load_motions([RecordConfig.model_validate(entry)], tmp_path)
    np.testing.assert_allclose(motion.acc, [samples.motion(seed) for seed in (1, 2, 3)], atol=1e-6)
    assert any("no record of acceleration, left out: notes.txt" in said for said in motion.warnings)


def test_the_command_lists_the_record_of_a_file_as_a_job_reads_it(tmp_path):
    from test_knet_three_files import write

    right = {suffix: write(tmp_path, "IBR003", suffix, n) for n, suffix in enumerate(("EW", "NS", "UD"))}
    files = [str(tmp_path / f"IBR003.{suffix}") for suffix in right]
    for sources in (files[:1], files, [str(tmp_path / "IBR003")]):
        (listed,) = list_records(sources, {"x_azimuth": 90})
        assert not any("is not there" in said for said in listed.motion.warnings)
        np.testing.assert_allclose(listed.motion.acc, list(right.values()))
