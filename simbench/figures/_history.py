"""Draw the accuracy over the stored baselines, one line per method."""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._style import label, panel, series, styled


@styled
def draw(table: pd.DataFrame) -> Figure:
    """Draw the lines, each named at its right end, the names pushed apart."""
    wide = table.pivot(index="baseline", columns="method", values="accuracy_applicable")
    made = table.drop_duplicates("baseline").set_index("baseline")
    figure, place = panel(7.0, 0.24 * wide.shape[1] + 1.6)
    last = wide.ffill().iloc[-1].sort_values()
    gap = max(float(last.max() - last.min()), 0.05) / max(len(last) - 1, 1) * 0.9
    at = float("-inf")
    for k, (method, value) in enumerate(last.items()):
        colour, dashes = series(k)
        line = wide[method]
        place.plot(range(len(line)), line, marker="o", color=colour, linestyle=dashes)
        at = max(float(value), at + gap)
        end, beyond = (len(line) - 1, float(value)), (len(line) - 0.85, at)
        name = f"{method} {value:.3f}"
        place.annotate(name, end, beyond, va="center", fontsize=7.5, color=colour)
    place.set_xticks(range(len(wide)), [f"{b}\n{str(made['commit'][b])[:7]}" for b in wide.index])
    place.set_xlim(-0.2, len(wide) - 1 + 0.45 * max(len(wide) - 1, 1) + 0.3)
    label(place, "baseline, commit", "accuracy against cycled, where it applies")
    return figure
