"""The main job's record, from the configuration to SI."""

from pathlib import Path

import numpy as np
import pytest

from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RecordError
from romdam.records.processing.resampling import resample
from romdam.records.record_set import load_motions

DATA = Path(__file__).parents[2] / "data" / "records"
RECORD = {
    "file": "northridge_mul009_g_dt0.01.txt",
    "unit": "9.81 m/s2",
    "dt": "0.01 s",
    "components": {"y": 1},
}


def load(folder=DATA, **changes):
    return load_motions((RecordConfig.model_validate(RECORD | changes),), folder)[0]


def test_record_is_in_si_on_its_axis():
    motion = load()
    raw = np.loadtxt(DATA / str(RECORD["file"]))
    assert motion.acc.shape == (3, 2999)
    np.testing.assert_allclose(motion.acc[1], 9.81 * raw, rtol=1e-15)
    assert not motion.acc[[0, 2]].any()
    assert np.abs(motion.acc).max() == pytest.approx(0.415783 * 9.81)  # printed maximum of the file, in g


def test_unit_g_is_standard_gravity():
    assert np.abs(load(unit="g").acc).max() == pytest.approx(0.415783 * 9.80665)


def test_linear_resampling_keeps_the_straight_lines():
    acc = np.array([0.0, 1.0, -1.0, 4.0])
    np.testing.assert_allclose(
        resample(acc, 0.01, 0.0025, "linear"),
        [0, 0.25, 0.5, 0.75, 1, 0.5, 0, -0.5, -1, 0.25, 1.5, 2.75, 4],
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: the file is empty"),
        ("1\n2\n", "2 samples"),
        ("# made by hand\n1\n", "1 samples, at least 3"),
        ("1\nnan\n3\n", "not finite, the first at t = 0.01 s"),
        ("1\n2\nx\n", "line 3"),
        ("1\n2 3\n", "line 2"),
    ],
)
def test_bad_plain_text_names_the_file_and_the_place(tmp_path, text, message):
    (tmp_path / "bad.txt").write_text(text)
    with pytest.raises(RecordError, match=message) as error:
        load(tmp_path, file="bad.txt")
    assert "bad.txt" in str(error.value)


def test_missing_file_is_named():
    with pytest.raises(RecordError, match=r"nothing\.txt"):
        load(file="nothing.txt")
