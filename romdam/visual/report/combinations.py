"""The page of load combinations: every margin and verdict, and what each combination changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from romdam.core.files import replacing
from romdam.core.version import SOURCE
from romdam.postprocess.combinations import HEAD, NOT_SATISFIED, SATISFIED, Margin
from romdam.visual.report.page import page
from romdam.visual.report.parts import Fact, PageSection, PageTable, Report, number

_DIGITS = 4  # of values and margins: 1.502 meets 1.5


def write_combinations(
    title: str,
    margins: Sequence[Margin],
    changes: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
    statements: Sequence[tuple[str, str, str]],
    path: Path,
) -> Path:
    """Write the page, whole or not at all.

    Parameters
    ----------
    changes : combination -> dotted path -> value
    failures : combination and record -> message
    statements : combination, record, and what the result says of itself

    Raises
    ------
    ResultError
        where the folder refuses the file.
    """
    least = {name: _least([one for one in margins if one.combination == name]) for name in changes}
    short = [one for one in margins if one.verdict != SATISFIED]
    facts = [
        Fact("combinations", str(len(changes))),
        Fact("margins that are not met", str(len(short)), bool(short)),
    ]
    summary = [
        (
            name,
            "–" if worst is None else worst.situation,
            "–" if worst is None else worst.of,
            "–" if worst is None else worst.criterion,
            "–" if worst is None else number(worst.value, _DIGITS),
            "–" if worst is None else number(worst.required),
            "–" if worst is None else number(worst.margin, _DIGITS),
            NOT_SATISFIED if worst is None else worst.verdict,
        )
        for name, worst in least.items()
    ]
    head = ["combination", "situation", "governed by", "criterion", "value", "required", "margin", "verdict"]
    changed = [(name, key, str(value)) for name, keys in changes.items() for key, value in keys.items()]
    about = f"{SOURCE}; {datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    sections = [
        PageSection("combinations", "Combinations", [PageTable(head, summary, "The least margin of each")]),
        PageSection(
            "margins",
            "Every margin",
            [PageTable(list(HEAD), [one.row for one in margins], label="Margins", sortable=True)],
        ),
        PageSection(
            "statements",
            "What the results say of themselves",
            [PageTable(["combination", "record", "stated error, warnings"], statements, label="Statements")],
        ),
        PageSection(
            "changes",
            "What they change",
            [PageTable(["combination", "key", "value"], changed, label="Changes")],
        ),
        PageSection(
            "failures", "Failures", [PageTable(["of", "why"], list(failures.items()), label="Failures")]
        ),
    ]
    report = Report(f"Load combinations: {title}", about, facts, [one for one in sections if one.shown])
    with replacing(path) as unfinished:
        unfinished.write_text(page(report), encoding="utf-8")
    return path


def _least(margins: Sequence[Margin]) -> Margin | None:
    """The one that governs; None where nothing could be judged."""
    return min(margins, key=lambda one: one.margin, default=None)
