"""The architecture in one picture: how data flow, and which subpackage may import which, from the
import rules that `make lint` checks.

The picture is committed (`PICTURE`), with its words as the description in the file; run this file
to print it again.
"""

from __future__ import annotations

import importlib
import json
import textwrap
import tomllib
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

PYPROJECT = Path(__file__).parents[3] / "pyproject.toml"
PICTURE = Path(__file__).parents[1] / "_static" / "architecture.svg"
FLOW = (
    ("scenarios", "what to try:\nloop, grid"),
    ("simbench", "simulate it:\nloop, valves, effects"),
    ("detectors", "judge it:\nmethods"),
    ("simbench", "score it, draw it,\ncompare with a plant"),
    ("results", "what a command\nprinted"),
)
GROUND = (
    ("scenarios", "what to try"),
    ("detectors", "judge a record"),
    ("valve", "move a valve by one sample"),
)
COLOUR = {
    "scenarios": "#F6E7C1",
    "simbench": "#D6E6F2",
    "detectors": "#F5D9C8",
    "results": "#E4E4E4",
}
WIDE, ROW = 8.6, 0.42


def layers() -> list[list[str]]:
    """Return the parts of simbench, the uppermost first; those in one list do not import each
    other.
    """
    contracts = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (rule,) = (c for c in contracts if c["type"] == "layers" and c["containers"] == ["simbench"])
    return [[part.strip() for part in layer.split("|")] for layer in rule["layers"]]


def purposes() -> dict[str, str]:
    """Return the first sentence of the docstring of every part that the picture shows."""
    sentences = {}
    # the others are small helpers, or stand in a row of their own
    apart = 2 + len(GROUND)
    for part in (part for layer in layers()[:-apart] for part in layer):
        text = (importlib.import_module(f"simbench.{part}").__doc__ or "").split("\n\n")[0]
        sentences[part] = " ".join(text.split()).partition(". ")[0].rstrip(".")
    return sentences


def words() -> str:
    """Return the texts of the picture, as the description in its file."""
    return json.dumps([FLOW, GROUND, purposes()])


def draw() -> Figure:
    """Draw the picture."""
    with matplotlib.rc_context({"font.family": "DejaVu Sans", "font.size": 8.5}):
        parts = purposes()
        height = 2.0 + ROW * len(parts) + 0.9
        figure = Figure(figsize=(WIDE, height))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(0, WIDE), ylim=(0, height))
        axes.set_axis_off()
        _flow(axes, height - 1.25)
        y = height - 1.95
        axes.text(
            0.1,
            y + 0.12,
            "Parts of simbench: each may import those below it, and none above it",
            weight="bold",
        )
        for part, purpose in parts.items():
            y -= ROW
            _box(axes, (0.1, y, WIDE - 0.2, ROW - 0.06), COLOUR["simbench"])
            axes.text(0.25, y + 0.5 * (ROW - 0.06), part, va="center", weight="bold")
            axes.text(
                1.3,
                y + 0.5 * (ROW - 0.06),
                textwrap.fill(purpose, 100),
                va="center",
                fontsize=8,
                linespacing=1.1,
            )
        y -= 0.62
        each = (WIDE - 0.1) / len(GROUND)
        for k, (name, role) in enumerate(GROUND):
            left = 0.1 + k * each
            _box(axes, (left, y, each - 0.1, 0.5), COLOUR.get(name, COLOUR["simbench"]))
            axes.text(left + 0.15, y + 0.32, name, va="center", weight="bold")
            axes.text(left + 0.15, y + 0.14, role, va="center")
        return figure


def _flow(axes: Axes, y: float) -> None:
    wide = (WIDE - 0.2 - 4 * 0.22) / 5
    for k, (name, content) in enumerate(FLOW):
        left = 0.1 + k * (wide + 0.22)
        _box(axes, (left, y, wide, 0.95), COLOUR[name])
        axes.text(left + wide / 2, y + 0.74, name, ha="center", va="center", weight="bold")
        axes.text(left + wide / 2, y + 0.34, textwrap.dedent(content), ha="center", va="center")
        if k:
            arrow = {"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", (left, y + 0.47), (left - 0.22, y + 0.47), arrowprops=arrow)


def _box(axes: Axes, place: tuple[float, float, float, float], colour: str) -> None:
    x, y, wide, high = place
    style = "round,pad=0,rounding_size=0.05"
    axes.add_patch(
        FancyBboxPatch(
            (x, y), wide, high, style, facecolor=colour, edgecolor="#444444", linewidth=0.8
        )
    )


def write(path: Path = PICTURE) -> None:
    """Write the picture as SVG, the same bytes every time."""
    with matplotlib.rc_context({"svg.hashsalt": "architecture", "svg.fonttype": "path"}):
        draw().savefig(path, format="svg", metadata={"Date": None, "Description": words()})


if __name__ == "__main__":
    write()
