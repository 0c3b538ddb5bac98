"""Formulas of the site as drawings inside the pages, by matplotlib: they need no script, no font and no network."""

import io
import re

import matplotlib
from docutils.nodes import SkipNode
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

_POINTS = 12.5  # size of the letters; a pixel of the page is 0.75 points


def _drawn(latex):
    """The formula as an <svg>, in the colour of the text around it and on its line."""
    file = io.BytesIO()
    with matplotlib.rc_context({"mathtext.fontset": "cm", "svg.hashsalt": "formula"}):
        depth = math_to_image(f"${latex}$", file, prop=FontProperties(size=_POINTS), dpi=72, format="svg")
    svg = file.getvalue().decode()
    svg = re.sub(r"<metadata>.*?</metadata>|<style[^>]*>.*?</style>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    svg = re.sub(r'<g id="patch_1">.*?</g>', "", svg, flags=re.DOTALL)  # the white paper
    return svg.replace("<svg", f'<svg class="formula" style="vertical-align:{-depth:.1f}pt"', 1)


def _inline(writer, node):
    writer.body.append(_drawn(node.astext()))
    raise SkipNode


def _displayed(writer, node):
    writer.body.append(f'<div class="formula">{_drawn(" ".join(node.astext().split()))}</div>')
    raise SkipNode


def setup(app):
    """Sphinx's entry point."""
    app.add_html_math_renderer("drawn", (_inline, None), (_displayed, None))
    return {"parallel_read_safe": True}
