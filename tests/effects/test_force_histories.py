"""Forces that vary in time: against closed forms, static loads that act at once, and own integrations."""

import copy
import json

import numpy as np
import pytest

import romdam
from romdam.config import parse_config
from romdam.core.motion import ForceSignal, GroundMotion
from romdam.effects.full_order import assemble_full
from romdam.records.processing.force_rows import lost_at_steps, step_of_signals
from romdam.scene.build import build_scene

DT = 1e-3
COLUMN = {
    "materials": {"concrete": {"E": "30 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
    "blocks": {
        "left": {
            "material": "concrete",
            "box": {"origin": [0, -4, 0], "size": [4, 4, 20], "element_size": [4, 4, 2.5]},
        },
        "right": {
            "material": "concrete",
            "box": {"origin": [0, 0, 0], "size": [4, 6, 20], "element_size": [4, 3, 2.5]},
        },
    },
    "supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "zmin"}],
    "joints": {
        "middle": {
            "between": ["left", "right"],
            "normal_stiffness": "4 GPa/m",
            "shear_stiffness": "2 GPa/m",
            "friction": 0.5,
        }
    },
    "damping": {"rayleigh": {"frequencies": ["3 Hz", "30 Hz"], "ratio": "5 %"}},
    "model": {"modes": 12},
    "transient": {"finest_step": "0.25 ms"},
    "outputs": {
        "plots": False,
        "mesh_error": False,
        "error_estimate": False,
        "nodes": {"tip": {"block": "left", "at": [0, -4, 20]}, "top": {"block": "right", "at": [0, 6, 20]}},
    },
}
SHAKER = {"block": "left", "at": [0, -4, 20], "direction": [0, 1, 0], "unit": "kN"}
FULL = {"model": {"order": "full"}, "transient": {"finest_step": "1 ms", "rho_inf": 1.0}}


def with_keys(*histories, **keys):
    """The columns with force histories, and keys changed; dots in names are two underscores."""
    job = copy.deepcopy(COLUMN)
    job["loads"] = {"force_history": list(histories)} if histories else {}
    for path, value in keys.items():
        *sections, last = path.split("__")
        at = job
        for name in sections:
            at = at.setdefault(name, {})
        at[last] = value
    return job


def still(seconds=1.0, dt=DT):
    return GroundMotion("still", np.zeros((3, round(seconds / dt) + 1)), dt)


def shaken(seconds=1.0, dt=DT):
    time = dt * np.arange(round(seconds / dt) + 1)
    acc = np.zeros((3, len(time)))
    acc[1] = 4.0 * np.sin(2 * np.pi * 5.0 * time) * np.sin(np.pi * np.minimum(time / 0.6, 1.0)) ** 2
    return GroundMotion("shaken", acc, dt)


def table(folder, time, force, name="force.csv"):
    rows = "\n".join(f"{t!r},{f!r}" for t, f in zip(map(float, time), map(float, force), strict=True))
    (folder / name).write_text(f"time,force\n{rows}\n")
    return str(folder / name)


def result(job, motion=None):
    return romdam.run(job, motions=motion or still()).results[0].dataset


@pytest.mark.parametrize("order", ["reduced", "full order"])
@pytest.mark.parametrize("frequency", [4.0, 9.0])
def test_a_shaker_alone_moves_a_column_as_its_dynamic_stiffness_says(order, frequency, tmp_path):
    """Steady state of the mesh, (K - omega^2 M + i omega C) u = F, of a column alone; no record shakes it."""
    seconds, omega = 4.0, 2 * np.pi * frequency
    time = DT * np.arange(4001)
    force = np.sin(omega * time) * np.minimum(time / 1.0, 1.0)
    shaker = SHAKER | {"table": table(tmp_path, time, 500.0 * force)}
    keys = {"joints": {}, "damping__rayleigh": {"frequencies": [3.0, 30.0], "ratio": 0.08}}
    keys |= FULL if order == "full order" else {}
    job = with_keys(shaker, **keys)
    found = result(job, still(seconds)).displacement.sel(node="tip").values[-250:]
    raw = copy.deepcopy(job)
    raw["records"] = [{"file": "none.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}]
    config = parse_config(raw, "s.yaml")
    system = assemble_full(build_scene(config, tmp_path, "s.yaml"), config.damping)
    dynamic = (system.K - omega**2 * system.M + 1j * omega * system.C).toarray()
    load = system.observe[:3].T @ np.array([0.0, 5e5, 0.0])
    steady = system.observe[:3] @ np.linalg.solve(dynamic, load)
    expected = np.imag(steady * np.exp(1j * omega * time[-250:, None]))
    # Newmark's steps of 1 ms lengthen the period by (omega h)^2 / 12
    assert np.abs(found - expected).max() < (3e-3 if order == "reduced" else 5e-3) * np.abs(steady).max()


@pytest.mark.parametrize(
    "keys", [{}, FULL, {"transient__integrator": "modal"}], ids=["adaptive", "full", "modal"]
)
@pytest.mark.parametrize("kind", ["force", pytest.param("pressure", marks=pytest.mark.slow)])
def test_what_acts_at_once_and_stays_is_a_static_load_on_an_undeformed_start(keys, kind, tmp_path):
    """The same load by another key, with a joint that opens, slides and is shaken, at every step."""
    path = table(tmp_path, [0.0, 0.1], [1.0, 1.0])
    if kind == "force":
        by_table = SHAKER | {"direction": [1, -2, 2], "scale": 900.0, "after": "hold"}
        static = {"force": [{"block": "left", "at": [0, -4, 20], "force": ["300 kN", "-600 kN", "600 kN"]}]}
    else:
        by_table = {"block": "left", "face": "ymin", "unit": "kPa", "scale": 25.0, "after": "hold"}
        static = {"pressure": [{"block": "left", "face": "ymin", "value": "25 kPa"}]}
    undeformed = {"initial_state": "undeformed"}
    histories = with_keys(by_table | {"table": path}, **keys)
    histories["loads"] |= undeformed
    plain = with_keys(**keys)
    plain["loads"] = static | undeformed
    one, other = result(histories, shaken()), result(plain, shaken())
    for name in ("displacement", "velocity", "opening", "slip", "normal_force", "energy_input"):
        own, expected = one[name].values[1:], other[name].values[1:]
        if name == "energy_input":  # what acts at once strains high modes at t = 0, or is there before
            own, expected = own - own[0], expected - expected[0]
        np.testing.assert_allclose(own, expected, rtol=0, atol=2e-6 * np.abs(expected).max(), err_msg=name)
    assert float(one.opening.max()) > 1e-5 and float(abs(one.slip).max()) > 1e-6


def test_static_answer_is_that_of_the_mesh_with_one_mode(tmp_path):
    """A force that grows slowly and stays: local flexibility is in the basis, whatever its modes."""
    shaker = SHAKER | {"table": table(tmp_path, [0, 3], [0, 800]), "after": "hold", "direction": [3, 4, 0]}
    keys = {"joints": {}, "damping__rayleigh": {"frequencies": [3.0, 30.0], "ratio": 0.3}}
    job = with_keys(shaker, model={"modes": 1}, **keys)
    found = result(job, still(5.0, 5e-3)).displacement.values[-1]
    plain = with_keys(model={"order": "full"}, transient={"finest_step": "5 ms"}, **keys)
    plain["loads"] = {"force": [{"block": "left", "at": [0, -4, 20], "force": [480e3, 640e3, 0]}]}
    expected = result(plain, still(0.01, 5e-3)).displacement.values[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_equal_and_opposite_forces_do_nothing(tmp_path):
    path = table(tmp_path, [0, 0.05, 0.3], [0, 700, -200])
    there = {"block": "left", "face": "zmax", "unit": "kN", "table": path, "direction": [1, 1, 0]}
    both = with_keys(there, there | {"direction": [-1, -1, 0]}, joints={})
    alone = result(with_keys(there, joints={})).displacement
    assert float(abs(result(both).displacement).max()) < 1e-12 * float(abs(alone).max())


def test_a_pressure_is_the_total_force_along_the_normal(tmp_path):
    """On a plane face of 4 m by 20 m: 1 kPa are 80 kN, written as what acts."""
    path = table(tmp_path, [0, 0.05, 0.3], [0, 30, -10])
    wave = {"block": "left", "face": "ymin", "unit": "kPa", "table": path}
    total = wave | {"unit": "kN", "direction": [0, 5, 0], "scale": 80.0}
    one, other = result(with_keys(wave)), result(with_keys(total))
    np.testing.assert_allclose(
        one.displacement, other.displacement, rtol=0, atol=1e-11 * float(abs(one.displacement).max())
    )
    np.testing.assert_allclose(one.applied_force, other.applied_force, rtol=1e-12)
    exact = 8e4 * np.interp(one.time, [0, 0.05, 0.3], [0, 30, -10], right=0.0)
    np.testing.assert_allclose(one.applied_force.values[:, 0], exact, atol=1e-6)
    assert one.force_history.values.tolist() == ["loads.force_history[0]"]


def test_a_turned_model_in_us_units_moves_as_the_other(tmp_path):
    """x to y, y to -x; feet, kips and psi."""
    path = table(tmp_path, [0, 0.05, 0.3], [0, 700, -200])
    first = result(with_keys(SHAKER | {"table": path, "direction": [1, 2, 0], "start": "0.1 s"}))
    feet, kip = 1.0 / 0.3048, 1.0 / 4448.2216152605
    ft = [lambda x: f"{x * feet!r} ft"][0]
    turned = with_keys(
        {
            "block": "left",
            "at": [ft(4), ft(0), ft(20)],
            "direction": [-2, 1, 0],
            "unit": "kip",
            "scale": 1000.0 * kip,
            "table": path,
            "start": "100 ms",
        }
    )
    boxes = {"left": ([0, 0, 0], [4, 4, 20], [4, 4, 2.5]), "right": ([-6, 0, 0], [6, 4, 20], [3, 4, 2.5])}
    turned["blocks"] = {
        name: {
            "material": "concrete",
            "box": {
                key: [ft(x) for x in values]
                for key, values in zip(("origin", "size", "element_size"), box, strict=True)
            },
        }
        for name, box in boxes.items()
    }
    turned["outputs"]["nodes"] = {
        "tip": {"block": "left", "at": [4, 0, 20]},
        "top": {"block": "right", "at": [-6, 0, 20]},
    }
    found = result(turned)
    own = found.displacement.values[:, :, [1, 0, 2]] * [1, -1, 1]
    expected = first.displacement.values
    np.testing.assert_allclose(own, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize(
    "keys", [{}, FULL, {"transient": {"accuracy": "1 %"}}], ids=["adaptive", "full", "auto"]
)
def test_its_work_is_in_the_ledger(keys, tmp_path):
    """The integral of force times velocity of the node, of a shaker alone."""
    time = np.linspace(0, 0.8, 161)
    path = table(tmp_path, time, 600 * np.sin(2 * np.pi * 5 * time))
    dataset = result(with_keys(SHAKER | {"table": path}, **keys))
    velocity = dataset.velocity.sel(node="tip", component="y").values
    force = dataset.applied_force.values[:, 0]
    work = (
        np.concatenate([[0.0], np.cumsum(0.5 * (force * velocity)[1:] + 0.5 * (force * velocity)[:-1])]) * DT
    )
    scale = np.abs(work).max()
    assert np.abs(dataset.energy_input.values - work).max() < 0.02 * scale
    assert dataset.attrs["solver_ledger_imbalance"] < 1e-9


def test_a_block_that_a_force_pushes_slides_as_a_rigid_one(tmp_path):
    """Newmark's block without an earthquake: P - mu m g accelerates it, and friction stops it."""
    mass, mu, g = 2400.0 * 4 * 4 * 1, 0.4, 9.81
    time, share = np.array([0.0, 0.2, 0.3, 0.8, 0.9]), np.array([0.0, 0.0, 1.6, 1.6, 0.0])
    path = table(tmp_path, time, share * mu * mass * g / 1e3)
    sole = {"element_size": [4, 4, 1]}
    job = {
        "materials": {"stiff": {"E": "300 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
        "blocks": {
            "base": {"material": "stiff", "box": sole | {"origin": [-4, -4, -1], "size": [12, 12, 1]}},
            "block": {"material": "stiff", "box": sole | {"origin": [0, 0, 0], "size": [4, 4, 1]}},
        },
        "supports": [{"block": "base", "face": "zmin"}],
        "joints": {
            "sole": {
                "between": ["base", "block"],
                "normal_stiffness": "40 GPa/m",
                "shear_stiffness": "20 GPa/m",
                "friction": mu,
            }
        },
        "loads": {
            "gravity": [0, 0, -g],
            "force_history": [
                {"block": "block", "face": "zmin", "direction": [3, 4, 0], "unit": "kN", "table": path}
            ],
        },
        "damping": {"rayleigh": {"frequencies": ["20 Hz", "200 Hz"], "ratio": "5 %"}},
        "model": {"modes": "all"},
        "transient": {"finest_step": "0.25 ms"},
        "outputs": COLUMN["outputs"] | {"nodes": {"corner": {"block": "block", "at": [0, 0, 1]}}},
    }  # fmt: skip
    dataset = result(job, still(1.6))
    slip = dataset.displacement.values[-1, 0] - dataset.displacement.values[0, 0]
    fine = np.linspace(0, 1.6, 160001)
    net = np.interp(fine, time, share) * mu * g
    v = d = 0.0
    for a in net:
        v = max(0.0, v + (a - mu * g) * 1e-5) if v > 0.0 or a > mu * g else 0.0
        d += v * 1e-5
    assert d > 0.3
    np.testing.assert_allclose(slip[:2], np.array([0.6, 0.8]) * d, rtol=3e-3)


def test_forces_act_with_every_record_and_no_scale_of_one_is_theirs(tmp_path):
    """Linear without a joint: shaken and pushed is the sum of both; twice the record leaves the push."""
    path = table(tmp_path, [0, 0.05, 0.3], [0, 700, -200])
    whole = {"joints": {}, "model": {"modes": "all"}}  # of the same basis with and without the push
    job = with_keys(SHAKER | {"table": path}, **whole)
    quake = shaken()
    twice = GroundMotion("twice", 2.0 * quake.acc, DT)
    outcome = romdam.run(job, tmp_path / "out", motions=[quake, twice])
    both, doubled = (found.dataset.displacement.values for found in outcome.results)
    push = result(job).displacement.values
    shake = result(with_keys(**whole), quake).displacement.values
    scale = np.abs(doubled).max()
    np.testing.assert_allclose(both, push + shake, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(doubled, push + 2.0 * shake, rtol=0, atol=1e-9 * scale)


def test_the_table_is_in_the_digest_of_the_scene(tmp_path):
    digests = []
    for last in (-200, -201):
        path = table(tmp_path, [0, 0.05, 0.3], [0, 700, last])
        digests.append(result(with_keys(SHAKER | {"table": path}), still(0.05)).attrs["scene_sha256"])
    assert digests[0] != digests[1]


def test_statements_of_error_know_the_forces(tmp_path):
    """Modes, steps and floor spectra of a shaker alone; a certificate and the unreduced mesh agree."""
    time = np.linspace(0, 0.8, 161)
    path = table(tmp_path, time, 900 * np.sin(2 * np.pi * 5 * time) * np.minimum(time / 0.2, 1))
    job = with_keys(
        SHAKER | {"table": path}, outputs__error_estimate=True, outputs__floor_spectra={"dampings": [0.05]}
    )
    dataset = result(job)
    assert "Leaving out modes changes the openings by about" in dataset.attrs["error_estimate"]
    assert 0.0 < dataset.attrs["solver_estimated_time_error"] < 0.2
    fine = FULL | {"transient": {"finest_step": "0.25 ms"}, "outputs__output_interval": "1 ms"}
    full = result(with_keys(SHAKER | {"table": path}, **fine))
    own, mesh = dataset.opening.values, full.opening.values
    true = np.linalg.norm(own - mesh) / np.linalg.norm(mesh)
    assert true < 0.05
    assert float(dataset.floor_spectrum_error.median()) < 0.05


@pytest.mark.slow
def test_a_certificate_holds_the_true_error_of_a_run_with_a_shaker(tmp_path):
    """Beside a weak record; the interval against the unreduced mesh, all of the record."""
    time = np.linspace(0, 0.8, 161)
    path = table(tmp_path, time, 900 * np.sin(2 * np.pi * 5 * time) * np.minimum(time / 0.2, 1))
    np.savetxt(tmp_path / "weak.txt", shaken(1.0, 2e-3).acc[1] / 10)
    raw = with_keys(SHAKER | {"table": path}, model={"modes": 3}, outputs__output_interval="2 ms")
    raw["records"] = [{"file": "weak.txt", "unit": "m/s2", "dt": "2 ms", "components": {"y": 1}}]
    raw["joints"]["middle"] = {"between": ["left", "right"], "normal_stiffness": "4 GPa/m"}
    job = romdam.load_config(raw, tmp_path)
    paths = romdam.run(job, tmp_path / "out").paths
    raw |= {"model": {"order": "full"}, "transient": {"finest_step": "0.125 ms", "rho_inf": 1.0}}
    full = romdam.run(romdam.load_config(raw, tmp_path)).results[0].dataset.opening.values
    with romdam.open_result(paths[0]) as opened:
        own = opened.dataset.opening.values
    true = np.linalg.norm(own - full) / np.linalg.norm(full)
    certified = romdam.certify(paths[0])
    stated = certified.statement.errors["opening"].l2
    assert 0.5 < stated / true < 2.0, (stated, true)


def test_steps_follow_a_table_that_is_finer_than_the_record(tmp_path):
    """A record of 10 ms and a table of 2 ms: the base step is 2 ms; rows are written as asked."""
    time = np.arange(0.0, 0.5001, 0.002)
    path = table(tmp_path, time, 300 * np.sin(2 * np.pi * 40 * time))
    motion = still(1.0, 0.01)
    dataset = result(with_keys(SHAKER | {"table": path}, outputs__output_interval="10 ms"), motion)
    assert dataset.attrs["solver_base_step"] == pytest.approx(0.002)
    assert dataset.sizes["time"] == 101
    assert not any("miss" in text for text in json.loads(dataset.attrs["run_warnings"]))


def test_what_steps_miss_of_a_force_is_a_warning_with_its_share(tmp_path):
    """A pulse of 2 ms at steps of 10 ms / 8; its share in L2 by hand."""
    signal = ForceSignal("f", np.array([0.011, 0.012, 0.013]), np.array([0.0, 1.0, 0.0]))
    assert lost_at_steps(signal, 0.01, 0.1) == pytest.approx(1.0)  # no step sees it
    ramp = ForceSignal("f", np.array([0.0, 0.005, 0.01]), np.array([0.0, 1.0, 0.0]))
    assert lost_at_steps(ramp, 0.005, 0.1) == pytest.approx(0.0, abs=1e-12)
    assert step_of_signals(0.01, [ramp]) == pytest.approx(0.005)
    assert step_of_signals(0.01, [signal]) == pytest.approx(0.01 / 8)
    path = table(tmp_path, [0.0111, 0.0112, 0.0131], [0, 500, 0])
    found = json.loads(result(with_keys(SHAKER | {"table": path}), still(0.2, 0.01)).attrs["run_warnings"])
    assert any("loads.force_history[0]: steps of 0.00125 s miss" in text for text in found)
    late = json.loads(
        result(with_keys(SHAKER | {"table": path, "start": "3 s"}), still(0.2)).attrs["run_warnings"]
    )
    assert any("so it does nothing" in text for text in late)


GOOD = "time,force\n0,0\n1,5\n"
REFUSED = {
    "times that fall": ({}, "time,force\n0,0\n2,1\n1,5\n", "line 4: the time 1 s does not rise over 2 s"),
    "times that stand": ({}, "time,force\n0,0\n1,1\n1,5\n", "line 4: the time 1 s does not rise"),
    "a time before": ({}, "time,force\n-1,0\n1,5\n", "line 2: the first time is -1 s, limit 0 s"),
    "one row": ({}, "time,force\n0,0\n", "has 1 rows, at least 2"),
    "no force": ({}, "time,force\n0,0\n1,0\n", "no force but zero"),
    "no number": ({}, "time,force\n0,0\n1,x\n", "line 3: force must be a finite number"),
    "no column": ({}, "t,force\n0,0\n1,1\n", "lacks column time"),
    "no node": ({"at": [9, 9, 9]}, GOOD, r"force_history\[0\].at: no node of block 'left' within 0.001 m"),
    "no face": ({"at": None, "face": "crest"}, GOOD, "block 'left' has no face 'crest'"),
    "two places": ({"face": "zmax"}, GOOD, "exactly one of `at`, a node, and `face`"),
    "no direction": ({"direction": None}, GOOD, "`direction` of the force at a node is missing"),
    "direction zero": ({"direction": [0, 0, 0]}, GOOD, "`direction` must not be zero"),
    "a length": ({"unit": "m"}, GOOD, "must be a unit of force such as kN, or of pressure"),
    "pressure at a node": ({"unit": "kPa"}, GOOD, "`unit` must be one of force, got 'kPa'"),
    "force as pressure": (
        {"at": None, "face": "zmax", "direction": None}, GOOD, "`unit` must be one of pressure"
    ),
    "a block": ({"block": "lift"}, GOOD, r"force_history\[0\].block: no 'lift' is defined"),
    "a support": ({"at": None, "face": "zmin"}, GOOD, "supports hold all 4 nodes of block 'left'"),
    "no table": ({"table": "none.csv"}, GOOD, "cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_input_is_refused(case, tmp_path):
    keys, text, message = REFUSED[case]
    (tmp_path / "force.csv").write_text(text)
    entry = {**SHAKER, "table": str(tmp_path / "force.csv")} | keys
    entry = {key: value for key, value in entry.items() if value is not None}
    with pytest.raises(romdam.ConfigError, match=message):
        romdam.run(with_keys(entry), motions=still())


def test_integrators_and_decks_that_do_not_know_it_say_so(tmp_path):
    from romdam.pipelines.export import ExportOptions, export_deck, export_matrices

    entry = SHAKER | {"table": table(tmp_path, [0, 1], [0, 5])}
    bare = with_keys(entry, damping={})
    bare["joints"]["middle"] = {"between": ["left", "right"], "normal_stiffness": "4 GPa/m"}
    with pytest.raises(romdam.ConfigError, match="conserving knows the motion of the base alone"):
        romdam.run(bare, motions=still())
    np.savetxt(tmp_path / "pulse.txt", np.sin(np.arange(100) / 5.0))
    raw = with_keys(entry) | {
        "records": [{"file": "pulse.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}]
    }
    job = romdam.load_config(raw, tmp_path)
    with pytest.raises(romdam.ConfigError, match=r"loads\.force_history is not written for other codes"):
        export_deck(job, tmp_path / "deck", ExportOptions("calculix"))
    with pytest.raises(romdam.ConfigError, match=r"loads\.force_history is not written as matrices"):
        export_matrices(job, tmp_path / "matrices")


@pytest.mark.parametrize("case", ["moving supports", "mirror images", "water and grouting"])
def test_steps_that_are_cut_agree_with_the_unreduced_mesh(case, tmp_path):
    """Rows of forces stand behind those of supports; one push breaks the symmetry of equal columns."""
    path = table(tmp_path, [0, 0.1, 0.25, 0.6], [0, 900, -700, 300])
    job = with_keys(SHAKER | {"table": path, "direction": [0, 1, 0.2]}, outputs__output_interval="2 ms")
    job["model"] = {"modes": "all"}
    if case == "moving supports":
        for support in job["supports"]:
            support["motion"] = {"delay": 0.02} if support["block"] == "left" else {"factor": 1.2}
    elif case == "mirror images":
        job["blocks"]["right"]["box"] = {"origin": [0, 0, 0], "size": [4, 4, 20], "element_size": [4, 4, 2.5]}
        job["outputs"]["nodes"]["top"] = {"block": "right", "at": [0, 4, 20]}
    else:
        job["water"] = {
            "level": "15 m",
            "faces": [{"block": "left", "face": "ymin"}],
            "model": "incompressible",
        }
        job["joints"]["middle"]["grouting_pressure"] = "20 kPa"
    motion = still() if case == "mirror images" else shaken()
    own = result(job, motion)
    full = result(job | FULL | {"transient": {"finest_step": "0.25 ms", "rho_inf": 1.0}}, motion)
    for name, most in (("displacement", 0.01), ("opening", 0.04)):
        mesh = full[name].values
        error = np.linalg.norm(own[name].values - mesh) / np.linalg.norm(mesh)
        assert error < most, (name, error)
    assert own.attrs["solver_ledger_imbalance"] < 1e-9
    assert float(own.opening.max()) > 1e-4


def test_a_suite_makes_runs_again_where_a_table_has_changed(tmp_path):
    """Two scales: the push is that of both; the same command again computes nothing."""
    table(tmp_path, [0, 0.05, 0.3], [0, 700, -200])
    np.savetxt(tmp_path / "weak.txt", shaken(1.0, 5e-3).acc[1])
    raw = with_keys(SHAKER | {"table": "force.csv"}, model={"modes": "all"}, joints__middle__friction=0.5)
    raw["records"] = [{"file": "weak.txt", "unit": "m/s2", "dt": "5 ms", "components": {"y": 1}}]
    raw |= {"pipeline": "suite", "suite": {"scales": [0.5, 1.0], "keep": "full"}}
    raw["outputs"] |= {"output_interval": "5 ms", "floor_spectra": {"dampings": [0.05]}}

    def run():
        outcome = romdam.run_suite(
            romdam.load_config(raw, tmp_path), tmp_path / "out", romdam.SuiteOptions(workers=1)
        )
        with romdam.open_suite(tmp_path / "out") as suite:
            forces = [node.applied_force.values for node in suite["runs"].children.values()]
            return outcome, forces, suite.floor_spectrum.values

    first, forces, spectra = run()
    np.testing.assert_array_equal(forces[0], forces[1])
    assert np.abs(forces[0]).max() == pytest.approx(7e5)
    assert spectra.shape == (1, 2, 1, 2, 3, 1, 75) and np.isfinite(spectra).all()
    assert first.made == 2 and run()[0].made == 0
    table(tmp_path, [0, 0.05, 0.3], [0, 800, -200])
    again, forces, _ = run()
    assert again.made == 2 and np.abs(forces[0]).max() == pytest.approx(8e5)
