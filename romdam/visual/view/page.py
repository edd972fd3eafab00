"""A page that shows the motion of a dam in 3-D: one file, which needs neither a network nor a library."""

from __future__ import annotations

import json
from base64 import b64encode
from html import escape
from importlib.resources import files
from pathlib import Path

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.files import replacing
from romdam.visual.view.moving import Moving

MOST = 32_000  # of 16 bits, that the largest number of a field is
MISSING = -32_767
_COLOURS = 256


def write_page(motion: Moving, path: Path) -> Path:
    """Write the page; numbers of fields are kept to 1/32000 of their largest.

    Raises
    ------
    WriteError
        where the folder or the disk refuses it.
    """
    moved, most = _short(motion.moved)
    fields = []
    for field in motion.fields:
        colours = np.round(255.0 * field.colours(np.linspace(0.0, 1.0, _COLOURS))[:, :3])
        fields.append(
            {
                "name": field.name,
                "unit": field.unit,
                "factor": field.factor,
                "low": field.low,
                "high": field.high,
                "colours": _packed(colours, "<u1"),
                "axis": None if field.axis is None else [float(x) for x in field.axis],
            }
        )
        if field.values is not None:
            values, most_of_field = _short(field.values)
            fields[-1] |= {"values": _packed(values, "<i2"), "most": most_of_field}
    # texts and numbers as they are, arrays as base64 of little-endian numbers
    content = {
        "title": motion.title,
        "record": motion.record,
        "times": [round(float(t), 6) for t in motion.times],
        "points": _packed(motion.points, "<f4"),
        "moved": _packed(moved, "<i2"),
        "most": most,
        "scale": motion.scale,
        "upstream": None if motion.upstream is None else [float(x) for x in motion.upstream],
        "blocks": [
            {"name": surface.name, "triangles": _packed(triangles, "<u4"), "edges": _packed(edges, "<u4")}
            for surface, triangles, edges in motion.numbered()
        ],
        "fields": fields,
    }
    text = files("romdam.visual.view").joinpath("page.html").read_text(encoding="utf-8")
    data = json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")
    text = text.replace("{{title}}", escape(f"{motion.title} · {motion.record}")).replace("{{data}}", data)
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
    return path


def _short(values: Floats) -> tuple[Floats, float]:
    """Values as whole numbers up to `MOST`, `MISSING` for NaN, and what `MOST` stands for."""
    most = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
    return np.where(np.isnan(values), MISSING, np.round(values * (MOST / most))), most


def _packed(values: Floats | Ints, kind: str) -> str:
    return b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode("ascii")
