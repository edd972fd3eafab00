"""Wrong configurations: each is refused with one message that names file and key, or right; never more."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from bounded import bounded
from config_cases import BASES, every_key, keys_of, models_of, mutated, write_files

import romdam
from romdam.config.sections.joint_laws import UserLaw
from romdam.pipelines.check import check
from romdam.pipelines.run import run
from romdam.pipelines.suites.run import SuiteOptions, run_suite
from romdam.results.sliding import UNDEFINED
from romdam.results.variables import UNDEFINED_MODES

SECONDS, BYTES = 30.0, 1e9  # before a refusal
WHOLE = 300.0  # seconds of what is right: a fine mesh among them, and suites with their workers
PLACED = re.compile(r"/configs\d+/\S|pulse|left")  # a file, in the tests' folder; a record; a block's mesh


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("configs")
    write_files(folder)
    return folder


def written(folder: Path, text: str) -> Path:
    path = folder / "case.yaml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    return path


def checked(path: Path) -> str:
    """As far as is cheap: keys, records, scene, reduction."""
    check(romdam.load_config(path))
    return "valid"


def finished(path: Path, out: Path) -> str:
    """The whole job; a result without a number is a failure too."""
    job = romdam.load_config(path)
    if job.config.pipeline == "suite":
        run_suite(job, out, SuiteOptions(workers=1))
        return "valid"
    for result in run(job, out).paths:
        with xr.open_dataset(result, engine="h5netcdf") as dataset:
            for name, variable in dataset.data_vars.items():
                if name == "construction_opening":  # of blocks that are there
                    variable = variable[-1]
                if (
                    variable.dtype.kind == "f"
                    and "stress" not in str(name)
                    and name not in (*UNDEFINED, *UNDEFINED_MODES)
                ):
                    assert np.isfinite(variable.values).all(), f"{name} is not finite"
    return "valid"


def test_every_model_stands_in_a_base():
    """A new model has to be put into a base of `config_cases`, or nothing would try its keys."""
    there = {model for raw in BASES.values() for _, model, _ in keys_of(raw)}
    assert models_of() - {UserLaw} == there, "UserLaw is made of `law`, and never written"
    assert len(every_key()) > 150


LONG = ("total", "suite", "waves", "gravity")


@pytest.mark.parametrize("base", [pytest.param(b, marks=[pytest.mark.slow] * (b in LONG)) for b in BASES])
def test_bases_run_through(folder, base):
    path = written(folder, yaml.safe_dump(BASES[base]))
    assert finished(path, folder / "out") == "valid"


def judge(outcome, number):
    """What is wrong with an outcome; empty where nothing is."""
    if outcome.crash:
        return f"case {number}: {outcome.crash[-700:]}"
    if outcome.value != "valid":
        message = outcome.refusal
        if not PLACED.search(message) or max(map(len, message.splitlines())) > 900:
            return f"case {number}: message {message[:300]!r}"
        if outcome.grown > BYTES or outcome.seconds > SECONDS:
            used = f"{outcome.grown / 1e6:.0f} MB and {outcome.seconds:.0f} s"
            return f"case {number}: {used} before it was refused: {message[:200]}"
    return ""


def test_mutated_configurations(folder, cases):
    count = cases(8, 2000)
    wrong, valid, largest, longest = [], 0, 0, 0.0
    for number in range(count):
        path = written(folder, mutated(number))
        whole = number % 20 == 7
        call = partial(finished, path, folder / "out") if whole else partial(checked, path)
        outcome = bounded(call, WHOLE)
        wrong += filter(None, [judge(outcome, number)])
        valid += outcome.value == "valid"
        largest, longest = max(largest, outcome.grown), max(longest, outcome.seconds)
    print(f"{count} cases: {valid} valid; {largest / 1e6:.0f} MB, {longest:.1f} s at most")
    assert not wrong, f"{len(wrong)} of {count}:\n" + "\n".join(wrong[:20])
