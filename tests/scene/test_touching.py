"""All bodies of a mesh as blocks, joints between all that touches, and names that stand for several."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from mortar_blocks import CONCRETE
from test_cli import call
from test_mesh_bodies import job, write_deck

import romdam
from romdam.config.sections.job import BoxConfig
from romdam.core.errors import ConfigError, MeshError
from romdam.geometry.boxes import box_block
from romdam.scene.found import touching_pairs

LAW = {"normal_stiffness": "20 GPa/m", "shear_stiffness": "10 GPa/m", "friction": 0.5}
FOOT = {"axis": "z", "at": 0}


def of_auto(folder, **changes):
    """The two bodies of one set as `all.1` and `all.2`, with the joint that is found between them."""
    deck = write_deck(folder / "two.inp", ("b", "a"))
    raw = job(folder, {"all": {"material": "c", "mesh": {"file": str(deck), "bodies": "auto"}}})
    return raw | {"joints": {"touching": dict(LAW)}, "supports": [{"block": "all.*", "face": FOOT}]} | changes


def of_names(folder, **changes):
    """The same, body by body."""
    deck = write_deck(folder / "two.inp", ("b", "a"))
    raw = job(
        folder,
        {f"all.{k}": {"material": "c", "mesh": {"file": str(deck), "body": k}} for k in (1, 2)},
    )
    return raw | {"joints": {"all.1-all.2": LAW | {"between": ["all.1", "all.2"]}}} | changes


def same(first, second, names=("opening", "normal_force", "slip")):
    for name in names:
        wanted = second[name].values
        assert np.abs(wanted).max() > 0.0
        assert first[name].values == pytest.approx(wanted, abs=1e-9 * np.abs(wanted).max()), name


def test_all_bodies_with_the_joints_that_are_found_are_the_same_as_named_ones(tmp_path):
    found, named = (romdam.run(make(tmp_path)).results[0].dataset.load() for make in (of_auto, of_names))
    assert float(np.abs(named.slip).max()) > 1e-8
    same(found, named)
    stated = json.loads(found.attrs["configuration"])
    assert stated["blocks"]["all"]["mesh"]["bodies"] == ["all.1", "all.2"]
    assert stated["joints"]["touching"]["pairs"] == {"all.1-all.2": ["all.1", "all.2"]}
    assert [support["block"] for support in stated["supports"]] == ["all.1", "all.2"]
    assert list(np.unique(found.gap_joint.values)) == ["all.1-all.2"]


def test_bodies_may_have_names(tmp_path):
    raw = of_auto(tmp_path)
    raw["blocks"]["all"]["mesh"]["bodies"] = ["left", "right"]
    raw["supports"] = [{"block": name, "face": FOOT} for name in ("left", "right")]
    job_of_names = romdam.load_config(raw)
    assert job_of_names.config.block_names == ("left", "right")
    assert list(job_of_names.config.every_joint) == ["left-right"]
    raw["blocks"]["all"]["mesh"]["bodies"] = ["left", "middle", "right"]
    with pytest.raises(
        MeshError, match=r"bodies: .*has 2 bodies in this block, and 3 are named: 1 \(x 0\.\."
    ):
        romdam.load_config(raw)


def test_check_lists_where_the_bodies_are(tmp_path):
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(of_auto(tmp_path)))
    code, out, err = call("check", tmp_path / "job.yaml")
    assert code == 0, err
    assert "block all.1: x 0..2, y 0..2, z 0..2 [m]" in out
    assert "block all.2: x 2..3, y 0..2, z 0..2 [m]" in out
    assert "all.1-all.2" in out


@pytest.mark.slow
def test_a_suite_varies_the_joints_that_are_found(tmp_path):
    """All by joints.touching, one by its name; the run of a value is that of a job with the value."""
    reduced = {"order": "reduced", "modes": "all"}
    wanted = []
    for value in (0.1, 0.3):
        alone = of_names(tmp_path, model=reduced)
        alone["joints"]["all.1-all.2"]["friction"] = value
        wanted.append(romdam.run(alone).results[0].dataset.peak_slip.max().item())
    for path in ("joints.touching.friction", "joints.all.1-all.2.friction", "joints.all.*.friction"):
        suite = {"parameters": {"mu": {"path": path, "values": [0.1, 0.3]}}}
        raw = of_auto(tmp_path, model=reduced, pipeline="suite", suite=suite)
        options = romdam.SuiteOptions(workers=1)
        summary = romdam.run_suite(raw, tmp_path / path.replace("*", "x"), options).summary
        assert summary.peak_slip.max(("record", "joint")).values.ravel() == pytest.approx(wanted, rel=1e-6)
    raw["suite"] = {"parameters": {"mu": {"path": "joints.touching.frictio", "values": [0.1]}}}
    with pytest.raises(ConfigError, match="did you mean 'friction'"):
        romdam.load_config(raw)


@pytest.mark.slow
def test_variants_of_a_comparison_change_the_joints_that_are_found(tmp_path):
    variants = {"stiff": {}, "soft": {"joints.touching.normal_stiffness": "2 GPa/m"}, "one": {
        "joints": {"j": LAW | {"between": ["all.1", "all.2"]}}}}  # fmt: skip
    raw = of_auto(tmp_path, pipeline="comparison", comparison={"variants": variants})
    compared = romdam.compare(raw, tmp_path / "out")
    assert not compared.failures
    of_one = of_auto(tmp_path)
    of_one["joints"]["touching"]["normal_stiffness"] = "2 GPa/m"
    wanted = romdam.run(of_one).results[0].dataset.peak_opening.max().item()
    peaks = compared.dataset.peak_opening.sel(variant="soft").max().item()
    assert peaks == pytest.approx(wanted, rel=1e-9)


def test_boxes_that_touch_get_joints_and_those_with_a_name_or_a_tie_keep_theirs(tmp_path):
    """Four boxes in a row and one apart: A-B has a name, B-C a tie; C and D do not match node to node."""
    boxes = {"A": (0, 1), "B": (1, 1), "C": (2, 1), "D": (3, 0.5), "E": (5, 1)}
    raw = job(
        tmp_path,
        {
            name: {"material": "c", "box": {"origin": [x, 0, 0], "size": [1, 2, 2], "element_size": size}}
            for name, (x, size) in boxes.items()
        },
    ) | {
        "supports": [{"block": "*", "face": FOOT}],
        "joints": {"mine": LAW | {"between": ["B", "A"]}, "touching": dict(LAW)},
        "ties": {"t": {"between": ["B", "C"]}},
    }
    prepared = romdam.load_config(raw)
    assert prepared.config.touching.pairs == {"C-D": ("C", "D")}
    checked = romdam.check(prepared)
    assert {name: each["area"] for name, each in checked.joints.items()} == {
        "C-D": pytest.approx(4.0), "mine": pytest.approx(4.0)
    }  # fmt: skip
    assert [support.block for support in prepared.config.supports] == list("ABCDE")


def test_blocks_that_meet_at_an_edge_only_or_stand_apart_do_not_touch(tmp_path):
    """Across the edge x = 1, y = 1; and 50 mm apart, which is less than a tenth of a facet."""
    for origin in ([1, 1, 0], [1.05, 0, 0]):
        raw = job(tmp_path, {
            name: {"material": "c", "box": {"origin": at, "size": [1, 1, 1], "element_size": 1}}
            for name, at in (("A", [0, 0, 0]), ("B", origin))
        }) | {"joints": {"touching": dict(LAW)}}  # fmt: skip
        with pytest.raises(ConfigError, match=r"joints.touching: blocks 'A' and 'B' do not touch"):
            romdam.load_config(raw)
    raw["joints"]["touching"]["tolerance"] = "0.06 m"
    assert list(romdam.load_config(raw).config.every_joint) == ["A-B"]


def test_curved_faces_that_are_meshed_otherwise_touch_within_their_sagittas():
    """Shells of 60 degrees inside and outside of a radius of 10 m, with elements of 15 and 10 degrees: their
    faces are up to 10 (1 - cos(7.5 deg)) = 86 mm apart, a clearance of 0.2 m is more than that."""

    def shell(name, inner, count):
        sizes = {
            "origin": (inner, 0.0, 0.0),
            "size": (1.0, 60.0, 2.0),
            "element_size": (1.0, 60.0 / count, 1.0),
        }
        box = box_block(name, BoxConfig.model_validate(sizes), CONCRETE, "")
        r, angle = box.points[:, 0], np.radians(box.points[:, 1])
        return replace(box, points=np.column_stack([r * np.cos(angle), r * np.sin(angle), box.points[:, 2]]))

    for outer, expected in ((10.0, [("A", "B")]), (10.2, [])):
        blocks = {"A": shell("A", 9.0, 4), "B": shell("B", outer, 6)}
        assert touching_pairs(blocks, 1e-3) == expected


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"supports": [{"block": "all.9", "face": FOOT}]},
         r"supports\[0\].block: no 'all.9' is defined; .*'all' has 2 bodies, 1 \(x 0..2, y 0..2, "),
        ({"supports": [{"block": "all", "face": FOOT}]},
         r"no 'all' is defined; .*all\.\* stands for all of them"),
        ({"supports": [{"block": "dam.*", "face": FOOT}]},
         r"supports\[0\].block: no block is like 'dam.\*'; blocks"),
        ({"supports": [{"block": "all.*", "face": "base"}]}, "block 'all.1' has no face 'base'"),
        ({"joints": {"touching": LAW | {"frictoin": 0.5}}},
         "joints.touching.frictoin is not a known key; did you"),
        ({"joints": {"j": LAW}}, "joints.j.between is missing"),
        ({"joints": {"j": LAW | {"pairs": {}}}}, "joints.j.pairs: is of joints.touching"),
        ({"joints": {"touching": LAW, "j": LAW | {"between": ["all.1", "all.2"]}}},
         r"joints.touching: every pair of blocks that touch \(1\) has a joint or a tie"),
        ({"loads": {"joint_water": [{"joints": ["all.1-all.3"], "level": "2 m"}]}},
         r"joint_water\[0\].joints: no 'all.1-all.3' is defined; defined are all.1-all.2"),
    ],
)  # fmt: skip
def test_names_that_are_not_there_are_refused(changes, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        romdam.check(of_auto(tmp_path, **changes))


def test_elements_of_another_order_are_another_body(tmp_path):
    """A bar of one hex8 and one hex20 that share the four corners of a face, in one set.

    The linear cube under the quadratic one: two blocks with a joint of 1 m2, or refused as one.
    """
    corners = [[x, y, z] for z in (0, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    edges = [
        (4, 5),
        (5, 6),
        (6, 7),
        (7, 4),
        (8, 9),
        (9, 10),
        (10, 11),
        (11, 8),
        (4, 8),
        (5, 9),
        (6, 10),
        (7, 11),
    ]
    points = [*corners, *(np.mean([corners[a], corners[b]], axis=0) for a, b in edges)]
    lines = ["*NODE", *(f"{k}, {x:g}, {y:g}, {z:g}" for k, (x, y, z) in enumerate(points, 1))]
    lines += [
        "*ELEMENT, TYPE=C3D8, ELSET=E",
        "1, 1, 2, 3, 4, 5, 6, 7, 8",
        "*ELEMENT, TYPE=C3D20, ELSET=E",
        "2, " + ", ".join(map(str, [*range(5, 13), *range(13, 20)])) + ",",
        ", ".join(map(str, range(20, 25))),
    ]
    (tmp_path / "mixed.inp").write_text("\n".join(lines) + "\n")
    mesh = {"file": str(tmp_path / "mixed.inp"), "group": "E"}
    raw = job(tmp_path, {"m": {"material": "c", "mesh": mesh}}) | {"joints": {}, "supports": [
        {"block": "m", "face": FOOT}]}  # fmt: skip
    with pytest.raises(
        MeshError, match=r"mixes elements in this block .*`mesh.bodies: auto` make a block of each"
    ):
        romdam.check(raw)
    mesh["bodies"] = "auto"
    raw |= {"joints": {"touching": dict(LAW)}, "supports": [{"block": "m.1", "face": FOOT}]}
    checked = romdam.check(raw)
    assert {name: block["element"] for name, block in checked.blocks.items()} == {
        "m.1": "hex8",
        "m.2": "hex20",
    }
    assert checked.joints["m.1-m.2"]["area"] == pytest.approx(1.0, rel=1e-12)
    raw |= {"joints": {}, "ties": {"t": {"between": ["m.1", "m.2"]}}}
    assert romdam.check(raw).ties["t"]["between"] == "m.1 - m.2"


def test_messages_on_what_is_found_name_the_line_that_it_is_found_by(tmp_path):
    raw = of_auto(tmp_path)
    raw["joints"]["touching"]["normal"] = [-1, 0, 0]
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(raw, sort_keys=False))
    lines = (tmp_path / "job.yaml").read_text().splitlines()
    code, _, err = call("check", tmp_path / "job.yaml")
    assert code == 2 and "joints.all.1-all.2.normal must point from block 'all.1' to 'all.2'" in err
    line = next(k for k, text in enumerate(lines, 1) if text.strip().startswith("normal:"))
    assert f"job.yaml:{line}: " in err
