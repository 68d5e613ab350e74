"""What the pages of a diagnosis, a plan and a discovery share."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from importlib.metadata import version
from pathlib import Path

from markupsafe import Markup
from matplotlib.figure import Figure

from simbench.files import whole_file
from simbench.gap.report.pictures import Traces, draw_loops, draw_spectra, draw_traces
from simbench.gap.report.traces import end_of
from simbench.gap.situation import Situation
from simbench.html.page import render as render_in
from simbench.html.svg import inline_svg

render = partial(render_in, "simbench.gap.report")


def write(
    path: str | Path, title: str, subtitle: str, sections: Iterable[tuple[str, str, str]]
) -> None:
    """Write sections (id, title, body), those that are not empty, as one self-contained page."""
    text = render(
        "page.html",
        title=title,
        subtitle=subtitle,
        sections=[{"id": i, "title": name, "body": body} for i, name, body in sections if body],
        footer=f"simbench {version('stiction-simbench')}",
    )
    with whole_file(path) as f:
        f.write(text)


def caption_pictures(drawn: Iterable[tuple[Figure, str, str]]) -> list[dict[str, str]]:
    """Return pictures, each with its name and what it shows, as a template takes them."""
    return [
        {"svg": inline_svg(figure, name, caption), "caption": f"{caption}."}
        for figure, name, caption in drawn
    ]


def look(traces: Traces, situation: Situation) -> Markup:
    """Return the record and its simulations in pictures: over time, over OP, and their spectra."""
    part, shown = end_of(situation), "record and simulations"
    drawn = [
        (draw_traces("PV", traces, part), "pv", f"PV over time, set point dotted: {shown}"),
        (draw_traces("OP", traces, part), "op", f"OP over time: {shown}"),
        (draw_loops("PV", traces, part), "pv-op", f"PV over OP: {shown}"),
        (draw_spectra(traces), "spectra", "Power spectra of PV and OP, whole record"),
    ]
    if all(trace.mv is not None for trace in traces.values()):
        drawn.append((draw_loops("MV", traces, part), "mv-op", f"MV over OP: {shown}"))
    return render(
        "look.html", items=caption_pictures(drawn), names=list(traces), given=situation.trusted
    )
