"""What pyproject.toml cannot say: the README as the package's description, with links that work outside the repository."""

import re
import tomllib
from pathlib import Path

from setuptools import setup

HERE = Path(__file__).parent
URL = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]["Repository"]
(VERSION,) = re.findall('__version__ = "(.*)"', (HERE / "cosserat_fenicsx" / "__init__.py").read_text(encoding="utf-8"))


def absolute(text):
    """Markdown whose links and pictures of this folder lead to the release's files in the repository."""

    def link(found):
        start, place, end = found.groups()
        kind = "raw" if place.endswith((".png", ".gif")) else "blob"
        return f"{start}{URL}/{kind}/v{VERSION}/{place}{end}"

    text = re.sub(r"(\]\()(?!https?:|#)([^)\s]+)(\))", link, text)
    return re.sub(r"(?m)^(\[[^\]]+\]: )(?!https?:)(\S+)()$", link, text)


setup(
    long_description=absolute((HERE / "README.md").read_text(encoding="utf-8")),
    long_description_content_type="text/markdown",
)
