"""Rows on models and theory: describing function, wave shapes, Tables 11.2 and 11.3."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from results.studies.chapter.row import Row, Source
from simbench.detectors.signal.half_cycles import split
from simbench.figures._folder import FIGURES
from simbench.scenarios.spec import Loop
from simbench.theory.describing import first_harmonic, stiction
from simbench.theory.predict import predict

# PI whose lead keeps the Nyquist curve away from -1/N, and which cycles all the same
SLOW = {
    "plant": {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 0.4, "Ti": 20.0},
    "valve": {"model": "choudhury", "S": 5.0, "J": 3.0},
    "sampling": {"Ts": 0.1},
}


def rows(isdb: Source) -> Iterator[Row]:
    """Yield the rows of sections 11.2 and 11.3; `isdb` is not used."""
    yield from _describing()
    yield from _waves()
    yield from _table_11_2()
    yield from _table_11_3()


def _describing() -> Iterator[Row]:
    cases = [
        (S, J, A)
        for S in (1.0, 5.0, 10.0)
        for J in (0.0, 0.4 * S, S, 1.5 * S)
        for A in (0.6 * S, S, 3 * S)
    ]
    worst = 0.0
    for S, J, A in cases:
        # 4000 samples per period: what is left is the sampling of the jump
        measured = first_harmonic("choudhury", {"S": S, "J": J}, A, samples=4000)[0]
        worst = max(worst, float(abs(measured - stiction(S, J).N(np.asarray(A)))))
    why = (
        "the extraction lost the leading minus and several signs and fractions; the restored form"
        f" meets the first harmonic of the simulated valve within {worst:.0e} in {len(cases)} cases"
    )
    yield Row(
        "Eqs 11.1, 11.2",
        "describing function N(A)",
        "formula",
        "formula, signs restored",
        worst < 1e-3,
        why,
    )
    d = FIGURES.load("fig_11_8").data()
    for panel, part in d[d.curve == "L"].groupby("panel", sort=False):
        z = (part["Re"] + 1j * part["Im"]).to_numpy()
        cut = np.flatnonzero((z.imag[:-1] < 0) & (z.imag[1:] >= 0))[0]
        at = float(np.interp(0, z.imag[cut : cut + 2], z.real[cut : cut + 2]))
        yield Row(
            "Fig. 11.8",
            f"{panel}: L(jw) cuts the real axis at",
            "between -1 and 0",
            f"{at:.2f}",
            -1 < at < 0,
        )
    dead = d[(d.curve == "intersection") & (d["J (%)"] == 0)]["panel"].tolist()
    yield Row(
        "Fig. 11.8",
        "dead-band limit cycle",
        "integrating only",
        ", ".join(dead),
        dead == ["(b) integrating"],
    )
    prediction = predict(Loop.from_table(SLOW))
    why = (
        "PI with Ti > T + Td leads enough at low frequency to stay in the fourth quadrant: with K"
        " = 2, T = 10, Td = 2, Kc = 0.4, Ti = 20, S = 5, J = 3 the curves do not meet, yet a cycle"
        f" of {prediction['exact']['period']:.0f} s exists"
    )
    what = "the curve of a self-regulating PI loop with J > 0 meets -1/N"
    meets = bool(prediction["describing_function"])
    yield Row("Sect. 11.3.3", what, "guaranteed", "always" if meets else "not always", meets, why)


def _waves() -> Iterator[Row]:
    d = FIGURES.load("fig_11_9").data()
    cycles = [c for _, c in d.groupby(["panel", "Td_over_T", "S_over_2J"], sort=False)]
    for panel, part, ratio in (("a", cycles[:3], "Td/T"), ("b", cycles[3:], "S/2J")):
        waves = [_best_wave(c, "PV - SP") for c in part]
        good = [name for name, _ in waves] == ["square", "sine", "triangle"]
        ours = ", ".join(f"{name} ({alike:.3f})" for name, alike in waves)
        why = (
            "best of three half-cycle waves, mean correlation in brackets; the chapter's own ratios"
            " are not printed"
        )
        yield Row(
            f"Fig. 11.9{panel}",
            f"PV with falling {ratio}",
            "square to triangle, close to a sine",
            ours,
            good,
            why,
        )
    waves = [_best_wave(c, "OP (%)") for c in cycles]
    good = all(name == "triangle" for name, _ in waves)
    least = min(alike for _, alike in waves)
    yield Row(
        "Fig. 11.9",
        "OP",
        "always triangular",
        f"triangle in all {len(waves)}",
        good,
        f"least correlation {least:.3f}",
    )
    even = max(_even_over_odd(c["OP (%)"].to_numpy()) for c in cycles)
    why = (
        "the cycle of a loop without bias is symmetric; 'usually asymmetric, with even and odd"
        " harmonics' (same page) needs a bias or a bent valve characteristic, which simulated loops"
        " have only where asked for"
    )
    yield Row(
        "Sect. 11.3.4",
        "even over odd harmonic power of OP",
        "odd only",
        f"at most {even:.4f}",
        even < 0.01,
        why,
    )


def _best_wave(cycle: pd.DataFrame, column: str) -> tuple[str, float]:
    x = cycle[column].to_numpy()
    humps = split(x - x.mean(), cycle["period (s)"].iloc[0] / cycle["t (s)"].iloc[1])
    t = (np.arange(humps.shape[1]) + 0.5) / humps.shape[1]
    shapes = {
        "square": np.ones(t.size),
        "sine": np.sin(np.pi * t),
        "triangle": 1 - np.abs(2 * t - 1),
    }
    length = np.linalg.norm(humps, axis=1)
    alike = {
        name: float(np.mean(humps @ shape / length) / np.linalg.norm(shape))
        for name, shape in shapes.items()
    }
    best = max(alike, key=alike.__getitem__)
    return best, alike[best]


def _even_over_odd(x: np.ndarray) -> float:
    power = np.abs(np.fft.rfft(x - x.mean())) ** 2  # three periods: harmonic k is in bin 3 k
    return float(power[6:60:6].sum() / power[3:60:6].sum())


def _table_11_2() -> Iterator[Row]:
    d = FIGURES.load("table_11_2").data()
    for (process, action, signal), part in d.groupby(["process", "action", "signal"], sort=False):
        share, shape = float(part.agreement.iloc[0]), str(part.table.iloc[0])
        where = f"{process}{f', {action} action' if action else ''}: {signal}"
        why = (
            f"share of {part.cycles.iloc[0]} simulated cycles with this label by dynamic time"
            " warping"
        )
        if shape == "parabolic":
            why += (
                "; there is no such label, a sine counts; the printed order of this cell is lost,"
                " by physics PV is the triangle"
            )
        yield Row("Table 11.2", where, shape, f"{share:.0%}", share > 0.5, why)


def _table_11_3() -> Iterator[Row]:
    notes = {
        (
            "self-regulating",
            "P",
            "stick-slip",
        ): "exists if and only if K Kc J > S, which the table leaves out",
        ("self-regulating", "PI", "dead-band"): "only where Kc is near its limit and Ti at most T",
    }
    for row in FIGURES.load("table_11_3").data().to_dict("records"):
        cell = (row["process"], row["controller"], row["nonlinearity"])
        share = row["cycled"] / row["simulated"]
        agrees = share == 0 if row["table"].startswith("no") else share > 0.9
        why = notes.get(
            cell, "the others were not excited far enough by six starts" if 0 < share < 1 else ""
        )
        yield Row(
            "Table 11.3",
            ", ".join(cell),
            row["table"],
            f"{row['cycled']} of {row['simulated']} cycle",
            agrees,
            why,
        )
