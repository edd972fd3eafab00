"""What is kept is of the code that computed it: a version stands for many."""

import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import xarray as xr
import yaml

import romdam
from romdam.core import fingerprint
from romdam.core.fingerprint import code_digest
from romdam.pipelines.suites import plan
from romdam.results.suite import rows
from romdam.results.suite.journal import JOURNAL

sys.path.append(str(Path(__file__).parent / "suite"))

from suite_jobs import command, made, write_job

DAMPED = "return 2.0 * ratio * np.sqrt(omega2)"


@pytest.fixture
def package(tmp_path):
    """A package of two rooms, of which one shows only."""
    for room in ("fem", "visual"):
        (tmp_path / room).mkdir()
        (tmp_path / room / "one.py").write_text("a = 1")
    return tmp_path


def digest_after_start(package, monkeypatch, *modules):
    """Digest in a process that started with the code as it is now."""
    monkeypatch.setattr(fingerprint, "_CODE", fingerprint._texts(package))
    return code_digest.__wrapped__(*modules)


def test_the_code_counts_to_the_byte(package, monkeypatch):
    found = []
    for text in ("a = 1", "a = 2", "a = 1"):
        (package / "fem" / "one.py").write_text(text)
        found.append(digest_after_start(package, monkeypatch))
    assert found[0] == found[2] != found[1]
    (package / "visual" / "one.py").write_text("a = 2")
    assert digest_after_start(package, monkeypatch) == found[0]
    assert digest_after_start(package, monkeypatch, "romdam.fem.one") != found[0]


def test_every_room_that_computes_counts():
    package = Path(romdam.__file__).parent
    rooms = {path.parent.name for path in package.glob("*/__init__.py")}
    counted = {name.split(".")[1] for name in fingerprint._CODE if fingerprint._computes(name)}
    assert rooms - counted == {"benchmarks", "commands", "examples", "export", "terminal", "visual"}
    assert {"contact", "fem", "pipelines", "reduction", "timestepping"} <= counted


def test_code_that_is_edited_meanwhile_does_not_count(package, monkeypatch):
    before = digest_after_start(package, monkeypatch)
    (package / "fem" / "one.py").write_text("a = 12")
    assert code_digest.__wrapped__() == before


def test_rows_of_other_code_do_not_count_and_that_is_said(tmp_path, monkeypatch, caplog):
    config = write_job(tmp_path, records=1)
    made(config, tmp_path / "out")
    for module in (plan, rows):
        monkeypatch.setattr(module, "code_digest", lambda: "of other code")
    assert made(config, tmp_path / "out").made == 1
    (said,) = [text for text in caplog.messages if JOURNAL in text]
    assert f"1 rows are of romdam {romdam.__version__}, code {code_digest()[:12]}" in said
    assert f"this is romdam {romdam.__version__}, code of other cod" in said and "made again" in said
    caplog.clear()
    assert made(config, tmp_path / "out").made == 0 and "made again" not in caplog.text


@pytest.mark.slow
def test_a_suite_is_run_again_by_code_of_the_same_version(tmp_path):
    """Modal damping of 2 % that the code takes times eight, in the folder of before, is one of 16 %."""
    suite = {"keep": "full", "scales": [1.0]}
    config = write_job(tmp_path, records=1, suite=suite, damping={"modal": "2 %"})

    def peak(out: str, path: str = "") -> tuple[float, str]:
        environment = os.environ | {"PYTHONPATH": path, "XDG_CACHE_HOME": str(tmp_path / "cache")}
        words = [*command(config, tmp_path / out, "--workers", 1)[:-1]]
        done = subprocess.run(words, env=environment, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        with xr.open_dataset(tmp_path / out / "summary.nc", engine="h5netcdf") as summary:
            return float(summary.peak_displacement.max()), " ".join(done.stderr.split())

    before, _ = peak("out")
    edited_code = tmp_path / "code"
    shutil.copytree(romdam.__path__[0], edited_code / "romdam")
    pipelines = import_module("romdam.pipelines").__path__[0]
    shutil.copytree(pipelines, edited_code / "romdam" / "pipelines", dirs_exist_ok=True)
    damping = edited_code / "romdam" / "fem" / "damping.py"
    assert DAMPED in damping.read_text()
    damping.write_text(damping.read_text().replace(DAMPED, DAMPED.replace("2.0", "16.0")))
    after, said = peak("out", str(edited_code))
    again, nothing = peak("out", str(edited_code))
    raw = yaml.safe_load(config.read_text())
    config.write_text(yaml.safe_dump(raw | {"damping": {"modal": "16 %"}}))
    right, _ = peak("other")
    assert after == pytest.approx(right, rel=1e-9) and again == after
    assert abs(before / right - 1.0) > 0.05
    assert "1 rows are of romdam" in said and "made again" in said and said.count(", code ") >= 2
    assert "made again" not in nothing
    assert len(list((tmp_path / "out" / "runs").glob("*.nc"))) == 2  # until `romdam clean` removes the former
