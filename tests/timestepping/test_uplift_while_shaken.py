"""Uplift in gaps that are closed at rest and open while shaken: as at rest, none, or that of the level."""

import json

import numpy as np
import pytest
import xarray as xr
import yaml

from romdam import SuiteOptions, run, run_suite
from romdam.config.load import load_config
from romdam.core.motion import GroundMotion
from romdam.pipelines import export

G, LEVEL, LENGTH = 9.81, 8.0, 10.0
DT = 0.01


def job(water, integrator=None, order="reduced", **joint):
    boxes = {"rock": ([0, 0, -2], [2, LENGTH, 2]), "dam": ([0, 0, 0], [2, LENGTH, 8])}
    return {
        "materials": {"concrete": {"E": 3e10, "nu": 0.2, "rho": 1500}},
        "blocks": {
            name: {"material": "concrete", "box": {"origin": at, "size": size, "element_size": [2, 0.625, 2]}}
            for name, (at, size) in boxes.items()
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "base": {"between": ["rock", "dam"], "normal_stiffness": 1e10, "shear_stiffness": 5e9}
            | {"friction": 1.0}
            | joint
        },
        "loads": {
            "gravity": [0, 0, -G],
            "hydrostatic": [{"level": LEVEL, "faces": [{"block": "dam", "face": "ymin"}]}],
            "joint_water": [
                {"joints": ["base"], "level": LEVEL, "downstream": [0, 1, 0], "crack": "redrawn"} | water
            ],
        },
        "damping": {"rayleigh": {"frequencies": ["5 Hz", "50 Hz"], "ratio": 0.05}},
        "model": {"order": "full"} if order == "full" else {"modes": 12},
        "transient": {"finest_step": 1e-3} | ({"integrator": integrator} if integrator else {}),
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False},
    }


def shaken(keys, peak=2.5):
    t = np.arange(100) * DT
    motion = GroundMotion.from_arrays("pulse", {"y": -peak * np.sin(2 * np.pi * 2.0 * t) * np.exp(-t)}, DT)
    return run(keys, motions=motion).results[0].dataset


@pytest.mark.parametrize(
    ("integrator", "order"),
    [
        (None, "reduced"),
        pytest.param("modal", "reduced", marks=pytest.mark.slow),
        pytest.param(None, "full", marks=pytest.mark.slow),
    ],
)
def test_what_opens_later_has_what_was_asked_for(integrator, order):
    results = {
        earthquake: shaken(job({"earthquake": earthquake}, integrator, order))
        for earthquake in ("frozen", "zero", "full")
    }
    frozen = results["frozen"]
    rest = float(frozen.crack_at_rest.max())
    y = frozen.gap_position.sel(component="y").values
    water = frozen.water_pressure.values * frozen.gap_area.values
    full = 1000 * G * LEVEL * frozen.gap_area.values
    assert 1.0 < rest < 3.0 and "crack_water_force" not in frozen
    for name, more in (("zero", -water), ("full", full - water)):
        result = results[name]
        assert result.water_pressure.values == pytest.approx(frozen.water_pressure.values, rel=1e-7)
        assert result.opening.values[0] == pytest.approx(frozen.opening.values[0], abs=1e-11)
        force, opened = result.crack_water_force.values, result.opening.values > 0.0
        assert (force[0] == 0.0).all() and (force[:, y < rest] == 0.0).all()
        beyond = opened & (y > rest)
        assert beyond.any(axis=0).sum() >= 2
        assert force[beyond] == pytest.approx(np.broadcast_to(more, force.shape)[beyond], rel=1e-7)
        stays = ~opened[1:] & ~opened[:-1]  # what is lost waits for a force that can carry it
        every_step = result.sizes["time"] > 500
        assert name == "zero" or not every_step or (force[1:][stays] == 0.0).all()
        assert float(result.attrs["solver_ledger_imbalance"]) < 1e-8
    widest = {name: float(result.peak_opening.values[0]) for name, result in results.items()}
    assert widest["zero"] < 0.9 * widest["frozen"] and 1.1 * widest["frozen"] < widest["full"], widest


def test_lost_water_is_back_when_the_gap_can_carry_it():
    """A closed gap without water that presses by more than the water would push has it from the next step."""
    result = shaken(job({"earthquake": "zero"}, "modal"))
    water = result.water_pressure.values * result.gap_area.values
    pressed, lost = -result.normal_force.values, result.crack_water_force.values < 0.0
    closed, carries = result.opening.values <= 0.0, pressed >= water
    returns, waits = lost & closed & carries, lost & closed & ~carries
    assert returns[:-1].sum() >= 4 and not (lost[1:] & returns[:-1]).any()
    assert waits[:-1].any() and lost[1:][waits[:-1]].all()


def test_an_initial_gap_that_is_closed_at_rest_is_no_crack():
    """A gap of 0.02 mm, which the weight closes beyond the crack."""
    keys = job({"earthquake": "full"}, gap=2e-5)
    result = shaken(keys)
    rest = float(result.crack_at_rest.max())
    y, force = result.gap_position.sel(component="y").values, result.crack_water_force.values
    assert (force[0] == 0.0).all() and 0.5 < rest < 6.0
    assert (result.opening.values[0][y > rest + 0.625] <= 0.0).all()
    assert force.max() > 0.0


def test_the_unchanged_diagram_without_water_in_what_opens_later():
    result = shaken(job({"crack": "unchanged", "earthquake": "zero"}))
    y, at_rest = result.gap_position.sel(component="y").values, result.opening.values[0] > 0.0
    head = LEVEL * (1.0 - y / LENGTH)
    inside = (y > 0.1) & (y < LENGTH - 0.1)
    assert result.water_pressure.values[inside] == pytest.approx(1000 * G * head[inside], rel=1e-9)
    assert at_rest.any() and np.isnan(result.crack_at_rest.values).all()
    force = result.crack_water_force.values
    assert (force[:, at_rest] == 0.0).all() and force.min() < 0.0


@pytest.mark.parametrize(
    ("earthquake", "said"), [("frozen", "as at rest"), ("zero", "no water"), ("full", "")]
)
def test_warnings_say_what_was_assumed(earthquake, said):
    warnings = json.loads(shaken(job({"earthquake": earthquake})).attrs["run_warnings"])
    found = [text for text in warnings if text.startswith("joint base is open over")]
    assert (len(found) == 1) == bool(said)
    if found:
        assert f"earthquake: {earthquake}" in found[0]


def written(keys, folder):
    """The job in a file, with its record."""
    np.savetxt(folder / "r.txt", -np.sin(4 * np.pi * np.arange(50) * DT))
    record = {"name": "r", "file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}
    (folder / "dam.yaml").write_text(yaml.safe_dump(keys | {"records": [record]}))
    return load_config(folder / "dam.yaml")


@pytest.mark.slow
def test_samples_of_a_suite_have_the_cracks_of_lone_runs(tmp_path):
    """A bond that holds leaves no crack, and the next sample of the same model has its own."""
    bond = {"cohesion": "100 kPa", "tensile_strength": "1 kPa"}
    strengths = {"path": "joints.base.tensile_strength", "values": ["1 kPa", "60 kPa", "2 kPa"]}
    keys = job({"earthquake": "full"}, **bond)
    suite = {"pipeline": "suite", "suite": {"parameters": {"T": strengths}, "keep": "full"}}
    run_suite(written(keys | suite, tmp_path), tmp_path / "out", SuiteOptions(workers=1))
    found = {}
    for path in (tmp_path / "out" / "runs").glob("*.nc"):
        with xr.open_dataset(path) as result:
            found[float(result.attrs["parameter_T"])] = result.load()
    assert sorted(found) == [1e3, 2e3, 6e4]
    assert (found[6e4].crack_at_rest == 0.0).all() and float(found[1e3].crack_at_rest.max()) > 1.0
    keys["joints"]["base"]["tensile_strength"] = "2 kPa"
    lone = run(written(keys, tmp_path), tmp_path / "lone").results[0].dataset
    for name in ("crack_at_rest", "water_pressure", "opening"):
        then = lone[name].values
        assert found[2e3][name].values == pytest.approx(then, rel=1e-6, abs=1e-6 * np.abs(then).max())


def test_a_deck_for_another_code_has_the_uplift_at_rest(tmp_path, monkeypatch):
    built = []

    def build_deck(scene, *rest, **keys):
        built.append(scene)
        return made(scene, *rest, **keys)

    made = export.build.build_deck
    monkeypatch.setattr(export.build, "build_deck", build_deck)
    ready = written(job({}), tmp_path)
    export.export_deck(ready, tmp_path / "deck", export.ExportOptions("opensees"))
    result = run(ready, tmp_path / "out").results[0].dataset
    assert float(result.crack_at_rest.max()) > 1.0
    pressure = built[0].joints["base"].water / built[0].joints["base"].area
    assert pressure == pytest.approx(result.water_pressure.values, rel=1e-6)
