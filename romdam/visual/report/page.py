"""A page of parts, whole in one file: it asks for nothing from elsewhere, and works without a network."""

from __future__ import annotations

import base64
import hashlib
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from romdam.core.printable import printable
from romdam.visual.report.parts import PageTable, Report


def page(report: Report) -> str:
    """A whole page.

    Whatever a file's name or message holds is text: templates escape it, and the page's policy lets no script
    and no style run but the page's own, named by their SHA-256.
    """
    parts = [block for section in report.sections for block in section.shown]
    sorts = any(isinstance(block, PageTable) and block.sortable for block in parts)
    style, script = _text("page.css"), _text("runs.js") if sorts else ""
    policy = f"default-src 'none'; img-src data:; style-src {_digest(style)}"
    policy += f"; script-src {_digest(script)}" if script else ""
    return _templates().get_template("page.html").render(
        report=report, policy=policy, style=Markup(style), script=Markup(script),
    )  # fmt: skip


@cache
def _templates() -> Environment:
    return Environment(
        loader=PackageLoader("romdam.visual.report"),
        autoescape=True,
        finalize=lambda value: printable(value) if type(value) is str else value,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _text(name: str) -> str:
    """A file beside the templates, as it is."""
    environment = _templates()
    assert environment.loader is not None
    return environment.loader.get_source(environment, name)[0]


def _digest(text: str) -> str:
    """Digest by which a page's policy knows an inline style or script."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
