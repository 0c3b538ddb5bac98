"""The documentation's site, built by `make docs`: Markdown and docstrings, without scripts or fonts from elsewhere."""

from docutils.nodes import SkipNode as _SkipNode
from latex2mathml.converter import convert

import cosserat_fenicsx

project, copyright = "cosserat_fenicsx", "MIT licence"
version = release = cosserat_fenicsx.__version__
html_title = f"cosserat_fenicsx {release}"
extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "myst_nb"]
html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
templates_path = ["templates"]
exclude_patterns = ["templates"]
html_show_sourcelink = html_copy_source = False

default_role = "py:obj"  # `Path` in a docstring becomes a link
napoleon_use_ivar = True
autodoc_typehints = "none"
autosummary_imported_members = True
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # the tests execute the notebook, and compare what it prints
suppress_warnings = ["config.cache"]


def _mathml(writer, node, display):
    """Formulas as MathML, which browsers show without a script."""
    writer.body.append(convert(node.astext(), display=display))
    raise _SkipNode


def setup(app):
    """Register the renderer of formulas."""
    app.add_html_math_renderer(
        "mathml",
        (lambda writer, node: _mathml(writer, node, "inline"), None),
        (lambda writer, node: _mathml(writer, node, "block"), None),
    )


html_math_renderer = "mathml"
