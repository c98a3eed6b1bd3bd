"""The site: `make docs` builds it into out/site, without network and with warnings as errors."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NoReturn

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

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
nb_execution_mode = "force"  # what a lesson prints is that of the present code
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True  # what a cell prints is one block

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = f"minisim {__version__}"
html_math_renderer = "mathml"  # Sphinx's own renderers load MathJax from the net, or need LaTeX


def setup(app: Sphinx) -> None:
    """Formulas are MathML, which every browser of today draws by itself."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))


def _inline(writer: HTML5Translator, node: nodes.math) -> NoReturn:
    writer.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _block(writer: HTML5Translator, node: nodes.math_block) -> NoReturn:
    writer.body.append(f"<div>{tex2mathml(node.astext(), as_block=True)}</div>")
    raise nodes.SkipNode
