"""The table of approximations: whatever a registry lists has a row, and what a row names exists."""

import ast
import importlib
import inspect
import typing
from functools import cache
from pathlib import Path

import pytest

import romdam
from romdam.config import parse_config
from romdam.contact import step
from romdam.contact.laws import LAWS
from romdam.core.integrators import INTEGRATORS
from romdam.effects import scene_effects
from romdam.error.approximations import APPROXIMATIONS, Stated, not_included
from romdam.error.statement import Kind
from romdam.geometry.elements import ELEMENTS
from romdam.records.processing.correction import STEPS
from romdam.reduction.synthesis import REDUCTORS

PACKAGE, TESTS = Path(romdam.__file__).parent, Path(__file__).parents[1]
ONE_FILE_EACH = ("contact/solvers", "records/processing", "reduction/methods", "timestepping/integrators")
NO_NUMERICS = {  # shared by what the folder holds
    "contact.solvers.state", "reduction.methods.attachment_modes", "reduction.methods.merged_part",
    "timestepping.integrators.registry",
}  # fmt: skip
STATEMENTS = {*typing.get_args(Kind), "steps"}


def entry(one):
    return f"{one.__module__}:{one.__name__}".removeprefix("romdam.")


def effects():
    """What `scene_effects` puts into its list."""
    lists = [node for node in ast.walk(ast.parse(inspect.getsource(scene_effects))) if type(node) is ast.List]
    return [getattr(scene_effects, call.func.id) for call in max(lists, key=lambda one: len(one.elts)).elts]


def registered():
    """Every entry of every registry, and every module of folders with one file for each method."""
    yield from map(entry, (*effects(), *LAWS, *map(type, REDUCTORS), *step._SOLVERS))
    yield from (one.source.removeprefix("romdam.") for one in INTEGRATORS.values())
    yield from (f"geometry.elements:{name}" for name in ELEMENTS)
    yield from (f"records.processing.correction:{step.__name__}" for step in STEPS)
    yield from (f"error.statement:{kind}" for kind in typing.get_args(Kind))
    for folder in ONE_FILE_EACH:
        modules = {f"{folder}/{path.stem}".replace("/", ".") for path in (PACKAGE / folder).glob("[!_]*.py")}
        yield from modules - NO_NUMERICS


def without_row(entries):
    named = {place for row in APPROXIMATIONS for place in row.where}
    named |= {place.partition(":")[0] for place in named}
    return sorted(set(entries) - named)


def test_every_entry_of_a_registry_has_a_row():
    entries = list(registered())
    assert len(entries) > 60 and len(effects()) == 12
    assert not without_row(entries), "say in romdam/error/approximations.py what they change, or why nothing"


@pytest.mark.parametrize("new", ["contact.laws.new:New", "geometry.elements:hex64", "contact.solvers.new"])
def test_a_new_entry_without_a_row_is_found(new):
    assert without_row([*registered(), new]) == [new]


@cache
def texts(module):
    """The pieces of text of a module, each in one piece."""
    source = inspect.getsource(importlib.import_module(f"romdam.{module}"))
    return tuple(
        node.value
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


@cache
def functions(file):
    return {one.name for one in ast.parse((TESTS / file).read_text()).body if type(one) is ast.FunctionDef}


def exists(row, by):
    """Tell whether there is the statement, test or sentence that a row names."""
    if row.stated == "varied by":
        return by in STATEMENTS
    if row.stated in ("bounded by test", "exact"):
        file, _, function = by.partition("::")
        return function.startswith("test_") and function in functions(file)
    if row.stated == "said in the result":
        module, _, text = by.partition(": ")
        return any(text in piece for piece in texts(module))
    return bool(by)


@pytest.mark.parametrize("row", APPROXIMATIONS, ids=lambda row: row.name)
def test_what_a_row_names_exists(row):
    assert row.stated in typing.get_args(Stated) and row.name and row.changes and row.where
    for place in row.where:
        name, _, of_registry = place.partition(":")
        module = importlib.import_module(f"romdam.{name}")
        assert not of_registry or place in set(registered()) or hasattr(module, of_registry), place
    assert bool(row.by) != (row.acts is not None), (
        "either what states it, or the jobs that `not_included` names"
    )
    assert row.acts is None or row.stated == "said in the result"
    assert [by for by in row.by if not exists(row, by)] == []


def test_no_row_stands_twice():
    assert len({row.name for row in APPROXIMATIONS}) == len(APPROXIMATIONS)


def scene(**keys):
    joint = {
        "between": ["a", "b"],
        "normal_stiffness": "16 GPa/m",
        "friction": 0.6,
        "shear_stiffness": "8 GPa/m",
    } | keys.pop("joint", {})
    box = {"size": [4, 4, 8], "element_size": 2}
    raw = {
        "materials": {"c": {"E": "30 GPa", "nu": 0.2, "rho": 2400}},
        "blocks": {k: {"material": "c", "box": box | {"origin": [4 * i, 0, 0]}} for i, k in enumerate("ab")},
        "supports": [{"block": k, "face": "zmin"} for k in "ab"],
        "joints": {"ab": joint},
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"x": 1}}],
        "model": {"modes": 10},
        "damping": {"rayleigh": {"ratio": 0.05, "frequencies": ["2 Hz", "10 Hz"]}},
        "transient": {"finest_step": 0.01},
    }
    return parse_config(raw | keys, "s.yaml")


def test_a_result_names_what_its_job_has_and_no_statement_includes():
    usual = not_included(scene())
    assert usual == (
        "No statement of error includes what leaving out modes changes in slips, "
        "forces and stress, and what steps change in forces and stress."
    )
    assert not_included(scene(joints={})) == ""
    field = {"of": ["friction"], "coefficient_of_variation": 0.2, "length": 5, "seed": 1}
    water = {"level": 8, "faces": [{"block": "a", "face": "ymin"}], "model": "incompressible"}
    said = {
        "the spacing of contact points": scene(joint={"spacing": "5 m"}, outputs={"mesh_error": False}),
        "the scatter of random joint strengths": scene(joint={"field": field}),
        "far end of incompressible water": scene(water=water | {"length": 8}),
        "peaks of stress between written rows": scene(outputs={"stress": {"blocks": ["a"]}}),
        "how far the rock goes": scene(ground={"viscous": [{"block": "a", "faces": ["zmin"]}]}, supports=[]),
    }
    for text, config in said.items():
        named = set(not_included(config).removesuffix(".").split("; ")) - set(
            usual.removesuffix(".").split("; ")
        )
        assert any(text in one for one in named) and len(named) <= 2, text
    assert not_included(scene(water=water)) == usual
