"""A report as a PDF: the parts of a page set on sheets of paper, by matplotlib, with bookmarks by pypdf.

Text is text that can be searched and copied, tables repeat their head on every sheet, and numbers stand under
one another. A browser prints the page as well, but a cluster has no browser.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.image import imread
from matplotlib.lines import Line2D
from matplotlib.textpath import text_to_path
from pypdf import PdfWriter

from romdam.core.files import replacing
from romdam.core.printable import printable
from romdam.visual.report.parts import (
    Code,
    PageCell,
    PagePicture,
    PageSection,
    PageTable,
    Part,
    Pictures,
    Report,
    Text,
)
from romdam.visual.style import GREY, STYLE

A4, LETTER = (595.0, 842.0), (612.0, 792.0)  # points
_MARGIN, _FOOT = 50.0, 34.0  # points: on all sides; of the line at the bottom
_TEXT, _SMALL, _HEADING, _TITLE = 9.0, 8.0, 13.0, 18.0  # points of letters
_LEAST = 5.5  # points of letters of a table too wide for the sheet
_LINE = 1.35  # height of a line over that of its letters
_GAP, _PAD = 7.0, 2.2  # points between columns, and above and below a row
_LEAST_DPI = 150  # of a picture, which is not drawn larger
_MOST_HIGH = 0.72  # of a sheet that a picture may take
_LONGEST_WORD = (
    0.3  # of a sheet's width that a word, such as a path, makes a column wide; a longer one is cut
)
_SOFT = "#59636e"


@dataclass
class Sheets:
    """Sheets that are filled from the top.

    Attributes
    ----------
    paper : width and height [points]
    all : the sheets
    y : how far the last one is filled [points from its top]
    bookmarks : title of every section, and the number of the sheet that it begins on, from 0
    """

    paper: tuple[float, float]
    all: list[Figure] = field(default_factory=list)
    y: float = 0.0
    bookmarks: list[tuple[str, int]] = field(default_factory=list)

    @property
    def width(self) -> float:
        """Of the text [points]."""
        return self.paper[0] - 2.0 * _MARGIN

    @property
    def left(self) -> float:
        """Height that is left on the last sheet [points]."""
        return self.paper[1] - _MARGIN - self.y if self.all else 0.0

    def need(self, height: float) -> None:
        """Begin another sheet where the last one has not so much room."""
        if height > self.left and (not self.all or self.y > _MARGIN):
            self.all.append(Figure(figsize=(self.paper[0] / 72.0, self.paper[1] / 72.0)))
            self.y = _MARGIN

    def write(self, x: float, text: str, size: float, *, bold: bool = False, colour: str = "black",
              right: bool = False) -> None:  # fmt: skip
        """A line of text whose top is at `y` and whose left (or right) end is at x."""
        baseline = x / self.paper[0], 1.0 - (self.y + 0.95 * size) / self.paper[1]
        self.all[-1].text(
            *baseline, text, fontsize=size, weight="bold" if bold else "normal", color=colour,
            ha="right" if right else "left", va="baseline", parse_math=False,
        )  # fmt: skip

    def rule(self, width: float, weight: float) -> None:
        """A line at `y`, as long as a table is wide."""
        across, at = np.array([_MARGIN, _MARGIN + width]) / self.paper[0], 1.0 - self.y / self.paper[1]
        self.all[-1].add_artist(Line2D(across, [at, at], lw=weight, color=GREY))

    def paragraph(self, text: str, size: float, *, bold: bool = False, colour: str = "black") -> None:
        """Text in as many lines as it takes."""
        for line in _lines(text, size, self.width, bold):
            self.need(_LINE * size)
            self.write(_MARGIN, line, size, bold=bold, colour=colour)
            self.y += _LINE * size
        self.y += 0.4 * size


def write_document(report: Report, path: Path, paper: tuple[float, float] = A4) -> Path:
    """Write a report as a PDF with a bookmark for each section, whole or not at all.

    Parameters
    ----------
    paper : width and height [points]

    Raises
    ------
    WriteError
        where the folder or the disk refuses it.
    """
    sheets, about = set_sheets(report, paper), {"Title": report.title, "CreationDate": None}
    drawn = io.BytesIO()
    with (
        mpl.rc_context({**STYLE, "pdf.fonttype": 42}),  # text that can be searched
        PdfPages(drawn, metadata=about) as pdf,
    ):
        for sheet in sheets.all:
            pdf.savefig(sheet)
    bookmarked = PdfWriter(clone_from=drawn)
    for title, number in sheets.bookmarks:
        bookmarked.add_outline_item(title=printable(title), page_number=number)
    bookmarked.page_mode = "/UseOutlines"  # a reader shows them beside the first sheet
    with replacing(path) as unfinished:
        bookmarked.write(unfinished)
    return path


def set_sheets(report: Report, paper: tuple[float, float]) -> Sheets:
    """Set a report on sheets of a size [points]."""
    with mpl.rc_context(STYLE):
        sheets = Sheets(paper)
        sheets.need(paper[1])
        sheets.paragraph(report.title, _TITLE, bold=True)
        sheets.paragraph(report.about, _TEXT, colour=_SOFT)
        if report.facts:
            _set_table(sheets, PageTable([], [[fact.name, fact.value] for fact in report.facts]))
        for section in report.sections:
            sheets.need(_beginning(sheets, section))  # a heading stays with what it is of
            sheets.y += _TEXT
            sheets.bookmarks.append((section.title, len(sheets.all) - 1))
            sheets.paragraph(section.title, _HEADING, bold=True)
            for part in section.shown:
                _set_part(sheets, part)
        for number, sheet in enumerate(sheets.all, 1):
            foot = Sheets(paper, [sheet], paper[1] - _FOOT)
            foot.write(_MARGIN, _lines(report.title, 7.0, 0.8 * sheets.width)[0], 7.0, colour=_SOFT)
            page_text = f"{number} of {len(sheets.all)}"
            foot.write(paper[0] - _MARGIN, page_text, 7.0, colour=_SOFT, right=True)
    return sheets


def _set_part(sheets: Sheets, part: Part) -> None:
    if isinstance(part, PageTable):
        _set_table(sheets, part)
    elif isinstance(part, Pictures):
        for drawn in part.all:
            _set_picture(sheets, drawn)
    elif isinstance(part, Text):
        sheets.paragraph(part.text, _TEXT, colour=_SOFT if part.soft else "black")
    elif isinstance(part, Code):  # what a page shows on demand is left out
        for line in part.text.splitlines():
            sheets.paragraph(line, _TEXT)


def _beginning(sheets: Sheets, section: PageSection) -> float:
    """Height of a heading and of what must stand below it [points]."""
    first = section.shown[0] if section.shown else None
    below = _sized(sheets, first.all[0])[2] if isinstance(first, Pictures) else 0.0
    return 8.0 * _LINE * _TEXT + below


def _sized(sheets: Sheets, drawn: PagePicture) -> tuple[np.ndarray, float, float]:
    """The pixels of a picture, its width and its height: as wide as the text, or as high as fits [points]."""
    pixels = imread(io.BytesIO(drawn.png))
    high, wide = pixels.shape[:2]
    most = _MOST_HIGH * sheets.paper[1]
    width = min(sheets.width, most * wide / high, 72.0 * wide / _LEAST_DPI)
    return pixels, width, width * high / wide


def _set_picture(sheets: Sheets, drawn: PagePicture) -> None:
    """A picture and its caption."""
    pixels, width, height = _sized(sheets, drawn)
    sheets.need(height + 3.0 * _LINE * _SMALL)
    corner = _MARGIN / sheets.paper[0], 1.0 - (sheets.y + height) / sheets.paper[1]
    axes = sheets.all[-1].add_axes((*corner, width / sheets.paper[0], height / sheets.paper[1]))
    axes.imshow(pixels, interpolation="none", aspect="auto")
    axes.set_axis_off()
    sheets.y += height + 2.0
    sheets.paragraph(drawn.caption, _SMALL, colour=_SOFT)


def _set_table(sheets: Sheets, table: PageTable) -> None:
    """A table, its head repeated on every sheet; letters as small as they must be to fit its numbers."""
    head = [PageCell(text) for text in table.head]
    rows, right = table.cells, table.numeric
    size = _SMALL
    widths = _column_widths([*([head] if head else []), *rows], right, size, sheets.width)
    while widths.sum() > sheets.width - _GAP * (len(right) - 1) and size > _LEAST:
        size -= 0.5
        widths = _column_widths([*([head] if head else []), *rows], right, size, sheets.width)
    room = sheets.width - _GAP * (len(right) - 1)
    if widths.sum() > room:  # words of the head are cut, numbers are not
        least = np.minimum(widths, _column_widths(rows, right, size, sheets.width))
        widths = least + (widths - least) * max(room - least.sum(), 0.0) / (widths - least).sum()
    wide = float(widths.sum()) + _GAP * (len(right) - 1)
    caption = _LINE * _SMALL if table.caption else 0.0
    first = _heights([head, rows[0]], widths, size).sum() if head else 2.0 * _LINE * size
    sheets.need(caption + first + 2.0 * _PAD)
    if table.caption:
        sheets.paragraph(table.caption, _SMALL, colour=_SOFT)
    if head:
        _set_row(sheets, head, widths, right, size, bold=True)
        sheets.rule(wide, 0.9)
    for row, height in zip(rows, _heights(rows, widths, size), strict=True):
        if height > sheets.left:
            sheets.need(height)
            if head:
                _set_row(sheets, head, widths, right, size, bold=True)
                sheets.rule(wide, 0.9)
        _set_row(sheets, row, widths, right, size)
        sheets.rule(wide, 0.3)
    sheets.y += _TEXT


def _set_row(
    sheets: Sheets,
    row: Sequence[PageCell],
    widths: np.ndarray,
    right: Sequence[bool],
    size: float,
    *,
    bold: bool = False,
) -> None:
    """A row of a table, each cell in as many lines as it takes."""
    top, x, bottom = sheets.y + _PAD, _MARGIN, sheets.y
    for cell, width, is_number in zip(row, widths, right, strict=True):
        sheets.y = top
        for line in _lines(cell.text, size, width, bold):
            sheets.write(x + width if is_number else x, line, size, bold=bold, right=is_number)
            sheets.y += _LINE * size
        bottom, x = max(bottom, sheets.y + _PAD), x + width + _GAP
    sheets.y = bottom


def _heights(rows: Sequence[Sequence[PageCell]], widths: np.ndarray, size: float) -> np.ndarray:
    """Of every row [points]."""
    counts = [
        max(len(_lines(cell.text, size, width)) for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]
    return np.array(counts) * _LINE * size + 2.0 * _PAD


def _column_widths(
    rows: Sequence[Sequence[PageCell]], right: Sequence[bool], size: float, width: float
) -> np.ndarray:
    """Widths of columns [points], of their longest word at least; what is left goes to long texts."""
    words = np.array(
        [[max((_width(w, size, True) for w in c.text.split()), default=0.0) for c in row] for row in rows]
    )
    whole = np.array([[_width(c.text, size, False) for c in row] for row in rows])
    least = np.minimum(words.max(axis=0), _LONGEST_WORD * width)
    wished = np.where(
        right, np.maximum(least, whole[1:].max(axis=0, initial=0.0)), np.maximum(least, whole.max(axis=0))
    )
    room = width - _GAP * (len(right) - 1)
    if wished.sum() <= room or least.sum() >= room:
        return wished if least.sum() < room else least
    low, high = 0.0, room  # every column gets what it wishes up to a width that the room allows
    for _ in range(40):
        level = 0.5 * (low + high)
        low, high = (level, high) if np.clip(level, least, wished).sum() <= room else (low, level)
    return np.clip(low, least, wished)


def _lines(text: str, size: float, width: float, bold: bool = False) -> list[str]:
    """A text in lines of at most a width [points]; a word that is longer is cut."""
    lines = [""]
    for word in printable(text).split():
        joined = f"{lines[-1]} {word}".strip()
        if _width(joined, size, bold) <= width + 0.5:
            lines[-1] = joined
            continue
        if lines[-1]:
            lines.append("")
        for letter in word:
            if lines[-1] and _width(lines[-1] + letter, size, bold) > width + 0.5:
                lines.append("")
            lines[-1] += letter
    return lines


def _width(text: str, size: float, bold: bool) -> float:
    """Of a line [points]."""
    return size * sum(_advance(letter, bold) for letter in text)


@cache
def _advance(letter: str, bold: bool) -> float:
    """Width of a letter over the size of its font, which is that of `STYLE`."""
    font = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal", size=100.0)
    pair, lone = (text_to_path.get_text_width_height_descent(n * letter, font, False)[0] for n in (2, 1))
    return float(pair - lone) / 100.0
