"""The command and the library wherever they are started from: the same numbers, or one message."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from suite_jobs import BASE

LIMIT = 400.0  # seconds; what takes longer hangs, kernels may have to be compiled
RUN, SUITE = "run one.yaml --out OUT", "run suite.yaml --out OUT --workers 2"
SCRIPT = """
import romdam
from romdam.pipelines.suites.run import SuiteOptions, run_suite
_ = open("started", "a").write("x")
run_suite(romdam.load_config("suite.yaml"), "OUT", SuiteOptions(workers=2))
"""


@dataclass(frozen=True)
class Case:
    """One way to start it.

    Attributes
    ----------
    command : arguments of romdam
    shell : how; "$@" is the command itself
    code, part : exit code, and what standard error holds; where it is 0 the numbers are those of a plain run
    told : what standard output holds
    """

    name: str
    command: str = RUN
    shell: str = '"$@"'
    code: int = 0
    part: str = ""
    told: str = ""
    environment: dict[str, str] = field(default_factory=dict)


def threads(name: str, value: str) -> Case:
    part = f"{name}_NUM_THREADS: this environment variable must be a whole number above 0"
    return Case(f"{name} {value!r}", code=2, part=part, environment={f"{name}_NUM_THREADS": value})


def under(name: str, command: str = RUN, **environment: str) -> Case:
    return Case(name, command, environment=environment)


PYTHON = f'"{sys.executable}"'
LONG = "x" * 60 + "/" + "y" * 60
CASES = [
    Case("standard output full", "check one.yaml", '"$@" > /dev/full', 1, "No space left"),
    threads("OMP", "abc"),
    Case("script without a guard", shell=f"{PYTHON} script.py"),
    Case("working folder gone", "check one.yaml", 'mkdir gone; cd gone; rmdir ../gone; "$@"', 2, "is gone"),
    Case("standard input as the script", shell=f"{PYTHON} - < script.py"),
    Case("interactive console", shell=f"{PYTHON} -i < script.py 2> console"),
    Case("read by exec", shell=f"{PYTHON} -c \"exec(open('script.py').read())\""),
    Case("module", RUN, f'shift; {PYTHON} -m romdam "$@"'),
    *(threads(*one) for one in [("OMP", "4,2"), ("OMP", ""), ("NUMBA", "0"), ("NUMBA", "abc")]),
    *(threads(*one) for one in [("MKL", "-1"), ("OPENBLAS", "1.5"), ("NUMEXPR", "²"), ("OMP", " 1")]),
    under("more threads than cores", SUITE, OMP_NUM_THREADS="999", NUMBA_NUM_THREADS="999"),
    Case("long TMPDIR", SUITE, f'mkdir -p {LONG}; TMPDIR="$PWD/{LONG}" "$@"'),
    under("no TMPDIR", SUITE, TMPDIR="/nowhere"),
    under("TMPDIR that cannot be written", SUITE, TMPDIR="/proc"),
    under("no HOME", SUITE, HOME="/nowhere", XDG_CACHE_HOME="/nowhere", MPLCONFIGDIR="/nowhere"),
    under("a backend that is none", MPLBACKEND="bad"),
    under("a backend with windows", MPLBACKEND="TkAgg"),
    Case("standard output closed", shell='"$@" >&-'),
    Case("standard output closed, suite", SUITE, shell='"$@" >&-'),
    Case("standard error closed", SUITE, shell='"$@" 2>&-'),
    Case("standard error full", "check none.yaml", '"$@" 2> /dev/full', 2),
    Case("standard input closed", SUITE, '"$@" <&-'),
    Case("all closed", SUITE, '"$@" <&- >&- 2>&-'),
    Case("nobody reads to the end", shell='set -o pipefail; "$@" | head -0'),
    Case("nobody reads a suite to the end", SUITE, 'set -o pipefail; "$@" | head -0'),
    Case("nobody reads the records", "records one.yaml", 'set -o pipefail; "$@" | head -1'),
    Case("standard output full, records", "records one.yaml", '"$@" > /dev/full', 1, "No space left"),
    Case("standard output full, help", "--help", '"$@" > /dev/full', 1, "No space left"),
    Case("ASCII", environment={"PYTHONIOENCODING": "ascii"}, told="Peaks"),
    Case("ASCII, check", "check one.yaml", environment={"PYTHONIOENCODING": "ascii"}, told="m\\xb2"),
    Case("ASCII, records", "records one.yaml", environment={"PYTHONIOENCODING": "ascii:strict"}, told="PGA"),
    under("C locale", SUITE, LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0"),
    under("decimal commas", SUITE, LC_ALL="de_DE.UTF-8", LC_NUMERIC="de_DE.UTF-8"),
    under("a locale that is none", LC_ALL="xx_YY.bad"),
    Case("20 columns", environment={"COLUMNS": "20"}, told="compression, mean of a writing interval [MPa]"),
    under("columns that are none", COLUMNS="abc", LINES="-1"),
    under("no terminal type", TERM="", NO_COLOR="1"),
    under("random hashes", SUITE, PYTHONHASHSEED="random"),
    under("other hashes", SUITE, PYTHONHASHSEED="12345"),
    under("no asserts", SUITE, PYTHONOPTIMIZE="2"),
    Case("no asserts, bad input", "check bad.yaml", '"$@"', 2, "dt", environment={"PYTHONOPTIMIZE": "2"}),
    under("warnings are errors", SUITE, PYTHONWARNINGS="error"),
    under("warnings are shown", SUITE, PYTHONWARNINGS="always", PYTHONDEVMODE="1"),
    under("no byte code", PYTHONDONTWRITEBYTECODE="1"),
    under("not safe to start in", SUITE, PYTHONSAFEPATH="1"),
    Case("no affinity", SUITE, f'{PYTHON} -c "import os; del os.sched_getaffinity; import sys; '
         'sys.argv[1:] = \'run suite.yaml --out OUT\'.split(); from romdam.cli import main; main()"'),
    Case("few files", SUITE, 'ulimit -n 40; "$@"'),
    Case("a file named as a library", SUITE, 'echo 1/0 > numpy.py; "$@"; code=$?; rm numpy.py; exit $code'),
]  # fmt: skip


@pytest.fixture(scope="session")
def jobs(tmp_path_factory) -> Path:
    """A job, a suite and a script in a folder."""
    folder = tmp_path_factory.mktemp("surroundings")
    (folder / "records").mkdir()
    disp = np.sin(np.linspace(0.0, np.pi, 60)) ** 6  # it ends at rest, so that nothing odd is told of it
    np.savetxt(folder / "records" / "r0.txt", np.gradient(np.gradient(disp, 0.01), 0.01) / 200.0)
    for name, plots, more in (
        ("one", True, {"pipeline": "run"}),
        ("suite", False, {"suite": {"scales": [0.5, 1.0], "batch": 1}}),
    ):
        job = BASE | more | {"outputs": BASE["outputs"] | {"plots": plots}}
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(job))
    (folder / "bad.yaml").write_text(yaml.safe_dump(BASE | {"transient": {"finest_step": "-1 s"}}))
    (folder / "script.py").write_text(SCRIPT)
    return folder


@pytest.fixture(scope="session")
def plain(jobs) -> Callable[[str], bytes]:
    """Callable (name of a result) -> its peaks in a plain run."""

    @cache
    def run(name: str) -> bytes:
        command = RUN if name == "r0.nc" else SUITE
        done = start(Case("plain", command.replace("OUT", "plain")), jobs)
        assert (done.returncode, done.stderr) == (0, "")
        return peaks(jobs / "plain" / name)

    return run


def start(case: Case, folder: Path) -> subprocess.CompletedProcess[str]:
    romdam = str(Path(sys.executable).with_name("romdam"))
    environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "PYTHONPATH")}
    return subprocess.run(
        ["bash", "-c", case.shell, "bash", romdam, *case.command.split()],
        cwd=folder,
        env=environment | case.environment,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=LIMIT,
        stdin=subprocess.DEVNULL,
    )


def peaks(file: Path) -> bytes:
    """Largest openings, bit for bit."""
    with xr.open_dataset(file, engine="h5netcdf") as found:
        return found.peak_opening.values.tobytes()


SHARE = 2  # of the cases, the first ones, with the other tests


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=[pytest.mark.fuzz] * (i >= SHARE))
        for i, case in enumerate(CASES)
    ],
)
def test_numbers_are_the_same_or_one_message_says_why(case, jobs, plain, tmp_path):
    shutil.copytree(jobs, tmp_path, dirs_exist_ok=True, ignore=lambda *_: ["plain"])
    done = start(case, tmp_path)
    about = f"{case.name}: exit {done.returncode}\n{done.stdout}\n{done.stderr}"
    assert done.returncode == case.code, about
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr, about
    assert case.part in done.stderr and case.told in done.stdout, about
    assert done.stderr.count("romdam: ") == (case.code > 0 and "2>" not in case.shell), about
    results = {path.name for path in tmp_path.glob("OUT/*.nc")} & {"r0.nc", "summary.nc"}
    assert bool(results) == (case.code == 0 and "OUT" in case.command), about
    for name in results:
        assert peaks(tmp_path / "OUT" / name) == plain(name), about
    if "script.py" in case.shell:
        assert (tmp_path / "started").read_text() == "x", "a worker has run the script again"
    assert not list(tmp_path.glob("**/.*.part")), about
