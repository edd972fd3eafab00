"""Valid files with marks, dates, indices and other channels, and files that only look valid."""

import numpy as np
import pytest
from vintages import csmip_v1

from romdam.config.sections.motions.records import read_entry
from romdam.core.errors import RecordError
from romdam.records.channel import Channel, Orientation
from romdam.records.formats.registry import Declared, read_channels
from romdam.records.formats.smc import write_smc
from romdam.records.measures import peak_ground
from romdam.records.record_set import load_motions

DT = 0.01
TIME = np.arange(2000) * DT
ACC = 3.0 * np.exp(-(((TIME - 9.0) / 2.0) ** 2)) * np.cos(2 * np.pi * 2.3 * (TIME - 9.0))  # peak 3 m/s2
G = 9.80665


def load(folder, text, name="r.csv", **entry):
    (folder / name).write_text(text)
    return load_motions([read_entry({"file": name, "components": {"y": 1}} | entry, "entry")], folder)


def lines(form, *columns):
    return "\n".join(form.format(*row) for row in zip(*columns, strict=True)) + "\n"


CLOCK = [f"2020-01-01T00:00:{t:05.2f}" for t in TIME]
SOUND = {  # text, keys
    "filter poles in the header": (
        "PEER NGA STRONG MOTION DATABASE RECORD\nEvent, 1/1/2000, Station, 090\n"
        "ACCELERATION TIME SERIES IN UNITS OF G\n"
        "NPTS=   2000, DT=   .0100 SEC,   0 POLE @    13.90000 HZ,  -5 POLE @      .10000\n"
        + lines("{:.8e}", ACC / G),
        {},
    ),
    "acceleration in g": (
        "PEER NGA STRONG MOTION DATABASE RECORD\nEvent, 1/1/2000, Station, 090\nACCELERATION IN G\n"
        "NPTS= 2000, DT= 0.01000000 SEC\n" + lines("{:.8e}", ACC / G),
        {},
    ),
    "end mark": (lines("{:.8e}", ACC) + "*** End Data ***\n", {"dt": "0.01 s", "unit": "m/s2"}),
    "end mark of PEER's": (
        "PEER STRONG MOTION DATABASE RECORD\nEvent, 1/1/2000, Station, 090\n"
        "ACCELERATION TIME HISTORY IN UNITS OF G\n 2000  0.0100  NPTS, DT\n"
        + lines("{:.8e}", ACC / G)
        + "*** End Data ***\n",
        {},
    ),
    "dates": (
        "time,RelativeTime(s),acc (cm/s2)\n" + lines("{},{:.2f},{:.5f}", CLOCK, TIME, 100 * ACC),
        {"time_column": 2, "components": {"y": 3}},
    ),
    "dates and clock times by blanks": (
        "# acceleration in m/s2\n"
        + lines("{} {:.6f}", [word.replace("T", " ").replace("-", "/") for word in CLOCK], ACC),
        {"dt": "0.01 s", "components": {"y": 2}},
    ),
    "index of pandas": (
        ",time,acc (cm/s2)\n" + lines("{},{:.2f},{:.5f}", range(2000), TIME, 100 * ACC),
        {"time_column": 2, "components": {"y": 3}},
    ),
    "velocity beside": (
        "Time [s],Acceleration [g],Velocity [m/s]\n"
        + lines("{:.2f},{:.8f},{:.8f}", TIME, ACC / G, 0.1 * ACC),
        {"time_column": 1, "components": {"y": "each"}},
    ),
    "microseconds": (
        "timestamp (us),acc (m/s2)\n" + lines("{:.0f},{:.6f}", 1e6 * TIME, ACC),
        {"time_column": 1, "components": {"y": 2}},
    ),
    "time_us": (
        "time_us,acc_ms2\n" + lines("{:.0f},{:.6f}", 1e6 * TIME, ACC),
        {"time_column": 1, "components": {"y": 2}},
    ),
}


@pytest.mark.parametrize("name", SOUND)
def test_valid_files_are_read(tmp_path, name):
    text, keys = SOUND[name]
    (motion,) = load(tmp_path, text, "r.AT2" if text.startswith("PEER") else "r.csv", **keys)
    assert motion.dt == pytest.approx(DT, rel=1e-9)
    np.testing.assert_allclose(motion.acc[1], ACC, atol=2e-6)
    assert sum("dates or clock times" in text for text in motion.warnings) <= 1
    if name == "velocity beside":
        assert any("channel 3 is in m/s, no acceleration" in text for text in motion.warnings)


def test_size_of_the_vector_is_no_component(tmp_path):
    """A telephone's file: three components and their absolute value."""
    other = np.roll(ACC, 40), 0.5 * np.roll(ACC, -30)
    total = np.sqrt(ACC**2 + other[0] ** 2 + other[1] ** 2)
    text = "Time (s),X (m/s^2),Y (m/s^2),Z (m/s^2),Absolute acceleration (m/s^2)\n"
    text += lines("{:.2f},{:.6f},{:.6f},{:.6f},{:.6f}", TIME, ACC, *other, total)
    motions = load(tmp_path, text, time_column=1, components={"y": "each"})
    assert [motion.name for motion in motions] == ["r_2", "r_3", "r_4"]
    assert any("column 5 is the size of the other columns' vector" in text for text in motions[0].warnings)


@pytest.mark.parametrize("names", ["T (s),PSA (g)", "Period (s),Sa [g]", "Frequency (Hz),acc (g)"])
def test_spectra_are_no_motions(tmp_path, names):
    text = names + "\n" + lines("{:.2f},{:.6f}", TIME + DT, np.abs(ACC) / G)
    with pytest.raises(RecordError, match="is of a spectrum, no motion"):
        load(tmp_path, text, time_column=1, components={"y": 2})


def test_dates_are_no_time_column(tmp_path):
    with pytest.raises(RecordError, match="time_column is 1, which holds dates or clock times"):
        load(tmp_path, SOUND["dates"][0], time_column=1, components={"y": 3})


def test_channels_that_are_counted_from_0_have_no_azimuth(tmp_path):
    import obspy

    rows = (ACC, 2.0 / 3.0 * np.roll(ACC, 150), 0.5 * np.roll(ACC, 90))
    traces = [
        obspy.Trace(row.astype(np.float32), {"delta": DT, "station": "DAM", "channel": str(k)})
        for k, row in enumerate(rows)
    ]
    obspy.Stream(traces).write(str(tmp_path / "r.mseed"), "MSEED")
    entry = {"file": "r.mseed", "unit": "m/s2", "x_azimuth": "35 deg"}
    entry |= {"azimuths": {"0": "35 deg", "1": "125 deg", "2": "up"}}
    (motion,) = load_motions([read_entry(entry, "entry")], tmp_path)
    np.testing.assert_allclose(motion.acc, [rows[0], -rows[1], rows[2]], atol=1e-5)


@pytest.mark.parametrize(
    ("names", "where"),
    [
        ("NS(gal),EW(gal),UD(gal)", (0.0, 90.0, None)),
        ("UD (gal);EW (gal);NS (gal)", (None, 90.0, 0.0)),
        ("acc N-S (gal),acc E-W (gal),acc U-D (gal)", (0.0, 90.0, None)),
        ("HNE_gal,HNN_gal,HNZ_gal", (90.0, 0.0, None)),
    ],
)
def test_names_of_columns_tell_directions(tmp_path, names, where):
    mark = ";" if ";" in names else ","
    text = names + "\n" + lines(mark.join(["{:.4f}"] * 3), ACC, 2 * ACC, np.roll(ACC, 9))
    (tmp_path / "r.csv").write_text(text)
    channels = read_channels(tmp_path / "r.csv", Declared(dt=DT))
    expected = [Orientation(None, 1) if azimuth is None else Orientation(azimuth) for azimuth in where]
    assert [channel.orientation for channel in channels] == expected


def csmip(tmp_path, change):
    (tmp_path / "r.v1").write_text(change(csmip_v1(ACC[:600])))
    return read_channels(tmp_path / "r.v1")


def test_csmip_files_that_hold_every_channel_twice_are_read_once(tmp_path):
    channels = csmip(tmp_path, lambda text: text + text)
    assert [channel.code for channel in channels] == ["1", "2"]
    assert "2 of 4 channels are in the file twice: left out" in channels[0].warnings


@pytest.mark.parametrize("cut", ["Chan  2: U", "Chan  2:", "Chan  2: "])
def test_csmip_titles_that_are_cut_still_tell_up(tmp_path, cut):
    def change(text):
        title = next(line for line in text.splitlines() if line.startswith("Chan  2"))
        there = "Station, sensor direction Up" if cut.strip().endswith(":") else "Station"
        head, below = text.replace(title, cut).split(cut)
        return head + cut + below.replace("Record of Mon Feb 13, 2012", there, 1)

    first, second = csmip(tmp_path, change)
    assert (first.orientation, second.orientation) == (Orientation(90.0), Orientation(None, 1))


@pytest.mark.parametrize("precise", [False, True])
def test_smc_of_boores_programs(tmp_path, precise):
    """The first line may name no kind, comments may lack the bar, and few write header 47."""
    gal = np.round(100 * ACC, 3)
    write_smc(Channel("H1", gal, DT, "cm/s2"), tmp_path / "r.smc")
    written = (tmp_path / "r.smc").read_text().splitlines()
    written[0] = "0 UNKNOWN                 "
    integers = written[12]
    written[12] = integers[:70] + f"{2:10d}"  # header 16, the number of comments
    rows = written[27:]
    if precise:
        words = [f"{value:.7E}".replace("E+0", "E+").replace("E-0", "E-").rjust(14) for value in gal]
        rows = ["".join(words[i : i + 5]) for i in range(0, gal.size, 5)]
    text = "\n".join([*written[:27], "| made by a program", " at a high rate", *rows]) + "\n"
    (tmp_path / "r.smc").write_text(text)
    (channel,) = read_channels(tmp_path / "r.smc")
    np.testing.assert_allclose(channel.data, gal, atol=1e-4 if precise else 0.02)
    assert any("names no kind of series" in said for said in channel.warnings)


def test_three_components_below_each_other_are_refused_with_a_remedy(tmp_path):
    text = "# 2000 points\n" + lines("{:.6f}", np.concatenate([ACC, 0.7 * ACC, 0.3 * ACC]))
    with pytest.raises(RecordError, match="are 3 components one below another in it"):
        load(tmp_path, text, dt="0.01 s", unit="m/s2")


def test_peak_velocity_lies_between_samples():
    """Acceleration 3, -1 m/s2 at 0 and 0.1 s is zero at 0.075 s, where velocity is 0.1125 m/s."""
    assert peak_ground(np.array([1.0, -3.0]), 0.1)["pgv"] == pytest.approx(0.1, rel=1e-12)  # at the end
    assert peak_ground(np.array([3.0, -1.0]), 0.1)["pgv"] == pytest.approx(0.1125, rel=1e-12)
    assert peak_ground(np.array([1.0, -1.0]), 0.1)["pgv"] == pytest.approx(0.025, rel=1e-12)
