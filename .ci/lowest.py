"""Print the lower bounds of pyproject.toml, and of the extras that are named, as constraints for pip."""

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text("utf-8"))["project"]
extras = (project["optional-dependencies"][name] for name in sys.argv[1:])
for requirement in {one for group in (project["dependencies"], *extras) for one in group}:
    if bound := re.match(r"([\w-]+)>=([\w.]+)", requirement):
        print(f"{bound[1]}=={bound[2]}")
