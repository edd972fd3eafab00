"""Fields of a result in 3-D: displacement and stress at their worst steps, and the motion as an animation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import Colormap, Normalize

from romdam.core.arrays import Floats
from romdam.core.files import replacing
from romdam.results.fields import Result
from romdam.results.series import Frames, dam_blocks, frame_times, worst_displacement_time
from romdam.visual.plots import save_figure
from romdam.visual.rendering import EDGES, Bounds, Image, Picture, fitting_size, grid, surface
from romdam.visual.style import STYLE, image_grid, image_panels, range_colours, scaled, side_name

Progress = Callable[[int, int], None]

_DIRECTIONS = (np.array([-0.5, -1.0, 0.45]), np.array([0.5, 1.0, 0.45]))
_SHARE = 0.99  # of the nodes' stresses that the colours reach
_SHOWN = 0.05  # of the model's size, that the largest displacement is drawn as
_EDGED = 20_000  # cells of a block, above which only its sharp edges are drawn
_FRAME_SIZE = (800, 640)
_PANEL = 640  # pixels of the longer side of one of several pictures
_MISSING = "#D9D9D9"
_SIGNED = "signed"  # of values whose sign matters, see `range_colours`


@dataclass(frozen=True)
class _Field:
    """Values of every node of some blocks, and how they are shown.

    Attributes
    ----------
    values : block -> (n,) in SI, NaN where not known
    moved : block -> (n, 3) displacement that the shape is drawn with [m]
    unit, label, colours : of the values
    """

    values: dict[str, Floats]
    moved: dict[str, Floats]
    unit: str
    label: str
    colours: str

    def colormap(self, norm: Normalize) -> Colormap:
        """Colours of a range; those of signed values are as far from white as the value is from zero."""
        if self.colours != _SIGNED or norm.vmin is None or norm.vmax is None:
            return mpl.colormaps[self.colours]
        return range_colours(norm.vmin, norm.vmax)


def draw_fields(result: Result, folder: Path, stem: str) -> list[Path]:
    """Draw displacement, and every stress that the result has, at its worst step: `stem`-field_<name>.png.

    Raises
    ------
    ResultError
        for a full-order result, and where 3-D pictures cannot be drawn.
    """
    dataset = result.dataset
    time = worst_displacement_time(result)
    paths = [_draw(result, _displacement(result, time), time, folder / f"{stem}-field_displacement.png")]
    for name in ("principal", "vertical", "arch"):
        variable = f"worst_{name}_stress"
        if variable in dataset and dataset[variable].notnull().any():
            at = float(dataset[f"worst_{name}_time"])
            path = folder / f"{stem}-field_{name}_stress.png"
            paths.append(_draw(result, _stress(result, variable, at), at, path))
    if "demand_capacity_ratio" in dataset:
        field = _stress(result, "demand_capacity_ratio", None)
        paths.append(_draw(result, field, None, folder / f"{stem}-field_demand_capacity_ratio.png"))
    return paths


def draw_side_by_side(results: Mapping[str, Result], axis: str, folder: Path, stem: str) -> dict[str, Path]:
    """Draw variants beside one another, each at its own worst step, in one scale of colours.

    Parameters
    ----------
    results : variant -> its result, of reduced models
    axis : component of the displacement

    Returns
    -------
    figure -> its file: displacement, and each stress that all have

    Raises
    ------
    ResultError
        where 3-D pictures cannot be drawn.
    """
    if not results:
        return {}
    times = {name: worst_displacement_time(result) for name, result in results.items()}
    fields = {name: _displacement(result, times[name], axis) for name, result in results.items()}
    path = folder / f"{stem}-field_displacement.png"
    paths = {"field_displacement": _draw_each(results, fields, times, path)}
    for kind in ("principal", "vertical"):
        name, variable = f"field_{kind}_stress", f"worst_{kind}_stress"
        datasets = [result.dataset for result in results.values()]
        if all(variable in dataset and dataset[variable].notnull().any() for dataset in datasets):
            times = {key: float(result.dataset[f"worst_{kind}_time"]) for key, result in results.items()}
            fields = {key: _stress(result, variable, times[key]) for key, result in results.items()}
            paths[name] = _draw_each(results, fields, times, folder / f"{stem}-{name}.png")
    return paths


def write_animation(result: Result, folder: Path, stem: str, frames: Frames, progress: Progress) -> Path:
    """Draw the motion, coloured by displacement, as `folder`/`stem`-motion.gif.

    Raises
    ------
    ResultError
        for a full-order result, for a window without written times, and where 3-D pictures cannot be drawn.
    """
    from PIL import Image as PillowImage

    times = frame_times(result, frames)
    fields = [_displacement(result, t) for t in times]
    top = max(float(v.max()) for field in fields for v in field.values.values())
    scale, norm = magnification(result, top), Normalize(0.0, top)
    bounds = _bounds(result, list(fields[0].values))
    images = []
    for k, (field, time) in enumerate(zip(fields, times, strict=True)):
        picture = _view(result, field, bounds, _DIRECTIONS[0], scale, norm, _FRAME_SIZE)
        text = f"{time:.2f} s   shape x {scale:g}   yellow: {1e3 * top:.3g} mm"
        picture.plotter.add_text(text, font_size=9, color="black")
        images.append(PillowImage.fromarray(picture.image()))
        progress(k + 1, len(times))
    path = folder / f"{stem}-motion.gif"
    with replacing(path) as unfinished:
        images[0].save(unfinished, format="GIF", save_all=True, append_images=images[1:], duration=80, loop=0)
    return path


def _displacement(result: Result, time: float, axis: str | None = None) -> _Field:
    """Size of the displacement, or its component along an axis."""
    moved = {name: result.displacement(name, times=time).values[0] for name in dam_blocks(result)}
    if axis is not None:
        values = {name: u[:, "xyz".index(axis)] for name, u in moved.items()}
        return _Field(values, moved, "m", f"displacement along {axis} relative to the base", "viridis")
    values = {name: np.linalg.norm(u, axis=1) for name, u in moved.items()}
    return _Field(values, moved, "m", "displacement relative to the base", "viridis")


def _stress(result: Result, variable: str, time: float | None) -> _Field:
    """A stress variable on the blocks that have it; undeformed where it belongs to no one time."""
    dataset = result.dataset
    values_of, moved = {}, {}
    for name in dict.fromkeys(dataset.stress_block.values.tolist()):
        of_block = dataset.stress_block.values == name
        values = np.full(len(result.points(name)), np.nan)
        values[dataset.stress_node_number.values[of_block]] = dataset[variable].values[of_block]
        values_of[name] = values
        at = None if time is None else result.displacement(name, times=time).values[0]
        moved[name] = np.zeros((len(values), 3)) if at is None else at
    label = str(dataset[variable].attrs["long_name"]).split(" at worst")[0].split(" (")[0]
    unit = str(dataset[variable].attrs["units"])
    return _Field(
        values_of, moved, "" if unit == "1" else unit, label, "viridis" if time is None else _SIGNED
    )


def _draw(result: Result, field: _Field, time: float | None, path: Path) -> Path:
    """Two sides of the field's blocks, with a colour bar."""
    whole = np.concatenate(list(field.values.values()))
    in_unit, factor, unit = scaled(xr.DataArray(whole[np.isfinite(whole)]), field.unit)
    norm, beyond = _norm(in_unit, field)
    largest = max(float(np.linalg.norm(u, axis=1).max()) for u in field.moved.values())
    scale = magnification(result, largest)
    field_scaled = _Field(
        {k: v * factor for k, v in field.values.items()}, field.moved, unit, "", field.colours
    )
    bounds = _bounds(result, list(field.values))
    images = {
        name: _view(result, field_scaled, bounds, direction, scale, norm).image()
        for name, direction in _sides(result).items()
    }
    when = f", largest {float(in_unit.max()):.3g} {unit}".rstrip()
    when += "" if time is None else f", at {time:.2f} s, shape x {scale:g}"
    with mpl.rc_context(STYLE):
        figure, axes = image_panels(images, f"{field.label}{when}  ·  {result.dataset.attrs['record']}")
        bar = mpl.cm.ScalarMappable(norm, field.colormap(norm))
        label = f"{field.label}{f' [{unit}]' if unit else ''}"
        figure.colorbar(bar, ax=axes, label=label, shrink=0.8, pad=0.01, aspect=30, extend=beyond)
    return save_figure(figure, path)


def _draw_each(
    results: Mapping[str, Result], fields: Mapping[str, _Field], times: Mapping[str, float], path: Path
) -> Path:
    """One panel for each result, with one colour bar and one magnification for all."""
    name, result = next(iter(results.items()))
    first, record = fields[name], result.dataset.attrs["record"]
    whole = np.concatenate([v for field in fields.values() for v in field.values.values()])
    in_unit, factor, unit = scaled(xr.DataArray(whole[np.isfinite(whole)]), first.unit)
    norm, beyond = _norm(in_unit, first)
    largest = max(np.linalg.norm(u, axis=1).max() for field in fields.values() for u in field.moved.values())
    scale = magnification(result, float(largest))
    # bounds of the blocks as they stand and as they are drawn, seen so that the longer side lies across
    points = np.concatenate(
        [result.points(block) + s * first.moved[block] for block in first.values for s in (0.0, scale)]
    )
    bounds = points.min(axis=0), points.max(axis=0)
    long_x, long_y, _ = bounds[1] - bounds[0]
    direction = _DIRECTIONS[1] if long_x >= long_y else _DIRECTIONS[1][[1, 0, 2]]
    panels: dict[str, Image] = {}
    for name, result in results.items():
        in_unit_of = {block: values * factor for block, values in fields[name].values.items()}
        low, high = (f(np.concatenate(list(in_unit_of.values()))) for f in (np.nanmin, np.nanmax))
        picture = _view(
            result,
            replace(fields[name], values=in_unit_of),
            bounds,
            direction,
            scale,
            norm,
            fitting_size(bounds, direction, _PANEL),
        )
        panels[f"{name}\n{low:.3g} to {high:.3g} {unit} at {times[name]:.2f} s"] = picture.image()
    with mpl.rc_context(STYLE):
        title = f"{first.label}, shape x {scale:g}  ·  {record}"
        figure, axes = image_grid(panels, title)
        bar = mpl.cm.ScalarMappable(norm, first.colormap(norm))
        label = f"{first.label} [{unit}]"
        figure.colorbar(bar, ax=axes, label=label, shrink=0.8, pad=0.01, aspect=30, extend=beyond)
    return save_figure(figure, path)


def _sides(result: Result) -> dict[str, Floats]:
    """Name -> direction to the eye, of both sides: upstream first where the result says which that is."""
    upstream = result.dataset.attrs.get("upstream")
    if upstream is None:
        return {side_name(towards, None): towards for towards in _DIRECTIONS}
    along, up = np.asarray(upstream, dtype=float), np.array([0.0, 0.0, 0.45])
    aside = 0.5 * np.cross(along, [0.0, 0.0, 1.0])
    return {side_name(s * (along + aside), along): s * (along + aside) + up for s in (1.0, -1.0)}


def _norm(values: xr.DataArray, field: _Field) -> tuple[Normalize, str]:
    """Range of the colours, and at which ends values go beyond it.

    Stress grows without limit at re-entrant corners as the mesh is refined: the highest percent at each end
    is cut off, so that the rest can be seen; the title says how far it goes. Zero is always within.
    """
    low, high = float(values.min()), float(values.max())
    if field.unit == "m" or not field.label:
        return Normalize(min(0.0, low), high), "neither"
    first, last = (float(x) for x in np.quantile(values.values, (1.0 - _SHARE, _SHARE)))
    norm = Normalize(min(0.0, first), max(0.0, last))
    ends = {(True, True): "both", (True, False): "min", (False, True): "max"}
    return norm, ends.get((low < min(0.0, first), high > max(0.0, last)), "neither")


def _view(
    result: Result,
    field: _Field,
    bounds: Bounds,
    direction: Floats,
    scale: float,
    norm: Normalize,
    size: tuple[int, int] | None = None,
) -> Picture:
    picture = Picture(bounds, direction, size)
    for name, values in field.values.items():
        element, cells = result.cells(name)
        points = result.points(name) + scale * field.moved[name]
        mesh, straight = grid(element, points, cells), surface(grid(element, points, cells, straight=True))
        mesh.point_data["values"] = values
        bar = {"scalars": "values", "cmap": field.colormap(norm), "clim": (norm.vmin, norm.vmax)}
        flat = {"lighting": False, "ambient": 0.0, "diffuse": 1.0}  # the colours of the bar, unshaded
        picture.add(surface(mesh), **bar, **flat, nan_color=_MISSING)
        all_of_them = len(cells) < _EDGED
        edges = straight.extract_all_edges() if all_of_them else straight.extract_feature_edges(30)
        picture.add(edges, color=EDGES, line_width=1.5, opacity=0.4)
    return picture


def _bounds(result: Result, names: list[str]) -> Bounds:
    points = np.concatenate([result.points(name) for name in names])
    return points.min(axis=0), points.max(axis=0)


def magnification(result: Result, largest: float) -> float:
    """A round factor that draws the largest displacement as a small part of the model."""
    if largest <= 0.0:
        return 0.0
    low, high = _bounds(result, dam_blocks(result))
    wanted = _SHOWN * float(np.linalg.norm(high - low)) / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(f for f in (1.0, 2.0, 5.0) if f * power <= wanted * (1.0 + 1e-9)) * power)
