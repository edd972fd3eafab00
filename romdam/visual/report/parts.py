"""The parts of a page, as data: what a template turns into HTML, and escapes."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from romdam.core.display_units import number
from romdam.visual.style import STYLE

LARGEST_SVG = 120_000  # bytes; a figure with more in it is a PNG
_DPI = 170  # sharp in print, and on a screen of two dots a pixel
_PIXELS = 128  # of the page for an inch of a figure, at most
_LONG = 60  # letters from which on a text is set in several lines
_UNIT = re.compile(r" ?(\[[^\[\]]+\])$")  # at the end of a column's head
_MANY = 9  # columns
_SHORT = 10  # letters of a head that stands in one line


@dataclass(frozen=True)
class Text:
    """A paragraph; `soft` is said in passing."""

    kind: ClassVar[str] = "text"
    text: str
    soft: bool = False


@dataclass(frozen=True)
class Fact:
    """One of what counts most, and whether it is bad news."""

    name: str
    value: str
    bad: bool = False


@dataclass(frozen=True)
class Code:
    """Lines as they are."""

    kind: ClassVar[str] = "code"
    text: str


@dataclass(frozen=True)
class Folded:
    """Lines that are shown on demand."""

    kind: ClassVar[str] = "folded"
    summary: str
    text: str


@dataclass(frozen=True)
class PageCell:
    """A cell of a table.

    Attributes
    ----------
    text : as it is shown
    look : class: "n" for a number, "text" for a long text
    value : number that it is sorted by; None for a text, and where there is none
    links : (text, address) of each, instead of a text
    """

    text: str
    look: str = ""
    value: float | None = None
    links: tuple[tuple[str, str], ...] = ()

    @property
    def key(self) -> str:
        """The number as a script reads it; empty where there is none."""
        if self.value is None:
            return ""
        return f"{self.value:.9g}".replace("inf", "Infinity")


Value = str | int | float | PageCell


@dataclass(frozen=True)
class PageTable:
    """A table; columns of numbers stand on the right, everything else is text.

    Attributes
    ----------
    head : of the columns, with their unit in brackets at the end, which is shown in a row of its own; none
        where the first cell of each row says what the second is
    rows : of cells, numbers with so many `digits`
    caption : above it; `label` is what a screen reader calls it where there is none
    sortable : whether a reader may sort and filter it
    descending : number of the column that its rows are in the order of, the largest first; None without one
    """

    kind: ClassVar[str] = "table"
    head: Sequence[str]
    rows: Sequence[Sequence[Value]]
    caption: str = ""
    digits: int = 3
    label: str = ""
    sortable: bool = False
    descending: int | None = None

    @property
    def titles(self) -> list[str]:
        """The head without its units."""
        return [_UNIT.sub("", text) for text in self.head]

    @property
    def lines(self) -> list[list[str]]:
        """The head without its units, each title in at most two lines."""
        return [_broken(title) for title in self.titles]

    @property
    def units(self) -> list[str]:
        """Units of the columns, in brackets; empty where no column has any."""
        units = [found[1] if (found := _UNIT.search(text)) else "" for text in self.head]
        return units if any(units) else []

    @property
    def dense(self) -> bool:
        """Tell whether it has so many columns that its letters are small."""
        return len(self.head) > _MANY

    @property
    def numeric(self) -> list[bool]:
        """Tell of each column whether it has numbers alone."""
        return [all(_is_number(row[k]) for row in self.rows) for k in range(len(self.rows[0]))]

    @property
    def cells(self) -> list[list[PageCell]]:
        """The rows as they are shown."""
        right = self.numeric
        return [
            [cell_of(value, self.digits, n) for n, value in zip(right, row, strict=True)] for row in self.rows
        ]


def _broken(title: str) -> list[str]:
    """A title in one line, or in the two whose longer one is the shortest."""
    words = title.split(" ")
    if len(title) <= _SHORT or len(words) == 1:
        return [title]
    breaks = ([" ".join(words[:k]), " ".join(words[k:])] for k in range(1, len(words)))
    return min(breaks, key=lambda lines: max(map(len, lines)))


def _is_number(value: Value) -> bool:
    if isinstance(value, PageCell):
        return value.look == "n"
    return isinstance(value, int | float) and not isinstance(value, bool)


def cell_of(value: Value, digits: int = 3, right: bool = True) -> PageCell:
    """A value as a cell, on the right where its column has numbers alone."""
    if isinstance(value, PageCell):
        return value
    if not _is_number(value):
        text = str(value)
        return PageCell(text, "text" if len(text) > _LONG else "")
    digits_text = str(value) if isinstance(value, int) else number(float(value), digits)
    return PageCell(digits_text, "n" if right else "", None if np.isnan(float(value)) else float(value))


@dataclass(frozen=True)
class PagePicture:
    """An image inside the page.

    Attributes
    ----------
    drawing : a figure, or the bytes of a PNG, which may be as wide as the page
    caption, alt : below it; in its place for who cannot see it
    """

    drawing: Figure | bytes
    caption: str
    alt: str

    @property
    def width(self) -> int:
        """Pixels on a page; 0 for those of the file."""
        return 0 if isinstance(self.drawing, bytes) else round(_PIXELS * self.drawing.get_figwidth())

    @property
    def height(self) -> int:
        """Pixels on a page; 0 for those of the file."""
        return 0 if isinstance(self.drawing, bytes) else round(_PIXELS * self.drawing.get_figheight())

    @property
    def source(self) -> str:
        """Address that holds the image itself: an SVG, or a PNG where that is smaller."""
        content, kind = self.drawing, "png"
        if not isinstance(content, bytes):
            content, kind = self._saved("svg"), "svg+xml"
            if len(content) > LARGEST_SVG:
                content, kind = self.png, "png"
        return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"

    @cached_property
    def png(self) -> bytes:
        """The image as a PNG."""
        return self.drawing if isinstance(self.drawing, bytes) else self._saved("png", dpi=_DPI)

    def _saved(self, kind: str, dpi: float | None = None) -> bytes:
        assert isinstance(self.drawing, Figure)
        file, about = io.BytesIO(), {"Date": None} if kind == "svg" else None
        with mpl.rc_context({**STYLE, "svg.hashsalt": "romdam"}):
            self.drawing.savefig(file, format=kind, metadata=about, dpi=dpi)
        return file.getvalue()


@dataclass(frozen=True)
class Pictures:
    """Pictures in as many columns as there is room for."""

    kind: ClassVar[str] = "pictures"
    all: tuple[PagePicture, ...]


Part = Text | Code | Folded | PageTable | Pictures


@dataclass(frozen=True)
class PageSection:
    """A part of a page with a heading.

    Attributes
    ----------
    name : of its anchor
    title : heading
    parts : one after another; empty tables and rows of pictures are left out
    """

    name: str
    title: str
    parts: Sequence[Part] = field(default_factory=list)

    @property
    def shown(self) -> list[Part]:
        """The parts that hold anything."""
        empty = [
            (isinstance(block, PageTable) and not block.rows)
            or (isinstance(block, Pictures) and not block.all)
            for block in self.parts
        ]
        return [block for block, is_empty in zip(self.parts, empty, strict=True) if not is_empty]


@dataclass(frozen=True)
class Report:
    """What a page or a document is made of.

    Attributes
    ----------
    title, about : its first lines
    facts : what counts most
    sections : one after another
    """

    title: str
    about: str
    facts: Sequence[Fact]
    sections: Sequence[PageSection]


def picture(drawing: Figure | bytes, caption: str, alt: str = "") -> PagePicture:
    """A figure, or the bytes of a PNG; its caption says what is seen where no text does."""
    return PagePicture(drawing, caption, alt or caption)


def side_by_side(*pictures: PagePicture | None) -> Pictures:
    """Those of the pictures that are there, in one row where there is room."""
    return Pictures(tuple(each for each in pictures if each is not None))
