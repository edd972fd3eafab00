"""A deck as input of Abaqus/Standard: `abaqus job=frequencies`, `job=deck`, `abaqus python openings.py`.

Not run in Abaqus: the keywords are those of `romdam.export.calculix`, which CalculiX reads and solves, with
output for the database of Abaqus in place of printed one.
"""

from __future__ import annotations

from romdam.export.deck import Deck
from romdam.export.keywords import (
    MODEL,
    frequencies_text,
    gaps_text,
    jump_node,
    mesh_text,
    probes_text,
    shared_statements,
    steps_text,
)
from romdam.export.tables import assignments, comments, openings_head

_ELEMENTS = {"hex8": "C3D8", "hex20": "C3D20", "tet4": "C3D4", "tet10": "C3D10"}


def write_abaqus(deck: Deck) -> tuple[dict[str, str], tuple[str, ...]]:
    """Files by name, and what differs from romdam's model.

    Raises
    ------
    ConfigError
        for elements that have no line here.
    """
    names = deck.elements(_ELEMENTS, "Abaqus")
    kinds = {solid.element for solid in deck.solids}
    stated = ["Such decks were never run in Abaqus; CalculiX solves models of the same keywords."]
    if "hex8" in kinds:
        stated.append(
            "C3D8 of Abaqus has one volumetric strain at all points, romdam integrates fully: it is softer."
        )
    if deck.added_mass.any():
        stated.append("Added mass has no Rayleigh damping.")
    deck = deck.stating(*shared_statements(deck), *stated)
    head = comments("**", deck.title, deck.stated) + "\n"
    sets = [name for name, there in (("GAPS", len(deck.gaps)), ("PROBES", deck.probes)) if there]
    output = [f"*OUTPUT, HISTORY, FREQUENCY=1\n*NODE OUTPUT, NSET={name}\nU1, U2, U3" for name in sets]
    probes = {node + 1: name for name, node in deck.probes.items()}
    settings = {
        "FIRST": jump_node(deck),
        "GAPS": deck.gaps.law.gap.tolist(),
        "PROBES": probes,
        "HEAD": openings_head(len(deck.gaps), probes.values()),
    }
    return {
        "mesh.inp": mesh_text(deck, names) + probes_text(deck),
        "gaps.inp": gaps_text(deck),
        "frequencies.inp": head + frequencies_text(),
        "deck.inp": head + MODEL + steps_text(deck, [], output),
        "openings.py": assignments(settings) + _SCRIPT,
    }, deck.stated


_SCRIPT = '''

from odbAccess import openOdb  # run as: abaqus python openings.py


def histories(step):
    """Node -> component -> rows of (time, value)."""
    made = {}
    for region in step.historyRegions.values():
        if region.name.startswith("Node") and "U1" in region.historyOutputs.keys():
            node = int(region.name.split(".")[-1])
            made[node] = [region.historyOutputs["U%d" % c].data for c in (1, 2, 3)]
    return made


def main():
    step = list(openOdb("frequencies.odb", readOnly=True).steps.values())[-1]
    with open("frequencies.csv", "w") as file:
        file.write("mode,frequency [Hz]\\n")
        for frame in step.frames:
            if frame.mode:
                file.write("%d,%r\\n" % (frame.mode, frame.frequency))
    moved = histories(list(openOdb("deck.odb", readOnly=True).steps.values())[-1])
    times = [row[0] for row in next(iter(moved.values()))[0]]
    with open("openings.csv", "w") as file:
        file.write(HEAD)
        for k, time in enumerate(times):
            numbers = [time] + [gap + moved[FIRST + m][0][k][1] for m, gap in enumerate(GAPS)]
            numbers += [moved[node][c][k][1] for node in PROBES for c in range(3)]
            file.write(",".join(repr(float(number)) for number in numbers) + "\\n")


if __name__ == "__main__":
    main()
'''
