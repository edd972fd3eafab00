"""Every test has a cache of reduced blocks of its own and leaves the user's alone; signals are heard.

BLAS has one thread: the tests run on one process a core, and a further thread of OpenBLAS that waits for work
spins, which was up to five sixths of the CPU time. The library reads the number as it is loaded, so it is set
here. Tests of threads set their numbers themselves (test_threads.py).
"""

import base64
import gc
import os
import signal
from itertools import count
from pathlib import Path

import pytest

_numbers = count()

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")


def pytest_collection_finish():
    """What has been collected lives as long as the process: searching it for garbage took a seventh of it."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.fixture(autouse=True, scope="session")
def cache_of_the_session(tmp_path_factory):
    """For what fixtures of a module or of the session run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))
        yield


@pytest.fixture(autouse=True)
def own_cache(cache_of_the_session, tmp_path_factory, monkeypatch):
    """A folder that is not there yet: what one test has reduced, another one must not find."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / f"cache{next(_numbers)}"))


@pytest.fixture(scope="session", autouse=True)
def signals_are_heard():
    """Commands that tests start hear signals, also where this run was told to ignore them (nohup, `&`)."""
    for name, handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)


_DOT = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR42mP4DwABAQEAHLCMmQAAAABJRU5ErkJggg=="
)  # a PNG of one pixel


@pytest.fixture
def unrendered(monkeypatch):
    """Figures are built, with all their texts and numbers, and a dot is written in their place.

    For tests of what is printed beside figures: pixels take more than all the rest of a run and its report.
    """
    from romdam.core.files import replacing

    # modules that take the function as they are loaded must not take the dot for good
    from romdam.visual import field_views, mode_views, plots, scene_view
    from romdam.visual.report.parts import PagePicture

    def dot(figure, path):
        with replacing(path) as unfinished:
            Path(unfinished).write_bytes(_DOT)
        return path

    for module in (plots, field_views, mode_views, scene_view):
        monkeypatch.setattr(module, "save_figure", dot)
    monkeypatch.setattr(
        PagePicture, "_saved", lambda self, kind, dpi=None: b"<svg/>" if kind == "svg" else _DOT
    )


_REST = {
    "materials": {"concrete": {"E": 30e9, "nu": 0.18, "rho": 2440.0}},
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}


@pytest.fixture
def make():
    """raw scene keys -> Scene; messages name the file `s.yaml`."""

    from romdam.config import parse_config
    from romdam.scene.build import build_scene

    def build(raw, folder=Path()):
        return build_scene(parse_config(_REST | raw, "s.yaml"), Path(folder), "s.yaml")

    return build
