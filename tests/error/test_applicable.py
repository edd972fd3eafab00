"""Which approximations a job has: by its effects, laws, elements, integrator and statements."""

import pytest

from romdam.config import parse_config
from romdam.config.load import load_config
from romdam.error.applicable import NEEDS, applies
from romdam.error.approximations import APPROXIMATIONS, Approximation

ROWS = {row.name: row for row in APPROXIMATIONS}


def of(name, config, integrator="adaptive", statements=()):
    return applies(ROWS[name], config, integrator, statements)


def test_every_beginning_that_is_listed_is_of_a_module_of_the_table():
    modules = {place.partition(":")[0] for row in APPROXIMATIONS for place in row.where}
    assert not [
        start
        for start in NEEDS
        if not any(module == start or module.startswith(f"{start}.") for module in modules)
    ]


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (
            {"joints.contraction.fracture": {"energy": 100.0, "tensile_strength": 1e6}},
            "end of exponential softening",
        ),
        ({"joints.contraction.normal_stiffness": "auto"}, "automatic stiffness of joints"),
        ({"joints.contraction.spacing": 5.0}, "contact points farther apart than the nodes"),
        ({"blocks.right.box.element_size": 5.0}, "mortar on curved faces"),
        (
            {"water": {"level": 40.0, "faces": [{"block": "left", "face": "ymin"}], "model": "compressible"}},
            "far end of compressible water",
        ),
        ({"outputs.stress": {"blocks": ["left"]}}, "stress of nodes"),
        ({"loads.temperature": [{"change": -4.0}]}, "bending of linear elements under temperature"),
        ({"records.0.correction": [{"step": "mean"}]}, "length of the pads of a filter"),
        ({"model.order": "full"}, None),
    ],
)
def test_a_key_brings_its_approximation_and_without_it_there_is_none(change, name):
    plain = load_config("configs/two_cantilevers.yaml")
    keys = plain.to_dict()
    for path, value in change.items():
        *sections, last = path.split(".")
        place = keys
        for section in sections:
            place = place[int(section)] if section.isdecimal() else place[section]
        place[last] = value
    changed = parse_config(keys, "job", folder=plain.folder, si=True)
    if name is None:  # without a reduction there is nothing that one leaves out
        assert of("residual vectors", plain.config) and not of("residual vectors", changed)
        return
    assert of(name, changed) and not of(name, plain.config)


def test_integrators_and_statements_are_those_of_the_run():
    config = load_config("configs/two_cantilevers.yaml").config
    own = "generalised-alpha's order and numerical damping, reduced"
    assert of(own, config, "generalized_alpha") and not of(own, config, "adaptive")
    cut = "changes of a joint force for which a step is not cut"
    assert of(cut, config, "adaptive") and not of(cut, config, "modal")
    for kind in ("certificate", "verification", "estimate"):
        name = f"{'an' if kind == 'estimate' else 'a'} {kind} itself"
        assert of(name, config, statements={kind}) and not of(name, config)


def test_the_longest_beginning_decides_and_a_row_that_says_itself_is_asked():
    config = load_config("configs/arch_dam.yaml").config  # incompressible water
    row = Approximation("a", ("fem.water.prism",), "b", "bounded by test")
    assert applies(row, config, "adaptive", ())
    assert not applies(Approximation("a", ("reduction.synthesis.x",), "b", "exact"), config, "adaptive", ())
    never = Approximation("a", ("core.arrays",), "b", "exact", acts=lambda _: False)
    assert not applies(never, config, "adaptive", ())
    assert applies(Approximation("a", ("core.arrays",), "b", "exact"), config, "adaptive", ())
