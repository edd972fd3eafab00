"""What files and texts say, as a few numbers of each array, table and text.

An array is reduced to its shape, the number of NaN, its largest value, mean, root mean square and two sums
with weights that no permutation, sign or shift leaves as they are. Of a text count the numbers and the units
that stand after them, not its words.

What depends on the machine is left out. Modes of equal frequency turn in their plane with the last digit of a
matrix, so only the length of a vector of modal coordinates counts. Printed numbers below a floor are rounding
errors. A duration above a threshold moves with the root of an error where its signal touches the threshold.
"""

from __future__ import annotations

import csv
import html
import io
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import meshio
import numpy as np

Entry = list[Any]  # a kind, then numbers
Digest = dict[str, Entry]

TOLERANCE = 1e-6  # of an array's largest value; of each number of a text
FLOOR = 1e-12  # what is smaller in SI is zero
FORCE_FLOOR = 1e-4  # the same of what has the unit N, N m, Pa or J
PRINTED_FLOOR = 1e-9  # what is smaller as printed is zero
CROSSING_TOLERANCE = 1e-4  # of an array's largest value, where values are durations between crossings
LONGEST = 60  # numbers of a text that are kept one by one
_BOOKKEEPING = {  # of HDF5 and of netCDF
    "CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "DIMENSION_LABELS", "_Netcdf4Dimid",
    "_Netcdf4Coordinates", "_NCProperties", "_nc3_strict",
}  # fmt: skip
# clock, machine, version, checksums, and what is of the size of rounding errors
NOISE = re.compile(
    r"seconds|cpu|iterations|residual$|energy_residual|residual \[|largest_residual|whole_run|costs_s"
    r"|integration_s|wall"
    r"|_date|^date|creat|history|version|written|sha256|digest|^path$|folder|^file$|_file\b|host|machine|threads"
    r"|bytes|memory|imbalance|romdam|uuid|identity|^command|platform|python|packages|libraries",
    re.IGNORECASE,
)
# lines of texts that say the same
NOISY_LINE = re.compile(
    r"CPU|, about [0-9.]+ s,|wall clock|written|\.log|version|SHA|/tmp|bytes|[0-9] (?:MB|GB|kB)\b"
    r"|residual of|residual:|imbalance"
    r"|rounding|reduced blocks|Python|processor|romdam [0-9]|\b20[0-9]{2}-[0-9]{2}-[0-9]{2}",
    re.IGNORECASE,
)
# modal coordinates along the last axis, of which modes of equal frequency leave only the length
MODAL = re.compile(r"reduced_coordinates|final_state:(?:[aqv]|model:(?:force|load|participation))$")
SIGN_IS_FREE = re.compile("participation$")  # of each mode
CROSSINGS = re.compile("duration")
_OF_FORCE = re.compile(r"(?:^|\[)(?:N|N m|Pa|J)(?:$|\])")  # a unit, in a heading or a long name too
_NOISY_ROW = re.compile("CPU|seconds|wall time|largest residual|ledger lacks|not accounted for")  # of a table
_UNSETTLED = re.compile(r"still moved \S+ of [^\s)]+")  # of an iteration without end
FINGERPRINT = re.compile(r"-[0-9a-f]{12}\b")  # in the name of a file: of the code as well
_POWER = re.compile("·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_NUMBER = re.compile(
    r"(?<![\w.])([-+]?(?:[0-9]+(?:,[0-9]{3})+|[0-9]+)(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?)\s?(%|[A-Za-z]+[A-Za-z0-9/]*)?"
)
_UNITS = {
    "%", "m", "mm", "cm", "km", "s", "ms", "Hz", "N", "kN", "MN", "GN", "Pa", "kPa", "MPa", "GPa", "t", "kg",
    "m2", "m3", "g", "in", "ft", "psi", "ksi", "kip", "K", "J", "kJ", "MJ", "times", "gaps", "modes", "steps",
    "nodes", "elements", "degrees", "MNm", "m/s", "m/s2", "GPa/m", "MN/m",
}  # fmt: skip


def of_array(values: np.ndarray, floor: float = FLOOR) -> Entry:
    """Shape, NaN, largest, mean, rms and two weighted sums over the root of the number."""
    x = np.asarray(values, dtype=float).ravel()
    shape = "x".join(map(str, np.shape(values)))
    whole = x[np.isfinite(x)]
    largest = float(np.abs(whole).max(initial=0.0))
    if not len(whole) or largest < floor:
        return [shape, len(x) - len(whole), 0.0]
    numbers = [largest]
    if len(x) > 1:
        i, n = np.arange(len(x))[np.isfinite(x)], math.sqrt(len(whole))
        numbers += [
            float(whole.mean()),
            float(np.sqrt(np.mean((whole / largest) ** 2))) * largest,
            float(whole @ np.cos(0.7 * i + 0.3)) / n,
            float(whole @ np.cos(1.9 * np.sqrt(i + 1.0) + 0.11 * i)) / n,
        ]
    return [shape, len(x) - len(whole), *(_rounded(number) for number in numbers)]


def of_modal(values: np.ndarray) -> Entry:
    """Shape of modal coordinates, and what `of_array` has of their lengths along the last axis."""
    shape = "x".join(map(str, np.shape(values)))
    return [shape, *of_array(np.linalg.norm(np.atleast_1d(values), axis=-1))[1:]]


def of_text(text: str) -> Entry:
    """Its numbers, or sums of them where there are many, and how often which unit stands after one."""
    numbers, units = [], Counter[str]()
    for line in text.splitlines():
        if NOISY_LINE.search(line):
            continue
        plain = FINGERPRINT.sub("", _UNSETTLED.sub("", line))
        plain = _POWER.sub(lambda power: f"e{power[1].translate(_RAISED)}", plain)
        for printed, after in _NUMBER.findall(plain):
            number = float(printed.replace(",", ""))
            numbers.append(0.0 if abs(number) < PRINTED_FLOOR else number)
            units.update({after} & _UNITS)
    after = " ".join(f"{unit}*{count}" for unit, count in sorted(units.items()))
    if len(numbers) <= LONGEST:
        return ["numbers", after, *(_rounded(number) for number in numbers)]
    x = np.array(numbers)
    return ["text", after, of_array(x), of_array(np.arcsinh(1e4 * x))]


def _rounded(number: float) -> float:
    return 0.0 if abs(number) < FLOOR else float(f"{number:.9g}")


def of_file(path: Path, name: str) -> Iterator[tuple[str, Entry]]:
    """Each thing in a file by its name; nothing of pictures, archives and bases."""
    suffix = path.suffix.lower()
    if suffix == ".nc":
        with h5py.File(path, "r") as file:
            yield from _of_hdf5(file, name)
    elif suffix in (".csv", ".parquet"):
        yield from _of_table(path, name)
    elif suffix == ".json":
        yield name, of_leaves(json.loads(path.read_text(encoding="utf-8")))
    elif suffix == ".html":
        yield name, of_text(words_of(path.read_text(encoding="utf-8")))
    elif suffix == ".vtu":
        mesh = meshio.read(path)
        yield f"{name}:points", of_array(mesh.points)
        for key, values in (mesh.point_data | mesh.cell_data).items():
            yield f"{name}:{key}", of_array(np.concatenate([np.ravel(part) for part in values]))
    elif suffix in (".npz", ".npy"):
        loaded = np.load(path)
        for key, values in loaded.items() if suffix == ".npz" else [("", loaded)]:
            if np.asarray(values).dtype.kind in "fiub":
                yield f"{name}:{key}", of_array(values)
    elif suffix not in (".png", ".pdf", ".h5", ".log", ".gif", ".lock", ".zip", ".xlsx", ".yaml"):
        try:
            yield name, of_text(path.read_text(encoding="utf-8"))
        except UnicodeDecodeError:
            return


def _of_hdf5(group: h5py.Group, name: str) -> Iterator[tuple[str, Entry]]:
    yield from _of_attributes(group, name)
    for key, node in sorted(group.items()):
        if NOISE.search(key):
            continue
        inner = f"{name}:{key}"
        if isinstance(node, h5py.Group):
            yield from _of_hdf5(node, inner)
            continue
        values = node[()]
        if np.asarray(values).dtype.kind in "fiub":
            said = [str(node.attrs.get(text, "")) for text in ("units", "long_name")]
            floor = FORCE_FLOOR if any(map(_OF_FORCE.search, said)) else FLOOR
            values = np.abs(values) if SIGN_IS_FREE.search(inner) else values
            yield inner, of_modal(values) if MODAL.search(inner) else of_array(values, floor)
        else:
            texts = [t.decode() if isinstance(t, bytes) else str(t) for t in np.ravel(values)]
            yield inner, of_text("\n".join(texts))
        yield from _of_attributes(node, inner)


def _of_attributes(node: Any, name: str) -> Iterator[tuple[str, Entry]]:
    """Numbers one by one; the numbers of all texts together."""
    texts = []
    for key, value in sorted(node.attrs.items()):
        if key in _BOOKKEEPING or NOISE.search(key):
            continue
        if isinstance(value, (bytes, str)):
            text = value.decode() if isinstance(value, bytes) else value
            texts.append(f"{key}: {text}")
            if key == "run_warnings":
                yield f"{name}@{key}", ["count", len(json.loads(text))]
        elif np.asarray(value).dtype.kind in "fiub":
            entry = of_array(np.asarray(value))
            yield f"{name}@{key}", entry
    found = of_text("\n".join(texts))
    if len(found) > 2:
        yield f"{name}@", found


def _of_table(path: Path, name: str) -> Iterator[tuple[str, Entry]]:
    """Columns of numbers, and the numbers in what is text."""
    if path.suffix == ".parquet":
        return
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = list(csv.reader(io.StringIO("\n".join(lines))))
    if not rows:
        return
    for column, head in enumerate(rows[0]):
        if NOISE.search(head):
            continue
        cells = [row[column] if column < len(row) else "" for row in rows[1:]]
        values = [_number(cell) for cell in cells]
        kept = [value for value in values if value is not None]
        if kept and len(kept) > len(values) / 2:
            yield (
                f"{name}:{head}",
                of_array(
                    np.array([math.nan if value is None else value for value in values]),
                    FORCE_FLOOR if _OF_FORCE.search(head) else FLOOR,
                ),
            )
        elif cells:
            yield f"{name}:{head}", of_text("\n".join(cells))


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def of_leaves(value: Any) -> Entry:
    """Numbers of a JSON document, and those in its texts."""
    return of_text("\n".join(_leaves(value)))


def _leaves(value: Any) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if not NOISE.search(key):
                yield from _leaves(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _leaves(inner)
    elif isinstance(value, bool) or value is None:
        yield str(value)
    elif isinstance(value, float):
        yield f"{value:.9g}"
    else:
        yield str(value)


def words_of(page: str) -> str:
    """What a page says, without its pictures, programs and CPU times; a line for each cell and paragraph."""
    page = re.sub(r"<tr\b.*?</tr>|<div><dt>.*?</div>", _untimed, page, flags=re.DOTALL)
    page = re.sub(r"<(script|style|svg)\b.*?</\1>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", "\n", page))


def _untimed(row: re.Match[str]) -> str:
    return "" if _NOISY_ROW.search(row[0]) else row[0]


def of_figure(figure: Any) -> Entry:
    """Curves, points, bars, limits and texts of a figure of matplotlib, in one entry."""
    numbers: list[np.ndarray] = []
    texts: list[str] = []
    for axes in figure.axes:
        numbers += [np.ravel(axes.get_xlim()), np.ravel(axes.get_ylim())]
        numbers += [np.ravel(np.asarray(line.get_xydata(), dtype=float)) for line in axes.lines]
        for drawn in axes.collections:
            numbers += [np.ravel(np.ma.filled(np.ma.asarray(drawn.get_offsets(), dtype=float), np.nan))]
            corners = [np.ravel(path.vertices) for path in drawn.get_paths()]
            numbers += [np.sort(np.concatenate(corners))] if corners else []  # of triangles the order is free
            if drawn.get_array() is not None:
                numbers += [np.ravel(np.ma.filled(np.ma.asarray(drawn.get_array(), dtype=float), np.nan))]
        numbers += [np.ravel(patch.get_path().vertices) for patch in axes.patches]
        texts += [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), *(t.get_text() for t in axes.texts)]
        legend = axes.get_legend()
        texts += [] if legend is None else [t.get_text() for t in legend.get_texts()]
    sums = [of_array(part) for part in numbers]
    spread = np.array([value for entry in sums for value in entry[2:]])
    words = of_text("\n".join(texts))
    return ["figure", len(figure.axes), of_array(spread), of_array(np.arcsinh(1e4 * spread)), words]


def differences(before: Digest, after: Digest) -> list[str]:
    """What is other: a line for each thing, with what it was and what it is."""
    lines = [f"{name}: is no longer there" for name in before if name not in after]
    lines += [f"{name}: is new" for name in after if name not in before]
    for name in before:
        tolerance = CROSSING_TOLERANCE if CROSSINGS.search(name) else TOLERANCE
        if name in after and (why := _differs(before[name], after[name], tolerance)):
            lines.append(f"{name}: {why}")
    return lines


def _differs(before: Sequence[Any], after: Sequence[Any], tolerance: float) -> str:
    if len(before) != len(after):
        return f"{_shown(before)} -> {_shown(after)}"
    each = before[0] in ("numbers", "count")
    floor = PRINTED_FLOOR if each else FLOOR
    scale = max((abs(x) for x in (*before[2:], *after[2:]) if isinstance(x, (int, float))), default=0.0)
    for old, new in zip(before, after, strict=True):
        if isinstance(old, list):
            if isinstance(new, list) and (why := _differs(old, new, tolerance)):
                return why
        elif isinstance(old, str) or isinstance(new, str):
            if old != new:
                return f"{old} -> {new}"
        elif abs(old - new) > max(tolerance * (max(abs(old), abs(new)) if each else scale), floor):
            return f"{_shown(before)} -> {_shown(after)}"
    return ""


def _shown(entry: Iterable[Any]) -> str:
    text = json.dumps(list(entry), ensure_ascii=False)
    return text if len(text) < 240 else f"{text[:236]} ...]"
