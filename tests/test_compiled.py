"""Compiled functions work where nothing may be written, and where what is kept of them is damaged."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import romdam
from romdam.core.arrays import record_type
from romdam.core.jit import CALLED

PROBE = """
import sys
from numba.core import caching
if {closed}:  # an installation and a home that take no files
    for locator in ("InTreeCacheLocator", "UserWideCacheLocator"):  # private before numba 0.62
        locator = getattr(caching, locator, None) or getattr(caching, "_" + locator)
        locator.from_function = classmethod(lambda cls, *_: None)
import numpy as np
from romdam.core.jit import copy
target = np.zeros(3)
copy(np.arange(3.0), target)
print(target.sum(), copy._cache.cache_path, sum(copy.stats.cache_hits.values()))
"""


def probe(closed: bool, **environment: str) -> tuple[list[str], str]:
    """What a fresh process prints, and what it says on stderr."""
    kept = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "TMPDIR")}
    done = subprocess.run(
        [sys.executable, "-c", PROBE.format(closed=closed)],
        env=kept | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split(), done.stderr


def test_a_closed_installation_keeps_what_is_compiled_among_temporary_files(tmp_path):
    own = tmp_path / f"romdam-numba-{os.getuid()}"
    (total, where, hits), said = probe(True, TMPDIR=str(tmp_path), HOME="/nonexistent")
    assert float(total) == 3.0 and where.startswith(str(own)) and hits == "0"
    assert said.count("compiled functions are kept in") == 1 and own.stat().st_mode & 0o077 == 0
    (total, where, hits), _ = probe(True, TMPDIR=str(tmp_path), HOME="/nonexistent")
    assert float(total) == 3.0 and hits == "1"


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param("open to others", marks=pytest.mark.slow),
        "a link",
        pytest.param("a file", marks=pytest.mark.slow),
    ],
)
def test_a_planted_folder_is_not_used(tmp_path, kind):
    """What is cached is unpickled: whoever may write it may have anything run."""
    own = tmp_path / f"romdam-numba-{os.getuid()}"
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    if kind == "open to others":
        own.mkdir()
        own.chmod(0o777)
    elif kind == "a link":
        own.symlink_to(tmp_path / "elsewhere")
    else:
        own.touch()
    (total, where, _), said = probe(True, TMPDIR=str(tmp_path), HOME="/nonexistent")
    assert float(total) == 3.0 and where == "None"
    assert said.count("no folder takes compiled functions") == 1
    assert not list((tmp_path / "elsewhere").iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "damage"),
    [
        (".nbi", b""),
        pytest.param(".nbi", b"\x80\x04K\x01.", marks=pytest.mark.slow),
        pytest.param(".nbc", b"no pickle", marks=pytest.mark.slow),
    ],
)
def test_damaged_compiled_functions_are_compiled_again(tmp_path, suffix, damage):
    (total, where, hits), _ = probe(False, NUMBA_CACHE_DIR=str(tmp_path))
    assert hits == "0"
    for path in Path(where).glob(f"*{suffix}"):
        path.write_bytes(damage)
    (total, _, hits), said = probe(False, NUMBA_CACHE_DIR=str(tmp_path))
    assert float(total) == 3.0 and hits == "0" and "Traceback" not in said
    assert probe(False, NUMBA_CACHE_DIR=str(tmp_path))[0][2] == "1", "and kept again"


@pytest.mark.slow
def test_compiled_functions_on_a_full_disk_are_not_kept(tmp_path):
    code = (
        "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code + PROBE.format(closed=False)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0 and done.stdout.startswith("3.0"), done.stderr
    assert not [path for path in tmp_path.rglob("*") if path.suffix == ".nbc"]


STUCK = """
import numpy as np
from romdam.contact.solvers.condensation import sticks
from romdam.contact.problem import Limits
limits = Limits(np.zeros((1, 2)), np.full((1, 2), 0.6), np.zeros(1))
print(sticks(limits, np.array([1.0, 0.1, 0.0]), 0), sum(sticks.stats.cache_hits.values()))
"""


def test_a_function_is_compiled_again_when_what_it_calls_has_changed(tmp_path):
    """`sticks` calls `slides`, in another file: numba alone would go on with the old one."""
    shutil.copytree(Path(romdam.__file__).parent, tmp_path / "romdam", ignore=shutil.ignore_patterns("__*__"))
    shutil.copy(romdam.__file__, tmp_path / "romdam")

    def stuck() -> list[str]:
        environment = os.environ | {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        command = [sys.executable, "-c", STUCK]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        return done.stdout.split()

    assert stuck() == ["True", "0"] and stuck() == ["True", "1"]
    laws = tmp_path / "romdam" / "contact" / "cone.py"
    start = "near_j, near_k = "
    assert laws.read_text().count(start) == 1
    laws.write_text(laws.read_text().replace(start, f"return True\n    {start}"))
    assert stuck() == ["False", "0"]


OTHER_NUMBA = """
import sys
import numba
from numba.core import caching
if "linking" in sys.argv:  # a version that functions were not tried to be linked late with
    numba.version_info = numba.version_info._replace(short=(0, 1))
if "cache" in sys.argv:  # and one whose cache has other parts
    caching.FunctionCache.__init__ = lambda self, function: setattr(self, "_cache_path", "elsewhere")
import numpy as np
from romdam.core import jit
from romdam.core.arrays import at, put
"""
PLAIN = (
    OTHER_NUMBA
    + STUCK
    + """
@jit.njit(cache=True)
def doubled(rows, values):
    for i in range(len(rows)):
        row = at(rows, i)
        row[1] = 2.0 * row[0]
    put(rows, 0, values)

rows = np.array([[1.0, 0.0], [3.0, 0.0]])
doubled(rows, np.array([5.0, 7.0]))
print(*rows.ravel(), *sorted(jit.CALLED))
"""
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "other",
    [
        *(pytest.param(each, marks=pytest.mark.slow) for each in ((), ("linking",), ("cache",))),
        ("linking", "cache"),
    ],
)
def test_another_numba_compiles_plainly_to_the_same_numbers(tmp_path, other):
    """`sticks` calls functions of other files, `doubled` takes a row of an array and writes one."""
    (tmp_path / "other.py").write_text(PLAIN)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for start in range(2):
        done = subprocess.run(
            [sys.executable, str(tmp_path / "other.py"), *other],
            env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        stuck, numbers = done.stdout.splitlines()
        assert stuck.split() == ["True", "0" if "cache" in other else str(start)]
        assert [float(number) for number in numbers.split()[:4]] == [5.0, 7.0, 3.0, 6.0]
        late = set(numbers.split()[4:])
        assert late == (set() if "linking" in other else set(CALLED))
        assert done.stderr.count("every process compiles") == ("cache" in other)
    assert bool(list(tmp_path.rglob("*.nbc"))) == ("cache" not in other)


@pytest.mark.skipif(not CALLED, reason="with this numba its own flags stay")
def test_flags_are_equal_where_all_their_values_are():
    """As numba compares them: whether a value is set or left at its default does not count."""
    from numba.core.compiler import Flags

    random, made = np.random.default_rng(3), [Flags(), Flags()]
    switches = [name for name, option in Flags.options.items() if isinstance(option.default, bool)]
    for _ in range(60):
        flags = Flags()
        for name in random.choice(switches[:3], 2):
            setattr(flags, name, bool(random.integers(2)))
        flags.fastmath = bool(random.integers(2))
        made.append(flags)
    alike = 0
    for one in made:
        for other in made:
            same = one.values() == other.values()
            assert (one == other) is same and (hash(one) == hash(other) or not same)
            alike += same
    assert len(made) < alike < len(made) ** 2 and made[0] != 1


STEPS = """
import sys
sys.path.insert(0, {contact!r})
from gap_problems import random_case, solve
for mu in (0.0, 0.6):
    memory = None
    for seed in range(4):
        memory = solve(random_case(seed, 6, (mu, mu)), memory)[3]
        print(*memory.force)
"""


def test_steps_are_the_same_without_compiling():
    """A debugger stops in the kernels with NUMBA_DISABLE_JIT=1, and sees what the compiled ones do."""
    code = STEPS.format(contact=str(Path(__file__).parent / "contact"))

    def forces(**environment: str) -> np.ndarray:
        command, environment = [sys.executable, "-c", code], os.environ | environment
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return np.array([float(number) for number in done.stdout.split()])

    compiled, interpreted = forces(), forces(NUMBA_DISABLE_JIT="1")
    assert len(compiled) == 4 * 6 + 4 * 18 and compiled.any()
    np.testing.assert_allclose(interpreted, compiled, rtol=1e-9, atol=1e-9 * compiled.max())


def test_no_field_of_a_record_hides_behind_numpys_own():
    with pytest.raises(AssertionError, match="size"):
        record_type(size=int)


AT_ONCE = """
import sys, time
from pathlib import Path
import numpy as np
from numba.core.caching import IndexDataCacheFile
from romdam.core.jit import copy
folder, name, kind, delay = Path(sys.argv[1]), sys.argv[2], sys.argv[3], float(sys.argv[4])
write = IndexDataCacheFile._save_index
def slowly(self, overloads):
    time.sleep(delay)  # what an index holds is read before, and written after
    write(self, overloads)
IndexDataCacheFile._save_index = slowly
(folder / name).touch()
while len(list(folder.glob("ready*"))) < 2:
    time.sleep(0.001)
copy(np.zeros(3, kind), np.zeros(3, kind))
print(sum(copy.stats.cache_hits.values()))
"""


def hits_at_once(folder: Path, kinds: tuple[str, str], delay: float) -> list[str]:
    """Hits of the cache in two processes that call a function at the same time, with these types."""
    cache = {"NUMBA_CACHE_DIR": str(folder / "cache")}
    started = [
        subprocess.Popen(
            [sys.executable, "-c", AT_ONCE, str(folder), f"ready{i}", kind, str(delay)],
            env=os.environ | cache, stdout=subprocess.PIPE, text=True,
        )
        for i, kind in enumerate(kinds)
    ]  # fmt: skip
    hits = [process.communicate()[0].strip() for process in started]
    for path in folder.glob("ready*"):
        path.unlink()
    return hits


@pytest.mark.slow
def test_of_two_processes_that_need_the_same_one_compiles(tmp_path):
    """Workers of a suite or of these tests start together, and a time loop takes a minute."""
    assert sorted(hits_at_once(tmp_path, ("float64", "float64"), 0.0)) == ["0", "1"]
    assert not list((tmp_path / "cache").rglob("*.lock"))


@pytest.mark.slow
def test_two_processes_that_keep_at_once_lose_nothing(tmp_path):
    """Numba reads the index, adds to it and writes it: the later of two would forget the earlier."""
    assert hits_at_once(tmp_path, ("float64", "int64"), 0.5) == ["0", "0"]
    assert hits_at_once(tmp_path, ("float64", "int64"), 0.0) == ["1", "1"]


@pytest.mark.slow
def test_functions_of_laws_with_memory_are_read_from_the_cache(tmp_path):
    """Their globals have no file of their own: without a module's name numba read none and compiled again."""
    code = (
        "import logging, sys; logging.basicConfig(level=logging.INFO, stream=sys.stdout);"
        "from romdam.contact.laws.bond import Bond; from romdam.contact.laws.crack_water import CrackWater;"
        "from romdam.contact.laws.compiled import Functions, _compiled;"
        "made = [_compiled(name, law) for name in Functions._fields for law in (Bond, CrackWater)];"
        "print('hits', sum(sum(one._function.stats.cache_hits.values()) for one in made))"
    )
    said = [
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for _ in range(2)
    ]
    assert "hits 6" not in said[0] and "hits 6" in said[1] and "cannot be read" not in said[1]
