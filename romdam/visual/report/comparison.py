"""The page of a comparison of variants: one file with its tables and figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from romdam.core.files import replacing
from romdam.postprocess.variant_tables import changes_of, variant_tables
from romdam.visual.report.page import page
from romdam.visual.report.parts import PageSection, PageTable, Report, picture, side_by_side

PAGE = "comparison.html"
_CAPTIONS = {
    "displacement": "Displacement of the output nodes; right, what each is more than the reference.",
    "relative": "Relative displacement; right, what each is more than the reference.",
    "opening": "The widest gap of each joint, open positive; right, what each is more than the reference.",
    "acceleration": "Acceleration of the output nodes, relative to the base, mean over a writing interval.",
    "relative_acceleration": "Relative acceleration, mean over a writing interval.",
    "field_displacement": "Displacement at each variant's worst step, one scale of colours for all.",
    "field_principal_stress": "Major principal stress at each variant's worst step, one scale for all.",
    "field_vertical_stress": "Vertical stress at each variant's worst step, one scale for all.",
}


def write_comparison(comparison: xr.Dataset, figures: Mapping[str, Figure | bytes], folder: Path) -> Path:
    """Write `comparison.html`, whole or not at all.

    Parameters
    ----------
    figures : name -> figure, or the bytes of a PNG

    Raises
    ------
    ResultError
        where the folder refuses the file.
    """
    attrs, tables = comparison.attrs, variant_tables(comparison)
    about = f"{attrs['record']}; {attrs['source']}; {attrs['machine']}; {attrs['date_created']}"
    variants = PageTable(["variant", "changes"], changes_of(comparison), f"Reference: {attrs['reference']}")
    drawn = [picture(figure, _CAPTIONS[name]) for name, figure in figures.items()]
    sections = [
        PageSection("variants", "Variants", [variants]),
        *(
            PageSection(table.name, table.title, [PageTable(table.head, table.rows, table.note, digits=4)])
            for table in tables
        ),
        PageSection("figures", "Figures", [side_by_side(pair) for pair in drawn]),
    ]
    with replacing(folder / PAGE) as unfinished:
        unfinished.write_text(page(Report(str(attrs["title"]), about, [], sections)), encoding="utf-8")
    return folder / PAGE
