"""What a user's law takes from outside its text counts as it is now; and an exception in it ends the run."""

import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
import yaml

import romdam
from romdam.config import load_config
from romdam.contact.laws.catalogue import find_law
from romdam.contact.laws.compiled import DONE, FAILED, call_limit, compiled
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.pipelines.run import run
from romdam.pipelines.suites.run import SuiteOptions, run_suite

sys.path.append(str(Path(__file__).parent))

from test_law_protocol import KEYS, RATE, written

LAW = '''
from romdam.contact.laws.law import MU_J, MU_K, Law, Parameter
{head}

class Own(Law):
    """Friction from elsewhere."""

    section = "own"
    parameters = (Parameter("factor", "", most=2.0),)
    memory = ("kept",)
    shear = True

    @staticmethod
    def limit(parameters, memory, step, limit):
        limit[MU_J] = limit[MU_K] = parameters[0] * ({value})
'''
OWN = {"law": "own_laws.Own", "own": {"factor": 1.0}}
READ = "from pathlib import Path\nMU = float(Path(__file__).with_name('mu.txt').read_text())"
COMPILED = "import numba\n@numba.njit(cache=True)\ndef mu():\n    return MU\n"
ELSEWHERE = {
    "a number": (READ, "MU"),
    "an array": (READ + "\nimport numpy as np\nTABLE = np.full(3, MU)", "TABLE[1]"),
    "a tuple": (READ + "\nTABLE = (MU, 1.0)", "TABLE[0] * TABLE[1]"),
    "a compiled function of the file": (READ + "\n" + COMPILED, "mu()"),
    "a plain function of the file": (READ + "\ndef mu():\n    return MU", "mu()"),
    "a number of a module": ("import helper_of_laws as h", "h.MU"),
    "a compiled function of a module": ("import helper_of_laws", "helper_of_laws.mu()"),
    "a compiled function that was imported": ("from helper_of_laws import mu as f", "f()"),
    "a number that was imported": ("from helper_of_laws import MU", "MU"),
}
PRINT = """
import numba, numpy, sys
from romdam.config import load_config
from romdam.contact.laws.compiled import call_limit, compiled
(law,) = load_config(sys.argv[1]).config.joints["contraction"].law
limit = numpy.zeros(6)
step = numpy.zeros(8)
call = numba.njit(lambda f, a, b, c, d: call_limit(f, a, b, c, d))
call(compiled([law.law]).limit[0], numpy.ones(1), numpy.zeros(1), step, limit)
print(limit[3])
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "helper_of_laws.py").write_text(READ + "\n" + COMPILED)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "helper_of_laws", raising=False)  # that of another test's folder
    return tmp_path


def of_now(path, name="limit"):
    """The law of a configuration's joint as it is compiled now."""
    (law,) = load_config(path).config.joints["contraction"].law
    return getattr(compiled([find_law(law.source)]), name)[0]


def friction(path):
    limit = np.zeros(6)
    call = numba.njit(lambda f, row, kept, step, limit: call_limit(f, row, kept, step, limit))
    assert call(of_now(path), np.ones(1), np.zeros(1), np.zeros(8), limit) == DONE
    return limit[3]


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(
            kind,
            marks=[pytest.mark.slow]
            * (
                kind
                not in (
                    "an array",
                    "a plain function of the file",
                    "a number of a module",
                    "a compiled function that was imported",
                )
            ),
        )
        for kind in ELSEWHERE
    ],
)
def test_what_stands_elsewhere_counts_as_it_is_now(folder, kind):
    head, value = ELSEWHERE[kind]
    found, digests = [], []
    for mu in ("0.3", "0.9", "0.3"):
        (folder / "mu.txt").write_text(mu)
        path = written(folder, OWN, LAW.format(head=head, value=value))
        digests.append(load_config(path).digest)
        found.append(friction(path))
    assert found == [0.3, 0.9, 0.3]
    assert digests[0] == digests[2] != digests[1]
    assert not list(folder.rglob("*.nbi"))


@pytest.mark.slow
def test_a_new_process_takes_what_stands_there_now(folder):
    path = written(folder, OWN, LAW.format(head="import helper_of_laws", value="helper_of_laws.mu()"))
    for mu in ("0.3", "0.9"):
        (folder / "mu.txt").write_text(mu)
        words = [sys.executable, "-c", PRINT, str(path)]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
        assert float(done.stdout) == float(mu), done.stderr


@pytest.mark.slow
def test_a_suite_makes_its_rows_again_where_a_table_has_changed(folder):
    raw = yaml.safe_load(written(folder, OWN, LAW.format(head=READ, value="MU")).read_text())
    path = folder / "dam.yaml"
    path.write_text(yaml.safe_dump(raw | {"pipeline": "suite", "suite": {"scales": [1.0]}}))
    slips = []
    for mu, made in (("0.3", 1), ("0.9", 1), ("0.9", 0)):
        (folder / "mu.txt").write_text(mu)
        outcome = run_suite(load_config(path), folder / "out", SuiteOptions(workers=2))
        assert outcome.made == made * outcome.runs
        slips.append(float(outcome.summary.peak_slip.max()))
    fresh = run_suite(load_config(path), folder / "fresh", SuiteOptions(workers=1)).summary
    assert slips[1] == slips[2] == float(fresh.peak_slip.max()) != slips[0]


def test_a_worker_refuses_a_table_that_has_changed_since(folder, monkeypatch):
    (folder / "mu.txt").write_text("0.3")
    path = written(folder, OWN, LAW.format(head=READ, value="MU"))
    (law,) = load_config(path).config.joints["contraction"].law
    (folder / "mu.txt").write_text("0.9")
    monkeypatch.setattr("romdam.contact.laws.catalogue._LOADED", {})
    with pytest.raises(ConfigError, match="or what it takes from elsewhere, has changed since"):
        find_law(law.source)


@pytest.mark.parametrize(
    ("head", "value"),
    [
        ("TABLE = {1: 0.5}", "TABLE[1]"),
        ("class Curve:\n    mu = 0.5\ncurve = Curve()", "curve.mu"),
        ("TABLE = [0.5, 0.6]", "TABLE[1]"),
    ],
)
def test_what_may_change_without_a_trace_is_refused(folder, head, value):
    path = written(folder, OWN, LAW.format(head=head, value=value))
    with pytest.raises(ConfigError, match=r"own_laws.py: Own.limit takes '\w+' from outside, of type"):
        load_config(path)


FAULTS = {
    "an exception in limit": (
        "limit",
        "    if memory[0] > 0.0:\n            raise ValueError('too fast')\n        ",
    ),
    "a division by zero in limit": ("limit", "    mu = 1.0 / (1e9 if memory[0] == 0.0 else 0.0)\n        "),
    "NaN in limit": ("limit", "    limit[0] = math.sqrt(-1.0) if memory[0] > 0.0 else 0.0\n        "),
    "an index beyond the memory in limit": (
        "limit",
        "    mu = memory[0 if memory[0] == 0.0 else 7]\n        ",
    ),
    "an exception in commit": (
        "commit",
        "    if step[0] > 1e-5:\n            raise ValueError('open')\n        ",
    ),
    "NaN in commit": ("commit", "    memory[0] = step[0]\n        "),
}
ANCHORS = {"limit": "    mu = parameters[1] +", "commit": "    memory[0] = step[RATE]"}


def failing(kind):
    name, text = FAULTS[kind]
    source = RATE
    if kind == "NaN in commit":  # numba's square root of a negative number
        source = RATE.replace("memory[0] = step[RATE]", "memory[0] = math.sqrt(step[RATE] - 1e9)")
    return name, source if kind == "NaN in commit" else source.replace(
        ANCHORS[name], text + ANCHORS[name].strip()
    )


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(
            kind,
            marks=[pytest.mark.slow] * (kind not in ("an index beyond the memory in limit", "NaN in commit")),
        )
        for kind in FAULTS
    ],
)
def test_a_law_that_fails_ends_the_run(tmp_path, kind, monkeypatch):
    name, source = failing(kind)
    monkeypatch.setattr("romdam.contact.laws.catalogue.try_law", lambda *rest: None)
    monkeypatch.setattr("romdam.config.sections.joint_laws.try_law", lambda *rest: None)
    with pytest.raises(
        ConvergenceError, match=f"{name} of law own_laws.RateFriction (raises|gives)"
    ) as caught:
        run(load_config(written(tmp_path, KEYS, source)), tmp_path / "out")
    assert "of joint contraction, with parameters [0.6, 0.4, 0.01]" in str(caught.value)
    assert not list((tmp_path / "out").glob("*.nc"))


def test_a_law_that_fails_under_generalised_alpha(tmp_path):
    path = written(tmp_path, KEYS, failing("an exception in limit")[1])
    raw = yaml.safe_load(path.read_text())
    raw["transient"]["integrator"] = "generalized_alpha"
    path.write_text(yaml.safe_dump(raw))
    with pytest.raises(
        ConvergenceError, match=r"raises ValueError \(too fast\) at gap \d+ of joint contraction"
    ):
        run(load_config(path), tmp_path / "out")


def test_a_law_that_refuses_a_joints_values_is_refused_with_the_configuration(tmp_path):
    bound = "    if parameters[1] > 0.5:\n            raise ValueError('at most 0.5')\n        "
    source = RATE.replace(ANCHORS["limit"], bound + ANCHORS["limit"].strip())
    assert load_config(written(tmp_path, KEYS, source))
    with pytest.raises(
        ConfigError, match=r"joints.contraction: .*limit cannot be called: ValueError: at most 0.5"
    ):
        load_config(written(tmp_path, KEYS | {"rate_mu_d": 0.55}, source))


def test_in_a_suite_only_the_runs_whose_law_fails_are_failed(tmp_path):
    fast = "    if memory[0] > 0.0 and parameters[2] > 0.01:\n            raise ValueError('no')\n        "
    path = written(tmp_path, KEYS, RATE.replace(ANCHORS["limit"], fast + ANCHORS["limit"].strip()))
    raw = yaml.safe_load(path.read_text())
    vary = {"v": {"path": "joints.contraction.rate_v_c", "values": [0.005, 0.02]}}
    path.write_text(yaml.safe_dump(raw | {"pipeline": "suite", "suite": {"parameters": vary}}))
    outcome = romdam.run_suite(load_config(path), tmp_path / "out", SuiteOptions(workers=1))
    assert (
        outcome.summary.status.sel(sample=1).values.all() and not outcome.summary.status.sel(sample=0).any()
    )
    assert all(
        "limit of law own_laws.RateFriction raises ValueError (no)" in text
        for text in outcome.failures.values()
    )
    assert FAILED > DONE
