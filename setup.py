"""The long description of the package: README.md, with pictures where a package's page finds them.

The page of a package index shows no file of the project. A picture is linked at the public address of this
version, below `[project.urls] Repository` in pyproject.toml; without one it is left out with its caption.
"""

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
_PICTURE = re.compile(r"^!\[([^\]]*)\]\(([\w./-]+)\)\n+(\*[^\n]+\*\n+)?", re.MULTILINE)  # and its caption


def long_description(text: str, address: str, version: str) -> str:
    """README.md with its pictures at their public address, or without them if that is empty."""
    if not address:
        return _PICTURE.sub("", text)
    raw = f"{address.rstrip('/')}/raw/v{version}"
    return _PICTURE.sub(lambda found: found[0].replace(f"]({found[2]})", f"]({raw}/{found[2]})"), text)


if __name__ == "__main__":
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"].get("urls", {})
    stated = re.search(
        r'^VERSION = "(.+)"', (ROOT / "romdam/core/version.py").read_text("utf-8"), re.MULTILINE
    )
    assert stated is not None
    text = (ROOT / "README.md").read_text("utf-8")
    setup(
        long_description=long_description(text, urls.get("Repository", ""), stated[1]),
        long_description_content_type="text/markdown",
    )
