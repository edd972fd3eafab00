"""The files of K-NET and KiK-net, one for each component, as one record; boreholes apart from the surface."""

import logging

import numpy as np
import pytest

from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RecordError
from romdam.records.record_set import load_motions

NUMBERS = {"EW1": 5, "NS1": 4, "UD1": 6, "EW2": 2, "NS2": 1, "UD2": 3}
GAL = 3920.0 / 6182761.0


def write(folder, name, suffix, seed):
    """One component after NIED's description of the format; KiK-net numbers its directions."""
    counts = np.round(np.random.default_rng(seed).normal(size=1000) * 1e5).astype(int)
    peak = np.abs(GAL * (counts - counts.mean())).max()
    direction = {"EW1": "5", "NS1": "4", "UD1": "6", "EW2": "2", "NS2": "1", "UD2": "3"}.get(suffix)
    direction = direction or {"EW": "E-W", "NS": "N-S", "UD": "U-D"}[suffix]
    head = {
        "Origin Time": "2011/03/11 14:46:00", "Lat.": "38.103", "Long.": "142.860", "Depth. (km)": "24",
        "Mag.": "9.0", "Station Code": "IBRH11", "Station Lat.": "36.370", "Station Long.": "140.140",
        "Station Height(m)": "67", "Record Time": "2011/03/11 14:46:51", "Sampling Freq(Hz)": "100Hz",
        "Duration Time(s)": "10", "Dir.": direction, "Scale Factor": "3920(gal)/6182761",
        "Max. Acc. (gal)": f"{peak:.3f}", "Last Correction": "2011/03/11 14:46:51", "Memo.": "",
    }  # fmt: skip
    lines = [f"{key:<18}{value}" for key, value in head.items()]
    lines += [" ".join(f"{c:8d}" for c in counts[i : i + 8]) for i in range(0, counts.size, 8)]
    (folder / f"{name}.{suffix}").write_text("\n".join(lines) + "\n")
    return 0.01 * GAL * counts


def load(folder, **entry):
    return load_motions([RecordConfig.model_validate({"x_azimuth": 90} | entry)], folder)


@pytest.fixture
def knet(tmp_path):
    return {
        suffix: write(tmp_path, "IBR0031103111446", suffix, n) for n, suffix in enumerate(("EW", "NS", "UD"))
    }


@pytest.mark.parametrize("file", ["IBR0031103111446.NS", "IBR0031103111446.UD", "IBR0031103111446"])
def test_any_of_three_files_or_the_stem_is_the_record(tmp_path, knet, file):
    (motion,) = load(tmp_path, file=file)
    assert motion.name == "IBR0031103111446"
    np.testing.assert_allclose(motion.acc, [knet["EW"], knet["NS"], knet["UD"]], rtol=1e-12)
    assert set(motion.provenance["files"]) == {f"IBR0031103111446.{s}" for s in ("EW", "NS", "UD")}


def test_a_folder_has_one_record_for_three_files(tmp_path, knet):
    (motion,) = load(tmp_path, files=".")
    np.testing.assert_allclose(motion.acc[2], knet["UD"])


def test_the_named_file_is_the_first_channel(tmp_path, knet):
    """Entries that name one file and take its only column mean what they meant."""
    (motion,) = load_motions(
        [RecordConfig.model_validate({"file": "IBR0031103111446.NS", "components": {"y": 1}})], tmp_path
    )
    np.testing.assert_allclose(motion.acc[1], knet["NS"])
    assert not motion.acc[0].any()


def test_borehole_and_surface_are_never_one_record(tmp_path, caplog):
    every = {suffix: write(tmp_path, "IBRH111103111446", suffix, n) for n, suffix in enumerate(NUMBERS)}
    with caplog.at_level(logging.WARNING):
        hole, surface = load(tmp_path, files=".")
    assert (hole.name, surface.name) == ("IBRH111103111446_borehole", "IBRH111103111446_surface")
    np.testing.assert_allclose(hole.acc, [every["EW1"], every["NS1"], every["UD1"]])
    np.testing.assert_allclose(surface.acc, [every["EW2"], every["NS2"], every["UD2"]])
    assert "records of boreholes" in caplog.text and "*.EW2" in caplog.text
    (one,) = load(tmp_path, file="IBRH111103111446.UD2")
    np.testing.assert_array_equal(one.acc, surface.acc)
    with pytest.raises(RecordError, match=r"borehole and of the surface; name a file of one, .*\.EW1 or"):
        load(tmp_path, file="IBRH111103111446")
    (alone,) = load(tmp_path, files="*.??2")
    assert alone.name == surface.name


def test_a_missing_component_is_said(tmp_path, knet):
    (tmp_path / "IBR0031103111446.UD").unlink()
    (motion,) = load(tmp_path, files=".")
    assert not motion.acc[2].any()
    assert any("IBR0031103111446.UD is not there" in text for text in motion.warnings)
