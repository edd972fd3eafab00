"""Rayleigh damping of each material, against bars that scipy integrates, closed forms and other spellings."""

import copy

import numpy as np
import pytest
import xarray as xr
import yaml
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from test_combinations import ALL_MODES, job

import romdam
from romdam.config import parse_config
from romdam.core.errors import ConfigError
from romdam.core.motion import GroundMotion
from romdam.effects.full_order import assemble_full
from romdam.pipelines.suites.run import SuiteOptions, run_suite
from romdam.reduction.natural_modes import natural_modes
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.visual.report.one_run import RunSubject, dam_section
from romdam.visual.report.parts import PageTable

DT, H, RHO, AREA = 0.005, 1.0, 2400.0, 1.0
SCENE = {"alpha": 1.5, "beta": 1e-4}
# first and last plane, modulus, and damping of its own; the third has that of the scene
BARS = {
    "left": (0, 5, 2e9, {"alpha": 12.0, "beta": 2e-4}),
    "tail": (5, 10, 3e9, {"ratio": 0.015, "frequencies": [20.0, 120.0]}),
    "right": (10, 16, 1.5e9, None),
}
K_N, GAP = 4e9, 2e-4  # [N/m3] of 1 m2, [m]


def coefficients(damping):
    """By the textbook: both frequencies have the ratio."""
    if damping is None:
        return SCENE["alpha"], SCENE["beta"]
    if "alpha" in damping:
        return damping["alpha"], damping["beta"]
    w = 2 * np.pi * np.array(damping["frequencies"])
    return tuple(np.linalg.solve(np.stack([0.5 / w, 0.5 * w], axis=1), np.full(2, damping["ratio"])))


def bars(names=("left", "tail", "right"), element="hex8", **model):
    """A bar of two tied materials, a gap, and a bar of a third; nu = 0, so that planes stay planes."""
    name = dict(zip(BARS, names, strict=True))
    materials, blocks = {}, {}
    for key, (a, b, E, damping) in BARS.items():
        own = {} if damping is None else {"damping": damping}
        materials[f"m_{key}"] = {"E": E, "nu": 0.0, "rho": RHO} | own
        of_box = {"origin": [a, 0, 0], "size": [b - a, 1, 1], "element_size": [H, 1, 1], "element": element}
        blocks[name[key]] = {"material": f"m_{key}", "box": of_box}
    return {
        "materials": materials,
        "blocks": dict(sorted(blocks.items())),
        "ties": {"grown": {"between": [name["left"], name["tail"]]}},
        "supports": [{"block": name["left"], "face": "xmin"}, {"block": name["right"], "face": "xmax"}],
        "joints": {"gap": {"between": [name["tail"], name["right"]], "normal_stiffness": K_N, "gap": GAP}},
        "damping": {"rayleigh": SCENE},
        "model": model or {"modes": "all"},
        "transient": {"finest_step": 2e-5},
        "outputs": {
            "nodes": {"end": {"block": name["tail"], "at": [10, 0, 0]}},
            "error_estimate": False,
            "mesh_error": False,
            "plots": False,
            "output_interval": DT,
        },
    }


def bar_matrices():
    """K, M and C of the bars' planes, two-node elements, and which planes are free."""
    n = 18  # planes at 0..10 of the left bar, 10..16 of the right one
    K, M, C = np.zeros((3, n, n))
    for key, (a, b, E, damping) in BARS.items():
        alpha, beta = coefficients(damping)
        for x in range(a, b):
            i = x + int(key == "right")
            at = np.ix_([i, i + 1], [i, i + 1])
            k = E / H * np.array([[1, -1], [-1, 1]])
            m = RHO * H / 6.0 * np.array([[2, 1], [1, 2]])
            K[at] += k
            M[at] += m
            C[at] += alpha * m + beta * k
    return K, M, C, slice(1, n - 1)


def shaken(seconds=0.25):
    t = np.arange(round(seconds / DT) + 1) * DT
    return 30.0 * np.sin(2 * np.pi * 17.0 * t) * np.sin(np.pi * t / seconds) ** 2


def run(raw, acc, axis="x", finer=20):
    """In short base steps, the record linear between its values."""
    fine = np.interp(np.arange(finer * (len(acc) - 1) + 1) / finer, np.arange(len(acc)), acc)
    motion = GroundMotion.from_arrays("pulse", {axis: fine}, DT / finer)
    return romdam.run(raw, motions=motion).results[0].dataset


@pytest.fixture(scope="module")
def exact():
    """Opening, displacement of the end and force by scipy alone."""
    K, M, C, free = bar_matrices()
    acc = shaken()
    times, n = np.arange(len(acc)) * DT, len(K)
    inverse, moved = np.linalg.inv(M[free, free]), (M @ np.ones(n))[free]
    jump = np.zeros(n)
    jump[[10, 11]] = -1, 1

    def force(u):
        return max(-(GAP + jump[free] @ u), 0.0) * K_N

    def rate(t, y):
        u, v = y[: n - 2], y[n - 2 :]
        inside = K[free, free] @ u + C[free, free] @ v
        return np.concatenate(
            [v, inverse @ (jump[free] * force(u) - inside - moved * np.interp(t, times, acc))]
        )

    start = np.zeros(2 * (n - 2))
    y = solve_ivp(rate, (0, times[-1]), start, "RK45", t_eval=times, rtol=1e-7, atol=1e-12, max_step=2e-5).y
    u = y[: n - 2]
    return {
        "opening": GAP + jump[free] @ u,
        "end": u[9],
        "force": np.array([force(u[:, k]) for k in range(len(times))]),
    }


@pytest.mark.parametrize(
    ("names", "model"),
    [
        pytest.param(("left", "tail", "right"), {"order": "full"}, marks=pytest.mark.slow),
        (("left", "tail", "right"), {"modes": "all"}),
        (("c", "b", "a"), {"modes": 60}),
        pytest.param(("c", "b", "a"), {"order": "full"}, marks=pytest.mark.slow),
    ],
)
def test_pounding_bars_of_three_dampings_move_as_by_scipy(exact, names, model):
    """Merged blocks of unlike damping and a third of the scene's: opening, end and force within 0.5 %."""
    data = run(bars(names=names, **model), shaken())
    found = {
        "opening": data.opening.values.mean(axis=1),
        "end": data.displacement.values[:, 0, 0],
        "force": -data.normal_force.values.sum(axis=1),
    }
    assert exact["force"].max() > 1e5 and exact["opening"].max() > 3 * GAP
    for name, values in exact.items():
        assert np.abs(found[name] - values).max() < 5e-3 * np.abs(values).max(), name


@pytest.mark.parametrize("joints", ["open", "tied"])
def test_effective_ratio_of_each_mode_is_that_of_the_bars(joints):
    """phi^T C phi / (2 omega) of the bars' own matrices, by scipy; one material alone has the closed form."""
    raw = bars()
    raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}]
    for block in ("left", "tail", "right"):
        raw["supports"].append({"block": block, "face": "ymin", "fix": ["y", "z"]})
        raw["supports"].append({"block": block, "face": "ymax", "fix": ["y", "z"]})
    if joints == "tied":
        raw["ties"]["gap"] = {"between": ["tail", "right"]}
        raw["joints"] = {}
    config = parse_config(raw, "job.yaml")
    modes = natural_modes(build_scene(config, ".", "job.yaml"), config.damping, 8)
    K, M, C, free = bar_matrices()
    join = np.eye(18)
    if joints == "tied":  # plane 11 is plane 10
        join[11, 10] = 1.0
        join = np.delete(join, 11, axis=1)
        K, M, C, free = (*(join.T @ matrix @ join for matrix in (K, M, C)), slice(1, 16))
    omega2, phi = eigh(K[free, free], M[free, free])
    full = phi.T @ C[free, free] @ phi
    ratio = full.diagonal() / (2 * np.sqrt(omega2))
    np.testing.assert_allclose(modes.freq, np.sqrt(omega2[:8]) / (2 * np.pi), rtol=1e-9)
    np.testing.assert_allclose(modes.damping_ratio, ratio[:8], rtol=1e-8)
    c = full.diagonal()[:8]
    off = np.abs(full[:8, :8] - np.diag(c)) / np.sqrt(np.outer(c, c))
    assert modes.damping_coupling == pytest.approx(off.max(), rel=1e-6) and off.max() > 0.05
    if joints == "open":  # the bar of one material: its damping is classical
        alpha, beta = coefficients(None)
        w = np.sqrt(eigh(K[11:17, 11:17], M[11:17, 11:17], eigvals_only=True)[0])
        k = np.argmin(np.abs(modes.freq - w / (2 * np.pi)))
        assert modes.damping_ratio[k] == pytest.approx(0.5 * (alpha / w + beta * w), rel=1e-9)


def scene_of(raw):
    config = parse_config(raw, "s.yaml")
    return build_scene(config, ".", "s.yaml"), config


@pytest.mark.parametrize(
    "effects", [(), ("incompressible water",), ("anchors", "masses"), ("viscous boundary",)]
)
def test_materials_that_all_name_one_damping_are_the_scene_that_has_it(effects):
    """C of every block is that of the section `damping`; what has no material keeps the scene's own."""
    own = {"frequencies": [3.0, 15.0], "ratio": 0.06}
    raw, other = job(*effects), job(*effects)
    raw["damping"] = {"rayleigh": own}
    other["damping"] = {"rayleigh": {"alpha": 0.0, "beta": 0.0}} if not effects else {"rayleigh": own}
    for material in other["materials"].values():
        material["damping"] = own
    for order in ("reduced", "full"):
        made = []
        for one in (raw, other):
            scene, config = scene_of(one)
            if order == "full":
                made.append(assemble_full(scene, config.damping))
            else:
                made.append(reduce_scene(scene, ALL_MODES, config.damping).system)
        first, second = made
        size = abs(first.C).max()
        assert abs(first.C - second.C).max() < 1e-11 * size
        assert first.diagonal == second.diagonal
        if first.drag is not None:
            difference = first.drag @ first.drag.T - second.drag @ second.drag.T
            assert np.abs(difference).max() < 1e-11 * size


@pytest.mark.parametrize("alpha", [0.0, 2.0])
def test_mass_terms_do_not_brake_what_joints_alone_hold(alpha):
    """A body of two materials on friction: C R = 0 on its rigid motions, C = sum of both where it strains."""
    raw = bars()
    raw["supports"] = raw["supports"][1:]
    raw["damping"] = {"rayleigh": {"alpha": alpha, "beta": 1e-4}}
    raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}]
    scene, config = scene_of(raw)
    full = assemble_full(scene, config.damping)
    size = abs(full.C).max()
    translation = np.zeros((full.size, 1))
    translation[full.parts["left"] if "left" in full.parts else next(iter(full.parts.values()))] = 1.0
    braked = full.C @ translation
    assert np.abs(braked).max() > 1e-4 * size
    assert np.abs(full.damping_force(translation)).max() < 1e-10 * np.abs(braked).max()
    reduced = reduce_scene(scene, ALL_MODES, config.damping).system
    rigid = reduced.K.diagonal() == 0.0
    assert rigid.sum() == 6 and not reduced.diagonal
    assert np.abs(reduced.C.toarray()[rigid]).max() < 1e-9 * abs(reduced.C).max()
    # the same damping seen from the mesh: eigenvalues of both pencils are one
    C = full.C.toarray() - full.drag @ full.drag.T
    both = [
        np.linalg.eigvals(
            np.block([[np.zeros_like(K), np.eye(len(K))], [-np.linalg.solve(M, K), -np.linalg.solve(M, c)]])
        )
        for K, M, c in (
            (full.K.toarray(), full.M.toarray(), C),
            (reduced.K.toarray(), reduced.M.toarray(), reduced.C.toarray()),
        )
    ]
    first, second = (np.sort_complex(np.round(values[np.abs(values) > 1.0], 3)) for values in both)
    np.testing.assert_allclose(first, second, rtol=1e-5, atol=1e-2)


def test_parts_of_one_damping_each_stay_apart_and_are_propagated_exactly():
    """Left and tail of one material, right of another: no mode couples, the adaptive integrator runs."""
    raw = bars()
    raw["materials"]["m_tail"]["damping"] = raw["materials"]["m_left"]["damping"]
    raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}]
    scene, config = scene_of(raw)
    system = reduce_scene(scene, ALL_MODES, config.damping).system
    assert system.diagonal
    omega2, c = system.K.diagonal(), system.C.diagonal()
    for part, damping in (("left", BARS["left"][3]), ("right", None)):
        alpha, beta = coefficients(damping)
        columns = next(value for key, value in system.parts.items() if part in key)
        np.testing.assert_allclose(c[columns], alpha + beta * omega2[columns], rtol=1e-12)
    del raw["records"]
    raw["transient"]["finest_step"] = 1e-4
    fine = run(raw, shaken(0.1), finer=10)
    coarse = run(raw | {"model": {"order": "full"}}, shaken(0.1), finer=10)
    assert fine.attrs["integrator"] == "adaptive" and coarse.attrs["integrator"] == "generalized_alpha"
    size = np.abs(coarse.displacement.values).max()
    assert np.abs(fine.displacement.values - coarse.displacement.values).max() < 5e-3 * size


def test_what_cannot_have_it_is_refused_by_the_key():
    raw = bars() | {"records": [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}]}
    with pytest.raises(ConfigError, match=r"materials.<name>.damping: is of a material, and damping.modal"):
        parse_config(raw | {"damping": {"modal": 0.05}}, "job.yaml")
    with pytest.raises(ConfigError, match=r"transient.integrator: adaptive needs modes that nothing couples"):
        parse_config(raw | {"transient": {"finest_step": 1e-4, "integrator": "adaptive"}}, "job.yaml")
    wrong = bars() | {"records": raw["records"]}
    wrong["materials"]["m_left"]["damping"] = {"ratio": 0.05}
    with pytest.raises(ConfigError, match=r"materials.m_left.damping: give either `frequencies` and `ratio`"):
        parse_config(wrong, "job.yaml")


@pytest.mark.parametrize(
    ("effects", "path", "value"),
    [
        pytest.param((), "materials.rock.damping.beta", 1.5e-3, marks=pytest.mark.slow),
        pytest.param(("free field",), "materials.rock.damping.beta", 1.5e-3, marks=pytest.mark.slow),
        pytest.param(
            ("incompressible water", "anchors"),
            "materials.concrete.damping.ratio",
            0.02,
            marks=pytest.mark.slow,
        ),
        (("moduli by duration", "viscous boundary"), "materials.*.damping.alpha", 1.1),
    ],
)
def test_suites_vary_the_damping_of_tied_materials(tmp_path, effects, path, value):
    """Coupled modes: the row of a sample is the row of the job that has the value written in; 1e-9."""
    np.savetxt(tmp_path / "r.txt", np.c_[shaken(0.4)])
    raw = job(*effects, "damping by material")
    raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}]
    raw["model"], raw["transient"] = {"modes": 12}, {"finest_step": DT}
    raw["outputs"] |= {"error_estimate": False, "mesh_error": False, "plots": False}
    key = path.rpartition(".")[2]
    found = []
    for written, values in ((False, [0.5 * value, value]), (True, [value])):
        one = copy.deepcopy(raw)
        if written:
            own = [
                one["materials"][name].get("damping")
                for name in one["materials"]
                if name in path or "*" in path
            ]
            for damping in own:
                damping |= {key: value} if key in damping else {}
        one["suite"] = {"parameters": {"x": {"path": path, "values": values}}}
        config = tmp_path / f"{written}.yaml"
        config.write_text(yaml.safe_dump(one | {"pipeline": "suite"}))
        run_suite(romdam.load_config(config), tmp_path / str(written), SuiteOptions(workers=1))
        found.append(xr.load_dataset(tmp_path / str(written) / "summary.nc").isel(sample=-1))
    for name in ("peak_opening", "peak_displacement", "energy_damping"):
        got, want = found[0][name].values, found[1][name].values
        np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-12 * np.abs(want).max(), err_msg=name)
        assert np.abs(want).max() > 0.0


def test_a_suite_over_the_damping_of_the_scene_is_refused(tmp_path):
    """It is in the coupled modes too; the materials' own can be varied."""
    raw = bars() | {"records": [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}]}
    raw |= {
        "pipeline": "suite",
        "suite": {"parameters": {"b": {"path": "damping.rayleigh.beta", "values": [1e-4]}}},
    }
    with pytest.raises(ConfigError, match=r"1 of damping varied, limit 0 with damping by material"):
        parse_config(raw, "job.yaml")


def test_a_result_and_its_report_state_the_damping_of_materials_and_effective_ratios():
    """Ratios of the open-joint modes by the bars' own matrices; the attribute and the pages' tables."""
    raw = bars(modes="all")
    raw["supports"] += [
        {"block": block, "face": face, "fix": ["y", "z"]}
        for block in ("left", "tail", "right")
        for face in ("ymin", "ymax")
    ]
    data = run(raw, shaken(0.05), finer=2)
    K, M, C, free = bar_matrices()
    omega2, phi = eigh(K[free, free], M[free, free])
    ratio = (phi.T @ C[free, free] @ phi).diagonal() / (2 * np.sqrt(omega2))
    order = np.argsort(data.mode_frequency.values)
    np.testing.assert_allclose(
        data.mode_frequency.values[order][:8], np.sqrt(omega2[:8]) / (2 * np.pi), rtol=1e-9
    )
    np.testing.assert_allclose(data.mode_damping_ratio.values[order][:8], ratio[:8], rtol=1e-8)
    assert "left: alpha = 12 1/s, beta = 0.0002 s of their own M and K" in data.attrs["material_damping"]
    raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}]
    section = dam_section(RunSubject(data, parse_config(raw, "job.yaml"), {}, {}))
    tables = {part.caption: part for part in section.parts if isinstance(part, PageTable)}
    assert [row[-1] for row in tables["Materials"].rows] == [
        "alpha 12 1/s, beta 0.0002 s",
        "1.5 % at 20 and 120 Hz",
        "of all",
    ]
    first = tables["Lowest modes with joints open"].rows[0]
    assert float(first[0]) == pytest.approx(np.sqrt(omega2[0]) / (2 * np.pi), rel=1e-3)
    assert float(first[1]) == pytest.approx(100 * ratio[0], rel=1e-2)
