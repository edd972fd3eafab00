"""CalculiX with contact that searches its partners, from the deck of `romdam export --to calculix`.

The exported deck has one spring on the jump of each gap. Here the springs give way to contact pairs, surface
to surface, of the same stiffness per area: CalculiX then finds at every increment which facets meet. The
points of the jumps stay, so openings are printed at the same nodes.
"""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

# corners of the faces S1 to S6 of a brick of eight nodes, as CalculiX and Abaqus number them
_FACES = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
_SPRINGS = ("*ELEMENT", "*SPRING", "*MATERIAL", "*ELASTIC")  # sections of gaps.inp that give way


def search_for_contact(folder: Path, stiffness: float) -> int:
    """Put contact pairs in place of the springs of an exported deck; returns how many pairs of blocks meet.

    Parameters
    ----------
    folder : with mesh.inp and gaps.inp, of bricks of eight nodes whose nodes coincide on joints
    stiffness : of all joints [N/m3]
    """
    mesh, gaps = ((folder / name).read_text() for name in ("mesh.inp", "gaps.inp"))
    points, blocks = _read_mesh(mesh)
    sections = [text if k == 0 else f"*{text}" for k, text in enumerate(gaps.split("\n*"))]
    lines = [text for text in sections if not text.startswith(_SPRINGS)]
    lines += ["*SURFACE INTERACTION, NAME=JOINT", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines.append(f"{stiffness:.6E}")
    count = 0
    for pair in combinations(blocks, 2):
        seen = [{points[n] for corners in block.values() for n in corners} for block in pair]
        faces = [_faces_within(block, points, seen[0] & seen[1]) for block in pair]
        if all(faces):
            for side, names in zip("IJ", faces, strict=True):
                lines += [f"*SURFACE, NAME={side}{count}, TYPE=ELEMENT", *names]
            lines += ["*CONTACT PAIR, INTERACTION=JOINT, TYPE=SURFACE TO SURFACE", f"I{count}, J{count}"]
            count += 1
    (folder / "gaps.inp").write_text("\n".join(lines) + "\n")
    return count


def _read_mesh(
    mesh: str,
) -> tuple[dict[int, tuple[float, ...]], list[dict[int, tuple[int, ...]]]]:
    """Node -> place in micrometres, and element -> corners of every block."""
    points, blocks = dict[int, tuple[float, ...]](), list[dict[int, tuple[int, ...]]]()
    for section in mesh.split("\n*"):
        head, *rows = section.removeprefix("*").splitlines()
        if head.startswith("NODE,"):
            table = (row.split(",") for row in rows)
            points |= {int(row[0]): tuple(round(1e6 * float(x)) for x in row[1:4]) for row in table}
        elif head.startswith("ELEMENT, TYPE=C3D8,"):
            words = [int(word) for row in rows for word in row.split(",") if word.strip()]
            blocks.append({words[k]: tuple(words[k + 1 : k + 9]) for k in range(0, len(words), 9)})
    return points, blocks


def _faces_within(
    block: dict[int, tuple[int, ...]], points: dict[int, tuple[float, ...]], common: set[tuple[float, ...]]
) -> list[str]:
    """Faces of a block with all corners among the places that two blocks have in common."""
    return [
        f"{number}, S{k}"
        for number, corners in block.items()
        for k, face in enumerate(_FACES, 1)
        if all(points[corners[c]] in common for c in face)
    ]
