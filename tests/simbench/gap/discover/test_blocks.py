"""The block of what no law describes is where most of the evidence lies, and nobody's where there is none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from simbench.gap.discover.blocks import located
from simbench.gap.likelihood import kernels
from simbench.loop.effects import EFFECTS

WHITE = np.random.default_rng(3).standard_normal(3000)


def assessed(residual=WHITE, failures=(), noise=0.9, **gains) -> Any:
    every, left = dict.fromkeys(EFFECTS, -4.0) | gains, residual[kernels.SKIP :]
    # the likelihood of innovations of standard deviation 1
    loglik = -0.5 * (left @ left + left.size * np.log(2.0 * np.pi))
    base = SimpleNamespace(residual=residual, loglik=loglik, theta={"load_time": 5.0, "noise_std": noise})
    return SimpleNamespace(log_likelihood_gains=every, failures=failures, base=base)


def test_a_block_stands_by_its_best_explanation_however_many_were_tried():
    found = located(assessed(gain_mismatch=14.0, deadband=15.0), [("process", 14.0), ("process", 13.0)])
    assert found.block == "valve"
    assert 0.5 < found.share < 0.65
    assert found.nearest == {"process": "gain_mismatch", "valve": "deadband"}
    assert "deadband explains most" in found.words
    assert located(assessed(gain_mismatch=14.0, deadband=15.0), [("process", 17.0)]).block == "process"


def test_within_the_noise_and_without_half_of_the_evidence_no_block_can_be_told():
    found = located(assessed(), [("process", -1.0)])
    assert found.nearest == {}
    assert found.doubt == found.words == "no explanation stands out of the noise (best -1.0 nats)"
    assert not located(assessed(gain_mismatch=4.0)).doubt
    several = located(assessed(gain_mismatch=14.0, deadband=13.9, outliers=13.8))
    assert several.share < 0.5
    said = f"cannot tell the block: none carries half of the evidence (process {several.share:.2f})"
    assert several.doubt == several.words == said


def test_what_single_samples_show_outranks_every_likelihood():
    assert located(assessed(gain_mismatch=90.0), certain="sensor").block == "sensor"
    assert located(assessed(gain_mismatch=90.0, failures=[(10.0, "controller", "said")])).block == "controller"


# behind much noise a spike is hardly taken back and a shock lasts, behind little it is taken back and a shock is over at once
@pytest.mark.parametrize(("noise", "lasts", "block"), [
    (0.9, 0.0, "sensor"), (0.9, 0.7, "disturbance"), (0.1, -0.8, "sensor"), (0.1, 0.0, "disturbance"),
])  # fmt: skip
def test_rare_large_innovations_are_the_reading_s_or_the_load_s_by_what_the_next_one_keeps(noise, lasts, block):
    rng = np.random.default_rng(1)
    hits = np.where(rng.random(3000) < 0.03, 9.0 * rng.standard_normal(3000), 0.0)
    hits[1:] += lasts * hits[:-1]
    assert located(assessed(WHITE + hits, noise=noise)).block == block
