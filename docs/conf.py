"""Sphinx settings of the manual; `make docs` builds it, and a warning is an error."""

import os
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import tables

import romdam

project = "romdam"
author = copyright = "the romdam authors"
version = release = romdam.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx-mathjax-offline"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
nb_execution_mode = "force"  # of docs/tutorials, which hold no outputs
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
exclude_patterns = ["_build", "generated", "jupyter_execute"]
html_theme = "furo"
html_title = f"romdam {version}"
html_static_path = ["_static"]
html_css_files = ["manual.css"]
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_use_type_comments = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
napoleon_google_docstring = False
napoleon_use_ivar = True
nitpicky = False


def _plain(*arguments: Any) -> None:
    """Docstrings are plain text: a bar or a star in them marks nothing up."""
    lines = arguments[5]
    for i, line in enumerate(lines):
        lines[i] = line.replace("|", r"\|").replace("*", r"\*")


def setup(app: Any) -> None:
    """Write the tables that come from the code, before any page is read."""
    tables.write(Path(__file__).parent / "generated")
    app.connect("autodoc-process-docstring", _plain, priority=1)
