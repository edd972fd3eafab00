"""The records that an entry's target was held against, as a table beside the results."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from romdam.core.files import replacing
from romdam.core.printable import plain_cell
from romdam.records.record_set import Loaded

CHOICE = "record_choice.csv"
_HEADINGS = ("record", "used", "factor", "misfit_rms_ln", "of", "why_not")


def write_choice(considered: Sequence[Loaded], folder: Path) -> None:
    """Write what was considered, taken and passed over, and why; nothing where there is no target."""
    if not considered:
        return
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(_HEADINGS)
    writer.writerows(map(plain_cell, _row(record)) for record in considered)
    with replacing(folder / CHOICE) as unfinished:
        unfinished.write_text(text.getvalue(), encoding="utf-8")


def _row(record: Loaded) -> tuple[str, ...]:
    used = "yes" if record.passes and record.motion is not None else "no"
    about = record.motion.provenance.get("target") if record.motion is not None else None
    of = str(about["of"]) if isinstance(about, dict) else ""
    candidate = record.candidate
    if candidate is None:
        return (record.name, used, "", "", of, str(record.error or ""))
    numbers = f"{candidate.factor:.6g}", f"{candidate.misfit:.6g}"
    return (record.name, used, *numbers, of, str(record.error or candidate.why))
