"""`romdam export` as a person meets it."""

import pytest
import yaml
from decks import boxes, pulse

from romdam.config.load import load_config
from romdam.core.errors import ConfigError
from romdam.export.codes import CODES
from romdam.pipelines.export import ExportOptions, export_deck


@pytest.fixture
def job(tmp_path):
    (tmp_path / "pulse.txt").write_text("\n".join(map(str, pulse(0.01)[1])))
    path = tmp_path / "job.yaml"
    path.write_text(yaml.safe_dump(boxes()))
    return load_config(path)


@pytest.mark.parametrize("code", CODES)
def test_every_code_gets_its_files(code, job, tmp_path):
    made = export_deck(job, tmp_path / code, ExportOptions(code, dt=0.001, duration=0.1))
    assert all(path.stat().st_size for path in made.paths)
    assert "100 steps of 1 ms" in made.said
    head = next(path for path in made.paths if path.stem == "deck").read_text()
    assert all(sentence.split()[0] in head for sentence in made.stated)


def test_step_and_duration_follow_the_job(job, tmp_path):
    made = export_deck(job, tmp_path / "own", ExportOptions("opensees"))
    assert "2400 steps of 0.25 ms, 0.6 s" in made.said


def test_unknown_record_is_told(job, tmp_path):
    with pytest.raises(ConfigError, match="records has no 'other'; it has pulse"):
        export_deck(job, tmp_path / "own", ExportOptions("opensees", record="other"))
