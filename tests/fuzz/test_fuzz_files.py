"""Files that romdam wrote and reads again, damaged or foreign: made again, refused, or read as they were.

Every case is named by its number; `pytest tests/fuzz/test_fuzz_files.py --fuzz` tries 2,300.
"""

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from bounded import bounded
from file_damage import damage_bytes, displace, put_back, rewrite
from test_cli import SMALL, call

from romdam import open_result
from romdam.core.errors import ResultError
from romdam.core.sealed import is_sealed, seal
from romdam.error.metrics import RelativeError
from romdam.error.statement import (
    FILES,
    ErrorStatement,
    read_verification,
    write_verification,
)
from romdam.postprocess.maxima import maxima
from romdam.reduction.storage.model_file import BlockStore
from romdam.results.model_info import model_lines
from romdam.results.stored_run import read_run
from romdam.terminal.lines import info_lines
from romdam.terminal.tables import peaks_table

SECONDS, GROWN = 30.0, 600e6  # that a case may take, and by which its memory may grow
STRESSED = "\n  stress: {faces: [{block: right, face: ymax}], nodes: {top: {block: right, at: [0, 0, 20]}}}\n"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A job's folder: result, basis and stress file, another model's, and the cache of both."""
    made = tmp_path_factory.mktemp("whole")
    time = np.arange(40) * 0.01
    np.savetxt(made / "pulse.txt", 5.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-4 * time))
    for name, modes in (("job", 10), ("other", 9)):
        text = SMALL.rstrip() + STRESSED
        (made / f"{name}.yaml").write_text(text.replace("modes: 10", f"modes: {modes}"))
        out = made / name
        code, _, err = call("run", made / f"{name}.yaml", "--out", out, "--cache", made / "cache", "--quiet")
        assert code == 0, err
    return made


@pytest.fixture
def job(whole, tmp_path):
    """A copy to be damaged."""
    shutil.copytree(whole, tmp_path / "job")
    return tmp_path / "job" / "job"


def content(path: Path) -> dict[str, bytes]:
    """Everything that a reader gets out of a result, as bytes; all that the commands do with it is tried."""
    found = {}
    with open_result(path) as result:
        for name, values in result.dataset.variables.items():
            array = np.asarray(values.values)
            found[str(name)] = (array.astype(str) if array.dtype.kind in "OT" else array).tobytes()
        for block in result.blocks:
            found[f"points {block}"] = result.points(block).tobytes()
            found[f"cells {block}"] = result.cells(block)[1].tobytes()
            found[f"displacement {block}"] = result.displacement(block).values.tobytes()
        found["stress"] = result.stress("right").values.tobytes()
        info_lines(result.dataset), peaks_table({"x": result.dataset}), maxima(result.dataset), repr(result)
    run = read_run(path)
    return found | {"run": run.jump.tobytes() + run.mean.tobytes() + run.q.tobytes() + run.strain.tobytes()}


def told(outcome, where):
    """A refusal is one message that names a file; nothing dies, waits or grows."""
    assert not outcome.crash, f"{where}: {outcome.crash}"
    assert outcome.seconds < SECONDS and outcome.grown < GROWN, f"{where}: {outcome}"
    assert not outcome.refusal or ".nc" in outcome.refusal or ".h5" in outcome.refusal, outcome.refusal


def files_of(job: Path) -> list[Path]:
    return [job / "pulse.nc", *sorted(job.glob("model-*.h5")), *sorted(job.glob("stress-*.h5"))]


def test_results_whose_bytes_or_place_changed_are_refused_or_read_as_they_were(job, whole, cases):
    expected = content(job / "pulse.nc")
    for case in range(cases(6, 900)):
        rng = np.random.default_rng([1, case])
        path = files_of(job)[int(rng.integers(3))]
        others = files_of(whole / "other") + files_of(whole / "job")
        change = displace(path, rng) if rng.random() < 0.1 else damage_bytes(path, others, rng)
        outcome = bounded(lambda: content(job / "pulse.nc"), SECONDS)
        where = f"case {case}: {path.name} {change}"
        told(outcome, where)
        foreign = "swapped" in change and path.suffix == ".nc"  # a whole result of another model is just that
        assert outcome.refusal or outcome.value == expected or foreign, f"{where}: read as something else"
        put_back(path, whole / "job" / path.name)


def test_results_that_another_program_changed_are_refused_or_read_as_they_were(job, whole, cases):
    expected = content(job / "pulse.nc")
    for case in range(cases(2, 500)):
        rng = np.random.default_rng([2, case])
        path = files_of(job)[int(rng.integers(3))]
        where = f"case {case}: {path.name} {rewrite(path, rng)}"
        outcome = bounded(lambda: content(job / "pulse.nc"), SECONDS)
        told(outcome, where)
        if not outcome.refusal:
            same = {name for name, values in outcome.value.items() if expected.get(name) == values}
            assert same == set(outcome.value), f"{where}: {set(outcome.value) - same} read as something else"
        put_back(path, whole / "job" / path.name)


def test_files_without_a_digest_that_are_damaged_bring_nothing_down(job, whole, cases):
    """Of version 0.1: numbers in them cannot be vouched for, but basis and stress are held to their names."""
    expected = content(job / "pulse.nc")
    for case in range(cases(1, 300)):
        rng = np.random.default_rng([3, case])
        path = files_of(job)[int(rng.integers(3))]
        with h5py.File(path, "r+"):
            pass  # which drops the digest
        where = f"case {case}: {path.name} {damage_bytes(path, [path], rng)}"
        outcome = bounded(lambda: content(job / "pulse.nc"), SECONDS + 30.0)
        assert not outcome.crash and outcome.grown < GROWN, f"{where}: {outcome}"
        held = path.suffix == ".nc" or outcome.refusal or outcome.value == expected
        assert held, f"{where}: read as something else"
        put_back(path, whole / "job" / path.name)


def test_caches_are_read_as_they_were_or_made_again(whole, tmp_path, cases):
    shutil.copytree(whole / "cache", tmp_path / "cache")
    store = BlockStore(tmp_path / "cache")
    blocks = sorted((tmp_path / "cache").glob("block-*.h5"))
    keys = {}
    for path in blocks:
        with h5py.File(path) as file:
            keys[path] = str(file.attrs["key"])
    known = {path: parts(store, keys[path]) for path in blocks}
    for case in range(cases(12, 600)):
        rng = np.random.default_rng([4, case])
        path = blocks[int(rng.integers(len(blocks)))]
        kind = rng.random()
        if kind < 0.1:
            change = displace(path, rng)
        elif kind < 0.4:
            change = rewrite(path, rng)
            if rng.random() < 0.5:
                seal(path)  # as if romdam itself had written this
                change += ", sealed"
        else:
            change = damage_bytes(path, blocks, rng)
        where = f"case {case}: {path.name} {change}"
        outcome = bounded(lambda path=path: parts(store, keys[path]), SECONDS)
        told(outcome, where)
        assert not outcome.refusal, f"{where}: {outcome.refusal}"
        held = outcome.value is None or outcome.value == known[path] or change.endswith("sealed")
        assert held, f"{where}: read as something else"
        outcome = bounded(lambda path=path: model_lines(path), SECONDS)
        told(outcome, f"{where}, told")
        put_back(path, whole / "cache" / path.name)


def parts(store: BlockStore, key: str) -> list[bytes] | None:
    found = store.read(key)
    return (
        None
        if found is None
        else [x.tobytes() for x in (found.vectors.rows(), found.omega2, found.participation)]
    )


def test_statements_that_changed_are_left_out(tmp_path, cases):
    content = {"scene_sha256": "scene", "record": "a", "record_sha256": "samples"}
    about = {"configuration_sha256": "abc", **content, "peak_error": 0.01, "cpu": [1, 2]}
    ours, other = ({"configuration_sha256": digest, **content} for digest in ("abc", "abd"))
    errors = {"opening": RelativeError(0.1, 0.01, {"gap": RelativeError(0.2, 0.02)})}
    statement = ErrorStatement("verification", "off by 1 %", errors, about)
    path = write_verification(tmp_path, statement)
    whole, expected = path.read_bytes(), read_verification(tmp_path, ours)
    assert (
        json.loads(str(expected["verification"])) == statement.document
        and read_verification(tmp_path, other) == {}
    )
    for case in range(cases(100, 1000)):
        damage_bytes(path, [path], np.random.default_rng([5, case]))
        found = read_verification(tmp_path, ours)
        assert found in ({}, expected), f"case {case}: {found}"
        path.write_bytes(whole)
    for foreign in ("null", "[]", '{"configuration_sha256": "abc"}', "[" * 100_000, '{"a": NaN}'):
        (tmp_path / FILES["verification"]).write_text(foreign)
        assert read_verification(tmp_path, ours) == {}


@pytest.mark.parametrize("size", [0, 7, 8, 9, 48, 51, 52, 79, 96])
def test_the_shortest_files_are_refused(tmp_path, size):
    path = tmp_path / "a.h5"
    path.write_bytes((b"\x89HDF\r\n\x1a\n" + bytes(99))[:size])
    with pytest.raises(ResultError, match=r"a\.h5: is "):
        is_sealed(path)


def test_a_swapped_basis_or_one_of_another_version_is_named(job, whole):
    model = next(job.glob("model-*.h5"))
    shutil.copyfile(next((whole / "other").glob("model-*.h5")), model)
    with open_result(job / "pulse.nc") as result, pytest.raises(ResultError, match="holds another model"):
        result.displacement("left")
    put_back(model, whole / "job" / model.name)
    with h5py.File(model, "r+") as file:
        file.attrs["format"] = "romdam-model-9"
    seal(model)
    with open_result(job / "pulse.nc") as result, pytest.raises(ResultError, match="format 'romdam-model-9'"):
        result.displacement("left")
