"""The parts of a page: text that is escaped, tables, figures and the whole, in one file without network."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from dataclasses import dataclass, field

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from romdam.visual.style import STYLE
from romdam.visual.suite_plots import SUPERSCRIPTS

LARGEST_SVG = 120_000  # bytes; a figure with more in it is a PNG
_DPI = 170
_PIXELS = 128  # of the page for an inch of a figure, at most

# no script, nothing from elsewhere: whatever a file's name or message holds, it is text
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"

_STYLE = """
:root { color-scheme: light dark; --text: #1c2126; --soft: #59636e; --back: #f6f7f9; --card: #ffffff;
  --line: #d9dee3; --accent: #0072b2; --bad: #b3401a; }
@media (prefers-color-scheme: dark) { :root { --text: #e4e8ec; --soft: #9ba6b1; --back: #14181c;
  --card: #1d2329; --line: #38414a; --accent: #56b4e9; --bad: #f08a5d; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--back); color: var(--text);
  font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; line-height: 1.25; margin: .5rem 0 .25rem; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 0 0 .5rem; }
p { margin: .4rem 0; max-width: 75ch; overflow-wrap: anywhere; }
.soft, figcaption, caption { color: var(--soft); font-size: .875rem; }
section { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 1rem;
  margin: 1rem 0; }
nav { display: flex; flex-wrap: wrap; gap: .25rem 1rem; font-size: .9rem; }
a { color: var(--accent); }
dl.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(8.5rem, 1fr)); gap: .75rem;
  margin: .75rem 0; }
dl.facts div { border-left: 3px solid var(--accent); padding-left: .6rem; }
dl.facts div.bad { border-color: var(--bad); }
dl.facts dt { color: var(--soft); font-size: .8rem; }
dl.facts dd { margin: 0; font-size: 1.15rem; font-weight: 600; overflow-wrap: anywhere; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); gap: 1rem; }
.figures.one { grid-template-columns: 1fr; }
figure { margin: 0; min-width: 0; }
figure img { display: block; width: 100%; height: auto; background: #ffffff;
  border-radius: 6px; padding: 4px; }
.wide { overflow-x: auto; margin: .75rem 0; }
table { border-collapse: collapse; font-size: .875rem; min-width: 60%; }
caption { text-align: left; padding-bottom: .25rem; }
th, td { padding: .3rem .75rem .3rem 0; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top; white-space: nowrap; }
th { font-weight: 600; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
td.text { min-width: 18rem; white-space: normal; overflow-wrap: anywhere; }
code, pre { font-family: ui-monospace, "Cascadia Mono", Menlo, Consolas, monospace; font-size: .85rem; }
pre { overflow-x: auto; background: var(--back); border: 1px solid var(--line); border-radius: 6px;
  padding: .6rem; }
code { overflow-wrap: anywhere; }
@media print { body { background: none; } section { break-inside: avoid; border: none; padding: 0; } }
"""


def escape(value: object) -> str:
    """Text that stays text in a page."""
    return html.escape(str(value), quote=True)


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, as plain text; a dash where there is none."""
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e6:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}".replace("-", "−")
    rounded = float(f"{value:.{digits - 1}e}")
    return np.format_float_positional(rounded, trim="-").replace("-", "−")


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Attributes
    ----------
    name : of its anchor
    title : heading
    parts : HTML, one after another
    """

    name: str
    title: str
    parts: list[str] = field(default_factory=list)

    def html(self) -> str:
        """The section."""
        body = "\n".join(part for part in self.parts if part)
        return f'<section id="{self.name}">\n<h2>{escape(self.title)}</h2>\n{body}\n</section>'


def paragraph(text: str, soft: bool = False) -> str:
    """A paragraph of plain text."""
    return f"<p{_marked('soft', soft)}>{escape(text)}</p>"


def facts(rows: Sequence[tuple[str, str, bool]]) -> str:
    """Boxes of what counts most: name, value (plain text), and whether it is bad news."""
    cells = (
        f"<div{_marked('bad', bad)}><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>"
        for name, value, bad in rows
    )
    return f'<dl class="facts">{"".join(cells)}</dl>'


def _marked(name: str, so: bool) -> str:
    return f' class="{name}"' if so else ""


def table(head: Sequence[str], rows: Sequence[Sequence[object]], caption: str = "", digits: int = 3) -> str:
    """A table; columns of numbers stand on the right, with so many digits, everything else is text."""
    if not rows:
        return ""
    right = [all(isinstance(row[k], int | float) for row in rows) for k in range(len(head))]
    parts = [f"<caption>{escape(caption)}</caption>"] if caption else []
    if any(head):
        cells = (
            f'<th scope="col"{_class(n, text)}>{escape(text)}</th>'
            for n, text in zip(right, head, strict=True)
        )
        parts.append(f"<thead><tr>{''.join(cells)}</tr></thead>")
    parts.append("<tbody>")
    for row in rows:
        line = (f"<td{_class(n, one)}>{_cell(one, digits)}</td>" for n, one in zip(right, row, strict=True))
        parts.append(f"<tr>{''.join(line)}</tr>")
    return f'<div class="wide" tabindex="0"><table>{chr(10).join(parts)}</tbody></table></div>'


def _class(right: bool, value: object) -> str:
    if right:
        return ' class="n"'
    return ' class="text"' if isinstance(value, str) and len(value) > 60 else ""


def _cell(value: object, digits: int) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return escape(value)
    return str(value) if isinstance(value, int) else number(value, digits)


def code(text: str) -> str:
    """Lines as they are."""
    return f'<pre tabindex="0">{escape(text)}</pre>'


def folded(summary: str, content: str) -> str:
    """HTML that opens on demand."""
    return f"<details><summary>{escape(summary)}</summary>{content}</details>"


def picture(figure: Figure | bytes, caption: str, alt: str = "") -> str:
    """A figure, or the bytes of a PNG, which may be as wide as the page, inside it."""
    size = "" if isinstance(figure, bytes) else f' style="max-width: {_PIXELS * figure.get_figwidth():.0f}px"'
    image = f'<img src="{_encoded(figure)}" alt="{escape(alt or caption)}"{size}>'
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def _encoded(figure: Figure | bytes) -> str:
    if isinstance(figure, bytes):
        return f"data:image/png;base64,{base64.b64encode(figure).decode()}"
    with mpl.rc_context({**STYLE, "svg.hashsalt": "romdam"}):
        file = io.BytesIO()
        figure.savefig(file, format="svg", metadata={"Date": None})
        kind = "svg+xml"
        if file.tell() > LARGEST_SVG:
            file, kind = io.BytesIO(), "png"
            figure.savefig(file, format="png", dpi=_DPI)
    return f"data:image/{kind};base64,{base64.b64encode(file.getvalue()).decode()}"


def side_by_side(pictures: Sequence[str]) -> str:
    """Pictures in as many columns as there is room for."""
    shown = [one for one in pictures if one]
    kind = "figures one" if len(shown) == 1 else "figures"
    return f'<div class="{kind}">{"".join(shown)}</div>' if shown else ""


def page(title: str, head: str, sections: Sequence[Section]) -> str:
    """A whole page."""
    links = " ".join(f'<a href="#{one.name}">{escape(one.title)}</a>' for one in sections)
    body = "\n".join(one.html() for one in sections)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<title>{escape(title)}</title>
<style>{_STYLE}</style>
</head>
<body>
<main>
<header>
<h1>{escape(title)}</h1>
{head}
<nav aria-label="Sections">{links}</nav>
</header>
{body}
</main>
</body>
</html>
"""
