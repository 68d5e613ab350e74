"""What a diagnosis weighs, as plain numbers without units: one row for the record, one for each effect that could be fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from detectors.errors import RecordError
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import Assessment, uncapped
from simbench.gap.effects import recogniser
from simbench.gap.effects._size import LoopSize
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import LOAD_MEMORY, load_memory
from simbench.loop.effects import EFFECTS, block_of

Row = dict[str, float]


TRIED = 2  # strongest effects whose loops are closed and simulated


def evidence(found: Assessment, runs: ClosedLoops | None = None, effects: Sequence[str] | None = None) -> dict[str, Row]:
    """Return the numbers on which the probabilities of an answer rest.

    Parameters
    ----------
    found : Assessment
    runs : ClosedLoops, optional
        Simulated loops of this assessment, to be shared with a report.
    effects : sequence of str, optional
        That are weighed against each other; all when absent.

    Returns
    -------
    dict of str to dict of str to float
        Key "record" holds what concerns every answer, an effect id what speaks for that effect. A number that does not apply
        is missing. Scaling PV, OP's offset or the sampling period changes nothing.
    """
    weighed = list(EFFECTS) if effects is None else effects
    gains = {e: squashed(g) for e, g in found.log_likelihood_gains.items() if e in weighed}
    rows = {"record": _record(found, gains)}
    loop = LoopSize(found.situation)
    for effect in weighed:
        rows[effect] = _effect(effect, found, gains, loop)
    runs = runs or ClosedLoops(found, 0)
    rows["record"] |= _closed([], runs, "gap")
    strongest = sorted(gains, key=lambda e: -gains[e])[:TRIED]
    for effect in strongest:
        if effect in found.parameters and gains[effect] > 0.0:
            rows[effect] |= _closed([effect], runs, "gap")
    if found.chosen:
        rows["record"] |= _closed(found.chosen, runs, "all chosen")
    return rows


def _closed(effects: list[str], runs: ClosedLoops, name: str) -> Row:
    """Return how far whole simulated loops are from the record, over what chance gives: before, and with some effects in."""
    try:
        gap = runs.shrink(effects)
    except RecordError:
        return {}
    floor = max(gap.floor, 1e-3)
    return {f"{name} before": float(np.log(gap.before / floor)), f"{name} after": float(np.log(gap.after / floor))}


def squashed(nats: float) -> float:
    """Return sign(x) log(1 + |x|): hundreds of nats are not ten times the certainty of tens."""
    return float(np.sign(nats) * np.log1p(abs(nats)))


def _record(found: Assessment, gains: dict[str, float]) -> Row:
    s, base = found.situation, found.base
    d, law = s.data, s.law
    ordered = sorted(gains.values(), reverse=True)
    steps = np.diff(s.sp)
    row = {
        "n": float(np.log(d.n)),
        "mv": float(s.record.mv is not None),
        "integrating": float(s.integrating),
        "proportional": float(s.baseline.controller.Ti is None),
        "play": float(s.baseline.valve.name != "ideal"),
        "sp moves": float(np.log1p(np.count_nonzero(steps))),
        "sp size": float(np.ptp(s.sp) / (np.std(d.y) + d.floor)),
        "op size": float(np.log(np.std(s.op) + 1e-6)),
        "dead time": d.Td / (_pace(found)),
        "pace": float(np.log(_pace(found))),
        "best": ordered[0],
        "second best": ordered[1],
        "third best": ordered[2],
        "law residual": float(np.log10(law.residual + 1e-6)),
        "law of baseline": float(np.log10(law.baseline_residual + 1e-6)),
        "law known": float(law.known),
        "law foreign": float(bool(law.foreign)),
        "law strays": float(law.strays.size / d.n),
        "strange law": float(bool(s.unexplained_law)),
        "frozen": float(s.frozen),
        "held": float(np.log(s.samples.held)),
        "straight": s.samples.straight,
        "strange valve": float(found.mv_unexplained),
        "hard": float(len(s.proven)),
        **_load(base, found),
    }
    row |= {f"left {name}": squashed(value) for name, value in found.tests.items()}
    return row


def _pace(found: Assessment) -> float:
    return load_memory(found.situation) / LOAD_MEMORY


def _load(fit: Fit, found: Assessment) -> Row:
    """Return how a fit's load and noise compare with what a loop usually has."""
    th, d = fit.theta, found.situation.data
    return {
        "load memory": float(np.log((th["load_time"] + th.get("load_lag", 0.0)) / _pace(found))),
        "load smooth": th.get("load_lag", 0.0) / th["load_time"],
        "load pink": float(fit.spec.pink),
        "load size": float(np.log(th["load"] / th["noise_std"])),
        "noise level": float(np.log(th["noise_std"] / d.noise)) if d.noise > 0 else 0.0,
        "colour": th["colour"],
        "gain used": float(np.log(max(fit.K / d.K, 1e-3))),
        "T used": float(np.log(th["T"] / d.T)) if d.T > 0 else 0.0,
        "Td used": (th["Td"] - d.Td) / _pace(found),
    }


def _effect(effect: str, found: Assessment, gains: dict[str, float], loop: LoopSize) -> Row:
    s, mine = found.situation, gains[effect]
    block = block_of(effect)
    rivals = [uncapped(found.log_likelihood_gains[e]) for e in gains if e != effect and block_of(e) == block]
    row = {
        "gain": mine,
        "nats ahead in block": squashed(uncapped(found.log_likelihood_gains[effect]) - max(rivals)),
        "hard": float(effect in s.proven),
        "lead": mine - max(g for e, g in gains.items() if e != effect),
        "lead in block": mine - max((g for e, g in gains.items() if e != effect and block_of(e) == block), default=-3.0),
        "lead outside": mine - max(g for e, g in gains.items() if block_of(e) != block),
        "chosen": float(1 + found.chosen.index(effect)) if effect in found.chosen else 0.0,
    }
    if effect in found.log_likelihood_gains_on_top:
        row["as second"] = squashed(found.log_likelihood_gains_on_top[effect])
    if effect in found.parameters:
        row |= recogniser(effect).size(found.parameters[effect], loop)
    if effect in found.candidates and found.candidates[effect].used:
        fit = found.candidates[effect].fit
        row |= _load(fit, found) | steadiness(found.base, fit)
    return row


def steadiness(base: Fit, fit: Fit) -> Row:
    """Return how evenly over the record a fit is better: Vuong's (1989) statistic, and the share won in the poorer half."""
    won = 0.5 * (np.asarray(base.residual) ** 2 - np.asarray(fit.residual) ** 2)[kernels.SKIP :]
    # both fits pay for their variance evenly
    won = won + (fit.loglik - base.loglik - float(won.sum())) / won.size
    parts = np.array([p.sum() for p in np.array_split(won, 40)])
    total = float(won.sum())
    half = min(float(won[: won.size // 2].sum()), float(won[won.size // 2 :].sum()))
    top = float(np.sort(parts)[-4:].sum())
    return {
        "vuong": total / (float(np.std(parts)) * np.sqrt(parts.size) + 1e-3),
        "poorer half": squashed(half),
        "best tenth": squashed(total - top),
    }
