"""A deck as input of CalculiX: `ccx frequencies`, `ccx deck`, `python openings.py`.

Tried with ccx 2.20. Its GAPUNI elements smooth the corner of the force; nonlinear one-node springs on jump
points are exact (`romdam.export.keywords`), and material damping is not on them. With *DYNAMIC, DIRECT gaps
that touch without force flicker between two states until ccx gives up, so increments may shrink, and openings
are written at every one.
"""

from __future__ import annotations

import numpy as np

from romdam.core.errors import ConfigError
from romdam.export.deck import Deck
from romdam.export.keywords import (
    MODEL,
    frequencies_text,
    gaps_text,
    mesh_text,
    probes_text,
    shared_statements,
    steps_text,
)
from romdam.export.tables import assignments, comments, openings_head

_ELEMENTS = {"hex8": "C3D8", "hex20": "C3D20", "tet4": "C3D4", "tet10": "C3D10"}


def write_calculix(deck: Deck) -> tuple[dict[str, str], tuple[str, ...]]:
    """Files by name, and what differs from romdam's model.

    Raises
    ------
    ConfigError
        for elements that CalculiX has not got, for equilibrium of gaps under static loads, and for blocks of
        unlike damping: it takes one for the whole model, whatever material that stands at.
    """
    dampings = {solid.damping for solid in deck.solids}
    if len(dampings) > 1:
        raise ConfigError(
            "materials.<name>.damping: CalculiX has one Rayleigh damping of the whole model, and blocks have "
            f"{len(dampings)}; leave it out, or export to opensees, abaqus or code_aster"
        )
    if deck.static and len(deck.gaps) and deck.force.any():
        raise ConfigError(
            "loads.initial_state: static has gaps under static loads, where the static step of CalculiX "
            "takes their springs as linear, and does not converge otherwise; set undeformed, or export to "
            "opensees"
        )
    names = deck.elements(_ELEMENTS, "CalculiX")
    stated = []
    if {solid.element for solid in deck.solids} & {"tet4", "tet10"}:
        stated.append(
            "C3D4 integrates its mass with one point and C3D10 with four, romdam exactly: frequencies "
            "differ, with C3D4 by percents on a coarse mesh."
        )
    if deck.added_mass.any():
        stated.append("Added mass has no Rayleigh damping: masses in CalculiX have none.")
    deck = deck.stating(*shared_statements(deck), *stated)
    head = comments("**", deck.title, deck.stated) + "\n"
    sets = [name for name, there in (("GAPS", len(deck.gaps)), ("PROBES", deck.probes)) if there]
    output = [f"*NODE PRINT, NSET={name}\nU" for name in sets]
    pull = deck.mass * float(np.abs(deck.motion.acc).max()) / len(deck.points)
    control = f"*CONTROLS, PARAMETERS=FIELD\n{_RESIDUAL}, 1.0E-2, {pull:.6E}, {pull:.6E}"
    probes = {node + 1: name for name, node in deck.probes.items()}
    settings = {
        "STATIC": deck.static and bool(deck.force.any()),
        "GAPS": deck.gaps.law.gap.tolist(),
        "PROBES": probes,
        "HEAD": openings_head(len(deck.gaps), probes.values()),
    }
    return {
        "mesh.inp": mesh_text(deck, names) + probes_text(deck),
        "gaps.inp": _ROOM + gaps_text(deck),
        "frequencies.inp": head + frequencies_text(),
        "deck.inp": head + MODEL + steps_text(deck, [control], output, _ENERGY),
        "openings.py": assignments(settings) + _SCRIPT,
    }, deck.stated


_ENERGY = ("*EL PRINT, ELSET=EALL, TOTALS=ONLY", "ENER")  # which ccx wants from the first of several steps on
_RESIDUAL = 1e-4  # of what the record's peak puts on a node; else small forces never settle
# ccx makes room for a spring's degree of freedom only where some material has four constants or more
_ROOM = """*MATERIAL, NAME=ROOM
*ELASTIC, TYPE=ORTHO
1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0
1.0
"""

_SCRIPT = '''

import pathlib

HERE = pathlib.Path(__file__).parent


def frequencies():
    """Rows of mode and frequency in frequencies.dat."""
    words = [line.split() for line in (HERE / "frequencies.dat").read_text().splitlines()]
    table = [row for row in words if len(row) == 5 and row[0].isdigit()]
    return [(int(row[0]), float(row[3])) for row in table]


def printed():
    """Time in the record -> node -> displacement, from deck.dat."""
    times = {}
    for line in (HERE / "deck.dat").read_text().splitlines():
        words = line.split()
        if words[:1] == ["displacements"]:
            now = times.setdefault(float(words[-1]), {})
        elif len(words) == 4 and words[0].isdigit():
            now[int(words[0])] = [float(word) for word in words[1:]]
    start = 1.0 if STATIC else 0.0  # the static step takes one second
    return {time - start: moved for time, moved in times.items() if time >= start}


def main():
    with open(HERE / "frequencies.csv", "w") as file:
        file.write("mode,frequency [Hz]\\n")
        file.writelines(f"{mode},{value}\\n" for mode, value in frequencies())
    steps = printed()
    nodes = next(iter(steps.values()))
    steps = steps if STATIC else {0.0: {node: [0.0, 0.0, 0.0] for node in nodes}, **steps}
    gaps = sorted(node for node in nodes if node not in PROBES)
    with open(HERE / "openings.csv", "w") as file:
        file.write(HEAD)
        for time, moved in steps.items():
            numbers = [time, *(gap + moved[node][0] for gap, node in zip(GAPS, gaps))]
            numbers += [value for node in PROBES for value in moved[node]]
            file.write(",".join(map(repr, numbers)) + "\\n")


if __name__ == "__main__":
    main()
'''
