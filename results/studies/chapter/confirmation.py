"""Rows on the confirmation tests and the procedure: sections 11.8 and 11.9."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from results.studies.chapter.row import Row, Source
from simbench.confirm.travel import travel_test
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import STICTION
from simbench.figures._cycles import sustained_cycle
from simbench.figures._folder import FIGURES

NOISE = 0.05  # of PV's standard deviation


def rows(isdb: Source) -> Iterator[Row]:
    """Yield the rows of sections 11.8 and 11.9; `isdb` is not used."""
    yield from _gain_change()
    yield from _travel()
    yield _nonlinearity_first()


def _gain_change() -> Iterator[Row]:
    for name, printed, what in (
        ("fig_11_24", "period longer, shape kept", "stiction, Kc lowered to 0.6 of itself"),
        ("fig_11_25", "period unchanged", "outside sine, Kc lowered to 0.6 of itself"),
    ):
        halves = (
            FIGURES.load(name)
            .data()
            .groupby("Kc", sort=False)[["period (s)", "amplitude (%)"]]
            .first()
        )
        (p1, a1), (p2, a2) = halves.to_numpy()
        ours = f"period {p1:.0f} to {p2:.0f} s, OP ±{a1:.1f} to ±{a2:.1f} %"
        agrees = (
            p2 > 1.1 * p1 and abs(a2 / a1 - 1) < 0.1
            if name == "fig_11_24"
            else abs(p2 / p1 - 1) < 0.02
        )
        yield Row("Sect. 11.8.1", what, printed, ours, bool(agrees))


def _travel() -> Iterator[Row]:
    travel = travel_test(FIGURES.load("fig_11_26").loop())
    why = (
        "the record is not published; our valve has S = 3 %, J = 1.1 %: in steps of 0.2 % the"
        " procedure as printed (same direction) measures the slip jump J; reversed steps measure"
        f" the whole band S ({travel.S:.1f} %)"
    )
    yield Row(
        "Fig. 11.26",
        "stiction by the travel test (%)",
        "1.2",
        f"{travel.J:.1f}, on a simulated valve",
        None,
        why,
    )


def _nonlinearity_first() -> Row:
    figure = FIGURES.load("fig_11_9")
    seen = 0
    for _, Td_over_T, S_over_2J in figure.PANELS:
        cycle = sustained_cycle(figure.loop(Td_over_T, S_over_2J), periods=20)
        pv = cycle["PV - SP"].to_numpy()
        noise = NOISE * pv.std() * np.random.default_rng(0).standard_normal(pv.size)
        record = LoopRecord(
            op=cycle["OP (%)"], pv=pv + noise, sp=0 * pv, Ts=figure.Ts, process="self-regulating"
        )
        seen += judge(record, ["bicoherence"])[0].verdict == STICTION
    count = len(figure.PANELS)
    why = (
        "a symmetric cycle has odd harmonics only, and the bicoherence sees quadratic coupling; the"
        " procedure here does not stop where no nonlinearity is seen"
    )
    quantity = "sticky loops of Fig. 11.9 that the bicoherence calls nonlinear"
    return Row(
        "Sects. 11.7, 11.9", quantity, f"all {count}", f"{seen} of {count}", seen == count, why
    )
