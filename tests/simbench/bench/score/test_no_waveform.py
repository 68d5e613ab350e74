"""What a record tells without its waveform, and the classifier that knows nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.bench.score.no_waveform import (
    EXTREMES,
    FEATURES,
    features_without_waveform,
    no_waveform,
)
from simbench.detectors.record import LoopRecord

NAMES = (*FEATURES, *EXTREMES)


def features(op, pv, period_s=40.0, **more):
    return dict(
        zip(
            NAMES,
            features_without_waveform(LoopRecord(op=op, pv=pv, Ts=2.0, **more), period_s),
            strict=True,
        )
    )


def wave(shape, n=2000):
    phase = np.arange(n) / 20.0 + 0.13
    x = np.sin(2 * np.pi * phase) if shape == "sine" else 4 * np.abs(phase % 1 - 0.5) - 1
    return x / x.std()


def test_features_are_what_they_are_called():
    rng = np.random.default_rng(0)
    sp = np.r_[np.full(1000, 10.0), np.full(1000, 13.0)]
    pv = 10 + 0.5 * wave("sine") + 0.05 * rng.standard_normal(2000)
    values = features(50 + 2 * wave("sine"), pv, sp=sp, process="integrating")
    wanted = {
        "samples_per_period": 20,
        "periods": 100,
        "n": 2000,
        "Ts": 2,
        "integrating": 1,
        "sp_steps": 1,
        "op_std": 2,
        "op_mean": 50,
        "op_first": 50 + 2 * wave("sine")[0],
        "op_begin": 1,
        "op_end": 1,
        "op_repeats": 0,
    }
    assert {name: values[name] for name in wanted} == pytest.approx(wanted, rel=1e-6)
    assert values["pv_noise"] == pytest.approx(0.1, rel=0.05)
    assert values["sp_span"] == pytest.approx(6.0, rel=0.02)
    assert values["error_mean"] == pytest.approx(3.0, rel=0.02)
    assert values["op_trend"] < 1e-9
    assert values["op_max"] - values["op_min"] == pytest.approx(4 * 2**0.5, rel=0.01)


def test_the_classifier_learns_from_other_groups_and_only_about_loops_that_oscillate(book):
    rng = np.random.default_rng(2)
    truth = rng.integers(0, 2, 600)
    run = book(truth, truth)
    # what is the same within a group tells nothing of another group
    groups = np.arange(600) // 3
    label_of_group = rng.integers(0, 2, 200)[groups]
    alike = replace(run, groups=groups, design=rng.normal(size=(600, len(NAMES))))
    alike.truth["cycled"][:] = label_of_group
    alike.design[:, 0] = rng.permutation(200)[groups]
    chance, _, asked = no_waveform(alike)
    assert asked.all()
    assert np.mean((chance > 0.5) == label_of_group) < 0.65
    leaking = replace(run, design=alike.design.copy(), oscillating=np.arange(600) < 400)
    leaking.truth["cycled"][:] = truth
    leaking.design[:, 3] = truth + rng.normal(0, 0.1, 600)
    chance, verdict, _ = no_waveform(leaking)
    assert np.mean(verdict[:400] == truth[:400]) > 0.95
    assert np.isneginf(chance[400:]).all()
    assert not verdict[400:].any()
    # extremes stay out of it
    leaking.design[:, 3] = rng.normal(size=600)
    leaking.design[:, len(FEATURES)] = truth
    assert np.mean(no_waveform(leaking)[1][:400] == truth[:400]) < 0.62
