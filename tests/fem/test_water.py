"""Added mass: total force on a rigid wall, a published dam, the reduced model against the mesh, refusals."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from gravity_sections import FOOT, KOYNA, PINE_FLAT, section_scene
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import eigsh
from simulating import simulated

import romdam.effects.added_mass
import romdam.reduction.storage.model_file
from romdam.config import parse_config
from romdam.core.errors import ConfigError, ReductionError
from romdam.core.scene import Reservoir
from romdam.effects.added_mass import added_mass, added_mass_matrix
from romdam.effects.full_order import assemble_full
from romdam.geometry.elements import SOLIDS
from romdam.reduction.basis import Lazy
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.refinement import embedding
from romdam.reduction.storage.model_file import read_block
from romdam.reduction.synthesis import reduce_scene
from romdam.results.fields import write_model
from romdam.scene.build import build_scene
from romdam.scene.reservoir.wet_mesh import wet_mesh

SERIES = 16 / np.pi**3 * sum(1 / (2 * k - 1) ** 3 for k in range(1, 200))  # 0.5427, Westergaard's total force


def job(water, boxes, element="hex8", **other):
    """Scene and configuration of boxes in a row along x, held at their feet, with joints between them."""
    names = list(boxes)
    raw = {
        "materials": {"c": {"E": "30 GPa", "nu": 0.18, "rho": 2440}},
        "blocks": {
            name: {"material": "c", "box": {"origin": o, "size": s, "element_size": e, "element": element}}
            for name, (o, s, e) in boxes.items()
        },
        "supports": [{"block": name, "face": "zmin"} for name in names],
        "joints": {
            f"{a}-{b}": {"between": [a, b], "normal_stiffness": "16 GPa/m"} for a, b in pairwise(names)
        },
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": "all"},
        "damping": {"rayleigh": {"alpha": 1.0, "beta": 1e-3}},
        "transient": {"finest_step": 0.01},
    } | ({"water": water} if water else {})
    config = parse_config(raw | other, "s.yaml")
    return build_scene(config, Path("."), "s.yaml"), config


def wall(model, element="hex8", level=40.0, edge=(4.0, 4.0, 2.0), **keys):
    faces = [{"block": "a", "face": "ymin"}]
    water = {"level": level, "faces": faces, "model": model, **keys}
    return job(water, {"a": ([0, 0, 0], [4, 4, 40], list(edge))}, element)


def rigid_mass(scene):
    """Added mass of unit rigid motions and ground load, (3, 3) each, in units of rho B H^2."""
    water = added_mass(scene)
    rigid = {name: np.tile(np.eye(3), (len(b.points), 1)) for name, b in scene.blocks.items()}
    B = water.on(rigid)
    unit = 1000.0 * 4.0 * scene.find(Reservoir).level ** 2
    return B.T @ water.times(B) / unit, B.T @ water.ground / unit


@pytest.mark.parametrize("element", SOLIDS)
def test_total_force_of_incompressible_water_is_westergaards_series(element):
    """0.543 rho a H^2 on a rigid wall in the 2-D limit (Westergaard 1933), within 1 %; no vertical force."""
    mass, ground = rigid_mass(wall("incompressible", element)[0])
    assert mass[1, 1] == pytest.approx(SERIES, rel=0.005)
    assert np.abs(np.delete(mass.ravel(), 4)).max() < 1e-9
    assert ground[1, 1] == pytest.approx(mass[1, 1], rel=2e-3)


@pytest.mark.parametrize("depths", [0.25, 0.5, 1.0, 2.0, 3.0])
def test_a_far_end_adds_what_its_closed_form_says(depths):
    """A rigid end at L that stands still: coth(l_n L) times the force of mode n, l_n = (2n - 1) pi / 2H.

    So the default of three depths is 0.015 % above a reservoir without end, one depth 8.6 %.
    """
    number = 2 * np.arange(1, 200) - 1
    exact = 16 / np.pi**3 * float((1 / number**3 / np.tanh(0.5 * np.pi * number * depths)).sum())
    mass = rigid_mass(wall("incompressible", "hex20", length=40.0 * depths)[0])[0]
    assert mass[1, 1] == pytest.approx(exact, rel=0.005)
    assert exact / SERIES - 1 < 2e-4 or depths < 3.0


def test_force_converges_to_the_series():
    errors = [
        rigid_mass(wall("incompressible", edge=(4.0, 4.0, h), length=160.0)[0])[0][1, 1] / SERIES - 1
        for h in (8.0, 4.0, 2.0)
    ]
    assert -0.03 < errors[0] < errors[1] < errors[2] < 0.0  # a conforming pressure gives too little


@pytest.mark.parametrize("level", [40.0, 37.3])
@pytest.mark.parametrize("element", ["hex8", "tet10"])
def test_level_between_nodes_cuts_the_elements(level, element):
    scene, _ = wall("incompressible", element, level)
    mesh = wet_mesh(scene.blocks, scene.find(Reservoir))
    assert mesh.points[:, 2].max() == pytest.approx(level)
    assert rigid_mass(scene)[0][1, 1] == pytest.approx(SERIES, rel=0.006)


@pytest.mark.parametrize("element", SOLIDS)
@pytest.mark.parametrize("level", [40.0, 37.3])
def test_westergaards_pressure_totals_seven_twelfths(element, level):
    """int 7/8 rho sqrt(H y) dy = 7/12 rho H^2."""
    mass, ground = rigid_mass(wall("westergaard", element, level)[0])
    assert mass[1, 1] == pytest.approx(7 / 12, rel=1e-3)
    np.testing.assert_allclose(ground, mass, atol=1e-12)


def test_vertical_ground_motion_presses_like_heavier_water():
    """Floor and walls rise together: p = rho a (level - z), total 1/2 rho a H^2 on the wall, into the dam."""
    _, ground = rigid_mass(wall("incompressible")[0])
    assert -ground[1, 2] == pytest.approx(0.5, rel=1e-6)


def test_inclined_face_of_a_reservoir_between_moving_walls():
    """Vertical motion of everything is exact on any face: force int rho (level - z) n dA."""
    scene, _ = wall("incompressible", "tet10")
    block = scene.blocks["a"]
    points = block.points.copy()
    points[:, 1] -= 0.5 * points[:, 2]  # the face leans over the water
    scene = replace(scene, blocks={"a": replace(block, points=points)})
    _, ground = rigid_mass(scene)
    np.testing.assert_allclose(ground[:, 2], [0.0, -0.5, -0.25], atol=1e-6)


def section_system(section, level=None):
    """First frequency of 6 x 16 hex20, and the first mode along the upstream face."""
    water = {"level": level, "model": "incompressible"} if level else None
    scene, config = section_scene(section, water, (6, 16), {})
    held = scene.fixed["a"]
    x, _, z = scene.blocks["a"].points.T
    system = assemble_full(scene, config.damping)
    omega2, mode = eigsh(system.K, 1, system.M, sigma=0.0, v0=np.ones(system.size))
    whole = np.zeros(held.size)
    whole[~held.ravel()] = mode[:, 0]
    face = np.isin(np.arange(len(x)), scene.blocks["a"].faces["ymin"]) & (x == 2.0)
    order = np.argsort(z[face])
    return np.sqrt(omega2[0]), z[face][order], whole[1::3][face][order]


def test_koyna_empty_is_the_published_frequency():
    """First frequency 19.27 rad/s (Chopra & Chakrabarti, Bull. Seism. Soc. Am. 63 (1973) 381-397).

    The figure is the one that later analyses of this section quote from there (Abaqus Example Problems,
    section 2.1.15, with 71 m at the base); the paper itself was not at hand.
    """
    assert section_system(KOYNA)[0] == pytest.approx(19.27, rel=0.02)


def test_koyna_full_is_the_closed_form():
    """A vertical face that moves with phi(z): p = 2 rho/H sum I_n / lambda_n cos(lambda_n z), with
    lambda_n = (n - 1/2) pi/H and I_n = int phi cos(lambda_n z) dz, for incompressible water (Chopra, J. Eng.
    Mech. Div. ASCE 93 (1967) 205).
    """
    level = 96.5
    omega, z, phi = section_system(KOYNA)
    t = np.linspace(0.0, level, 4001)
    n = (np.arange(1, 80) - 0.5) * np.pi / level
    integral = np.trapezoid(np.interp(t, z, phi) * np.cos(n[:, None] * t), t, axis=1)
    mass = 4.0 * 2.0 * 1000.0 / level * (integral**2 / n).sum()  # on a mode of unit mass
    wet = section_system(KOYNA, level)[0]
    assert wet == pytest.approx(omega / np.sqrt(1.0 + mass), rel=2e-3)


def test_pine_flat_empty_and_full_against_published_periods():
    """Empty 0.317 s; full, lengthened by 1.263 for soft concrete, where the water's compressibility is small.

    Fenves & Chopra, Simplified analysis for earthquake resistant design of concrete gravity dams,
    UCB/EERC-85/10 (1986): E = 22.4 GPa; lengthening ratio for a full reservoir, rigid base, E = 6.9 GPa. For
    22.4 GPa they give 0.397 s with compressible water at 381 of 400 ft; incompressible water is 5 % short.
    The figures are as handed down; the report (PB87-124160) was not at hand to compare them again.
    """
    empty = 2 * np.pi / section_system(PINE_FLAT)[0]
    assert empty == pytest.approx(0.317, rel=0.015)
    full = 2 * np.pi / section_system(PINE_FLAT, 400 * FOOT)[0]
    assert full / empty == pytest.approx(1.263, rel=0.02)
    high = 2 * np.pi / section_system(PINE_FLAT, 381 * FOOT)[0]
    assert 0.94 < high / 0.397 < 0.96


def two_blocks(model="incompressible", **other):
    faces = [{"block": b, "face": "ymin"} for b in ("a", "b")]
    boxes = {"a": ([0, 0, 0], [2, 2, 8], 1.0), "b": ([2, 0, 0], [3, 2, 8], 1.0)}
    water = {"level": 7.5, "faces": faces, "model": model, "density": 3000.0}
    return job(water, boxes, **other)


@pytest.mark.parametrize("model", ["incompressible", "westergaard"])
def test_all_modes_with_water_are_those_of_the_mesh(model):
    scene, config = two_blocks(model)
    reduced = reduce_scene(scene, config.model, config.damping).system
    full = assemble_full(scene, config.damping)
    expected = np.sort(eigsh(full.K, 12, full.M, sigma=0.0, v0=np.ones(full.size))[0])
    np.testing.assert_allclose(np.sort(reduced.K.diagonal())[:12], expected, rtol=1e-9)
    static = full.load.T @ np.linalg.solve(full.K.toarray(), full.load)
    np.testing.assert_allclose(
        (reduced.load.T / reduced.K.diagonal()) @ reduced.load, static, rtol=1e-8, atol=1e-9 * static.max()
    )
    flexible = full.B @ np.linalg.solve(full.K.toarray(), full.B.T.toarray())
    B = reduced.B.toarray()
    np.testing.assert_allclose((B / reduced.K.diagonal()) @ B.T, flexible, atol=1e-9 * flexible.max())
    assert list(reduced.parts) == ["water"]
    dry, _ = job(None, {"a": ([0, 0, 0], [2, 2, 8], 1.0), "b": ([2, 0, 0], [3, 2, 8], 1.0)})
    lowest = reduce_scene(dry, config.model, config.damping).system.K.diagonal().min()
    assert expected[0] < 0.9 * lowest


def test_few_modes_find_the_wet_frequencies():
    """12 modes a block: the five lowest frequencies within 0.1 % of the mesh's, all from above."""
    scene, config = two_blocks()
    reduced = reduce_scene(scene, ModeChoice(count=12), config.damping).system
    full = assemble_full(scene, config.damping)
    expected = np.sort(eigsh(full.K, 5, full.M, sigma=0.0, v0=np.ones(full.size))[0])
    errors = np.sqrt(np.sort(reduced.K.diagonal())[:5] / expected) - 1
    assert (errors > -1e-9).all() and errors.max() < 1e-3


def test_modes_left_dry_cost_little(monkeypatch):
    """Without water on the highest half of the modes the six lowest frequencies move by less than 0.2 %."""
    scene, config = two_blocks()
    whole = reduce_scene(scene, config.model, config.damping)
    monkeypatch.setattr(romdam.effects.added_mass, "_MOST", whole.system.size // 2)
    half = reduce_scene(scene, config.model, config.damping)
    assert set(half.system.parts) == {"water", "a", "b"}
    k, k_half = (np.sqrt(np.sort(m.system.K.diagonal())[:6]) for m in (whole, half))
    assert (np.abs(k_half / k - 1) < 2e-3).all()


def test_large_bases_are_turned_row_by_row(monkeypatch, tmp_path):
    """A mapped basis takes the water where its rows are read; what is stored is the same."""
    scene, config = two_blocks()
    known = reduce_scene(scene, ModeChoice(count=12), config.damping)
    monkeypatch.setattr(romdam.reduction.storage.model_file, "_MAPPED", 0.0)
    made = reduce_scene(scene, ModeChoice(count=12), config.damping)
    path = tmp_path / write_model(tmp_path, scene, made.basis)
    for name in scene.blocks:
        size = np.abs(known.basis[name].vectors.rows()).max()
        assert isinstance(made.basis[name].vectors, Lazy)
        whole = made.basis[name].vectors.rows()
        np.testing.assert_allclose(whole, known.basis[name].vectors.rows(), atol=1e-9 * size)
        with h5py.File(path) as file:
            stored = read_block(file[f"blocks/{name}"]).vectors.rows()
        np.testing.assert_allclose(stored, whole, atol=1e-7 * size)  # single precision


def test_motion_of_one_wet_basis_is_written_in_another():
    """All modes span every motion, so that the embedding of a smaller basis is exact."""
    scene, config = two_blocks()
    whole = reduce_scene(scene, config.model, config.damping)
    few = reduce_scene(scene, ModeChoice(count=5), config.damping)
    u = np.random.default_rng(1).standard_normal(few.system.size)
    into = embedding(scene, few, whole)
    for name in scene.blocks:
        a, b = few.basis[name], whole.basis[name]
        expected = a.vectors.apply(u[a.columns])
        found = b.vectors.apply((into @ u)[b.columns])
        np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("model", ["incompressible", "westergaard"])
def test_shaken_with_water_reduced_and_full_order_agree(model):
    """All modes against the mesh, three components, mass-proportional damping: within 0.2 % in L2."""
    nodes = {"top": {"block": "a", "at": [0, 0, 8]}}
    scene, config = two_blocks(model, outputs={"nodes": nodes})
    t = np.arange(0.0, 0.3, 2e-4)
    ground = np.stack([3 * np.sin(60 * t), 5 * np.sin(40 * t), 2 * np.sin(90 * t)])
    reduced = reduce_scene(scene, config.model, config.damping).system
    full = assemble_full(scene, config.damping)
    options = {"stride": 5, "initial_state": "undeformed"}
    found = simulated(reduced, ground, 2e-4, **options)
    fixed = {"integrator": "generalized_alpha", "midpoint": False}  # as `modal` has it
    expected = simulated(full, ground, 2e-4, **fixed, **options)
    for name in ("disp", "jump"):
        a, b = getattr(found, name), getattr(expected, name)
        assert np.linalg.norm(a - b) < 0.002 * np.linalg.norm(b)
    assert np.abs(found.energy["residual"]).max() < 1e-9 * found.energy["input"].max()


def test_block_that_the_water_does_not_touch_keeps_its_modes():
    boxes = {"a": ([0, 0, 0], [2, 2, 8], 1.0), "b": ([2, 0, 0], [3, 2, 8], 1.0)}
    water = {"level": 8.0, "faces": [{"block": "b", "face": "ymin"}], "model": "westergaard"}
    scene, config = job(water, boxes)
    wet = reduce_scene(scene, config.model, config.damping)
    dry = reduce_scene(job(None, boxes)[0], config.model, config.damping)
    own = wet.basis["a"].columns
    np.testing.assert_allclose(wet.system.K.diagonal()[own], dry.basis["a"].omega2)
    np.testing.assert_array_equal(wet.basis["a"].vectors.rows(), dry.basis["a"].vectors.rows())
    assert wet.system.parts["a"] == own


FACE = {"block": "a", "face": "ymin"}


TWICE = "faces[1]: the face is not wet:"


@pytest.mark.parametrize(
    ("water", "says"),
    [
        ({"level": 8.5}, "water.level: the water is above the top of its faces: 8.5 m, and they"),
        ({"level": -1.0}, "water.level: the water is not above the foot of its faces: -1 m"),
        ({"faces": [FACE, {"block": "a", "face": "zmax"}]}, f"{TWICE} it begins at 8 m, above the level"),
        ({"faces": [FACE, {"block": "a", "face": "xmax"}]}, f"{TWICE} 16 of its 16 facets lie in the"),
        ({"faces": [FACE, {"block": "a", "face": "zmin"}]}, f"{TWICE} supports hold all 4 of its facets"),
        ({"faces": [FACE, {"block": "b", "face": "ymax"}], "upstream": [0, -1, 0]}, "look away"),
        ({"faces": [FACE, {"block": "a", "face": "ymax"}]}, "normal of the faces has no horizontal part"),
        ({"bottom": 9.0}, "water.bottom: the floor at 9 m must be below the level of 7 m"),
        ({"faces": [{"block": "z", "face": "ymin"}]}, "water.faces[0].block: no 'z' is defined"),
        ({"density": -1}, "water.density"),
        ({"model": "shallow"}, "water.model"),
        ({"sound_speed": 1500.0}, "water.sound_speed: water that is 'incompressible' knows no waves"),
    ],
)  # fmt: skip
def test_water_that_cannot_be_is_refused_with_numbers(water, says):
    boxes = {"a": ([0, 0, 0], [2, 2, 8], 1.0), "b": ([2, 0, 0], [3, 2, 8], 1.0)}
    with pytest.raises(ConfigError) as caught:
        job({"level": 7.0, "faces": [FACE], "model": "incompressible"} | water, boxes)
    assert says in str(caught.value) and str(caught.value).startswith("s.yaml: ")


def test_facets_that_look_away_are_counted():
    boxes = {"a": ([0, 0, 0], [2, 2, 8], 1.0)}
    faces = [FACE, {"block": "a", "face": "ymax"}]
    water = {"level": 7.0, "faces": faces, "model": "incompressible", "upstream": [0, -1, 0]}
    with pytest.raises(
        ConfigError, match=r"faces\[1\]: 16 of its 16 facets are not wet, .* \(180 degrees off"
    ):
        job(water, boxes)


def test_full_order_says_what_it_cannot_hold():
    scene, _ = two_blocks()
    maps = {name: csr_matrix((3 * len(b.points), 3 * len(b.points))) for name, b in scene.blocks.items()}
    maps["a"] = csr_matrix(np.eye(maps["a"].shape[0]))
    maps["b"] = csr_matrix((maps["b"].shape[0], maps["a"].shape[0]))
    water = added_mass(scene)
    with pytest.raises(ReductionError, match=r"couples 27 wet DOFs, 7.3e\+02 entries .* limit 1e\+02; use"):
        added_mass_matrix(water, csr_matrix(water.on(maps)), 100)


@pytest.mark.parametrize("edges", [[2, 4, 4 / 3], [1, 4, 40 / 17], [2, 4, 1], [2, 4, 5]])
@pytest.mark.parametrize("level", [40.0, 37.3])
def test_water_passes_a_seam_of_faces_that_do_not_meet_node_by_node(edges, level):
    """A wall of two blocks of other meshes: vertical motion exact, Westergaard's series as with one mesh."""
    boxes = {"a": ([0, 0, 0], [2, 4, 40], [2, 4, 2]), "b": ([2, 0, 0], [2, 4, 40], edges)}
    faces = [{"block": name, "face": "ymin"} for name in boxes]
    scene, _ = job({"level": level, "faces": faces, "model": "incompressible"}, boxes)
    mesh = wet_mesh(scene.blocks, scene.find(Reservoir))
    assert len(mesh.seams) and len(mesh.independent) < (~mesh.surface).sum()
    mass, ground = rigid_mass(scene)
    assert mass[1, 1] == pytest.approx(SERIES, rel=0.006 if edges[2] == 5 else 0.0025)
    assert ground[1, 1] == pytest.approx(mass[1, 1], rel=1e-12)
    assert -ground[1, 2] == pytest.approx(0.5, rel=1e-12)


def test_seam_is_no_wall_between_unlike_motions():
    """Only one block moves: the other is pressed as much as where both have the coarser mesh, within 2 %."""
    pressed = []
    for edges in ([2, 4, 2], [2, 4, 1], [1, 4, 40 / 17]):
        boxes = {"a": ([0, 0, 0], [2, 4, 40], [2, 4, 2]), "b": ([2, 0, 0], [2, 4, 40], edges)}
        faces = [{"block": name, "face": "ymin"} for name in boxes]
        water = added_mass(job({"level": 40, "faces": faces, "model": "incompressible"}, boxes)[0])
        along = {name: np.tile([0.0, 1.0, 0.0], B.shape[1] // 3) for name, B in water.coupling.items()}
        pressed.append(water.coupling["b"] @ along["b"] @ water.times(water.coupling["a"] @ along["a"]))
    assert min(pressed) > 0.0
    np.testing.assert_allclose(pressed[1:], pressed[0], rtol=0.02)
