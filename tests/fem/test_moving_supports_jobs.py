"""Jobs whose supports have motions of their own: results, statements of error, keys of suites, refusals."""

import numpy as np
import pytest
import yaml
from test_moving_supports import MATERIALS, l2, pulses, valley

import romdam
from romdam.config import load_config, parse_config
from romdam.core.errors import ConfigError, RecordError, RomdamError
from romdam.core.fingerprint import fingerprint
from romdam.core.motion import MovingSupports
from romdam.pipelines.check import check
from romdam.pipelines.error.certify import certify
from romdam.pipelines.moving_supports import scene_of
from romdam.results.fields import open_result

WAVE = {"right": {"delay": 0.08, "factor": 1.2}, "middle": {"delay": "40 ms"}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a record whose displacement ends at rest, and one that drifts."""
    made = tmp_path_factory.mktemp("moving")
    np.savetxt(made / "pulse.txt", pulses(2.2).T)
    np.savetxt(made / "drifting.txt", pulses(2.2).T + 0.3)
    return made


def record(name="pulse.txt"):
    return {"file": name, "unit": "m/s2", "dt": 0.01, "components": {"x": 1, "y": 2, "z": 3}}


def job(folder, name="job.yaml", motions=WAVE, **sections):
    raw = valley(**motions) | {
        "materials": {"concrete": MATERIALS["concrete"]},
        "records": [record()],
        "damping": {"rayleigh": {"frequencies": [3.0, 30.0], "ratio": 0.03}},
        "model": {"modes": 4},
        "transient": {"finest_step": 0.0005},
    }
    raw["outputs"] |= {"plots": False, "output_interval": 0.01}
    (folder / name).write_text(yaml.safe_dump(raw | sections))
    return load_config(folder / name)


def test_results_and_statements_of_a_run(folder, tmp_path):
    """Fields rebuilt are those of probes and the mesh; the estimate is near the true error; certified."""
    (path,) = romdam.run(job(folder), tmp_path / "reduced").paths
    full = job(folder, "full.yaml", model={"order": "full"}, transient={"finest_step": 0.0005})
    (mesh,) = romdam.run(full, tmp_path / "full").paths
    with open_result(path) as own, open_result(mesh) as of_mesh:
        data, reference = own.dataset, of_mesh.dataset
        rebuilt = own.displacement("left", nodes=[0, 1]).values
        bank = own.displacement("right").values
        moved = data.support_displacement.values
        assert data.support.values.tolist() == ["supports[1]", "supports[2]"]
        assert rebuilt.shape == (len(data.time), 2, 3)
        single = 1e-6 * np.abs(bank).max()  # bases are written in single precision
        held = np.isclose(own.points("right")[:, 0], 30.0)
        np.testing.assert_allclose(bank[:, held], np.tile(moved[:, 1:], (1, held.sum(), 1)), atol=single)
        crest = own.displacement("middle")
        at = int(np.argmin(np.linalg.norm(own.points("middle") - [15, 0, 20], axis=1)))
        np.testing.assert_allclose(crest.values[:, at], data.displacement.values[:, 1], atol=single)
        true = l2(data.opening.values, reference.opening.values)
        estimate = data.attrs["error_estimate_opening_l2"]
        assert data.attrs["solver_ledger_imbalance"] < 1e-10
        assert reference.attrs["solver_ledger_imbalance"] < 1e-10
        np.testing.assert_allclose(
            data.max_principal_stress.values, reference.max_principal_stress.values, rtol=0.1
        )
    statement = certify(path, folder / "job.yaml").statement
    certified = statement.errors["opening"].l2
    assert true < 2.0 * estimate
    assert 0.5 * estimate < certified < 2.0 * estimate


@pytest.mark.parametrize("delay", [0.01, 0.0137])
def test_a_late_support_of_a_record_that_begins_with_an_acceleration_comes_back(folder, tmp_path, delay):
    """u = A t^2 (T - t)^4 begins with a = 3 m/s2 and ends at rest; the support has u(t - delay) - u(t)."""
    length = 2.0
    u = (
        3.0
        / (2.0 * length**4)
        * np.polynomial.Polynomial([0, 0, 1])
        * np.polynomial.Polynomial([length, -1]) ** 4
    )
    time = np.arange(1001) * 0.002
    np.savetxt(folder / "starts.txt", np.outer(u.deriv(2)(time), [1.0, 0.0, 0.0]))
    raw = {"right": {"delay": delay}}
    (path,) = romdam.run(
        job(
            folder,
            "late.yaml",
            raw,
            records=[record("starts.txt") | {"dt": 0.002}],
            transient={"finest_step": 0.002},
        ),
        tmp_path / "late",
    ).paths
    with open_result(path) as result:
        at = result.dataset.time.values
        moved = result.dataset.support_displacement.values[:, 0, 0]
    inside = [np.clip(t, 0.0, length) for t in (at - delay, at)]
    exact = u(inside[0]) - u(inside[1])
    assert np.abs(moved - exact).max() < 5e-5 * np.abs(exact).max()  # straight lines between samples
    assert np.abs(moved).max() == pytest.approx(np.abs(exact).max(), rel=1e-3)


def test_record_of_a_support_is_what_it_follows(folder):
    """A record in place of a delay, of the same samples as the job's: the support moves as the base does."""
    scene = scene_of(job(folder, motions={"right": {"record": record()}}))
    (motion,) = scene.find(MovingSupports).motions
    np.testing.assert_allclose(motion.record.acc, pulses(2.2))
    assert motion.name == "supports[2]"


def test_motion_is_in_what_a_suite_knows_its_runs_by(folder):
    keys = {
        fingerprint(scene_of(job(folder, motions=motions)).find(MovingSupports))
        for motions in ({}, WAVE, WAVE | {"middle": {"delay": 0.05}}, {"right": WAVE["right"]})
    }
    assert len(keys) == 4


@pytest.mark.parametrize(
    ("motion", "text"),
    [
        ({}, r"supports\[2\].motion: give `delay` above 0 s, a `factor`"),
        ({"delay": -0.1}, r"supports\[2\].motion.delay"),
        ({"factor": 0.0}, r"supports\[2\].motion.factor"),
        ({"delay": 0.1, "record": record()}, r"give `record`, or `delay` and `factor`"),
        ({"delays": 0.1}, r"delays is not a known key"),
    ],
)
def test_wrong_motions_are_refused_by_their_keys(folder, motion, text):
    with pytest.raises(ConfigError, match=text):
        job(folder, motions={"right": {"delay": 1.0}})
        raw = yaml.safe_load((folder / "job.yaml").read_text())
        raw["supports"][2]["motion"] = motion
        parse_config(raw, "job.yaml")


@pytest.mark.parametrize(
    ("sections", "text"),
    [
        (
            {"transient": {"finest_step": 0.001, "integrator": "conserving"}, "damping": {}},
            "conserving knows one",
        ),
    ],
)
def test_what_knows_one_motion_is_refused(folder, sections, text):
    with pytest.raises(ConfigError, match=text):
        job(folder, "bad.yaml", **sections)


def test_supports_that_meet_and_records_that_drift_are_refused(folder):
    one = job(folder)
    raw = yaml.safe_load(one.path.read_text())
    raw["supports"].append({"block": "right", "face": "zmin"})
    (folder / "meet.yaml").write_text(yaml.safe_dump(raw))
    with pytest.raises(
        ConfigError, match=r"supports\[3\].motion: 2 of its nodes are held by supports\[2\] too"
    ):
        scene_of(load_config(folder / "meet.yaml"))
    with pytest.raises(RecordError, match=r"ends .* from it, 79% of its largest distance, limit 10%.*peer"):
        check(job(folder, "drift.yaml", records=[record("drifting.txt")]))
    with pytest.raises(RecordError, match=r"supports\[2\].motion.record: record drifting"):
        scene_of(job(folder, "own.yaml", motions={"right": {"record": record("drifting.txt")}}))
    several = {
        "records": [record(), record() | {"name": "again"}],
        "motions": {"right": {"record": record()}},
    }
    with pytest.raises(RomdamError, match=r"motion.record: goes with one record"):
        job(folder, "several.yaml", **several)
    loose = job(folder, "loose.yaml")
    raw = yaml.safe_load(loose.path.read_text())
    raw["supports"][2]["fix"] = ["x"]
    (folder / "loose.yaml").write_text(yaml.safe_dump(raw))
    with pytest.raises(ConfigError, match="leave it a rigid motion, limit 0"):
        check(load_config(folder / "loose.yaml"))
