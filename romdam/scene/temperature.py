"""Changes of temperature of blocks: the same everywhere, or at every node from a table less the closure's.

Three kinds of tables: of the upstream and the downstream face by elevation, of scattered points, and of the
nodes of a mesh file. Each may have a month in every row, of which the load names one.

References
----------
Stucky, Derron, Problèmes thermiques posés par la construction des barrages-réservoirs (1957): a slab whose
faces have periodic temperatures, and the mean and linear part that beams and shells respond to. Carslaw,
Jaeger, Conduction of Heat in Solids, 2nd ed. (1959), 3.6: each harmonic.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from romdam.config.quantities import CELSIUS, TemperatureUnit, to_si
from romdam.config.sections.loads import (
    FaceTemperaturesConfig,
    NodeTemperaturesConfig,
    PointTemperaturesConfig,
    TemperatureConfig,
)
from romdam.core.arrays import Floats
from romdam.core.csv_table import Table, read_table
from romdam.core.errors import ConfigError
from romdam.core.scene import Block
from romdam.geometry.meshes.files import MeshFiles
from romdam.geometry.nearest import nearest
from romdam.scene.select import select_facets
from romdam.scene.thickness import UpstreamSurface, share_of_thickness

YEAR = 365.25 * 86400.0  # s
_ROUND_OFF = 1e-6  # of the range of a table's elevations, by which a node may lie beyond it
_THIN = 1e-4  # of a slab's z = h sqrt(i omega / a): below it its temperature is linear to 1e-9


def temperature_change(
    load: TemperatureConfig,
    names: Sequence[str],
    blocks: Mapping[str, Block],
    files: MeshFiles,
    location: str,
) -> dict[str, float | Floats]:
    """Change of temperature of blocks: name -> of the whole block, or (n,) of its nodes [K].

    Parameters
    ----------
    names : of the blocks
    files : that the blocks come from, of which `nodes` needs the numbers
    location : file and key, for messages

    Raises
    ------
    ConfigError
        for tables that cannot be read or do not cover the blocks, months that they lack, and nodes whose
        place between the faces cannot be told.
    """
    if load.faces is not None:
        temperature = _of_faces(load.faces, load.month, names, blocks, files.folder, f"{location}.faces")
    elif load.points is not None:
        temperature = _of_points(load.points, load.month, names, blocks, files.folder, f"{location}.points")
    elif load.nodes is not None:
        temperature = _of_nodes(load.nodes, load.month, names, blocks, files, f"{location}.nodes")
    else:
        assert load.change is not None
        return dict.fromkeys(names, load.change)
    return {name: values - load.reference_of(name) for name, values in temperature.items()}


def temperature_changes(
    loads: Sequence[TemperatureConfig],
    blocks: Mapping[str, Block],
    files: MeshFiles,
    source: str,
    key: str = "loads.temperature",
) -> dict[str, float | Floats]:
    """Change of temperature that a list of loads names: block name -> of the block, or (n,) of its nodes [K].

    Parameters
    ----------
    key : of the list, for messages

    Raises
    ------
    ConfigError
        as `temperature_change`; for blocks without thermal expansion, and blocks that are named twice.
    """
    changes, warmed = dict[str, float | Floats](), dict[str, int]()
    for k, load in enumerate(loads):
        location = f"{source}: {key}[{k}]"
        names = load.blocks or [name for name, block in blocks.items() if block.material.expansion > 0.0]
        stiff = [name for name in names if blocks[name].material.expansion == 0.0]
        if stiff or not names:
            what = f"block {stiff[0]!r} is of a material" if stiff else "no block is of a material"
            raise ConfigError(
                f"{location}: {what} "
                f"{'without' if stiff else 'with'} thermal expansion; give materials.<name>.expansion, "
                "about 1e-5 1/K for concrete"
            )
        for name in names:
            if name in warmed:
                earlier = loads[warmed[name]].change
                change = "" if earlier is None else f" ({earlier:g} K)"
                raise ConfigError(
                    f"{location}: the change of block {name!r} is named by "
                    f"{key}[{warmed[name]}] already{change}, limit once; name each "
                    "block once, with its whole change"
                )
            warmed[name] = k
        changes |= temperature_change(load, names, blocks, files, location)
    return changes


def slab_weights(
    share: Floats,
    thickness: Floats,
    period: float,
    diffusivity: float,
    through: Literal["equivalent", "harmonic"],
) -> tuple[Floats, Floats]:
    """Complex shares of the amplitudes of both faces in that of the temperature between them, (n,), (n,).

    With z = h sqrt(i omega / a) a slab has (U sinh z(1 - s) + D sinh z s) / sinh z where its faces have U and
    D. The mean of that is (U + D) tanh(z/2) / z, and the difference between the faces of the straight line
    with the same first moment is (D - U) (6/z) (coth(z/2) - 2/z).

    Parameters
    ----------
    share : (n,) s, distance from the upstream face as a share of the thickness
    thickness : (n,) h [m]
    period : 2 pi / omega [s]
    diffusivity : a [m2/s]
    through : the whole solution, or its mean and linear part
    """
    z = thickness * np.sqrt(2j * np.pi / period / diffusivity)
    thin = np.abs(z) < _THIN
    z = np.where(thin, 1.0, z)
    if through == "harmonic":  # exponentials of what decays only
        decay = 1.0 - np.exp(-2.0 * z)
        upstream = np.exp(-z * share) * (1.0 - np.exp(-2.0 * z * (1.0 - share))) / decay
        downstream = np.exp(-z * (1.0 - share)) * (1.0 - np.exp(-2.0 * z * share)) / decay
    else:
        tanh = (1.0 - np.exp(-z)) / (1.0 + np.exp(-z))  # of z / 2
        mean, linear = tanh / z, 6.0 / z * (1.0 / tanh - 2.0 / z)
        upstream, downstream = mean - linear * (share - 0.5), mean + linear * (share - 0.5)
    return np.where(thin, 1.0 - share, upstream), np.where(thin, share, downstream)


@dataclass(frozen=True)
class _Rows:
    """The rows of a table of one month; `label` says which, for messages."""

    columns: Mapping[str, Floats]
    label: str


def _months(columns: Mapping[str, Floats], month: int | None, table: Table, *, every: bool) -> list[_Rows]:
    """Rows of the month that a load names, or of all twelve; all rows of a table without months."""
    if "month" not in columns:
        if month is not None or every:
            why = f"month: {month} is asked for" if not every else "twelve months are needed"
            raise ConfigError(f"{table.where} has no column month, and {why}; add the column, 1 to 12")
        return [_Rows(columns, "")]
    numbers = columns["month"]
    if (wrong := np.flatnonzero((numbers != np.round(numbers)) | (numbers < 1) | (numbers > 12))).size:
        raise ConfigError(f"{table.at(wrong[0])}: month is {numbers[wrong[0]]:g}; write 1 to 12")
    there = sorted({int(number) for number in numbers})
    if month is None:
        raise ConfigError(
            f"{table.where} has months ({_numbers(there)}), and the load names none; give `month`, 1 to 12"
        )
    wanted = range(1, 13) if every else (month,)
    if missing := [k for k in wanted if k not in there]:
        needed = "; conduction of heat needs all twelve" if every else ""
        raise ConfigError(
            f"{table.where} has no rows of month {_numbers(missing)}, only of "
            f"{_numbers(there)}{needed}; add them"
        )
    return [
        _Rows({key: values[numbers == k] for key, values in columns.items()}, f" of month {k}")
        for k in wanted
    ]


def _celsius(values: Floats, unit: TemperatureUnit, table: Table) -> Floats:
    """Temperatures [degC] of a table; those below absolute zero are refused."""
    zero, degree = CELSIUS[unit]
    celsius = zero + degree * values
    if (cold := np.flatnonzero(celsius < CELSIUS["K"][0])).size:
        raise ConfigError(
            f"{table.at(cold[0])}: {values[cold[0]]:g} {unit} is below absolute zero; is `unit` right?"
        )
    return celsius


def _of_faces(
    config: FaceTemperaturesConfig,
    month: int | None,
    names: Sequence[str],
    blocks: Mapping[str, Block],
    folder: Path,
    location: str,
) -> dict[str, Floats]:
    """Temperature of the blocks' nodes between their upstream and downstream faces, (n,) each [degC]."""
    path, sides = folder / config.table, ("upstream", "downstream")
    row = f"one elevation per line, {config.length} and {config.unit}"
    table = read_table(path, location=location)
    columns = table.columns(("elevation", *sides), row, optional="month")
    scale = to_si(f"1 {config.length}", "m")
    columns |= {side: _celsius(columns[side], config.unit, table) for side in sides}
    columns["elevation"] = columns["elevation"] * scale
    months = _months(columns, month, table, every=config.through != "linear")
    surfaces = {
        side: UpstreamSurface.of(
            {
                name: (
                    blocks[name].points,
                    select_facets(blocks[name], getattr(config, side), f"{location}.{side}"),
                )
                for name in names
            }
        )
        for side in sides
    }
    temperature = {}
    for name in names:
        points = blocks[name].points
        share, thickness = share_of_thickness(
            name, points, surfaces["upstream"], surfaces["downstream"], location
        )
        upstream, downstream = (
            np.stack([_at_elevations(rows, side, points, name, path, location) for rows in months])
            for side in sides
        )
        if config.through == "linear":
            temperature[name] = (1.0 - share) * upstream[0] + share * downstream[0]
            continue
        assert month is not None and config.diffusivity is not None  # twelve months are there
        harmonics = zip(np.fft.rfft(upstream, axis=0), np.fft.rfft(downstream, axis=0), strict=True)
        total = np.zeros(len(points))
        for k, (u, d) in enumerate(harmonics):
            shares = (
                slab_weights(share, thickness, YEAR / k, config.diffusivity, config.through)
                if k
                else (1.0 - share, share)
            )
            once = k in (0, 6)  # the mean and the highest harmonic have no conjugate
            turned = (u * shares[0] + d * shares[1]) * np.exp(2j * np.pi * k * (month - 1) / 12)
            total += (1.0 if once else 2.0) / 12 * turned.real
        temperature[name] = total
    return temperature


def _at_elevations(rows: _Rows, side: str, points: Floats, block: str, path: Path, location: str) -> Floats:
    """Temperature of a face at the elevations of nodes (n,) [degC], linear between the rows."""
    elevation, values = rows.columns["elevation"], rows.columns[side]
    if len(elevation) > 1 and elevation[0] > elevation[-1]:
        elevation, values = elevation[::-1], values[::-1]
    if (wrong := np.flatnonzero(np.diff(elevation) <= 0.0)).size:
        first, second = elevation[wrong[0]], elevation[wrong[0] + 1]
        raise ConfigError(
            f"{location}: {path}: the elevations{rows.label} neither rise nor fall from row to row: "
            f"{first:g} m stands beside {second:g} m; sort them, each once"
        )
    z, slack = points[:, 2], _ROUND_OFF * (elevation[-1] - elevation[0])
    beyond = (z < elevation[0] - slack) | (z > elevation[-1] + slack)
    if beyond.any():
        first = points[np.flatnonzero(beyond)[0]]
        raise ConfigError(
            f"{location}: {path} covers elevations {elevation[0]:g} to {elevation[-1]:g} m{rows.label}, and "
            f"{beyond.sum()} of {len(z)} nodes of block {block!r}, which spans {z.min():g} to {z.max():g} m, "
            f"lie beyond, limit 0; the first is at {_at(first)}; add rows, or name other `blocks`"
        )
    return np.interp(z, elevation, values)


def _of_points(
    config: PointTemperaturesConfig,
    month: int | None,
    names: Sequence[str],
    blocks: Mapping[str, Block],
    folder: Path,
    location: str,
) -> dict[str, Floats]:
    """Temperature of the blocks' nodes from scattered points, linear in Delaunay's tetrahedra [degC]."""
    from scipy.interpolate import LinearNDInterpolator  # here: half a second that few scenes need
    from scipy.spatial import QhullError

    path = folder / config.table
    row = f"one point per line, {config.length} and {config.unit}"
    table = read_table(path, location=location)
    columns = table.columns(("x", "y", "z", "temperature"), row, optional="month")
    columns["temperature"] = _celsius(columns["temperature"], config.unit, table)
    (rows,) = _months(columns, month, table, every=False)
    points = np.stack([rows.columns[axis] for axis in "xyz"], axis=1) * to_si(f"1 {config.length}", "m")
    values = rows.columns["temperature"]
    _, first, again = np.unique(points, axis=0, return_index=True, return_inverse=True)
    same = first[again.ravel()]
    if (differing := np.flatnonzero(values != values[same])).size:
        k = differing[0]
        raise ConfigError(
            f"{location}: {path} has two temperatures{rows.label} at {_at(points[k])}: "
            f"{values[same[k]]:g} and {values[k]:g} degC; leave one"
        )
    try:
        interpolate = LinearNDInterpolator(points[first], values[first])
    except (QhullError, ValueError):
        low, high = points.min(axis=0), points.max(axis=0)
        raise ConfigError(
            f"{location}: {path}: the {len(first)} points{rows.label}, from {_at(low)} to {_at(high)}, span "
            "no volume; add points beside their plane, or give temperatures of both `faces`"
        ) from None
    temperature = {}
    for name in names:
        at = blocks[name].points
        found = np.asarray(interpolate(at)).ravel()
        lost = np.flatnonzero(np.isnan(found))
        distance, number = nearest(points, at[lost])
        found[lost] = values[number]
        outside = lost[distance > config.tolerance]
        if outside.size:
            worst = lost[distance.argmax()]
            raise ConfigError(
                f"{location}: {outside.size} of {len(at)} nodes of block {name!r} lie outside of the points "
                f"of {path}, limit 0; the one farthest from any, {distance.max():.4g} m, is at "
                f"{_at(at[worst])} "
                f"(tolerance {config.tolerance:g} m); add points around the block, or raise `tolerance`"
            )
        temperature[name] = found
    return temperature


def _of_nodes(
    config: NodeTemperaturesConfig,
    month: int | None,
    names: Sequence[str],
    blocks: Mapping[str, Block],
    files: MeshFiles,
    location: str,
) -> dict[str, Floats]:
    """Temperature of the blocks' nodes by their numbers in the mesh file [degC]."""
    path = files.folder / config.table
    table = read_table(path, location=location)
    columns = table.columns(("node", "temperature"), "one node per line", optional="month")
    columns["temperature"] = _celsius(columns["temperature"], config.unit, table)
    (rows,) = _months(columns, month, table, every=False)
    listed_nodes, values = rows.columns["node"], rows.columns["temperature"]
    order = np.argsort(listed_nodes, kind="stable")
    listed_nodes, values = listed_nodes[order], values[order]
    if (twice := np.flatnonzero(np.diff(listed_nodes) == 0.0)).size:
        raise ConfigError(
            f"{location}: {path} names node {listed_nodes[twice[0]]:g}{rows.label} twice; leave one"
        )
    temperature = {}
    for name in names:
        numbers = files.node_numbers.get(name)
        if numbers is None or name not in blocks:
            raise ConfigError(
                f"{location}: the nodes of block {name!r} have no numbers of a mesh file, as it is a box, of "
                "a generated dam, cut or refined; give temperatures of `points` or `faces`, or name other "
                "`blocks`"
            )
        row = np.searchsorted(listed_nodes, numbers).clip(max=len(listed_nodes) - 1)
        missing = np.flatnonzero(listed_nodes[row] != numbers)
        if missing.size:
            raise ConfigError(
                f"{location}: {path} lacks {missing.size} of {len(numbers)} nodes of block {name!r}"
                f"{rows.label}, limit 0; the first is node {numbers[missing[0]]} at "
                f"{_at(blocks[name].points[missing[0]])}; add it"
            )
        temperature[name] = values[row]
    return temperature


def _at(point: Floats) -> str:
    return f"({', '.join(f'{x:.6g}' for x in point)}) m"


def _numbers(months: Sequence[int]) -> str:
    return ", ".join(map(str, months))
