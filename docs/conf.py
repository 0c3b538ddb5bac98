"""The documentation's site, built by `make docs`: Markdown and docstrings, without scripts or fonts from elsewhere."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))

import defaults
import scene_keys

import cosserat_fenicsx

for module in (defaults, scene_keys):  # pages that follow from the code
    file, text = Path(__file__).parent / "api" / f"{module.__name__}.md", module.page()
    file.parent.mkdir(exist_ok=True)
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")
project, copyright = "cosserat_fenicsx", "MIT licence"
version = release = cosserat_fenicsx.__version__
html_title = f"cosserat_fenicsx {release}"
extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "myst_nb",
    "formulas",
    "responsive",
]
html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_math_renderer = "drawn"
html_show_sourcelink = html_copy_source = False
templates_path = ["templates"]
exclude_patterns = ["templates", "paper"]

default_role = "py:obj"  # `Path` in a docstring becomes a link
napoleon_use_ivar = True
autodoc_typehints = "none"
autodoc_use_type_comments = False  # there are none, and to look for them takes a fifteenth of the time
autosummary_imported_members = True
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # the tests run the tutorials, and compare what they print


def collapsed(app, pagename, templatename, context, doctree):
    """The navigation opens where the reader is: all names of the reference on each page of it take most of the time."""
    if whole := context.get("toctree"):
        depth = 1 if pagename.startswith("api/") else 2
        context["toctree"] = lambda **options: whole(**options | {"collapse": True, "maxdepth": depth})


def setup(app):
    """Sphinx's entry point."""
    app.connect("html-page-context", collapsed, priority=400)  # before the theme, whose is 500
