"""Each loop of a diagnosis is run once: before, recalibrated and with the effects, all under one
load.
"""

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


def test_of_no_effect_the_loop_as_given_is_the_last_where_it_is_the_nearer(made):
    loops, seen = made
    seen.first = 0.5
    assert loops.shrink([]).number == 2
    assert seen.compared[1] == ((*BARE, "base"), (*TUNED, "base"), (*BARE, "base"), 7)
    seen.compared.clear()
    loops.shrink(["stiction"])
    assert len(seen.compared) == 1


def test_effects_share_the_fit_in_which_they_were_chosen_or_the_first_ones(made):
    loops, _ = made
    assert loops.loop(["stiction", "gain_mismatch"])[0] == "both"
    assert loops.loop(["gain_mismatch", "stiction"])[0] == "both"
    # what the engine does not see stands on the base
    assert loops.loop(["quantisation"]) == ("base", ("quantisation",), "fitted", "base")
    assert loops.loop(["quantisation", "gain_mismatch"])[0] == "slack"
    assert loops.loop(["drift"]) == ("base", (), "fitted", "base")


def test_a_rival_is_run_under_the_load_of_the_answer(made):
    loops, seen = made
    assert loops.rival(["gain_mismatch"], ["stiction"]).number == len(seen.compared)
    assert seen.simulated[-1] == ("slack", ("gain_mismatch",), "fitted", "stuck", 0.0)
    assert seen.compared[-1] == (
        (*BARE, "stuck"),
        (*TUNED, "stuck"),
        ("slack", ("gain_mismatch",), "fitted", "stuck"),
        7,
    )


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
