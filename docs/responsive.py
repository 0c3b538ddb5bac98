"""Pictures of the site at every width: on narrow pages the one that is drawn for them (docs/pictures/narrow/), and each
picture leads to its file."""

import re
import shutil
from pathlib import Path

_NARROW = Path(__file__).parent / "pictures" / "narrow"
#: Pictures with so many small texts that narrow pages show them larger than the page, in a box that scrolls.
_SCROLL = ("failures", "work_precision_motion", "work_precision_sweep")
# Width of the page, pixels, up to which it is narrow.
_UP_TO = 640


def _responsive(found):
    """The picture of an <img> (a match) for pages of every width."""
    image, folder, name = found.group(0), found.group("folder"), found.group("name")
    if (_NARROW / name).exists():
        image = f'<source media="(max-width: {_UP_TO}px)" srcset="{folder}_images/narrow/{name}">{image}'
        image = f"<picture>{image}</picture>"
    kind = "picture scrolls" if Path(name).stem in _SCROLL and not (_NARROW / name).exists() else "picture"
    return f'<a class="{kind}" href="{folder}_images/{name}">{image}</a>'


def _page(app, pagename, templatename, context, doctree):
    if "body" in context:
        pattern = r'<img [^>]*?src="(?P<folder>(?:\.\./)*)_images/(?P<name>[^"/]+)"[^>]*>'
        context["body"] = re.sub(pattern, _responsive, context["body"])


def _copy(app, exception):
    if exception is None and app.builder.format == "html":
        shutil.copytree(_NARROW, Path(app.outdir) / "_images" / "narrow", dirs_exist_ok=True)


def setup(app):
    """Sphinx's entry point."""
    app.connect("html-page-context", _page)
    app.connect("build-finished", _copy)
    return {"parallel_read_safe": True}
