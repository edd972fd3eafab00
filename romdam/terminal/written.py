"""Files that a command has written to a folder, found by what changed there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from romdam.core.machine import shown_size

Seen = dict[Path, tuple[int, int, int]]

_MOST = 20  # files of a folder within the folder that are listed one by one


def seen(folder: Path) -> Seen:
    """Content of a folder and of its folders: path -> number, time of change and size of each file."""
    stats = {}
    for path in (*folder.glob("[!.]*"), *folder.glob("[!.]*/[!.]*")):
        if path.is_file():
            about = path.stat()
            stats[path] = (about.st_ino, about.st_mtime_ns, about.st_size)
    return stats


def written_lines(folder: Path, before: Seen) -> Iterator[str]:
    """A line for each file that is new or was written again, results first; one for a folder of many."""
    now = seen(folder)
    changed = [path for path, about in now.items() if before.get(path) != about]
    inner: dict[Path, list[Path]] = {}
    for path in sorted(changed, key=lambda path: (path.suffix != ".nc", path)):
        if path.parent == folder:
            yield f"written: {path}"
        else:
            inner.setdefault(path.parent, []).append(path)
    for parent, paths in sorted(inner.items()):
        if len(paths) > _MOST:
            size = shown_size(sum(now[path][2] for path in paths))
            yield f"written: {parent}, {len(paths)} files, {size}"
        else:
            yield from (f"written: {path}" for path in paths)
