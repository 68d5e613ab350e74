"""The block of what no law describes is where most of the evidence lies, and nobody's where there
is none.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from simbench.gap.discover.blocks import located
from simbench.gap.intake.check import check
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.valve_map import lagged
from simbench.gap.situation import load_memory
from simbench.loop.effects import EFFECTS
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

BASELINE = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 900},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[100 * k, 50 + 2 * (-1) ** k] for k in range(1, 9)]},
}
LOAD = {"type": "coloured", "amplitude": 0.3, "period": 30.0}
HIDDEN: dict[str, dict[str, Any]] = {
    "nothing": {},
    "noise": {"noise": {"std": 0.3}},
    "period": {"disturbance": [LOAD, {"type": "sine", "amplitude": 2.0, "period": 47.0}]},
    "another plant": {"plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 9.0}},
}


@cache
def fitted(hidden: str) -> tuple[Any, Any]:
    loop = Loop.from_table({**BASELINE, "disturbance": [LOAD], **HIDDEN[hidden]})
    situation = check(simulate(loop, 5).record, Loop.from_table(BASELINE))
    return situation, Engine(situation.data, load_memory(situation)).base()


def assessed(hidden: str = "nothing", mv_unexplained: bool = False, **gains: float) -> Any:
    situation, base = fitted(hidden)
    every = dict.fromkeys(EFFECTS, -4.0) | gains
    return SimpleNamespace(
        log_likelihood_gains=every, situation=situation, base=base, mv_unexplained=mv_unexplained
    )


def test_a_block_counts_by_its_best_explanation_and_has_the_share_of_its_nats():
    place = located(
        assessed(gain_mismatch=14.0, deadband=30.0), [("process", 14.0), ("process", 13.0)]
    )
    assert place.block == "valve"
    assert place.shares["valve"] / place.shares["process"] == pytest.approx(36.0 / 20.0)
    assert sum(place.shares.values()) == pytest.approx(1.0)
    assert place.nearest == {"process": "gain_mismatch", "valve": "deadband"}
    assert "deadband explains most" in place.words
    assert (
        located(assessed(gain_mismatch=14.0, deadband=30.0), [("process", 60.0)]).block == "process"
    )


def test_within_the_noise_and_where_several_share_the_evidence_no_block_is_certain():
    place = located(assessed(), [("process", -1.0)])
    assert place.nearest == {}
    assert place.doubt == place.words == "no explanation stands out of the noise (best -1.0 nats)"
    several = located(assessed(gain_mismatch=14.0, deadband=13.9, outliers=13.8))
    evidence = f"process has {several.shares['process']:.2f}, valve {several.shares['valve']:.2f}"
    assert several.doubt == several.words == f"cannot tell the block: of the evidence {evidence}"


def test_what_single_samples_or_mv_show_outranks_every_likelihood():
    assert located(assessed(gain_mismatch=90.0), certain="sensor").block == "sensor"
    shown = located(assessed(mv_unexplained=True, gain_mismatch=90.0))
    assert (shown.block, shown.shares["valve"], shown.doubt) == ("valve", 1.0, "")


@pytest.mark.parametrize(
    ("hidden", "block"),
    [("noise", "sensor"), ("period", "disturbance"), ("another plant", "process")],
)
def test_a_block_whose_effects_are_not_known_counts_by_what_it_does_freely(hidden, block):
    place = located(assessed(hidden))
    assert place.block == block
    assert place.shares[block] > 0.5


@pytest.mark.parametrize(
    ("slow", "height", "block"), [(0.0, 2.5, "sensor"), (20.0, 12.0, "disturbance")]
)
def test_sudden_events_are_the_sensor_s_where_pv_jumps_and_the_load_s_where_it_follows(
    slow, height, block
):
    situation, base = fitted("nothing")
    at = np.arange(situation.record.n)
    events = sum(
        height * side * (at >= k)
        for k, side in ((150, 1), (260, -1), (420, 1), (555, -1), (700, 1))
    )
    data = replace(situation.data, y=situation.data.y + (lagged(events, slow) if slow else events))
    base = Engine(data, load_memory(situation)).base()
    changed = replace(situation, data=data)
    every = dict.fromkeys(EFFECTS, -4.0)
    assert (
        located(
            SimpleNamespace(
                log_likelihood_gains=every, situation=changed, base=base, mv_unexplained=False
            )
        ).block
        == block
    )
