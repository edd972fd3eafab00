"""Materials and levels of water that a suite varies, against jobs in which they stand, and closed forms."""

import math

import numpy as np
import pytest
import suite_jobs
import yaml
from gravity_dams import gravity_dam
from suite_jobs import BASE, made, write_job

import romdam
from romdam.config import parse_config
from romdam.config.parameters import find_varied_key, vary
from romdam.core.errors import ConfigError
from romdam.core.scene_digest import scene_digest
from romdam.pipelines.run import Clock, build_model, silent
from romdam.pipelines.simulation import simulate_motion
from romdam.pipelines.suites.plan import make_plan
from romdam.pipelines.suites.run import build_suite
from romdam.pipelines.suites.runs import sample_model
from romdam.scene.build import build_scene
from romdam.scene.varied import vary_scene

WET = [{"block": "left", "face": "ymin"}]
RUBS = {"joints": {"gap": {**BASE["joints"]["gap"], "friction": 0.5, "gap": "0.2 mm"}}}
HEAVY = {"loads": {"gravity": [0, 0, -9.81], "hydrostatic": [{"level": "15 m", "faces": WET}]}}
TWO = {
    "materials": {
        "concrete": {"E": "4.4e6 psi", "nu": 0.18, "rho": "152 lb/ft3"},
        "rock": {"E": "20 GPa", "nu": 0.25, "rho": "2600 kg/m3"},
    },
    "blocks": {"left": {**BASE["blocks"]["left"], "material": "rock"}, "right": BASE["blocks"]["right"]},
}
FREE = {"supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "ymax"}]}


def put(raw, path, value):
    *sections, last = path.split(".")
    for key in sections:
        raw = raw[int(key)] if isinstance(raw, list) else raw[key]
    raw[last] = value


def water(model, level="15 m", **more):
    return {"water": {"level": level, "faces": WET, "model": model, **more}}


def openings(folder, parameters, **sections):
    """(sample, ...) jumps of a suite's samples and of jobs with their values, and the stated errors."""
    suite = {"parameters": {name: {"path": path, "values": v} for name, (path, v) in parameters.items()}}
    config = write_job(folder, records=1, suite=suite, **sections)
    job = romdam.load_config(config)
    plan = make_plan(job, Clock(silent))
    built = build_suite(plan, folder / "out", None, Clock(silent))
    of_suite, of_jobs = [], []
    for number, values in enumerate(plan.samples.values):
        model = sample_model(built, number)
        (motion,) = plan.motions.values()
        of_suite.append(simulate_motion(plan.job, model.prepared, motion).jump)
        raw = yaml.safe_load(config.read_text())
        del raw["suite"]
        for name, (path, _) in parameters.items():
            for place in [path] if isinstance(path, str) else path:
                put(raw, place, values[name])
        fresh = romdam.load_config({**raw, "pipeline": "run"}, folder)
        alone = build_model(fresh, Clock(silent), estimated=True)
        of_jobs.append(simulate_motion(fresh, alone.prepared, motion).jump)
        assert (model.finer is None) == (alone.finer is None)
    return np.array(of_suite), np.array(of_jobs)


E = {"E": ("materials.concrete.E", ["20 GPa", "30 GPa", "45 GPa"])}
RHO = {"rho": ("materials.concrete.rho", ["2200 kg/m3", "170 lb/ft3"])}
EXPANDS = {"materials": {"concrete": {**BASE["materials"]["concrete"], "expansion": "1e-5 1/K"}}}
COOL = {"dT": ("loads.temperature.0.change", ["-20 K", "-3.5 K", "12 K"])}
BOTH = {"E": ("materials.concrete.E", ["3e6 psi"]), "rho": ("materials.concrete.rho", [2700])}


@pytest.mark.parametrize(
    ("parameters", "sections"),
    [
        (E, {}),
        (RHO, {}),
        (BOTH, RUBS | HEAVY),
        (BOTH, RUBS | HEAVY | FREE | {"model": {"modes": 6, "residual_vectors": 4}}),
        (BOTH, RUBS | HEAVY | TWO | water("westergaard")),
        (BOTH, {"joints": {"gap": {**RUBS["joints"]["gap"], "normal_stiffness": "auto",
                                   "shear_stiffness": "auto"}}} | HEAVY),
        pytest.param(E | RHO, HEAVY | TWO | water("incompressible"), marks=pytest.mark.slow),
        (BOTH, RUBS | HEAVY | water("compressible")),
        pytest.param(BOTH, {"damping": {"modal": "5 %"}, "model": {"modes": "all"}} | RUBS,
                     marks=pytest.mark.slow),
        pytest.param(BOTH, {"damping": {"rayleigh": {"alpha": 0.6, "beta": 4e-4}}} | RUBS | HEAVY,
                     marks=pytest.mark.slow),
        pytest.param({"E": ("materials.rock.E", ["10 GPa"]), "rho": ("materials.concrete.rho", [2000])},
                     TWO | RUBS, marks=pytest.mark.slow),
        pytest.param(COOL, RUBS | EXPANDS
                     | {"loads": {"gravity": [0, 0, -9.81], "temperature": [{"change": 0}]}},
                     marks=pytest.mark.slow),
        (
            BOTH | {"dT": (["loads.temperature.0.change"], ["14 degF"])},
            RUBS
            | EXPANDS
            | {"model": {"modes": "all"}}
            | {"loads": HEAVY["loads"] | {"temperature": [{"change": "-12 K", "blocks": ["right"]}]}},
        ),
        (
            BOTH,
            RUBS
            | {"materials": {"concrete": {**BASE["materials"]["concrete"], "expansion": 1e-5}}}
            | {"loads": {"temperature": [{"change": "-12 K"}]}},
        ),
    ],
)  # fmt: skip
def test_materials_give_the_numbers_of_a_job_in_which_they_stand(parameters, sections, tmp_path):
    outputs = {**BASE["outputs"], "error_estimate": True, "mesh_error": False}
    suite, jobs = openings(tmp_path, parameters, **{"outputs": outputs, **sections})
    size = np.abs(jobs).max(axis=(1, 2, 3))
    assert size.min() > 1e-4
    assert (np.abs(suite - jobs).max(axis=(1, 2, 3)) <= 1e-9 * size).all()
    if len(jobs) > 1:  # what is varied does something
        assert np.abs(jobs[0] - jobs[-1]).max() > 0.05 * size[0]


def test_materials_vary_beside_supports_of_their_own_motion(tmp_path, monkeypatch):
    """Its record ends at rest, so that nothing drifts."""
    moved = np.gradient(np.gradient(np.sin(np.linspace(0.0, np.pi, 80)) ** 6))
    monkeypatch.setattr(suite_jobs, "pulse", lambda number: 5.0 * moved / np.abs(moved).max())
    supports = [
        {"block": "left", "face": "zmin"},
        {"block": "right", "face": "zmin", "motion": {"delay": "0.05 s"}},
    ]
    sections = {**RUBS, **HEAVY, **water("westergaard"), "supports": supports}
    suite, jobs = openings(tmp_path, BOTH, **sections)
    assert np.abs(suite - jobs).max() <= 1e-9 * np.abs(jobs).max()


@pytest.mark.parametrize("model", ["westergaard", pytest.param("incompressible", marks=pytest.mark.slow)])
def test_levels_give_the_numbers_of_a_job_but_for_its_basis(model, tmp_path):
    """The suite's basis answers the loads at its lowest and highest level, that of a job those at its own."""
    path = ["water.level", "loads.hydrostatic.0.level"]
    sections = {**water(model), **HEAVY, **RUBS}
    suite, jobs = openings(tmp_path, {"h": (path, ["12 m", "13.7 m", "15 m", "19 m"])}, **sections)
    off = np.sqrt(((suite - jobs) ** 2).sum(axis=(1, 2, 3)) / (jobs**2).sum(axis=(1, 2, 3)))
    assert 0.0 < off.max() < 2e-3
    assert np.abs(jobs[0] - jobs[3]).max() > 0.1 * np.abs(jobs[0]).max()
    every = {**sections, "model": {"modes": "all"}}  # where all bases are the mesh itself
    suite, jobs = openings(tmp_path / "all", {"h": (path, ["12 m", "19 m"])}, **every)
    assert np.abs(suite - jobs).max() <= 1e-9 * np.abs(jobs).max()


UPLIFT = {
    "joint_water": [
        {"joints": ["base_1", "base_2"], "level": 30, "downstream": [0, 1, 0], "crack": "full",
         "drains": {"at": "4 m", "rule": "usbr"}},
        {"joints": ["base_3"], "level": 30},
    ]
}  # fmt: skip
REST = {
    "records": [{"file": "r.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
    "model": {"modes": 3},
    "transient": {"finest_step": "2 ms"},
    "damping": {"rayleigh": {"frequencies": [3, 20], "ratio": 0.05}},
}
DAM_FACES = [{"block": f"monolith_{k}", "face": "upstream"} for k in (1, 2, 3)]


@pytest.mark.parametrize(
    ("raw", "path", "value"),
    [
        (gravity_dam() | REST, "materials.concrete.E", 21e9),
        (gravity_dam() | REST, "materials.concrete.rho", 2500.0),
        (gravity_dam() | REST, "materials.*.E", 21e9),
        (
            gravity_dam()
            | REST
            | {"loads": {"gravity": [0, 0, -9.81], **UPLIFT,
                         "hydrostatic": [{"level": 30, "faces": DAM_FACES[:2]},
                                         {"level": 30, "faces": DAM_FACES[2:], "density": 1030}]}}
            | {"water": {"level": 30, "faces": DAM_FACES, "model": "westergaard"}},
            "*.level",
            27.5,
        ),
        (
            gravity_dam()
            | REST
            | {
                "materials": {
                    name: {**material, "expansion": 1e-5}
                    for name, material in gravity_dam()["materials"].items()
                }
            }
            | {"loads": {"temperature": [{"change": "-4 K", "blocks": ["monolith_1"]},
                                         {"change": 0, "blocks": ["monolith_2"]}]}},
            "loads.temperature.*.change",
            7.5,
        ),
        (
            gravity_dam() | REST | {"water": {"level": 30, "faces": DAM_FACES, "model": "incompressible"}},
            "water.level",
            27.5,
        ),
    ],
)  # fmt: skip
def test_the_scene_of_a_sample_is_that_which_would_be_built(raw, path, value, tmp_path):
    config = parse_config(raw, "dam.yaml")
    key = find_varied_key(config, path, "x", "dam.yaml")
    varied = vary(config, {"x": key}, {"x": value}, "dam.yaml").config
    built = build_scene(config, tmp_path, "dam.yaml")
    want = build_scene(varied, tmp_path, "dam.yaml")
    assert scene_digest(vary_scene(built, varied, "dam.yaml")) == scene_digest(want)
    assert scene_digest(built) != scene_digest(want)
    assert scene_digest(vary_scene(want, config, "dam.yaml")) == scene_digest(built)  # and back


ONE = {
    "blocks": {"right": BASE["blocks"]["right"]},
    "supports": [{"block": "right", "face": "zmin"}],
    "joints": {},
    "damping": {"modal": "5 %"},
    "model": {"modes": "all"},
    "transient": {"finest_step": "1 ms"},
    "outputs": {**BASE["outputs"], "output_interval": "1 ms"},  # peaks of nodes are of written rows
}  # fmt: skip


@pytest.mark.slow
def test_moments_of_the_peak_of_an_oscillator_are_the_closed_form(tmp_path):
    """Set off by a constant acceleration, modes of one damping ratio have a peak displacement ~ rho / E.

    With lognormal E and rho, whose scores are correlated by r, it is lognormal with the logarithm's variance
    s_E^2 + s_rho^2 - 2 r s_E s_rho, and its size at the median is that of the sum of all modes' answers.
    """
    s_E, s_rho, r = 0.3, 0.05, 0.4
    parameters = {
        "E": {"path": "materials.concrete.E", "distribution": "lognormal", "median": "30 GPa", "beta": s_E},
        "rho": {"path": "materials.concrete.rho", "distribution": "lognormal", "median": 2440, "beta": s_rho},
    }
    correlation = {"of": "scores", "pairs": [{"between": ["E", "rho"], "value": r}]}
    suite = {"parameters": parameters, "design": {"latin_hypercube": 400}, "correlation": correlation}
    config = write_job(tmp_path, records=1, suite=suite, **ONE)
    np.savetxt(tmp_path / "records" / "r0.txt", np.full(100, 2.0))
    found = made(config, tmp_path / "out").summary
    peak = found.peak_displacement.values[0, 0, :, 0, list(found.component.values).index("y")]
    # the closed form at the medians: u = sum of participation over omega^2 times the step response
    raw = yaml.safe_load(config.read_text())
    del raw["suite"]
    system = build_model(romdam.load_config({**raw, "pipeline": "run"}, tmp_path), Clock(silent)).system
    omega, xi, t = np.sqrt(system.K.diagonal()), 0.05, np.arange(0.0, 0.99, 1e-4)[:, None]
    turn = omega * math.sqrt(1.0 - xi**2) * t
    step = 1.0 - np.exp(-xi * omega * t) * (np.cos(turn) + xi / math.sqrt(1.0 - xi**2) * np.sin(turn))
    shape = system.observe.toarray()[1] * system.load[:, 1] / omega**2
    median = 2.0 * np.abs(step @ shape).max()
    s = math.sqrt(s_E**2 + s_rho**2 - 2 * r * s_E * s_rho)
    mean, std = median * math.exp(s**2 / 2), median * math.exp(s**2 / 2) * math.sqrt(math.expm1(s**2))
    assert peak.mean() == pytest.approx(mean, rel=2e-3)
    assert peak.std() == pytest.approx(std, rel=2e-2)
    ratio = peak * found.parameter_E.values / found.parameter_rho.values
    assert np.ptp(ratio) < 1e-3 * ratio.mean()


@pytest.mark.slow
def test_samples_go_on_where_a_suite_stopped_and_stand_in_the_summary(tmp_path):
    path = ["water.level", "loads.hydrostatic.0.level"]
    parameters = {
        "E": {"path": "materials.concrete.E", "distribution": "lognormal", "mean": "30 GPa", "cov": 0.2},
        "level": {"path": path, "low": "12 m", "high": "18 m"},
        "mu": {"path": "joints.gap.friction", "low": 0.3, "high": 0.9},
    }
    suite = {"parameters": parameters, "design": {"latin_hypercube": 5}, "batch": 5}
    config = write_job(tmp_path, records=2, suite=suite, **{**water("westergaard"), **HEAVY, **RUBS})
    first = made(config, tmp_path / "out")
    assert first.made == 10 and not first.failures
    assert made(config, tmp_path / "out").made == 0
    assert first.summary.parameter_E.attrs["units"] == "Pa" and first.summary.parameter_level.max() < 18.0
    alone = yaml.safe_load(config.read_text())
    alone["suite"]["batch"] = 1  # samples of unlike modes are not integrated with each other's
    config.write_text(yaml.safe_dump(alone))
    again = made(config, tmp_path / "alone").summary
    np.testing.assert_array_equal(again.gap_peak_opening.values, first.summary.gap_peak_opening.values)
    assert romdam.check(config).records


TIED = {"joints": {}, "ties": {"t": {"between": ["left", "right"]}}, **TWO}


@pytest.mark.parametrize(
    ("path", "values", "sections", "part"),
    [
        ("materials.concrete.E", [2e10], TIED, "does not change as a whole, but by factors of"),
        ("materials.*.rho", [2500], TIED, "the density of part"),
        ("materials.concret.E", [2e10], {}, "'materials.concret.E' is not of"),
        ("materials.concrete.E", [2e10], {"joints": {"gap": {**BASE["joints"]["gap"],
         "normal_stiffness": "auto"}}, **TWO}, "auto follows the elements on both sides"),
        ("loads.temperature.0.change", ["-12 Pa"], EXPANDS | {"loads": {"temperature": [{"change": 1}]}},
         "got '-12 Pa'"),
        ("loads.temperature.0.change", [-301], EXPANDS | {"loads": {"temperature": [{"change": 1}]}},
         "got -301"),
        ("loads.temperature.0.month", [3], EXPANDS | {"loads": {"temperature": [{"change": 1}]}},
         "loads.temperature.<number>.change (of no table)"),
        ("loads.temperature.0.change", [3], EXPANDS | {"suite_keep": "full",
         "loads": {"temperature": [{"change": 1}]}}, "suite.keep: a kept result"),
        ("materials.concrete.nu", [0.2], {}, "materials.<name>.E, .E_dynamic, .rho or .damping.ratio"),
        ("materials.concrete.E", ["-3 GPa"], {}, "got '-3 GPa'"),
        ("materials.concrete.E", [2e10], {"suite_keep": "full"}, "suite.keep: a kept result"),
        ("water.level", [12], water("westergaard") | HEAVY, "loads.hydrostatic.0.level is at the same 15 m"),
        ("water.level", [12], water("compressible"), "its waves are reduced for it"),
        ("water.level", [12, 25], water("westergaard"), "the water is above the top of its faces"),
        (["water.level", "materials.concrete.E"], [12], water("westergaard"), "a list have one key"),
        ("materials.concrete.E", [2e10], {"model": {"order": "full"}}, "a suite needs a reduced model"),
    ],
)  # fmt: skip
def test_what_has_another_basis_is_refused_by_check_and_by_run(path, values, sections, part, tmp_path):
    suite = {"parameters": {"x": {"path": path, "values": values}}}
    sections = dict(sections)
    suite["keep"] = sections.pop("suite_keep", "peaks")
    config = write_job(tmp_path, records=1, suite=suite, **sections)
    for command in (romdam.check, lambda c: romdam.run_suite(c, tmp_path / "out")):
        with pytest.raises(ConfigError) as told:
            command(config)
        assert part in str(told.value) and "suite.yaml" in str(told.value)


def test_two_parameters_of_one_material_are_refused(tmp_path):
    parameters = {n: {"path": p, "values": [2e10]} for n, p in
                  (("a", "materials.concrete.E"), ("b", "materials.*.E"))}  # fmt: skip
    config = write_job(tmp_path, records=1, suite={"parameters": parameters})
    with pytest.raises(ConfigError, match=r"suite\.parameters\.b\.path: materials\.concrete\.E is varied by"):
        romdam.check(config)
