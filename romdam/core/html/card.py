"""A few lines about an object as HTML, for the cell of a notebook that ends with it."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from romdam.core.printable import printable

_FRAME = "display:inline-block;max-width:60em;padding:.5em .8em;border:1px solid;border-radius:4px;opacity:.9"
_PLAIN = "color:inherit;font:inherit;background:none"  # whatever the notebook gives to tables
_CELL = f"{_PLAIN};text-align:left;vertical-align:top;padding:.1em .8em .1em 0;white-space:normal"


def card(title: str, kind: str, rows: Mapping[str, str]) -> str:
    """Lay a title, what the object is, and rows out as a table.

    Everything is escaped. Colours are those of the notebook, so it reads on light and on dark ones.

    Parameters
    ----------
    rows : name -> text; a row without text is left out
    """
    body = "".join(
        f'<tr style="{_PLAIN}"><th scope="row" style="{_CELL};white-space:nowrap;opacity:.75">'
        f"{escape(printable(name))}</th>"
        f'<td style="{_CELL};overflow-wrap:anywhere">{escape(printable(text))}</td></tr>'
        for name, text in rows.items()
        if text
    )
    return (
        f'<div style="{_FRAME}"><strong>{escape(printable(title))}</strong>'
        f'<div style="opacity:.75">{escape(printable(kind))}</div>'
        f'<table style="{_PLAIN};border:0;margin:.3em 0 0;border-collapse:collapse">{body}</table></div>'
    )
