"""Describe a file of reduced blocks: a block of the cache, or the basis file beside results."""

from __future__ import annotations

from pathlib import Path

import h5py

from romdam.core.errors import ResultError
from romdam.core.sealed import examine, opened, text_of
from romdam.reduction.storage.model_file import LAYOUT, read_block
from romdam.results.fields import stored_digest

_STRESS = "romdam-stress-"  # what the format of a stress file begins with, in any version


def model_lines(path: str | Path) -> list[str]:
    """Sizes, cut-off, library version and hash of every reduced block in a file, each checked as it is read.

    Raises
    ------
    ResultError
        where there is no such file, or it is not one of reduced blocks.
    """
    path = Path(path)
    sealed = examine(path).sealed
    with opened(path) as file:
        if text_of(file, "format").startswith(_STRESS):
            raise ResultError(
                f"{path}: holds the stress of modes, for `romdam.open_result`; name the file of reduced "
                "blocks beside it, model-*.h5"
            )
        blocks = dict(file["blocks"]) if "blocks" in file else {"(cache)": file}
        if any(text_of(group, "layout") != LAYOUT for group in blocks.values()):
            raise ResultError(f"{path}: is not a file of reduced blocks of this version ({LAYOUT})")
        digest = text_of(file, "key") or text_of(file, "content_sha256")
        if not sealed and not ("blocks" in file and stored_digest(file) == digest):
            raise ResultError(
                f"{path}: was damaged or changed since it was written; the next run makes it again"
            )
        state = "whole" if sealed else "mesh and basis whole, frequencies and report not vouched for"
        lines = [f"{path.name}: {len(blocks)} reduced block{'s' * (len(blocks) > 1)}, {state}"]
        lines += [f"layout         {LAYOUT}, written by {text_of(file, 'source') or 'an unknown version'}"]
        lines += [f"SHA-256        {digest}"]
        return lines + [line for name, group in blocks.items() for line in _block_lines(name, group)]


def _block_lines(name: str, group: h5py.Group) -> list[str]:
    if "mix" in group and "of" in group["mix"].attrs:
        (all_of_them, columns), more = group["mix"].shape, group["basis"].shape[2]
        of = f"{all_of_them - more} modes of another file, {more} residual vectors beside them"
        return [f"block {name}, finer basis of an error estimate", f"  coordinates  {columns}: {of}"]
    try:
        block = read_block(group)
    except ResultError as error:
        return [f"block {name}: damaged, {error}"]
    report = block.report
    frequencies = report.get("frequencies_hz")
    lowest = ", ".join(f"{f:.3g}" for f in frequencies[:4]) if isinstance(frequencies, list) else "none"
    asked = f"below {report['cutoff_hz']:g} Hz" if "cutoff_hz" in report else "by count"
    cells, nodes = group["cells"], len(group["points"])
    return [
        f"block {name}",
        f"  mesh         {len(cells)} {cells.attrs['element']}, {nodes} nodes, {3 * nodes} DOFs",
        f"  coordinates  {block.vectors.shape[1]}: {report.get('retained_dofs')} retained, "
        f"{report.get('fixed_interface_modes')} fixed-interface modes ({asked}), "
        f"{report.get('static_vectors', 0)} static vectors, "
        f"{report.get('residual_vectors', report.get('corrections'))} residual vectors",
        f"  method       {report.get('method', 'unknown')}",
        f"  frequencies  {lowest} Hz with the joints open; fixed interface up to "
        f"{report.get('highest_fixed_interface_hz', 0.0):.4g} Hz",
        f"  basis        {block.vectors.nbytes / 1e6:.1f} MB",
    ]
