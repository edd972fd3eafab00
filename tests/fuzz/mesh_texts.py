"""Two cubes, and the texts of mesh files of each format."""

import base64
import struct
from collections.abc import Callable, Iterable, Sequence
from typing import Any

Point = Sequence[float]
Cells = Sequence[Sequence[int]]
Array = Callable[[str, str, Sequence[Any], str, int], str]

CUBES: list[tuple[float, float, float]] = [(x, y, z) for z in (0, 1, 2) for y in (0, 1) for x in (0, 1)]
HEX = [[1, 2, 4, 3, 5, 6, 8, 7], [5, 6, 8, 7, 9, 10, 12, 11]]
TETS = [[1, 2, 4, 8], [1, 2, 8, 6], [1, 4, 3, 8], [1, 3, 7, 8], [1, 7, 5, 8], [1, 5, 6, 8]]
SLAB = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]


def grids(points: Sequence[Point] = CUBES, form: str = "GRID,{0},,{1},{2},{3}", first: int = 1) -> list[str]:
    return [form.format(k, *(float(x) for x in p)) for k, p in enumerate(points, start=first)]


def chexa(
    cells: Cells = HEX, pid: int = 1, form: str = "CHEXA,{0},{1},{2},+\n+,{3}", first: int = 1
) -> list[str]:
    return [
        form.format(k, pid, ",".join(map(str, c[:6])), ",".join(map(str, c[6:])))
        for k, c in enumerate(cells, first)
    ]


def bdf(*lines: str | list[str]) -> str:
    return "\n".join(
        [*(x for part in lines for x in ([part] if isinstance(part, str) else part)), "ENDDATA", ""]
    )


def small(points: Sequence[Point] = CUBES, cells: Cells = HEX, mark: tuple[str, str] = ("", "")) -> str:
    lines = [f"GRID    {k:<8}{'':8}{x:<8.4f}{y:<8.4f}{z:<8.4f}" for k, (x, y, z) in enumerate(points, 1)]
    for k, c in enumerate(cells, 1):
        words = "".join(f"{n:<8}" for n in (k, 1, *c[:6]))
        lines += [f"CHEXA   {words}{mark[0]}", f"{mark[1]:<8}{c[6]:<8}{c[7]:<8}"]
    return bdf(lines)


def msh(
    points: Sequence[Point] = CUBES,
    cells: Cells = HEX,
    kind: int = 5,
    tags: str = "2 1 1",
    numbers: Iterable[int] | None = None,
    ids: Iterable[int] | None = None,
    head: str = "2.2 0 8",
    extra: str = "",
) -> str:
    numbers, ids = numbers or range(1, len(points) + 1), ids or range(1, len(cells) + 1)
    nodes = "\n".join(f"{n} {' '.join(map(str, p))}" for n, p in zip(numbers, points, strict=True))
    rows = "\n".join(f"{i} {kind} {tags} {' '.join(map(str, c))}" for i, c in zip(ids, cells, strict=True))
    return (
        f"$MeshFormat\n{head}\n$EndMeshFormat\n{extra}$Nodes\n{len(points)}\n{nodes}\n$EndNodes\n"
        f"$Elements\n{len(cells)}\n{rows}\n$EndElements\n"
    )


def msh4(nodes: str, elements: str, entities: str = "", extra: str = "") -> str:
    part = f"$Entities\n{entities}\n$EndEntities\n" if entities else ""
    return (
        f"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n{extra}{part}$Nodes\n{nodes}\n$EndNodes\n"
        f"$Elements\n{elements}\n$EndElements\n"
    )


NODES4 = (
    "1 12 1 12\n3 1 0 12\n"
    + " ".join(map(str, range(1, 13)))
    + "\n"
    + "\n".join(" ".join(map(str, p)) for p in CUBES)
)
CELLS4 = "1 2 1 2\n3 1 5 2\n" + "\n".join(f"{k} {' '.join(map(str, c))}" for k, c in enumerate(HEX, 1))

_AT = "\n".join(f"{k} {' '.join(map(str, p))}" for k, p in enumerate(CUBES, 1))
# $Entities of a volume in group 7, and of a point, whose box has six numbers; nodes of two entities
OLD4 = (
    "$MeshFormat\n4 0 8\n$EndMeshFormat\n$Entities\n1 0 0 1\n1 0 0 0 0 0 0 0\n"
    "1 0 0 0 1 1 2 1 7 0\n$EndEntities\n$Nodes\n2 12\n1 0 0 1\n"
    + _AT.replace("\n", "\n1 3 0 11\n", 1)
    + "\n$EndNodes\n$Elements\n1 2\n1 3 5 2\n"
    + "\n".join(f"{k} {' '.join(map(str, c))}" for k, c in enumerate(HEX, 1))
    + "\n$EndElements\n"
)
OLDEST = (
    f"$NOD\n12\n{_AT}\n$ENDNOD\n$ELM\n2\n"
    + "\n".join(f"{k} 5 1 1 8 {' '.join(map(str, c))}" for k, c in enumerate(HEX, 1))
    + "\n$ENDELM\n"
)


def inp(
    points: Sequence[Point] = CUBES,
    cells: Cells = HEX,
    kind: str = "C3D8",
    more: str = "",
    node: str = "*NODE",
    numbers: Iterable[int] | None = None,
) -> str:
    numbers = numbers or range(1, len(points) + 1)
    nodes = "\n".join(f"{n}, {x}, {y}, {z}" for n, (x, y, z) in zip(numbers, points, strict=True))
    rows = "\n".join(f"{k}, {', '.join(map(str, c))}" for k, c in enumerate(cells, 1))
    return f"*HEADING\n{node}\n{nodes}\n*ELEMENT, TYPE={kind}\n{rows}\n{more}"


def assembly(instances: str) -> str:
    """Two cubes as a part, and instances of it."""
    part = inp().removeprefix("*HEADING\n")
    return f"*HEADING\n*PART, NAME=p\n{part}*END PART\n*ASSEMBLY, NAME=A\n{instances}\n*END ASSEMBLY\n"


def vtu(
    points: Sequence[Point] = CUBES,
    cells: Cells = HEX,
    kind: int = 12,
    count: int | None = None,
    array: Array | None = None,
    attributes: str = "",
    pieces: int = 1,
    offsets: list[int] | None = None,
) -> str:
    """Text, or arrays as `array` writes them."""

    def data(name: str, kind: str, values: Sequence[Any], code: str, width: int = 1) -> str:
        if array is not None:
            return array(name, kind, values, code, width)
        numbers = " ".join(map(str, values))
        head = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" format="ascii">'
        return f"{head}{numbers}</DataArray>"

    ends = offsets or [sum(map(len, cells[: k + 1])) for k in range(len(cells))]
    body = (
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{count or len(cells)}"><Points>'
        + data("Points", "Float64", [x for p in points for x in p], "d", 3)
        + "</Points><Cells>"
        + data("connectivity", "Int64", [n - 1 for c in cells for n in c], "q")
        + data("offsets", "Int64", ends, "q")
        + data("types", "UInt8", [kind] * len(cells), "B")
        + "</Cells></Piece>"
    )
    return (
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" {attributes}>'
        f"<UnstructuredGrid>{body * pieces}</UnstructuredGrid></VTKFile>"
    )


def packed(size: int) -> Array:
    """Arrays in base64; the header is coded by itself where `size` is 8."""

    def array(name: str, kind: str, values: Sequence[Any], code: str, width: int) -> str:
        raw = struct.pack(f"<{len(values)}{code}", *values)
        head = struct.pack("<Q" if size == 8 else "<I", len(raw))
        text = base64.b64encode(head) + base64.b64encode(raw) if size == 8 else base64.b64encode(head + raw)
        return (
            f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" format="binary">'
            f"{text.decode()}</DataArray>"
        )

    return array


def moved(points: Sequence[Point], by: Point, which: Iterable[int] | None = None) -> list[Point]:
    return [tuple(a + b for a, b in zip(p, by, strict=True)) if which is None or k in which else p
            for k, p in enumerate(points)]  # fmt: skip


def stretched(points: Sequence[Point], factor: float) -> list[Point]:
    return [tuple(factor * x for x in p) for p in points]
