"""A disk that fills at any byte: one message, exit 1, only whole files, and later the same bits.

On a small disk of its own (a tmpfs, where one can be mounted), and by a limit on the size of a file.
"""

import resource
import shutil
import signal
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from bounded import bounded
from suite_jobs import BASE, write_job
from test_cli import DRAWN, call

from romdam.core.errors import ResultError, WriteError
from romdam.core.sealed import creating, is_sealed

SECONDS = 120.0
VARYING = ("date_created", "history", "configuration_folder")


@pytest.fixture(scope="module", params=["job", pytest.param("suite", marks=pytest.mark.slow)])
def small(request, tmp_path_factory):
    """A job, or a suite that keeps its runs, and its results where nothing is in the way."""
    made = tmp_path_factory.mktemp(request.param)
    if request.param == "suite":
        outputs = BASE["outputs"] | {"plots": False}
        path = write_job(made, records=2, suite={"keep": "full", "scales": [1], "batch": 1}, outputs=outputs)
        path.rename(made / "job.yaml")
    else:
        time = np.arange(40) * 0.01
        np.savetxt(made / "pulse.txt", 5.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-4 * time))
        (made / "job.yaml").write_text(DRAWN)
    assert run(made, made / "out")[0] == 0
    return made


def run(made, out):
    alone = ("--workers", 1) if (made / "records").exists() else ()
    return call("run", made / "job.yaml", "--out", out, "--cache", out / "cache", "--quiet", *alone)


@pytest.fixture
def disk(tmp_path):
    """Callable (bytes) -> folder on a disk of that size."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mount(size):
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)], capture_output=True
        )
        if done.returncode:
            pytest.skip("no disk can be mounted here")
        return folder

    yield mount
    subprocess.run(["umount", "--lazy", str(folder)], capture_output=True, check=False)


def contents(out: Path) -> dict[str, bytes]:
    """Every variable and attribute of every result, but seconds and dates."""
    found = {}
    for path in sorted(out.rglob("*.nc")):
        with xr.open_dataset(path, engine="h5netcdf") as dataset:
            values = {
                str(name): v.values for name, v in dataset.variables.items() if "seconds" not in str(name)
            }
            stated = {k: v for k, v in dataset.attrs.items() if k not in VARYING and "seconds" not in k}
        found |= {f"{path.name}: {name}": _plain(value).tobytes() for name, value in values.items()}
        found[path.name] = repr(sorted(stated.items())).encode()
    return found


def _plain(values) -> np.ndarray:
    return values.astype(str) if values.dtype.kind == "O" else values


def only_whole_files(out: Path, where: str) -> None:
    for path in out.rglob("*"):
        assert ".part" not in str(path), f"{where}: {path} is left"
        if path.suffix in (".nc", ".h5"):
            assert is_sealed(path), f"{where}: {path}"
        if path.suffix == ".png":
            assert path.read_bytes().endswith(b"IEND\xaeB`\x82"), f"{where}: {path}"


def one_message(outcome, where: str) -> int:
    assert not outcome.crash and not outcome.refusal, f"{where}: {outcome}"
    code, _, err = outcome.value
    assert code in (0, 1), f"{where}: exit {code}: {err}"
    assert code == 0 or (err.count("romdam: ") == 1 and "Traceback" not in err), f"{where}: {err}"
    return code


def test_a_disk_that_fills_at_any_byte(small, disk, cases):
    taken = sum(path.stat().st_size for path in (small / "out").rglob("*") if path.is_file())
    expected, stopped = contents(small / "out"), 0
    for case in range(cases(1, 50)):
        size = 4096 * int(np.random.default_rng([1, case]).integers(2, taken // 4096 + 20))
        where, folder = f"case {case}, {size} of {taken} bytes", disk(size)
        code = one_message(bounded(lambda folder=folder: run(small, folder / "out"), SECONDS), where)
        stopped += code
        only_whole_files(folder, where)
        subprocess.run(["mount", "-o", f"remount,size={4 * taken}", str(folder)], check=True)
        code, _, err = bounded(lambda folder=folder: run(small, folder / "out"), SECONDS).value
        assert code == 0, f"{where}: {err}"
        only_whole_files(folder, where)
        assert contents(folder / "out") == expected, where
        subprocess.run(["umount", str(folder)], check=True)
    assert stopped > 0


def test_files_that_may_not_grow_beyond_any_byte(small, tmp_path, cases):
    """As a quota does; the limit holds for every file alone."""
    largest = max(path.stat().st_size for path in (small / "out").rglob("*") if path.is_file())
    expected = contents(small / "out")
    for case in range(cases(1, 50)):
        most = int(np.random.default_rng([2, case]).integers(1, largest))
        where, out = f"case {case}, {most} of {largest} bytes", tmp_path / f"{case}"
        outcome = bounded(lambda out=out, most=most: limited(most, lambda: run(small, out)), SECONDS)
        assert one_message(outcome, where) == 1, where
        only_whole_files(out, where)
        code, _, err = bounded(lambda out=out: run(small, out), SECONDS).value
        assert code == 0, f"{where}: {err}"
        assert contents(out) == expected, where
        shutil.rmtree(out)


def limited(most: int, call):
    """Call where no file may be longer than `most` bytes; only in a child process."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))
    return call()


def test_hdf5_survives_a_full_disk_wherever_it_comes(tmp_path, cases):
    """Many small groups and chunks: where it writes straight to a file, HDF5 dies as it closes that."""
    path = tmp_path / "a.h5"

    def write():
        with creating(path) as file:
            file.attrs["text"] = "x" * 1000
            file.create_dataset("chunked", data=np.ones((1000, 30)), chunks=(100, 30), compression="gzip")
            for k in range(40):
                file.create_group(f"blocks/{k}")["points"] = np.full((50, 3), float(k))

    write()
    size = path.stat().st_size
    whole = path.read_bytes()
    for case in range(cases(20, 400)):
        most = int(np.random.default_rng([3, case]).integers(size))
        outcome = bounded(lambda most=most: limited(most, write), SECONDS)
        assert "a.h5: cannot be written" in outcome.refusal, f"case {case}, {most}: {outcome}"
        assert path.read_bytes() == whole and len(list(tmp_path.iterdir())) == 1, f"case {case}, {most}"


def test_what_the_body_raises_is_told_where_the_disk_is_well(tmp_path):
    with pytest.raises(ZeroDivisionError), creating(tmp_path / "a.h5") as file:
        file["a"] = 1 / 0
    assert not list(tmp_path.iterdir())
    (tmp_path / "b.h5").mkdir()
    for name in ("none/a.h5", "b.h5"):
        with pytest.raises(WriteError, match=f"{name}: cannot be written"), creating(tmp_path / name):
            pass
    with pytest.raises(ResultError, match="is a folder"):
        is_sealed(tmp_path / "b.h5")
    assert h5py.is_hdf5(tmp_path / "b.h5") is False
