"""Sustained modulus at rest and dynamic modulus of the record, against closed forms and a bar of its own."""

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_combinations import job

import romdam
from romdam.config import parse_config
from romdam.config.effects import refuse_unknown_effects
from romdam.core.errors import ConfigError
from romdam.core.motion import GroundMotion
from romdam.pipelines.linear import linear
from romdam.pipelines.suites.run import SuiteOptions, run_suite

G, RHO, DT = 9.81, 2400.0, 0.005
E, E_D = 20e9, 32e9


def box(origin, size, edge, material, element="hex8"):
    of_box = {"origin": origin, "size": size, "element_size": edge, "element": element}
    return {"material": material, "box": of_box}


def column(**model):
    """A column of 20 m on a block of 4 m, a joint between them; without lateral strain (nu = 0)."""
    return {
        "materials": {"concrete": {"E": E, "E_dynamic": E_D, "nu": 0.0, "rho": RHO}},
        "blocks": {
            "foot": box([0, 0, -4], [2, 2, 4], [2, 2, 2], "concrete"),
            "column": box([0, 0, 0], [2, 2, 20], [2, 2, 1], "concrete"),
        },
        "supports": [{"block": "foot", "face": "zmin"}],
        "joints": {"joint": {"between": ["foot", "column"], "normal_stiffness": "100 GPa/m"}},
        "loads": {"gravity": [0, 0, -G]},
        "damping": {"rayleigh": {"frequencies": [5.0, 80.0], "ratio": 0.02}},
        "model": model or {"modes": "all"},
        "transient": {"finest_step": DT / 10},
        "outputs": {
            "nodes": {"top": {"block": "column", "at": [0, 0, 20]}},
            "stress": {
                "blocks": ["column"],
                "sections": {"middle": {"blocks": ["column"], "point": [1, 1, 10]}},
            },
            "error_estimate": False,
            "mesh_error": False,
            "plots": False,
        },
    }


def run(raw, acc, axis="z", dt=DT):
    motion = GroundMotion.from_arrays("pulse", {axis: acc}, dt)
    return romdam.run(raw, motions=motion).results[0].dataset


def pulse(a, seconds=1.0, f=4.0):
    t = np.arange(round(seconds / DT) + 1) * DT
    return a * np.sin(2 * np.pi * f * t) * np.sin(np.pi * np.minimum(t / 0.5, 1.0)) ** 2


@pytest.mark.parametrize("model", [{"modes": "all"}, {"modes": 12}, {"order": "full"}])
def test_column_rests_by_its_sustained_modulus_and_swings_by_its_dynamic_one(model):
    """Shortening and forces by hand; the period is that of rods of E_dynamic with the joint between."""
    data = run(column(**model), np.concatenate([np.full(2, 0.5), np.zeros(200)]))
    weight, area = RHO * G * 20.0, 4.0  # per area; [m2]
    shortened = (weight * 4.0 + RHO * G * 8.0) / E + weight / 100e9 + RHO * G * 200.0 / E
    top = data.displacement.sel(node="top").values[:, 2]
    assert -top[0] == pytest.approx(shortened, rel=1e-3)
    assert data.normal_force.values[0].sum() == pytest.approx(-weight * area, rel=1e-6)
    section = data.section_force.values[:, 0, 0]
    assert section[0] == pytest.approx(-0.5 * weight * area, rel=2e-3)
    # rods of 4 and 20 m with a spring between: tan(a) tan(b) - ... by the roots of the dynamic stiffness
    c, k = np.sqrt(E_D / RHO), 100e9

    def unbalanced(omega):
        """Stiffness of the spring and the free rod in series, and of the foot."""
        q = omega / c
        free, foot = -E_D * q * np.tan(20.0 * q), E_D * q / np.tan(4.0 * q)
        return 1.0 / (1.0 / free + 1.0 / k) + foot

    first = brentq(unbalanced, 0.02 * c, 0.96 * np.pi / 2.0 / 20.0 * c) / (2.0 * np.pi)
    swing = top[2:] - top[0]
    t, up = data.time.values[2:], np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    crossing = t[up] - swing[up] * (t[up + 1] - t[up]) / (swing[up + 1] - swing[up])
    found = (len(crossing) - 1) / (crossing[-1] - crossing[0])
    assert found == pytest.approx(first, rel=5e-3)
    assert "E = 20 GPa at rest" in data.attrs["moduli"] and "E_dynamic = 32 GPa" in data.attrs["moduli"]


# length of an element, gap, joint stiffness, temperature, expansion
H, GAP, K_N, WARM, ALPHA = 1.0, 1e-3, 20e9, 12.0, 1e-5
BARS = {"left": (0, 6, 18e9, 30e9), "tail": (6, 10, 12e9, 30e9), "right": (10, 16, 22e9, 28e9)}
XI = {"alpha": 20.0, "beta": 2e-4}
SHAKEN = 700.0 * np.sin(2 * np.pi * 31.0 * np.arange(41) * DT) * np.sin(np.pi * np.arange(41) / 40) ** 2


def bars(element="hex8", names=("left", "tail", "right"), **model):
    """Two bars, one of two merged blocks, with a gap between them that warmth closes."""
    name = dict(zip(BARS, names, strict=True))
    materials = {
        f"m_{k}": {"E": e, "E_dynamic": d, "nu": 0.0, "rho": RHO, "expansion": ALPHA}
        for k, (_, _, e, d) in BARS.items()
    }
    blocks = {
        name[k]: box([a, 0, 0], [b - a, 1, 1], [H, 1, 1], f"m_{k}", element)
        for k, (a, b, _, _) in BARS.items()
    }
    return {
        "materials": materials,
        "blocks": dict(sorted(blocks.items())),
        "ties": {"grown": {"between": [name["left"], name["tail"]]}},
        "supports": [{"block": name["left"], "face": "xmin"}, {"block": name["right"], "face": "xmax"}],
        "joints": {"gap": {"between": [name["tail"], name["right"]], "normal_stiffness": K_N, "gap": GAP}},
        "loads": {"temperature": [{"change": WARM}]},
        "damping": {"rayleigh": XI},
        "model": model or {"modes": "all"},
        "transient": {"finest_step": 2e-5},
        "outputs": {
            "nodes": {"end": {"block": name["tail"], "at": [10, 0, 0]}},
            "stress": {
                "blocks": list(name.values()),
                "sections": {
                    k: {"blocks": [name[k]], "point": [x, 0.5, 0.5], "normal": [1, 0, 0]}
                    for k, x in (("left", 2.5), ("tail", 8.5), ("right", 13.5))
                },
            },
            "error_estimate": False,
            "mesh_error": False,
            "plots": False,
            "output_interval": DT,
        },
    }


def bar_history(times):
    """Opening, displacement of the end, contact force, and normal forces of three elements, by scipy alone.

    Bars of two-node elements with consistent mass; the force inside is K_s u_s + K_d (u - u_s), warmth acts
    on K_s.
    """
    n = 18  # planes at 0..10 of the left bar, 10..16 of the right one
    K_s, K_d, M, warm, elements = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n), {}
    for key, (a, b, e, d) in BARS.items():
        for x in range(a, b):
            i = x + int(key == "right")
            at = np.ix_([i, i + 1], [i, i + 1])
            K_s[at] += e / H * np.array([[1, -1], [-1, 1]])
            K_d[at] += d / H * np.array([[1, -1], [-1, 1]])
            M[at] += RHO * H / 6.0 * np.array([[2, 1], [1, 2]])
            warm[[i, i + 1]] += e * ALPHA * WARM * np.array([-1, 1])
            elements[key, x] = i, e, d
    free = slice(1, n - 1)
    jump = np.zeros(n)
    jump[[10, 11]] = -1, 1

    def contact(u):
        opening = GAP + jump @ u
        return max(-opening, 0.0) * K_N  # compression of 1 m2

    def at_rest(p):
        u = np.zeros(n)
        u[free] = np.linalg.solve(K_s[free, free], (warm + jump * p)[free])
        return u

    p = brentq(lambda p: p - contact(at_rest(p)), 0.0, 1e9, xtol=1e-3)
    u_s = at_rest(p)
    C = (XI["alpha"] * M + XI["beta"] * K_d)[free, free]
    inverse = np.linalg.inv(M[free, free])
    moved, grid = (M @ np.ones(n))[free], np.arange(len(SHAKEN)) * DT

    def rate(t, y):
        u = np.zeros(n)
        u[free], v = y[: n - 2], y[n - 2 :]
        inside = (K_s @ u_s + K_d @ (u - u_s) - warm)[free]
        force = jump[free] * contact(u) - inside - C @ v - moved * np.interp(t, grid, SHAKEN)
        return np.concatenate([v, inverse @ force])

    y = np.concatenate([u_s[free], np.zeros(n - 2)])
    solved = solve_ivp(rate, (0, times[-1]), y, "RK45", t_eval=times, rtol=1e-7, atol=1e-12, max_step=2e-5).y
    u = np.zeros((n, len(times)))
    u[free] = solved[: n - 2]
    normal = {}
    for key, x in (("left", 2), ("tail", 8), ("right", 13)):
        i, e, d = elements[key, x]
        rest = e * ((u_s[i + 1] - u_s[i]) / H - ALPHA * WARM)
        normal[key] = rest + d * (u[i + 1] - u[i] - u_s[i + 1] + u_s[i]) / H
    return {
        "opening": GAP + jump @ u,
        "end": u[10],
        "force": np.array([contact(u[:, k]) for k in range(len(times))]),
        "rest": p,
    } | normal


def run_finely(raw, acc):
    """The same motion along x in short base steps."""
    return run(
        raw, np.interp(np.arange(20 * (len(acc) - 1) + 1) / 20, np.arange(len(acc)), acc), "x", DT / 20
    )


def of_result(data):
    sections = {str(name): data.section_force.sel(section=name).values[:, 0] for name in data.section.values}
    return {
        "opening": data.opening.values.mean(axis=1),
        "end": data.displacement.values[:, 0, 0],
        "force": -data.normal_force.values.sum(axis=1),
    } | sections


@pytest.fixture(scope="module")
def exact():
    return bar_history(np.arange(len(SHAKEN)) * DT)


@pytest.mark.parametrize(
    ("names", "model"),
    [
        (("left", "tail", "right"), {"order": "full"}),
        (("left", "tail", "right"), {"modes": "all"}),
        (("left", "tail", "right"), {"modes": 40}),
        (("c", "b", "a"), {"modes": 40}),
        (("c", "b", "a"), {"order": "full"}),
    ],
)
def test_gap_that_warmth_closes_is_shaken_as_by_scipy(exact, names, model):
    """Merged blocks of unlike ratios and a third beyond the gap: rest, jumps, force, normal forces; 0.5 %."""
    data = run_finely(bars(names=names, **model), SHAKEN)
    found = of_result(data)
    assert found["force"][0] == pytest.approx(exact["rest"], rel=1e-4) and exact["rest"] > 1e5
    assert (exact["opening"] > 1e-4).any() and (exact["opening"][20:] < 0).any()
    for name in ("opening", "end", "force", "left", "tail", "right"):
        size = np.abs(exact[name]).max()
        assert np.abs(found[name] - exact[name]).max() < 5e-3 * size, name


@pytest.mark.parametrize("element", ["hex20", "tet10"])
def test_merged_blocks_of_unlike_ratios_reduced_and_at_full_order(element):
    """With friction, shear and a lateral load: jumps, forces and stress reduced and of the mesh; 0.5 %."""
    found = []
    for model in ({"modes": 60}, {"order": "full"}):
        raw = bars(element, **model)
        for material in raw["materials"].values():
            material["nu"] = 0.2
        raw["joints"]["gap"] |= {"friction": 0.6, "shear_stiffness": 8e9}
        raw["loads"] |= {"gravity": [0, 0.4 * G, -G]}
        raw["transient"] = {"finest_step": 1e-4}
        motion = GroundMotion.from_arrays("p", {"x": 0.4 * SHAKEN[:25], "z": 0.2 * SHAKEN[5:30]}, DT)
        found.append(romdam.run(raw, motions=motion).results[0].dataset)
    reduced, full = found
    for name in ("opening", "normal_force", "displacement", "start_principal_stress", "section_force"):
        a, b = reduced[name].values, full[name].values
        assert np.abs(a[0] - b[0]).max() < 1e-6 * np.abs(b).max(), name
        assert np.abs(a - b).max() < 5e-3 * np.abs(b).max(), name
    assert (full["opening"].values > 1e-4).any()


def test_rock_without_mass_of_unlike_ratios_rests_and_yields_as_the_mesh_does():
    """Its reduced form is exact: two merged blocks without mass against the mesh, and at rest one modulus."""
    made = {}
    for case, model in (
        ("reduced", {"modes": "all"}),
        ("full", {"order": "full"}),
        ("rest", {"modes": "all"}),
    ):
        raw = bars(**model)
        raw["transient"] = {"finest_step": 1e-4}
        for name in ("left", "tail"):
            raw["blocks"][name]["mass"] = False
        if case == "rest":
            for material in raw["materials"].values():
                del material["E_dynamic"]
        made[case] = of_result(run_finely(raw, 2.0 * SHAKEN[:31]))
    for name, full in made["full"].items():
        size = np.abs(full).max()
        assert abs(made["reduced"][name][0] - made["rest"][name][0]) < 1e-7 * size, name
        assert np.abs(made["reduced"][name] - full).max() < 5e-3 * size, name
    assert (made["full"]["opening"] > 1e-4).any()


@pytest.mark.parametrize("ratio", [1.0, 0.6])
def test_equal_moduli_are_one_modulus_and_others_change_what_the_record_adds(ratio):
    """E_dynamic equal to E changes nothing by a bit; 5/3 of E adds other openings to the same rest."""
    raw, own = column(modes=8), column(modes=8)
    del own["materials"]["concrete"]["E_dynamic"]
    raw["materials"]["concrete"]["E_dynamic"] = E / ratio
    two, one = (run(job, pulse(8.0)) for job in (raw, own))
    same = np.array_equal(two.displacement.values, one.displacement.values)
    assert same == (ratio == 1.0) and ("moduli" in two.attrs) == (ratio != 1.0) and "moduli" not in one.attrs
    np.testing.assert_allclose(two.displacement.values[0], one.displacement.values[0], atol=1e-10)
    for name in ("start_principal_stress", "normal_force"):
        first, other = (
            data[name].values if "time" not in data[name].dims else data[name].values[0]
            for data in (two, one)
        )
        np.testing.assert_allclose(first, other, rtol=1e-7, atol=1e-2)
    np.testing.assert_allclose(two.section_force.values[0], one.section_force.values[0], rtol=1e-6, atol=1.0)


def refused(raw, match, **sections):
    with pytest.raises(ConfigError, match=match):
        parse_config(raw | sections, "job.yaml")


def test_what_has_no_two_moduli_is_refused_by_the_key():
    """A start without rest, stages, a certificate, decks: with the key and the remedy."""
    raw = column() | {"records": [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"z": 1}}]}
    for state in ("undeformed", {"result": "before.nc"}):
        refused(
            raw,
            r"E_dynamic: E is the modulus of the state at rest.*set static",
            loads={"initial_state": state},
        )
    refused(
        raw, r"E_dynamic: concrete hardens while stages", construction=[{"name": "all", "pour": ["column"]}]
    )
    config = parse_config(raw, "job.yaml")
    for computation in ("deck", "matrices", "certificate"):
        with pytest.raises(ConfigError, match=r"materials.<name>.E_dynamic: moduli by duration is not"):
            refuse_unknown_effects(config, computation, "job.yaml")


def test_merged_blocks_that_joints_alone_hold_need_one_ratio():
    raw = bars(modes=8)
    raw["supports"] = raw["supports"][1:]
    raw["loads"] = {}
    with pytest.raises(ConfigError, match=r"E / E_dynamic of 0.4 to 0.6 and joints alone hold them"):
        run(raw, SHAKEN, "x")


def dam(two, *effects, **joint):
    """A block tied to rock by a mortar, one beside it, and effects of `test_combinations`."""
    raw = job(*effects)
    raw["joints"]["joint"] |= joint
    raw["outputs"] |= {
        "stress": {
            "blocks": ["left", "rock"],
            "sections": {"low": {"blocks": ["left"], "point": [2, 2, 3]}},
        },
        "error_estimate": False, "mesh_error": False, "plots": False,
    }  # fmt: skip
    for name, (e, d) in {"concrete": (3e9, 4.5e9), "rock": (2e9, 2.4e9)}.items():
        raw["materials"][name] |= {"both": {"E": e, "E_dynamic": d}, "rest": {"E": e}, "record": {"E": d}}[
            two
        ]
    return {key: value for key, value in raw.items() if key != "records"}


def shaken(raw):
    """Along all axes."""
    acc = pulse(4.0, 0.4)
    motion = GroundMotion.from_arrays("p", {"x": acc, "y": 1.5 * acc[::-1], "z": 0.5 * acc}, DT)
    return romdam.run(raw, motions=motion).results[0].dataset


HISTORIES = ("opening", "normal_force", "displacement", "section_force", "section_moment")


@pytest.mark.parametrize("effects", [("grouting", "temperature"), ("water in joints",), ("staged weight",)])
@pytest.mark.parametrize(
    "model", [{"modes": "all"}, pytest.param({"modes": 12}, marks=pytest.mark.slow), {"order": "full"}]
)
def test_state_at_rest_is_that_of_a_job_with_the_sustained_moduli_alone(effects, model):
    """Jumps, forces, displacement, stress and sections of tied blocks of unlike ratios, with friction."""
    both, rest = (shaken(dam(two, *effects) | {"model": model}) for two in ("both", "rest"))
    for name in (*HISTORIES, "start_principal_stress"):
        got, want = both[name].values, rest[name].values
        got, want = (a if name.startswith("start") else a[0] for a in (got, want))
        least = 1.0 if name.startswith(("section", "start")) else 0.0  # [N], [N m], [Pa]: round-off
        assert np.abs(got - want).max() <= 2e-6 * np.abs(want).max() + least, name


@pytest.mark.parametrize("effects", [("temperature",), ("staged weight",), ("Westergaard's added mass",)])
@pytest.mark.parametrize("model", [{"modes": "all"}, pytest.param({"order": "full"}, marks=pytest.mark.slow)])
def test_in_an_elastic_scene_both_states_superpose(effects, model):
    """What the record adds is what it adds in a job with the dynamic moduli alone; stress too."""
    elastic = {"tension_stiffness": "2 GPa/m", "friction": 0.0}
    both, rest, record = (
        shaken(dam(two, *effects, **elastic) | {"model": model}) for two in ("both", "rest", "record")
    )
    for name in HISTORIES:
        got, want = both[name].values, rest[name].values[:1] + record[name].values - record[name].values[:1]
        assert np.abs(want - want[:1]).max() > 1e-2 * np.abs(want).max()
        assert np.abs(got - want).max() <= 1e-6 * np.abs(want).max(), name


def test_linear_stage_has_the_static_state_of_one_modulus_and_the_modes_of_the_other(tmp_path):
    """Joints tied, blocks of unlike ratios: displacement and stress at rest, frequencies, and peaks."""
    np.savetxt(tmp_path / "r.txt", pulse(3.0, 0.4))
    found = {}
    for two in ("both", "rest", "record"):
        raw = dam(two, "temperature") | {"model": {"modes": 12}, "linear_stage": {"cutoff": 60.0}}
        raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}]
        path = tmp_path / f"{two}.yaml"
        path.write_text(yaml.safe_dump(raw))
        found[two] = linear(path, tmp_path / two).stages["r"].spectrum
    both, rest, record = found.values()
    for name in ("static_displacement", "static_stress", "static_traction", "static_normal_force"):
        size = np.abs(rest[name].values).max()
        assert np.abs(both[name].values - rest[name].values).max() <= 2e-6 * size, name
    for name in ("frequency", "peak_displacement", "peak_stress"):
        size = np.abs(record[name].values).max()
        assert np.abs(both[name].values - record[name].values).max() <= 1e-6 * size, name


def test_kept_results_of_a_suite_with_another_rest_are_refused(tmp_path):
    np.savetxt(tmp_path / "r.txt", pulse(3.0, 0.4))
    raw = dam("both") | {"model": {"modes": 12}, "pipeline": "suite"}
    raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}]
    mu = {"mu": {"path": "joints.joint.friction", "values": [0.2, 0.6]}}
    raw["suite"] = {"parameters": mu, "keep": "full"}
    path = tmp_path / "suite.yaml"
    path.write_text(yaml.safe_dump(raw))
    with pytest.raises(ConfigError, match=r"suite.keep: with materials.<name>.E_dynamic .* mu may change it"):
        run_suite(romdam.load_config(path), tmp_path / "out", SuiteOptions(workers=1))


def test_a_suite_does_not_change_the_ratio_of_one_of_two_merged_blocks(tmp_path):
    """The basis answers what lasts with the ratios that it was made for."""
    np.savetxt(tmp_path / "r.txt", 0.01 * SHAKEN)
    raw = bars(modes=12) | {"pipeline": "suite"}
    raw["records"] = [{"file": "r.txt", "unit": "m/s2", "dt": DT, "components": {"x": 1}}]
    raw["suite"] = {"parameters": {"e": {"path": "materials.m_tail.E", "values": [9e9, 12e9]}}}
    path = tmp_path / "suite.yaml"
    path.write_text(yaml.safe_dump(raw))
    with pytest.raises(ConfigError, match=r"the ratio E / E_dynamic of part .* does not change as a whole"):
        run_suite(romdam.load_config(path), tmp_path / "out", SuiteOptions(workers=1))
