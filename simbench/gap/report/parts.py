"""What the pages of a diagnosis, a plan and a discovery share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path

from markupsafe import Markup
from matplotlib.figure import Figure

from detectors.record import LoopRecord
from simbench.files import whole_file
from simbench.gap.report import pictures
from simbench.html.page import render as render_in
from simbench.html.svg import inline_svg

render = partial(render_in, "simbench.gap.report")
Picture = tuple[Figure, str, str]  # with its name and what it shows


def write(
    path: str | Path, title: str, subtitle: str, sections: Iterable[tuple[str, str, Markup]]
) -> None:
    """Write sections (id, title, body) as one self-contained HTML page."""
    text = render(
        "page.html",
        title=title,
        subtitle=subtitle,
        sections=[{"id": i, "title": name, "body": body} for i, name, body in sections],
        footer=f"simbench {version('stiction-simbench')}",
    )
    with whole_file(path) as f:
        f.write(text)


def compared(
    record: LoopRecord, runs: Mapping[str, LoopRecord], start: int, stop: int
) -> list[Picture]:
    """Return the pictures of PV and of OP over time, and of the power spectra."""
    part, shown = (record, runs, start, stop), "record and simulations"
    return [
        (pictures.draw_traces("PV", *part), "pv", f"PV over time, set point dotted: {shown}"),
        (pictures.draw_traces("OP", *part), "op", f"OP over time: {shown}"),
        (
            pictures.draw_spectra(record, runs),
            "spectra",
            "Power spectra of PV and OP, whole record",
        ),
    ]


def captioned(drawn: Iterable[Picture]) -> list[dict[str, str]]:
    """Return pictures as a template takes them, what they show as their caption."""
    return [
        {"svg": inline_svg(figure, name, caption), "caption": f"{caption}."}
        for figure, name, caption in drawn
    ]
