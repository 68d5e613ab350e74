"""The block of what no law describes is where most of the evidence lies, and nobody's where there is none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from simbench.gap.discover.blocks import located
from simbench.loop.effects import EFFECTS

WHITE = np.random.default_rng(3).standard_normal(3000)


def assessed(residual=WHITE, failures=(), **gains) -> Any:
    every = dict.fromkeys(EFFECTS, -4.0) | gains
    return SimpleNamespace(log_likelihood_gains=every, failures=failures, base=SimpleNamespace(residual=residual))


def test_evidence_of_known_effects_and_of_laws_adds_up_by_block():
    found = located(assessed(gain_mismatch=14.0, deadband=15.0), [("process", 14.0), ("process", 13.0)])
    assert found.block == "process"
    assert 0.5 < found.share < 0.9
    assert found.nearest == {"process": "gain_mismatch", "valve": "deadband"}
    assert "gain mismatch explains most" in found.words


def test_within_the_noise_no_block_is_told():
    found = located(assessed())
    assert found.block == ""
    assert "noise" in found.words
    split = located(assessed(gain_mismatch=9.0, deadband=9.0, noise=9.0))
    assert split.block == ""
    assert "none carries half" in split.words


def test_what_single_samples_show_outranks_every_likelihood():
    assert located(assessed(gain_mismatch=90.0), certain="sensor").block == "sensor"
    assert located(assessed(gain_mismatch=90.0, failures=[(10.0, "controller", "said")])).block == "controller"


@pytest.mark.parametrize(("lasts", "block"), [(0.0, "sensor"), (0.7, "disturbance")])
def test_rare_large_innovations_are_a_sensor_s_unless_they_last(lasts, block):
    rng = np.random.default_rng(1)
    hits = np.where(rng.random(3000) < 0.03, 9.0 * rng.standard_normal(3000), 0.0)
    hits[1:] += lasts * hits[:-1]
    assert located(assessed(WHITE + hits)).block == block
