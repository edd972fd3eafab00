"""Temperature fields against closed forms: bending, restraint, Timoshenko's ring, a slab."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.sparse.linalg import spsolve

from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig
from romdam.core.errors import ConfigError
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import assemble
from romdam.fem.loads import static_force
from romdam.fem.sections import initial_section_forces, section_operators
from romdam.fem.stress import _recovered, stress_operators, thermal_stress
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.scene.temperature import YEAR, slab_weights
from romdam.timestepping.equilibrium import static_equilibrium

E, NU, ALPHA = 30e9, 0.2, 1e-5
SIDES = {"upstream": {"axis": "y", "at": 0.0}, "downstream": {"axis": "y", "at": 2.0}}
HEIGHT, THICK = 20.0, 2.0  # of the pillar, 1 m wide along x, upstream at y = 0


def job(folder, table, load, **changes):
    """A pillar of two elements through its thickness, with a table of temperatures."""
    if table is not None:
        (folder / "t.csv").write_text(table)
    box = {"origin": [0, 0, 0], "size": [1, THICK, HEIGHT], "element_size": 1.0, "element": "hex20"}
    return {
        "materials": {"c": {"E": E, "nu": NU, "rho": 2400.0, "expansion": ALPHA}},
        "blocks": {"a": {"material": "c", "box": box}},
        "supports": [{"block": "a", "face": "zmin"}],
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"order": "full"},
        "transient": {"finest_step": 0.01},
        "loads": {"temperature": [load]},
        "outputs": {"stress": {"blocks": ["a"]}},
    } | changes


def build(folder, table, load, **changes):
    return build_scene(parse_config(job(folder, table, load, **changes), "s.yaml"), folder, "s.yaml")


def at_rest(scene, held=None):
    """Displacement of the one block under its static loads (n, 3), and its stress (n, 6)."""
    held = scene.fixed["a"] if held is None else held
    free = ~held.ravel()
    K, u = assemble(scene.blocks["a"])[0], np.zeros(free.size)
    u[free] = spsolve(K[free][:, free].tocsc(), static_force(scene, "a").ravel()[free])
    stress = (stress_operators(scene)["a"] @ u).reshape(-1, 6) + thermal_stress(scene)["a"]
    return u.reshape(-1, 3), stress


def node_at(points, place):
    return int(np.argmin(np.abs(points - np.array(place)).sum(axis=1)))


def three_points(points):
    """Six components of three corners of the foot, which hold no strain back."""
    held = np.zeros_like(points, dtype=bool)
    held[node_at(points, [0, 0, 0])] = True
    held[node_at(points, [1, 0, 0]), 1:] = True
    held[node_at(points, [0, 2, 0]), 2] = True
    return held


def faces(**keys):
    return {"faces": {"table": "t.csv", "unit": "degC"} | SIDES | keys}


ACROSS = "elevation,upstream,downstream\n0,6,16\n20,6,16\n"  # 10 K warmer downstream


def test_a_free_pillar_bends_without_stress(tmp_path):
    """Curvature alpha dT / h; the tip moves alpha dT L^2 / (2 h) to the cold side, and mean alpha dT L up."""
    scene = build(tmp_path, ACROSS, faces() | {"reference": "8 degC"})
    points = scene.blocks["a"].points
    change = -2.0 + 10.0 * points[:, 1] / THICK
    np.testing.assert_allclose(scene.loads.warmed["a"], change, atol=1e-9)
    kappa, mean = ALPHA * 10.0 / THICK, ALPHA * 3.0
    x, y, z = points[:, 0] - 0.5, points[:, 1] - 1.0, points[:, 2]
    exact = np.stack(
        [
            mean * x + kappa * x * y,
            mean * y + kappa * (y**2 - x**2 - z**2) / 2,
            mean * z + kappa * y * z,
        ],
        axis=1,
    )
    K = assemble(scene.blocks["a"])[0]
    force = static_force(scene, "a").ravel()
    assert np.abs(K @ exact.ravel() - force).max() < 1e-9 * np.abs(force).max()
    stress = (stress_operators(scene)["a"] @ exact.ravel()).reshape(-1, 6) + thermal_stress(scene)["a"]
    assert np.abs(stress).max() < 1e-6 * E * ALPHA * 10.0
    u, stress = at_rest(scene, three_points(points))
    tip = node_at(points, [0, 0, HEIGHT])
    assert u[tip, 1] == pytest.approx(-kappa * HEIGHT**2 / 2, rel=1e-6)
    assert np.abs(stress).max() < 1e-6 * E * ALPHA * 10.0


def test_linear_elements_that_resist_bending_are_told_of(tmp_path):
    """They are: the tip moves by a third of what it should where elements are long."""
    box = {"origin": [0, 0, 0], "size": [1, THICK, HEIGHT], "element_size": [1.0, 1.0, 5.0]}
    blocks = {"a": {"material": "c", "box": box | {"element": "hex8"}}}
    scene = build(tmp_path, ACROSS, faces() | {"reference": "8 degC"}, blocks=blocks)
    assert "loads.temperature: a of linear elements, which resist the bending" in " ".join(scene.remarks)
    points = scene.blocks["a"].points
    u, _ = at_rest(scene, three_points(points))
    tip = u[node_at(points, [0, 0, HEIGHT]), 1]
    assert tip == pytest.approx(-0.3 * ALPHA * 10.0 / THICK * HEIGHT**2 / 2, rel=0.02)
    for told, table in (
        (build(tmp_path, ACROSS, faces() | {"reference": "8 degC"}), "quadratic"),
        (build(tmp_path, None, {"change": 5.0}, blocks=blocks), "uniform"),
    ):
        assert "resist the bending" not in " ".join(told.remarks), table


def test_a_column_between_two_foundations(tmp_path):
    """sigma = -E alpha dT of the mean, +-E alpha dT / 2 of the gradient, N and M of the section."""
    section = {"sections": {"mid": {"blocks": ["a"], "point": [0, 0, 10.0], "normal": [0, 0, 1]}}}
    stress_of = {"outputs": {"stress": {"blocks": ["a"]} | section}}
    scene = build(tmp_path, ACROSS, faces() | {"reference": "8 degC"}, **stress_of)
    points = scene.blocks["a"].points
    held = three_points(points)
    held[(points[:, 2] == 0.0) | (points[:, 2] == HEIGHT), 2] = True
    u, stress = at_rest(scene, held)
    middle = points[:, 2] == 10.0
    expected = -E * ALPHA * (-2.0 + 10.0 * points[middle, 1] / THICK)
    worst = np.abs(stress[middle, 2] - expected).max() / np.abs(expected).max()
    print("column", worst)
    assert worst < 1e-6
    forces = (section_operators(scene)["a"] @ u.ravel()).reshape(-1, 6)
    forces = forces + initial_section_forces(scene, {"a": np.zeros_like(points)})["a"]
    assert forces[0, 0] == pytest.approx(-E * ALPHA * 3.0 * THICK, rel=1e-6)
    moment = E * ALPHA * 10.0 / THICK * THICK**3 / 12
    assert np.linalg.norm(forces[0, 4:]) == pytest.approx(moment, rel=1e-6)


def test_a_clamped_plate(tmp_path):
    """Edges clamped: M = E alpha dT h^2 / (12 (1 - nu)), sigma = E alpha dT / (2 (1 - nu)), no deflection."""
    box = {"origin": [0, 0, 0], "size": [12, THICK, 12], "element_size": [2.0, 1.0, 2.0], "element": "hex20"}
    edges = [{"block": "a", "face": face, "fix": ["x", "z"]} for face in ("xmin", "xmax", "zmin", "zmax")]
    edges += [{"block": "a", "face": "ymin", "fix": ["y"]}]
    table = "elevation,upstream,downstream\n0,3,13\n12,3,13\n"
    plate = {"a": {"material": "c", "box": box}}
    scene = build(tmp_path, table, faces() | {"reference": "8 degC"}, supports=edges, blocks=plate)
    u, stress = at_rest(scene)
    side = E * ALPHA * 10.0 / (2 * (1 - NU))
    y = scene.blocks["a"].points[:, 1]
    for component in (0, 2):
        np.testing.assert_allclose(stress[:, component], side * (1.0 - y), atol=1e-6 * side)
    assert np.abs(u[:, [0, 2]]).max() < 1e-12


def test_a_thick_ring(tmp_path):
    """Logarithmic temperature from a to b (Timoshenko, Goodier, art. 150), plane strain."""
    inner, outer, n, m, high = 8.0, 16.0, 12, 16, 2.0
    text, points = _ring_mesh(inner, outer, n, m, high)
    (tmp_path / "ring.inp").write_text(text)
    r = np.hypot(points[:, 1], points[:, 2])
    warm = 10.0 * np.log(outer / r) / np.log(outer / inner) + 8.0
    rows = "".join(f"{k + 1},{float(t)!r}\n" for k, t in enumerate(warm))
    blocks = {"a": {"material": "c", "mesh": {"file": "ring.inp"}}}
    supports = [
        {"block": "a", "face": {"axis": axis, "at": at, "tolerance": 1e-6}, "fix": [axis]}
        for axis, at in (("x", 0.0), ("x", high), ("y", 0.0), ("z", 0.0))
    ]
    load = {"nodes": {"table": "t.csv", "unit": "degC"}, "reference": "8 degC"}
    scene = build(tmp_path, "node,temperature\n" + rows, load, blocks=blocks, supports=supports)
    points = scene.blocks["a"].points
    r = np.hypot(points[:, 1], points[:, 2])
    np.testing.assert_allclose(scene.loads.warmed["a"], 10 * np.log(outer / r) / np.log(2.0), atol=1e-9)
    _, stress = at_rest(scene)
    ratio = inner**2 / (outer**2 - inner**2)
    unit = E * ALPHA * 10.0 / (2 * (1 - NU) * np.log(outer / inner))
    radial = unit * (-np.log(outer / r) - ratio * (1 - outer**2 / r**2) * np.log(outer / inner))
    hoop = unit * (1 - np.log(outer / r) - ratio * (1 + outer**2 / r**2) * np.log(outer / inner))
    along = NU * (radial + hoop) - E * ALPHA * 10 * np.log(outer / r) / np.log(outer / inner)
    c, s = points[:, 1] / r, points[:, 2] / r
    xx, yy, zz, xy, yz, xz = stress.T
    found = {
        "radial": yy * c * c + zz * s * s + 2 * yz * s * c,
        "hoop": yy * s * s + zz * c * c - 2 * yz * s * c,
        "along": xx,
    }
    for name, exact in (("radial", radial), ("hoop", hoop), ("along", along)):
        worst = np.abs(found[name] - exact).max() / np.abs(hoop).max()
        print("ring", name, worst)
        assert worst < 0.005, name
    assert np.abs([xy, xz]).max() < 1e-3 * np.abs(hoop).max()


def _ring_mesh(inner, outer, n, m, high):
    """A quarter of a ring about x, hex20 in Abaqus' order."""
    grid, nodes, lines = {}, [], []

    def node(i, j, k):
        if (i, j, k) not in grid:
            r, angle = inner * (outer / inner) ** (i / (2 * n)), np.pi / 2 * j / (2 * m)
            nodes.append([high * k / 2, r * np.cos(angle), r * np.sin(angle)])
            nodes[-1] = [0.0 if abs(v) < 1e-12 else float(v) for v in nodes[-1]]
            grid[i, j, k] = len(nodes)
        return grid[i, j, k]

    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    local = np.array(corners + [tuple((np.array(corners[a]) + corners[b]) // 2) for a, b in edges])
    for i in range(n):
        for j in range(m):
            lines.append([node(*(np.array([2 * i, 2 * j, 0]) + at)) for at in local])
    text = "*NODE\n" + "".join(f"{k}, {x!r}, {y!r}, {z!r}\n" for k, (x, y, z) in enumerate(nodes, start=1))
    text += "*ELEMENT, TYPE=C3D20\n"
    for k, line in enumerate(lines, start=1):
        text += f"{k}, " + ", ".join(map(str, line[:15])) + ",\n" + ", ".join(map(str, line[15:])) + "\n"
    return text, np.array(nodes)


@pytest.mark.parametrize("thickness", [1.0, 6.0, 40.0])
def test_conduction_in_a_slab(thickness):
    """Crank-Nicolson for a quarter of a year, faces of two phases; mean and moment by quadrature."""
    a, n, steps = 1e-6, 200, 1000
    u, d = 5.0 * np.exp(0.4j), 12.0 * np.exp(-0.7j)
    s, dt = np.linspace(0, 1, n + 1), YEAR / steps
    second = np.diag(-2 * np.ones(n - 1)) + np.diag(np.ones(n - 2), 1) + np.diag(np.ones(n - 2), -1)
    second *= a * dt / 2 * (n / thickness) ** 2
    edge, forward = a * dt / 2 * (n / thickness) ** 2, np.eye(n - 1) + second
    step, T = np.linalg.inv(np.eye(n - 1) - second), np.zeros(n - 1)
    weights = slab_weights(s, np.full_like(s, thickness), YEAR, a, "harmonic")
    T = (u * weights[0] + d * weights[1]).real[1:-1]  # periodic from the start, if it is right
    for k in range(steps // 4):
        rhs = forward @ T
        for time in (k, k + 1):
            rhs[0] += edge * (u * np.exp(2j * np.pi * time / steps)).real
            rhs[-1] += edge * (d * np.exp(2j * np.pi * time / steps)).real
        T = step @ rhs
    quarter = ((u * weights[0] + d * weights[1]) * 1j).real[1:-1]
    print(np.abs(T - quarter).max())
    assert np.abs(T - quarter).max() < 2e-3 * 12.0

    def at(x, part):
        w = slab_weights(np.array([x]), np.array([thickness]), YEAR, a, "harmonic")
        return getattr((u * w[0] + d * w[1])[0], part)

    w = slab_weights(np.array([0.0, 1.0]), np.full(2, thickness), YEAR, a, "equivalent")
    ends = u * w[0] + d * w[1]
    for part in ("real", "imag"):
        mean = quad(lambda x, p=part: at(x, p), 0, 1, limit=200)[0]
        moment = 12 * quad(lambda x, p=part: at(x, p) * (x - 0.5), 0, 1, limit=200)[0]
        assert getattr(ends.mean(), part) == pytest.approx(mean, rel=1e-6, abs=1e-8)
        assert getattr(ends[1] - ends[0], part) == pytest.approx(moment, rel=1e-6, abs=1e-8)


def test_twelve_months_through_the_thickness(tmp_path):
    """Faces 10 + 8 cos, 10 + 4 cos: the sum of the harmonics is the slab's own one; faces keep theirs."""
    phase = 2 * np.pi * np.arange(12) / 12
    rows = (
        "".join(
            f"{k + 1},{z},{10 + 8 * np.cos(p - 0.5)!r},{12 + 4 * np.cos(p - 1.0)!r}\n"
            for k, p in enumerate(phase)
            for z in (0, 20)
        )
        .replace("np.float64(", "")
        .replace(")", "")
    )
    table = "month,elevation,upstream,downstream\n" + rows
    for through in ("linear", "equivalent", "harmonic"):
        keys = {} if through == "linear" else {"diffusivity": "1e-6 m2/s"}
        load = faces(through=through, **keys) | {"month": 8, "reference": "10 degC"}
        scene = build(tmp_path, table, load)
        s = scene.blocks["a"].points[:, 1] / THICK
        if through == "linear":
            w = 1 - s, s
        else:
            w = slab_weights(s, np.full_like(s, THICK), YEAR, 1e-6, through)
        turned = (8 * np.exp(-0.5j) * w[0] + 4 * np.exp(-1j) * w[1]) * np.exp(1j * phase[7])
        np.testing.assert_allclose(scene.loads.warmed["a"], 2 * s + turned.real, atol=1e-9)


@pytest.mark.parametrize("through", ["equivalent", "harmonic"])
def test_twelve_unlike_months_through_a_slab_that_conducts_at_once(tmp_path, through):
    """All seven harmonics of an arbitrary year add up to the month's own straight line between the faces."""
    upstream = [4.0, 9.5, 3.0, 12.0, 7.5, 16.0, 21.0, 15.5, 18.0, 6.0, 11.0, 2.5]
    downstream = [1.0, -6.0, 8.0, 5.5, 19.0, 14.0, 27.0, 22.5, 13.0, 17.0, 0.5, 9.0]
    rows = "".join(
        f"{k + 1},{z},{u},{d}\n"
        for k, (u, d) in enumerate(zip(upstream, downstream, strict=True))
        for z in (0, 20)
    )
    for month in (1, 4, 11):
        load = faces(through=through, diffusivity="1 m2/s") | {"month": month, "reference": "10 degC"}
        scene = build(tmp_path, "month,elevation,upstream,downstream\n" + rows, load)
        s = scene.blocks["a"].points[:, 1] / THICK
        line = (1.0 - s) * upstream[month - 1] + s * downstream[month - 1] - 10.0
        np.testing.assert_allclose(scene.loads.warmed["a"], line, atol=1e-4)


def test_points_and_us_units_give_the_same(tmp_path):
    """A linear field by points in feet and Fahrenheit is that of the faces."""
    ft = 0.3048
    corners = [(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 20)]
    rows = "".join(f"{x / ft!r},{y / ft!r},{z / ft!r},{(6 + 5 * y) * 1.8 + 32!r}\n" for x, y, z in corners)
    load = {"points": {"table": "t.csv", "unit": "degF", "length": "ft"}, "reference": "46.4 degF"}
    scene = build(tmp_path, "x,y,z,temperature\n" + rows, load)
    y = scene.blocks["a"].points[:, 1]
    np.testing.assert_allclose(scene.loads.warmed["a"], -2 + 5 * y, atol=1e-8)
    table = f"elevation,upstream,downstream\n0,42.8,60.8\n{20 / ft!r},78.8,60.8\n"  # upstream 6 to 26 degC
    scene = build(tmp_path, table, faces(unit="degF", length="ft") | {"reference": "281.15 K"})
    z = scene.blocks["a"].points[:, 2]
    np.testing.assert_allclose(scene.loads.warmed["a"], -2 + 5 * y + (1 - y / 2) * z, atol=1e-8)


def test_horizontal_distances_of_a_slope(tmp_path):
    """A wedge, turned about z: the place is that along the horizontal, not that along normals."""
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    # upstream vertical, downstream 1 : 0.8, crest 2 m
    nodes = [
        turn @ [x, y, z] for z in (0, 20) for x, y in ((0, 0), (5, 0), (5, 18 - 0.8 * z), (0, 18 - 0.8 * z))
    ]
    text = "*NODE\n" + "".join(f"{k},{p[0]!r},{p[1]!r},{p[2]!r}\n" for k, p in enumerate(nodes, start=1))
    text = text.replace("np.float64(", "").replace(")", "")
    text += "*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n"
    for k, ring in enumerate(((1, 2, 6, 5), (3, 4, 8, 7)), start=2):
        text += f"*ELEMENT, TYPE=S4, ELSET={('up', 'down')[k - 2]}\n{k},{','.join(map(str, ring))}\n"
    (tmp_path / "wedge.inp").write_text(text)
    blocks = {"a": {"material": "c", "mesh": {"file": "wedge.inp", "refine": 2}}}
    load = faces(upstream="up", downstream="down") | {"reference": "0 degC"}
    table = "elevation,upstream,downstream\n20,0,100\n0,0,100\n"
    foot = [{"block": "a", "face": {"axis": "z", "at": 0.0}}]
    scene = build(tmp_path, table, load, blocks=blocks, supports=foot)
    points = scene.blocks["a"].points @ turn
    np.testing.assert_allclose(
        scene.loads.warmed["a"], 100 * points[:, 1] / (18 - 0.8 * points[:, 2]), atol=1e-6
    )


MONTHS = "month,elevation,upstream,downstream\n" + "".join(
    f"{k},{z},5,6\n" for k in range(1, 12) for z in (0, 20)
)
POINTS = {"points": {"table": "t.csv", "unit": "degC"}, "reference": "8 degC"}


@pytest.mark.parametrize(
    ("table", "load", "words"),
    [
        ("elevation,upstream,downstream\n0,1,2\n12,1,2\n", faces(), r"elevations 0 to 12 m, and \d+ of"),
        ("elevation,upstream,downstream\n0,1,2\n9,1,2\n9,1,2\n20,1,1", faces(), "9 m stands beside 9 m"),
        ("elevation,upstream,downstream\n0,1,2\n20,nan,2\n", faces(), "line 3: upstream must be a"),
        ("elevation,upstream,downstream\n0,1,2\n20,-300,2\n", faces(), "line 3: -300 degC is below absolute"),
        ("elevation,upstream\n0,1\n", faces(), "lacks column downstream"),
        (ACROSS, faces() | {"month": 3}, "no column month, and month: 3 is asked for"),
        (MONTHS, faces(), r"has months \(1, 2, 3, .*give `month`"),
        (MONTHS, faces() | {"month": 12}, "no rows of month 12, only of"),
        (MONTHS, faces(through="harmonic", diffusivity=1e-6) | {"month": 3}, "of month 12.*needs all twelve"),
        (MONTHS.replace("\n3,", "\n3.5,"), faces() | {"month": 3}, "line 6: month is 3.5"),
        (ACROSS, faces(upstream="zmin"), "have no point of a face at their elevation"),
        (ACROSS, faces(upstream="up"), r"faces.upstream: block 'a' has no face 'up'"),
        (ACROSS, faces(upstream={"axis": "y", "at": 2.0}, downstream={"axis": "y", "at": 2.0}), "same side"),
        ("x,y,z,temperature\n0,0,0,1\n1,0,0,1\n0,2,0,1\n1,2,20,1\n", POINTS, "nodes of block 'a' lie out"),
        ("x,y,z,temperature\n0,0,0,1\n1,0,0,1\n0,2,0,1\n1,2,0,1\n", POINTS, "span no volume"),
        ("x,y,z,temperature\n0,0,0,1\n0,0,0,2\n0,2,0,1\n1,2,9,1\n", POINTS, "two temperatures at"),
        ("node,temperature\n1,4\n", {"nodes": {"table": "t.csv", "unit": "degC"}}, "no numbers of a mesh"),
        (None, faces(), "t.csv cannot be read"),
    ],
)  # fmt: skip
def test_wrong_tables_are_refused(tmp_path, table, load, words):
    with pytest.raises(ConfigError, match=rf"s\.yaml: loads\.temperature\[0\](?s:.*)({words})"):
        build(tmp_path, table, load | {"reference": "8 degC"})


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ({}, "exactly one of"),
        ({"change": 3.0} | faces(), "exactly one of"),
        ({"change": 3.0, "month": 2}, "`month` belongs to a table"),
        (faces(), "`reference` is missing"),
        (faces() | {"reference": 8.0}, "is no temperature"),
        (faces() | {"reference": "8 K/s"}, "is no temperature"),
        (faces() | {"reference": "-300 degC"}, "limits -273.15"),
        (faces(unit="C") | {"reference": "8 degC"}, "degC"),
        (faces(through="harmonic") | {"reference": "8 degC"}, "`diffusivity` belongs"),
        (faces() | {"reference": {"a": "8 degC"}}, "needs `blocks`"),
        (faces() | {"reference": {"b": "8 degC"}, "blocks": ["a"]}, "no temperature of block 'a'"),
        (faces() | {"month": 13, "reference": "8 degC"}, "month"),
    ],
)
def test_wrong_keys_are_refused(tmp_path, load, words):
    with pytest.raises(ConfigError, match=words):
        build(tmp_path, ACROSS, load)


@pytest.mark.parametrize("weight", ["staged", "monolithic"])
def test_cooled_cantilevers_open_their_joint(tmp_path, weight):
    """Two pillars beside each other, held at the far sides: full order and reduced, opening alpha dT L."""
    (tmp_path / "t.csv").write_text("elevation,upstream,downstream\n0,0,0\n20,0,0\n")
    box = {"size": [5, THICK, HEIGHT], "element_size": [2.5, 1.0, 5.0], "element": "hex20"}
    at = {"a": [0, 0, 0], "b": [5, 0, 0]}
    raw = job(
        tmp_path,
        None,
        faces() | {"reference": {"a": "8 degC", "b": "50 degF"}, "blocks": ["a", "b"]},
        blocks={name: {"material": "c", "box": box | {"origin": origin}} for name, origin in at.items()},
        supports=[
            {"block": "a", "face": "xmin", "fix": ["x"]},
            {"block": "b", "face": "xmax", "fix": ["x"]},
            *({"block": n, "face": {"axis": "y", "at": 0.0}, "fix": ["y"]} for n in at),
            *({"block": n, "face": {"axis": "z", "at": 0.0}, "fix": ["z"]} for n in at),
        ],
        joints={"j": {"between": ["a", "b"], "normal_stiffness": "20 GPa/m", "friction": 0.6,
                      "shear_stiffness": "10 GPa/m", "gaps": "corners"}},
        outputs={},
    )  # fmt: skip
    raw["loads"] |= {"gravity": [0, 0, -9.81], "weight": weight}
    raw["materials"]["c"]["nu"] = 0.0
    scene = build_scene(parse_config(raw, "s.yaml"), tmp_path, "s.yaml")
    expected = 5 * ALPHA * (8 + 10)  # each from its far side on
    for system in (
        assemble_full(scene, DampingConfig()),
        reduce_scene(scene, ModeChoice(count=5), DampingConfig()).system,
    ):
        _, gaps = static_equilibrium(system, 1e-10)
        np.testing.assert_allclose(gaps.jump[:, 0], expected, rtol=1e-8)


def test_a_curved_temperature_is_carried_to_the_nodes_as_stress_is():
    """x^2 over -1 to 1 is 1/3 at the Gauss points of a hex20, and so at all of its nodes; x is itself."""
    scene = build_scene(
        parse_config(
            {
                "materials": {"c": {"E": 30e9, "nu": 0.2, "rho": 2400.0}},
                "blocks": {
                    "a": {
                        "material": "c",
                        "box": {
                            "origin": [-1, 0, 0],
                            "size": [2, 3, 4],
                            "element_size": [2, 3, 4],
                            "element": "hex20",
                        },
                    }
                },
                "supports": [{"block": "a", "face": "zmin"}],
                "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
                "model": {"order": "full"},
                "transient": {"finest_step": 0.01},
            },
            "s.yaml",
        ),
        Path(),
        "s.yaml",
    )
    block = scene.blocks["a"]
    x = block.points[:, 0]
    np.testing.assert_allclose(_recovered(block, x**2), 1 / 3, atol=1e-12)
    np.testing.assert_allclose(_recovered(block, x), x, atol=1e-12)
