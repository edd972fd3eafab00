"""The certificate from a sample covers that of the whole record, and is the same wherever it is made."""

import numpy as np
import pytest
import yaml
from test_cli import SMALL, call
from threadpoolctl import threadpool_limits

from romdam.config import load_config
from romdam.core.errors import ResultError
from romdam.core.system import History
from romdam.error.sampled import sample_windows
from romdam.pipelines.error import certify as pipeline
from romdam.pipelines.run import run

FRICTION = {"gap": {"friction": 0.6, "shear_stiffness": "8 GPa/m"}}
CASES = {
    "penalty": ({}, {"modes": 10}, 0),
    "few modes": ({}, {"modes": 4}, 1),
    "rigid": ({"gap": {"normal_stiffness": "rigid"}}, {"modes": 8}, 2),
    "friction": (FRICTION, {"modes": 10}, 3),
}


def shaking(seed, seconds=15.0):
    """Noise of 2 to 8 Hz that swells and fades [m/s2]."""
    time, random = np.arange(0.0, seconds, 0.01), np.random.default_rng(seed)
    waves = random.uniform(2.0, 8.0, 20), random.uniform(0.0, 2.0 * np.pi, 20)
    noise = np.sin(2.0 * np.pi * np.outer(time, waves[0]) + waves[1]).sum(axis=1)
    return 0.8 * noise * (time / 4.0) * np.exp(1.0 - time / 4.0)


def result_of(folder, joints, model, seed, nodes=True):
    raw = yaml.safe_load(SMALL)
    for name, more in joints.items():
        raw["joints"][name] |= more
    raw["model"] |= model
    for block in raw["blocks"].values() if nodes else ():  # so that the finer model is not the mesh itself
        block["box"]["element_size"] = 2.5
    raw["outputs"] |= {"plots": False} | ({} if nodes else {"nodes": {}})
    np.savetxt(folder / "pulse.txt", shaking(seed))
    (folder / "small.yaml").write_text(yaml.safe_dump(raw))
    return run(load_config(folder / "small.yaml"), folder / "out").paths[0]


@pytest.fixture(scope="module")
def penalty(tmp_path_factory):
    return result_of(tmp_path_factory.mktemp("penalty"), *CASES["penalty"])


QUICK = "friction"  # of the cases; the others are slow


@pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[] if name == QUICK else [pytest.mark.slow]) for name in CASES]
)
def test_the_interval_covers_the_whole_record(case, tmp_path):
    path = result_of(tmp_path, *CASES[case])
    sample, whole = (pipeline.certify(path, passes=passes).statement for passes in (None, 1))
    assert 0.3 < sample.details["sampled_share"] < 0.85
    for quantity, error in whole.errors.items():
        for measure in ("l2", "peak"):
            low, high = sample.details["within"][quantity][measure]
            assert low <= getattr(error, measure) <= high, (quantity, measure)
    low, high = sample.details["within"]["opening"]["l2"]
    assert high < 3.0 * whole.errors["opening"].l2 and low > 0.0


@pytest.mark.slow
def test_no_displacement_is_certified_where_none_is_written(tmp_path):
    path = result_of(tmp_path, *CASES["penalty"], nodes=False)
    for passes in (None, 1):
        stated = pipeline.certify(path, passes=passes).statement
        assert set(stated.errors) == {"opening", "energy"} and "displacement" not in stated.sentence
        assert "strain energy by" in stated.sentence


@pytest.mark.slow
def test_the_command_tells_the_cost_first_and_the_interval(penalty):
    code, out, err = call("certify", penalty)
    assert code == 0, err
    assert out.index("solutions with the mesh's") < out.index("Certificate, from a sample")
    assert "`romdam certify --full` solves it in all" in out.replace("\n", " ")
    code, out, err = call("certify", penalty, "--full")
    assert (
        code == 0 and "over 100 % of the record" in out and "Certificate, 15 s" in out.replace("14.99", "15")
    )


def test_the_windows_are_the_peak_s_and_always_the_same_other_one():
    time = np.arange(4001) * 0.01
    jump = np.zeros((4001, 2, 1))
    jump[2000, 1] = 1.0
    none = np.zeros(0)
    gaps = {"jump": jump, "traction": none, "mean_traction": none, "state": none}
    history = History(time, none, none, none, None, {}, {}, {}, "adaptive", **gaps)
    first, other = sample_windows(history)
    assert (first.stop - first.start, other.stop - other.start) == (601, 601)
    assert first.start == 2050 - 600 and (other.stop - 1 <= first.start or other.start >= first.stop - 1)
    assert sample_windows(history) == [first, other]


@pytest.mark.slow
def test_a_sample_does_not_depend_on_the_threads(penalty):
    usual = pipeline.certify(penalty).statement.details["within"]
    for threads in (1, 2):
        with threadpool_limits(threads):
            assert pipeline.certify(penalty).statement.details["within"] == usual


def test_what_cannot_be_certified_is_refused_before_anything_is_reduced(penalty, monkeypatch):
    monkeypatch.setattr(pipeline, "reduced_model", None)
    monkeypatch.setattr(pipeline.StoredRun, "refuse_other", refuse)
    with pytest.raises(ResultError, match="another scene"):
        pipeline.certify(penalty)


def refuse(self, position, unknowns):
    raise ResultError("another scene")
