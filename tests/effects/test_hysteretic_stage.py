"""Hysteretic damping and damping of materials in the linear stage, against closed forms and sums of waves."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu
from test_combinations import job

import romdam
from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig
from romdam.core.errors import ConfigError
from romdam.effects.full_order import assemble_full
from romdam.pipelines.linear import linear
from romdam.scene.build import build_scene
from romdam.scene.ties import tie_joints

DT, RHO = 0.005, 2400.0


def bar(tmp_path, acc, lengths=(6, 9), moduli=(2e9, 5e9), ratios=(0.08, 0.03), edge=0.5, **stage):
    """A bar along x of two materials with a joint between them, held at one end; nu = 0."""
    np.savetxt(tmp_path / "r.txt", acc)
    materials, blocks, start = {}, {}, 0.0
    for name, length, E, ratio in zip("ab", lengths, moduli, ratios, strict=True):
        own = {"ratio": ratio, "frequencies": ["10 Hz", "60 Hz"]}
        materials[name] = {"E": E, "nu": 0.0, "rho": RHO, "damping": own}
        of_box = {"origin": [start, 0, 0], "size": [length, 1, 1], "element_size": [edge, 1, 1]}
        blocks[name] = {"material": name, "box": of_box | {"element": "hex20"}}
        start += length
    raw = {
        "materials": materials,
        "blocks": blocks,
        "supports": [{"block": "a", "face": "xmin"}]
        + [{"block": b, "face": f, "fix": ["y", "z"]} for b in "ab" for f in ("ymin", "ymax")],
        "joints": {"joint": {"between": ["a", "b"], "normal_stiffness": "50 GPa/m"}},
        "records": [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}],
        "model": {"modes": 10},
        "transient": {"finest_step": DT},
        "outputs": {"nodes": {"end": {"block": "b", "at": [start, 0, 0]}}, "plots": False},
        "linear_stage": {"cutoff": 200.0, "damping": "hysteretic"} | stage,
    }
    path = tmp_path / "bar.yaml"
    path.write_text(yaml.safe_dump(raw))
    return path, raw


def transfer(omega, lengths, moduli, ratios):
    """Displacement of the end relative to the base for a unit acceleration of it: two rods in series.

    E* = E (1 + 2 i xi); with total displacement U: E* U_xx = -rho omega^2 U, base moved by 1, end free,
    relative displacement U(L) - 1 over the acceleration -omega^2.
    """
    out = np.zeros(len(omega), complex)
    for k, w in enumerate(omega):
        E = [e * (1 + 2j * xi) for e, xi in zip(moduli, ratios, strict=True)]
        kappa = [w * np.sqrt(RHO / e) for e in E]
        # end free: U = C cos(kappa (x - L)) in b; displacement and stress go on at the joint
        u, s = np.cos(kappa[1] * lengths[1]), E[1] * kappa[1] * np.sin(kappa[1] * lengths[1])
        c, d = np.cos(kappa[0] * lengths[0]), np.sin(kappa[0] * lengths[0])
        base = u * c - s / (E[0] * kappa[0]) * d
        out[k] = (1.0 / base - 1.0) / -(w**2)
    return out


def pulse(count=200):
    t = np.arange(count) * DT
    return 2.0 * np.sin(2 * np.pi * 13.0 * t) * np.sin(np.pi * t / (count * DT)) ** 2


def by_fourier(acc, function, seconds=40.0):
    """The record, rest for so long, each line of its spectrum times the transfer function."""
    size = round(seconds / DT)
    omega = 2 * np.pi * np.fft.rfftfreq(size, DT)
    with np.errstate(invalid="ignore"):
        H = np.concatenate([[0.0], function(omega[1:])])
    H[0] = H[1].real
    return np.fft.irfft(np.fft.rfft(acc, size) * H, size)[: len(acc)]


def test_bar_of_two_materials_is_that_of_complex_moduli(tmp_path):
    """Two rods in series by theory, unlike ratios: the end's history within 0.5 %; ledger and peak too."""
    acc = pulse()
    shape = (6, 9), (2e9, 5e9), (0.08, 0.03)
    path, _ = bar(tmp_path, acc)
    stage = linear(path, tmp_path / "out").stages["r"]
    exact = by_fourier(acc, lambda w: transfer(w, *shape))
    found = stage.history.displacement.sel(node="end").values[:, 0]
    size = np.abs(exact).max()
    assert np.abs(found - exact).max() < 5e-3 * size
    assert stage.history.attrs["solver_ledger_imbalance"] < 1e-9
    assert stage.history.attrs["integrator"] == "frequency_domain"
    warnings = json.loads(stage.history.attrs["configuration_doubts"])
    assert any("damping couples modes" in line for line in warnings)
    # not that of one ratio, and not the viscous one
    one = by_fourier(acc, lambda w: transfer(w, *shape[:2], (0.05, 0.05)))
    assert np.abs(found - one).max() > 2e-2 * size
    path, _ = bar(tmp_path, acc, damping="viscous")
    viscous = linear(path, tmp_path / "viscous").stages["r"].history
    assert np.abs(viscous.displacement.values[:, 0, 0] - exact).max() > 2e-2 * size


def test_effective_ratio_of_each_mode_is_the_share_of_strain_energy(tmp_path):
    """2 xi omega^2 = phi^T K_h phi: the mean of the materials by the strain energy of sine waves in rods."""
    path, _ = bar(tmp_path, pulse())
    spectrum = linear(path, tmp_path / "out").stages["r"].spectrum
    lengths, moduli, ratios = (6, 9), (2e9, 5e9), (0.08, 0.03)
    omega = 2 * np.pi * spectrum.frequency.values[0]
    k = omega * np.sqrt(RHO / np.array(moduli))
    x = np.linspace(0, 1, 20001)
    # sine from the base, cosine from the free end, equal at the joint
    b = np.sin(k[0] * lengths[0]) / np.cos(k[1] * lengths[1])
    strain = [
        moduli[0] * np.trapezoid((k[0] * np.cos(k[0] * lengths[0] * x)) ** 2, x) * lengths[0],
        moduli[1] * np.trapezoid((b * k[1] * np.sin(k[1] * lengths[1] * x)) ** 2, x) * lengths[1],
    ]
    want = np.dot(ratios, strain) / sum(strain)
    assert spectrum.damping_ratio.values[0] == pytest.approx(want, rel=2e-3)


@pytest.mark.parametrize("share", [0.5, 1.0, 1.6])
def test_steady_vibration_has_the_closed_amplitude_and_loss(tmp_path, share):
    """Of one material: amplitude by theory; a cycle loses 4 pi xi times the strain energy at any speed."""
    shape = (1.0, 1.0), (2e8, 2e8), (0.06, 0.06)
    omega = share * 0.25 * np.pi * np.sqrt(2e8 / RHO)  # of the first mode: c / 4 L
    cycle = 2 * np.pi / omega
    t = np.arange(2400) * DT
    path, _ = bar(tmp_path, np.sin(omega * t), *shape, edge=0.25, cutoff=3000.0)
    history = linear(path, tmp_path / "out").stages["r"].history
    late = history.time.values >= 6.0
    time, disp = history.time.values[late], history.displacement.values[late, 0, 0]
    waves = np.stack([np.sin(omega * time), np.cos(omega * time)], axis=1)
    amplitude = np.hypot(*np.linalg.lstsq(waves, disp, rcond=None)[0])
    exact = np.abs(transfer(np.array([omega]), *shape))[0]
    assert amplitude == pytest.approx(exact, rel=5e-3)
    lost = np.polyfit(time, history.energy_damping.values[late], 1)[0] * cycle
    # largest strain energy in a cycle of steady vibration, from complex amplitudes along the bar
    x = np.linspace(0.0, 2.0, 4001)
    kappa = omega * np.sqrt(RHO / (2e8 * (1 + 0.12j)))
    strain = kappa / omega**2 * np.sin(kappa * (x - 2.0)) / np.cos(2.0 * kappa)
    energy = 0.5 * 2e8 * np.trapezoid(np.abs(strain) ** 2, x)
    assert lost == pytest.approx(4 * np.pi * 0.06 * energy, rel=5e-3)


def dam(tmp_path, **sections):
    path, raw = bar(tmp_path, pulse(60))
    for material in raw["materials"].values():
        material["nu"] = 0.2
    raw["loads"] = {"gravity": [0, 0, -9.81]}
    path.write_text(yaml.safe_dump(raw | sections))
    return path, raw | sections


def test_rest_is_that_of_the_static_loads_and_attachments_have_the_ratio_of_the_scene(tmp_path):
    """Weight, an anchor and added mass: the history begins near rest, and the ledger closes with its work."""
    water = {
        "model": "westergaard",
        "level": 0.9,
        "upstream": [0, 0, 0],
        "faces": [{"block": "b", "face": "xmax"}],
    }
    del water["upstream"]
    bars = {
        "tie": {
            "head": {"block": "b", "at": [15, 0, 1]},
            "foot": [18, 0, 1],
            "stiffness": 4e7,
            "pretension": 1e5,
        }
    }
    own = {"anchors": bars, "water": water, "damping": {"rayleigh": {"ratio": 0.2, "frequencies": [10, 60]}}}
    path, _ = dam(tmp_path, **own)
    stage = linear(path, tmp_path / "out").stages["r"]
    rest = stage.spectrum.static_displacement.values[0]
    history = stage.history
    size = np.abs(history.displacement.values - rest).max()
    assert np.abs(rest).max() > 1e-6
    assert np.abs(history.displacement.values[0, 0] - rest).max() < 0.05 * size
    assert history.attrs["solver_ledger_imbalance"] < 1e-9
    assert np.isfinite(history.anchor_force.values).all()
    other = own | {"damping": {"rayleigh": {"ratio": 0.0, "frequencies": [10, 60]}}}
    path, _ = dam(tmp_path, **other)
    less = linear(path, tmp_path / "less").stages["r"].spectrum
    assert (less.damping_ratio.values < stage.spectrum.damping_ratio.values).any()


def test_spectrum_of_coupled_viscous_damping_takes_the_effective_ratios(tmp_path):
    """Tied materials of unlike viscous damping: ratios are those of `romdam modes`, and a warning says so."""
    path, _ = dam(tmp_path, linear_stage={"cutoff": 200.0})
    stage = linear(path, tmp_path / "out").stages["r"]
    modes = romdam.modes(path, tmp_path / "modes").dataset
    count = 4
    np.testing.assert_allclose(stage.spectrum.frequency[:count], modes.frequency[:count], rtol=1e-5)
    np.testing.assert_allclose(stage.spectrum.damping_ratio[:count], modes.damping_ratio[:count], rtol=1e-4)
    assert any("effective ratios" in line for line in json.loads(stage.history.attrs["configuration_doubts"]))
    assert stage.history.attrs["integrator"] == "generalized_alpha"


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"damping": {"rayleigh": {"alpha": 1.0, "beta": 1e-3}}}, r"damping.rayleigh has `alpha` and `beta`"),
        ({"loads": {"initial_state": "undeformed"}}, r"hysteretic begins at rest"),
    ],
)
def test_what_has_no_ratio_or_rest_is_refused(tmp_path, changes, match):
    _, raw = dam(tmp_path)
    with pytest.raises(ConfigError, match=match):
        parse_config(raw | changes, "job.yaml")
    raw["materials"]["a"]["damping"] = {"alpha": 1.0, "beta": 1e-3}
    with pytest.raises(ConfigError, match=r"materials.a.damping has `alpha` and `beta`; give `ratio`"):
        parse_config(raw, "job.yaml")


def test_modes_that_nothing_damps_are_refused(tmp_path):
    path, _ = bar(tmp_path, pulse(60), ratios=(0.0, 0.0))
    with pytest.raises(
        ConfigError, match=r"hysteretic: the mode at .* Hz has a damping ratio of 0, limit 0.001"
    ):
        linear(path, tmp_path / "out")


def test_accuracy_and_intervals_of_the_job_hold(tmp_path):
    """Steps that an accuracy chose, and rows at an interval: the same motion within 1 %."""
    found = []
    for more in (
        {"transient": {"finest_step": DT / 8}},
        {
            "transient": {"accuracy": "1 %"},
            "outputs": {
                "nodes": {"end": {"block": "b", "at": [15, 0, 0]}},
                "plots": False,
                "output_interval": 2 * DT,
            },
        },
    ):
        path, _ = dam(tmp_path, **more)
        found.append(linear(path, tmp_path / f"{len(found)}").stages["r"].history)
    fine, coarse = (one.displacement.values[:, 0, 0] for one in found)
    at = np.searchsorted(found[0].time.values, found[1].time.values - 1e-9)
    assert np.abs(coarse - fine[at]).max() < 1e-2 * np.abs(fine).max()
    assert float(found[1].time[1]) == pytest.approx(2 * DT)


def scenes(raw):
    """The tied scene of a job, full-order K and M, and K of each material alone by doubling its modulus."""
    config = parse_config(raw, "s.yaml")
    undamped = DampingConfig()

    def full(one):
        tied = build_scene(one, Path(), "s.yaml")
        tied = tie_joints(tied, list(tied.joints), one.every_joint, "s.yaml")
        return assemble_full(tied, undamped)

    system, own = full(config), {}
    for name in raw["materials"]:
        other = copy.deepcopy(raw)
        for key in {"E", "E_dynamic"} & {*other["materials"][name]}:
            other["materials"][name][key] *= 2.0
        own[name] = full(parse_config(other, "s.yaml")).K - system.K
    return system, own


@pytest.mark.parametrize(
    "effects",
    [
        (),
        pytest.param(("masses", "anchors"), marks=pytest.mark.slow),
        ("Westergaard's added mass", "moduli by duration"),
        ("incompressible water", "masses"),
        pytest.param(("temperature", "staged weight"), marks=pytest.mark.slow),
        ("moduli by duration", "anchors", "grouting"),
    ],
    ids=", ".join,
)
def test_with_other_effects_it_is_the_mesh_with_complex_stiffness(tmp_path, effects):
    """Every line of the spectrum solved on the mesh, the record followed by rest: the top within 0.5 %."""
    raw = job(*effects)
    ratios = {"concrete": 0.07, "rock": 0.03}
    for name, ratio in ratios.items():
        raw["materials"][name]["damping"] = {"ratio": ratio, "frequencies": [2.0, 20.0]}
    raw["damping"] = {"rayleigh": {"ratio": 0.11, "frequencies": [2.0, 20.0]}}  # of anchors
    raw["linear_stage"] = {"cutoff": 5e3, "damping": "hysteretic"}
    raw["model"] = {"modes": 12}
    raw["outputs"] |= {"error_estimate": False, "mesh_error": False, "plots": False}
    acc = pulse(120)
    np.savetxt(tmp_path / "r.txt", acc)
    raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1, "z": 1}}]
    raw["transient"] = {"finest_step": DT}
    path = tmp_path / "job.yaml"
    path.write_text(yaml.safe_dump(raw))
    history = linear(path, tmp_path / "out").stages["r"].history
    system, own = scenes(raw)
    K_h = 2 * 0.11 * system.K
    for name, ratio in ratios.items():
        K_h = K_h + 2 * (ratio - 0.11) * own[name]
    load = np.asarray(system.load)[:, 1:3].sum(axis=1)
    observe = system.observe[:3]
    size = 4000
    omega = 2 * np.pi * np.fft.rfftfreq(size, DT)
    spectrum = np.fft.rfft(acc, size)
    some = np.flatnonzero(np.abs(spectrum) > 1e-5 * np.abs(spectrum).max())
    answer = np.zeros((3, len(omega)), complex)
    for k in some:
        A = csc_matrix(system.K + (1j if k else 0j) * K_h - omega[k] ** 2 * system.M)
        answer[:, k] = observe @ splu(A).solve(-load * spectrum[k])
    exact = np.fft.irfft(answer, size)[:, : len(acc)]
    rest = history.displacement.values[0, 0] - exact[:, 0]
    found = history.displacement.values[:, 0] - rest
    assert np.abs(found - exact.T).max() < 5e-3 * np.abs(exact).max()
    assert history.attrs["solver_ledger_imbalance"] < 1e-9
