"""Progress of a suite: runs done of all, also within a batch, in a terminal and in a plain log."""

import io
import re
import time
from contextlib import contextmanager

import numpy as np
import pytest
import yaml
from rich.console import Console
from suite_jobs import write_job
from test_cli import SMALL

import romdam
from romdam import terminal
from romdam.core.counted import Counted
from romdam.pipelines.suites import progress as progress_module
from romdam.pipelines.suites.progress import STEPS, Note, of_parts, watched
from romdam.pipelines.suites.run import SuiteOptions, run_suite


class Recorder:
    """Shows stages, and keeps what each is told."""

    def __init__(self):
        self.told = {}

    def __call__(self, text):
        return self._Stage(self.told.setdefault(text, []))

    class _Stage:
        def __init__(self, told):
            self._told = told

        def __enter__(self):
            return lambda done, total: self._told.append((done, total))

        def __exit__(self, *_):
            return None


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_batch_tells_how_far_it_is_before_it_ends(workers, tmp_path, monkeypatch):
    """Four runs in one batch: without a word from within there would be one, at the end."""
    monkeypatch.setattr(progress_module, "_EVERY", 0.02)
    time_axis = 0.01 * np.arange(3000)
    np.savetxt(tmp_path / "pulse.txt", np.sin(9.0 * time_axis) * np.sin(np.pi * time_axis / 30.0) ** 2)
    job = yaml.safe_load(SMALL) | {"pipeline": "suite", "suite": {"scales": [1, 2, 3, 4], "batch": 4}}
    path = tmp_path / "suite.yaml"
    path.write_text(yaml.safe_dump(job))
    shown = Recorder()
    run_suite(path, tmp_path / "o", SuiteOptions(workers=workers), shown)
    told = shown.told["4 runs"]
    done = [number for number, _ in told]
    assert {total for _, total in told} == {4 * STEPS}
    assert done == sorted(done) and done[-1] == 4 * STEPS
    if workers == 1:  # a worker process has the interval of the module, a second
        assert any(0 < number < 4 * STEPS for number in done)  # how many depends on the machine
    assert not [*(tmp_path / "o").glob(".romdam-*.part")]  # the notes are gone


def test_notes_of_several_tasks_add_up(tmp_path, monkeypatch):
    monkeypatch.setattr(progress_module, "_EVERY", 0.01)
    told = []
    with watched(tmp_path, 10, lambda done, total: told.append((done, total))) as end_task:
        Note(tmp_path, "a", 4).report_stage(0.0, 0.5)(1, 2)  # a quarter of four runs
        Note(tmp_path, "b", 6).report_stage(0.5, 1.0)(1, 3)  # two thirds of six
        (tmp_path / "c").write_text("half writ")
        time.sleep(0.1)
        end_task(4, "a")
    assert (5 * STEPS, 10 * STEPS) in told and told[-1] == (8 * STEPS, 10 * STEPS)


def test_a_plain_log_says_runs_done_of_all_and_the_time_left(monkeypatch):
    monkeypatch.setattr(terminal, "EVERY", 0.05)
    out = io.StringIO()
    stages = terminal.Stages(Console(file=out, width=200), quiet=False)
    with stages(Counted(7, "runs")) as progress:
        progress(3500, 7000)
        time.sleep(0.2)
    assert re.search(r"\n\S+ \S+ 3 of 7 runs: 50 %, 0:00:00 elapsed, 0:00:00 left\n", "\n" + out.getvalue())


def test_a_terminal_says_runs_done_of_all_and_the_time_left(monkeypatch):
    monkeypatch.setattr(terminal, "DELAY", 0.0)
    out = io.StringIO()
    stages = terminal.Stages(Console(file=out, width=100, force_terminal=True), quiet=False)
    with stages(Counted(7, "runs")) as progress:
        progress(6999, 7000)
        time.sleep(0.3)
    assert "6 of 7 runs" in out.getvalue() and "left" in out.getvalue()


def test_parts_of_a_stage_are_one_progress():
    told = []
    tell = of_parts(lambda *shares: told.append(shares), 3)
    for done, total in ((1, 4), (4, 4), (1, 2), (2, 2), (0, 10), (10, 10), (1, 10)):
        tell(done, total)
    assert told == [(n, 3 * STEPS) for n in (250, 1000, 1500, 2000, 2000, 3000, 3000)]


def test_the_statement_of_the_mesh_before_a_suite_has_one_progress(tmp_path):
    """Two scales on two meshes: four runs, from none to all, before the runs of the suite."""
    shown = {}

    @contextmanager
    def show(text):
        yield lambda *of: shown.setdefault(str(text), []).append(of)

    box = {"origin": [0, -4, 0], "size": [4, 4, 16], "element_size": "2 m"}
    blocks = {
        "left": {"material": "concrete", "box": box},
        "right": {"material": "concrete", "box": box | {"origin": [0, 0, 0]}},
    }
    config = write_job(tmp_path, records=1, suite={"scales": [0.5, 1.0]}, blocks=blocks,
                       outputs={"output_interval": "0.02 s", "error_estimate": False})  # fmt: skip
    run_suite(romdam.load_config(config), tmp_path / "out", SuiteOptions(workers=1), show)
    names = list(shown)
    (stage,) = [name for name in names if name.startswith("stating the error of the mesh")]
    assert names.index(stage) < names.index("2 runs")
    shares = [done / total for done, total in shown[stage]]
    assert shares == sorted(shares) and shares[0] < 0.26 and shares[-1] == 1.0
    assert {total for _, total in shown[stage]} == {4 * STEPS}
