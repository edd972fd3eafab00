"""`romdam wedges`: rock wedges on one to three planes, against printed values and a search of all modes."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from rock_wedges import FOOT, NORTH, POUND, PSF, SLAB, active, hoek_and_bray, loads_of, only, random_wedge
from scipy.spatial import ConvexHull
from test_cli import call

import romdam
from romdam.core.errors import ConfigError
from romdam.pipelines.wedges import assess_wedges
from romdam.postprocess.wedges import (
    slide,
    trend_and_plunge,
    upward_normal,
)


def test_hoek_and_brays_wedge_has_its_printed_areas_weight_and_normal_forces():
    """W = 2.8272e7 lb, A = 5565.01, 6428.1 ft2; full of water N = 1.5171e7, 5.7892e6 lb; 31.20/157.73."""
    config, wedge, geometry = only(hoek_and_bray(1084.3 * PSF))
    assert 160.0 * geometry.volume / FOOT**3 == pytest.approx(2.8272e7, rel=2e-5)
    assert geometry.areas[:2] / FOOT**2 == pytest.approx([5565.01, 6428.1], rel=1e-5)
    assert geometry.areas[4] / FOOT**2 == pytest.approx(1846.6, rel=1e-4)
    wet = slide(geometry, wedge, active(config, geometry)[None])
    assert wet.normal_force[0] / POUND == pytest.approx([1.5171e7, 5.7892e6], rel=1e-4)
    assert trend_and_plunge(wet.direction[0], NORTH) == pytest.approx((157.73, 31.20), abs=0.01)
    strength = np.tan(np.radians([20, 30])) @ wet.normal_force[0] / POUND + 500 * 5565.01 + 1000 * 6428.1
    # along the line: weight, less what the crack's water pushes
    driving = 2.8272e7 * np.sin(np.radians(31.1965)) + 1084.3 * 1846.6 * (
        wet.direction[0] @ geometry.normals[4]
    )
    assert wet.factor[0] == pytest.approx(strength / driving, rel=1e-4)


def by_all_modes(normals, friction, cohesive, force):
    """Factor and direction by trying lifting off, one plane and two planes; None where nothing is free."""
    if (normals @ force > 0.0).all():
        return 0.0, force / np.linalg.norm(force)
    for k, normal in enumerate(normals):
        push = -normal @ force
        along = force + push * normal
        others = np.delete(normals, k, axis=0)
        if push > 0.0 and (others @ along > 0.0).all():
            size = np.linalg.norm(along)
            return (friction[k] * push + cohesive[k]) / size, along / size
    for i, j in combinations(range(len(normals)), 2):
        line = np.cross(normals[i], normals[j])
        line *= np.sign(line @ force) / np.linalg.norm(line)
        *pushes, driving = np.linalg.solve(np.column_stack([normals[i], normals[j], -line]), -force)
        others = np.delete(normals, [i, j], axis=0)
        if min(pushes) > 0.0 and (others @ line > 0.0).all():
            return (friction[[i, j]] @ pushes + cohesive[[i, j]].sum()) / driving, line
    return None


def test_every_mode_is_that_of_an_enumeration():
    rng, seen = np.random.default_rng(3), {"held": 0, 0: 0, 1: 0, 2: 0}
    for trial in range(400):
        planes = 1 + trial % 3
        raw, corners = random_wedge(rng, planes)
        config, wedge, geometry = only(raw)
        assert geometry.volume == pytest.approx(ConvexHull(corners).volume, rel=1e-9)
        force = active(config, geometry) + rng.normal(size=3) * 2600 * 9.81 * geometry.volume
        found = slide(geometry, wedge, force[None])
        normals, areas = geometry.normals[:planes], geometry.areas[:planes]
        friction, cohesion = (
            np.array([getattr(p, key) for p in wedge.planes.values()]) for key in ("friction", "cohesion")
        )
        expected = by_all_modes(normals, friction, cohesion * areas, force)
        if expected is None:
            assert np.isinf(found.factor[0]) and not found.direction.any()
            seen["held"] += 1
        else:
            assert found.factor[0] == pytest.approx(expected[0], rel=1e-9, abs=1e-12)
            np.testing.assert_allclose(found.direction[0], expected[1], atol=1e-9)
            seen[int(found.contact.sum())] += 1
    assert min(seen.values()) > 10, seen


def test_water_below_a_level_is_integrated_over_the_wet_part():
    """A wall of 10 m, foot at 0, level at 3 m: rho g 3^2 / 2 a metre; two thirds behind drains."""
    raw = SLAB | {"surfaces": {n: dict(s) for n, s in SLAB["surfaces"].items()}}
    raw["surfaces"]["x0"]["water"] = {"level": 3.0}
    raw["surfaces"]["x10"]["water"] = {"level": 3.0, "share": 2 / 3}
    raw["planes"] = {"base": SLAB["planes"]["base"] | {"water": {"level": 3.0, "share": 0.5}}}
    config, wedge, geometry = only(raw)
    water = dict(zip(geometry.names, loads_of(config, geometry).water[0], strict=True))
    assert geometry.volume == pytest.approx(400.0) and geometry.areas[0] == pytest.approx(100.0)
    assert water["x0"] == pytest.approx(9810 * 4.5 * 10) and water["x10"] == pytest.approx(9810 * 3.0 * 10)
    assert water["base"] == pytest.approx(0.5 * 9810 * 3.0 * 100)
    found = slide(geometry, wedge, active(config, geometry)[None])
    push = 2500 * 9.81 * 400 - water["base"]
    assert found.factor[0] == pytest.approx((0.5 * push + 2e4 * 100) / (water["x0"] - water["x10"]))
    assert found.direction[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)


def test_north_turns_what_dips_count_from():
    """With north along x, a dip direction of 90 degrees is along -y."""
    assert upward_normal(30, 90, (1, 0, 0)) == pytest.approx([0, -0.5, np.sqrt(0.75)], abs=1e-12)
    assert upward_normal(30, 90, NORTH) == pytest.approx([0.5, 0, np.sqrt(0.75)], abs=1e-12)
    assert trend_and_plunge(np.array([0.0, -np.sqrt(0.75), -0.5]), (1, 0, 0)) == pytest.approx((90, 30))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A block on rock with friction, shaken, with water in the joint and a section through the block."""
    folder = tmp_path_factory.mktemp("wedges")
    time = np.arange(100) * 0.01
    pulse = np.sin(2 * np.pi * 3.0 * time) * np.exp(-3 * time)
    np.savetxt(folder / "pulse.txt", pulse)
    raw = {
        "materials": {
            name: {"E": 30e9, "nu": 0.2, "rho": rho} for name, rho in (("concrete", 2400), ("rock", 2600))
        },
        "blocks": {
            "rock": {"material": "rock", "box": {"origin": [0, 0, -2], "size": [6, 8, 2], "element_size": 2}},
            "dam": {"material": "concrete", "box": {"origin": [0] * 3, "size": [6, 8, 4], "element_size": 2}},
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "base": {"between": ["rock", "dam"], "normal_stiffness": "20 GPa/m",
                     "shear_stiffness": "10 GPa/m", "friction": 0.7}
        },
        "loads": {"gravity": [0, 0, -9.81], "joint_water": [{"joints": ["base"], "level": 2.0}],
                  "force": [{"block": "dam", "at": [6, 4, 4], "force": [3e5, 1e5, 0]}]},
        "damping": {"rayleigh": {"frequencies": [5, 50], "ratio": 0.05}},
        "records": [{"name": "pulse", "unit": "m/s2", "dt": 0.01, "components": {
            axis: {"file": str(folder / "pulse.txt")} for axis in "xz"}}],
        "model": {"order": "full"},
        "transient": {"finest_step": 0.0025},
        "outputs": {"plots": False, "error_estimate": False, "stress": {
            "blocks": ["dam"], "sections": {"foot": {"blocks": ["dam"], "point": [0, 0, 1]}}}},
    }  # fmt: skip
    path = folder / "job.yaml"
    path.write_text(yaml.safe_dump(raw))
    return romdam.run(romdam.load_config(path), folder / "out").paths[0]


def slab_under(run, tmp_path, **thrust):
    raw = SLAB | {"thrust": thrust, "inertia": thrust.pop("inertia", False)}
    path = tmp_path / "w.yaml"
    path.write_text(yaml.safe_dump({"wedges": {"w": raw}}))
    return assess_wedges(path, run, tmp_path / "out")


def test_joints_press_on_the_wedge_with_what_the_dam_weighs(run, tmp_path):
    """At rest the base bears weight, water beneath and force; while shaken the inertia of the block too."""
    found = slab_under(run, tmp_path, joints=["base"], on="rock").dataset
    weight, slab = 2400 * 9.81 * 6 * 8 * 4, 2500 * 9.81 * 400
    push = -found.wedge_plane_normal_force.values[0, 0, 0]
    assert push == pytest.approx(slab + weight, rel=1e-6)
    driving = np.hypot(3e5, 1e5)
    assert float(found.wedge_driving_force[0, 0]) == pytest.approx(driving, rel=1e-6)
    assert found.wedge_slip_direction.values[0, 0] == pytest.approx(
        [3e5 / driving, 1e5 / driving, 0], abs=1e-6
    )
    assert float(found.wedge_factor_of_safety[0, 0]) == pytest.approx(
        (0.5 * (slab + weight) + 2e4 * 100) / driving, rel=1e-6
    )
    with romdam.open_result(run) as result:
        tangential = result.dataset.joint_shear_force.values[:, 0]
    assert found.wedge_driving_force.values[:, 0] == pytest.approx(np.hypot(*tangential.T), rel=1e-5)


def test_a_section_presses_as_the_joint_beneath_it_does(run, tmp_path):
    """1 m of the block is below the section; at rest that alone is the difference, without the water."""
    of_joint = slab_under(run, tmp_path, joints=["base"], on="rock").dataset
    of_section = slab_under(run, tmp_path, sections=["foot"]).dataset
    metre = 2400 * 9.81 * 6 * 8
    pushes = [-float(each.wedge_plane_normal_force[0, 0, 0]) for each in (of_joint, of_section)]
    assert pushes[0] - pushes[1] == pytest.approx(metre, rel=1e-6)
    drives = [float(each.wedge_driving_force[0, 0]) for each in (of_joint, of_section)]
    assert drives[0] == pytest.approx(drives[1], rel=1e-6)


def test_the_ground_shakes_the_wedge(run, tmp_path):
    found = slab_under(run, tmp_path, inertia=True).dataset
    with romdam.open_result(run) as result:
        ground = result.dataset.ground_acceleration.values
    mass = 2500 * 400.0
    assert found.wedge_driving_force.values[:, 0] == pytest.approx(
        mass * np.hypot(*ground[:, :2].T), rel=1e-9, abs=1.0
    )
    assert -found.wedge_plane_normal_force.values[:, 0, 0] == pytest.approx(
        mass * (9.81 + ground[:, 2]), rel=1e-9
    )


def test_the_command_prints_and_writes_its_table(run, tmp_path):
    path = tmp_path / "abutment.yaml"
    raw = SLAB | {"thrust": {"joints": ["base"], "on": "rock", "force": ["100 kN", 0, 0]}}
    path.write_text(
        yaml.safe_dump({"wedges": {"left": raw, "held": SLAB | {"inertia": False}}}, sort_keys=False)
    )
    code, out, err = call("wedges", path, run, "--out", tmp_path / "out")
    assert code == 0, err
    assert "left" in out and "base" in out and "held" in out
    rows = (tmp_path / "out" / "abutment-wedges.csv").read_text().splitlines()
    assert len(rows) == 3 and rows[2].split(",")[3:6] == ["held"] * 3
    with xr.open_dataset(tmp_path / "out" / "abutment-wedges.nc", engine="h5netcdf") as written:
        assert written.wedge_factor_of_safety.sizes == {"time": written.sizes["time"], "wedge": 2}
        assert np.isnan(written.wedge_factor_of_safety.sel(wedge="held")).all()


WRONG = {
    "open": ({"surfaces": {"top": SLAB["surfaces"]["top"]}}, "leave the wedge open"),
    "inside on a plane": ({"inside": [5.0, 5.0, 0.0]}, "inside: is on 'base'"),
    "beyond": (
        {"surfaces": SLAB["surfaces"] | {"far": {"dip": 0, "through": [0, 0, 9]}}},
        "'far' does not bound the wedge",
    ),
    "one name": (
        {"surfaces": SLAB["surfaces"] | {"base": {"dip": 45, "through": [0, 0, 3]}}},
        "give each its own",
    ),
    "a joint": ({"thrust": {"joints": ["foot"], "on": "rock"}}, r"no joint 'foot'; it has base"),
    "a block": ({"thrust": {"joints": ["base"], "on": "left"}}, r"not on 'left'"),
    "a section": ({"thrust": {"sections": ["top"]}}, r"no section 'top'; it has foot"),
    "joints alone": ({"thrust": {"joints": ["base"]}}, "belong together"),
    "a dip": ({"planes": {"base": {"dip": 95, "through": [0, 0, 0]}}}, r":\d+: wedges\.w\.planes\.base\.dip"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "told"), WRONG.values(), ids=WRONG)
def test_wrong_files_are_refused(change, told, run, tmp_path):
    path = tmp_path / "w.yaml"
    path.write_text(yaml.safe_dump({"wedges": {"w": SLAB | change}}))
    with pytest.raises(ConfigError, match=told):
        assess_wedges(path, run, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_joints_need_a_result(tmp_path):
    path = tmp_path / "w.yaml"
    path.write_text(yaml.safe_dump({"wedges": {"w": SLAB | {"thrust": {"joints": ["base"], "on": "rock"}}}}))
    with pytest.raises(ConfigError, match="press by forces of a result; name one, or give `force`"):
        assess_wedges(path)
    code, out, err = call("wedges", path)
    assert (code, out) == (2, "") and "Traceback" not in err


def test_the_example_of_the_manual_is_a_wedge():
    text = (Path(__file__).parents[2] / "docs" / "sliding.md").read_text()
    raw = yaml.safe_load("wedges:" + text.split("```text\nwedges:")[1].split("```")[0])
    raw["wedges"]["left"] |= {"thrust": {"force": [0, "30 MN", "-5 MN"]}, "inertia": False}
    config, wedge, geometry = only(raw["wedges"]["left"])
    found = slide(geometry, wedge, active(config, geometry)[None])
    assert geometry.volume > 1e3 and 0.1 < found.factor[0] < 100.0
