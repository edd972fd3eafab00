"""Files written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from romdam.errors import ResultError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary name in the same folder, renamed to `path` once the body has ended well.

    Raises
    ------
    ResultError
        where the operating system refuses the file.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise ResultError(
            f"{path}: cannot be written ({error}); free the disk or choose another folder"
        ) from error
    finally:
        part.unlink(missing_ok=True)


def prepare_folder(folder: Path) -> Path:
    """Make an output folder and prove that it takes files, before anything is computed.

    Raises
    ------
    ResultError
        where it cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"{folder}: the output folder cannot be made ({error}); choose another") from error
    with replacing(folder / ".writable") as part:
        part.touch()
    (folder / ".writable").unlink()
    return folder
