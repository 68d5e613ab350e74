"""The load of a law follows from the simulated loop."""

from dataclasses import replace

import pytest

from simbench.gap.closed_loop.gap import held_out
from simbench.gap.discover.effect_file import lent_effect
from simbench.gap.discover.moments import matched
from simbench.gap.discover.search import search
from simbench.gap.intake.check import check
from simbench.gap.law import FoundLaw
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

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


def test_a_load_of_the_wrong_size_is_brought_back(seen):
    s, finding = seen
    twice = replace(
        finding.fit, theta=finding.fit.theta | {"load": 2.5 * finding.fit.theta["load"]}
    )
    with lent_effect(RETUNED) as name:
        fit = matched(s, twice, twice, RETUNED, name, 0)
    assert fit.theta["load"] == pytest.approx(finding.fit.theta["load"], rel=0.4)
