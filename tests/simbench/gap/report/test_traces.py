"""A loop that cannot be simulated is not drawn."""

from types import SimpleNamespace

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap.closed_loop import level
from simbench.gap.report.ranked import Ranked
from simbench.gap.report.view import FIXED, RECORD, compared
from simbench.scenarios.spec import Loop

X = np.arange(100.0)


def loop(K):
    return Loop.from_table(
        {
            "plant": {"type": "foptd", "K": K, "T": 20.0, "Td": 3.0},
            "controller": {"type": "PI", "Kc": 0.5, "Ti": 20.0},
            "sampling": {"Ts": 2.0, "n": 150},
            "setpoint": {"value": 50.0},
            "noise": {"std": 0.1},
        }
    )


class Loops:
    """Loops of a diagnosis by the effects in them."""

    def __init__(self):
        arms = tuple(SimpleNamespace(loop=loop(K)) for K in (1.0, 1.1, 1.2))
        self.arms = {("stiction",): arms, (): arms}

    def runs_with(self, effects):
        return self.arms[tuple(effects)]

    def kick(self, effects):
        return 5.0

    def corrected(self, effects):
        return loop(1.3)


def report(effect="stiction", named=("stiction",), n=100, mv=True, ranking=()):
    record = SimpleNamespace(op=X / 10, pv=X, mv=X + 1.0 if mv else None, Ts=2.0, n=n)
    situation = SimpleNamespace(record=record, op=X, sp=X + 2.0, pace=1)
    ranked = ranking or (Ranked("stiction", "valve", 0.9, 4.0, 1.0, {"S": 5.0, "J": 2.0}),)
    return SimpleNamespace(
        effect=effect, named=list(named), ranking=ranked, fixed_loop=lambda: loop(1.2),
        behind=SimpleNamespace(
            found=SimpleNamespace(situation=situation), loops=Loops(), shown=None
        ),
    )  # fmt: skip


def test_a_loop_that_cannot_be_simulated_or_runs_away_is_left_out(monkeypatch):
    def fails(x, seed, kick):
        if x.plant.K == 1.0:
            raise RecordError("it runs away")
        pv = np.full(9, 1e10 if x.plant.K == 1.1 else 1.0)
        return SimpleNamespace(record=LoopRecord(pv, pv, 1.0, pv))

    monkeypatch.setattr(level, "simulate", fails)
    assert list(compared(report())) == [RECORD, FIXED]
