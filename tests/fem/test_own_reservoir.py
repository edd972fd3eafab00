"""A reservoir of its own mesh: the prism as a file, closed forms of basins and channels, a job, refusals."""

import logging
from dataclasses import replace

import meshio
import numpy as np
import pytest
from reservoir_meshes import box, plane, written
from scipy.optimize import brentq
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import eigsh, splu
from scipy.special import iv, jvp, kv, yvp
from test_compressible_water import ABOVE, BELOW, FIRST, C, H, agree, closed_form, force
from test_water import job, wall

import romdam
from romdam.core.errors import ConfigError, MeshError
from romdam.core.fingerprint import fingerprint
from romdam.core.scene import Reservoir
from romdam.effects.added_mass import added_mass
from romdam.effects.compressible_water import reservoir_waves
from romdam.fem.water.prism import prism
from romdam.scene.reservoir.wet_mesh import wet_mesh

OMEGA = FIRST * np.array(BELOW + ABOVE)


def as_file(path, scene):
    """The prism of a scene, with its layers for sound up to 50 Hz or without, as hexahedra in a file."""
    longest = np.inf if scene.find(Reservoir).sound is None else C / 500.0
    channel = prism(scene.find(Reservoir), wet_mesh(scene.blocks, scene.find(Reservoir)), longest)
    cells = np.concatenate([cells for _, cells, *_ in channel.cells()])
    return written(path, replace(box((0, 0, 0), (1, 1, 1), 1.0), points=channel.points, cells=cells))


@pytest.mark.parametrize("reflection", [1.0, 0.5])
def test_prism_as_a_file_is_the_prism(reflection, tmp_path):
    """On the dam's own nodes: complex force on a rigid wall within 1e-9, along the channel and vertical."""
    keys = {"bottom_reflection": reflection, "edge": (4.0, 4.0, 4.0)}
    scene, _ = wall("compressible", **keys)
    mesh = {"file": as_file(tmp_path / "w.vtu", scene), "end": plane("y", -120.0)}
    own, _ = wall("compressible", mesh=mesh, **keys)
    for axis in (1, 2):
        expected, found = (force(s, reservoir_waves(s), OMEGA, axis) for s in (scene, own))
        np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_incompressible_prism_as_a_file_is_the_prism(tmp_path):
    keys = {"edge": (4.0, 4.0, 4.0)}
    scene, _ = wall("incompressible", **keys)
    mesh = {"file": as_file(tmp_path / "w.vtu", scene), "end": plane("y", -120.0)}
    own, _ = wall("incompressible", mesh=mesh, **keys)
    rigid = np.tile(np.eye(3), (len(scene.blocks["a"].points), 1))
    masses = []
    for water in (added_mass(scene), added_mass(own)):
        B = water.coupling["a"] @ rigid
        masses.append((B.T @ water.times(B), B.T @ water.ground))
    np.testing.assert_allclose(masses[1], masses[0], atol=1e-9 * np.abs(masses[0]).max())


@pytest.mark.parametrize("reflection", [1.0, 0.9, 0.5, 0.0])
@pytest.mark.parametrize("element", ["hex20", "tet10"])
def test_rigid_wall_on_which_the_water_has_other_facets(element, reflection, tmp_path):
    """Westergaard, Chopra, Fenves and Chopra from 0.05 to 2.9 times the first frequency, within 1.5 %.

    The wall has facets 4 m by 2 m, the water 4 m by 5 m.
    """
    block = box((0, -3 * H, 0), (4, 3 * H, H), (4, 6, 5), element)
    mesh = {"file": written(tmp_path / "w.vtu", block), "end": plane("y", -3 * H)}
    scene, _ = wall("compressible", bottom_reflection=reflection, mesh=mesh)
    found = force(scene, reservoir_waves(scene), OMEGA)
    assert np.abs(found / closed_form(OMEGA, reflection) - 1).max() < 0.015


def sector(points, radius=60.0):
    """x from 0 to 1 is an angle of 60 degrees, y a distance from the outer radius, downstream positive."""
    angle, r = np.pi / 3.0 * points[:, 0], radius + points[:, 1]
    return np.stack([r * np.sin(angle), r * np.cos(angle), points[:, 2]], axis=1)


R1, R2, DEPTH, SOUND = 20.0, 60.0, 30.0, 1440.0


def basin(tmp_path, element, n, other=(1 / 3, 2.0, 5.0), kind="hex20"):
    """Water between radii R1 and R2, closed, held by an arch: n elements across, upstream and up."""
    dam = box((0, 0, 0), (1, 4, DEPTH), (other[0], 4.0, other[2]), kind, sector)
    water = box((0, R1 - R2, 0), (1, R2 - R1, DEPTH), (1 / n, (R2 - R1) / n, DEPTH / n), element, sector)
    files = [written(tmp_path / f"{k}.msh", b, "ymin") for k, b in (("dam", dam), ("water", water))]
    keys = {"level": DEPTH, "faces": [{"block": "a", "face": "ymin"}], "model": "compressible"}
    keys["mesh"] = {"file": files[1], "end": "closed"}
    blocks = {"a": {"material": "c", "mesh": {"file": files[0]}}}
    supports = [{"block": "a", "face": plane("z", 0.0)}]
    return job(keys, {}, blocks=blocks, supports=supports, joints={})[0]


def radial_roots(order, inner, outer, count):
    """First k with J'(k r1) Y'(k r2) = J'(k r2) Y'(k r1)."""

    def f(k):
        return jvp(order, k * inner) * yvp(order, k * outer) - jvp(order, k * outer) * yvp(order, k * inner)

    k = np.linspace(1e-3, 0.5, 4000)
    change = np.flatnonzero(np.diff(np.sign(f(k))))
    return np.array([brentq(f, k[i], k[i + 1]) for i in change[:count]])


def basin_frequencies(count):
    """omega/c of modes cos(3 m angle) R(r) cos(mu z), Neumann on all walls and zero at the surface."""
    across = np.concatenate([[0.0]] + [radial_roots(3 * m, R1, R2, 4) for m in range(4)])
    mu = (np.arange(1, 5) - 0.5) * np.pi / DEPTH
    return np.sort(np.sqrt(across[:, None] ** 2 + mu**2).ravel())[:count]


@pytest.mark.parametrize(("element", "rate", "n"), [("hex8", 1.9, 4), ("tet10", 3.7, 3), ("hex27", 3.9, 3)])
def test_basin_between_arcs_has_the_frequencies_of_bessel_functions(element, rate, n, tmp_path):
    """Three lowest omega^2 of a closed sector: errors fall as h^2 and h^4."""
    exact, errors = (SOUND * basin_frequencies(3)) ** 2, []
    for count in (n, 2 * n):
        waves = reservoir_waves(basin(tmp_path, element, count))
        omega2 = np.sort(eigsh(waves.K, 3, waves.M, sigma=0.0, v0=np.ones(waves.M.shape[0]))[0])
        errors.append(np.abs(omega2 / exact - 1.0).max())
    assert np.log2(errors[0] / errors[1]) > rate
    assert errors[1] < (0.015 if rate < 2.0 else 5e-4)


@pytest.mark.parametrize("element", ["hex20", "tet10"])
def test_arch_that_moves_outward_meets_bessel_functions(element, tmp_path):
    """Radial force of unit radial acceleration of an arc, on other facets than the water's, within 0.4 %.

    p = sum b_n f_n(r) cos(mu_n z) with f = I0(k r) K1(k r1) + K0(k r) I1(k r1), k^2 = mu^2 - w^2/c^2, and
    b_n f_n'(r2) = -2 rho (-1)^(n + 1)/(mu_n d): below and above the first frequency of the basin.
    """
    scene = basin(tmp_path, element, 5)
    waves, points = reservoir_waves(scene), scene.blocks["a"].points
    radial = points * [1.0, 1.0, 0.0] / np.linalg.norm(points[:, :2], axis=1)[:, None]
    swept = waves.at_dam @ (waves.coupling["a"] @ radial.ravel())
    n, first = np.arange(1, 60), np.pi * SOUND / (2.0 * DEPTH)
    mu, sign = (n - 0.5) * np.pi / DEPTH, (-1.0) ** (n + 1)
    for omega in first * np.array([0.3, 0.7, 0.9, 1.1, 1.3, 1.7]):
        x = splu(csc_matrix(waves.K - omega**2 * waves.M)).solve(swept)  # undamped: in phase
        found = swept @ x
        k = np.sqrt(mu**2 - omega**2 / SOUND**2 + 0j)
        f = iv(0, k * R2) * kv(1, k * R1) + kv(0, k * R2) * iv(1, k * R1)
        slope = k * (iv(1, k * R2) * kv(1, k * R1) - kv(1, k * R2) * iv(1, k * R1))
        exact = 1000.0 * np.pi / 3.0 * R2 * (2.0 / DEPTH * sign**2 / mu**2 * f / slope).sum()
        assert found == pytest.approx(exact.real, rel=0.004, abs=1e5)  # of 4e7 statically


def trough(points):
    """x from 0 to 1 runs along the half circle below the surface, z from 0 to 1 inward from R2 to R1."""
    angle, r = np.pi * (points[:, 0] - 1.0), R2 + (R1 - R2) * points[:, 2]
    return np.stack([r * np.cos(angle), points[:, 1], r * np.sin(angle)], axis=1)


def test_channel_beyond_the_end_has_the_cut_offs_of_its_section(tmp_path):
    """Half a ring, sin(m angle) R(r): cut-offs of the modes that leave at the end, within 0.2 %."""
    dam = box((0, 0, 0), (1, 4, 1), (1 / 8, 4, 1 / 4), "hex20", trough)
    water = box((0, -8, 0), (1, 8, 1), (1 / 10, 4, 1 / 5), "hex27", trough)
    files = [
        written(tmp_path / f"{k}.msh", b, "ymin", "zmin", "zmax") for k, b in (("dam", dam), ("water", water))
    ]
    mesh = {"file": files[1], "end": "ymin", "bottom": ["zmin", "zmax"]}
    keys = {"level": 0.0, "faces": [{"block": "a", "face": "ymin"}], "model": "compressible", "mesh": mesh}
    blocks = {"a": {"material": "c", "mesh": {"file": files[0]}}}
    supports = [{"block": "a", "face": plane("y", 4.0)}]
    scene, _ = job(keys, {}, blocks=blocks, supports=supports, joints={})
    found = np.sqrt(np.sort(reservoir_waves(scene).drive.k)) / SOUND
    exact = np.sort(np.concatenate([radial_roots(m, R1, R2, 2) for m in range(1, 8)]))
    np.testing.assert_allclose(found[:6], exact[:6], rtol=2e-3)


def sloping(points):
    """The floor rises from the dam's foot to half its depth 60 m upstream."""
    depth = (H - points[:, 2]) * (1.0 + points[:, 1] / 120.0)
    return np.stack([points[:, 0], points[:, 1], H - depth], axis=1)


def test_sloping_bottom_that_takes_waves_up_converges(tmp_path):
    """A wedge before a shallower channel: linear elements approach fine quadratic ones with order 2."""
    omega, found = FIRST * np.array([0.3, 0.7, 1.2, 1.7]), []
    for element, edges in (("hex8", (4, 7.5, 5)), ("hex8", (4, 3.75, 2.5)), ("hex20", (4, 3, 2))):
        file = written(tmp_path / "w.vtu", box((0, -60, 0), (4, 60, H), edges, element, sloping))
        keys = {"bottom_reflection": 0.5, "mesh": {"file": file, "end": plane("y", -60.0)}}
        scene, _ = wall("compressible", **keys)
        found.append(force(scene, reservoir_waves(scene), omega))
    coarse, fine = (np.abs(f / found[-1] - 1.0).max() for f in found[:2])
    assert np.log2(coarse / fine) > 1.8 and fine < 0.01


def two(tmp_path, model="compressible", edges=1.25, element="tet10", **keys):
    """Two blocks whose facets match neither each other's nor the water's, which rises upstream."""
    boxes = {"a": ([0, 0, 0], [2, 2, 8], 2.0), "b": ([2, 0, 0], [3, 2, 8], [1.0, 1.0, 1.0])}

    def rising(points):
        depth = (7.5 - points[:, 2]) * (1.0 + points[:, 1] / 20.0)
        return np.stack([points[:, 0], points[:, 1], 7.5 - depth], axis=1)

    file = written(tmp_path / "w.vtu", box((0, -10, 0), (5, 10, 7.5), edges, element, rising))
    faces = [{"block": b, "face": "ymin"} for b in boxes]
    water = {"level": 7.5, "faces": faces, "model": model, "mesh": {"file": file, "end": plane("y", -10.0)}}
    nodes = {"nodes": {"top": {"block": "a", "at": [0, 0, 8]}}}
    joints = {"a-b": {"between": ["a", "b"], "normal_stiffness": "16 GPa/m", "discretization": "mortar"}}
    return job(water | keys, boxes, joints=joints, outputs=nodes)


@pytest.mark.parametrize(("element", "edges"), [("hex8", 2.5), ("tet10", 2.5)])
def test_vertical_motion_presses_like_heavier_water_on_facets_that_do_not_match(element, edges, tmp_path):
    """p = rho a (level - z) is in the elements' space: exact forces, the level within facets."""
    mesh = {"file": str(tmp_path / "w.vtu"), "end": "closed"}
    scene, _ = two(tmp_path, "incompressible", edges, element, mesh=mesh)
    water = added_mass(scene)
    for name, width in (("a", 2.0), ("b", 3.0)):
        rigid = np.tile(np.eye(3), (len(scene.blocks[name].points), 1))
        pressed = rigid.T @ (water.coupling[name].T @ water.ground[:, 2])
        np.testing.assert_allclose(pressed, [0.0, -1000.0 * width * 7.5**2 / 2.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("end", [plane("y", -10.0), "closed"])
def test_own_reservoir_reduced_and_full_order_agree_and_their_ledgers_close(end, tmp_path):
    """Slow, heavy water with absorption beside two blocks, with and without radiation: within 1 % in L2."""
    slow = {"sound_speed": 300.0, "bottom_reflection": 0.7, "cutoff": 60.0, "density": 3000.0}
    mesh = {"file": str(tmp_path / "w.vtu"), "end": end}
    agree(*two(tmp_path, **slow, edges=2.5, mesh=mesh), share=0.6, damped=0.1)


def test_dam_and_water_of_one_file_that_share_their_nodes(tmp_path):
    """Groups of one mesh: the same added mass as of two files, and nothing of the file is left over."""
    whole = box((0, -6, 0), (2, 8, 4), (1, 1, 1))
    is_water = whole.points[whole.cells].mean(axis=1)[:, 1] < 0.0
    parts = [("hexahedron", whole.cells[some]) for some in (is_water, ~is_water)]
    tags = [np.full(len(cells), k) for k, (_, cells) in enumerate(parts, start=1)]
    fields = {"water": np.array([1, 3]), "a": np.array([2, 3])}
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    file = {"file": str(tmp_path / "both.msh")}
    meshio.Mesh(whole.points, parts, cell_data=data, field_data=fields).write(file["file"], "gmsh22")
    alone = {"file": written(tmp_path / "w.vtu", box((0, -6, 0), (2, 6, 4), (1, 1, 1)))}
    blocks, masses = {"a": {"material": "c", "mesh": file | {"group": "a"}}}, []
    for mesh in (file | {"group": "water"}, alone):
        water = {"level": 4.0, "faces": [{"block": "a", "face": plane("y", 0.0)}], "model": "incompressible"}
        water["mesh"] = mesh | {"end": plane("y", -6.0)}
        supports = [{"block": "a", "face": plane("z", 0.0)}]
        scene = job(water, {}, blocks=blocks, supports=supports, joints={})[0]
        mass = added_mass(scene)
        masses.append(mass.coupling["a"].T @ mass.times(mass.coupling["a"].toarray()))
        assert any("belong to no block" in remark for remark in scene.remarks) == (mesh is alone)
    np.testing.assert_allclose(masses[0], masses[1], atol=1e-9 * masses[0].max())


def test_content_of_the_file_and_not_its_name_is_what_a_model_is_known_by(tmp_path):
    keys = []
    for name, edges in (("one", 2.5), ("two", 2.5), ("three", 1.25)):
        (tmp_path / name).mkdir()
        keys.append(fingerprint(two(tmp_path / name, edges=edges)[0].find(Reservoir)))
    assert keys[0] == keys[1] != keys[2]


JOB = """
materials: {{concrete: {{E: 30 GPa, nu: 0.18, rho: 2440 kg/m3}}}}
blocks:
  dam: {{material: concrete, mesh: {{file: dam.msh}}}}
supports: [{{block: dam, face: {{axis: z, at: 0 m}}}}]
water:
  level: 36 m
  faces: [{{block: dam, face: ymin}}]
  model: compressible
  bottom_reflection: 0.8
  cutoff: 20 Hz
  mesh: {{file: water.msh, unit: cm, end: ymin, bottom: [zmin]}}
damping: {{rayleigh: {{frequencies: [2 Hz, 20 Hz], ratio: 5 %}}}}
records: [{{file: r.txt, unit: m/s2, dt: 0.01 s, components: {{y: 1}}}}]
model: {{order: {order}, modes: 20}}
transient: {{finest_step: 5 ms}}
outputs: {{output_interval: 0.01 s, nodes: {{crest: {{block: dam, at: [0, 0, 40]}}}}}}
"""


def test_job_with_a_dam_and_a_reservoir_of_files(tmp_path):
    """Faces by name, another unit, reduced and full order: crest motion within 1 %, the ledger closes."""
    written(tmp_path / "dam.msh", box((0, 0, 0), (4, 10, 40), (4, 5, 5), "hex20"), "ymin")
    water = box((0, -80, 0), (4, 80, 36), (4, 8, 6), "tet10", lambda x: 100.0 * sloping_half(x))
    written(tmp_path / "water.msh", water, "ymin", "zmin")
    t = 0.01 * np.arange(300)
    np.savetxt(tmp_path / "r.txt", 2.0 * np.sin(12.0 * t) * np.sin(np.pi * t / 3.0) ** 2)
    crest = {}
    for order in ("reduced", "full"):
        (tmp_path / f"{order}.yaml").write_text(JOB.format(order=order))
        outcome = romdam.run(romdam.load_config(tmp_path / f"{order}.yaml"), tmp_path / order)
        with romdam.open_result(outcome.paths[0]).dataset as result:
            crest[order] = result.displacement.sel(node="crest").values
            assert np.abs(result.energy_residual).max() < 1e-9 * np.abs(result.energy_input).max()
    assert np.linalg.norm(crest["reduced"] - crest["full"]) < 0.01 * np.linalg.norm(crest["full"])
    assert np.abs(crest["full"]).max() > 1e-4


def sloping_half(points):
    """The floor rises by half over 80 m, below a level of 36 m."""
    depth = (36.0 - points[:, 2]) * (1.0 + points[:, 1] / 160.0)
    return np.stack([points[:, 0], points[:, 1], 36.0 - depth], axis=1)


def moved(x=0.0, y=0.0, z=0.0):
    return lambda points: points + np.array([x, y, z])


def test_overlap_lets_water_lie_on_some_of_the_dam(tmp_path):
    """Water on 0.7 m of a wall 2 m wide, beside it rock: 0.35 of the force, vertical motion."""
    file = written(tmp_path / "w.msh", box((0, -6, 0), (2, 6, 4), (1, 1.5, 1), "hex8", moved(x=1.3)), "ymin")
    mesh = {"file": file, "end": "ymin", "bottom": [], "overlap": 0.3}
    keys = {"level": 4.0, "faces": [{"block": "a", "face": "ymin"}], "model": "incompressible", "mesh": mesh}
    scene, _ = job(keys, {"a": ([0, 0, 0], [2, 2, 6], 1.0)})
    water, rigid = added_mass(scene), np.tile(np.eye(3), (len(scene.blocks["a"].points), 1))
    pressed = rigid.T @ (water.coupling["a"].T @ water.ground[:, 2])
    np.testing.assert_allclose(pressed, [0.0, -1000.0 * 0.7 * 4.0**2 / 2.0, 0.0], atol=1e-6)


def test_what_was_taken_for_what_is_said(tmp_path, caplog):
    """Coverage, walls that take waves up, and the frequency that the mesh resolves: c/(10 * 6 m)."""
    file = written(tmp_path / "w.msh", box((0, -6, 0), (2, 6, 4), (1, 6, 1)), "ymin")
    water = {"level": 4.0, "faces": [{"block": "a", "face": "ymin"}], "model": "compressible"}
    with caplog.at_level(logging.INFO, "romdam.scene.reservoir"):
        job(water | {"mesh": {"file": file, "end": "ymin"}}, {"a": ([0, 0, 0], [2, 2, 6], 1.0)})
    assert "the water's mesh lies on 1 of the 8 m2 of the dam's wet faces, at most 0 m apart" in caplog.text
    assert "2 walls that lean more than 10 degrees, 12 m2, reflect as `bottom_reflection`" in caplog.text
    assert "edges are up to 6 m long, so that waves up to 24 Hz have 10 nodes in their length" in caplog.text


def test_water_that_no_surface_bounds_is_refused(tmp_path):
    parts = [box((0, -6, 0), (2, 6, 4), 2.0), box((0, -6, -6), (2, 6, 4), 2.0)]
    cells = np.vstack([parts[0].cells, parts[1].cells + len(parts[0].points)])
    both = replace(parts[0], points=np.vstack([p.points for p in parts]), cells=cells, faces={})
    mesh = {"file": written(tmp_path / "w.vtu", both), "end": "closed"}
    water = {"level": 4.0, "faces": [{"block": "a", "face": "ymin"}], "model": "compressible", "mesh": mesh}
    with pytest.raises(ConfigError, match=r"1 of the 2 parts .* no free surface, .* about \(1, -3, -4\)"):
        job(water, {"a": ([0, 0, 0], [2, 2, 6], 1.0)})


def falling(points):
    """The surface is level for 3 m, then it falls."""
    return points * np.column_stack(
        [np.ones((len(points), 2)), 1.0 + 0.05 * np.minimum(points[:, 1] + 3.0, 0.0)]
    )


@pytest.mark.parametrize(
    ("bend", "keys", "says"),
    [
        (moved(y=-5.0), {}, "does not touch the wet faces of block 'a': the smallest distance of their"),
        (moved(x=1.0), {}, "lies on 4 of the 8 m2 of the wet faces"),
        (moved(z=-1.0), {}, "free surface must lie at water.level, 4 m (within 0.0004 m; 0 of its"),
        (moved(), {"unit": "cm"}, "reaches from 0 to 0.04 m, and its free surface must lie at water.level"),
        (falling, {}, "free surface is not level: 4 facets look up"),
        (moved(), {"end": None}, "water.mesh.end is missing and has no default; add it: beyond which face"),
        (moved(), {"end": "up"}, "water.mesh.end: block 'reservoir' has no face 'up'; its faces are ymin"),
        (moved(), {"end": plane("y", -7.0)}, "water.mesh.end: the plane y = -7 m catches no node"),
        (moved(), {"end": plane("z", 0.0)}, "the end must be an upright plane, beyond which"),
        (moved(), {"bottom": ["zmax"]}, "8 facets are both on the surface and on the bottom"),
        (moved(), {"file": "none.msh"}, "no mesh file"),
        (lambda x: x * [1.0, 1.0, 0.0] + [0.0, 0.0, 4.0], {}, "limit above 0 (32 such elements here)"),
        (moved(), {"water.length": 30.0}, "length: of a reservoir without `mesh`, the mesh ends where"),
        (moved(), {"water.bottom": 0.0}, "bottom: of a reservoir without `mesh`, name the floor's"),
        (moved(), {"water.model": "westergaard"}, "mesh: Westergaard's pressure knows no reservoir"),
    ],
)  # fmt: skip
def test_what_is_no_reservoir_of_this_dam_is_refused(bend, keys, says, tmp_path):
    block = box((0, -6, 0), (2, 6, 4), (1, 1.5, 1), "hex8", bend)
    mesh = {"file": written(tmp_path / "w.msh", block, "ymin", "zmax"), "end": "ymin"}
    mesh |= {key: value for key, value in keys.items() if "." not in key}
    mesh = {key: value for key, value in mesh.items() if value is not None}
    water = {"level": 4.0, "faces": [{"block": "a", "face": "ymin"}], "model": "compressible", "mesh": mesh}
    water |= {key.removeprefix("water."): value for key, value in keys.items() if "." in key}
    with pytest.raises((ConfigError, MeshError)) as caught:
        job(water, {"a": ([0, 0, 0], [2, 2, 6], 1.0)})
    assert says in str(caught.value) and str(caught.value).startswith("s.yaml: water")
