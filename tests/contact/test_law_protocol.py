"""Laws as a stranger adds them: declared once, checked, read from a file of one's own, run."""

import copy
import inspect
import os
import py_compile
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
import xarray as xr
import yaml

from romdam.config import load_config
from romdam.config.parameters import find_varied_key, si_value
from romdam.contact.laws import LAWS
from romdam.contact.laws.catalogue import find_law
from romdam.contact.laws.compiled import call, compiled
from romdam.contact.laws.coulomb import Coulomb
from romdam.contact.laws.law import MU_J, MU_K
from romdam.contact.problem import gap_problem
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.system import GapLaw
from romdam.pipelines.run import run
from romdam.pipelines.suites.run import SuiteOptions, run_suite

EXAMPLE = Path(__file__).parents[2] / "configs" / "two_cantilevers.yaml"
RATE = '''
import math

from romdam.contact import Law, Parameter
from romdam.contact.laws.law import DT, MU_J, MU_K, RATE


class RateFriction(Law):
    """mu = mu_d + (mu_s - mu_d) exp(-|v| / v_c)."""

    parameters = (
        Parameter("rate_mu_s", "", most=2.0, required=True),
        Parameter("rate_mu_d", "", most=2.0, required=True),
        Parameter("rate_v_c", "m/s", above=True, required=True),
    )
    memory = ("rate",)
    shear = True
    follows_step = True

    @staticmethod
    def limit(parameters, memory, step, limit):
        rate = step[RATE] if step[DT] > 0.0 else memory[0]
        fall = math.exp(-rate / parameters[2])
        mu = parameters[1] + (parameters[0] - parameters[1]) * fall
        limit[MU_J], limit[MU_K] = mu, mu

    @staticmethod
    def commit(parameters, memory, step):
        memory[0] = step[RATE]
'''
VARIED = "joints.contraction.rate_v_c"
KEYS = {"law": "own_laws.RateFriction", "rate_mu_s": 0.6, "rate_mu_d": 0.4, "rate_v_c": "10 mm/s"}


def written(folder, joint, source=RATE):
    """A short job with these keys in its joint, and the user's file beside it."""
    raw = yaml.safe_load(EXAMPLE.read_text())
    data = EXAMPLE.parent
    for record in raw["records"]:
        record["file"] = str((data / record["file"]).resolve())
    raw["joints"]["contraction"] |= {"shear_stiffness": "8 GPa/m"} | joint
    raw["transient"] = {"finest_step": "2.5 ms", "duration": "1.0 s"}
    raw["outputs"] = {"error_estimate": False, "plots": False}
    raw["model"] = {"order": "reduced", "modes": 5}
    (folder / "own_laws.py").write_text(source)
    (folder / "dam.yaml").write_text(yaml.safe_dump(raw))
    return folder / "dam.yaml"


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_a_law_declares_itself_whole(law):
    assert inspect.getdoc(law)
    assert law.key_names() and len({p.name for p in law.parameters}) == len(law.parameters)
    assert bool(law.array) or law.limit is not None
    assert law.release is None or law.memory
    for name, last in (("limit", ["step", "limit"]), ("release", ["step"]), ("commit", ["step"])):
        function = getattr(law, name)
        assert function is None or [*inspect.signature(function).parameters] == [
            "parameters",
            "memory",
            *last,
        ]


def test_a_law_of_a_users_file_runs_as_the_same_one_inside(tmp_path):
    own, inside = tmp_path / "own", tmp_path / "inside"
    own.mkdir(), inside.mkdir()
    within = {"velocity_friction": {"mu_s": 0.6, "mu_d": 0.4, "v_c": "10 mm/s"}}
    results = [
        xr.load_dataset(run(load_config(written(folder, joint)), tmp_path / "out" / folder.name).paths[0])
        for folder, joint in ((own, KEYS), (inside, within))
    ]
    assert np.abs(results[0].slip).max() > 0.0
    for name in ("opening", "slip", "shear_force"):
        assert np.array_equal(results[0][name], results[1][name]), name


def test_a_users_law_is_of_the_configuration_and_its_file_of_the_digest(tmp_path):
    path = written(tmp_path, KEYS)
    job = load_config(path)
    (law,) = job.config.joints["contraction"].law
    assert law.values == {"rate_mu_s": 0.6, "rate_mu_d": 0.4, "rate_v_c": 0.01}
    assert str(tmp_path) not in job.config.model_dump_json()
    assert load_config(path).digest == job.digest
    other = written(tmp_path, KEYS | {"rate_mu_d": 0.3})
    assert load_config(other).digest != job.digest
    path = written(tmp_path, KEYS, RATE.replace("step[RATE] if", "+step[RATE] if"))
    assert load_config(path).digest != job.digest


def test_a_suite_may_vary_what_a_users_law_declares(tmp_path):
    config = load_config(written(tmp_path, KEYS)).config
    place = find_varied_key(config, "joints.contraction.rate_v_c", "v", "dam.yaml")
    assert place.units == "m s-1" and si_value(place, "5 mm/s", "v", "dam.yaml") == pytest.approx(0.005)
    with pytest.raises(ConfigError, match="greater than 0"):
        si_value(place, 0.0, "v", "dam.yaml")


MISTAKES = [
    ({"law": "own_laws.Nothing"}, RATE, "has no class of that name"),
    ({"law": "elsewhere.RateFriction"}, RATE, "cannot read"),
    ({"law": "RateFriction"}, RATE, "module.Class"),
    ({"law": ["own_laws.RateFriction"] * 2}, RATE, "names a class twice"),
    ({"rate_mu_s": -1.0}, RATE, "rate_mu_s must be at least 0, got -1"),
    ({"rate_mu_s": "3 m"}, RATE, "rate_mu_s"),
    ({"rate_mu": 0.1}, RATE, "rate_mu is not a known key"),
    ({"rate_v_c": None}, RATE.replace("", ""), "rate_v_c"),
    ({}, RATE + "\nraise KeyError('x')\n", "cannot be run: KeyError"),
    ({}, RATE + "\nraise SystemExit\n", "cannot be run: SystemExit"),
    ({}, RATE + "\nsyntax error\n", "cannot be run: SyntaxError"),
    ({}, RATE.replace('"rate_mu_s"', '"friction"'), "is a key of joints already"),
    ({}, RATE.replace('"m/s"', '"furlong"'), "unit 'furlong' is not known"),
    ({}, RATE.replace("def limit", "def bound"), "without the function `limit`"),
    (
        {},
        RATE.replace("memory, step):", "memory, opening, sliding, rate_j, rate_k):"),
        "commit must be commit(parameters, memory, step), as from version 0.3 on",
    ),
    ({"shear_stiffness": 0.0}, RATE, "needs `shear_stiffness`"),
    ({}, RATE.replace("    shear = True\n", ""), "bounds the shear, which no gap carries"),
    (
        {},
        RATE.replace("memory[0] = step", "memory[1] = step"),
        "commit cannot be called: IndexError",
    ),
]


@pytest.mark.parametrize(("joint", "source", "message"), MISTAKES, ids=[m[2] for m in MISTAKES])
def test_what_a_users_law_gets_wrong_is_one_clear_error(tmp_path, joint, source, message):
    with pytest.raises(ConfigError) as caught:
        load_config(written(tmp_path, copy.deepcopy(KEYS) | joint, source))
    assert message in str(caught.value) and "joints.contraction" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_function_that_does_not_compile_is_named(tmp_path):
    source = RATE.replace("mu = parameters[1]", "mu = parameters.tolist()[1]")
    job = load_config(written(tmp_path, KEYS, source))
    law = find_law(next(iter(job.config.joints["contraction"].law)).source)
    with pytest.raises(ConfigError, match=r"own_laws.py: RateFriction.limit cannot be compiled"):
        compiled([law])


@pytest.mark.slow
def test_workers_of_a_suite_know_a_users_law(tmp_path):
    path = written(tmp_path, KEYS)
    raw = yaml.safe_load(path.read_text())
    raw |= {"pipeline": "suite", "suite": {"parameters": {"v": {"path": VARIED, "values": [0.005, 0.02]}}}}
    path.write_text(yaml.safe_dump(raw))
    alone, together = (
        run_suite(load_config(path), tmp_path / f"out{n}", SuiteOptions(workers=n)).summary for n in (1, 2)
    )
    assert np.allclose(alone.peak_slip, together.peak_slip, rtol=1e-9)
    assert len(np.unique(alone.peak_slip)) == alone.peak_slip.size > 1


ENDLESS = (
    RATE
    + """
    @staticmethod
    def release(parameters, memory, step):
        return True
"""
)


def test_a_law_that_never_ends_giving_up_does_not_hang(tmp_path):
    with pytest.raises(ConvergenceError, match="gap 0 of joint contraction"):
        run(load_config(written(tmp_path, KEYS, ENDLESS)), tmp_path / "out")


def test_friction_alone_is_what_its_law_puts(monkeypatch):
    """The step of a scene with friction only knows no law, but takes its limit from one."""
    ones, mu = np.ones(3), np.array([[0.6, 0.6], [0.3, 0.5], [0.6, 0.6]])
    law = GapLaw(1e9 * ones, 0 * ones, 1e9 * ones, mu, 0 * ones, {})
    assert (gap_problem(1e-9 * np.eye(9), law).mu == mu).all()

    def half(parameters, memory, step, limit):
        limit[MU_J], limit[MU_K] = 0.5 * parameters[0], 0.5 * parameters[1]

    monkeypatch.setattr(Coulomb, "limit", staticmethod(half))
    assert (gap_problem(1e-9 * np.eye(9), law).mu == 0.5 * mu).all()


NOTED = (
    "from __future__ import annotations\n\nfrom dataclasses import dataclass\n\nimport numba\n"
    + RATE.replace("memory[0] = step[RATE]", "memory[0] = math.sqrt(square(step[RATE], 0.0))")
    + """

@dataclass
class Note:
    text: str = ""


@numba.njit(cache=True)
def square(j, k):
    return 1.0 * (j**2 + k**2)
"""
)


def rate_after(path):
    """What a gap keeps as its rate after 3 and 4 m/s, as compiled."""
    law = find_law(next(iter(load_config(path).config.joints["contraction"].law)).source)
    commit = compiled([law]).commit[0]
    step = np.array([0.0, 0.0, 3e-3, 4e-3, 5.0, 1e-3, 0.0, 1.0])
    kept, calls = np.zeros(2), numba.njit(lambda f, row, kept, step: call(f, row, kept, step))
    calls(commit, np.ones(3), kept, step)
    return kept[0]


def test_what_runs_are_the_bytes_that_were_hashed(tmp_path):
    """Two contents of one size and one time, in one process: no cache may mix them, Python's or numba's."""
    digests, rates = [], []
    for factor in ("1.0", "4.0", "1.0"):
        path = written(tmp_path, KEYS, NOTED.replace("1.0 * (j", f"{factor} * (j"))
        os.utime(tmp_path / "own_laws.py", (1.6e9, 1.6e9))
        digests.append(load_config(path).digest)
        rates.append(rate_after(path))
    assert rates == [5.0, 10.0, 5.0]
    assert digests[0] == digests[2] != digests[1]
    assert sorted(each.name for each in tmp_path.iterdir()) == ["dam.yaml", "own_laws.py"]


def test_a_stale_bytecode_file_is_not_run(tmp_path):
    """Bytecode of another content of the same size and second, as Python itself would leave it."""
    path, file = written(tmp_path, KEYS, RATE + "\nraise KeyError('old')\n"), tmp_path / "own_laws.py"
    os.utime(file, (1.6e9, 1.6e9))
    py_compile.compile(str(file))
    file.write_text(RATE + "\nraised = KeyError, 1\n".rjust(len("\nraise KeyError('old')\n")))
    os.utime(file, (1.6e9, 1.6e9))
    load_config(path)


def test_a_file_that_failed_leaves_no_module(tmp_path):
    path = written(tmp_path, KEYS, RATE + "\nraise KeyError('x')\n")
    for _ in range(2):
        before = set(sys.modules)
        with pytest.raises(ConfigError, match="cannot be run: KeyError"):
            load_config(path)
        assert not {name for name in set(sys.modules) - before if name.startswith("romdam_law_")}
