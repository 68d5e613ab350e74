"""Accuracy over the baselines that were kept, one line per method."""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._style import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, RED, SKY, panels, styled

_COLOURS = (BLUE, RED, GREEN, ORANGE, SKY, PINK, BLACK, GREY)
_DASHES = ("-", "--", ":")


@styled
def draw(table: pd.DataFrame) -> Figure:
    """Draw the lines, each named at its right end, the names pushed apart."""
    wide = table.pivot(index="baseline", columns="method", values="accuracy_applicable")
    made = table.drop_duplicates("baseline").set_index("baseline")
    figure, axes = panels(1, 1, 7.0, 0.24 * wide.shape[1] + 1.6)
    place = axes[0, 0]
    last = wide.ffill().iloc[-1].sort_values()
    gap = max(float(last.max() - last.min()), 0.05) / max(len(last) - 1, 1) * 0.9
    at = float("-inf")
    for k, (method, value) in enumerate(last.items()):
        style = {
            "color": _COLOURS[k % len(_COLOURS)],
            "linestyle": _DASHES[k // len(_COLOURS) % len(_DASHES)],
        }
        line = wide[method]
        place.plot(range(len(line)), line, marker="o", **style)
        at = max(float(value), at + gap)
        end = (len(line) - 1, float(value))
        place.annotate(
            f"{method} {value:.3f}",
            end,
            (len(line) - 0.85, at),
            va="center",
            fontsize=7.5,
            color=style["color"],
        )
    place.set_xticks(range(len(wide)), [f"{b}\n{str(made['commit'][b])[:7]}" for b in wide.index])
    place.set_xlim(-0.2, len(wide) - 1 + 0.45 * max(len(wide) - 1, 1) + 0.3)
    place.set_xlabel("baseline, commit")
    place.set_ylabel("accuracy against cycled, where it applies")
    return figure
