"""Still water, temperature and staged weight against closed forms."""

from pathlib import Path

import numpy as np
import pytest
from arch_dams import DIVISIONS, arch_dam
from scipy.sparse import csr_matrix

from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig
from romdam.core.errors import ConfigError
from romdam.effects.full_order import assemble_full
from romdam.effects.static_loads import static_loads
from romdam.fem.assembly import assemble
from romdam.fem.loads import hydrostatic_force, static_force, surface_force, thermal_force
from romdam.fem.parts import basis_over_unknowns, unknowns
from romdam.fem.stress import stress_operators
from romdam.geometry.elements import SOLIDS
from romdam.linalg.factor import Factor
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.storage.staging import initial_stress, staged_displacement
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.equilibrium import static_equilibrium

REST = {
    "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400.0, "expansion": 1e-5}},
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}


def build(raw):
    return build_scene(parse_config(REST | raw, "s.yaml"), Path(), "s.yaml")


def wall(element, level, size=(2.0, 2.0, 6.0), divisions=2.0):
    """A wall with water on its side y = 0."""
    box = {"origin": [0, 0, 0], "size": list(size), "element_size": divisions, "element": element}
    return {
        "blocks": {"wall": {"material": "concrete", "box": box}},
        "supports": [{"block": "wall", "face": "zmin"}],
        "loads": {"hydrostatic": [{"level": level, "faces": [{"block": "wall", "face": "ymin"}]}]},
    }


@pytest.mark.parametrize("element", SOLIDS)
@pytest.mark.parametrize("level", [6.0, 4.0, 3.3, 0.7])
def test_still_water_pushes_with_half_gamma_h_squared(element, level):
    """F = rho g h^2 b / 2 at a third of the depth, wherever the level cuts the facets."""
    scene = build(wall(element, level))
    points = scene.blocks["wall"].points
    force = surface_force(scene, "wall")
    total = 1000.0 * 9.81 * level**2 / 2 * 2.0
    assert force.sum(axis=0) == pytest.approx([0.0, total, 0.0], rel=1e-12, abs=1e-9 * total)
    assert (force[:, 1] @ points[:, 2]) == pytest.approx(total * level / 3, rel=1e-12)
    assert (force[:, 1] @ points[:, 0]) == pytest.approx(total * 1.0, rel=1e-12)


def test_still_water_on_a_curved_face():
    """The resultant on the facets of an arch dam follows from the divergence theorem on its wet shadow."""
    raw = arch_dam(ground=False, divisions=DIVISIONS | {"up": 4}) | {k: REST[k] for k in ("records", "model")}
    faces = [{"block": f"C{k}", "face": "upstream"} for k in (1, 2, 3, 4)]
    for level in (100.0, 63.0):
        loads = {"hydrostatic": [{"level": level, "faces": faces}]}
        scene = build(raw | {"transient": {"finest_step": 0.01}, "loads": loads})
        coarse, fine = np.zeros(3), np.zeros(3)
        for water in scene.loads.water:
            points = scene.blocks[water.block].points
            coarse += hydrostatic_force(points, water).sum(axis=0)
            fine += by_small_squares(points[water.facets], water)
        assert coarse == pytest.approx(fine, rel=2e-4, abs=1e-4 * np.abs(fine).max())


def by_small_squares(corners, water, n=200):
    """Resultant of still water on bilinear facets (nf, 4, 3) by the midpoint rule."""
    s = (np.arange(n) + 0.5) / n
    u, v = (g.ravel() for g in np.meshgrid(s, s))
    shape = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
    du = np.stack([-(1 - v), 1 - v, v, -v])
    dv = np.stack([-(1 - u), -u, u, 1 - u])
    x, a, b = (np.einsum("jq,fjk->fqk", m, corners) for m in (shape, du, dv))
    pressure = water.weight * np.maximum(water.level - x[..., 2], 0.0)
    return -(pressure[..., None] * np.cross(a, b)).sum(axis=(0, 1)) / n**2


@pytest.mark.parametrize(("level", "what"), [(6.5, "above the top"), (0.0, "not above the foot")])
def test_water_off_its_faces_is_refused_with_numbers(level, what):
    with pytest.raises(ConfigError, match=rf"hydrostatic\[0\]\.level: the water is {what}.*{level:g} m"):
        build(wall("hex8", level))


@pytest.mark.parametrize("element", SOLIDS)
def test_free_expansion_is_free_of_stress(element):
    """u = alpha dT x satisfies K u = f exactly."""
    raw = wall(element, 6.0) | {"loads": {"temperature": [{"change": -20.0}]}}
    scene = build(raw)
    block = scene.blocks["wall"]
    force = thermal_force(block, -20.0)
    u = 1e-5 * -20.0 * block.points
    K = assemble(block)[0]
    assert np.abs(K @ u.ravel() - force.ravel()).max() < 1e-9 * np.abs(force).max()


def test_temperature_needs_expansion():
    raw = wall("hex8", 6.0) | {"loads": {"temperature": [{"change": 5.0}]}}
    raw |= {"materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400.0}}}
    with pytest.raises(ConfigError, match=r"temperature\[0\]: no block .* give materials\.<name>\.expansion"):
        build(raw)


def pillars(weight, **loads):
    """Two pillars of different height on one foundation; the higher one leans on the other one."""
    box = {"element_size": 1.0}
    at = {"foot": ([0, 0, -2], [4, 2, 2]), "left": ([0, 0, 0], [2, 2, 6]), "right": ([2, 0, 0], [2, 2, 4])}
    return REST | {
        "blocks": {
            n: {"material": "concrete", "weight": n != "foot", "box": box | {"origin": o, "size": s}}
            for n, (o, s) in at.items()
        },
        "supports": [{"block": "foot", "face": "zmin"}],
        "ties": {n: {"between": ["foot", n]} for n in ("left", "right")},
        "joints": {
            "j": {
                "between": ["left", "right"],
                "normal_stiffness": 1e11,
                "shear_stiffness": 5e10,
                "friction": 0.6,
            }
        },
        "loads": {"gravity": [2.0, 0, -9.81], "weight": weight, **loads},
        "outputs": {"stress": {"blocks": ["left", "right"]}},
    }


def test_staged_weight_leaves_the_joints_unloaded():
    staged, monolithic = (build(pillars(w)) for w in ("staged", "monolithic"))
    for scene, carries in ((staged, False), (monolithic, True)):
        assert (np.abs(static_force(scene, "left")).max() > 0.0) == carries
        for system in (assemble_full(scene, DampingConfig()), _reduced(scene)):
            q, gaps = static_equilibrium(system, 1e-10)
            assert (np.abs(gaps.force).max() > 1.0) == carries
            assert (np.abs(q).max() > 0.0) == carries


def _reduced(scene):
    from romdam.config.sections.job import ModelConfig

    return reduce_scene(scene, ModelConfig(cutoff=50.0), DampingConfig()).system


def test_staged_displacement_is_that_of_open_joints():
    scene = build(pillars("staged"))
    loose = build(pillars("monolithic") | {"joints": {}})
    system = assemble_full(loose, DampingConfig())
    u = Factor(csr_matrix(system.K)).solve(system.force)
    for name, matrix in unknowns(loose).of_block.items():
        found = staged_displacement(scene)[name].ravel()
        assert np.abs(found - matrix @ u).max() < 1e-10 * np.abs(u).max()


def test_staged_displacement_comes_out_of_the_basis_of_a_part():
    """The basis of blocks that have grown together holds the answer to weight, however few its modes."""
    scene = build(pillars("staged"))
    model = reduce_scene(scene, ModeChoice(cutoff=1.0), DampingConfig())
    mesh, basis = staged_displacement(scene), staged_displacement(scene, model.basis)
    assert model.basis["left"].report["fixed_interface_modes"] == 0
    for name, u in mesh.items():
        assert np.abs(basis[name] - u).max() < 1e-9 * np.abs(mesh["left"]).max()


def test_staged_stress_carries_the_weight():
    """The mean vertical stress at the middle of a pillar's height is the weight above it."""
    scene = build(pillars("staged"))
    stress = initial_stress(scene, stress_operators(scene))["left"]
    points = scene.blocks["left"].points[scene.stress.blocks["left"].nodes]
    middle = points[:, 2] == 3.0
    weight = np.outer([0.5, 1.0, 0.5], [0.5, 1.0, 0.5]).ravel() / 4.0
    order = np.lexsort(points[middle][:, :2].T)
    assert weight @ stress[middle][order, 2] == pytest.approx(-2400 * 9.81 * 3.0, rel=1e-2)


def test_rock_excluded_from_gravity_has_no_weight():
    """Only the pillars' weight arrives at the base."""
    system = assemble_full(build(pillars("monolithic")), DampingConfig())
    whole = 2400 * 9.81 * (2 * 2 * 6 + 2 * 2 * 4)
    assert system.force.sum() == pytest.approx(-whole * (1 - 2.0 / 9.81), rel=1e-12)


def test_a_basis_without_modes_answers_every_kind_of_load_by_itself():
    """K^-1 f of water, temperature and a pressure, each alone, out of a basis that knows their sum."""
    water = [{"level": 3.7, "faces": [{"block": "left", "face": "ymin"}]}]
    raw = pillars(
        "monolithic",
        hydrostatic=water,
        temperature=[{"change": 7.0, "blocks": ["left"]}],
        pressure=[{"block": "left", "face": "zmax", "value": 3e5}],
    )
    built = build(raw | {"joints": {}})
    full, small = (
        assemble_full(built, DampingConfig()),
        reduce_scene(built, ModeChoice(cutoff=1.0), DampingConfig()),
    )
    assert small.basis["left"].report["fixed_interface_modes"] == 0
    T = basis_over_unknowns(built, small.basis, small.system.size)
    K, numbered, kinds = csr_matrix(full.K), unknowns(built), static_loads(built).kinds["left"]
    assert set(kinds) == {"water", "temperature", "forces"}
    for kind, force in kinds.items():
        f = numbered.of_block["left"].T @ force
        u = Factor(K).solve(f)
        found = T @ np.linalg.solve(T.T @ (K @ T), T.T @ f)
        assert np.abs(found - u).max() <= 1e-8 * np.abs(u).max(), kind
