"""Writers beside each other: of one process and of several, living and killed."""

import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from test_cli import SMALL

import romdam
from romdam.core.errors import ResultError, WriteError
from romdam.core.files import hold, prepare_folder, replacing, sweep_parts
from romdam.core.sealed import is_sealed
from romdam.reduction.storage import out_of_core_matrix
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix

WRITER = """
import sys, time
from pathlib import Path
from romdam.core.files import replacing
with replacing(Path(sys.argv[1])) as part:
    part.write_text("whole")
    print("writing", flush=True)
    sys.stdin.readline()
"""


@pytest.fixture
def writer(tmp_path):
    """A process that is writing `a`, until it is told to end."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path / "a")],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "writing\n"
    yield process
    process.kill()
    process.wait()
    process.stdin.close(), process.stdout.close()


def test_threads_write_the_same_file_whole(tmp_path):
    def write(k):
        with replacing(tmp_path / "a") as part:
            part.write_text(f"{k}" * 1000)
            time.sleep(0.01)

    with ThreadPoolExecutor(8) as threads:
        list(threads.map(write, range(40)))
    assert (tmp_path / "a").read_text() in {f"{k}" * 1000 for k in range(40)}
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_what_a_living_process_writes_is_not_swept(tmp_path, writer):
    sweep_parts(prepare_folder(tmp_path))
    assert len(list(tmp_path.iterdir())) == 1
    writer.communicate("\n")
    assert writer.returncode == 0 and (tmp_path / "a").read_text() == "whole"


def test_what_a_killed_process_left_is_swept(tmp_path, writer):
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    (tmp_path / ".b.nc.123.part").write_text("as romdam 0.1 named them")
    (tmp_path / "notes.part").write_text("someone else's")
    assert len(list(tmp_path.iterdir())) == 3
    prepare_folder(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.part"]


def test_planted_names_are_not_written_to(tmp_path):
    """Names that were used before, and any that can be foreseen, as links to a file that must not change."""
    target = tmp_path / "precious"
    target.write_text("kept")
    out = tmp_path / "out"
    out.mkdir()
    for name in (f".a.{os.getpid()}.part", ".a.part", ".romdam-.part"):
        (out / name).symlink_to(target)
    (out / "a").symlink_to(target)
    with replacing(out / "a") as part:
        assert stat.S_IMODE(part.parent.stat().st_mode) == 0o700
        part.write_text("new")
    assert target.read_text() == "kept" and not (out / "a").is_symlink()
    sweep_parts(out)
    assert target.read_text() == "kept"


def test_files_have_the_mode_that_the_mask_says(tmp_path):
    before = os.umask(0o027)
    try:
        with replacing(tmp_path / "a") as part:
            part.write_text("x")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640


def test_a_name_as_long_as_names_can_be_is_written(tmp_path):
    name = "r" * 250 + ".nc"
    with replacing(tmp_path / name) as part:
        part.write_text("x")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_device_is_not_replaced_by_a_file(tmp_path):
    """It once was, by `romdam schema --out /dev/null`."""
    device = tmp_path / "null"
    try:
        os.mknod(device, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    except (AttributeError, OSError):
        pytest.skip("needs the right to make a device")
    refused = pytest.raises(WriteError, match="null: cannot be written, it is a device")
    with refused, replacing(device):
        pass
    assert stat.S_ISCHR(device.stat().st_mode) and os.listdir(tmp_path) == ["null"]


def test_a_folder_that_takes_no_files_is_named_before_anything_is_computed(tmp_path):
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(ResultError, match="loop: the output folder cannot be made or written") as caught:
        prepare_folder(tmp_path / "loop")
    assert not isinstance(caught.value, WriteError)


def test_runs_of_one_process_share_a_folder_and_a_cache(tmp_path):
    np.savetxt(tmp_path / "pulse.txt", np.sin(np.arange(20.0)))
    (tmp_path / "job.yaml").write_text(SMALL)
    job = romdam.load_config(tmp_path / "job.yaml")
    with ThreadPoolExecutor(4) as threads:
        made = [threads.submit(romdam.run, job, tmp_path / "out", cache=tmp_path / "c") for _ in range(8)]
    assert all(one.result().paths for one in made)
    assert is_sealed(tmp_path / "out" / "pulse.nc") and len(list((tmp_path / "out").iterdir())) == 2


def test_a_folder_that_another_job_sweeps_before_it_is_opened_is_made_again(tmp_path, monkeypatch):
    real, swept = tempfile.mkdtemp, []

    def mkdtemp(**options):
        made = real(**options)
        if len(swept) < 2:
            swept.append(made)
            os.rmdir(made)
        return made

    monkeypatch.setattr(tempfile, "mkdtemp", mkdtemp)
    with replacing(tmp_path / "a") as part:
        part.write_text("whole")
    assert (tmp_path / "a").read_text() == "whole" and len(swept) == 2


def test_a_held_file_is_not_held_twice(tmp_path):
    first = hold(tmp_path / "a")
    assert first is not None and hold(tmp_path / "a") is None
    os.close(first)
    again = hold(tmp_path / "a")
    assert again is not None
    os.close(again)


@pytest.fixture
def matrix(monkeypatch):
    monkeypatch.setattr(out_of_core_matrix, "WIDTH", 4)
    monkeypatch.setattr(out_of_core_matrix, "_TOGETHER", 6)
    return np.random.default_rng(0).standard_normal((30, 14))


def filled(path, matrix, until):
    """OutOfCoreMatrix of a matrix, and which of them were made."""
    made, T = [], OutOfCoreMatrix(path, "key", matrix.shape)
    T.fill(until, lambda first, last: made.extend(range(first, last)) or matrix[:, first:last])
    return T, made


def test_columns_are_the_matrix_by_rows_and_by_columns(tmp_path, matrix):
    T, _ = filled(tmp_path / "c", matrix[:, :11], 11)
    T.widen(3)
    T.fill(14, lambda first, last: matrix[:, first:last])
    V = np.eye(14)
    assert np.array_equal(T.combined(V), matrix)
    assert np.array_equal(np.vstack(list(T.pieces([0, 7, 8, 30]))), matrix)
    assert np.array_equal(T.before(np.eye(30)), matrix)
    T.remove()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "damage", ["a byte", "cut", "gone", "lines gone", "line cut", "noise", "another key"]
)
def test_columns_go_on_from_the_first_that_is_not_what_was_written(tmp_path, matrix, damage):
    T, _ = filled(tmp_path / "c", matrix, 14)
    T._release()  # the process ends
    path, lines, first = tmp_path / "c", tmp_path / "c.done", 0
    data = bytearray(path.read_bytes())
    if damage == "a byte":
        data[8 * 30 * 9 + 5] ^= 1
        first = 8
    elif damage == "cut":
        del data[8 * 30 * 5 :]
        first = 4
    elif damage == "gone":
        data.clear()
    elif damage == "lines gone":
        lines.unlink()
    elif damage == "line cut":
        lines.write_text(lines.read_text()[:-20])
        first = 12
    elif damage == "noise":
        lines.write_bytes(b"\xff\x00 \n\n9" * 5)
    else:
        lines.write_text(lines.read_text().replace("key", "kez"))
    path.write_bytes(data)
    T, made = filled(path, matrix, 14)
    assert made == list(range(first, 14)) and np.array_equal(T.combined(np.eye(14)), matrix)


def test_columns_that_another_is_making_are_made_beside(tmp_path, matrix):
    T, _ = filled(tmp_path / "c", matrix, 8)
    other, made = filled(tmp_path / "c", matrix, 14)
    assert made == list(range(14)) and other.path != T.path
    sweep_parts(tmp_path)
    assert np.array_equal(other.combined(np.eye(14)), matrix)
    other.remove()
    T.fill(14, lambda first, last: matrix[:, first:last])
    assert np.array_equal(T.combined(np.eye(14)), matrix)
    T.remove()
    assert not list(tmp_path.iterdir())
