"""The study that lets labelled cycles go on without noise."""

import pytest

from results.studies import truth_again
from results.studies.truth_again import goes_on
from simbench.scenarios.spec import Loop


@pytest.mark.parametrize("sticks", [True, False])
def test_only_a_sticky_loop_goes_on_when_the_noise_ends(sticks):
    loop = Loop.from_table(
        {
            "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
            "controller": {"type": "PI", "Kc": 1, "Ti": 10},
            "valve": {"model": "choudhury", "S": 5, "J": 2} if sticks else {"model": "ideal"},
            "noise": {"std": 0.05},
            "setpoint": {"value": 50.0, "steps": [[50, 53.0]]},
            "sampling": {"Ts": 1, "n": 500},
        }
    )
    assert goes_on(loop, 1, 60.0) is sticks


def test_every_loop_that_is_counted_is_another_one(monkeypatch, capsys):
    seen = []
    monkeypatch.setattr(truth_again, "goes_on", lambda loop, seed, period: not seen.append(seed))
    truth_again.main(["ci", "--loops", "120", "--seed", "5"])
    assert len(set(seen)) == len(seen) == 120
    assert "120 of 120 cycling loops go on" in capsys.readouterr().out
