"""Text from files and names, before a terminal, a log or a page shows it."""

from __future__ import annotations

import unicodedata

_OBEYED = {"Cc", "Cf", "Cs", "Zl", "Zp"}  # controls, marks of direction, halves of pairs, line separators


def printable(text: str) -> str:
    """The text with control characters written out (``\\x1b``), but for line feeds and tabs.

    A terminal obeys such characters: a foreign file could clear the screen, change its title or forge lines.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        c if c in "\n\t" or unicodedata.category(c) not in _OBEYED else c.encode("unicode_escape").decode()
        for c in text
    )


def one_line(text: str) -> str:
    """The same as one line."""
    return printable(text).replace("\n", "\\n").replace("\t", " ")


def plain_cell(value: object) -> object:
    """A cell for spreadsheets: a text that begins as a formula does has an apostrophe in front."""
    if not isinstance(value, str):
        return value
    text = one_line(value)
    if len(text) < 2 or text[0] not in "=+-@":
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text
