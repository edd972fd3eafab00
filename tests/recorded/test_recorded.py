"""Numbers and texts of jobs in which nothing is symmetric, zero or one are those of the references.

A difference says that something has changed, not that it is wrong; what is right is for the other tests. If
the change is meant, `python tests/recorded/record.py` makes the references again and prints each difference,
and the commit explains it.
"""

import pytest
from jobs import JOBS
from record import differences_of
from running import recorded


@pytest.fixture(scope="module")
def shared_cache(tmp_path_factory):
    return tmp_path_factory.mktemp("reduced")


LONG = ("blocks", "gravity", "arch", "laws", "suite", "records", "linear", "meshes")  # 10 to 43 s each
NAMES = [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in JOBS]


@pytest.mark.parametrize("name", NAMES)
def test_all_that_a_job_writes_and_says(name, tmp_path, shared_cache, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(shared_cache))
    lines = differences_of(name, recorded(name, tmp_path / name))
    shown = "\n".join([*lines[:40], *[f"and {len(lines) - 40} more"] * (len(lines) > 40)])
    assert not lines, f"{len(lines)} differences\n{shown}"
