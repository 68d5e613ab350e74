"""Write the HTML page of a study: how far plant and grid differ, in which features, what it costs,
and what so few loops cannot show.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._style import BLUE, GREY, RED, label, panels, styled
from simbench.plant.page import SectionTable, section, write
from simbench.plant.study.result import Study

_SHOWN = 12  # features drawn


def write_study(study: Study, path: str | Path) -> None:
    """Write a study as one self-contained HTML page."""
    d, (auc, p) = study.distance, study.classifier
    differ = "differ from" if d["p"] < 0.05 else "cannot be told from"
    answer = (
        f"{study.loops} loops ({study.records} records) {differ} what grid {study.grid} simulates."
    )
    tiles = [
        (
            f"{d['value']:.2f}",
            f"kernel distance (95 % interval {d['lo']:.2f} to {d['hi']:.2f}), p = {d['p']:.3f}",
        ),
        (
            f"{auc:.2f}",
            f"AUC of a classifier that tells real from simulated loops (0.5 = cannot), p = {p:.2f}",
        ),
        (str(study.loops), "loops: the unit of every interval and p-value"),
    ]
    caption = (
        "Median of the real loops in spreads of the simulated ones; red where p < 0.05 among all"
        " features"
    )
    parts = [
        section("answer", "The answer", [answer], tiles=tiles),
        section(
            "features",
            "By what they differ",
            pictures=[(_draw_shifts(study.features[:_SHOWN]), caption)],
        ),
        section(
            "effects",
            "What explains it",
            _explained(study),
            table=SectionTable(_effects(study)) if study.effects else None,
        ),
        section("methods", "What it costs each detector", table=SectionTable(_methods(study))),
        section(
            "limits", "What so few loops can and cannot show", _limits(study), points=study.notes
        ),
    ]
    write(path, f"A plant against grid {study.grid}", "Sim-to-real gap of a benchmark", parts)


@styled
def _draw_shifts(features: Sequence[dict[str, float | str]]) -> Figure:
    """Draw how far single features lie from the simulation's."""
    figure, axes = panels(1, 1, 5.0, 0.22 * len(features) + 0.8)
    ax, at = axes.ravel()[0], np.arange(len(features))[::-1]
    colours = [RED if float(f["p"]) < 0.05 else BLUE for f in features]
    ax.barh(at, [float(f["shift"]) for f in features], color=colours, height=0.6)
    ax.set_yticks(at, [str(f["name"]) for f in features])
    ax.axvline(0.0, color=GREY, lw=0.7)
    label(ax, "shift (spreads of the simulated loops)", "")
    return figure


def _explained(study: Study) -> list[str]:
    if not study.effects:
        return ["No effect diagnosed in two or more loops brings the grid nearer to these loops."]
    steps = ", ".join(f"with {e.effect} {e.distance_after:.2f}" for e in study.effects)
    return [
        f"Distance: {study.distance['value']:.2f} as it is; {steps} (each joined to those before"
        " it)."
    ]


def _effects(study: Study) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "effect": e.effect,
            "share of loops": e.share,
            "distance after": e.distance_after,
            "costs most, alone": next(iter(e.costly()), "none"),
            "points": round(100 * min(e.costs.values()), 1),
        }
        for e in study.effects
    )


def _methods(study: Study) -> pd.DataFrame:
    rows = []
    for m, value in study.simulated.items():
        row: dict[str, object] = {
            "method": m,
            "on the grid": value,
            "with the effects": study.moved[m],
        }
        if study.real:
            real = study.real[m]
            row |= {"on these loops": real["value"], "from": real["lo"], "to": real["hi"]}
        rows.append(row | {f"{e.effect}, alone": e.costs[m] for e in study.effects})
    return pd.DataFrame(rows)


def _limits(study: Study) -> list[str]:
    smallest = 2.8 / np.sqrt(study.loops)
    return [
        (
            f"With {study.loops} loops a feature must be shifted by about {smallest:.1f} of its"
            " spread to be detected in 4 of 5 such plants, before correction for the number of"
            " features. The absence of a detected difference does not show that there is none."
        ),
        (
            "Accuracy is the mean of the shares right of sticky and of healthy loops; no decision"
            " is not right."
        ),
    ]
