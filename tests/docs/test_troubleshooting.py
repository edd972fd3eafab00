"""The messages that docs/troubleshooting.md explains are messages of the code."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "troubleshooting.md").read_text()
SOURCES = [*(ROOT / "romdam").rglob("*.py"), *(ROOT / "pipelines").rglob("*.py")]
GAP = "..."  # names and numbers in a message of the page
SHORTEST = 4  # letters of a fragment that is looked for


@cache
def _messages():
    """Every text of the code, its placeholders as `GAP`, without backticks, with single blanks."""
    texts = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.JoinedStr):
                parts = [p.value if isinstance(p, ast.Constant) else GAP for p in node.values]
                texts.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(node.value)
    return {" ".join(text.replace("`", "").split()) for text in texts}


QUOTED = sorted(
    {
        text
        for line in PAGE.splitlines()
        if line.startswith(("| `", "**Message"))
        for text in re.findall(r"`([^`]+)`", line.split(" | ")[0])
        if " " in text and not re.search(r"[{}]", text)
    }
)


def test_the_page_quotes_messages():
    assert len(QUOTED) >= 25


@pytest.mark.parametrize("quoted", QUOTED)
def test_every_quoted_message_is_one_of_the_code(quoted):
    fragments = [part.strip(" ,;:.") for part in quoted.split(GAP)]
    fragments = [part for part in fragments if len(part) >= SHORTEST]
    assert fragments
    assert any(all(part in message for part in fragments) for message in _messages()), quoted
