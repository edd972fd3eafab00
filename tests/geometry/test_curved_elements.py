"""Quadratic elements of generated dams on arcs and in curvature both ways, against closed forms.

A dam of one cantilever is a sector of a thick cylinder where its profiles are constant, and a piece of a
thick sphere where its radii follow one. Its volume, its answer to pressure and its breathing frequency
converge with the order of the element, which they cannot where middle nodes stand on chords.
"""

import re
from itertools import pairwise

import numpy as np
import pytest
from arch_dams import DIVISIONS as ARCH_DIVISIONS
from arch_dams import JOINTS, arch_dam
from gravity_dams import DIVISIONS as GRAVITY_DIVISIONS
from gravity_dams import gravity_dam
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.sparse import block_diag, csr_matrix
from scipy.sparse.linalg import eigsh, spsolve
from scipy.special import jv, yv

from romdam.core.errors import ConfigError
from romdam.fem.assembly import assemble
from romdam.fem.loads import pressure_force
from romdam.fem.stress import stress_operator
from romdam.geometry.elements import ELEMENTS, jacobians
from romdam.geometry.facets import facet_areas
from romdam.geometry.meshes.quality import sound_volume

OUTER, INNER, ANGLE = 50.0, 35.0, np.radians(40.0)  # radii [m], half the angle of the sector
E, NU, RHO = 28e9, 0.2, 2400.0  # of the concrete of arch_dams
LAM, MU = E * NU / (1 + NU) / (1 - 2 * NU), E / 2 / (1 + NU)
PRESSURE = 1e6


def dam(make, element, divisions, outer, inner, top):
    """One cantilever whose faces have these radii over the elevation, all about the crest's axis."""
    z = np.linspace(0.0, 100.0, 401)
    at_top = 0.5 * (outer(top) + inner(top)) * np.sin(ANGLE)
    shift = float(outer(100.0))
    profile = {
        "upstream": [[float(h), shift - float(outer(h))] for h in z],
        "thickness": [[float(h), float(outer(h) - inner(h))] for h in z],
    }
    along, through, up = divisions
    (block,) = make(
        arch_dam(
            ground=False,
            cantilevers=1,
            joints="tied",
            element=element,
            crown=profile,
            arcs={
                "upstream_radius": [[float(h), float(outer(h))] for h in z],
                "downstream_radius": [[float(h), float(inner(h))] for h in z],
            },
            valley=[[0, at_top], [100, at_top]],
            abutment_height=100.0 - top,
            divisions={"along": along, "through": through, "up": up},
        )
    ).blocks.values()
    centred = block.points - [0.0, shift, 0.0]
    return block, centred


def ring(make, element, divisions):
    """A sector of a thick cylinder, 10 m high."""
    return dam(make, element, divisions, lambda z: OUTER + 0.0 * z, lambda z: INNER + 0.0 * z, 90.0)


SPHERE = 200.0, 170.0  # radii [m]


def cap(make, element, divisions):
    """A piece of a thick sphere around the crest's centre, between 40 and 100 m above its equator."""
    outer, inner = (lambda z, R=R: np.sqrt(R**2 - np.square(z)) for R in SPHERE)
    return dam(make, element, divisions, outer, inner, 40.0)


def orders(errors):
    """Order of convergence of each halving."""
    return [np.log2(a / b) for a, b in pairwise(errors)]


def lame(r, outer, inner, dimension):
    """Radial displacement (u, r A + B r^(1 - dimension)) under a pressure on the outer face; A and B."""
    # sigma_r = a A - b B r^-d, zero at the inner face and -PRESSURE at the outer one
    a = 2 * LAM + 2 * MU if dimension == 2 else 3 * LAM + 2 * MU
    b = 2 * MU if dimension == 2 else 4 * MU
    A, B = np.linalg.solve([[a, -b * inner**-dimension], [a, -b * outer**-dimension]], [0.0, -PRESSURE])
    return A * r + B * r ** (1.0 - dimension), A, B


@pytest.mark.parametrize(
    ("element", "least"), [("hex8", 1.9), ("hex20", 3.8), ("hex27", 3.8), ("tet10", 3.5)]
)
@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (ring, ANGLE * (OUTER**2 - INNER**2) * 10.0),
        (cap, ANGLE * (SPHERE[0] ** 2 - SPHERE[1] ** 2) * 60.0),  # horizontal rings of one area
    ],
)
def test_volume_converges_with_the_order_of_the_element(make, shape, volume, element, least):
    errors = []
    for n in (1, 2, 4):
        block, _ = shape(make, element, (2 * n, 1, n))
        errors.append(abs(sound_volume(block, "s") / volume - 1.0))
    assert min(orders(errors)) > least, errors
    assert element == "hex8" or errors[-1] < 1e-5


def free_of_turning(block, centred):
    """Independent components (3n, m): none across the ends' radial planes nor across top and bottom."""
    angle = np.arctan2(centred[:, 0], -centred[:, 1])
    ends = np.abs(np.abs(angle) - ANGLE) < 1e-9
    flat = np.ptp(block.points[:, 2]) * 1e-9
    level = np.min([np.abs(block.points[:, 2] - z) for z in (block.points[:, 2].min(), 100.0)], axis=0) < flat
    turns = []
    for a, end, held in zip(angle, ends, level, strict=True):
        axes = np.array([[np.sin(a), -np.cos(a), 0.0], [np.cos(a), np.sin(a), 0.0], [0.0, 0.0, 1.0]])
        keep = np.array([True, not end, not held])
        turns.append(csr_matrix(axes[keep].T))
    return csr_matrix(block_diag(turns))


@pytest.mark.parametrize(("element", "least"), [("hex20", 3.0), ("hex27", 3.0), ("tet10", 2.5)])
def test_a_thick_cylinder_under_pressure_is_lames(make, element, least):
    """Plane strain, slipping on the planes that end it; energy, radial displacement and hoop stress."""
    displacement, hoop = [], []
    for n in (1, 2, 4):
        block, centred = ring(make, element, (2 * n, n, 1))
        K = assemble(block)[0]
        T = free_of_turning(block, centred)
        force = pressure_force(block.points, block.faces["upstream"], PRESSURE).ravel()
        u = T @ spsolve((T.T @ K @ T).tocsc(), T.T @ force)
        r = np.hypot(centred[:, 0], centred[:, 1])
        exact, A, B = lame(r, OUTER, INNER, 2)
        direction = np.c_[centred[:, :2] / r[:, None], np.zeros(len(r))]
        difference = u.reshape(-1, 3) - exact[:, None] * direction
        displacement.append(np.linalg.norm(difference) / np.linalg.norm(exact))
        nodes = np.flatnonzero(np.abs(centred[:, 0]) < 1e-9)
        stress = (stress_operator(block, nodes) @ u).reshape(-1, 6)[:, 0]  # at the crown hoops run along x
        right = 2 * (LAM + MU) * A + 2 * MU * B / r[nodes] ** 2
        hoop.append(np.abs(stress / right - 1.0).max())
    assert min(orders(displacement)) > least, displacement
    assert displacement[-1] < 2e-4
    assert min(orders(hoop)) > 1.4, hoop
    assert hoop[-1] < 0.01


@pytest.mark.parametrize(("element", "least"), [("hex20", 2.8), ("tet10", 2.5)])
def test_a_thick_sphere_under_pressure_is_lames(make, element, least):
    """Displacements of the cut faces are the exact ones; those in between follow from the pressure."""
    errors = []
    for n in (1, 2, 4):
        block, centred = cap(make, element, (2 * n, n, n))
        K = assemble(block)[0]
        r = np.linalg.norm(centred, axis=1)
        exact = (lame(r, *SPHERE, 3)[0] / r)[:, None] * centred
        held = np.zeros(len(r), dtype=bool)
        held[np.unique(block.faces["contact"])] = held[np.unique(block.faces["crest"])] = True
        on = np.repeat(held, 3)
        force = pressure_force(block.points, block.faces["upstream"], PRESSURE).ravel()
        u = np.where(on, exact.ravel(), 0.0)
        u[~on] = spsolve(K[~on][:, ~on].tocsc(), (force - K @ u)[~on])
        difference = (u - exact.ravel())[~on]
        errors.append(np.linalg.norm(difference) / np.linalg.norm(exact.ravel()[~on]))
    assert min(orders(errors)) > least, errors
    assert errors[-1] < 1e-4


def breathing(outer, inner):
    """Circular frequency of the lowest axisymmetric mode of a free ring in plane strain."""
    c = np.sqrt((LAM + 2 * MU) / RHO)

    def radial_stress(f, k, r):
        """Of u = f_1(k r), with f_1' = k f_0 - f_1 / r."""
        slope = k * f(0, k * r) - f(1, k * r) / r
        return (LAM + 2 * MU) * slope + LAM * f(1, k * r) / r

    def determinant(k):
        rows = [[radial_stress(f, k, r) for f in (jv, yv)] for r in (inner, outer)]
        return np.linalg.det(rows)

    k = np.linspace(0.2, 1.5, 200) / outer
    values = [determinant(x) for x in k]
    at = next(i for i in range(len(k) - 1) if values[i] * values[i + 1] < 0.0)
    return c * brentq(determinant, k[at], k[at + 1])


@pytest.mark.parametrize("element", ["hex20", "tet10"])
def test_a_ring_breathes_at_the_closed_forms_frequency(make, element):
    omega = breathing(OUTER, INNER)
    # a thin ring: omega = sqrt(E' / rho) / R
    assert omega == pytest.approx(np.sqrt(E / (1 - NU**2) / RHO) / (0.5 * (OUTER + INNER)), rel=0.02)
    errors = []
    for n in (1, 2, 4):
        block, centred = ring(make, element, (2 * n, n, 1))
        K, M = assemble(block)
        T = free_of_turning(block, centred)
        radial = np.c_[centred[:, :2], np.zeros(len(centred))].ravel()
        values, shapes = eigsh(T.T @ K @ T, 4, T.T @ M @ T, sigma=omega**2)
        likeness = np.abs((T @ shapes).T @ (M @ radial))
        errors.append(abs(np.sqrt(values[np.argmax(likeness)]) / omega - 1.0))
    assert min(orders(errors)) > 3.2, errors
    assert errors[-1] < 1e-5


@pytest.mark.parametrize("element", ["hex20", pytest.param("tet10", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("joint", "gaps"), [("corners", 9), ("nodes", 21), ("mortar", 9), ("spacing", 0)])
def test_joint_areas_follow_the_curve_of_the_crown(make, element, joint, gaps):
    """Gaps share the area between the crown's curved faces: Simpson's rule is exact for a cubic."""
    keys = {
        "corners": {"gaps": "corners", "discretization": "node_to_node"},
        "nodes": {"gaps": "nodes", "discretization": "node_to_node"},
        "mortar": {"gaps": "nodes", "discretization": "mortar"},
        "spacing": {"gaps": "corners", "spacing": 20.0},
    }[joint]
    raw = arch_dam(element=element, divisions={"along": 1, "through": 2, "up": 2}, joints=JOINTS | keys)
    z, thickness = np.transpose(raw["arch_dam"]["crown"]["thickness"])
    area = quad(PchipInterpolator(z, thickness), 0.0, 100.0, points=[50.0])[0]
    found = make(raw).joints["J2"]
    if element == "hex20" and gaps:
        assert len(found.area) == gaps
    assert found.area.min() > 0.0
    assert found.area.sum() == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize("element", ["hex20", "hex27", "tet10"])
def test_rock_follows_the_contact_and_keeps_its_box(make, element):
    scene = make(arch_dam(element=element))
    assert ELEMENTS[element].quadratic
    for name, block in scene.blocks.items():
        for face, axis, at in (("base", 2, -120.0), ("side_left", 0, -260.0), ("side_upstream", 1, -160.0)):
            if name.startswith("rock") and face in block.faces:
                assert np.abs(block.points[np.unique(block.faces[face]), axis] - at).max() < 1e-9
    # middle nodes of the upstream face stand on circles about the centres of their elevations
    points = scene.blocks["C1"].points[np.unique(scene.blocks["C1"].faces["upstream"])]
    y = PchipInterpolator([0, 40, 100], [0, -9, -2])(points[:, 2])
    radius = 75.0 + 0.5 * points[:, 2]
    assert np.abs(np.hypot(points[:, 0], points[:, 1] - y - radius) - radius).max() < 1e-9


@pytest.mark.parametrize("along", [16, 22])
def test_rays_that_straddle_an_edge_of_the_rock_leave_no_cell_flat(make, along):
    """Rays of one point of the contact left the box on both sides of its lower edge: cells fell together."""
    scene = make(arch_dam(divisions=ARCH_DIVISIONS | {"along": along, "through": 2}))
    sizes = []
    for name, block in scene.blocks.items():
        if name.startswith("rock"):
            for face in {"base", "side_left", "side_right"} & set(block.faces):
                size = facet_areas(block.points, block.faces[face])
                assert (size > 1e-3).all()
                sizes += [size] * (face == "base")
    assert np.concatenate(sizes).sum() == pytest.approx(520.0 * 380.0, rel=1e-12)  # none is turned over


SPOILED = {
    "40 through": (
        arch_dam(element="hex20", ground=False, divisions={"along": 1, "through": 40, "up": 3}),
        "arch_dam.divisions.through = 40: in block C2 around (-24.77, 0.7027, 85.67) m an element is",
    ),
    "200 up, tetrahedra": (
        arch_dam(element="tet10", ground=False, divisions={"along": 1, "through": 1, "up": 200}),
        "arch_dam.divisions.up = 200: in block C4",
    ),
    "crown of 0.3 m": (
        arch_dam(
            element="hex20",
            ground=False,
            divisions={"along": 1, "through": 4, "up": 2},
            crown={"thickness": [[0, 6], [50, 1], [100, 0.3]]},
        ),
        "raise divisions.along to 7 and raise divisions.up to 14",
    ),
    "middle nodes on a crown that bends": (  # a parabola through 60, 5 and 5 m is negative in between
        arch_dam(
            element="hex20",
            ground=False,
            divisions={"along": 1, "through": 1, "up": 1},
            crown={"thickness": [[0, 60], [50, 5], [100, 5]]},
            arcs={"upstream_radius": 125.0},
        ),
        "arch_dam.divisions.up = 1: in block C2 around (-21.8, 15.84, 56.04) m a curved or skew hex20 is",
    ),
    "tetrahedra on a narrow arc": (
        arch_dam(
            element="tet10",
            ground=False,
            cantilevers=2,
            divisions={"along": 1, "through": 1, "up": 3},
            crown={"upstream": [[0, 0], [40, -9], [100, -2]], "thickness": [[0, 20], [100, 6]]},
            arcs={"upstream_radius": [[0, 40], [100, 56]]},
            valley=[[0, 14], [40, 30], [100, 52]],
            abutment_height=20.0,
        ),
        "in block C1 around",
    ),
    "layers of a perimeter": (
        arch_dam(element="hex8", divisions=ARCH_DIVISIONS | {"perimeter": 60}),
        "arch_dam.divisions.perimeter = 60: in block perimeter around",
    ),
    "rock that grows fast": (
        arch_dam(
            element="hex8",
            divisions=ARCH_DIVISIONS | {"rock": 8, "upstream": 8, "downstream": 8, "growth": 2.8},
        ),
        "arch_dam.divisions.growth = 2.8: in block rock_left around",
    ),
    "refined": (
        arch_dam(element="hex20", ground=False, divisions={"along": 1, "through": 20, "up": 3, "refine": 1}),
        "arch_dam.divisions.through = 20: in block C",
    ),
    "rows of unequal monoliths": (
        gravity_dam(monoliths=[10, 16, 22], divisions=GRAVITY_DIVISIONS | {"through": 100, "up": 2}),
        "gravity_dam.divisions.through = 100: in block monolith_1 around",
    ),
    "banks": (
        gravity_dam(
            divisions=GRAVITY_DIVISIONS | {"banks": 8, "upstream": 8, "downstream": 8, "growth": 2.8}
        ),
        "gravity_dam.divisions.growth = 2.8: in block rock_left around",
    ),
    "a sharp crest": (
        gravity_dam(downstream=[[0, 70], [66.5, 19.25], [103, 0.2]], divisions=GRAVITY_DIVISIONS | {"up": 4}),
        "gravity_dam.divisions.up = 4: in block monolith_1 around",
    ),
}


def soundness(block):
    """Least Jacobian determinant over the largest, and longest over shortest edge, of every cell."""
    element = ELEMENTS[block.element]
    xi = element.rule_of(5)[0] if element.box else element.rule[0]
    determinant = np.linalg.det(jacobians(block.points, block.cells, element, xi))
    ends = block.points[block.cells[:, np.array(element.edges)]]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    return determinant.min(axis=1) / determinant.max(axis=1), length.max(axis=1) / length.min(axis=1)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            case,
            marks=[pytest.mark.slow]
            * (case in ("refined", "200 up, tetrahedra", "crown of 0.3 m", "rock that grows fast")),
        )
        for case in SPOILED
    ],
)
def test_divisions_that_spoil_elements_are_refused_with_ones_that_do_not(make, case):
    raw, message = SPOILED[case]
    with pytest.raises(ConfigError, match=re.escape(message)) as refused:
        make(raw)
    (key,) = raw.keys() & {"arch_dam", "gravity_dam"}
    remedies = str(refused.value).split("; ")[-1].split(", or ")
    for remedy in remedies:
        changes = re.findall(r"(raise|lower) divisions\.(\w+) to ([\d.]+)", remedy)
        assert len(changes) == remedy.count("divisions.")
        divisions = dict(raw[key]["divisions"])
        for change, name, value in changes:
            assert (float(value) > divisions[name]) == (change == "raise")
            divisions[name] = float(value) if name == "growth" else int(value)
        scene = make(raw | {key: raw[key] | {"divisions": divisions}})
        for name, block in scene.blocks.items():
            least, slender = soundness(block)
            assert least.min() > 0.0
            assert slender.max() < (1200.0 if name.startswith("rock") else 120.0)  # diagonals of tetrahedra


def test_a_perimeter_that_is_too_thin_for_any_divisions_is_refused_with_a_thickness_that_is_not(make):
    def raw(thickness):
        perimeter = {"material": "concrete", "thickness": thickness}
        return arch_dam(element="hex20", perimeter=perimeter, divisions=ARCH_DIVISIONS | {"along": 1})

    with pytest.raises(ConfigError, match="in block perimeter around") as refused:
        make(raw(0.05))
    (times,) = re.findall(r"make perimeter\.thickness (\d+) times what it is$", str(refused.value))
    assert soundness(make(raw(0.05 * int(times))).blocks["perimeter"])[1].max() < 100.0
    with pytest.raises(ConfigError, match="in block perimeter around"):
        make(raw(0.05 * (int(times) - 2)))


def test_rows_of_intervals_that_are_too_thin_are_refused_with_rows_that_are_not(make):
    def raw(up):
        return gravity_dam(divisions=GRAVITY_DIVISIONS | {"through": 1, "up": up})

    with pytest.raises(ConfigError, match=r"divisions.up = \[100, 2, 2, 2\]: in block monolith_2") as refused:
        make(raw([100, 2, 2, 2]))
    (rows,) = re.findall(r"lower divisions\.up to \[([\d, ]+)\]", str(refused.value))
    blocks = make(raw([int(row) for row in rows.split(", ")])).blocks
    assert max(soundness(blocks[f"monolith_{k}"])[1].max() for k in (1, 2, 3)) < 100.0
