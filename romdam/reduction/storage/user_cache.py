"""The user's folder of reduced blocks: single jobs find there what earlier ones have reduced.

    $XDG_CACHE_HOME/romdam/block-<key>.h5    (~/.cache without it; %LOCALAPPDATA% on Windows)

The key says from which mesh, material, supports and modes a block was made, and by which code (`keys.py`).
The blocks that were used longest ago go where all together, those of other code too, would exceed a limit.
"""

from __future__ import annotations

import logging
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from romdam.core.basis import BlockBasis
from romdam.core.errors import ResultError
from romdam.core.files import hold
from romdam.core.scene import Block
from romdam.reduction.storage.model_file import BlockStore, StreamedBasis

log = logging.getLogger(__name__)

LIMIT = 10e9  # bytes of all blocks: a thousand of the main job's, or one and a half of a million unknowns
_FILES = ("block-*.h5", ".block-*.columns")
_CODE = re.compile("[0-9a-f]{12}")  # folder of the blocks of one code, in versions of before


@dataclass(frozen=True)
class Entry:
    """A file of the cache: a block, or the unfinished columns of one.

    Attributes
    ----------
    size : bytes
    used : when last [s since 1970]
    """

    path: Path
    size: int
    used: float


def cache_folder() -> Path:
    """The user's folder of reduced blocks, which may not be there yet."""
    system = os.environ.get("LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME", "")
    if os.path.isabs(system):  # the convention asks for it
        return Path(system) / "romdam"
    return Path(os.path.expanduser("~")) / ".cache" / "romdam"


def open_store(folder: Path | None) -> BlockStore | None:
    """The store of a folder, limited if it is the user's; None without one, or where that takes no files."""
    if folder != cache_folder():
        return None if folder is None else BlockStore(folder)
    try:
        if not folder.is_absolute():
            raise FileNotFoundError("no home folder is known")
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not os.access(folder, os.W_OK):
            raise PermissionError(f"{folder} cannot be written")
    except OSError as error:
        log.warning("%s: reduced blocks cannot be kept there (%s); give --cache or --no-cache", folder, error)
        return None
    return UserCache(folder)


class UserCache(BlockStore):
    """The store of a folder in which blocks make room for new ones."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._used: set[Path] = set()

    def read(self, key: str, inner: BlockBasis | None = None) -> BlockBasis | None:
        """As `BlockStore`; what is found counts as used now."""
        basis = super().read(key, inner)
        if basis is not None:
            log.info("%s: the reduced block is found", self.path(key))
            self._use(key, grown=not self._used)
        return basis

    def write(self, key: str, block: Block, basis: BlockBasis) -> BlockBasis:
        """As `BlockStore`; where the disk refuses the block, the job goes on without keeping it."""
        try:
            basis = super().write(key, block, basis)
        except ResultError as error:
            log.warning("%s; the reduced block is not kept", error)
        self._use(key)
        return basis

    def write_streamed(self, key: str, block: Block, streamed: StreamedBasis) -> BlockBasis:
        """As `BlockStore`."""
        basis = super().write_streamed(key, block, streamed)
        self._use(key)
        return basis

    def _use(self, key: str, grown: bool = True) -> None:
        """Count a block as used now; let others go as far as the limit asks, but not this job's own.

        Parameters
        ----------
        grown : whether the folder may exceed the limit since it was looked at
        """
        path = self.path(key)
        self._used.add(path)
        with suppress(OSError):
            os.utime(path)
        if not grown:
            return
        left = entries(self.folder)
        size = sum(entry.size for entry in left)
        for entry in left:
            if size > LIMIT and entry.path not in self._used:
                size -= entry.size if remove(entry) else 0


def entries(folder: Path) -> list[Entry]:
    """Files in the user's cache, that used longest ago in front."""
    # folders of single codes, as earlier versions had them; others are of files being written
    earlier = [path for path in folder.iterdir() if _CODE.fullmatch(path.name)] if folder.is_dir() else []
    files = []
    for level in (folder, *earlier):
        with suppress(OSError):  # another process has removed the folder of before
            for path in (path for name in _FILES for path in level.glob(name)):
                with suppress(OSError):  # or the file
                    about = path.stat()
                    files.append(Entry(path, about.st_size, about.st_mtime))
    return sorted(files, key=lambda entry: (entry.used, entry.path))


def remove(entry: Entry) -> bool:
    """Remove a file, unless another process is writing it; whoever reads it keeps what it has."""
    try:
        if entry.path.suffix == ".columns":
            lock = hold(entry.path)
            if lock is None:
                return False
            try:
                entry.path.with_name(f"{entry.path.name}.done").unlink(missing_ok=True)
                entry.path.unlink(missing_ok=True)
            finally:
                os.close(lock)
            return True
        entry.path.unlink(missing_ok=True)
    except OSError:  # Windows: it is open
        return False
    if _CODE.fullmatch(entry.path.parent.name):
        with suppress(OSError):  # other blocks are there
            entry.path.parent.rmdir()
    return True
