"""Every path that a suite may vary makes the job that a file with the value written in makes."""

import json
import math
from typing import Any

import numpy as np
import pytest
import yaml
from arch_dams import arch_dam
from gravity_dams import gravity_dam
from suite_jobs import BASE, made, summary, write_job

from romdam.config import parse_config
from romdam.config.job import Config
from romdam.config.parameters import find_varied_key, replace_values, varied_paths, vary
from romdam.contact.laws import LAWS
from romdam.contact.laws.law import Parameter
from romdam.core.errors import ConfigError

LAW = '''
"""Friction that is lost with the opening, and one that wears."""
from typing import Any

from romdam.contact.laws.law import MU_J, MU_K, OPENING, Law, Parameter


class Asperities(Law):
    section = "asperities"
    parameters = (
        Parameter("mu_rough", "", most=2.0, default=1.5),
        Parameter("mu_smooth", "", most=2.0, default=0.8),
        Parameter("height", "m", above=True),
    )
    memory = ("lost",)
    shear = True

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        mu = parameters[1] if memory[0] > 0.0 else parameters[0]
        limit[MU_J], limit[MU_K] = mu, mu

    @staticmethod
    def commit(parameters: Any, memory: Any, step: Any) -> None:
        if step[OPENING] > parameters[2]:
            memory[0] = 1.0


class Plain(Law):
    parameters = (Parameter("mu_own", "", most=2.0, default=0.9), Parameter("wear", "m", default=0.1))
    shear = True

    @staticmethod
    def limit(parameters: Any, memory: Any, step: Any, limit: Any) -> None:
        limit[MU_J], limit[MU_K] = parameters[0], parameters[0]
'''
JOINT = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "shear_stiffness": "8 GPa/m"}
USERS = {
    "law": ["rough.Asperities", "rough.Plain"],
    "asperities": {"mu_rough": 0.05, "mu_smooth": 0.01, "height": "1 mm"},
    "wear": "3 mm",
}
PLANE = {"plane": {"point": [0, 5, 0], "normal": [0, 1, 0]}}
FACES = [{"block": "right", "face": "ymax"}]
CONCRETE = {**BASE["materials"]["concrete"], "expansion": 1e-5}


def number(parameter: Parameter) -> float:
    """A value that a law's parameter may have, unlike those of the other parameters."""
    spread = 0.01 * (1 + sum(map(ord, parameter.name)) % 7)
    least = parameter.least if math.isfinite(parameter.least) else 0.0
    return least + (spread if parameter.most is None else 0.3 * (parameter.most - least) * (1.0 + spread))


def outcome(make: Any) -> Config | None:
    try:
        return make()
    except ConfigError:
        return None


def joint_of(law: Any) -> dict[str, Any]:
    """A joint with a law, all of its keys written."""
    keys: dict[str, Any] = {}
    for p in law.parameters:
        keys[p.name] = ["j"] if p.unit == "axes" else p.choices[0] if p.choices else number(p)
    joint = {**JOINT, **({law.section: keys} if law.section else keys)}
    with_friction = BASE | {"joints": {"gap": joint | {"friction": 0.4}}}
    return joint | ({"friction": 0.4} if outcome(lambda: parse_config(with_friction, "job.yaml")) else {})


def jobs() -> dict[str, dict[str, Any]]:
    """Jobs that have every section with a number that can be varied."""
    base = {key: value for key, value in BASE.items() if key != "pipeline"}
    dams = {"records": base["records"], "model": {"modes": 3}, "transient": base["transient"]}
    left = [{"block": "left", "face": "ymin"}]
    loads = {
        "hydrostatic": [
            {"level": 15, "faces": FACES},
            {"level": 7, "faces": left},
        ],
        "joint_water": [{"level": 9, "joints": ["gap"]}],
        "temperature": [{"change": "-4 K", "blocks": ["left"]}],
    }
    result = {
        "users": base | {"joints": {"gap": JOINT | USERS, "other": JOINT | {"friction": [0.3, 0.4]}}},
        "loads": base | {"loads": loads, "materials": {"concrete": CONCRETE}},
        "coefficients": base | {"damping": {"rayleigh": {"alpha": 1.0, "beta": "1 ms"}}},
        "modal": base | {"damping": {"modal": [0.05, 0.02]}},
        "tables": base | {"joints": {"gap": JOINT | {
            "normal_stiffness": {"per_gap": "1 GN/m"}, "gap": {"table": "gaps.csv"}, "friction": 0.5,
            "field": {"of": ["friction"], "coefficient_of_variation": 0.3, "length": "4 m"}}}},
        "attached": base | {
            "anchors": {
                "bar": {"head": {"block": "left", "at": [2, -2, 20]}, "foot": [2, -2, -5], "E": 2e11,
                        "area": "30 cm2", "pretension": 1e6, "loss": 0.1},
                "tendon": {"head": {"block": "right", "at": [2, 6, 18]}, "foot": [2, 9, -5],
                           "stiffness": 4e7},
            },
            "masses": {"gate": {"block": "right", "face": "ymax", "mass": "300 t"}}},
        "water": base | {"water": {"level": 12, "faces": FACES, "model": "westergaard"}},
        "cut": base | {"cut": {"right": {"along": [PLANE], "into": ["near.side", "far"],
                                         "joints": {k: v for k, v in JOINT.items() if k != "between"}}},
                       "joints": {"gap": JOINT | {"between": ["left", "near.side"], "friction": 0.2}},
                       "supports": [{"block": b, "face": "zmin"} for b in ("left", "near.side", "far")],
                       "outputs": {}},
        "gravity dam": gravity_dam() | dams,
        "arch dam": arch_dam() | dams,
    }  # fmt: skip
    return result | {law.__name__: base | {"joints": {"gap": joint_of(law)}} for law in LAWS}


JOBS = jobs()


def written_in(raw: dict[str, Any], path: str, value: object) -> dict[str, Any]:
    """The mapping of a file with a value where a path leads; names may have points."""
    raw = json.loads(json.dumps(raw))  # sections that two keys share are two
    target: Any = raw
    while True:
        names = target if isinstance(target, dict) else map(str, range(len(target)))
        key = next((name for name in names if path.startswith(f"{name}.")), path.partition(".")[0])
        rest = path.removeprefix(key).removeprefix(".")
        at: Any = key if isinstance(target, dict) else int(key)
        if not rest:
            target[at] = value
            return raw
        if isinstance(target, dict) and not isinstance(target.get(key), dict | list):
            target[key] = {}  # a section that is not there, or a number in its place
        target, path = target[at], rest


def candidates(key: Any, current: Config) -> list[float]:
    """Values of which some at least are allowed."""
    if key.parameter is None:
        return [0.031, 7.25]
    return [number(key.parameter) * 1.07, 0.23]


@pytest.mark.parametrize("name", JOBS)
def test_every_path_makes_the_configuration_of_a_file_with_the_value(tmp_path, name):
    (tmp_path / "rough.py").write_text(LAW)
    source = str(tmp_path / "job.yaml")
    config = parse_config(JOBS[name], source)
    paths = [path for path in varied_paths(config) if _stands_in_a_file(config, path)]
    if name == "users":  # a file with laws takes 0.1 s to read, and other jobs have the keys of romdam's laws
        starts = ("damping", "materials", "joints.other.friction", "joints.gap.normal")
        users = {"mu_own", "wear", "asperities"}
        paths = [path for path in paths if users & {*path.split(".")} or path.startswith(starts)]
    accepted = set()
    for path in paths:
        key = find_varied_key(config, path, "x", source)
        for value in candidates(key, config):
            varied = outcome(lambda key=key, v=value: vary(config, {"x": key}, {"x": v}, source).config)
            raw = written_in(JOBS[name], path, value)
            written = outcome(lambda raw=raw: parse_config(raw, source))
            assert varied == written, (path, value)
            if varied is not None:
                accepted.add(path)
                assert varied.model_dump(exclude_unset=True) == written.model_dump(exclude_unset=True)
    assert len(accepted) >= 6  # what is refused by both is no comparison
    laws = [law for law in LAWS if law.__name__ == name]
    for law in laws:  # all of its numbers are among them
        keys = {f"joints.gap.{law.section}.{p.name}".replace("..", ".") for p in law.parameters
                if p.unit != "axes" and not p.choices}  # fmt: skip
        assert keys <= accepted


def _stands_in_a_file(config: Config, path: str) -> bool:
    """Whether a file can have it: joints of dams and cuts stand in the section that makes them."""
    return not path.startswith("joints.") or any(path.startswith(f"joints.{name}.") for name in config.joints)


@pytest.mark.parametrize("name", JOBS)
def test_a_configuration_with_its_own_values_is_itself(tmp_path, name):
    (tmp_path / "rough.py").write_text(LAW)
    config = parse_config(JOBS[name], str(tmp_path / "job.yaml"))
    again = replace_values(config, {("title",): config.title}, "job.yaml")
    assert again.model_dump(exclude={"title"}) == config.model_dump(exclude={"title"})
    for material, section in config.materials.items():
        assert replace_values(config, {("materials", material, "nu"): section.nu}, "job.yaml") == config


def test_a_key_that_only_some_joints_have_is_refused(tmp_path):
    (tmp_path / "rough.py").write_text(LAW)
    source = str(tmp_path / "job.yaml")
    config = parse_config(JOBS["users"], source)
    with pytest.raises(ConfigError, match="belongs to a law that other of the joints does not have"):
        find_varied_key(config, "joints.*.asperities.height", "x", source)


def test_a_key_of_two_laws_is_one_parameter_only_where_it_means_the_same(tmp_path):
    (tmp_path / "rough.py").write_text(LAW)
    (tmp_path / "other.py").write_text(LAW.replace('Parameter("wear", "m"', 'Parameter("wear", "Pa"'))
    joints = {
        "a": JOINT | {"law": "rough.Plain", "wear": "3 mm"},
        "b": JOINT | {"law": "other.Plain", "wear": "3 MPa"},
    }
    source = str(tmp_path / "job.yaml")
    config = parse_config(JOBS["users"] | {"joints": joints}, source)
    assert find_varied_key(config, "joints.a.wear", "x", source).units == "m"
    assert find_varied_key(config, "joints.b.wear", "x", source).units == "Pa"
    with pytest.raises(ConfigError, match="of different laws in joints a and b"):
        find_varied_key(config, "joints.*.wear", "x", source)


def test_two_values_of_one_section_are_put_in_together():
    """alpha and beta would each be refused alone where the file has a ratio."""
    config = parse_config(JOBS["coefficients"], "job.yaml")
    places = {n: find_varied_key(config, f"damping.rayleigh.{n}", n, "job.yaml") for n in ("alpha", "beta")}
    rayleigh = vary(config, places, {"alpha": 2.0, "beta": 0.003}, "job.yaml").config.damping.rayleigh
    assert rayleigh is not None and (rayleigh.alpha, rayleigh.beta) == (2.0, 0.003)


def test_the_whole_is_validated_not_only_the_section():
    """Grouting needs a state at rest, which stands in another section."""
    raw = JOBS["loads"] | {"loads": {"initial_state": "undeformed"}}
    config = parse_config(raw, "job.yaml")
    key = find_varied_key(config, "joints.gap.grouting_pressure", "p", "job.yaml")
    with pytest.raises(ConfigError, match="starts without rest"):
        vary(config, {"p": key}, {"p": 1e5}, "job.yaml")


OWN_DAMPING: dict[str, Any] = {
    "materials": {"concrete": CONCRETE | {"damping": {"frequencies": ["4 Hz", "30 Hz"], "ratio": "6 %"}}}
}
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "joints.gap.asperities.height": ("0.01 mm", {}),
    "joints.gap.asperities.mu_smooth": ("0.3", {}),
    "joints.gap.normal_stiffness": ("9 GPa/m", {}),
    "joints.gap.normal_stiffness.per_gap": ("0.4 GN/m", {}),
    "joints.gap.gap": ("0.02 mm", {}),
    "joints.gap.viscosity": ("2 MN s/m3", {}),
    "damping.rayleigh.ratio": ("3 %", {}),
    "damping.modal": ("3 %", {"damping": {"modal": "6 %"}}),
    "materials.concrete.E": ("22 GPa", {}),
    "materials.concrete.damping.ratio": ("3 %", OWN_DAMPING),
    "materials.concrete.rho": ("2700 kg/m3", {}),
    "water.level": ("9 m", {"water": {"level": 12, "faces": FACES, "model": "incompressible"}}),
    "loads.hydrostatic.1.level": ("11 m", {}),
    "loads.joint_water.0.level": ("12 m", {}),
    "loads.temperature.0.change": ("3 K", {}),
}


QUICK = ("joints.gap.asperities.height", "materials.concrete.E", "loads.hydrostatic.1.level")


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=[pytest.mark.slow] * (p not in QUICK)) for p in RUNS],
)
def test_a_suite_has_the_numbers_of_the_job_with_the_value(tmp_path, path):
    compare_with_the_job(tmp_path, path, *RUNS[path])


@pytest.mark.parametrize(
    ("path", "value"),
    [
        pytest.param("materials.concrete.E_dynamic", "45 GPa", marks=pytest.mark.slow),
        pytest.param("materials.concrete.E", "22 GPa", marks=pytest.mark.slow),
        pytest.param("materials.concrete.E", "40 GPa", marks=pytest.mark.slow),  # one modulus in this sample
        pytest.param(
            "joints.gap.normal_stiffness", "5 GPa/m", marks=pytest.mark.slow
        ),  # another state at rest
    ],
)
def test_a_suite_with_moduli_by_duration_has_the_numbers_of_the_job_with_the_value(tmp_path, path, value):
    two = {"materials": {"concrete": CONCRETE | {"E_dynamic": "40 GPa"}}}
    stress = {"stress": {"blocks": ["left"], "sections": {"low": {"blocks": ["left"], "point": [2, -2, 8]}}}}
    compare_with_the_job(
        tmp_path, path, value, two | {"outputs": BASE["outputs"] | {"mesh_error": False} | stress}
    )


def compare_with_the_job(tmp_path, path, value, sections):
    """Assert that a suite with one value has the numbers of the job that the value is written in."""
    law: dict[str, Any] = {"friction": 0.05}
    if path.startswith(("joints", "damping", "materials")):  # a law of a file takes 0.7 s more to compile
        (tmp_path / "rough.py").write_text(LAW)
        law = {"law": "rough.Asperities", "asperities": USERS["asperities"]}
    job = {
        "joints": {"gap": JOINT | law},
        "loads": JOBS["loads"]["loads"] | {"gravity": [0, 0, -9.7]},
        "materials": {"concrete": CONCRETE},
        "model": {"order": "reduced", "modes": "all"},
        "outputs": BASE["outputs"] | {"mesh_error": False},
    } | sections  # fmt: skip
    varied = {"parameters": {"x": {"path": path, "values": [value]}}}
    suite = write_job(tmp_path, records=1, suite=varied, **job)
    made(suite, tmp_path / "suite")
    of_suite = summary(tmp_path / "suite")
    raw: Any = yaml.safe_load(suite.read_text())
    del raw["suite"]
    single = tmp_path / "single.yaml"
    single.write_text(yaml.safe_dump(written_in(raw, path, value)))
    made(single, tmp_path / "single")
    of_single = summary(tmp_path / "single")
    compared = 0
    for name in of_single.data_vars:
        if (
            name.endswith("_seconds")
            or name in ("energy_residual", "ledger_imbalance")
            or of_single[name].dtype.kind != "f"
        ):
            continue
        want, got = of_single[name].values, of_suite[name].values
        np.testing.assert_allclose(
            got, want, rtol=1e-9, atol=1e-12 * np.nanmax(np.abs(want), initial=0.0), err_msg=name
        )
        compared += int(np.isfinite(want).any() and bool(np.nanmax(np.abs(want)) > 0.0))
    assert compared >= 8
