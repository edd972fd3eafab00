"""Dams that are built in stages: closed forms of bars, an independent superposition, what is refused."""

from pathlib import Path

import numpy as np
import pytest

import romdam
from romdam.config import parse_config
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.effects.full_order import assemble_full
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.construction import constructed
from romdam.timestepping.equilibrium import static_equilibrium
from romdam.visual.report.one_run import RunSubject, loads_section
from romdam.visual.report.parts import PageTable

E, RHO, ALPHA, G = 20e9, 2500.0, 1e-5, 9.81
STIFFNESS = 5e9  # Pa/m
PROXIMAL = 1e-6  # of what floats: the iteration stops once a step moves it by 1e-9


def box(origin, size, edge):
    return {"material": "concrete", "box": {"origin": origin, "size": size, "element_size": edge}}


def job(blocks, joints, supports, stages, loads, **more):
    return {
        "materials": {"concrete": {"E": E, "nu": 0.0, "rho": RHO, "expansion": ALPHA}},
        "blocks": blocks,
        "joints": joints,
        "supports": supports,
        "construction": stages,
        "loads": loads,
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"modes": 3},
        "transient": {"finest_step": 0.01},
    } | more


def systems(raw):
    """The scene, and its systems at full order and reduced, after construction."""
    config = parse_config(raw, "dam.yaml")
    scene = build_scene(config, Path(), "dam.yaml")
    both = assemble_full(scene, config.damping), reduce_scene(scene, config.model, config.damping).system
    return scene, [constructed(system, 1e-12) for system in both]


LIFTS, HEIGHT, SIDE = 4, 3.0, 2.0


def column(stages, friction):
    """A bar of lifts on top of each other, with horizontal joints between them."""
    blocks, joints, supports, nodes = {}, {}, [{"block": "lift1", "face": "zmin"}], {}
    for k in range(1, LIFTS + 1):
        z = (k - 1) * HEIGHT
        blocks[f"lift{k}"] = box([0, 0, z], [SIDE, SIDE, HEIGHT], [SIDE, SIDE, HEIGHT / 2])
        nodes[f"top{k}"] = {"block": f"lift{k}", "at": [0, 0, z + HEIGHT]}
        if k > 1:
            joints[f"J{k}"] = {"between": [f"lift{k - 1}", f"lift{k}"], "normal_stiffness": STIFFNESS} | (
                {"friction": 0.6, "shear_stiffness": STIFFNESS / 2, "cohesion": 1e6, "tensile_strength": 1e6}
                if friction
                else {}
            )
    return job(blocks, joints, supports, stages, {"gravity": [0, 0, -G]}, outputs={"nodes": nodes})


@pytest.mark.parametrize("friction", [False, True])
def test_column_built_in_lifts_against_built_at_once(friction):
    """Since it was poured, the top of a lift has sunk by its own weight and that of lifts above alone."""
    area, weight = SIDE**2, RHO * G * SIDE**2 * HEIGHT
    pours = [{"name": f"pour {k}", "pour": [f"lift{k}"]} for k in range(1, LIFTS + 1)]
    flexibility, joint = HEIGHT / (E * area), 1.0 / (STIFFNESS * area)
    staged, once = np.zeros(LIFTS), np.zeros(LIFTS)
    for k in range(1, LIFTS + 1):
        own = weight * ((k - 0.5) * flexibility + (k - 1) * joint)
        above = (LIFTS - k) * weight * (k * flexibility + (k - 1) * joint)
        staged[k - 1] = own + above
        for i in range(1, k + 1):  # at once each lift below sinks under all that it carries
            once[k - 1] += (
                weight * (LIFTS - i + 0.5) * flexibility + (i > 1) * weight * (LIFTS - i + 1) * joint
            )
    together = [{"name": "all", "pour": [f"lift{k}" for k in range(1, LIFTS + 1)]}]
    for stages, closed_form in ((pours, staged), (together, once)):
        for system in systems(column(stages, friction))[1]:
            q, gaps = static_equilibrium(system, 1e-12)
            settlement = -(system.observe @ q)[2::3]
            assert settlement == pytest.approx(closed_form, rel=PROXIMAL)
            carried = [gaps.force[of, 0].sum() for of in system.law.joints.values()]
            assert carried == pytest.approx([weight * (LIFTS - k) for k in range(1, LIFTS)], rel=PROXIMAL)
            assert np.isnan(system.built.opening[0]).any() == (stages is pours)
    assert np.abs(staged / once - 1.0).max() > 0.3


LENGTH, WIDE = 6.0, 2.0


def pillars(stages, change, friction):
    """Two pairs of pillars between rigid abutments, free sideways, a joint in the middle of each."""
    blocks, supports = {}, []
    for k, (left, right) in enumerate((("a", "b"), ("c", "d"))):
        y, edge = 5.0 * k, [LENGTH / 2, WIDE, WIDE]
        blocks[left] = box([0, y, 0], [LENGTH, WIDE, WIDE], edge)
        blocks[right] = box([LENGTH, y, 0], [LENGTH, WIDE, WIDE], edge)
        for name, end in ((left, "xmin"), (right, "xmax")):
            sides = ((end, "x"), ("ymin", "y"), ("zmin", "z"))
            supports += [{"block": name, "face": face, "fix": [axis]} for face, axis in sides]
    law = {"normal_stiffness": STIFFNESS} | (
        {"friction": 0.8, "shear_stiffness": STIFFNESS / 2, "tensile_strength": 1e3, "cohesion": 1e3}
        if friction
        else {}
    )
    joints = {"early": {"between": ["a", "b"]} | law, "late": {"between": ["c", "d"]} | law}
    return job(blocks, joints, supports, stages, {"temperature": [{"change": change}]})


@pytest.mark.parametrize("friction", [False, True])
def test_joints_grouted_at_two_temperatures_have_no_common_reference(friction):
    """Grouted 4 K and 10 K below the blocks' own: at -7 K one joint is open, the other presses."""
    cool = [{"change": "-4 K"}]
    colder = [{"change": "-10 K"}]
    stages = [
        {"name": "autumn", "temperature": cool, "grout": [{"joints": ["early"]}]},
        {"name": "winter", "temperature": colder, "grout": [{"joints": ["late"]}]},
    ]
    area = WIDE**2
    pressed = ALPHA * 3.0 * 2 * LENGTH / (2 * LENGTH / (E * area) + 1.0 / (STIFFNESS * area))
    for system in systems(pillars(stages, "-7 K", friction))[1]:
        early, late = (system.law.joints[name] for name in ("early", "late"))
        built = system.built
        assert built.opening[0] == pytest.approx(ALPHA * 4.0 * 2 * LENGTH, rel=1e-9)
        assert built.opening[1, early] == pytest.approx(ALPHA * 6.0 * 2 * LENGTH, rel=1e-9)
        assert built.opening[1, late] == pytest.approx(ALPHA * 10.0 * 2 * LENGTH, rel=1e-9)
        _, gaps = static_equilibrium(system, 1e-12)
        assert gaps.jump[early, 0] == pytest.approx(ALPHA * 3.0 * 2 * LENGTH, rel=1e-9)
        assert gaps.force[late, 0].sum() == pytest.approx(pressed, rel=1e-9)
        assert np.abs(gaps.force[late, 1:]).max(initial=0.0) < 1e-9 * pressed


@pytest.mark.parametrize("friction", [False, True])
def test_grout_keeps_the_pressure_that_it_sets_under(friction):
    """Of the pump where a joint was open, of the pillars where it was pressed; both change with the
    temperature after that: forces of two bars and a spring."""
    pressure, area = 0.5e6, WIDE**2
    per_kelvin = ALPHA * 2 * LENGTH / (2 * LENGTH / (E * area) + 1.0 / (STIFFNESS * area))
    stages = [
        {"name": "cold", "temperature": [{"change": "-4 K"}], "grout": [{"joints": ["early"]}]},
        {"name": "warm", "temperature": [{"change": "1 K"}], "grout": [{"joints": ["late"]}]},
    ]
    for change in ("1 K", "-3 K", "-5 K"):
        raw = pillars(stages, change, friction)
        raw["joints"]["early"]["grouting_pressure"] = pressure
        warmer = {"early": float(change.split()[0]) + 4.0, "late": float(change.split()[0])}
        forces = {
            "early": pressure * area + per_kelvin * warmer["early"],
            "late": max(per_kelvin * warmer["late"], 0.0),
        }
        for system in systems(raw)[1]:
            _, gaps = static_equilibrium(system, 1e-12)
            for name, force in forces.items():
                found = gaps.force[system.law.joints[name], 0].sum()
                assert found == pytest.approx(force, rel=1e-9, abs=1e-6)  # N


def monoliths(stages, **more):
    """Three cantilevers of unequal height; weight, and pressure that closes their joints and bends them."""
    heights, blocks = (6.0, 10.0, 8.0), {}
    for k, (name, height) in enumerate(zip("abc", heights, strict=True)):
        blocks[name] = box([4.0 * k, 0, 0], [4.0, 2.0, height], [2.0, 2.0, 2.0])
    law = {"normal_stiffness": STIFFNESS, "shear_stiffness": STIFFNESS / 2, "friction": 1.9}
    joints = {"J1": {"between": ["a", "b"]} | law, "J2": {"between": ["b", "c"]} | law}
    loads = {
        "gravity": [3.0, 1.0, -9.81],
        "temperature": [{"change": "-5 K"}],
        "pressure": [
            {"block": "a", "face": "xmin", "value": 2e6},
            {"block": "c", "face": "xmax", "value": 2e6},
            {"block": "b", "face": "ymin", "value": 5e4},
        ],
    }
    supports = [{"block": name, "face": "zmin"} for name in "abc"]
    return job(blocks, joints, supports, stages, loads, **more)


def test_weight_in_cantilevers_and_pressure_in_the_arch_superpose():
    """Joints open while weight and cooling act, stuck after grouting: K_open and K with springs, by hand."""
    stages = [
        {"name": "blocks", "pour": ["a", "b", "c"], "temperature": [{"change": "-60 K"}]},
        {"name": "grout", "temperature": [{"change": "-60 K"}], "grout": [{"joints": ["J1", "J2"]}]},
        {"name": "warm", "temperature": [{"change": "-60 K"}]},
    ]
    raw = monoliths(stages)
    raw["loads"]["temperature"] = [{"change": "-60 K"}]
    scene, (full, reduced) = systems(raw)
    K, B = full.K.toarray(), full.B.toarray()
    area = np.concatenate([joint.area for joint in scene.joints.values()])
    springs = np.outer(area, [STIFFNESS, STIFFNESS / 2, STIFFNESS / 2]).ravel()
    config = parse_config(raw, "dam.yaml")
    alone = parse_config(raw | {"loads": raw["loads"] | {"pressure": []}}, "dam.yaml")
    weight = assemble_full(build_scene(alone, Path(), "d"), config.damping).force
    open_joints = np.linalg.solve(K, weight)
    assert (B @ open_joints)[::3].min() > 1e-4  # no contact before grouting
    arch = np.linalg.solve(K + B.T @ (springs[:, None] * B), full.force - weight)
    by_hand = (-springs * (B @ arch)).reshape(-1, 3)
    assert by_hand[:, 0].min() > 0.0 and (np.abs(by_hand[:, 1:]).max(axis=1) < 1.9 * by_hand[:, 0]).all()
    for system in (full, reduced):
        q, gaps = static_equilibrium(system, 1e-12)
        assert gaps.force == pytest.approx(by_hand, abs=1e-8 * np.abs(by_hand).max())
        assert system.built.opening[0] == pytest.approx((B @ open_joints)[::3], rel=1e-8)
        assert np.abs(system.built.opening[2]).max() < 1e-9 * system.built.opening[0].max()
    q, _ = static_equilibrium(full, 1e-12)
    assert q == pytest.approx(open_joints + arch, abs=1e-9 * np.abs(q).max())


ORDERS = {
    "water before its block": (
        [{"name": "lake", "level": "5 m"}, {"name": "late", "pour": ["c"]}],
        r"construction\[0\].level: water at 5 m wets block 'c', whose face begins at 0 m, before it is "
        "poured in stage 'late'",
    ),
    "grout before its block": (
        [{"name": "zone", "grout": [{"joints": ["J2"]}]}, {"name": "late", "pour": ["c"]}],
        r"construction\[0\].grout\[0\]: joint 'J2' is grouted in stage 'zone', and its block 'c' is poured "
        "in stage 'late'",
    ),
    "zone above the joint": (
        [{"name": "zone", "grout": [{"joints": ["J1"], "above": "9 m"}]}],
        r"no gap of joint 'J1' is in the zone from 9 to inf m, limit 1; its gaps are at z = 2 to 6 m",
    ),
    "zones that overlap": (
        [
            {"name": "one", "grout": [{"joints": ["J1"], "below": "5 m"}]},
            {"name": "two", "grout": [{"joints": ["J1"], "above": "3 m"}]},
        ],
        r"construction\[1\].grout\[0\]: 2 of 4 gaps of joint 'J1' in the zone, the first at z = 4 m, are "
        "grouted in stage 'one' already",
    ),
    "a zone left out": (
        [{"name": "one", "grout": [{"joints": ["J1"], "below": "13.12 ft"}]}],
        "4 of 6 gaps of joint 'J1', at z = 4 to 6 m, are grouted in no stage",
    ),
    "temperature before its block": (
        [
            {"name": "cold", "temperature": [{"change": "-3 K", "blocks": ["c"]}]},
            {"name": "l", "pour": ["c"]},
        ],
        r"construction\[0\].temperature\[0\].blocks: block 'c' has a temperature in stage 'cold' and is not "
        "poured yet",
    ),
    "water that wets nothing": (
        [{"name": "lake", "level": "-1 m"}],
        r"construction\[0\].level: -1 m is below every face of loads.hydrostatic",
    ),
    "water above its load": (
        [{"name": "lake", "level": "30 m"}],
        r"construction\[0\].level: 30 m is above every level of loads.hydrostatic, the highest "
        "of which is 8 m",
    ),
    "poured twice": (
        [{"name": "one", "pour": ["c"]}, {"name": "two", "pour": ["c"]}],
        r"construction\[1\].pour: block 'c' is poured in stage 'one' already, limit once",
    ),
    "names twice": (
        [{"name": "one", "pour": ["c"]}, {"name": "one", "pour": ["b"]}],
        r"construction\[1\].name: 'one' is the name of construction\[0\] too",
    ),
    "nothing": ([{"name": "one"}], r"does nothing; give `pour`, `temperature`, `level` or `grout`"),
    "zone upside down": (
        [{"name": "zone", "grout": [{"joints": ["J1"], "above": "9 m", "below": "3 m"}]}],
        "`above` must be lower than `below`, got 9 m and 3 m",
    ),
    "no such joint": (
        [{"name": "zone", "grout": [{"joints": ["J7"]}]}],
        r"construction\[0\].grout.joints: no 'J7' is defined",
    ),
    "no such block": ([{"name": "one", "pour": ["x"]}], r"construction\[0\]: no 'x' is defined"),
}


@pytest.mark.parametrize("case", ORDERS)
def test_order_that_cannot_be_is_refused_with_place_and_numbers(case):
    stages, message = ORDERS[case]
    raw = monoliths(stages)
    wet = [{"block": name, "face": "ymin"} for name in "abc"]
    raw["loads"]["hydrostatic"] = [{"level": "8 m", "faces": wet}]
    with pytest.raises(ConfigError, match=message):
        build_scene(parse_config(raw, "dam.yaml"), Path(), "dam.yaml")


def test_other_keys_that_contradict_are_refused():
    stage = [{"name": "zone", "grout": [{"joints": ["J1"]}]}]
    pressed = monoliths(stage)
    pressed["joints"]["J2"] = pressed["joints"]["J2"] | {"grouting_pressure": 1e5}
    undeformed = monoliths(stage)
    undeformed["loads"]["initial_state"] = "undeformed"
    for raw, message in (
        (pressed, "joints.J2.grouting_pressure: no stage of `construction` grouts the joint"),
        (undeformed, "loads.initial_state: undeformed starts without one"),
        (
            monoliths(stage) | {"linear_stage": {}},
            "linear_stage: construction grouts joints one after another",
        ),
    ):
        with pytest.raises(ConfigError, match=message):
            parse_config(raw, "dam.yaml")


def test_lift_on_a_lift_that_is_not_poured_is_refused():
    stages = [{"name": "upper", "pour": ["lift3", "lift4"]}, {"name": "lower", "pour": ["lift1", "lift2"]}]
    with pytest.raises(
        ConfigError, match=r"construction\[0\].pour: stage 'upper': .*'lift3'.*pour first what"
    ):
        build_scene(parse_config(column(stages, False), "dam.yaml"), Path(), "dam.yaml")


def test_tied_blocks_are_poured_together():
    raw = monoliths([{"name": "one", "pour": ["a"]}, {"name": "two", "pour": ["b"]}])
    raw["ties"] = {"grown": {"between": raw["joints"].pop("J1")["between"]}}
    with pytest.raises(ConfigError, match="the tied blocks a, b are poured in several stages, one, two"):
        build_scene(parse_config(raw, "dam.yaml"), Path(), "dam.yaml")
    raw["construction"] = [{"name": "two", "pour": ["b"]}]
    with pytest.raises(
        ConfigError, match="block 'a' has weight in stage 'before the stages', before block 'b'"
    ):
        build_scene(parse_config(raw, "dam.yaml"), Path(), "dam.yaml")


def test_stage_without_equilibrium_is_named():
    """A block on frictionless joints alone that gravity pushes sideways."""
    raw = column([{"name": "tower", "pour": [f"lift{k}" for k in range(1, LIFTS + 1)]}], True)
    raw["loads"]["gravity"] = [9.81, 0, -0.1]
    for joint in raw["joints"].values():
        del joint["cohesion"], joint["tensile_strength"]
    with pytest.raises(ConvergenceError, match="construction, stage 'tower': initial state: no static"):
        systems(raw)


STAGES = [
    {"name": "blocks", "pour": ["a", "b", "c"], "temperature": [{"change": "-60 K"}]},
    {"name": "lower", "grout": [{"joints": ["J1", "J2"], "below": "3 m"}]},
    {
        "name": "upper",
        "temperature": [{"change": "-50 K"}],
        "grout": [{"joints": ["J1", "J2"], "above": "3 m"}],
    },
    {"name": "lake", "level": "5 m"},
]


def run_job(tmp_path, **more):
    """A job with a record, ready to run."""
    time = np.arange(60) * 0.01
    np.savetxt(tmp_path / "r.txt", 4.0 * np.sin(20.0 * time) * np.exp(-4.0 * time))
    raw = monoliths(STAGES, damping={"rayleigh": {"frequencies": [5.0, 50.0], "ratio": 0.05}})
    raw["records"] = [{"file": str(tmp_path / "r.txt"), "unit": "m/s2", "dt": 0.01, "components": {"x": 1}}]
    del raw["loads"]["temperature"]
    raw["loads"]["hydrostatic"] = [{"level": "7 m", "faces": [{"block": n, "face": "ymin"} for n in "abc"]}]
    raw["outputs"] = {"mesh_error": False, "plots": False, "nodes": {"top": {"block": "b", "at": [4, 0, 10]}}}
    return raw | more


def test_result_and_report_have_the_openings_by_stage(tmp_path):
    """Zones are filled one after the other; temperatures stay from stage to stage into the run."""
    out = romdam.run(run_job(tmp_path), tmp_path / "out")
    data = out.results[0].dataset
    assert data.construction_stage.values.tolist() == ["blocks", "lower", "upper", "lake"]
    opening, z = data.construction_opening.values, data.gap_position.values[:, 2]
    low = z < 3.0
    assert (data.construction_grouted.values == np.stack([0 * z, low, ~low, 0 * z])).all()
    assert opening[0] == pytest.approx(opening[1], rel=1e-9)
    assert opening[0].min() > 1e-4
    assert np.abs(opening[3, ~low]).max() < opening[0].min()
    assert "construction_normal_force" in data
    config = parse_config(run_job(tmp_path), "dam.yaml")
    parts = loads_section(RunSubject(data, config, {}, {})).parts
    (table,) = (
        part for part in parts if isinstance(part, PageTable) and "stage of construction" in part.caption
    )
    assert table.head == ["joint", "blocks", "lower", "upper", "lake"]
    assert [row[0] for row in table.rows] == ["J1", "J2"]
    for row in table.rows:
        assert row[2].endswith(", then grouted in part") and row[3].endswith(", then grouted in part")


def test_run_goes_on_from_the_end_of_another_of_the_same_construction(tmp_path):
    """Slip and openings count from the same grout: both records in one run, and one after the other."""
    raw = run_job(tmp_path)
    first = romdam.run(raw, tmp_path / "first").paths[0]
    again = run_job(tmp_path)
    again["loads"]["initial_state"] = {"result": str(first), "take": "all"}
    second = romdam.run(again, tmp_path / "second").results[0].dataset
    begin, end = second.opening.values[0], romdam.open_result(first).dataset.opening.values[-1]
    assert begin == pytest.approx(end, abs=1e-6 * np.abs(end).max() + 1e-9)
    again["loads"]["initial_state"] = {"result": str(first), "take": "joints"}
    romdam.run(again, tmp_path / "joints")
