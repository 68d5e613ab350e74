"""Section of the report: the run in a few numbers, and the score table."""

import math

import pandas as pd

from simbench.bench.score.names import ALL, NO_WAVEFORM, OF_NOT_OSCILLATING, OF_OSCILLATING
from simbench.bench.score.show.picture import sides
from simbench.bench.score.show.table import NO_REFERENCES
from simbench.page.document import Part, Pictures, Table, Text, Tiles, percent, texts
from simbench.report.data import RunData

TITLE = "Summary"
_SAYS = (
    "The first table ranks the detectors on the loops that oscillate. Cost is the mean loss: a"
    " wrong answer costs 1, no decision 0.5, a right answer 0. Accuracy is the share of right"
    " answers; no decision counts as not right. Sensitivity is the share of the cycling loops"
    " called stiction, false positives the share of the other loops. Applies: share of the loops"
    " that the publication of the method covers; the other columns count these loops only. Small"
    " figures are 95 % intervals.",
    "Rank 1: no method costs less by a difference that these loops resolve between the two. Rank"
    " 2: only methods of rank 1 do, and so on. Methods that need the valve position (MV) are ranked"
    " among themselves. A method that answers fewer than nine tenths of the loops has no rank; one"
    " of your own is then ranked on the loops that it answers. Reference rows are no detectors: the"
    " oracle answers the label, and no_waveform is a classifier that sees period, amplitude and"
    " noise, but no waveform. A useful detector costs less than no_waveform. Each column can be"
    " sorted.",
)
_HEADLINE = {
    "cost": "cost",
    "accuracy": "accuracy",
    "sensitivity": "sensitivity",
    "false positives": "false_positives",
    "no decision": "no_decision",
}
_DETAILS = {
    "accuracy of decided": "accuracy_decided",
    "sensitivity at 5 % false positives": "sensitivity_at_5",
    "AUC": "auc",
}
_SHARES = (*_HEADLINE, *_DETAILS, "accuracy, not applicable counted as wrong", "applies")
_FORMATS = dict.fromkeys(_SHARES, "{:.2f}".format) | {"rank": "{:.0f}".format}
_USES = {
    "stiction": "detector",
    "nonlinearity": "nonlinearity test",
    "yardstick": "reference",
    "oracle": "reference",
}


def section(run: RunData) -> list[Part]:
    """Draw what each method is right on, then give all scores, size, balance, the best detector
    with its interval, failures, and what the columns mean.
    """
    book = run.book
    cycle = book.truth["cycled"][book.truth["cycled"] >= 0] == 1
    tiles = [
        (f"{book.ids.size}", "scenarios"),
        (
            percent(float(cycle.mean())) if cycle.size else "-",
            f"of the {cycle.size} scenarios with a clear label: the valve makes the loop cycle",
        ),
        (f"{len(book.methods)}", "detectors"),
    ]
    ranking = run.scores.rows()
    fair = ranking[ranking["rank"].notna() & ~ranking["partial"] & ~ranking["sees_mv"]]
    if len(fair):
        best = fair.iloc[0]
        limits = f"{percent(best['accuracy_lo'])} to {percent(best['accuracy_hi'])}"
        tiles.append(
            (
                percent(best["accuracy"]),
                f"accuracy of {best['method']}, the first method without MV ({limits})",
            )
        )
    if not math.isnan(run.scores.resolution):
        tiles.append(
            (f"{run.scores.resolution:.2f}", "smallest difference of cost that this run resolves")
        )
    tiles.append((str(len(run.errors)), "failures"))
    places: list[tuple[str, tuple[str, str, str]]] = [
        (
            "Oscillating loops; label: the valve makes the loop cycle (cycled)",
            ("cycled", ALL, OF_OSCILLATING),
        ),
        (
            "Oscillating loops; label: Table 11.3 predicts a cycle (predicted)",
            ("predicted", ALL, OF_OSCILLATING),
        ),
        ("Oscillating self-regulating loops", ("cycled", "self-regulating", OF_OSCILLATING)),
        ("Oscillating integrating loops", ("cycled", "integrating", OF_OSCILLATING)),
        (
            "Loops that do not oscillate",
            ("cycled", ALL, OF_NOT_OSCILLATING),
        ),
        ("All loops", ("cycled", ALL, ALL)),
    ]
    parts: list[Part] = []
    if len(ranking):
        caption = "Of the loops that the valve makes cycle and of the others: right, open, wrong"
        parts.append(Pictures([(sides(ranking).figure, caption)], wide=True))
    for title, place in places:
        rows = run.scores.rows(*place)
        # methods that are not ranked with each other stand under a heading of their own
        for group, some in rows.groupby("group", sort=False):
            words = str(group)
            told = f"{words[0].upper()}{words[1:]}" if words else title
            parts += [Text(told, "heading"), _readable(some, place)]
        if place == places[0][1]:
            parts.append(Tiles(tiles))
    lacking = [] if NO_WAVEFORM in set(ranking["method"]) else [NO_REFERENCES]
    return [*parts, Text("What the columns mean", "heading"), *texts([*_SAYS, *lacking])]


def _readable(ranking: pd.DataFrame, place: tuple[str, str, str]) -> Table:
    """Return one row per detector with the columns a reader compares."""
    # a rank on a part of the loops says so
    named = [
        f"{r.method} (ranked on the {r.rank_loops} loops that it answers)"
        if r.partial and not math.isnan(r.rank)
        else r.method
        for r in ranking.itertuples()
    ]
    table = pd.DataFrame({"rank": ranking["rank"].astype(float), "detector": named})
    beside = {}
    everything = place[-1] == ALL
    for name, column in {**_HEADLINE, **(_DETAILS if everything else {})}.items():
        table[name] = ranking[column]
        beside[name] = [
            "" if pd.isna(value) else f"{lo:.2f}-{hi:.2f}"
            for value, lo, hi in zip(
                ranking[column], ranking[f"{column}_lo"], ranking[f"{column}_hi"]
            )
        ]
    if everything:
        table["accuracy, not applicable counted as wrong"] = ranking["accuracy_all"]
        table["median (ms)"] = ranking["median_ms"]
    table["applies"] = ranking["applicable"] / ranking["n"]
    table["use"] = [
        f"{_USES.get(role, role)}{', with MV' if mv else ''}"
        for role, mv in zip(ranking["role"], ranking["sees_mv"])
    ]
    table["fitted"] = (
        ranking["home"]
        .map({"fitted here": "on this grid", "siblings": "on loops like these"})
        .fillna("")
    )
    return Table(table, _FORMATS, beside=beside)
