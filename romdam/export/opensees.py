"""A deck as an OpenSees script in Python, `python deck.py`, with its model in tables beside it.

Tried with openseespy 3.7.1.2. Frictionless gaps are zeroLength elements of an elastic multilinear material,
those with friction zeroLengthContactASDimplex elements (implicit; zeroLengthContact3D knows normals along
global axes only, flatSliderBearing nodes of six degrees of freedom). That element takes the shear off a gap
that opens only where it is open by less than 1e-6 of the unit of length, so the script counts in 1e6 m.
Rayleigh damping is set, and frequencies are solved for, before there are gaps, which have no damping, as in
romdam. HHT with 0.9 damps what closing contacts send out, which Newmark's average acceleration keeps.
TenNodeTetrahedron of this version integrates a sixth of its volume and prints its shape functions at every
call, so it is not among the elements.
"""

from __future__ import annotations

import numpy as np

from romdam.core.errors import ConfigError
from romdam.export.deck import Deck
from romdam.export.tables import assignments, comments, openings_head, table

_ELEMENTS = {"hex8": "stdBrick", "hex20": "20NodeBrick", "tet4": "FourNodeTetrahedron"}


def write_opensees(deck: Deck) -> tuple[dict[str, str], tuple[str, ...]]:
    """Files by name, and what differs from romdam's model.

    Raises
    ------
    ConfigError
        for elements that OpenSees has not got, and for points that follow several others.
    """
    names = deck.elements(_ELEMENTS, "OpenSees")
    if deck.follows.nnz:
        rows = deck.follows.getnnz(axis=1).astype(bool).sum() // 3
        key, why = next(iter(deck.averaged.items()))
        spacing = key.endswith(".spacing")
        remedy = "give faces the same nodes and discretization: node_to_node"
        raise ConfigError(
            f"{key} {why}, so that {rows} points of the deck follow several nodes, limit 0: openseespy "
            f"has no linear constraints of several nodes; {'leave it out' if spacing else remedy}, "
            "or export to calculix or abaqus"
        )
    stated, diagonal = [], np.einsum("nii->ni", deck.added_mass)
    if "tet4" in {solid.element for solid in deck.solids}:
        stated.append(
            "FourNodeTetrahedron integrates its mass with one point, romdam exactly: frequencies differ."
        )
    # largest coupling of directions over the largest mass of a point
    largest = diagonal.max(axis=1, initial=0.0)
    off = np.abs(deck.added_mass * (1.0 - np.eye(3))).max(axis=(1, 2), initial=0.0)
    coupled = float((off[largest > 0.0] / largest[largest > 0.0]).max(initial=0.0))
    if coupled > 0.0:
        stated.append(
            "Added mass has no coupling of directions, which on inclined faces is up to "
            f"{100 * coupled:.0f} % of its largest component: nodes have three masses."
        )
    deck = deck.stating(*stated)
    head = comments("#", deck.title, deck.stated)
    settings = {
        "DT": deck.motion.dt,
        "STEPS": deck.motion.steps,
        "STRIDE": deck.motion.stride,
        "STATIC": deck.static,
        "ALPHA": deck.alpha,
        "BETA": deck.beta,
        "MODES": 10,
        "PROBES": {name: node + 1 for name, node in deck.probes.items()},
        "HEAD": openings_head(len(deck.gaps), deck.probes),
        "BLOCKS": {
            k: (solid.name, name, solid.material.E, solid.material.nu, solid.material.rho, *solid.damping)
            for k, (solid, name) in enumerate(zip(deck.solids, names, strict=True), 1)
        },
    }
    node_head = ["node", *(f"{what}{axis}" for what in ("", "fix_", "mass_", "force_") for axis in "xyz")]
    columns = (deck.points, deck.fixed.astype(int), diagonal, deck.force)
    of_nodes = zip(*(column.tolist() for column in columns), strict=True)
    nodes = [[k, *at, *fixed, *mass, *force] for k, (at, fixed, mass, force) in enumerate(of_nodes, 1)]
    cells = [
        [k, " ".join(map(str, cell))]
        for k, solid in enumerate(deck.solids, 1)
        for cell in (solid.cells + 1).tolist()
    ]
    gaps, law = deck.gaps, deck.gaps.law
    gap_head = [
        "joint",
        "I",
        "J",
        "nx",
        "ny",
        "nz",
        "jx",
        "jy",
        "jz",
        "K_n",
        "K_nz",
        "K_s",
        "friction",
        "gap",
    ]
    parameters = np.column_stack([law.K_n, law.K_nz, law.K_s, gaps.friction, law.gap])
    of_gaps = (gaps.points + 1, gaps.axes[:, :2].reshape(-1, 6), parameters)
    gap_rows = [
        [name, *points, *axes, *numbers]
        for name, points, axes, numbers in zip(gaps.joint, *(each.tolist() for each in of_gaps), strict=True)
    ]
    return {
        "deck.py": f"{head}\n{_IMPORTS}\n{assignments(settings)}\n{_SCRIPT}",
        "nodes.csv": table(node_head, nodes),
        "elements.csv": table(["block", "nodes"], cells),
        "gaps.csv": table(gap_head, gap_rows),
        "record.csv": table(["x", "y", "z"], deck.motion.acc.T.tolist()),
    }, deck.stated


_IMPORTS = """
import csv
import math
import pathlib
import sys

import openseespy.opensees as ops

HERE = pathlib.Path(__file__).parent
LENGTH = 1e6  # m to a unit of length, in which zeroLengthContactASDimplex takes 1e-6 for none
"""

_SCRIPT = '''

def rows(name):
    with open(HERE / name, newline="") as file:
        return list(csv.DictReader(file))


def xyz(row, what):
    return [float(row[what + axis]) for axis in "xyz"]


def build():
    """Nodes, solids, Rayleigh damping on them, frequencies with open joints, then the gaps.

    Units are kg, s and 1e6 m. A gap that opens by more than 1e-6 of the unit in a step keeps the shear that
    it had; stiffness per length has the same numbers as in N/m.
    """
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 3)
    nodes = rows("nodes.csv")
    for row in nodes:
        tag = int(row["node"])
        ops.node(tag, *(x / LENGTH for x in xyz(row, "")))
        ops.fix(tag, *(int(row["fix_" + axis]) for axis in "xyz"))
        if any(xyz(row, "mass_")):
            ops.mass(tag, *xyz(row, "mass_"))
    for tag, (_, _, E, nu, rho, _, _) in BLOCKS.items():
        ops.nDMaterial("ElasticIsotropic", tag, E * LENGTH, nu, rho * LENGTH**3)
    cells = rows("elements.csv")
    for tag, row in enumerate(cells, 1):
        block = int(row["block"])
        ops.element(BLOCKS[block][1], tag, *map(int, row["nodes"].split()), block)
    ops.rayleigh(ALPHA, 0.0, BETA, 0.0)  # of the initial stiffness, which bricks keep: half the time
    for block, (*_, alpha, beta) in BLOCKS.items():  # of materials with damping of their own
        if (alpha, beta) != (ALPHA, BETA):
            elements = [tag for tag, row in enumerate(cells, 1) if int(row["block"]) == block]
            ops.region(block, "-eleOnly", *elements, "-rayleigh", alpha, 0.0, beta, 0.0)
    with open(HERE / "frequencies.csv", "w") as file:
        file.write("mode,frequency [Hz]\\n")
        for mode, value in enumerate(ops.eigen(MODES), 1):
            file.write(f"{mode},{math.sqrt(max(value, 0.0)) / (2.0 * math.pi)!r}\\n")
    gaps = rows("gaps.csv")
    for number, row in enumerate(gaps):
        tags = len(nodes) + number + 1, len(cells) + 2 * number + 1, len(BLOCKS) + 2 * number + 1
        row["elements"] = add_gap(row, *tags)
    return nodes, gaps


def add_gap(row, spare, element, material):
    """One gap: compression K_n beyond the initial gap, K_nz in both signs; friction where it has some.
    Shear without a bound, of a friction of inf, is a spring. Returns the elements' tags.
    """
    I, J, normal, along = int(row["I"]), int(row["J"]), xyz(row, "n"), xyz(row, "j")
    K_n, K_nz, K_s, friction, gap = (float(row[key]) for key in ("K_n", "K_nz", "K_s", "friction", "gap"))
    if math.isinf(friction):
        ops.uniaxialMaterial("Elastic", material + 1, K_s)
        ends, frame = (I, J, "-mat", *[material + 1] * 2, "-dir", 2, 3), ("-orient", *normal, *along)
        ops.element("zeroLength", element + 1, *ends, *frame)
    if friction == 0.0 or math.isinf(friction):
        strain = [(end - gap) / LENGTH for end in (-1.0, 0.0, 1.0)]  # to a metre on both sides
        stress = [force / LENGTH for force in (-K_n, 0.0, K_nz)]
        ops.uniaxialMaterial("ElasticMultiLinear", material, "-strain", *strain, "-stress", *stress)
        ops.element("zeroLength", element, I, J, "-mat", material, "-dir", 1, "-orient", *normal, *along)
        return [element] if friction == 0.0 else [element, element + 1]
    if gap != 0.0:  # the contact element takes its initial gap from where its nodes stand
        ops.node(spare, *(x + gap * n / LENGTH for x, n in zip(ops.nodeCoord(I), normal)))
        ops.equalDOF(J, spare, 1, 2, 3)
        J = spare
    # what K_nz leaves of the compression bears friction for all of it
    ends = (I, J, K_n - K_nz, K_s, friction * K_n / (K_n - K_nz))
    ops.element("zeroLengthContactASDimplex", element, *ends, "-orient", *normal, "-intType", 0)
    if K_nz:  # from where the joint closes, not from where it stands
        strain = [(end - gap) / LENGTH for end in (-1.0, 1.0)]
        stress = [force / LENGTH for force in (-K_nz, K_nz)]
        ops.uniaxialMaterial("ElasticMultiLinear", material + 1, "-strain", *strain, "-stress", *stress)
        frame = ("-orient", *normal, *along)
        ops.element("zeroLength", element + 1, I, J, "-mat", material + 1, "-dir", 1, *frame)
        return [element, element + 1]
    return [element]


def loads(nodes, series):
    ops.timeSeries(series, 1)
    ops.pattern("Plain", 1, 1)
    for row in nodes:
        if any(xyz(row, "force_")):
            ops.load(int(row["node"]), *(f / LENGTH for f in xyz(row, "force_")))


def analysis(kind, *integrator):
    ops.wipeAnalysis()
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("UmfPack")  # SparseSYM takes two thirds of its time, and crashes where blocks hang apart
    ops.test("NormDispIncr", 1e-10 / LENGTH, 30, 0)
    ops.algorithm("Newton")
    ops.integrator(*integrator)
    ops.analysis(kind)


def advance(analyze, step, failure, depth=0):
    """One step in time or load; where Newton's method fails another one, then two steps of half the size."""
    if analyze(step) == 0:
        return
    for method in (("NewtonLineSearch",), ("KrylovNewton",)):
        ops.algorithm(*method)
        done = analyze(step) == 0
        ops.algorithm("Newton")
        if done:
            return
    if depth == 6:
        sys.exit(failure.format(ops.getTime()))
    advance(analyze, step / 2.0, failure, depth + 1)
    advance(analyze, step / 2.0, failure, depth + 1)


def add_load(share):
    ops.integrator("LoadControl", share)
    return ops.analyze(1)


def add_time(dt):
    return ops.analyze(1, dt)


def opening(row):
    I, J = (ops.nodeDisp(int(row[end])) for end in "IJ")
    return float(row["gap"]) + LENGTH * sum(n * (q - p) for n, p, q in zip(xyz(row, "n"), I, J))


def force(row):
    """Along the normal, j and k of a gap, on its side J against the joint: compression is negative."""
    normal, along = xyz(row, "n"), xyz(row, "j")
    upright = [normal[a - 2] * along[a - 1] - normal[a - 1] * along[a - 2] for a in range(3)]
    total = [LENGTH * sum(ops.eleForce(tag)[3 + a] for tag in row["elements"]) for a in range(3)]
    return [sum(a * f for a, f in zip(axis, total)) for axis in (normal, along, upright)]


def at_rest():
    """The model in equilibrium under the static loads, or under them from the first step on."""
    nodes, gaps = build()
    if STATIC:
        loads(nodes, "Linear")
        analysis("Static", "LoadControl", 0.1)
        for _ in range(10):
            advance(add_load, 0.1, "equilibrium under {:.4g} of the static loads was not found")
        ops.loadConst("-time", 0.0)
    else:
        loads(nodes, "Constant")
    return gaps


def main():
    global LENGTH
    try:
        gaps = at_rest()
    except SystemExit as failure:  # gaps that keep their shear as they open make it easier
        print(f"{failure}; once more in metres, where a gap that opens by 1e-6 m in a step keeps its shear")
        LENGTH = 1.0
        gaps = at_rest()
    record = rows("record.csv")
    for direction, axis in enumerate("xyz", 1):
        values = [float(row[axis]) / LENGTH for row in record]
        if any(values):
            ops.timeSeries("Path", 1 + direction, "-dt", DT, "-values", *values)
            ops.pattern("UniformExcitation", 1 + direction, direction, "-accel", 1 + direction)
    analysis("Transient", "HHT", 0.9)
    with open(HERE / "openings.csv", "w", buffering=1) as file, open(HERE / "forces.csv", "w") as forces:
        file.write(HEAD)
        axes = [f"{axis}:{k}" for k in range(len(gaps)) for axis in ("normal", "j", "k")]
        forces.write(",".join(["time", *axes]) + "\\n")
        for step in range(STEPS + 1):
            if step:
                advance(add_time, DT, "no convergence at {:.6f} s; what was computed stands in openings.csv")
            if step % STRIDE == 0:
                moved = [LENGTH * value for node in PROBES.values() for value in ops.nodeDisp(node)]
                numbers = [step * DT, *(opening(row) for row in gaps), *moved]
                file.write(",".join(map(repr, numbers)) + "\\n")
                of_gaps = [value for row in gaps for value in force(row)]
                forces.write(",".join(map(repr, [step * DT, *of_gaps])) + "\\n")


if __name__ == "__main__":
    main()
'''
