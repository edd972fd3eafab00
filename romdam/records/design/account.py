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
    writer.writerows(map(plain_cell, _row(one)) for one in considered)
    with replacing(folder / CHOICE) as part:
        part.write_text(text.getvalue(), encoding="utf-8")


def _row(one: Loaded) -> tuple[str, ...]:
    used = "yes" if one.passes and one.motion is not None else "no"
    about = one.motion.provenance.get("target") if one.motion is not None else None
    of = str(about["of"]) if isinstance(about, dict) else ""
    numbers = ("", "") if one.aimed is None else (f"{one.aimed.factor:.6g}", f"{one.aimed.misfit:.6g}")
    return (one.name, used, *numbers, of, str(one.error or (one.aimed.why if one.aimed else "")))
