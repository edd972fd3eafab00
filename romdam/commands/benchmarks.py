"""Cases with known answers: `romdam benchmarks`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from romdam.commands.options import FAILED, Quiet, Verbose
from romdam.surroundings import search_what_comes


def benchmarks(
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="Write the table as .csv, .json or .md too."),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATTERN",
            help="Only the cases whose names match it; * and ? stand for any. Give it again for more cases.",
        ),
    ] = None,
    listing: Annotated[
        bool, typer.Option("--list", help="List the cases and their sources; compute nothing.")
    ] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Compute cases with printed or closed-form answers, and set romdam's numbers beside them.

    Exit code 1 if a number is outside its tolerance. A known difference is marked, with its reason.
    """
    from romdam.benchmarks.case import run_cases, select_cases
    from romdam.benchmarks.catalogue import CASES
    from romdam.benchmarks.table import refuse_format, write_rows
    from romdam.core.benchmark_row import WRONG
    from romdam.terminal import complain, only_errors, open_terminal
    from romdam.terminal.tables import benchmarks_table, cases_table

    stages, say = open_terminal(quiet, verbose)
    if out is not None:
        refuse_format(out)
    cases = select_cases(CASES, *(only or ()))
    if listing:
        say(cases_table(cases))
        return
    search_what_comes()
    with only_errors(verbose):
        rows = run_cases(cases, stages)
    notes = [f"{row.case}: known difference: {row.note}" for row in rows if row.verdict == "known difference"]
    say(benchmarks_table(rows), *dict.fromkeys(notes))
    if out is not None:
        say(f"written: {write_rows(rows, out)}")
    wrong = [row for row in rows if row.verdict in WRONG]
    if wrong:
        complain(
            *(
                f"{row.case}, {row.quantity}: {row.note}"
                if row.verdict == "failed"
                else f"{row.case}, {row.quantity}: {100 * row.difference:.3g} % from {row.source}, "
                f"limit {100 * row.tolerance:g} %"
                for row in wrong
            ),
            f"{len(wrong)} of {len(rows)} numbers are outside their tolerance or failed",
        )
        raise typer.Exit(FAILED)
