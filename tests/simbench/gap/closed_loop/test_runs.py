"""A simulated loop that runs away is replaced by the one before it, or refused."""

from types import SimpleNamespace

import pytest

from simbench.detectors.errors import RecordError
from simbench.gap.candidates import Candidate, Fitted
from simbench.gap.closed_loop import runs
from simbench.gap.closed_loop.runs import ClosedLoops

BASE, STUCK, SLACK, BOTH = (
    SimpleNamespace(name=name) for name in ("base", "stuck", "slack", "both")
)
NUMBERS = {
    "stiction": {"S": 5.0, "J": 2.0},
    "gain_mismatch": {"factor": 2.0},
    "quantisation": {"step": 0.1, "at": "loop"},
}


@pytest.fixture
def made(monkeypatch):
    """Return the loops of a diagnosis that names stiction and a gain, and what was built, simulated
    and compared.
    """
    seen = SimpleNamespace(simulated=[], compared=[], away=set(), jumps=[], first=2.0)

    def fixed_loop(situation, fit, effects, *, plant, load, jumps):
        seen.jumps.append(jumps)
        return fit.name, tuple(effects), plant, load.name

    def simulate_runs(situation, loop, seed, kick=0.0):
        seen.simulated.append((*loop, kick))
        return None if loop in seen.away else loop

    def measure(situation, before, again, after, seed):
        seen.compared.append((before, again, after, seed))
        return SimpleNamespace(before=seen.first, recalibrated=1.0, number=len(seen.compared))

    for name, stub in (
        ("fixed_loop", fixed_loop),
        ("simulate_runs", simulate_runs),
        ("measure", measure),
    ):
        monkeypatch.setattr(runs, name, stub)
    candidates = {
        "stiction": Candidate("stiction", STUCK, 9.0),
        "gain_mismatch": Candidate("gain_mismatch", SLACK, 9.0),
    }
    return ClosedLoops(
        Fitted(None, BASE, candidates, NUMBERS, ["stiction", "gain_mismatch"], BOTH), 7
    ), seen


BARE, TUNED = ("base", (), "baseline"), ("base", (), "fitted")


def test_a_loop_that_runs_away_is_replaced_by_the_one_before_it(made):
    loops, seen = made
    seen.away |= {(*TUNED, "stuck"), ("stuck", ("stiction",), "fitted", "stuck")}
    loops.shrink(["stiction"])
    assert seen.compared == [((*BARE, "stuck"),) * 3 + (7,)]
    assert loops.rival(["stiction"], ["stiction"]) is None


def test_a_baseline_that_runs_away_is_refused(made):
    loops, seen = made
    seen.away.add((*BARE, "stuck"))
    with pytest.raises(RecordError, match="it runs away"):
        loops.shrink(["stiction"])
