"""Statements of error, certificates and suites of jobs whose modes are coupled by water or viscous faces."""

import numpy as np
import pytest
import yaml
from test_combinations import DT, ON_ROCK, job

import romdam
from romdam.config import load_config, parse_config
from romdam.core.errors import ConfigError
from romdam.pipelines.error.certify import certify
from romdam.results.fields import open_result


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a record of two seconds along all axes, which ends at rest."""
    made = tmp_path_factory.mktemp("coupled")
    t = DT * np.arange(201)
    window = np.where(t < 1.4, np.sin(np.pi * t / 1.4) ** 2, 0.0)
    acc = [a * window * np.sin(2 * np.pi * f * t) for a, f in ((6.0, 3.1), (8.0, 4.3), (3.0, 6.0))]
    acc = [a - window * a.sum() / window.sum() for a in acc]  # the velocity ends at zero
    np.savetxt(made / "pulse.txt", np.stack(acc).T)
    return made


def jobs(folder, *effects, name="job.yaml", **sections):
    record = {"file": "pulse.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1, "y": 2, "z": 3}}
    raw = job(*effects) | {"records": [record], "transient": {"finest_step": 2.5e-3}, "model": {"modes": 4}}
    raw["outputs"] |= {"plots": False, "output_interval": DT}
    (folder / name).write_text(yaml.safe_dump(raw | sections))
    return load_config(folder / name)


def l2(values, reference):
    return np.linalg.norm(values - reference) / np.linalg.norm(reference)


@pytest.mark.parametrize(
    "effects",
    [
        pytest.param(("compressible water",), marks=pytest.mark.slow),
        pytest.param(("compressible water", "free field"), marks=pytest.mark.slow),
        pytest.param(("compressible water", "free field", ON_ROCK), marks=pytest.mark.slow),
        pytest.param(("compressible water", "moving supports", ON_ROCK), marks=pytest.mark.slow),
        ("compressible water", "moving supports"),
        pytest.param(("viscous boundary",), marks=pytest.mark.slow),
    ],
)
def test_estimate_and_certificate_of_coupled_modes_are_near_the_true_error(effects, folder, tmp_path):
    (path,) = romdam.run(jobs(folder, *effects), tmp_path / "reduced").paths
    full = jobs(folder, *effects, name="full.yaml", model={"order": "full"})
    (mesh,) = romdam.run(full, tmp_path / "full").paths
    with open_result(path) as own, open_result(mesh) as of_mesh:
        opening = own.dataset.opening.values
        true = l2(opening, of_mesh.dataset.opening.values)
        estimate = own.dataset.attrs["error_estimate_opening_l2"]
        steps = own.dataset.attrs["solver_estimated_time_error"]
    stated = certify(path, folder / "job.yaml").statement.errors["opening"].l2
    assert 0.45 * true < estimate < 2.0 * true
    assert stated == pytest.approx(true, rel=0.1)
    if effects == ("viscous boundary",):
        finer = jobs(folder, *effects, name="finer.yaml", transient={"finest_step": 2.5e-3 / 4})
        with open_result(romdam.run(finer, tmp_path / "finer").paths[0]) as better:
            assert 0.6 * (true_steps := l2(opening, better.dataset.opening.values)) < steps < 2.0 * true_steps


@pytest.mark.parametrize(
    ("effects", "path", "values"),
    [
        pytest.param(("compressible water",), "damping.rayleigh.ratio", [0.03, 0.1], marks=pytest.mark.slow),
        pytest.param(
            ("compressible water", "free field"), "joints.joint.friction", [0.1, 0.8], marks=pytest.mark.slow
        ),
        pytest.param(
            ("compressible water", "free field", ON_ROCK),
            "joints.joint.friction",
            [0.1, 0.8],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_suite_with_coupled_modes_makes_the_runs_of_jobs(effects, path, values, folder, tmp_path):
    """Peaks of each sample are those of a job of its own with the same damping or friction, and differ."""
    suite = {"parameters": {"varied": {"path": path, "values": values}}}
    coarse = {"transient": {"finest_step": DT / 2.0}}
    asked = jobs(folder, *effects, name="suite.yaml", pipeline="suite", suite=suite, **coarse)
    summary = romdam.run_suite(asked, tmp_path / "suite", romdam.SuiteOptions(workers=1)).summary
    found = summary.peak_opening.values.ravel()
    stated = summary.estimated_reduction_error.values
    made = []
    for k, value in enumerate(values):
        alone = jobs(folder, *effects, name=f"{k}.yaml", **coarse)
        raw = yaml.safe_load(alone.path.read_text())
        section, *keys = path.split(".")
        target = raw[section]
        for key in keys[:-1]:
            target = target[key]
        target[keys[-1]] = value
        alone.path.write_text(yaml.safe_dump(raw))
        with open_result(romdam.run(load_config(alone.path), tmp_path / str(k)).paths[0]) as result:
            made += result.dataset.peak_opening.values.tolist()
    np.testing.assert_allclose(found, made, rtol=1e-6)
    assert abs(found[1] - found[0]) > 0.02 * found.max()
    assert (stated > 0.0).all()


def test_varied_damping_beside_dashpots_is_refused():
    suite = {"parameters": {"xi": {"path": "damping.rayleigh.ratio", "values": [0.01, 0.1]}}}
    with pytest.raises(
        ConfigError, match=r"1 of damping varied, limit 0 with dashpots .* vary joints, or hold"
    ):
        parse_config(job("viscous boundary") | {"pipeline": "suite", "suite": suite}, "s.yaml")


@pytest.mark.slow
def test_modes_are_chosen_for_an_accuracy_beside_water_with_waves(folder, tmp_path):
    """`modes: auto` judges by the estimate; the run then states an error within the accuracy."""
    asked = jobs(
        folder, "compressible water", name="auto.yaml", model={"modes": "auto"}, transient={"accuracy": 0.05}
    )
    with open_result(romdam.run(asked, tmp_path / "auto").paths[0]) as result:
        attrs = result.dataset.attrs
        assert 0.0 < attrs["error_estimate_opening_l2"] < 0.05
        assert 0.0 < attrs["solver_estimated_time_error"] < 0.05
        assert attrs["integrator"] == "generalized_alpha"
