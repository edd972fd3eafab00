"""SHA-256 of plain data: what a stored file was made from; of the code; and of a file's bytes.

Results are told apart by their scene and their samples: the SHA-256 of a configuration is of its keys alone,
and a mesh, a record, matrices or a gap table can be another under the same name. What is kept for later
counts for the code that computed it alone: its key has the digest of that code; a version stands for many.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hashlib import _Hash

# rooms that show or compare what was computed, or write it for others; every other room may move a number
_SHOWING = ("benchmarks", "commands", "examples", "export", "terminal", "visual")
_IMPORT = re.compile(
    rb"^[ \t]*(?:from[ \t]+(romdam[\w.]*)[ \t]+import[ \t]+(\([^)]*\)|[^\n]+)|import[ \t]+(romdam[^\n]*))",
    re.M,
)
_LIBRARIES = ("numpy", "scipy", "numba")  # that multiply, factor and compile


def fingerprint(value: object) -> str:
    """SHA-256 of a tree of dataclasses, mappings, sequences, sets, arrays, sparse matrices and plain values.

    Arrays count by shape and content: floats as float64, integers and booleans as int64; numpy's scalars as
    Python's. The order of a mapping counts, as the order of blocks and joints does.

    Raises
    ------
    TypeError
        for anything else.
    """
    content = hashlib.sha256()
    _add(content, value)
    return content.hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes.

    Raises
    ------
    OSError
        where it cannot be read.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def files_digest(paths: Iterable[Path]) -> str:
    """SHA-256 of the bytes of files one after another; those that cannot be read count as empty."""
    content = hashlib.sha256()
    for path in paths:
        with suppress(OSError):  # a package in an archive, which does not change file by file
            content.update(path.read_bytes())
    return content.hexdigest()


@cache
def code_digest(*modules: str) -> str:
    """SHA-256 of modules and all that they import, of all that compute if none is named, and of libraries.

    It is of the code as it was when this process began: what is computed is not by what is edited meanwhile.

    Parameters
    ----------
    modules : full names, such as romdam.reduction.synthesis; those that are not romdam's count by name alone
    """
    counted = imported_modules(modules) if modules else {name for name in _CODE if _computes(name)}
    files = [(name, hashlib.sha256(_CODE[name]).hexdigest()) for name in sorted(counted)]
    return fingerprint((modules, files, [version(name) for name in ("romdam", *_LIBRARIES)]))


def imported_modules(modules: Iterable[str]) -> set[str]:
    """Names of modules of romdam and of all that they import, at once or later, one through another.

    Imports for type checkers count, as they name the types that a function takes. `romdam` itself holds names
    only, which are looked up when they are used.
    """
    reached = set[str]()
    left = [*modules]
    while left:
        name = left.pop()
        if name in _CODE and name not in reached:
            reached.add(name)
            left += [name.rpartition(".")[0], *_imports(name)]
    return reached


@cache
def _imports(module: str) -> frozenset[str]:
    """What the import statements of a module name: modules, and names in them, which may be modules too.

    The statements are read by an expression, in a fifth of the time that a syntax tree takes.
    """
    names = set[str]()
    for source, taken, plain in _IMPORT.findall(_CODE[module]):
        words = re.findall(r"[\w.]+", re.sub(r"#.*", "", (taken or plain).decode()))
        names |= {source.decode(), *(f"{source.decode()}.{word}" for word in words)} if source else {*words}
    return frozenset(names)


def _computes(module: str) -> bool:
    """Tell whether a module stands in a room that computes."""
    room, _, _ = module.removeprefix("romdam.").partition(".")
    return room not in _SHOWING


def _texts(package: Path) -> dict[str, bytes]:
    """Module -> its text, of every room, in the order of their paths.

    The pipelines of a checkout stand outside the package, by a link. A package in an archive has no files: it
    changes by its version alone.
    """
    texts = {}
    with suppress(OSError):
        rooms = sorted(path for path in package.iterdir() if path.is_dir())
        for path in (path for room in rooms for path in sorted(room.rglob("*.py"))):
            parts = path.relative_to(package).with_suffix("").parts
            texts[".".join(("romdam", *(parts[:-1] if parts[-1] == "__init__" else parts)))] = (
                path.read_bytes()
            )
    return texts


def _add(content: _Hash, value: Any) -> None:
    """Add a value to what is hashed; what numpy and scipy are needed for comes last."""
    if is_dataclass(value) and not isinstance(value, type):
        _add(content, {f.name: getattr(value, f.name) for f in fields(value)})
    elif isinstance(value, Mapping):
        content.update(f"mapping {len(value)};".encode())
        for key, entry in value.items():
            _add(content, key)
            _add(content, entry)
    elif isinstance(value, frozenset | set):
        _add(content, sorted(value))
    elif isinstance(value, list | tuple):
        content.update(f"sequence {len(value)};".encode())
        for entry in value:
            _add(content, entry)
    elif isinstance(value, slice):
        content.update(b"slice;")
        _add(content, (value.start, value.stop, value.step))
    elif value is None:
        content.update(b"NoneTypeNone;")
    elif isinstance(value, str | bytes | bool | int | float | PurePath):
        # numpy's own kinds of these have a repr that follows numpy's print options
        kinds = (kind for kind in (str, bytes, float) if isinstance(value, kind))
        content.update(f"{next(kinds, type(value)).__repr__(value)};".encode())
    else:
        import numpy as np
        from scipy.sparse import csr_matrix, issparse

        if issparse(value):
            matrix = csr_matrix(value)
            matrix.sum_duplicates()
            _add(content, (matrix.shape, matrix.indptr, matrix.indices, matrix.data))
        elif isinstance(value, np.generic) and value.dtype.kind in "fiub":
            _add(content, value.item())
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            plain = np.ascontiguousarray(value, dtype=np.float64 if value.dtype.kind == "f" else np.int64)
            content.update(f"array {np.shape(value)};".encode())
            content.update(plain.data if plain.size else b"")
        else:
            raise TypeError(f"no fingerprint of {type(value).__name__}")


_CODE = _texts(Path(__file__).parents[1])
