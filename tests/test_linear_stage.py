"""The linear stage: spectra by hand, closed forms and printed numbers; histories; stages together."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from arch_dams import arch_dam
from gravity_dams import gravity_dam
from scipy.linalg import eigh
from typer.testing import CliRunner

import romdam
from romdam.cli import app
from romdam.config import load_config
from romdam.core.errors import ConfigError
from romdam.effects.full_order import assemble_full
from romdam.fem.parts import unknowns
from romdam.fem.stress import stress_operator
from romdam.pipelines.check import check
from romdam.pipelines.linear import linear
from romdam.pipelines.moving_supports import scene_of
from romdam.postprocess.response_spectrum import (
    Spectrum,
    combine_directions,
    cqc,
    largest_normal_stress,
    modal_peaks,
)
from romdam.reduction.natural_modes import natural_modes
from romdam.scene.build import build_scene
from romdam.scene.ties import tie_joints

DT = 0.01  # [s]
POINTS = [[0.02, 3.0], [0.1, 7.0], [0.4, 7.0], [2.0, 1.4]]  # [s], [m/s2]


def spectrum(points=POINTS, factor=1.0):
    """A spectrum as a configuration has it."""
    return {"points": [[period, f"{factor * sa} m/s2"] for period, sa in points]}


@pytest.fixture
def record(tmp_path):
    """Three components of modulated noise, smooth enough for steps of a tenth of the record's."""
    rng, time = np.random.default_rng(3), np.arange(400) * DT
    for axis in "xyz":
        phase = rng.uniform(0, 2 * np.pi, 40)
        waves = np.sin(2 * np.pi * np.linspace(0.5, 20.0, 40)[:, None] * time + phase[:, None])
        np.savetxt(tmp_path / f"{axis}.txt", (rng.uniform(0.2, 1.0, 40) @ waves) * np.sin(np.pi * time / 4.0))
    return {
        "name": "noise",
        "unit": "m/s2",
        "dt": DT,
        "components": {axis: {"file": str(tmp_path / f"{axis}.txt")} for axis in "xyz"},
    }


def tower(record, **more):
    """Two unlike boxes one on the other, turned mortar faces between them, in US units."""
    lower = {"origin": ["0 ft", "0 ft", "0 ft"], "size": ["20 ft", "30 ft", "40 ft"], "element_size": "10 ft"}
    upper = {
        "origin": ["0 ft", "5 ft", "40 ft"],
        "size": ["20 ft", "15 ft", "30 ft"],
        "element_size": ["10 ft", "5 ft", "10 ft"],
    }
    return {
        "materials": {
            "old": {"E": "3e6 psi", "nu": 0.2, "rho": "150 lb/ft3"},
            "new": {"E": "2e6 psi", "nu": 0.1, "rho": "120 lb/ft3"},
        },
        "blocks": {
            "lower": {"material": "old", "box": lower},
            "upper": {"material": "new", "box": upper},
        },
        "supports": [{"block": "lower", "face": "zmin"}],
        "joints": {
            "lift": {
                "between": ["lower", "upper"],
                "normal_stiffness": "20 GPa/m",
                "shear_stiffness": "10 GPa/m",
                "friction": 0.7,
            }
        },
        "loads": {"gravity": [0, 0, "-32.174 ft/s2"], "pressure": [pressed()]},
        "damping": {"rayleigh": {"frequencies": [3.0, 25.0], "ratio": 0.05}},
        "records": [record],
        "model": {"order": "reduced", "modes": 20},
        "transient": {"finest_step": 0.0025},
        "outputs": {
            "plots": False,
            "error_estimate": False,
            "mesh_error": False,
            "nodes": {"top": {"block": "upper", "at": ["20 ft", "20 ft", "70 ft"], "tolerance": "1 ft"}},
            "stress": {
                "strength": "200 psi",
                "blocks": "all",
                "faces": [{"block": "lower", "face": "ymin"}, {"block": "upper", "face": "ymax"}],
                "nodes": {"heel": {"block": "lower", "at": [0, 0, "10 ft"], "tolerance": "1 ft"}},
                "sections": {"foot": {"blocks": ["lower"], "point": [0, 0, "20 ft"]}},
            },
        },
    } | more


def pressed():
    return {"block": "lower", "face": "ymin", "value": "50 psi"}


def full_order(job):
    """Dense matrices of the tied mesh, and what is observed of it."""
    config = load_config(job).config
    scene = build_scene(config, Path(), "s.yaml")
    tied = tie_joints(scene, scene.joints, config.every_joint, "s.yaml")
    return tied, assemble_full(tied, config.damping)


def by_hand(system, rows, cutoff, spectra, alpha_beta, rule):
    """Peaks of rows @ u by own modes, own CQC and own missing mass, each direction of the ground (3, k)."""
    M, K, load = system.M.toarray(), system.K.toarray(), np.asarray(system.load)[:, :3]
    omega2, Phi = eigh(K, M)
    few = omega2 <= (2 * np.pi * cutoff) ** 2
    omega, Phi = np.sqrt(omega2[few]), Phi[:, few]
    xi = (alpha_beta[0] / omega + alpha_beta[1] * omega) / 2
    total = []
    for axis in range(3):
        gamma = Phi.T @ load[:, axis]
        sd = np.array([spectra[axis](2 * np.pi / w, x) / w**2 for w, x in zip(omega, xi, strict=True)])
        r = (rows @ Phi) * (gamma * sd)
        square = np.zeros(len(r))
        for i, wi in enumerate(omega):
            for j, wj in enumerate(omega):
                b = wi / wj
                rho = 8 * np.sqrt(xi[i] * xi[j]) * (b * xi[i] + xi[j]) * b**1.5
                rho /= (
                    (1 - b * b) ** 2
                    + 4 * xi[i] * xi[j] * b * (1 + b * b)
                    + 4 * (xi[i] ** 2 + xi[j] ** 2) * b * b
                )
                square += r[:, i] * r[:, j] * (rho if rule == "cqc" else float(i == j))
        missing = load[:, axis] - M @ (Phi @ gamma)
        stiff = rows @ np.linalg.solve(K, missing) * spectra[axis](1 / cutoff, 0.05)
        total.append(np.sqrt(square + stiff**2))
    return np.array(total), len(omega)


def interpolated(factor):
    T, sa = np.array(POINTS).T
    return lambda period, xi: factor * float(np.exp(np.interp(np.log(period), np.log(T), np.log(sa))))


def rayleigh():
    """alpha, beta of 5 % at 3 and 25 Hz."""
    a, b = 2 * np.pi * 3.0, 2 * np.pi * 25.0
    return 0.1 * a * b / (a + b), 0.1 / (a + b)


@pytest.mark.parametrize("rule", ["cqc", "srss"])
def test_spectrum_against_modal_combination_by_hand(rule, record, tmp_path):
    """Displacement and stress of the full mesh's own modes: three components, two materials, missing mass."""
    stage = {"spectra": {"x": spectrum(), "z": spectrum(factor=0.5)}, "combination": rule}
    job = tower(record, linear_stage=stage)
    outcome = linear(job, tmp_path)
    dataset = outcome.stages["noise"].spectrum
    tied, system = full_order(job)
    rows = system.observe.toarray()
    spectra = (interpolated(1.0), lambda period, xi: 0.0, interpolated(0.5))
    each, modes = by_hand(system, rows, 33.0, spectra, rayleigh(), rule)
    assert dataset.sizes["mode"] == modes == 5
    assert dataset.peak_displacement.values.ravel() == pytest.approx(np.sqrt((each**2).sum(axis=0)), rel=1e-6)
    # at 10 ft: stress of one node by its own operator on the mesh
    nodes = dataset.stress_node_number.values[dataset.stress_block.values == "lower"]
    operator = stress_operator(tied.blocks["lower"], nodes) @ unknowns(tied).of_block["lower"]
    each, _ = by_hand(system, operator.toarray(), 33.0, spectra, rayleigh(), rule)
    expected = np.sqrt((each**2).sum(axis=0)).reshape(-1, 6)
    stress = dataset.peak_stress.values[dataset.stress_block.values == "lower"]
    assert stress == pytest.approx(expected, rel=1e-5, abs=1e-6 * expected.max())
    static = (operator @ np.linalg.solve(system.K.toarray(), system.force)).reshape(-1, 6)
    rest = dataset.static_stress.values[dataset.stress_block.values == "lower"]
    assert rest == pytest.approx(static, rel=1e-5, abs=1e-6 * np.abs(static).max())


def test_turned_model_has_the_same_peaks(record, tmp_path):
    """A quarter turn about z, the spectra turned with it; components of the ground by percentages."""
    job = tower(record, linear_stage={"spectra": {"x": spectrum(), "z": spectrum(factor=0.6)}})
    job["linear_stage"]["directions"] = "100-40-40"
    turned = tower(record, linear_stage={"spectra": {"y": spectrum(), "z": spectrum(factor=0.6)}})
    turned["linear_stage"]["directions"] = "100-40-40"
    for name, origin, size in (
        ("lower", ["-30 ft", "0 ft", "0 ft"], ["30 ft", "20 ft", "40 ft"]),
        ("upper", ["-20 ft", "0 ft", "40 ft"], ["15 ft", "20 ft", "30 ft"]),
    ):
        edges = turned["blocks"][name]["box"]["element_size"]
        edges = edges if isinstance(edges, str) else [edges[1], edges[0], edges[2]]
        turned["blocks"][name]["box"] = {"origin": origin, "size": size, "element_size": edges}
    turned["loads"]["pressure"][0]["face"] = "xmax"
    faces = [{"block": "lower", "face": "xmax"}, {"block": "upper", "face": "xmin"}]
    turned["outputs"]["stress"] |= {"faces": faces}
    turned["outputs"]["nodes"]["top"]["at"] = ["-20 ft", "20 ft", "70 ft"]
    first, second = (
        linear(raw, tmp_path / str(k)).stages["noise"].spectrum for k, raw in enumerate((job, turned))
    )
    assert second.frequency.values == pytest.approx(first.frequency.values, rel=1e-7)
    moved, other = first.peak_displacement.values[0], second.peak_displacement.values[0]
    assert other[[1, 0, 2]] == pytest.approx(moved, rel=1e-6)
    # 100 % of x with 40 % of z, or the other way round
    x, _, z = first.peak_displacement_by_direction.values[:, 0]
    assert moved == pytest.approx(np.maximum(x + 0.4 * z, z + 0.4 * x), rel=1e-12)
    for name in ("max_principal_stress", "static_principal_stress"):
        assert np.sort(second[name].values) == pytest.approx(np.sort(first[name].values), rel=1e-4)
    for name in ("max_joint_tension", "static_normal_force", "peak_normal_force"):
        assert float(second[name][0]) == pytest.approx(float(first[name][0]), rel=1e-4)


def test_joint_force_at_rest_is_the_weight_above(record, tmp_path):
    """Of a column of one section: by stress at the nodes of hex20 within 0.2 %."""
    raw = rod(record) | {"loads": {"gravity": [0, 0, -9.81]}}
    dataset = linear(raw, tmp_path).stages["noise"].spectrum
    assert float(dataset.static_normal_force[0]) == pytest.approx(-2500 * 9.81 * 80.0, rel=2e-3)


def test_five_storeys_of_chopra():
    """Chopra, Dynamics of Structures, 13.8.2: modal base shears and table 13.8.5, 5 % damping, El Centro.

    Printed: base shear 66.066 (SRSS) and 66.507 kips (CQC), periods 2.0, 0.685, 0.435, 0.338, 0.297 s; roof
    6.800 and 6.793 in, from ordinates that are printed with three digits.
    """
    k, m = 31.54, 100 / 386.4  # [kip/in], [kip s2/in]
    K = k * (np.diag([2.0, 2, 2, 2, 1]) - np.diag([1.0] * 4, 1) - np.diag([1.0] * 4, -1))
    omega2, Phi = eigh(K, m * np.eye(5))
    assert 2 * np.pi / np.sqrt(omega2) == pytest.approx([2.0, 0.685, 0.435, 0.338, 0.297], abs=6e-4)
    gamma = Phi.T @ np.full(5, m)
    load, sa = np.zeros((5, 3)), np.zeros((3, 5))
    load[:, 0], sa[0] = gamma, np.array([60.469, 24.533, 9.867, 2.943, 0.595]) / gamma**2
    shear = (m * Phi.sum(axis=0) * omega2)[None]
    for rule, base, roof in (("srss", 66.066, 6.800), ("cqc", 66.507, 6.793)):
        freq, damping = np.sqrt(omega2) / (2 * np.pi), np.full(5, 0.05)
        ordinates = Spectrum(np.arange(5), freq, damping, load, sa, np.zeros(3))
        peaks = modal_peaks(load, omega2, ordinates, rule)
        assert peaks.combined(shear) == pytest.approx(base, abs=1e-3)
        assert peaks.combined(Phi[-1:]) == pytest.approx(roof, rel=1e-3)


def test_correlation_of_equal_and_undamped_modes():
    """Equal modes are one; undamped ones know nothing of each other; the coefficients are symmetric."""
    assert cqc(np.array([5.0, 5.0]), np.array([0.05, 0.05])) == pytest.approx(np.ones((2, 2)))
    assert cqc(np.array([5.0, 5.0, 6.0]), np.zeros(3)) == pytest.approx(np.eye(3))
    rho = cqc(np.array([3.0, 4.0, 9.0]), np.array([0.02, 0.07, 0.1]))
    assert rho == pytest.approx(rho.T, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["srss", "100-40-40", "100-30-30"])
def test_largest_normal_stress_over_all_directions(rule):
    """Against 60,000 directions at random tensors of every sign."""
    rng = np.random.default_rng(0)
    S, B = rng.normal(size=(40, 6)), rng.normal(size=(3, 40, 6, 4))
    C = B @ B.swapaxes(2, 3)
    n = rng.normal(size=(60_000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    x, y, z = n.T
    p = np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * y * z, 2 * x * z])
    R = np.sqrt(np.einsum("dkab,sa,sb->dks", C, p, p, optimize=True))
    if rule == "srss":
        together = np.sqrt((R**2).sum(axis=0))
    else:
        lesser = 0.4 if rule == "100-40-40" else 0.3
        together = lesser * R.sum(axis=0) + (1 - lesser) * R.max(axis=0)
    assert combine_directions(R, rule) == pytest.approx(together)
    brute = (S @ p.T + together).max(axis=1)
    found = largest_normal_stress(S, C, rule)
    assert (found >= brute * (1 - 1e-12)).all() and found == pytest.approx(brute, rel=3e-4)


def rod(record, **stage):
    """A rod along z of two tied halves without Poisson's ratio, held at its foot."""
    box = {"size": [2, 2, 20], "element_size": [2, 2, 1.0], "element": "hex20"}
    return {
        "materials": {"m": {"E": 2500 * 4000.0**2, "nu": 0.0, "rho": 2500}},
        "blocks": {
            "low": {"material": "m", "box": box | {"origin": [0, 0, 0]}},
            "high": {"material": "m", "box": box | {"origin": [0, 0, 20]}},
        },
        "supports": [{"block": "low", "face": "zmin"}],
        "joints": {"j": {"between": ["low", "high"], "normal_stiffness": 1e9, "gap": 0.001}},
        "damping": {"modal": 0.05},
        "records": [record],
        "model": {"order": "reduced", "modes": 10},
        "transient": {"finest_step": DT},
        "outputs": {
            "plots": False,
            "nodes": {"tip": {"block": "high", "at": [2, 2, 40]}},
            "error_estimate": False,
            "mesh_error": False,
        },
        "linear_stage": stage,
    }


def test_rod_in_a_flat_spectrum(record, tmp_path):
    """Fixed-free rod, Sa = a: tip and joint's force by modes of theory below 100 Hz, the rest statically.

    Mode n: f = (2 n - 1) c / 4 L = 25 and 75 Hz; u(z) = 4 / ((2 n - 1) pi) sin(k z) a / w^2; the force at z
    is E A u'. Static: u = rho a (L z - z^2 / 2) / E.
    """
    a, L, c = 2.0, 40.0, 4000.0
    flat = spectrum([[0.001, a], [10.0, a]])
    dataset = linear(rod(record, spectra={"z": flat}, cutoff=100.0), tmp_path).stages["noise"].spectrum
    axial = dataset.effective_mass.values[:, 2] > 1.0
    freq = dataset.frequency.values[axial]
    assert freq == pytest.approx([25.0, 75.0], rel=1e-4)
    k = np.array([1, 3]) * np.pi / 2 / L
    gain = 4 / (np.array([1, 3]) * np.pi) * a / (k * c) ** 2
    tip = gain * np.sin(k * L)
    force = 2500 * c**2 * 4 * gain * k * np.cos(k * 20.0)
    missing_tip = a * L**2 / 2 / c**2 - tip.sum()
    missing_force = 2500 * 4 * a * 20.0 - force.sum()
    b = 1 / 3
    rho = 8 * 0.05**2 * (1 + b) * b**1.5 / ((1 - b * b) ** 2 + 4 * 0.05**2 * b * (1 + b) ** 2)
    for values, missing, found, rel in (
        (tip, missing_tip, dataset.peak_displacement.values[0, 2], 1e-4),
        (force, missing_force, float(dataset.peak_normal_force[0]), 2e-3),
    ):
        hand = np.sqrt(values @ [[1, rho], [rho, 1]] @ values + missing**2)
        assert found == pytest.approx(hand, rel=rel)
    assert float(dataset.modal_mass_share[2]) == pytest.approx(800 / np.pi**2 * (1 + 1 / 9), rel=1e-2)


def test_linear_history_against_newmark_of_the_whole_mesh(record, tmp_path):
    """Displacement, and stress at a node: average acceleration at a twentieth of the step."""
    job = tower(record)
    stage = linear(job, tmp_path).stages["noise"]
    tied, system = full_order(job)
    M, K = system.M.toarray(), system.K.toarray()
    alpha, beta = rayleigh()
    C, load = alpha * M + beta * K, np.asarray(system.load)[:, :3]
    ground = np.array([np.loadtxt(tmp_path / f"{axis}.txt") for axis in "xyz"])
    parts = 20
    h, times = DT / parts, np.arange(len(ground[0])) * DT
    fine = np.arange(parts * (len(times) - 1) + 1) * h
    acc = np.array([np.interp(fine, times, row) for row in ground])
    u = np.linalg.solve(K, system.force)
    v, a = np.zeros_like(u), np.linalg.solve(M, -load @ acc[:, 0])
    inverse = np.linalg.inv(M + h / 2 * C + h * h / 4 * K)
    node = int(np.flatnonzero((np.abs(tied.blocks["lower"].points - [0, 0, 3.048]) < 1e-6).all(axis=1))[0])
    operator = stress_operator(tied.blocks["lower"], np.array([node])) @ unknowns(tied).of_block["lower"]
    shown, stress = [], []
    for n in range(len(fine)):
        if n:
            predicted, speed = u + h * v + h * h / 4 * a, v + h / 2 * a
            a = inverse @ (system.force - load @ acc[:, n] - C @ speed - K @ predicted)
            u, v = predicted + h * h / 4 * a, speed + h / 2 * a
        if n % parts == 0:
            shown.append(system.observe @ u)
            stress.append(operator @ u)
    for run, hand in (
        (stage.history.displacement.values[:, 0], np.array(shown)),
        (stage.history.stress.values[:, 0], np.array(stress)),
    ):
        assert len(run) == len(hand)
        error = np.linalg.norm(run - hand) / np.linalg.norm(hand)
        assert error < 2e-3, error  # Newmark's own: 16 times as much at steps four times as long
    assert stage.history.attrs["title"].endswith("linear, joints tied")


def test_spectrum_of_a_record_bounds_a_single_mode(record, tmp_path):
    """With one mode below the cut-off the spectrum of the record is its history's own peak."""
    raw = rod(record, cutoff=30.0)
    raw["records"] = [record | {"components": {"z": record["components"]["z"]}}]
    stage = linear(raw, tmp_path).stages["noise"]
    tip = float(stage.spectrum.peak_displacement[0, 2])
    history = float(np.abs(stage.history.displacement.values[:, 0, 2]).max())
    assert tip == pytest.approx(history, rel=0.03)  # the static rest is in phase with the ground in truth


def test_weight_stands_on_open_joints_where_it_is_staged(record, tmp_path):
    """The static stress of staged weight is that of blocks which stand alone, not of the tied whole."""
    raw = gravity_dam() | {
        "loads": {"gravity": [0, 0, -9.81], "weight": "staged"},
        "damping": {"rayleigh": {"frequencies": [3, 20], "ratio": 0.05}},
        "records": [record],
        "model": {"order": "reduced", "modes": 10},
        "transient": {"finest_step": 0.0025},
        "outputs": {
            "stress": {"blocks": ["monolith_2"]},
            "plots": False,
            "error_estimate": False,
            "mesh_error": False,
        },
    }
    raw["gravity_dam"]["joints"]["base"] = "tied"
    staged = linear(raw, tmp_path / "a").stages["noise"].spectrum
    raw["loads"]["weight"] = "monolithic"
    whole = linear(raw, tmp_path / "b").stages["noise"].spectrum
    raw["loads"]["weight"] = "staged"
    nonlinear = romdam.run(raw, tmp_path / "c").results[0].dataset
    rest = nonlinear.start_principal_stress.values
    scale = np.abs(rest).max()
    assert staged.static_principal_stress.values == pytest.approx(rest, abs=1e-3 * scale)
    assert np.abs(whole.static_principal_stress.values - rest).max() > 0.05 * scale


@pytest.mark.slow
def test_stages_in_one_command_and_one_table(record, tmp_path):
    """Records of a job with `linear_stage`: files, the table of all three, and `romdam linear` the same."""
    raw = tower(record, linear_stage={"directions": "100-30-30"})
    job = load_config(raw)
    (tmp_path / "job.yaml").write_text(job.to_yaml())
    assert load_config(tmp_path / "job.yaml").config.linear_stage.directions == "100-30-30"
    run = CliRunner().invoke(app, ["run", str(tmp_path / "job.yaml"), "-o", str(tmp_path / "r")])
    assert run.exit_code == 0, run.output
    for words in ("Stages of the analysis, noise", "largest opening", "tension across the joint"):
        assert words in run.output
    alone = CliRunner().invoke(app, ["linear", str(tmp_path / "job.yaml"), "-o", str(tmp_path / "l")])
    assert alone.exit_code == 0, alone.output
    for name in ("noise.nc", "noise-spectrum.nc", "noise-stages.csv"):
        assert (tmp_path / "r" / "linear" / name).is_file() and (tmp_path / "l" / "linear" / name).is_file()
    both = [xr.open_dataset(tmp_path / one / "linear" / "noise-spectrum.nc") for one in "rl"]
    xr.testing.assert_equal(*both)
    tables = [(tmp_path / one / "linear" / "noise-stages.csv").read_text().splitlines() for one in "rl"]
    assert tables[1][1].endswith("-") and not tables[0][1].endswith("-")
    (table,) = romdam.run(raw, tmp_path / "p").stages
    assert {len(row) for row in table.rows} == {6}
    linear_opening = [row for row in table.rows if row[0] == "largest opening"]
    assert [row[3:5] for row in linear_opening] == [("-", "-")] and float(linear_opening[0][5]) >= 0.0
    tell_spectrum(tmp_path / "l" / "linear" / "noise-spectrum.nc", tables[1])


def tell_spectrum(path, stages):
    """`romdam info` of a spectrum has the numbers of the table of stages, as lines and as JSON."""
    dataset = xr.load_dataset(path)
    numbers = [name for name, values in dataset.variables.items() if values.dtype == np.float64]
    assert all(dataset[name].attrs["units"] for name in numbers)
    table = {row[0]: row[3] for row in csv.reader(stages)}
    told = CliRunner().invoke(app, ["info", str(path)])
    assert told.exit_code == 0, told.output
    lines = told.output.splitlines()
    assert lines[3] == "combination    modes by cqc, directions by 100-30-30, joints tied"
    assert lines[4].startswith("modes          5 below 33 Hz: 9.087, ")
    x, y, z = (table[f"largest displacement {axis}"] for axis in "xyz")
    assert f"displacement   top: x {x}, y {y}, z {z} mm at most, either sign" in lines
    tension = table["largest tension across the joint"]
    assert any(line.startswith(f"joint          lift: tension {tension} MPa at most") for line in lines)
    said = json.loads(CliRunner().invoke(app, ["info", "--json", str(path)]).output)
    assert said["frequencies_Hz"] == pytest.approx(dataset.frequency.values, rel=1e-15)
    joint = said["joints"]["lift"]
    force = 1e-6 * (joint["static_normal_force_N"] + joint["peak_normal_force_N"])
    assert f"{force:.4g}" == table["largest normal force, tension > 0"]
    outside = dataset.max_principal_stress.values[dataset.stress_ring.values == 0]
    assert said["stress"]["largest_principal_Pa"] == outside.max()
    other = path.with_name("other-spectrum.nc")
    dataset.frequency.attrs["units"] = "1/min"
    dataset.to_netcdf(other, engine="h5netcdf")
    refused = CliRunner().invoke(app, ["info", str(other)])
    assert refused.exit_code != 0 and "frequency must have the units 'Hz'" in str(refused.exception)


def test_scene_is_built_and_its_warnings_are_said_once(record, tmp_path, monkeypatch, caplog):
    """With the nonlinear run; results hold the warnings, those of the linear stage its own too."""
    raw = tower(record, linear_stage={})
    raw["transient"]["duration"] = "0.2 s"
    raw["joints"]["lift"]["gap"] = "1 mm"
    raw["joints"]["lift"]["normal_stiffness"] = "auto"
    built = []
    for module in (romdam.pipelines.run, romdam.pipelines.linear, romdam.pipelines.check):
        monkeypatch.setattr(module, "scene_of", lambda job: built.append(1) or scene_of(job))
    both, tied = "joints: normal_stiffness: auto is", "linear_stage: initial gaps of up to 1 mm are taken"
    for count, call in enumerate((romdam.run, linear), 1):
        caplog.clear()
        call(load_config(raw), tmp_path / str(count))
        said = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
        words = (both, tied, "outputs.stress.ring: it leaves out")
        assert [sum(part in text for text in said) for part in words] == [1, 1, 1]
        assert len(built) == count
        doubts = xr.load_dataset(tmp_path / str(count) / "linear" / "noise.nc").attrs["configuration_doubts"]
        assert both in doubts and tied in doubts and "joints with friction alone" not in doubts
    doubts = xr.load_dataset(tmp_path / "1" / "noise.nc").attrs["configuration_doubts"]
    assert both in doubts and tied not in doubts and "joints with friction alone" in doubts
    warnings = check(raw).warnings
    assert len(built) == 3
    assert [sum(part in text for text in warnings) for part in (both, tied)] == [1, 1]


def test_record_that_cannot_be_read_does_not_stop_the_others(record, tmp_path):
    raw = tower(record)
    raw["records"] = [record, record | {"name": "gone", "components": {"x": {"file": "/nowhere.txt"}}}]
    (tmp_path / "job.yaml").write_text(load_config(raw).to_yaml())
    run = CliRunner().invoke(app, ["linear", str(tmp_path / "job.yaml"), "-o", str(tmp_path / "r")])
    assert run.exit_code == 1 and "gone: " in run.output
    assert (tmp_path / "r" / "linear" / "noise-stages.csv").is_file()


REFUSED = {
    "suite": ({"pipeline": "suite", "suite": {"scales": [1.0]}}, "other runs"),
    "full": ({"model": {"order": "full"}}, "model.order is full"),
    "force": (
        {
            "loads": {
                "force_history": [
                    {"table": "f.csv", "unit": "kPa", "block": "lower", "face": "ymax"},
                ]
            }
        },
        "no response spectrum knows",
    ),
    "short": ({"linear_stage": {"spectra": {"x": spectrum([[0.05, 1.0], [1.0, 1.0]])}}}, "from 0.05 to 1 s"),
    "none": ({"linear_stage": {"spectra": {"damping": 0.02}}}, "at least one of `x`, `y` and `z`"),
    "critical": ({"damping": {"rayleigh": {"alpha": 0.0, "beta": 0.05}}}, "limit 1"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_by_run_linear_and_check(name, record, tmp_path):
    keys, words = REFUSED[name]
    raw = tower(record, linear_stage={}) | keys
    for call in (check, lambda job: romdam.run(job, tmp_path), lambda job: linear(job, tmp_path)):
        with pytest.raises(ConfigError, match=words):
            call(raw)


def test_what_couples_modes_is_refused(record):
    moving = tower(record, linear_stage={})
    moving["supports"] = [{"block": "lower", "face": "zmin", "motion": {"delay": "0.1 s"}}]
    with pytest.raises(ConfigError, match="several motions"):
        load_config(moving)


def test_job_without_the_section_has_the_defaults(record, tmp_path):
    raw = tower(record, pipeline="suite", suite={"scales": [1.0]})
    with pytest.raises(ConfigError, match="pipeline: suite has other runs"):
        linear(raw, tmp_path)
    with pytest.raises(ConfigError, match="give a folder"):
        romdam.run(tower(record, linear_stage={}))


@pytest.mark.slow
def test_arch_dam_with_water_and_three_components(record, tmp_path):
    """Mortar joints, temperature, incompressible water: modes are the mesh's, spectrum and history agree."""
    wet = [{"block": f"C{k}", "face": "upstream"} for k in (1, 2, 3, 4)]
    raw = arch_dam() | {
        "loads": {"gravity": [0, 0, -9.81], "weight": "staged", "temperature": [{"change": "-4 K"}]},
        "water": {"level": 90.0, "faces": wet, "model": "incompressible", "upstream": [0, -1, 0]},
        "damping": {"rayleigh": {"frequencies": [3, 20], "ratio": 0.05}},
        "records": [record],
        "model": {"order": "reduced", "modes": 10},
        "transient": {"finest_step": 0.0025},
        "outputs": {"plots": False},
        "linear_stage": {"cutoff": 15.0},
    }
    stage = linear(raw, tmp_path).stages["noise"]
    config = load_config(raw).config
    scene = build_scene(config, Path(), "s.yaml")
    tied = tie_joints(scene, scene.joints, config.every_joint, "s.yaml")
    modes = natural_modes(tied, config.damping, stage.spectrum.sizes["mode"])
    assert stage.spectrum.frequency.values == pytest.approx(modes.freq, rel=5e-3)  # the last; the first 1e-7
    assert stage.spectrum.frequency.values[:5] == pytest.approx(modes.freq[:5], rel=1e-5)
    assert stage.spectrum.damping_ratio.values[:5] == pytest.approx(modes.damping_ratio[:5], rel=1e-5)
    masses = stage.spectrum.effective_mass.values.sum(axis=0)
    assert masses == pytest.approx(modes.effective_mass.sum(axis=0), rel=3e-3)
    assert stage.spectrum.total_mass.values == pytest.approx(modes.total_mass, rel=1e-12)
    ratio = stage.spectrum.max_joint_tension / stage.spectrum.history_max_joint_tension
    assert (ratio > 0.6).all() and (ratio < 2.0).all()
