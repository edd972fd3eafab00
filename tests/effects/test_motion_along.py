"""Motion of supports by position: stations, waves that pass, and motions that are not coherent."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.sparse.linalg import splu
from simulating import simulated

import romdam
from romdam.config import load_config, parse_config
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.errors import ConfigError, RecordError
from romdam.core.motion import GroundMotion, Incoherence, MovingSupports, SupportMotion
from romdam.core.scene_digest import scene_digest
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import Assembly
from romdam.pipelines.check import check
from romdam.pipelines.error.certify import certify
from romdam.pipelines.simulation import ground_at_steps
from romdam.records.processing.incoherence import incoherent_motions
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.processing.support_motions import add_support_rows, late_warnings
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.results.fields import open_result
from romdam.scene.build import build_scene
from romdam.scene.ground.motion_along import chebyshev_points, interpolation_error, lagrange

DT = 0.01
DAMPED = DampingConfig(rayleigh=RayleighConfig(frequencies=(3.0, 30.0), ratio=0.03))
RECORD = {"file": "pulse.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1, "y": 2, "z": 3}}
SHIFTED = {"delay": 0.06, "factor": 1.4}


def pulses(seconds=3.0, dt=DT):
    """Along all axes, each ends at rest with no displacement, (3, nt) [m/s2]."""
    time = np.arange(round(seconds / dt) + 1) * dt
    rows = []
    for peak, freq in ((6.0, 1.7), (9.0, 2.3), (3.0, 3.1)):
        window = np.where(time < 2.0, np.sin(np.pi * time / 2.0) ** 4, 0.0)
        wave = peak * window * np.sin(2 * np.pi * freq * time) / (2 * np.pi * freq) ** 2
        rows.append(np.gradient(np.gradient(wave, dt), dt))
    return np.stack(rows)


def canyon(along=None, scale=1.0, turn=False, **joints):
    """Three monoliths that are no mirror images, on a floor and between two banks, with friction.

    `turn` exchanges x and y.
    """
    law = {"normal_stiffness": "20 GPa/m", "shear_stiffness": "10 GPa/m", "friction": 0.6} | joints
    spans = {"left": (0.0, 10.0), "middle": (10.0, 10.0), "right": (20.0, 15.0)}
    turned = (lambda v: [v[1], v[0], v[2]]) if turn else list
    across = "y" if turn else "x"
    box = {
        name: {
            "material": "concrete",
            "box": {
                "origin": turned([scale * at, 0, 0]),
                "size": turned([scale * width, scale * 5, scale * 20]),
                "element_size": scale * 5.0,
            },
        }
        for name, (at, width) in spans.items()
    }
    return {
        "materials": {"concrete": {"E": 25e9, "nu": 0.2, "rho": 2400.0}},
        "blocks": box,
        "supports": [
            {"block": "left", "face": f"{across}min"},
            *({"block": name, "face": "zmin"} for name in spans),
            {"block": "right", "face": f"{across}max"},
        ],
        "joints": {
            f"J{k}": {"between": pair} | law
            for k, pair in enumerate((["left", "middle"], ["middle", "right"]))
        },
        "loads": {"gravity": [0, 0, -9.81]},
        "records": [RECORD],
        "damping": {"rayleigh": {"frequencies": [3.0, 30.0], "ratio": 0.03}},
        "model": {"modes": 6},
        "transient": {"finest_step": 0.002},
        "outputs": {
            "nodes": {"crest": {"block": "middle", "at": turned([scale * 15, 0, scale * 20])}},
            "plots": False,
            "error_estimate": False,
            "mesh_error": False,
        },
    } | ({"ground": {"along": along}} if along else {})


def scene_of(raw):
    return build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")


def systems(scene, modes=20):
    return assemble_full(scene, DAMPED), reduce_scene(scene, ModeChoice(count=modes), DAMPED).system


LINE = {"stations": [{"at": at} | SHIFTED for at in ([0, 0, 20], [0, 0, 0], [35, 0, 0], [35, 0, 20])]}
ON_AXIS = {"axis": "x", "stations": [{"at": at} | SHIFTED for at in (0.0, 12.0, 35.0)]}


@pytest.mark.parametrize(
    ("along", "integrator"), [(LINE, "generalized_alpha"), (ON_AXIS, "modal"), (LINE, "modal")]
)
def test_the_same_motion_everywhere_is_that_motion_of_the_base(along, integrator):
    """Openings, slips and forces are those of the record that all stations follow; displacement is u + d."""
    acc = pulses()
    moving, still = scene_of(canyon(along)), scene_of(canyon())
    ground = add_support_rows(acc, DT, moving.find(MovingSupports).motions)
    k = 0 if integrator == "generalized_alpha" else 1
    own, base = (
        simulated(systems(scene, 2**62)[k], motion, DT, integrator)
        for scene, motion in ((moving, ground), (still, acc + ground[3:6]))
    )
    assert np.abs(base.jump).max() > 1e-4
    np.testing.assert_allclose(own.jump, base.jump, atol=1e-10 * np.abs(base.jump).max())
    follows = own.supports[:, :3]
    np.testing.assert_allclose(own.disp, base.disp + follows, atol=1e-10 * np.abs(follows).max())
    assert own.stats["ledger_imbalance"] < 1e-10


def long_block(along):
    return canyon() | {
        "blocks": {
            "long": {
                "material": "soft",
                "box": {"origin": [0, 0, 0], "size": [120, 5, 15], "element_size": [5.0, 5.0, 5.0]},
            }
        },
        "materials": {"soft": {"E": 2e9, "nu": 0.2, "rho": 2400.0}},
        "supports": [{"block": "long", "face": "zmin"}],
        "joints": {},
        "loads": {},
        "model": {"order": "full"},
        "outputs": {"nodes": {"top": {"block": "long", "at": [85, 0, 15]}}},
        "ground": {"along": along},
    }


def test_wave_passage_is_that_of_absolute_coordinates():
    """A wave under a soft block, every node of its base later than the one before, against a Newmark code."""
    c, dt = 400.0, 0.002
    fine = np.stack([np.interp(np.arange(1101) * dt, np.arange(301) * DT, row) for row in pulses()])
    scene = scene_of(long_block({"axis": "x", "velocity": c, "cutoff": 12.0}))
    alpha, beta = 0.4, 3e-4
    damping = DampingConfig(rayleigh=RayleighConfig(alpha=alpha, beta=beta))
    system = assemble_full(scene, damping)
    assert 6 <= len(scene.find(MovingSupports).motions) <= 20
    own = simulated(
        system, add_support_rows(fine, dt, scene.find(MovingSupports).motions), dt, "generalized_alpha"
    )
    absolute = own.disp + displacement(fine, dt).T

    K, M = (matrix.tocsc() for matrix in Assembly(scene.blocks).matrices("long"))
    held, free = np.flatnonzero(scene.fixed["long"].ravel()), np.flatnonzero(~scene.fixed["long"].ravel())
    time = np.arange(fine.shape[1]) * dt
    delay = scene.blocks["long"].points[held // 3, 0] / c
    acc = np.stack(
        [np.interp(time - d, time, fine[k], left=0.0) for d, k in zip(delay, held % 3, strict=True)]
    )
    vel, disp = velocity(acc, dt), displacement(acc, dt)
    Kff, Mff, Kfs, Mfs = K[free][:, free], M[free][:, free], K[free][:, held], M[free][:, held]
    carried = -splu(Kff).solve(np.ascontiguousarray(Kfs @ vel))  # by the supports alone
    C = alpha * Mff + beta * Kff
    step = splu((Mff + 0.5 * dt * C + 0.25 * dt**2 * Kff).tocsc())
    x, v = np.zeros(len(free)), np.zeros(len(free))
    a, found = np.zeros(len(free)), np.zeros((len(time), 3))
    node = int(np.linalg.norm(scene.blocks["long"].points - [85, 0, 15], axis=1).argmin())
    rows = np.searchsorted(free, 3 * node + np.arange(3))
    for k in range(1, len(time)):
        x_free, v_free = x + dt * v + 0.25 * dt**2 * a, v + 0.5 * dt * a
        force = -Kfs @ disp[:, k] - Mfs @ acc[:, k] + C @ carried[:, k]
        a = step.solve(force - C @ v_free - Kff @ x_free)
        x, v = x_free + 0.25 * dt**2 * a, v_free + 0.5 * dt * a
        found[k] = x[rows]
    apart = np.abs(own.disp).max()
    assert apart > 0.3 * np.abs(found).max()
    np.testing.assert_allclose(absolute, found, atol=2e-3 * np.abs(found).max())


@pytest.mark.parametrize("turn", [False, True])
def test_a_base_that_tilts_turns_what_stands_on_it(turn):
    """Rigid dam: stations that rise in proportion to x turn the block, and do not strain it."""
    raw = canyon(turn=turn)
    axis, place = ("y", 1) if turn else ("x", 0)
    raw["supports"] = [support for support in raw["supports"] if support["face"] == "zmin"]
    raw["ground"] = {
        "along": {
            "axis": axis,
            "stations": [{"at": 0.0, "factor": [1, 1, 2.0]}, {"at": 35.0, "factor": [1, 1, 5.5]}],
        }
    }
    scene = scene_of(raw)
    moving = assemble_full(scene, DampingConfig()).pseudo_static
    # vertical motion of the stations alone, d_z = 1 and 4.5 (the record's own is taken off)
    for name, u in moving.shapes.items():
        d = u.reshape(-1, 3, len(moving.motions) * 3)
        displaced = d[:, :, 2] * 1.0 + d[:, :, 5] * 4.5
        points = scene.blocks[name].points
        np.testing.assert_allclose(displaced[:, 2], 1.0 + 0.1 * points[:, place], atol=1e-11)
        np.testing.assert_allclose(displaced[:, place], -0.1 * points[:, 2], atol=1e-11)
    assert np.abs(moving.jump @ np.array([0, 0, 1.0, 0, 0, 4.5])).max() < 1e-11
    stiffness = np.array([0, 0, 1.0, 0, 0, 4.5])
    assert stiffness @ moving.stiffness @ stiffness < 1e-9 * np.abs(moving.stiffness).max()


def test_faster_waves_come_nearer_to_uniform_motion():
    """What a wave changes is in proportion to its delays, and nothing is left of it without them."""
    acc = pulses(2.2)
    base = simulated(systems(scene_of(canyon()), 2**62)[1], acc, DT, "modal")
    scene, apart = scene_of(canyon({"axis": "x", "velocity": 1e6})), []
    reduced = systems(scene, 2**62)[1]
    for part in (1.0, 0.1, 0.0):
        motions = [
            replace(motion, delay=part * motion.delay) for motion in scene.find(MovingSupports).motions
        ]
        own = simulated(reduced, add_support_rows(acc, DT, motions), DT, "modal")
        apart.append(np.abs(own.jump - base.jump).max() / np.abs(base.jump).max())
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.2)
    assert apart[2] < 1e-10


def test_polynomials_through_stations_follow_waves():
    """Shares sum to one, waves are kept within the error that is stated, long ones far better."""
    s, c, freq = np.linspace(-40.0, 260.0, 801), 2000.0, 25.0
    at = chebyshev_points(-40.0, 260.0, 18)
    shares, omega = lagrange(s, at), 2 * np.pi * freq
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-13)
    stated = interpolation_error(s, at, 1 / c, 0.0, np.array([omega]))
    exact, made = np.exp(-1j * omega * s / c), shares @ np.exp(-1j * omega * at / c)
    assert np.abs(made - exact).max() == pytest.approx(stated, rel=1e-6)
    assert stated < 0.01
    slow = 2 * np.pi * 0.5
    strain = np.gradient(shares @ np.exp(-1j * slow * at / c), s)
    np.testing.assert_allclose(strain[5:-5], (-1j * slow / c) * np.exp(-1j * slow * s / c)[5:-5], rtol=1e-4)


def test_incoherent_motions_have_the_coherency_of_the_model():
    """Over 100 seeds: mean square, coherency with the record and among stations, rest in the end."""
    dt, loss = 0.02, 4e-4
    time = np.arange(1001) * dt
    freq = np.fft.rfftfreq(len(time), dt)
    band = (freq > 0.4) & (freq < 20.0)  # of one amplitude, so that smoothing its spectrum changes nothing
    phase = np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, len(freq))
    acc = np.zeros((3, len(time)))
    acc[0] = np.fft.irfft(np.where(band, np.exp(1j * phase), 0.0), len(time))
    motion = GroundMotion("noise", acc, dt)
    at = np.array([0.0, 40.0, 100.0])
    spectra = []
    for seed in range(100):
        made = incoherent_motions(motion, Incoherence(at, loss, seed))
        np.testing.assert_allclose(made[0], acc, atol=1e-12 * np.abs(acc).max())
        assert not made[:, 1:].any()
        drift = velocity(made[:, 0] - acc[0], dt)
        assert np.abs(drift[:, -1]).max() < 1e-9 * np.abs(drift).max()
        assert np.abs(displacement(made[:, 0] - acc[0], dt)[:, -1]).max() < 1e-9
        spectra.append(np.fft.rfft(made[:, 0]))
    U, record = np.array(spectra), np.fft.rfft(acc[0])
    for low, high in ((0.7, 1.4), (1.4, 2.8), (2.8, 5.6), (5.6, 11.2)):
        here = (freq > low) & (freq < high)
        power = (np.abs(U[:, :, here]) ** 2).mean(axis=(0, 2)) / (np.abs(record[here]) ** 2).mean()
        np.testing.assert_allclose(power, 1.0, atol=0.06)
        for i, j in ((0, 1), (0, 2), (1, 2)):
            cross = (U[:, i, here] * U[:, j, here].conj()).mean(axis=0).sum().real
            own = np.sqrt(np.prod([(np.abs(U[:, k, here]) ** 2).mean(axis=0).sum() for k in (i, j)]))
            model = np.exp(-((loss * 2 * np.pi * freq[here] * (at[i] - at[j])) ** 2)).mean()
            assert cross / own == pytest.approx(model, abs=0.06)


def test_incoherent_motions_have_the_envelope_of_the_record():
    """A pulse of 2 s in 12 s: what is not coherent is where the pulse is; 0.75 of steady noise were not."""
    acc = np.pad(pulses(2.0), ((0, 0), (400, 600)))
    motion, time = GroundMotion("pulse", acc, DT), np.arange(acc.shape[1]) * DT
    outside = (time < 3.5) | (time > 6.5)
    parts = [
        (incoherent_motions(motion, Incoherence(np.array([80.0]), 5e-4, seed))[0] - acc) ** 2
        for seed in range(20)
    ]
    assert np.sum(parts) > 20 * 0.02 * (acc**2).sum()
    assert sum(part[:, outside].sum() for part in parts) < 0.05 * np.sum(parts)


def test_coherent_motions_are_the_record_and_steps_do_not_change_motions():
    acc = pulses()
    motion = GroundMotion("pulse", acc, DT)
    made = incoherent_motions(motion, Incoherence(np.array([0.0, 50.0]), 0.0, 1))
    np.testing.assert_allclose(made, np.tile(acc, (2, 1, 1)), atol=1e-12 * np.abs(acc).max())
    along = {
        "axis": "x",
        "velocity": 1500.0,
        "incoherence": {"alpha": 0.3, "shear_velocity": 800.0, "seed": 7},
    }
    scene = scene_of(canyon(along))
    system = systems(scene)[1]
    coarse, fine = (ground_at_steps(motion, dt, None, system) for dt in (DT, DT / 4))
    most = np.abs(coarse).max(axis=1, keepdims=True)
    np.testing.assert_allclose(fine[:, ::4], coarse, atol=2e-2 * most.max())
    other = ground_at_steps(
        motion,
        DT,
        None,
        systems(
            scene_of(canyon(along | {"incoherence": {"alpha": 0.3, "shear_velocity": 800.0, "seed": 8}}))
        )[1],
    )
    assert np.abs(other[:3] - coarse[:3]).max() == 0.0
    assert np.abs(other - coarse).max() > 0.1 * np.abs(coarse[3:]).max()


def test_reduced_model_moves_as_its_mesh_does():
    """A wave and its incoherence through three monoliths with friction: openings, crest, ledger."""
    along = {"axis": "x", "velocity": 300.0, "incoherence": {"shear_velocity": 300.0}, "cutoff": 15.0}
    scene = scene_of(canyon(along))
    full, reduced = systems(scene)
    motion = GroundMotion("pulse", pulses(2.2), DT)
    ground = ground_at_steps(motion, 0.001, None, reduced)
    own = simulated(reduced, ground, 0.001, "modal", stride=10)
    mesh = simulated(full, ground, 0.001, "generalized_alpha", stride=10)
    for name in ("jump", "disp"):
        of_mesh = getattr(mesh, name)
        assert np.linalg.norm(getattr(own, name) - of_mesh) < 0.02 * np.linalg.norm(of_mesh)
    for history in (own, mesh):
        assert history.stats["ledger_imbalance"] < 1e-10


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("along")
    np.savetxt(made / "pulse.txt", pulses(2.2).T)
    np.savetxt(made / "drifting.txt", pulses(2.2).T + 0.3)
    return made


def job(folder, along, name="job.yaml", **sections):
    raw = canyon(along) | sections
    (folder / name).write_text(yaml.safe_dump(raw))
    return load_config(folder / name)


WAVE = {"axis": "x", "velocity": 800.0, "incoherence": {"shear_velocity": 500.0, "seed": 4}, "cutoff": 15.0}


def test_a_run_keeps_its_stations_and_states_its_error(folder, tmp_path):
    """Fields rebuilt follow the stations at held nodes; a certificate-like estimate stands in the result."""
    outputs = canyon()["outputs"] | {"error_estimate": True}
    one = job(folder, WAVE, outputs=outputs)
    found = check(one)
    (path,) = romdam.run(one, tmp_path / "run").paths
    with open_result(path) as result:
        data = result.dataset
        at = data.station_coordinate.values
        np.testing.assert_allclose(data.support_delay.values, at / 800.0, atol=1e-12)
        assert [motion["station"] for motion in found.supports.values()] == at.tolist()
        moved = data.support_displacement.values
        shares = lagrange(result.points("right")[:, 0], at)
        held = result.points("right")[:, 2] == 0.0
        rebuilt = result.displacement("right").values[:, held]
        np.testing.assert_allclose(
            rebuilt, np.einsum("ns,tsc->tnc", shares[held], moved), atol=1e-6 * np.abs(moved).max()
        )
        assert 0.0 < data.attrs["error_estimate_opening_l2"] < 0.3
        assert data.attrs["solver_ledger_imbalance"] < 1e-10
        estimate = data.attrs["error_estimate_opening_l2"]
    certified = certify(path, folder / "job.yaml").statement.errors["opening"].l2
    assert 0.3 * estimate < certified < 3.0 * estimate


def test_random_motions_do_not_depend_on_the_mesh():
    """Stations of incoherent motions stand at the same places on a finer mesh."""
    raw = canyon(WAVE)
    coarse = scene_of(raw).find(MovingSupports)
    for block in raw["blocks"].values():
        block["box"]["element_size"] = 2.5
    fine = scene_of(raw).find(MovingSupports)
    assert [one.station for one in fine.motions] == [one.station for one in coarse.motions]
    np.testing.assert_array_equal(fine.incoherence.distance, coarse.incoherence.distance)


def test_a_run_that_ends_before_the_last_support_has_moved_says_so():
    """A pulse of 2 s that reaches the last station 0.5 s late, in a run of 1.5 s and of 3 s."""
    motion, motions = GroundMotion("pulse", pulses(), DT), [SupportMotion(0), SupportMotion(1, delay=0.5)]
    (said,) = late_warnings(motions, motion, 1.5)
    time = motion.time
    squared = (motion.acc**2).sum(axis=0)
    late = squared[(time > 1.0) & (time <= 1.5)].sum() / squared.sum()
    assert f"supports[1] moves 0.5 s behind the record, and {late:.2g} of its Arias" in said
    assert "set transient.duration to 2 s" in said
    assert late_warnings(motions, motion, 3.0) == []


def test_units_of_us_practice_are_the_same_job(folder):
    feet = {"axis": "x", "velocity": "4000 ft/s", "start": "-10 ft"}
    metres = {"axis": [2, 0, 0], "velocity": 1219.2, "start": -3.048}
    a, b = (scene_of(canyon(along)).find(MovingSupports) for along in (feet, metres))
    for one, other in zip(a.motions, b.motions, strict=True):
        assert (one.station, one.delay) == pytest.approx((other.station, other.delay), rel=1e-12)
    for name, shares in a.shares.items():
        np.testing.assert_allclose(shares.toarray(), b.shares[name].toarray(), atol=1e-12)
    keys = {scene_digest(scene_of(canyon(along))) for along in (None, feet, WAVE, LINE, ON_AXIS)}
    assert len(keys) == 5


def test_stations_beside_water_and_records_of_their_own(folder):
    own = {"axis": "x", "stations": [{"at": 0.0, "record": RECORD}, {"at": 35.0, "delay": 0.02}]}
    wet = {
        "model": "incompressible",
        "level": 18.0,
        "faces": [{"block": name, "face": "ymin"} for name in ("left", "middle", "right")],
    }
    found = check(job(folder, own, "wet.yaml", water=wet))
    assert [motion["record"] for motion in found.supports.values()] == ["pulse", None]
    assert any("floor and the banks of the reservoir move as the record" in text for text in found.warnings)


def test_supports_beyond_the_table_are_refused_or_held(folder):
    short = {"axis": "x", "stations": [{"at": 5.0}, {"at": 30.0, "factor": [1.0, 1.2, 0.7]}]}
    with pytest.raises(ConfigError, match=r"do not cover the supports: .* up to 5 m beyond stations\[0\]"):
        check(job(folder, short, "short.yaml"))
    held = scene_of(canyon(short | {"beyond": "hold"}))
    assert any("move as the first or the last station" in text for text in held.remarks)
    shares = held.find(MovingSupports).shares["left"].toarray()
    x = held.blocks["left"].points[:, 0]
    fixed = held.fixed["left"].any(axis=1)
    np.testing.assert_allclose(shares[fixed & (x == 0.0)], [[1.0, 0.0]] * int((fixed & (x == 0.0)).sum()))
    np.testing.assert_allclose(shares[fixed & (x == 10.0), 1], 0.2)


POINTS = {"stations": [{"at": [0, 0, 0]}, {"at": [35, 0, 0], "factor": 1.2}]}


@pytest.mark.parametrize(
    ("along", "sections", "text"),
    [
        ({}, {}, r"ground.along: give `stations`, or `axis` with `velocity`"),
        ({"velocity": 900.0}, {}, r"`axis` is missing"),
        (WAVE | {"stations": ON_AXIS["stations"]}, {}, r"give `stations`, or `axis`"),
        (WAVE | {"axis": [0, 0, 0]}, {}, r"\[0, 0, 0\] has no direction"),
        (WAVE | {"velocity": 0.0}, {}, r"ground.along.velocity"),
        (WAVE | {"start": 3.0}, {}, r"meets supports 3 m before the place .* set start to 0 m"),
        (ON_AXIS | {"stations": ON_AXIS["stations"][::-1]}, {}, r"stations\[1\].at: must rise"),
        (POINTS | {"axis": "x"}, {}, r"stations\[0\].at: must be a coordinate along `axis`"),
        (POINTS | {"cutoff": 5.0}, {}, r"`cutoff` is of a wave"),
        (
            {"stations": [{"at": at} for at in ([0, 0, 20], [0, 0, -30], [5, 0, -30], [5, 0, 20])]},
            {},
            r"nodes of block 'left' that are .* m apart are nearest to places",
        ),
        (
            WAVE,
            {"transient": {"finest_step": 0.001, "integrator": "conserving"}, "damping": {}},
            "conserving knows",
        ),
        (WAVE, {"linear_stage": {"spectrum": {}}}, r"linear_stage"),
        (
            {"axis": "x", "stations": [{"at": 0.0, "record": RECORD}, {"at": 35.0}]},
            {"records": [RECORD, RECORD | {"name": "again"}]},
            r"ground.along.stations\[0\].record: goes with one record",
        ),
    ],
)
def test_wrong_motions_are_refused_by_their_keys(folder, along, sections, text):
    with pytest.raises(ConfigError, match=text):
        check(job(folder, along, "bad.yaml", ground={"along": along}, **sections))


def test_waves_too_short_for_stations_are_refused():
    raw = long_block({"axis": "x", "velocity": 30.0})
    raw["blocks"]["long"]["box"]["element_size"] = [1.0, 5.0, 15.0]
    with pytest.raises(
        ConfigError, match=r"40 stations leave an error of .* at 25 Hz, limit 0.01, along 120 m"
    ):
        scene_of(raw)


def test_other_grounds_and_drifting_records_are_refused(folder):
    raw = canyon(WAVE)
    raw["supports"][0]["motion"] = {"delay": 0.1}
    with pytest.raises(
        ConfigError, match=r"moves all supports by their position, and supports\[\].motion one"
    ):
        scene_of(raw)
    raw = canyon(WAVE)
    raw["ground"]["viscous"] = [{"block": "left", "faces": ["ymin"]}]
    with pytest.raises(ConfigError, match="rock beyond viscous faces moves as the record everywhere"):
        scene_of(raw)
    with pytest.raises(RecordError, match="ends with a velocity"):
        check(job(folder, WAVE, "drift.yaml", records=[RECORD | {"file": "drifting.txt"}]))
