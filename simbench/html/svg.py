"""Turn matplotlib figures into inline SVG that follows the colours and width of the page."""

import io
import re
import sys
from html import escape

import matplotlib
from markupsafe import Markup
from matplotlib.figure import Figure


def inline_svg(figure: Figure, name: str, caption: str) -> Markup:
    """Return a figure as an <svg> element for an HTML page, for which alone it was drawn: pyplot
    keeps it no longer.
    """
    figure.patch.set_alpha(0.0)
    for axes in figure.axes:
        axes.patch.set_alpha(0.0)
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        pyplot.close(figure)
    text = re.sub(r"\s+", " ", buffer.getvalue()).replace("> <", "><")
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text)
    # black follows the page's text colour, so that one picture serves light and dark
    text = re.sub(r"(stroke|fill): #000000", r"\1: currentColor", text)
    # ids are unique within one picture only
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)
    width = re.search(r'viewBox="0 0 ([\d.]+)', text)
    wide = float(width.group(1)) if width else 400.0
    head = (
        f'<svg role="img" aria-label="{escape(caption, quote=True)}"'
        f' style="max-width:{wide * 1.5:.0f}px" '
    )
    text = re.sub(r'<svg ([^>]*?)(width|height)="[^"]*"', r"<svg \1", text, count=1)
    text = re.sub(r'<svg ([^>]*?)(width|height)="[^"]*"', r"<svg \1", text, count=1)
    return Markup(text.replace("<svg ", head, 1))
