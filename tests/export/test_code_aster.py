"""Decks of code_aster, which is not here: the mesh by romdam's reader, commands against their catalogue."""

import os
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from decks import boxes, built, columns, written

from romdam.config.sections.geometry.mesh_file import MeshFileConfig
from romdam.core.scene import Material
from romdam.export.code_aster import write_code_aster
from romdam.geometry.meshes.files import MeshFiles
from romdam.geometry.meshes.formats.aster import read_aster
from romdam.geometry.meshes.kinds import mixed_cells
from romdam.geometry.meshes.quality import sound_volume

FRICTION = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"} | {
    "shear_stiffness": "8 GPa/m", "friction": 0.5, "gap": "1 mm", "tension_stiffness": "1 GPa/m",
}  # fmt: skip
WET = {"level": "20 m", "faces": [{"block": "left", "face": "ymin"}], "model": "westergaard"}
WEIGHT = {"gravity": [0, 0, -9.81], "initial_state": "static"}

# Required and further keywords that decks use, after code_aster 17, code_aster/Cata/Commands/<command>.py:
# statut="o" and "f"; below a dot those of a keyword factor (FACT), with what its rules (UN_PARMI) want.
# Of factors that commands share ("*."), LIRE_MAILLAGE, ASSE_MATRICE, DEFI_LIST_REEL and DEFI_MATERIAU's
# ELAS and DIS_CONTACT, uses in public scripts and in code_aster's source were read, not the definitions.
CATALOGUE = {
    "DEBUT": ("", ""),
    "FIN": ("", ""),
    "LIRE_MAILLAGE": ("", "FORMAT UNITE"),
    "AFFE_MODELE": ("MAILLAGE", "AFFE"),
    "AFFE_MODELE.AFFE": ("PHENOMENE MODELISATION GROUP_MA", ""),
    "DEFI_MATERIAU": ("", "ELAS DIS_CONTACT"),
    "DEFI_MATERIAU.ELAS": ("E NU", "RHO AMOR_ALPHA AMOR_BETA"),
    "DEFI_MATERIAU.DIS_CONTACT": ("RIGI_NOR", "RIGI_TAN COULOMB JEU DIST_1"),
    "AFFE_MATERIAU": ("AFFE", "MAILLAGE"),
    "AFFE_MATERIAU.AFFE": ("GROUP_MA MATER", ""),
    "AFFE_CARA_ELEM": ("MODELE", "DISCRET"),
    "AFFE_CARA_ELEM.DISCRET": ("CARA GROUP_MA VALE", ""),
    "AFFE_CHAR_MECA": ("MODELE", "DDL_IMPO LIAISON_DDL FORCE_NODALE VECT_ASSE"),
    "AFFE_CHAR_MECA.DDL_IMPO": ("GROUP_NO", "DX DY DZ"),
    "AFFE_CHAR_MECA.LIAISON_DDL": ("GROUP_NO DDL COEF_MULT COEF_IMPO", ""),
    "AFFE_CHAR_MECA.FORCE_NODALE": ("GROUP_NO", "FX FY FZ"),
    "CALC_MATR_ELEM": ("OPTION MODELE", "CHAM_MATER CARA_ELEM CHARGE"),
    "NUME_DDL": ("MATR_RIGI", ""),
    "ASSE_MATRICE": ("MATR_ELEM NUME_DDL", ""),
    "CALC_MODES": ("MATR_RIGI MATR_MASS", "OPTION CALC_FREQ"),
    "CALC_MODES.CALC_FREQ": ("", "NMAX_FREQ"),
    "CALC_CHAR_SEISME": ("MATR_MASS DIRECTION MONO_APPUI", ""),
    "DEFI_FONCTION": ("NOM_PARA", "VALE ABSCISSE ORDONNEE PROL_DROITE"),
    "DEFI_LIST_REEL": ("DEBUT INTERVALLE", ""),
    "DEFI_LIST_REEL.INTERVALLE": ("JUSQU_A NOMBRE", ""),
    "DEFI_LIST_INST": ("DEFI_LIST", "METHODE ECHEC"),
    "DEFI_LIST_INST.DEFI_LIST": ("LIST_INST", ""),
    "DEFI_LIST_INST.ECHEC": ("", "EVENEMENT ACTION SUBD_METHODE SUBD_PAS SUBD_NIVEAU"),
    "STAT_NON_LINE": (
        "MODELE CHAM_MATER EXCIT INCREMENT",
        "CARA_ELEM COMPORTEMENT NEWTON CONVERGENCE ETAT_INIT",
    ),
    "DYNA_NON_LINE": (
        "MODELE CHAM_MATER SCHEMA_TEMPS INCREMENT",
        "CARA_ELEM EXCIT COMPORTEMENT NEWTON CONVERGENCE ETAT_INIT ARCHIVAGE",
    ),
    "*.EXCIT": ("CHARGE", "FONC_MULT"),
    "*.COMPORTEMENT": ("RELATION", "GROUP_MA"),
    "*.INCREMENT": ("LIST_INST", ""),
    "*.NEWTON": ("", "MATRICE REAC_ITER"),
    "*.CONVERGENCE": ("", "RESI_GLOB_RELA ITER_GLOB_MAXI"),
    "*.ETAT_INIT": ("", "EVOL_NOLI"),
    "*.ARCHIVAGE": ("", "LIST_INST"),
    "*.SCHEMA_TEMPS": ("SCHEMA FORMULATION", "ALPHA MODI_EQUI"),
    "CREA_TABLE": ("", "RESU"),
    "CREA_TABLE.RESU": ("RESULTAT NOM_CHAM", "NOM_CMP GROUP_NO TOUT_ORDRE"),
}
VALUES = {"K_T_D_N": 3, "A_T_D_N": 3, "M_T_N": 6, "A_T_N": 6, "M_T_D_N": 1}  # affe_cara_elem.py, of POI1


class Factor(dict):
    """_F(...)."""


class Stand:
    """Commands that check and record their keywords in place of code_aster's."""

    def __init__(self):
        self.calls = []

    def names(self):
        made = {name: self.command(name) for name in CATALOGUE if "." not in name}
        return made | {"_F": Factor}

    def command(self, name):
        def run(**given):
            self.check(name, given)
            self.calls.append((name, given))
            return SimpleNamespace(
                LIST_VARI_ACCES=lambda: {"FREQ": [1.5, 2.5]},
                EXTR_TABLE=lambda: {"INST": [0.0, 0.5], "DX": [1.0, 2.0], "DY": [3.0, 4.0], "DZ": [5.0, 6.0]},
            )

        return lambda **given: self.with_values(run(**given))

    def with_values(self, made):
        table = made.EXTR_TABLE()
        made.EXTR_TABLE = lambda: SimpleNamespace(values=lambda: table)
        return made

    def check(self, name, given):
        required, further = CATALOGUE.get(name) or CATALOGUE["*." + name.split(".")[1]]
        assert set(required.split()) <= set(given) <= {*required.split(), *further.split()}, name
        for keyword, value in given.items():
            for one in value if isinstance(value, tuple) else (value,):
                if isinstance(one, Factor):
                    self.check(f"{name.split('.')[0]}.{keyword}", one)

    def factors(self, command, keyword):
        """All factors of a keyword, of all calls of a command."""
        found = [given[keyword] for name, given in self.calls if name == command and keyword in given]
        return [one for value in found for one in (value if isinstance(value, tuple) else (value,))]


def ran(raw, folder, static=False):
    """The deck, what its script called, and the constants in it."""
    deck = built(raw, static=static)[1]
    written(write_code_aster(deck)[0], folder)
    stand, before = Stand(), os.getcwd()
    names = stand.names()
    os.chdir(folder)
    try:
        exec(compile((folder / "deck.comm").read_text(), "deck.comm", "exec"), names)
    finally:
        os.chdir(before)
    return deck, stand, names


def rich(other=5.0, **sections):
    return boxes(other=other, joints={"gap": FRICTION}, water=WET, loads=WEIGHT) | sections


def test_script_calls_what_the_catalogue_knows(tmp_path):
    _, stand, _ = ran(rich(), tmp_path, static=True)
    called = [name for name, _ in stand.calls]
    assert (called[0], called[-1]) == ("DEBUT", "FIN")
    assert called.index("CALC_MODES") < called.index("STAT_NON_LINE") < called.index("DYNA_NON_LINE")
    for card in stand.factors("AFFE_CARA_ELEM", "DISCRET"):
        assert np.size(card["VALE"]) == VALUES[card["CARA"]]
    relations = {own["RELATION"] for own in stand.factors("DYNA_NON_LINE", "COMPORTEMENT")}
    assert relations == {"ELAS", "DIS_CHOC"}


@pytest.mark.parametrize("other", [5.0, 4.0])
def test_groups_that_are_named_are_in_the_mesh(other, tmp_path):
    joint = FRICTION | {"discretization": "node_to_node" if other == 5.0 else "mortar"}
    _, stand, _ = ran(rich(other=other, joints={"gap": joint}), tmp_path)
    mesh = read_aster(tmp_path / "deck.mail", "job.yaml")
    calls = [given for _, given in stand.calls]
    assert set(_named(calls, "GROUP_MA")) == set(mesh.groups)
    assert set(_named(calls, "GROUP_NO")) == set(mesh.node_sets)


def _named(value, keyword):
    """Names of groups anywhere in the keywords."""
    for key, own in value.items() if isinstance(value, dict) else ((None, one) for one in value):
        if key == keyword:
            yield from (own,) if isinstance(own, str) else own
        elif isinstance(own, (dict, tuple, list)):
            yield from _named(own, keyword)


@pytest.mark.parametrize(
    "element", ["hex8", "hex20", "hex27", "tet4", "tet10", "wedge6", "wedge15", "pyramid5", "pyramid13"]
)
def test_mesh_is_read_again(element, tmp_path):
    deck = built(boxes(element, joints={}))[1]
    written(write_code_aster(deck)[0], tmp_path)
    volume = 0.0
    for k, solid in enumerate(deck.solids):
        config = MeshFileConfig(file="deck.mail", group=f"B{k + 1}")
        block = MeshFiles(tmp_path).block(solid.name, config, Material(1.0, 0.0, 1.0), "job.yaml")
        assert block.element == element
        assert np.allclose(block.points[block.cells], deck.points[solid.cells], rtol=0.0, atol=1e-11)
        volume += sound_volume(block, "job.yaml")
    assert volume == pytest.approx(5 * 5 * 20 + 5 * 10 * 20, rel=1e-12)
    assert max(map(len, (tmp_path / "deck.mail").read_text().splitlines())) <= 80


def test_mixed_blocks_are_written_kind_by_kind(tmp_path):
    deck = built(boxes("wedge6", joints={}))[1]
    left, right = deck.solids
    name, cells = mixed_cells({"wedge": left.cells})
    deck = replace(deck, solids=(replace(left, element=name, cells=cells), right))
    written(write_code_aster(deck)[0], tmp_path)
    config = MeshFileConfig(file="deck.mail", group="B1")
    block = MeshFiles(tmp_path).block("left", config, Material(1.0, 0.0, 1.0), "job.yaml")
    assert block.element == "wedge6"
    assert np.allclose(block.points[block.cells], deck.points[left.cells], rtol=0.0, atol=1e-11)


def test_supports_and_probes_are_the_deck_s(tmp_path):
    deck, _, names = ran(rich(), tmp_path)
    sets = read_aster(tmp_path / "deck.mail", "job.yaml").node_sets
    for axis, held in zip("XYZ", deck.fixed.T, strict=True):
        assert sorted(sets[f"FIX_{axis}"]) == np.flatnonzero(held).tolist()
    assert [int(names["PROBES"]["top"][1:]) - 1] == [deck.probes["top"]]


@pytest.mark.parametrize("other", [5.0, 4.0])
def test_relations_make_jumps_of_displacements(other, tmp_path):
    """Solved for the jumps, they are those of the gap operators for any displacement."""
    joint = FRICTION | {"discretization": "node_to_node" if other == 5.0 else "mortar"}
    deck, stand, names = ran(boxes(other=other, joints={"gap": joint}), tmp_path)
    moved = np.random.default_rng(1).normal(size=3 * len(deck.points))
    jumps = solved(stand, moved)
    expected = dict(enumerate(deck.jumps() @ moved, len(moved)))
    assert jumps == pytest.approx(expected, rel=1e-12)
    first = len(deck.points) + 1
    assert [name for name, _ in names["OPENINGS"]] == [f"P{first + k}" for k in range(len(deck.gaps))]


def test_relations_hold_ties(tmp_path):
    """Slave nodes of a mortar tie move with their master's as the deck says."""
    deck, stand, _ = ran(boxes(other=4.0, joints={}, ties={"t": {"between": ["left", "right"]}}), tmp_path)
    moved = np.random.default_rng(1).normal(size=3 * len(deck.points))
    slaves = np.flatnonzero(np.diff(deck.follows.indptr)).tolist()
    assert slaves
    followed = deck.follows @ moved
    assert solved(stand, moved) == pytest.approx({dof: followed[dof] for dof in slaves}, rel=1e-12)


def solved(stand, moved):
    """The first DOF of every relation, from the others."""
    found = {}
    for relation in stand.factors("AFFE_CHAR_MECA", "LIAISON_DDL"):
        named = zip(relation["GROUP_NO"], relation["DDL"], strict=True)
        first, *others = [3 * (int(group[1:]) - 1) + "XYZ".index(component[1]) for group, component in named]
        factor, *factors = relation["COEF_MULT"]
        found[first] = -(moved[others] @ factors) / factor
    return found


@pytest.mark.parametrize("friction", [True, False])
def test_law_of_a_gap_is_romdam_s(friction, tmp_path):
    """Force over the jump, of all elements and forces on the gap's point: K_n closed, K_nz beyond the gap."""
    joint = (
        FRICTION
        if friction
        else {k: FRICTION[k] for k in FRICTION if k not in ("friction", "shear_stiffness")}
    )
    deck, _, names = ran(boxes(joints={"gap": joint}), tmp_path)
    sets, law = read_aster(tmp_path / "deck.mail", "job.yaml"), deck.gaps.law
    points = {name: _points_of(sets, name) for name in (*names["GAPS"], *names["TENSION"])}
    held = {name: force for name, force, _, _ in names["FORCES"]}
    for jump in (-0.005, -0.0005, 0.002):
        force = {name: -held.get(name, 0.0) for name, _ in names["OPENINGS"]}
        for group, own in names["GAPS"].items():
            for point in points[group]:
                force[point] += own["RIGI_NOR"] * min(jump + own["JEU"] - own["DIST_1"], 0.0)
        for group, (stiffness, shear) in names["TENSION"].items():
            assert shear == 0.0
            for point in points[group]:
                force[point] += stiffness * jump
        opening = jump + law.gap
        expected = np.where(opening < 0.0, law.K_n, law.K_nz) * opening
        assert list(force.values()) == pytest.approx(expected, rel=1e-9)
    shear = sum(own.get("RIGI_TAN", 0.0) * len(points[group]) for group, own in names["GAPS"].items())
    assert shear == pytest.approx(law.K_s.sum() if friction else 0.0)
    limits = {own.get("COULOMB") for own in names["GAPS"].values()}
    assert limits == ({0.5 * law.K_n[0] / (law.K_n[0] - law.K_nz[0])} if friction else {None})
    assert ("NO_SLIP" in names["HELD"]) != friction


def test_an_elastic_joint_is_springs_along_three_axes(tmp_path):
    joint = {name: value for name, value in FRICTION.items() if name != "friction"}
    joint |= {"tension_stiffness": joint["normal_stiffness"], "gap": 0.0}
    deck, _, names = ran(boxes(joints={"gap": joint}), tmp_path)
    sets, law = read_aster(tmp_path / "deck.mail", "job.yaml"), deck.gaps.law
    springs = dict.fromkeys((name for name, _ in names["OPENINGS"]), 0.0)
    found = {point: kind for group, kind in names["TENSION"].items() for point in _points_of(sets, group)}
    assert [found[name] for name in springs] == pytest.approx(np.column_stack([law.K_nz, law.K_s]), rel=1e-12)
    assert all(own["RIGI_NOR"] == 0.0 and "COULOMB" not in own for own in names["GAPS"].values())
    assert "NO_SLIP" not in names["HELD"] and not any("Left out" in text for text in deck.stated)


def _points_of(mesh, group):
    """Names of the single-point groups that a group's one-node elements stand on."""
    nodes = {int(own[0]): name for name, own in mesh.node_sets.items() if re.fullmatch(r"P\d+", name)}
    cells = zip(mesh.cells, mesh.groups[group], strict=True)
    return [nodes[int(node)] for cell, members in cells for node in cell.nodes[members].ravel()]


def test_water_has_its_mass_and_its_damping(tmp_path):
    """All added mass, with the coupling of directions, and alpha of it; the solids' alpha is AMOR_BETA."""
    deck, stand, _ = ran(rich(), tmp_path)
    cards = stand.factors("AFFE_CARA_ELEM", "DISCRET")
    for cara, factor in (("M_T_N", 1.0), ("A_T_N", deck.alpha)):
        total = np.sum([card["VALE"] for card in cards if card["CARA"] == cara], axis=0) / 2.0  # open, closed
        mass = factor * deck.added_mass.sum(axis=0)
        assert total == pytest.approx(mass[np.tril_indices(3)], rel=1e-12, abs=1e-9)
    for own in stand.factors("DEFI_MATERIAU", "ELAS")[:2]:
        assert (own["AMOR_ALPHA"], own["AMOR_BETA"]) == (deck.beta, deck.alpha)


def test_loads_are_the_deck_s(tmp_path):
    deck, stand, _ = ran(rich(), tmp_path, static=True)
    forces = stand.factors("AFFE_CHAR_MECA", "FORCE_NODALE")
    on_deck = [own for own in forces if int(own["GROUP_NO"][1:]) <= len(deck.points)]
    total = np.sum([[own[c] for c in ("FX", "FY", "FZ")] for own in on_deck], axis=0)
    assert total == pytest.approx(deck.force.sum(axis=0), rel=1e-12, abs=1e-6)
    record = next(given for name, given in stand.calls if name == "DEFI_FONCTION" and "ABSCISSE" in given)
    assert record["ORDONNEE"] == deck.motion.acc[1].tolist()
    assert [given["DIRECTION"] for name, given in stand.calls if name == "CALC_CHAR_SEISME"] == [(0, 1, 0)]


def test_tables_are_those_of_the_other_decks(tmp_path):
    deck, _, _ = ran(boxes(joints={"gap": FRICTION}), tmp_path)
    table = columns(tmp_path / "fort.41")
    own = [f"opening:{k}" for k in range(len(deck.gaps))]
    assert list(table) == ["time", *own, *(f"displacement:top:{axis}" for axis in "xyz")]
    assert table["opening:0"].tolist() == [1.001, 2.001]
    assert table["displacement:top:z"].tolist() == [5.0, 6.0]
    assert columns(tmp_path / "fort.42")["frequency [Hz]"].tolist() == [1.5, 2.5]


def test_blocks_alone_need_no_discrete_elements(tmp_path):
    _, stand, _ = ran(boxes(joints={}), tmp_path)
    assert not {"AFFE_CARA_ELEM"} & {name for name, _ in stand.calls}


def test_what_was_never_run_is_said():
    files, stated = write_code_aster(built(boxes(joints={"gap": FRICTION}))[1])
    assert "never run" in stated[0]
    assert "never run" in files["deck.comm"].partition("DEBUT()")[0]
    light = boxes(joints={})
    light["blocks"]["left"]["mass"] = False
    assert "massless" in write_code_aster(built(light)[1])[1][1]
