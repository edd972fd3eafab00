"""Names that a user gives: they become those of files, of groups in files, and words in tables."""

from __future__ import annotations

import unicodedata
from typing import Annotated

from pydantic import AfterValidator

from romdam.core.errors import quote

LONGEST = 100  # bytes; a file's name has at most 255, and figures and runs add to it
_FORBIDDEN = '/\\:*?"<>|'  # of file names on one system or another; of groups in HDF5; "*" is every joint
_WRITTEN = {  # by commands themselves
    "summary", "design", "study", "comparison", "report", "report-data", "verification",
}  # fmt: skip
_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in range(1, 10))}


def same_file(name: str) -> str:
    """Return what two names have in common that are one file's to some file systems."""
    return unicodedata.normalize("NFC", name).casefold()


def misnamed(name: str) -> str:
    """Say what is wrong with a name, and the remedy; empty where nothing is."""
    if not name.strip() or name != name.strip():
        return "is empty or begins or ends with a blank; remove it"
    size = len(name.encode("utf-8", "replace"))
    if size > LONGEST:
        return f"has {size} bytes, at most {LONGEST} go into the name of a file; shorten it"
    wrong = next((c for c in name if c in _FORBIDDEN or not c.isprintable()), "")
    if wrong or name[0] in ".-" or name[-1] == ".":
        what = f"holds {wrong!r}" if wrong else "begins with a dot or a dash, or ends with a dot"
        return f"{what}, which not every file system takes; use letters, digits, _ and -"
    if unicodedata.normalize("NFC", name) != name:
        return "is written with combining characters, which look like others; use composed ones (NFC)"
    return ""


def misnamed_file(name: str) -> str:
    """Say what is wrong with a record's name, which its results bear; empty where nothing is."""
    stem = same_file(name)
    if stem in _WRITTEN or stem.startswith(("model-", "stress-")):
        return "is that of a file that romdam writes itself; choose another"
    if stem.split(".")[0] in _DEVICES:
        return "is that of a device on Windows; choose another"
    return misnamed(name)


def _name(value: str) -> str:
    if wrong := misnamed(value):
        raise ValueError(f"the name {quote(value)} {wrong}")
    return value


def _file_name(value: str) -> str:
    if wrong := misnamed_file(value):
        raise ValueError(f"the name {quote(value)} {wrong}")
    return value


Name = Annotated[str, AfterValidator(_name)]
OfFile = AfterValidator(_file_name)
