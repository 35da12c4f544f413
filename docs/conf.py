"""Sphinx' settings of the site. Build it with `sphinx-build -W -b html docs docs/_build`."""

import sys
from pathlib import Path

from pytest_simbench import __version__

sys.path.insert(0, str(Path(__file__).parent))
import made

project = "pytest-simbench"
author = "pytest-simbench developers"
project_copyright = "2026, the pytest-simbench developers"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"pytest-simbench {__version__}"
smartquotes = False  # they would turn the dashes of options into others

myst_heading_anchors = 3

default_role = "code"  # single backticks in docstrings
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_numpy_docstring = False
napoleon_use_ivar = True  # attributes of dataclasses are described in the class' docstring


def setup(app):
    """Makes the pages of docs/data, and the tables of all others."""
    made.write_pages()
    app.connect("source-read", lambda app, name, text: text.__setitem__(0, made.filled(text[0])))
