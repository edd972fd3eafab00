"""The neutral description against romdam's own operators, totals and closed forms."""

import csv
import io
import math
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from decks import boxes, built

from romdam.config.sections.job import DampingConfig
from romdam.core.errors import ConfigError
from romdam.export.abaqus import write_abaqus
from romdam.export.build import build_deck
from romdam.export.calculix import write_calculix
from romdam.export.deck import Deck
from romdam.export.opensees import write_opensees
from romdam.fem.gaps import gap_operators

WATER = [{"block": "left", "face": "ymin"}]


def test_totals_are_those_of_volume_weight_and_pressure():
    loads = {"gravity": [0, 0, -9.81], "pressure": [{"block": "left", "face": "ymin", "value": "1 kPa"}]}
    deck = built(boxes(loads=loads))[1]
    mass = 2440.0 * (5 * 5 * 20 + 5 * 10 * 20)
    assert deck.mass == pytest.approx(mass, rel=1e-12)
    assert deck.force.sum(axis=0) == pytest.approx([0.0, 1e3 * 5 * 20, -9.81 * mass], rel=1e-12, abs=1e-6)
    assert deck.fixed.sum() == 3 * (4 + 6)
    assert deck.gaps.law.K_n.sum() == pytest.approx(16e9 * (5 * 20 - 5 * 2.5))  # without what the feet hold


@pytest.mark.parametrize("element", ["hex8", "hex20"])
@pytest.mark.parametrize("other", [5.0, 4.0])
@pytest.mark.parametrize("spacing", [None, 10.0])
def test_jumps_are_those_of_the_gap_operators(element, other, spacing):
    """Node to node, by mortar, and as means of a spacing: any displacement gives the same jumps."""
    joint = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "spacing": spacing}
    joint["discretization"] = "node_to_node" if other == 5.0 else "mortar"
    if element == "hex20" and other == 5.0:
        joint["gaps"] = "corners"
    scene, deck = built(boxes(element, other, joints={"gap": joint}))
    moved = np.random.default_rng(1).normal(size=(len(deck.points), 3))
    first = len(scene.blocks["left"].points)
    own = {"left": moved[:first], "right": moved[first : first + len(scene.blocks["right"].points)]}
    jumps = sum(operator @ own[name].ravel() for name, operator in gap_operators(scene, 3).items())
    assert deck.jumps() @ moved.ravel() == pytest.approx(jumps, abs=1e-12)
    assert (deck.follows.nnz > 0) == (other == 4.0 or element == "hex20" or spacing is not None)
    assert ("joints.gap.spacing" in deck.averaged) == (spacing is not None)
    if spacing is not None:
        assert 2 <= len(deck.gaps) < 8
    assert deck.meshed.sum() == sum(len(block.points) for block in scene.blocks.values())


def test_tied_blocks_share_points():
    tied = built(boxes(joints={}, ties={"t": {"between": ["left", "right"]}}))[1]
    apart = built(boxes())[1]
    assert len(apart.points) - len(tied.points) == 10  # nodes of the common face
    assert tied.mass == apart.mass


def test_mortar_tie_carries_a_linear_field():
    deck = built(boxes(other=4.0, joints={}, ties={"t": {"between": ["left", "right"]}}))[1]
    follows = np.flatnonzero(np.diff(deck.follows.indptr))
    field = np.outer(deck.points[:, 2], [1.0, 2.0, 0.5]).ravel()  # zero on the ground
    assert len(follows) == 3 * 10  # of the finer face, above its foot
    assert (deck.follows @ field)[follows] == pytest.approx(field[follows], abs=1e-9)


def test_added_mass_is_westergaards():
    """7/12 rho H^2 per width, normal to a vertical face, nothing across."""
    deck = built(boxes(water={"level": "20 m", "faces": WATER, "model": "westergaard"}))[1]
    total = deck.added_mass.sum(axis=0)
    assert total[1, 1] == pytest.approx(7.0 / 12.0 * 1000.0 * 20.0**2 * 5.0, rel=0.02)
    assert np.abs(total - np.diag([0.0, total[1, 1], 0.0])).max() < 1e-9
    assert sum(mass for _, mass, _ in deck.wet()) == pytest.approx(total[1, 1])


def test_joint_water_is_a_force_on_both_sides():
    joint_water = [{"joints": ["gap"], "level": "20 m"}]
    deck = built(boxes(loads={"joint_water": joint_water}))[1]
    right = deck.points[deck.solids[1].cells].min(axis=(0, 1))
    assert right[1] == 0.0
    push = np.zeros(len(deck.points), dtype=bool)
    push[deck.solids[1].cells] = True
    gaps_hold = 9810.0 * 5.0 * (20.0**2 / 2.0 - 20.0 * 2.5 + 2.5**2 / 2.0)  # above half a foot's element
    assert deck.force.sum(axis=0) == pytest.approx(0.0, abs=1e-6)
    assert deck.force[push, 1].sum() == pytest.approx(gaps_hold, rel=0.02)


def test_rigid_gaps_and_laws_are_stated():
    """Rigid gaps have E A / 10 mm, of 87.5 m2 without what the feet hold."""
    joint = {"between": ["left", "right"], "normal_stiffness": "rigid"}
    deck = built(boxes(joints={"gap": joint}))[1]
    assert "8 rigid gaps" in deck.stated[0] and "10 mm" in deck.stated[0]
    assert deck.gaps.law.K_n.sum() == pytest.approx(30e9 * 87.5 / 0.01)
    bonded = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "tensile_strength": "1 MPa"}
    bonded |= {"cohesion": "1 MPa", "shear_stiffness": "8 GPa/m"}
    one_way = bonded | {"tensile_strength": "0 MPa", "cohesion": "0 MPa", "friction": [0.5, 0.2]}
    deck = built(boxes(joints={"gap": one_way}))[1]
    assert "smaller" in deck.stated[0] and (deck.gaps.friction == 0.2).all()
    assert "cohesion, tensile_strength" in built(boxes(joints={"gap": bonded}))[1].stated[0]


def test_the_order_of_static_loads_is_stated_where_friction_makes_it_count():
    loads = {"gravity": [0, 0, -9.7], "pressure": [{"block": "left", "face": "ymin", "value": "1 kPa"}]}
    rough = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "shear_stiffness": "8 GPa/m"}
    rough |= {"friction": 0.5}
    job = boxes(loads=loads, joints={"gap": rough})
    (said,) = built(job, static=True)[1].stated
    assert "romdam applies weight, then forces (loads.order)" in said
    assert not built(job)[1].stated
    assert not built(boxes(loads=loads), static=True)[1].stated
    assert not built(boxes(loads={"gravity": [0, 0, -9.7]}, joints={"gap": rough}), static=True)[1].stated


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"damping": {"modal": "5 %"}}, "damping.modal"),
        (
            {"water": {"level": "20 m", "faces": WATER, "model": "incompressible", "length": "40 m"}},
            "westergaard",
        ),
    ],
)
def test_what_no_mass_or_force_stands_for_is_refused(sections, message):
    with pytest.raises(ConfigError, match=message):
        built(boxes(**sections))


def test_a_block_of_matrices_is_refused():
    scene, deck = built(boxes())[:2]
    blocks = {name: replace(block, matrices=object()) for name, block in scene.blocks.items()}
    with pytest.raises(ConfigError, match="matrices is not written for other codes; mesh the block"):
        build_deck(replace(scene, blocks=blocks), DampingConfig(), deck.motion, title="", static=False)


def test_opensees_refuses_points_that_follow_several():
    mortar = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "discretization": "mortar"}
    with pytest.raises(ConfigError, match=r"several nodes.*calculix"):
        write_opensees(built(boxes(other=4.0, joints={"gap": mortar}))[1])
    spaced = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "spacing": "10 m"}
    with pytest.raises(ConfigError, match=r"joints\.gap\.spacing has gaps that are means.*leave it out, or"):
        write_opensees(built(boxes(joints={"gap": spaced}))[1])
    with pytest.raises(ConfigError, match=r"ties\.t is by mortar"):
        tie = {"between": ["left", "right"]}
        write_opensees(built(boxes(other=4.0, joints={}, ties={"t": tie}))[1])
    with pytest.raises(ConfigError, match=r"blocks\.left: element hex27"):
        write_opensees(built(boxes("hex27"))[1])


class _Stiff:
    """OpenSees as far as `advance` of a deck sees it: Newton's method fails on steps above a size."""

    def __init__(self, largest):
        self.largest, self.method, self.load, self.time, self.share = largest, "Newton", 0.0, 0.0, 0.0

    def algorithm(self, method):
        self.method = method

    def integrator(self, kind, share):
        assert kind == "LoadControl"
        self.share = share

    def analyze(self, count, dt=0.0):
        assert count == 1
        step = dt or self.share
        if step > self.largest.get(self.method, 0.0):
            return -3
        self.load, self.time = self.load + (0.0 if dt else step), self.time + dt
        return 0

    def getTime(self):
        return self.time or self.load


@pytest.mark.parametrize("largest", [{"Newton": 1.0}, {"KrylovNewton": 1.0}, {"Newton": 0.02}])
def test_steps_of_an_opensees_deck_have_the_same_fallbacks_in_load_and_in_time(largest):
    script = write_opensees(built(boxes())[1])[0]["deck.py"]
    functions = script[script.index("def advance") : script.index("def opening")]
    ops = _Stiff(largest)
    names = {"ops": ops, "sys": sys}
    exec(functions, names)
    for _ in range(10):
        names["advance"](names["add_load"], 0.1, "{:g}")
    names["advance"](names["add_time"], 0.3, "{:g}")
    assert (ops.load, ops.time) == (pytest.approx(1.0), pytest.approx(0.3))


def test_an_opensees_deck_says_not_found_where_no_step_converges():
    script = write_opensees(built(boxes())[1])[0]["deck.py"]
    functions = script[script.index("def advance") : script.index("def opening")]
    names = {"ops": _Stiff({"Newton": 1e-9}), "sys": sys}
    exec(functions, names)
    with pytest.raises(SystemExit, match="equilibrium under 0 of the static loads was not found"):
        names["advance"](names["add_load"], 0.1, "equilibrium under {:.4g} of the static loads was not found")


ELASTIC = {
    "between": ["left", "right"],
    "normal_stiffness": "16 GPa/m",
    "tension_stiffness": "16 GPa/m",
    "shear_stiffness": "8 GPa/m",
}


class _Springs:
    """OpenSees as far as `add_gap` sees it: stiffness of uniaxial materials, and springs by direction."""

    def __init__(self):
        self.stiffness, self.found = {}, {1: 0.0, 2: 0.0, 3: 0.0}

    def uniaxialMaterial(self, kind, tag, *values):
        # the secant of the multilinear one over both signs, without a gap
        secant = kind != "Elastic" and (values[7] - values[5]) / (values[3] - values[1])
        self.stiffness[tag] = secant or values[0]

    def element(self, kind, tag, I, J, *words):
        assert kind == "zeroLength"
        materials = words[words.index("-mat") + 1 : words.index("-dir")]
        directions = words[words.index("-dir") + 1 : words.index("-orient")]
        for material, direction in zip(materials, directions, strict=True):
            self.found[direction] += self.stiffness[material]


def test_springs_of_an_elastic_joint_in_opensees():
    deck = built(boxes(joints={"gap": ELASTIC}))[1]
    files, stated = write_opensees(deck)
    script, ops = files["deck.py"], _Springs()
    names = {"ops": ops, "math": math, "LENGTH": 1e6}
    names["xyz"] = lambda row, what: [float(row[what + axis]) for axis in "xyz"]
    exec(script[script.index("def add_gap") : script.index("def loads")], names)
    for k, row in enumerate(csv.DictReader(io.StringIO(files["gaps.csv"]))):
        names["add_gap"](row, 1000 + k, 1 + 2 * k, 1 + 2 * k)
    law = deck.gaps.law
    assert ops.found == pytest.approx({1: law.K_n.sum(), 2: law.K_s.sum(), 3: law.K_s.sum()}, rel=1e-12)
    assert not any("Left out" in text for text in stated)


@pytest.mark.parametrize("write", [write_calculix, write_abaqus])
def test_springs_of_an_elastic_joint_in_keywords(write):
    deck = built(boxes(joints={"gap": ELASTIC}))[1]
    files, stated = write(deck)
    lines, along = files["gaps.inp"].splitlines(), {"2": 0.0, "3": 0.0}
    for k, line in enumerate(lines):
        if line.startswith("*SPRING, ELSET=S"):  # the group stands above, from its *ELEMENT on
            first = max(i for i in range(k) if lines[i].startswith("*ELEMENT"))
            along[lines[k + 1]] += (k - first - 1) * float(lines[k + 2])
    assert along == pytest.approx(dict.fromkeys("23", deck.gaps.law.K_s.sum()), rel=1e-9)
    assert not any("Left out" in text or "no limit" in text for text in stated)


def test_added_mass_is_that_of_three_masses_along_their_axes():
    """Of any inclined face: the sum of m e e^T over the directions of a point."""
    root = np.array([[3.0, 0.4, -1.0], [0.7, 2.0, 0.5], [1.1, -0.6, 5.0]])
    added = np.stack([np.zeros((3, 3)), root @ root.T])
    wet = list(Deck.wet(SimpleNamespace(added_mass=added)))
    assert [point for point, _, _ in wet] == [1, 1, 1]
    total = sum(mass * np.outer(axis, axis) for _, mass, axis in wet)
    np.testing.assert_allclose(total, added[1], rtol=1e-12)
