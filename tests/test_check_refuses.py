"""`romdam check` refuses what `romdam run` and its like refuse before their first step, in the same words."""

import pytest
import yaml
from test_cli import SMALL, call, config  # noqa: F401

import romdam
from romdam.core.errors import RomdamError
from romdam.pipelines.error.comparison import compare
from romdam.pipelines.error.study import study
from romdam.pipelines.suites.run import SuiteOptions, run_suite

SHEAR = {"gap": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "shear_stiffness": "8 GPa/m"}}


def varied(path, *values):
    return {
        "pipeline": "suite",
        "joints": SHEAR,
        "suite": {"parameters": {"p": {"path": path, "values": [*values]}}},
    }


def with_variant(**changes):
    return {"pipeline": "comparison", "comparison": {"variants": {"a": {}, "b": changes}}}


REFUSED = {
    "a pattern that is no name": (varied("joints.x*.friction", 0.5, 0.7), "no joint is like 'x*'"),
    "Poisson's ratio": (varied("materials.concrete.nu", 0.1, 0.2), "materials.concrete.nu"),
    "the level where there is no water": (varied("water.level", 5.0, 6.0), "water.level"),
    "a value out of range": (varied("joints.gap.friction", 0.5, -0.7), "friction"),
    "a suite at full order": (
        {"pipeline": "suite", "model": {"order": "full"}, "suite": {"scales": [1.0]}},
        "a suite needs a reduced model",
    ),
    "a table that is not there": (
        {
            "pipeline": "suite",
            "suite": {"parameters": {"p": {"path": "joints.gap.friction"}}, "design": {"table": "none.csv"}},
        },
        "none.csv",
    ),
    "a variant without joints": (
        with_variant(joints={}) | {"outputs": {"plots": False}},
        "neither joints nor outputs.nodes",
    ),
    "automatic modes without an estimate": (
        {"model": {"modes": "auto"}, "transient": {"accuracy": "1 %"}, "outputs": {"error_estimate": False}},
        "modes: auto needs joints, damping and outputs.error_estimate",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_check_and_run_refuse_the_same_in_the_same_words(case, config, tmp_path):  # noqa: F811
    changes, message = REFUSED[case]
    raw = yaml.safe_load(SMALL) | changes
    config.write_text(yaml.safe_dump(raw))
    messages = []
    runs = {
        "suite": lambda: run_suite(config, tmp_path / "o", SuiteOptions(workers=1)),
        "comparison": lambda: compare(config, tmp_path / "o"),
    }
    for does in (
        lambda: romdam.check(config),
        runs.get(raw.get("pipeline"), lambda: romdam.run(config, tmp_path / "o")),
    ):
        with pytest.raises(RomdamError) as raised:
            does()
        messages.append(str(raised.value))
    assert messages[0] == messages[1]
    assert message in messages[0]


def test_the_command_ends_with_2(config):  # noqa: F811
    config.write_text(yaml.safe_dump(yaml.safe_load(SMALL) | varied("materials.concrete.nu", 0.1)))
    code, out, err = call("check", config)
    assert code == 2 and "is valid" not in out and "materials.concrete.nu" in err


def test_a_study_that_is_named_is_refused_as_the_study_does(config, tmp_path):  # noqa: F811
    changes = {"study": {"modes": [5]}, "model": {"order": "full"}}
    config.write_text(yaml.safe_dump(yaml.safe_load(SMALL) | changes))
    job = romdam.load_config(config)
    for does in (lambda: romdam.check(job), lambda: study(job, tmp_path / "o")):
        with pytest.raises(RomdamError, match=r"model\.order is full, a study is about reduced models"):
            does()


def test_a_dam_that_does_not_rest_is_refused(config, tmp_path):  # noqa: F811
    """A block on a slope steeper than its friction slides under its weight."""
    raw = yaml.safe_load(SMALL)
    raw["loads"] = {"gravity": [0, 8.0, -5.0]}
    raw["supports"] = raw["supports"][:1]
    raw["blocks"]["right"]["box"] = {"origin": [0, -5, 20], "size": [5, 5, 5], "element_size": 5}
    raw["joints"] = {"gap": SHEAR["gap"] | {"friction": 0.2}}
    raw["outputs"] = {}
    config.write_text(yaml.safe_dump(raw))
    messages = []
    for does in (romdam.check, lambda path: romdam.run(path, tmp_path / "o")):
        with pytest.raises(RomdamError) as raised:
            does(config)
        messages.append(str(raised.value))
    assert messages[0] == messages[1]


def test_a_variant_that_fails_is_a_warning_and_the_reference_is_refused(config, tmp_path):  # noqa: F811
    """As in a comparison, which goes on without any variant but its reference."""
    raw = yaml.safe_load(SMALL) | {"pipeline": "comparison"}
    raw["outputs"] |= {"plots": False, "error_estimate": False}
    variants = {
        "a": {},
        "b": {"outputs.nodes.top.at": [0, 0, 900]},
        "c": {"joints.gap.normal_stiffness": 8e9},
    }
    raw["comparison"] = {"variants": variants, "reference": "a"}
    config.write_text(yaml.safe_dump(raw))
    done = compare(config, tmp_path / "o")
    ((name, message),) = done.failures.items()
    warnings = romdam.check(config).warnings
    assert name == "b" and "outputs.nodes" in message and f"b: {message}" in warnings
    raw["comparison"]["reference"] = "b"
    config.write_text(yaml.safe_dump(raw))
    for does in (romdam.check, lambda path: compare(path, tmp_path / "p")):
        with pytest.raises(RomdamError) as raised:
            does(config)
        assert str(raised.value) == message
