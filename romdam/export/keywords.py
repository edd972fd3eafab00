"""A deck in the keywords that CalculiX and Abaqus share.

A gap is a point of its own whose displacement is the jump: linear equations make its x the opening without
the initial gap, y and z the slips, whatever nodes the gap sees, and one-node springs act on it. Added mass
stands at points that move as their wet node does along one direction, so that it has no inertia across.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, Ints
from romdam.export.deck import Deck, as_written

MODEL = "*INCLUDE, INPUT=mesh.inp\n*INCLUDE, INPUT=gaps.inp\n"
_REACH = 10.0  # [m] to which the force of a spring is tabulated
_FREQUENCIES = 10  # that a deck asks for
_ROUNDING = 1e-12  # of the largest force
_LEAST_DENSITY = 1e-3  # [kg/m3]
_LEAST_STEP = 1e-5  # of the step asked for


def mesh_text(deck: Deck, names: list[str]) -> str:
    """Points, solids, materials, supports, what follows, added mass; all that has mass is in EALL."""
    lines = ["*NODE, NSET=NALL", *_points(deck.points[deck.meshed], np.flatnonzero(deck.meshed) + 1)]
    first = 1
    for k, (solid, name) in enumerate(zip(deck.solids, names, strict=True), 1):
        lines.append(f"*ELEMENT, TYPE={name}, ELSET=B{k}")
        for number, cell in enumerate((solid.cells + 1).tolist(), first):
            # as many lines as it needs, all but the last with a comma at the end
            words = [str(word) for word in (number, *cell)]
            pieces = [", ".join(words[k : k + 10]) for k in range(0, len(words), 10)]
            lines += [*(f"{piece}," for piece in pieces[:-1]), pieces[-1]]
        first += len(solid.cells)
        material = solid.material
        lines += [
            f"** B{k} is block {solid.name}",
            f"*SOLID SECTION, ELSET=B{k}, MATERIAL=M{k}",
            f"*MATERIAL, NAME=M{k}",
            "*ELASTIC",
            f"{_number(material.E)}, {_number(material.nu)}",
            "*DENSITY",
            _number(material.rho or _LEAST_DENSITY),
            f"*DAMPING, ALPHA={_number(solid.damping[0])}, BETA={_number(solid.damping[1])}",
        ]
    lines += ["*ELSET, ELSET=EALL", *(f"B{k}" for k in range(1, len(names) + 1)), "*BOUNDARY"]
    lines += [f"{p + 1}, {c + 1}, {c + 1}" for p, c in np.argwhere(deck.fixed).tolist()]
    leads = np.repeat(deck.meshed, 3) & (np.diff(deck.follows.indptr) > 0)
    lines += _equations(deck.follows[leads], np.flatnonzero(leads).tolist())
    # added mass at points that move as their wet node does along one direction
    behind = len(deck.points) + 1
    for k, (point, mass, axis) in enumerate(deck.wet()):
        node = behind + k
        rows = np.zeros((3, 3 * len(deck.points)))
        rows[:, 3 * point : 3 * point + 3] = np.outer(axis, axis)
        lines += ["*NODE", *_points(deck.points[point][None], np.array([node]))]
        kept = [c for c in range(3) if abs(axis[c]) > 1e-9]
        lines += _equations(csr_matrix(rows[kept]), [3 * (node - 1) + c for c in kept])
        lines += [
            f"*ELEMENT, TYPE=MASS, ELSET=W{k}",
            f"{first + k}, {node}",
            f"*MASS, ELSET=W{k}",
            _number(mass),
        ]
        lines += ["*ELSET, ELSET=EALL", f"W{k}", "*BOUNDARY" if len(kept) < 3 else "**"]
        lines += [f"{node}, {c + 1}, {c + 1}" for c in range(3) if c not in kept]
    return "\n".join(lines) + "\n"


def gaps_text(deck: Deck) -> str:
    """Jump points from `jump_node` on, their equations, and springs on them."""
    gaps, law, count = deck.gaps, deck.gaps.law, len(deck.gaps)
    if not count:
        return "** no gaps\n"
    first = jump_node(deck)
    sticks = gaps.sticks
    dofs = np.flatnonzero(np.column_stack([np.ones(count, dtype=bool), sticks, sticks]).ravel())
    nodes = deck.points[gaps.points[:, 0]]
    lines = ["*NODE, NSET=GAPS", *_points(nodes, first + np.arange(count))]
    lines += _equations(deck.jumps()[dofs], (dofs + 3 * (first - 1)).tolist())
    lines += ["*BOUNDARY", *(f"{first + gap}, 2, 3" for gap in np.flatnonzero(~sticks).tolist())]
    number = sum(len(solid.cells) for solid in deck.solids) + first - len(deck.points)
    kinds, kind = np.unique(
        as_written(np.column_stack([law.K_n, law.K_nz, law.gap])), axis=0, return_inverse=True
    )
    for k, (K_n, K_nz, gap) in enumerate(kinds.tolist()):
        of_kind = np.flatnonzero(kind.ravel() == k)
        lines += [
            f"*ELEMENT, TYPE=SPRING1, ELSET=G{k}",
            *(f"{number + i}, {first + gap}" for i, gap in enumerate(of_kind.tolist())),
        ]
        lines += [f"*SPRING, NONLINEAR, ELSET=G{k}", "1"]
        lines += [f"{_number(-K_n * _REACH)}, {_number(-gap - _REACH)}", f"0.0, {_number(-gap)}"]
        lines.append(f"{_number(K_nz * _REACH)}, {_number(_REACH - gap)}")
        number += len(of_kind)
    K_s = as_written(law.K_s)
    for k, stiffness in enumerate(np.unique(K_s[sticks]).tolist()):
        sliding_gaps = np.flatnonzero(sticks & (K_s == stiffness))
        for axis in (2, 3):
            lines += [
                f"*ELEMENT, TYPE=SPRING1, ELSET=S{k}_{axis}",
                *(f"{number + i}, {first + gap}" for i, gap in enumerate(sliding_gaps.tolist())),
            ]
            lines += [f"*SPRING, ELSET=S{k}_{axis}", str(axis), _number(stiffness)]
            number += len(sliding_gaps)
    return "\n".join(lines) + "\n"


def jump_node(deck: Deck) -> int:
    """Number of the first gap's jump point, behind those of added mass."""
    return len(deck.points) + sum(1 for _ in deck.wet()) + 1


def _points(points: Floats, numbers: Ints) -> Iterator[str]:
    rows = zip(numbers.tolist(), points.tolist(), strict=True)
    return (f"{k}, {', '.join(map(_number, point))}" for k, point in rows)


def _number(value: float) -> str:
    """A number in the 20 characters that CalculiX reads of one, always with a point."""
    return f"{value:.12E}"


def _equations(rows: csr_matrix, dofs: list[int]) -> list[str]:
    """Each DOF (numbers 3 point + component) is the combination of others in its row."""
    lines: list[str] = []
    for dof, start, end in zip(dofs, rows.indptr[:-1].tolist(), rows.indptr[1:].tolist(), strict=True):
        columns = slice(start, end)
        terms = zip(rows.indices[columns].tolist(), rows.data[columns].tolist(), strict=True)
        texts = [f"{c // 3 + 1}, {c % 3 + 1}, {_number(v)}" for c, v in ((dof, -1.0), *terms) if v]
        lines += ["*EQUATION", str(len(texts))]
        lines += [", ".join(texts[k : k + 4]) for k in range(0, len(texts), 4)]
    return lines


def steps_text(deck: Deck, control: list[str], output: list[str], also: tuple[str, ...] = ()) -> str:
    """The static step, and the record as inertia of what has mass, each with what controls and prints it.

    `also` stands in the static step alone. The step is the longest: contact that flickers between two states
    at one is solved at a shorter one.
    """
    motion = deck.motion
    loads = [
        f"{p + 1}, {c + 1}, {_number(deck.force[p, c])}"
        for p, c in np.argwhere(abs(deck.force) > _ROUNDING * abs(deck.force).max(initial=0.0)).tolist()
    ]
    step, end = _number(motion.dt), _number(motion.steps * motion.dt)
    lines = ["*AMPLITUDE, NAME=ALWAYS", f"0.0, 1.0, {end}, 1.0"]
    for axis, acc in zip("XYZ", motion.acc, strict=True):
        if acc.any():
            lines.append(f"*AMPLITUDE, NAME=GROUND_{axis}")
            lines += [f"{_number(k * motion.dt)}, {_number(a)}" for k, a in enumerate(acc.tolist())]
    if deck.static and loads:
        lines += ["*STEP, INC=1000", "*STATIC", "0.1, 1.0", *control, "*CLOAD", *loads, *output]
        lines += [*also, "*END STEP"]
    least = _number(_LEAST_STEP * motion.dt)
    lines += ["*STEP, INC=10000000", "*DYNAMIC, ALPHA=-0.05", f"{step}, {end}, {least}, {step}", *control]
    if loads and not deck.static:
        lines += ["*CLOAD, AMPLITUDE=ALWAYS", *loads]
    for axis, acc in zip("XYZ", motion.acc, strict=True):
        if acc.any():
            along = ", ".join("-1.0" if axis == direction else "0.0" for direction in "XYZ")
            lines += [f"*DLOAD, AMPLITUDE=GROUND_{axis}", f"EALL, GRAV, 1.0, {along}"]
    return "\n".join([*lines, *output, "*END STEP"]) + "\n"


def probes_text(deck: Deck) -> str:
    """The set of nodes whose displacement is written."""
    nodes = [str(node + 1) for node in deck.probes.values()]
    return "\n".join(["*NSET, NSET=PROBES", *nodes, ""]) if nodes else ""


def frequencies_text() -> str:
    """Natural frequencies with open joints: of the mesh alone."""
    return f"*INCLUDE, INPUT=mesh.inp\n*STEP\n*FREQUENCY\n{_FREQUENCIES}\n*END STEP\n"


def shared_statements(deck: Deck) -> Iterator[str]:
    """State what both codes have otherwise than romdam."""
    if (np.isfinite(deck.gaps.friction) & (deck.gaps.friction > 0.0)).any():
        yield (
            "Friction has no limit: gaps with friction hold along both tangents with K_s, whether they are "
            "closed, slide or are open."
        )
    if any(solid.material.rho == 0.0 for solid in deck.solids):
        yield f"Massless blocks have {_LEAST_DENSITY:g} kg/m3, for the first acceleration needs some."
