"""Commands tell of one physical model the same, however it is written: frame, order, units, kind of mesh.

`reference/same_models.py` writes two blocks on rock in these ways. What equilibrium by hand gives of them is
compared too: weight, thrust and uplift do not depend on elements or joints.
"""

import html
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_cli import call

sys.path.insert(0, str(Path(__file__).parent / "reference"))

from same_models import STEP, in_us_units, reordered, shaking, turn, turned, two_blocks

import romdam
from romdam.export import codes
from romdam.pipelines import export
from romdam.pipelines.error.certify import certify
from romdam.pipelines.linear import linear
from romdam.pipelines.modes import ModesOptions, modes
from romdam.pipelines.stability import assess_stability
from romdam.pipelines.wedges import assess_wedges
from romdam.visual import mode_views

G, WATER, CONCRETE = 9.81, 9810.0, 2400.0
WEIGHT = {"base_left": CONCRETE * G * 4 * 6 * 8, "base_right": CONCRETE * G * 2 * 6 * 6}  # [N]
UPLIFT = {name: WATER * wide * 6 * (5.5 + 0.5) / 2 for name, wide in (("base_left", 4), ("base_right", 2))}
THRUST = WATER * 6 * 5.5**2 / 2
FRICTION = 0.7  # after the earthquake
JOINTS = ["between", "base_left", "base_right"]
KINDS = ["hex8", "hex8 mortar", "hex8 spacing", "hex20", "hex20 spacing", "tet10 mortar", "tet10 spacing"]
WAYS = ["as it is", "in another order", "in US units", "turned by 37 degrees"]
WEDGE = {
    "inside": [2.0, 3.0, -1.0],
    "density": 2600.0,
    "planes": {"A": {"dip": 20.0, "dip_direction": 10.0, "through": [3.0, 3.0, -6.0], "friction": 0.9,
                     "cohesion": 1e4, "water": {"level": -1.0}}},
    "surfaces": {
        "top": {"dip": 0.0, "through": [0.0, 0.0, 0.0]},
        "front": {"dip": 90.0, "through": [0.0, 0.0, 0.0]},
        "back": {"dip": 90.0, "through": [0.0, 6.0, 0.0]},
        "left": {"dip": 90.0, "dip_direction": 90.0, "through": [0.0, 0.0, 0.0]},
        "right": {"dip": 90.0, "dip_direction": 90.0, "through": [6.0, 0.0, 0.0]},
    },
    "thrust": {"joints": ["base_left", "base_right"], "on": "rock"},
}  # fmt: skip


def written(kind, way, folder):
    """The job's file, and the angle by which it is turned."""
    element, _, discretization = kind.partition(" ")
    raw, degrees = two_blocks(element, discretization), 0.0
    raw["outputs"]["nodes"] = {"top": {"block": "left", "at": [4.0, 0.0, 8.0]}}
    stress = {"blocks": ["left"], "faces": [{"block": "left", "face": "ymin"}], "ring": {"edges": 0.5}}
    section = {"point": [3.0, 3.0, 0.5], "blocks": ["left", "right", "rock"], "normal": [0.0, 0.0, 1.0]}
    raw["outputs"]["stress"] = stress | {"sections": {"foot": section}}
    if way == "in another order":
        raw = reordered(raw)
    elif way == "in US units":
        raw = in_us_units(raw)
        raw["outputs"]["stress"]["ring"] = {"edges": f"{0.5 / 0.3048!r} ft"}
        section["point"] = [f"{x / 0.3048!r} ft" for x in section["point"]]
        raw["outputs"]["stress"]["sections"] = {"foot": section}
    elif way == "turned by 37 degrees":
        degrees = 37.0
        raw = turned(raw, degrees, folder / "meshes")
        raw["outputs"]["stress"]["sections"]["foot"]["point"] = (turn(degrees) @ section["point"]).tolist()
    folder.mkdir(parents=True, exist_ok=True)
    for axis, row in zip("xyz", turn(degrees) @ shaking(), strict=True):
        np.savetxt(folder / f"{axis}.txt", row)
    np.savetxt(folder / "up.txt", shaking()[1])
    record = {"name": "quake", "dt": STEP, "unit": "m/s2"}
    record["components"] = {axis: {"file": f"{axis}.txt"} for axis in "xyz"}
    changes = {f"joints.{name}.friction": FRICTION for name in WEIGHT}
    raw |= {"records": [record], "post_earthquake": {"changes": changes, "required_factor": 1.5}}
    (folder / "job.yaml").write_text(yaml.safe_dump(raw, sort_keys=False))
    # spectra of components are independent of each other, so that only a vertical record stays the same
    raw["records"] = [record | {"components": {"z": {"file": "up.txt"}}}]
    (folder / "upright.yaml").write_text(yaml.safe_dump(raw, sort_keys=False))
    return folder / "job.yaml", degrees


def wedge_file(folder, R):
    raw = yaml.safe_load(yaml.safe_dump(WEDGE))
    for side in (*raw["planes"].values(), *raw["surfaces"].values()):
        side["through"] = (R @ side["through"]).tolist()
    raw["inside"] = (R @ raw["inside"]).tolist()
    path = folder / "wedge.yaml"
    path.write_text(yaml.safe_dump({"north": (R @ [0.0, 1.0, 0.0]).tolist(), "wedges": {"w": raw}}))
    return path


def sides(dataset):
    """1 where block J is above or to the right, else -1."""
    upper = {"between": "right", "base_left": "left", "base_right": "right"}
    return np.array(
        [1.0 if str(dataset.joint_blocks.sel(joint=n).values[1]) == upper[n] else -1.0 for n in JOINTS]
    )


def stability_of(job, result):
    assessed = assess_stability(job, [result])
    found = {joint.joint: joint for joint in assessed.joints}
    both = next(joint for name, joint in found.items() if " + " in name)
    values = {}
    for name, joint in (
        ("base_left", found["base_left"]),
        ("base_right", found["base_right"]),
        ("both", both),
    ):
        for key in (
            "factor",
            "shear",
            "compression",
            "water",
            "resultant",
            "toe_pressure",
            "cracked_length",
            "slip",
        ):
            values[f"stability: {key} of {name}"] = np.array([getattr(joint, key)])
    for name, weight in WEIGHT.items():
        assert found[name].compression == pytest.approx(weight - UPLIFT[name], rel=1e-6), "by hand"
        assert found[name].water == pytest.approx(UPLIFT[name], rel=1e-6), "by hand"
    assert both.shear == pytest.approx(THRUST, rel=5e-4), "by hand"  # a level within an element
    N = sum(WEIGHT.values()) - sum(UPLIFT.values())
    assert both.factor == pytest.approx(FRICTION * N / THRUST, rel=5e-4), "by hand"
    (dam,) = [row for row in assessed.forces if row[1:3] == ("whole dam", "loads")]
    assert float(dam[5]) == pytest.approx(-1e-6 * sum(WEIGHT.values()), rel=1e-5), "by hand"
    assert float(dam[-1]) <= 1e-6
    return values


def run_of(job, folder, R):
    (path,) = romdam.run(job, folder / "run").paths
    with romdam.open_result(path) as opened:
        dataset = opened.dataset.load()
    section = dataset.sel(section="foot")
    rest = (dataset.joint_force.sel(joint=JOINTS).values[0] @ R) * sides(dataset)[:, None]
    values = {
        "run: openings": dataset.peak_opening.sel(joint=JOINTS).values,
        "run: slips": dataset.peak_slip.sel(joint=JOINTS).values,
        "run: factors": np.nanmin(dataset.sliding_safety_factor.sel(joint=JOINTS[1:]).values, axis=0),
        "run: joint forces": rest,
        "run: stress": dataset.face_principal_stress.values,
        "run: section": section.section_force.values @ section.section_axes.values @ R,
    }
    bases = dict(zip(JOINTS, rest, strict=True))
    total = bases["base_left"] + bases["base_right"]
    assert total[2] == pytest.approx(sum(WEIGHT.values()), rel=1e-6), "by hand, with the uplift"
    assert -total[1] == pytest.approx(THRUST, rel=5e-4), "by hand"
    # the section at 0.5 m, through all blocks: what stands above it
    foot = values["run: section"][0]
    above = sum(WEIGHT.values()) - CONCRETE * G * 6 * 6 * 0.5
    assert -foot[2] == pytest.approx(above, rel=1e-6), "by hand"
    assert foot[1] == pytest.approx(THRUST * (5.0 / 5.5) ** 2, rel=0.02), "by hand"
    # moments of joints about the middle of each monolith are those of the balance of forces
    for name, touching in (("left", ("between", "base_left")), ("right", ("between", "base_right"))):
        body, total = dataset.sel(body=name), np.zeros(3)
        for joint in (dataset.sel(joint=each).isel(time=0) for each in touching):
            sign = 1.0 if str(joint.joint_blocks.values[1]) == name else -1.0
            arm = joint.joint_middle.values - body.body_middle.values
            total += sign * (joint.joint_moment.values + np.cross(arm, joint.joint_force.values))
        held = body.joints_at_rest.values[3:]
        assert total == pytest.approx(held, abs=1e-6 * np.abs(body.joints_at_rest.values).max()), name
    wedges = assess_wedges(wedge_file(folder, R), path).dataset
    values["wedges: factor"] = wedges.wedge_factor_of_safety.values
    values["wedges: slip"] = wedges.wedge_displacement.values @ R
    values["wedges: overturning"] = wedges.wedge_overturning_factor.values
    values["wedges: turning"] = wedges.wedge_turning_factor.values
    values["wedges: direction"] = wedges.wedge_slip_direction.values @ R
    # the dam's thrust on a plane of 20 degrees, with its own weight and water, by hand at rest
    error = certify(path).statement.errors["opening"]
    values["certify: errors"] = np.array([error.l2, error.peak])
    return path, values


def modes_of(job, folder, R):
    values = {}
    for joints in ("tied", "bonded"):
        found = modes(job, folder / "modes", ModesOptions(joints=joints, count=6)).dataset
        values[f"modes: frequencies, {joints}"] = found.frequency.values[:6]
        values[f"modes: damping, {joints}"] = found.damping_ratio.values[:6]
        values[f"modes: participation, {joints}"] = np.abs(found.participation_factor.values[:6] @ R)
        mass = (WEIGHT["base_left"] + WEIGHT["base_right"]) / G
        assert found.total_mass.values == pytest.approx([mass] * 3, rel=1e-6), "by hand"
    return values


def linear_of(folder):
    (stage,) = linear(romdam.load_config(folder / "upright.yaml"), folder / "linear").stages.values()
    spectrum = stage.spectrum
    return {
        "linear: frequencies": spectrum.frequency.values,
        "linear: displacement": spectrum.peak_displacement.sel(component="z").values,
        "linear: stress": np.array([float(spectrum.max_principal_stress.max())]),
        "linear: tension": spectrum.max_joint_tension.sel(joint=JOINTS).values,
        "linear: history": stage.history.face_principal_stress.values,
    }


def exported(job, folder, R, monkeypatch):
    decks = {}

    def kept(name):
        write = codes.CODES[name]

        def writing(deck):
            decks[name] = deck
            return write(deck)

        return writing

    monkeypatch.setattr(export, "CODES", {name: kept(name) for name in ("code_aster", "abaqus")})
    values = {}
    for name in export.CODES:
        export.export_deck(job, folder / name, export.ExportOptions(name))
        deck = decks[name]
        force = deck.force.sum(axis=0) @ R
        # the water in a joint pushes both sides, and leaves nothing
        assert -force[2] == pytest.approx(sum(WEIGHT.values()), rel=1e-9), "by hand"
        assert force[1] == pytest.approx(THRUST, rel=5e-4), "by hand"
        assert deck.mass == pytest.approx((WEIGHT["base_left"] + WEIGHT["base_right"]) / G, rel=1e-9), (
            "by hand"
        )
        stiff = [deck.gaps.law.K_n[np.array(deck.gaps.joint) == joint].sum() for joint in JOINTS]
        assert stiff == pytest.approx([20e9 * area for area in (36.0, 24.0, 12.0)], rel=1e-9), "by hand"
        values |= {f"export: {name}, motion": R.T @ deck.motion.acc, f"export: {name}, force": force}
    return values


def all_of(kind, way, folder, monkeypatch):
    """Numbers of every command, of one way to write the model; vectors in the frame that is not turned."""
    path, degrees = written(kind, way, folder)
    job, R = romdam.load_config(path), turn(degrees)
    result, values = run_of(job, folder, R)
    values |= stability_of(job, result) | modes_of(job, folder, R) | linear_of(folder)
    values |= exported(job, folder, R, monkeypatch)
    code, _, err = call("report", result)
    assert code == 0, err
    page = html.unescape(result.with_name("quake-report.html").read_text(encoding="utf-8"))
    shown = re.search(r"largest opening</[^>]*>\s*<[^>]*>([^<]*)<", page) or re.search(r"([\d.]+ µm)", page)
    values["report: opening"] = np.array([float(re.search(r"[\d.]+", shown[1])[0])])
    return values


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_commands_tell_the_same_of_one_model(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(mode_views, "draw_modes", lambda scene, dataset, path: path)
    known = all_of(kind, WAYS[0], tmp_path / "0", monkeypatch)
    assert len(known) > 40
    for number, way in enumerate(WAYS[1:], start=1):
        found = all_of(kind, way, tmp_path / str(number), monkeypatch)
        assert found.keys() == known.keys()
        for name, values in known.items():
            there = np.isfinite(values)
            assert np.array_equal(np.isfinite(found[name]), there), f"{way}: {name}"
            size = np.abs(values[there]).max(initial=0.0)
            apart = np.abs(found[name][there] - values[there]).max(initial=0.0)
            assert apart <= 1e-6 * size + 1e-12, f"{way}: {name}: {apart} of {size}"
