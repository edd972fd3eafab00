"""Mesh files changed at random: read right, said, or refused with file and place; never a traceback.

The original of every file is known. What is read without a word must have its elements between its nodes and,
where the format can tell, its groups. A node may move: that its elements stay sound and lie nowhere in each
other is then checked by sampling, with other means than the reader's.
"""

import logging
import re
from functools import cache
from pathlib import Path

import meshio
import numpy as np
import pytest
from bounded import bounded
from hand_meshes import HAND

from romdam.config.sections.geometry.mesh_file import MeshFileConfig
from romdam.core.scene import Material
from romdam.fem.assembly import assemble
from romdam.geometry.elements import SOLIDS
from romdam.geometry.meshes.files import MeshFiles, read_mesh_file

DATA = Path(__file__).parents[1] / "geometry" / "data"
ENDINGS = (
    ".msh", "_binary.msh", "_22.msh", "_22_binary.msh", ".bdf", "_free.bdf", "_large.bdf", ".inp",
    "_ascii.vtu", "_plain.vtu", "_zlib.vtu", "_lzma.vtu", "_raw.vtu", ".unv", ".mail", ".cdb", ".med",
)  # fmt: skip
ELEMENTS = ("hex8", "hex20", "tet4", "tet10")
BINARY = ("_binary.msh", "_22_binary.msh", "_raw.vtu", ".med")
WORDS = [
    "0",
    "-1",
    "1e300",
    "nan",
    "inf",
    "-inf",
    "99999999999",
    "1000000000",
    "2147483648",
    "1.5",
    "x",
    "",
    "1_0",
]
CONCRETE = Material(30e9, 0.2, 2400.0)
PLACE = "job.yaml: blocks.b.mesh"
SECONDS, MEMORY = 10.0, 300e6


@cache
def original(element, ending, folder):
    """Bytes of a sound file."""
    if not ending.endswith(".vtu"):
        return (DATA / f"{element}{ending}").read_bytes()
    mesh = meshio.read(DATA / f"{element}.msh")
    cells = [(c.type, c.data) for c in mesh.cells if c.type == SOLIDS[element].cell.name or c.dim == 2]
    group = [np.full(len(data), k + 1) for k, (_, data) in enumerate(cells)]
    path = folder / "made.vtu"
    how = {"_ascii": (False, None), "_plain": (True, None), "_zlib": (True, "zlib"), "_lzma": (True, "lzma")}
    binary, compression = how.get(ending[:-4], (True, None))
    made = meshio.Mesh(mesh.points, cells, cell_data={"group": group})
    made.write(path, binary=binary, compression=compression)
    return appended(path.read_text()) if ending == "_raw.vtu" else path.read_bytes()


def appended(text):
    """The same file with its arrays as raw bytes at its end."""
    import base64

    blob = b""

    def move(match):
        nonlocal blob
        head = f'{match[1]}format="appended" offset="{len(blob)}"/>'
        blob += base64.b64decode(match[2].strip())
        return head

    pattern = re.compile(r'(<DataArray[^>]*?)format="binary"[^>]*>\s*([^<]*)</DataArray>')
    body = pattern.sub(move, text).replace("</VTKFile>", "")
    return body.encode() + b'<AppendedData encoding="raw">_' + blob + b"</AppendedData></VTKFile>"


def mutate(data, rng, binary):
    """A changed copy, and what was done to it."""
    kind = rng.choice(
        [
            "byte",
            "bytes",
            "insert",
            "delete",
            "cut",
            "line",
            "swap",
            "twice",
            "word",
            "number",
            "digit",
            "chunk",
        ]
    )
    at = int(rng.integers(len(data)))
    if kind == "byte":
        return data[:at] + bytes([rng.integers(256)]) + data[at + 1 :], kind
    if kind == "bytes":
        new = (
            rng.bytes(4)
            if rng.random() < 0.5
            else int(rng.integers(-2, 60)).to_bytes(4, "little", signed=True)
        )
        return data[:at] + new + data[at + 4 :], kind
    if kind == "insert":
        return data[:at] + bytes([rng.choice(list(b" 0123456789.-+,*$\n\tE"))]) + data[at:], kind
    if kind == "delete":
        return data[:at] + data[at + 1 :], kind
    if kind == "cut":
        return data[:at], kind
    if kind == "chunk":
        return data[:at] + data[at + int(rng.integers(1, 200)) :], kind
    lines = data.split(b"\n")
    i, j = sorted(int(k) for k in rng.integers(len(lines), size=2))
    if kind in ("line", "swap", "twice"):
        changed = {
            "line": lines[:i] + lines[i + 1 :],
            "twice": [*lines[:i], lines[i], *lines[i:]],
            "swap": [*lines[:i], lines[j], *lines[i + 1 : j], lines[i], *lines[j + 1 :]] if i < j else lines,
        }
        return b"\n".join(changed[kind]), kind
    words = list(re.finditer(rb"[-+0-9.eE]+", data))
    word = words[int(rng.integers(len(words)))]
    if kind == "number":
        new = words[int(rng.integers(len(words)))].group()
    elif kind == "word":
        new = WORDS[int(rng.integers(len(WORDS)))].encode()
    else:
        text = bytearray(word.group())
        text[int(rng.integers(len(text)))] = int(rng.choice(list(b"0123456789")))
        new = bytes(text)
    return data[: word.start()] + new + data[word.end() :], kind


class Kept(logging.Handler):
    """Keeps the messages."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.found = []

    def emit(self, record):
        self.found.append(record.getMessage())


def facts(path):
    """What is read of a file: elements and groups by the file's node numbers, positions, and what was "
    "said."""
    kept = Kept()
    kept.setLevel(logging.WARNING)
    logging.getLogger("romdam").addHandler(kept)
    files = MeshFiles(path.parent)
    block = files.block("b", MeshFileConfig(file=path.name), CONCRETE, PLACE)
    file = read_mesh_file(path, f"{PLACE}.file")
    elements = [tuple(row) for c in file.cells if c.dim == 3 for row in file.tags[c.nodes].tolist()]
    groups = {
        label: sorted(
            tuple(sorted(row))
            for m, c in zip(members, file.cells, strict=True)
            for row in file.tags[c.nodes[m]].tolist()
        )
        for label, members in file.groups.items()
    }
    logging.getLogger("romdam").removeHandler(kept)
    return sorted(elements), groups, block, kept.found + files.remarks


def overlap(block):
    """Share of random points that lie in more than one element, each cut into tetrahedra."""
    corners = block.cells[:, : 8 if block.element.startswith("hex") else 4]
    split = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
    tets = block.points[corners[:, split if corners.shape[1] == 8 else [[0, 1, 2, 3]]]]
    low, high = block.points.min(axis=0), block.points.max(axis=0)
    points = low + (high - low) * np.random.default_rng(1).random((4000, 3))
    matrix = np.linalg.inv(np.swapaxes(tets[:, :, 1:] - tets[:, :, :1], 2, 3) + 1e-14 * np.eye(3))
    where = np.einsum("ctij,pctj->pcti", matrix, points[:, None, None] - tets[None, :, :, 0])
    inside = ((where > 1e-3).all(axis=3) & (where.sum(axis=3) < 1 - 1e-3)).any(axis=2)
    return float((inside.sum(axis=1) > 1).mean())


def verdict(outcome, right, ending, kind):
    """Empty where the outcome is right, else what is wrong with it."""
    if outcome.crash or outcome.seconds > SECONDS or outcome.grown > MEMORY:
        return outcome.crash[-300:] or f"{outcome.seconds:.1f} s, {outcome.grown / 1e6:.0f} MB"
    if outcome.refusal:
        named = outcome.refusal.startswith(PLACE) and f"case{ending}" in outcome.refusal
        return "" if named and "\n" not in outcome.refusal else f"names no file: {outcome.refusal}"
    elements, groups, block, said = outcome.value
    if elements != right[0]:
        lost = f"{len(elements)} of {len(right[0])} elements"
        if said:
            return ""
        return f"elements read in silence: {lost}"
    if ending.endswith(".msh") and sorted(groups.values()) != sorted(right[1].values()) and not said:
        return f"groups read in silence: {groups}"
    share = overlap(block) if block.element in ("tet4", "hex8") else 0.0
    return f"{share:.2g} of the points are in several elements" if share > 2e-3 else ""


def test_files_changed_at_random(cases, tmp_path):
    """Right, said or refused; what is gone shows in sets, nodes or numbers."""
    number = cases(24, 3000)
    wrong, ends = [], {"refused": 0, "read": 0, "said": 0}
    rights = {}
    for seed in range(number):
        rng = np.random.default_rng(seed)
        element, ending = ELEMENTS[seed % 4], ENDINGS[(seed // 4) % len(ENDINGS)]
        data = original(element, ending, tmp_path)
        path = tmp_path / f"case{ending}"
        if (element, ending) not in rights:
            path.write_bytes(data)
            rights[element, ending] = facts(path)
        changed, kind = mutate(data, rng, ending in BINARY)
        path.write_bytes(changed)
        outcome = bounded(lambda path=path: facts(path), SECONDS)
        found = verdict(outcome, rights[element, ending], ending, kind)
        if found:
            wrong.append(f"seed {seed} ({element}{ending}, {kind}): {found}")
        else:
            ends["refused" if outcome.refusal else "said" if outcome.value[3] else "read"] += 1
    print(ends)
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("name", HAND)
def test_meshes_made_by_hand(name, tmp_path):
    """Each trap is read with the volume it holds, perhaps with a word, or refused with its reason."""
    file, text, expected = HAND[name]
    for path, content in text.items() if isinstance(text, dict) else [(file, text)]:
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(content)
    files = MeshFiles(tmp_path)

    def volume():
        block = files.block("b", MeshFileConfig(file=file), CONCRETE, PLACE)
        return float(assemble(block)[1].sum() / 3.0 / CONCRETE.rho), files.remarks

    outcome = bounded(volume, SECONDS)
    assert not outcome.crash and outcome.grown < MEMORY
    if not isinstance(expected, str):
        holds, word = expected if isinstance(expected, tuple) else (expected, "")
        assert not outcome.refusal and outcome.value[0] == pytest.approx(holds, rel=1e-9)
        assert not word or any(word in remark for remark in outcome.value[1])
    else:
        assert outcome.refusal.startswith(PLACE) and str(tmp_path / file) in outcome.refusal
        assert expected in outcome.refusal
