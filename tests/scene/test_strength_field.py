"""Random fields of strengths along joints: moments, other meshes, runs, suites, what is refused."""

import numpy as np
import pytest
import yaml
from scipy.stats import kurtosis, skew

import romdam
from romdam.config import parse_config
from romdam.config.sections.joints import StrengthField
from romdam.core.errors import ConfigError
from romdam.scene.build import build_scene
from romdam.scene.strength_field import field_factors

FIELD = {"of": ["friction"], "coefficient_of_variation": 0.3, "length": "2 m", "seed": 5}


def raw_job(folder, size=1.0, field=FIELD, **joint):
    """Two unlike pillars that rub."""
    time = np.linspace(0.0, 1.0, 201)
    np.savetxt(folder / "shake.txt", 20.0 * np.sin(20.0 * time) * np.sin(np.pi * time))
    box = {"element_size": [size, 1.0, size], "element": "hex8"}
    properties = {"between": ["left", "right"], "normal_stiffness": "50 GPa/m", "shear_stiffness": "25 GPa/m"}
    properties |= {"friction": 0.5}
    return {
        "materials": {"concrete": {"E": "30 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
        "blocks": {
            "left": {"material": "concrete", "box": box | {"origin": [0, -1, 0], "size": [2, 1, 6]}},
            "right": {"material": "concrete", "box": box | {"origin": [0, 0, 0], "size": [2, 2, 6]}},
        },
        "supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "zmin"}],
        "joints": {"J": properties | joint | ({"field": field} if field else {})},
        "loads": {"pressure": [{"block": "left", "face": "ymin", "value": "0.2 MPa"},
                               {"block": "right", "face": "ymax", "value": "0.2 MPa"}]},
        "damping": {"rayleigh": {"frequencies": ["5 Hz", "50 Hz"], "ratio": 0.05}},
        "records": [{"name": "shake", "file": "shake.txt", "unit": "m/s2", "dt": 0.005,
                     "components": {"x": 1, "y": 1}}],
        "model": {"modes": 20},
        "transient": {"finest_step": "1.25 ms"},
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False},
    }  # fmt: skip


def joint_of(folder, **changes):
    return build_scene(parse_config(raw_job(folder, **changes), "job.yaml"), folder, "job.yaml").joints["J"]


def test_factors_are_lognormal_with_the_moments_and_the_correlation_that_are_asked_for():
    """Over 3,000 fields at five places; the correlation of the logarithms over 0.5 to 4 lengths."""
    place = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 2.0, 0], [0, 0, 4.0], [8.0, 0, 0]])
    fields = [
        StrengthField(of=("friction",), coefficient_of_variation=0.4, length=2.0, seed=s) for s in range(3000)
    ]
    factor = np.array([field_factors(field, place, "J") for field in fields])
    assert factor.mean(axis=0) == pytest.approx(1.0, abs=4 * 0.4 / np.sqrt(3000))
    assert factor.std(axis=0) == pytest.approx(0.4, rel=0.1)
    log = np.log(factor)
    assert np.abs(skew(log)).max() < 0.15 and np.abs(kurtosis(log)).max() < 0.3
    expected = np.exp(-np.array([1.0, 2.0, 4.0, 8.0]) / 2.0)
    assert np.corrcoef(log.T)[0, 1:] == pytest.approx(expected, abs=4 / np.sqrt(3000))
    other = np.array([field_factors(field, place[:1], "K") for field in fields])
    assert abs(np.corrcoef(log[:, 0], np.log(other[:, 0]))[0, 1]) < 4 / np.sqrt(3000)


def test_a_place_has_the_same_friction_on_every_mesh(tmp_path):
    coarse, fine = joint_of(tmp_path), joint_of(tmp_path, size=0.5)
    here = [
        np.flatnonzero(np.linalg.norm(fine.position - place, axis=1) < 1e-9).item()
        for place in coarse.position
    ]
    assert coarse.mu == pytest.approx(fine.mu[here], rel=1e-12)
    assert np.ptp(coarse.mu[:, 0]) > 0.05 and (coarse.mu[:, 0] == coarse.mu[:, 1]).all()
    assert (joint_of(tmp_path, field=FIELD | {"seed": 6}).mu != coarse.mu).all()


def test_strengths_of_bonds_and_of_softening_vary_together(tmp_path):
    """Of each gap times its area; what is not named stays."""
    fracture = {
        "tensile_strength": "1 MPa",
        "energy": "100 N/m",
        "cohesion": "2 MPa",
        "shear_energy": "300 N/m",
    }
    of = ["fracture.tensile_strength", "fracture.cohesion"]
    plain = joint_of(tmp_path, field=None, fracture=fracture)
    varied = joint_of(tmp_path, field=FIELD | {"of": of}, fracture=fracture)
    factor = field_factors(StrengthField(**FIELD | {"of": of, "length": 2.0}), plain.position, "J")
    for column, power in ((1, 1.0), (3, 1.0), (2, -1.0), (4, -1.0)):  # strengths; openings of the same energy
        assert varied.laws[0].values[:, column] == pytest.approx(
            plain.laws[0].values[:, column] * factor**power, rel=1e-12
        )
    assert (varied.mu == plain.mu).all()


def test_each_gap_slides_at_its_own_friction(tmp_path):
    """|t| <= mu p at every gap and step, reached somewhere; reduced with all modes as at full order."""
    mu = joint_of(tmp_path).mu[:, 0]
    found = []
    for model in ({"modes": "all"}, {"order": "full"}):
        path = tmp_path / "job.yaml"
        path.write_text(
            yaml.safe_dump(raw_job(tmp_path) | {"model": model, "transient": {"finest_step": "5 ms"}})
        )
        run = romdam.run(romdam.load_config(path), out=tmp_path / str(len(found)))
        found.append(romdam.open_result(run.paths[0]).dataset)
    for one in found:
        shear, pressed = np.hypot(*np.moveaxis(one.shear_force.values, -1, 0)), one.normal_force.values
        use = np.where(np.abs(pressed) > 1.0, shear / np.maximum(np.abs(pressed), 1.0), 0.0)
        assert (use <= mu * (1 + 1e-5)).all()
        assert (use.max(axis=0) > 0.999 * mu).sum() > 0.5 * len(mu)


def test_a_suite_draws_a_field_for_every_sample_and_equals_jobs(tmp_path):
    path = tmp_path / "job.yaml"
    parameters = {"seed": {"path": "joints.J.field.seed", "values": [1, 2.5]}}
    path.write_text(
        yaml.safe_dump(raw_job(tmp_path) | {"suite": {"parameters": parameters}, "pipeline": "suite"})
    )
    romdam.run_suite(romdam.load_config(path), tmp_path / "suite", romdam.SuiteOptions(workers=1))
    peaks = romdam.open_suite(tmp_path / "suite").peak_slip.values.ravel()
    assert len(peaks) == 2 and peaks[0] != pytest.approx(peaks[1], rel=0.01)
    path.write_text(yaml.safe_dump(raw_job(tmp_path, field=FIELD | {"seed": 2.5})))
    one = romdam.open_result(romdam.run(romdam.load_config(path), out=tmp_path / "one").paths[0]).dataset
    assert peaks[1] == pytest.approx(float(one.peak_slip.max()), rel=1e-6)


@pytest.mark.parametrize(
    ("field", "joint", "words"),
    [
        (FIELD | {"of": ["cohesion"]}, {}, "cohesion is 0 in this joint"),
        (FIELD | {"of": ["fracture.energy"]}, {}, "fracture.energy is not given"),
        (FIELD | {"of": []}, {}, "field.of"),
        (FIELD | {"length": 0.0}, {}, "field.length"),
        (FIELD | {"coefficient_of_variation": 3.0}, {}, "coefficient_of_variation"),
        (
            FIELD | {"of": ["friction_static"]},
            {"friction_static": 0.52},
            r"at least friction \(0.5, 0.5\).*name both keys in field.of",
        ),
    ],
)
def test_what_is_refused(tmp_path, field, joint, words):
    with pytest.raises(ConfigError, match=words):
        joint_of(tmp_path, field=field, **joint)
