"""Load and uncertain numbers follow from the simulated loop; what single samples show stays as it
is.
"""

from dataclasses import replace

import pytest

from scenarios.spec import Loop
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.discover import moments
from simbench.gap.discover.moments import matched
from simbench.gap.discover.search import Finding, search
from simbench.gap.intake.check import check
from simbench.gap.law import FoundLaw
from simbench.loop.simulate import simulate

BASELINE = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.2, "T": 10.0, "Td": 2.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0},
        "sampling": {"Ts": 1.0, "n": 900},
        "noise": {"std": 0.1},
    }
)
LOAD = [{"type": "coloured", "amplitude": 1.0, "period": 15.0}]
RETUNED = FoundLaw("tuning", {"gain": 1.6, "integral": 1.5}, 100.0)


@pytest.fixture(scope="module")
def seen():
    real = (
        Loop.from_table(BASELINE.to_table() | {"disturbance": LOAD})
        .with_("controller.Kc", 1.6)
        .with_("controller.Ti", 15.0)
    )
    s = check(simulate(real, 3).record, BASELINE)
    return s, search(s, held_out(s))


def test_a_finding_without_a_law_stays_as_it_is(seen):
    s, finding = seen
    assert matched(s, finding._replace(law=None), 0).fit is finding.fit


def test_a_load_of_the_wrong_size_is_brought_back_and_exact_numbers_stay(seen):
    s, finding = seen
    twice = replace(
        finding.fit, theta=finding.fit.theta | {"load": 2.5 * finding.fit.theta["load"]}
    )
    law = replace(finding.law or RETUNED, form="tuning", numbers=RETUNED.numbers)
    again = matched(s, Finding(law, twice, twice), 0)
    assert again.law is not None
    assert again.law.numbers == RETUNED.numbers
    assert again.fit.theta["load"] == pytest.approx(finding.fit.theta["load"], rel=0.4)


def test_numbers_of_a_likelihood_move_only_where_the_loop_is_plainly_nearer(monkeypatch):
    monkeypatch.setattr(moments, "_TRIALS", 12)
    s = check(
        simulate(Loop.from_table(BASELINE.to_table() | {"disturbance": LOAD}), 3).record, BASELINE
    )
    finding = search(s, held_out(s))
    near, far = ({"gain": gain} for gain in (1.0001, 2.5))
    moved = [
        matched(
            s, Finding(FoundLaw("size", numbers, 10.0), finding.null, replace(finding.null)), 0
        ).law.numbers["gain"]
        for numbers in (near, far)
    ]
    assert moved[0] == near["gain"]
    assert moved[1] != far["gain"]
