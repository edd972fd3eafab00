"""What a first start compiles: the loop alone, said on the terminal, and with the bits of the next."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from romdam.core.jit import CALLED

ROOT = Path(__file__).parents[1]
MOST = 45  # functions of romdam, each for one kind of arguments
START = """
import sys
from pathlib import Path
from numba.core import event
made = []
class Compiled(event.Listener):
    def on_start(self, what):
        made.append((what.data["dispatcher"], what.data["args"]))
    def on_end(self, what):
        pass
event.register("numba:compile", Compiled())
from romdam import cli
sys.argv = ["romdam", "run", sys.argv[1], "--out", sys.argv[2], "--no-cache"]
try:
    cli.main()
finally:
    own = [one for one, _ in made if one.py_func.__module__.startswith("romdam.")]
    assert not [args for one, args in made if one in own and "Literal" in str(args)], made
    own = [one for one in own if not one.py_func.__module__.startswith("romdam.records.")]  # their spectra
    whole = [one.__name__ for one in own if not one.targetoptions.get("no_cpython_wrapper")]
    Path("made.txt").write_text(f"{len(own)} {' '.join(whole)}")
"""


def start(folder: Path, out: str) -> tuple[list[str], str, xr.Dataset]:
    """Run a second of the main job; what is compiled, what is said on stderr, the result."""
    text = (ROOT / "configs" / "two_cantilevers.yaml").read_text().replace("../data", str(ROOT / "data"))
    text = text.replace("finest_step: 2.5 ms", "finest_step: 2.5 ms, duration: 1 s")
    config = folder / "job.yaml"
    config.write_text(text)
    done = subprocess.run(
        [sys.executable, "-c", START, str(config), str(folder / out)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")},
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    result = xr.load_dataset(folder / out / "northridge_mul009.nc", engine="h5netcdf")
    return (folder / "made.txt").read_text().split(), done.stderr, result


@pytest.mark.slow
@pytest.mark.skipif(not CALLED, reason="with this numba every function is compiled whole")
def test_a_first_start_compiles_the_loop_alone_and_has_the_bits_of_the_next(tmp_path):
    (number, *whole), said, first = start(tmp_path, "first")
    assert whole == ["integrate"], "others are called by compiled functions only"
    assert int(number) <= MOST and "compiling, once for this version: " in said
    (number, *_), said, following = start(tmp_path, "next")
    assert number == "0" and "compiling" not in said
    for name in ("opening", "normal_force", "energy_input", "energy_contact"):
        assert np.array_equal(first[name], following[name]), name
