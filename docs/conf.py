"""The site: `make docs` builds it into out/site, without network and with warnings as errors."""

from __future__ import annotations

import sys
from pathlib import Path

from minisim.version import __version__

sys.path.insert(0, str(Path(__file__).parent))
import generate

generate.write(Path(__file__).parent / "generated")

project = "minisim"
author = "The minisim developers"
copyright = "2026, The minisim developers"
version = release = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
default_role = "code"  # docstrings put code between single backticks
autodoc_typehints = "none"  # they are in the signatures
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 120

html_theme = "furo"
html_title = f"minisim {__version__}"
