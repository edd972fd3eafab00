"""Names of before: read with a warning that tells the present one, and the same configuration."""

import copy
from pathlib import Path

import pytest
import yaml

import romdam
from romdam.config import renamed
from romdam.config.load import parse_config
from romdam.config.renamed import with_present_names
from romdam.core.errors import ConfigError
from romdam.pipelines.job_warnings import job_warnings

EXAMPLE = Path(__file__).parents[2] / "configs" / "two_cantilevers.yaml"
BEFORE = {  # section -> what stood in it before, and what stands in it now
    "transient": ({"dt": "2.5 ms"}, {"finest_step": "2.5 ms"}),
    "outputs": ({"every": "0.01 s"}, {"output_interval": "0.01 s"}),
    "model": ({"modes": 60, "corrections": 20}, {"modes": 60, "residual_vectors": 20}),
    "loads": ({"initial_state": "from_start"}, {"initial_state": "undeformed"}),
    "study": (
        {"dt": ["1 ms"], "reference_dt": "0.1 ms", "corrections": [0, 5]},
        {"finest_steps": ["1 ms"], "reference_step": "0.1 ms", "residual_vectors": [0, 5]},
    ),
    "suite": ({"keep": {"every": "0.05 s"}}, {"keep": {"output_interval": "0.05 s"}}),
}
TOLD = [
    "transient.dt is called transient.finest_step now",
    "outputs.every is called outputs.output_interval now",
    "suite.keep.every is called suite.keep.output_interval now",
    "model.corrections is called model.residual_vectors now",
    "loads.initial_state: from_start is called undeformed now",
]


def spelt(which: int) -> dict:
    return copy.deepcopy(
        yaml.safe_load(EXAMPLE.read_text()) | {name: now[which] for name, now in BEFORE.items()}
    )


def test_both_spellings_are_one_configuration_with_one_digest(tmp_path):
    jobs = []
    for which in range(2):
        path = tmp_path / f"{which}.yaml"
        path.write_text(yaml.safe_dump(spelt(which)))
        jobs.append(romdam.load_config(path))
    assert jobs[0].config == jobs[1].config
    assert jobs[0].digest == jobs[1].digest
    told = job_warnings(jobs[0], [])
    for line in TOLD:
        assert any(f": {line}" in one for one in told), line
    assert jobs[1].renamed == ()


def test_a_stored_configuration_is_read_by_its_names_of_before():
    assert parse_config(spelt(0), "result.nc: configuration") == parse_config(spelt(1), "now")


@pytest.mark.parametrize(
    ("section", "parts"),
    [
        ("transient", ["transient.dt", "transient.finest_step", "'2.5 ms'", "'1 ms'", "remove transient.dt"]),
        ("suite", ["suite.keep.every", "suite.keep.output_interval", "remove suite.keep.every"]),
    ],
)
def test_a_key_by_both_its_names_is_refused(section, parts):
    raw = spelt(1)
    both = raw[section]["keep"] if section == "suite" else raw[section]
    both |= {"every": "0.1 s"} if section == "suite" else {"dt": "2.5 ms", "finest_step": "1 ms"}
    with pytest.raises(ConfigError) as error:
        parse_config(raw, "dam.yaml")
    for part in ("dam.yaml", *parts):
        assert part in str(error.value)


def test_paths_through_names_and_lists(monkeypatch):
    monkeypatch.setattr(renamed, "KEYS", {"joints.*.mu": "friction", "suites.*.at": "place"})
    monkeypatch.setattr(renamed, "WORDS", {"joints.*.law": {"glued": "bonded"}})
    raw = {
        "joints": {"J1": {"mu": 0.6, "law": "glued"}, "J2": {"law": "open"}, "J3": 3},
        "suites": [{"at": 1}],
    }
    before = copy.deepcopy(raw)
    made, told = with_present_names(raw, "dam.yaml")
    assert raw == before
    assert made == {
        "joints": {"J1": {"friction": 0.6, "law": "bonded"}, "J2": {"law": "open"}, "J3": 3},
        "suites": [{"place": 1}],
    }
    assert [line.split(" is called")[0] for line in told] == [
        "joints.J1.mu",
        "suites[0].at",
        "joints.J1.law: glued",
    ]


@pytest.mark.parametrize(
    "raw", [None, 3, [], "text", {"transient": None}, {"transient": ["dt"]}, {"model": 3}]
)
def test_what_is_no_mapping_is_left_to_the_validation(raw):
    assert with_present_names(raw, "dam.yaml") == (raw, ())
