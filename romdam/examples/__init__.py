"""Jobs to begin with: the configurations of the repository, with the files that they name."""

from __future__ import annotations

import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from romdam.core.errors import ConfigError
from romdam.core.files import prepare_folder, replacing

EXAMPLES = {  # name -> its configuration, and what it is
    "two_cantilevers": ("two_cantilevers", "two concrete cantilevers pound each other; some seconds"),
    "suite": ("suite", "the same at three scales and with six joints, one page and one table of all runs"),
    "mesh": ("own_mesh", "two monoliths of a mesh file of gmsh, with friction, weight and water"),
    "gravity_dam": (
        "koyna",
        "Koyna's five monoliths on their bases, with friction and uplift; a minute or two",
    ),
    "arch_dam": ("arch_dam", "eight cantilevers between rock, with water; a minute or two"),
}
SCHEMA = "romdam.schema.json"
_FILE = re.compile(r"\.\./(data/[\w./-]+/)([\w.-]+)")


def contents(name: str) -> dict[str, str]:
    """Texts of an example's files by their names: its configuration first, and beside it what it names.

    The configuration's first line is that by which editors find the schema, which is the last file.
    """
    from romdam.config.schema import schema_text

    here = _folder()
    text = (here / "configs" / f"{EXAMPLES[name][0]}.yaml").read_text(encoding="utf-8")
    named = {match[2]: (here / match[1] / match[2]).read_text("utf-8") for match in _FILE.finditer(text)}
    text = _FILE.sub(r"\2", text).replace(f"configs/{EXAMPLES[name][0]}.yaml", f"{name}.yaml")
    return {f"{name}.yaml": text} | named | {SCHEMA: schema_text()}


def _folder() -> Traversable:
    """Folder of `configs` and `data`: beside this module once installed, in a checkout at its top."""
    here = files("romdam.examples")
    return here if (here / "configs").is_dir() else Path(__file__).parents[2]


def write(name: str, folder: Path) -> list[Path]:
    """Write an example's files; none of them if one is there already with another content."""
    texts = {folder / file: text for file, text in contents(name).items()}
    for path, text in texts.items():
        if path.exists() and path.read_text(encoding="utf-8", errors="replace") != text:
            raise ConfigError(f"{path}: is there already with other content, and stays; give another --out")
    prepare_folder(folder)
    for path, text in texts.items():
        with replacing(path) as unfinished:
            unfinished.write_text(text, encoding="utf-8")
    return list(texts)
