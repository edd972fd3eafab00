"""What people get wrong: one message with file, line, key, cause and remedy, exit code 2, no traceback."""

import pytest
from test_cli import call
from wrong_inputs import JOB, WRONG


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_told_with_file_line_cause_and_remedy(name, tmp_path, monkeypatch):
    wrong = WRONG[name]
    assert JOB.count(wrong.old) >= 1
    text = JOB.replace(wrong.old, wrong.new, 1)
    (tmp_path / "dam.yaml").write_text(text, encoding=wrong.encoding)
    (tmp_path / "pulse.txt").write_text(wrong.record)
    monkeypatch.chdir(tmp_path)
    code, _, err = call("check", "dam.yaml", "--no-cache")
    line = 1 + text[: text.index(wrong.line)].count("\n")
    assert code == 2 and "Traceback" not in err
    assert err.startswith(f"romdam: dam.yaml:{line}: "), err
    assert [words for words in wrong.words if words not in err] == [], err


def test_the_job_that_the_mistakes_are_made_in_is_right(tmp_path, monkeypatch):
    (tmp_path / "dam.yaml").write_text(JOB)
    (tmp_path / "pulse.txt").write_text(WRONG["no such axis"].record)
    monkeypatch.chdir(tmp_path)
    assert call("check", "dam.yaml", "--no-cache")[0] == 0
