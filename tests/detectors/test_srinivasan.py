"""Shape recognition: time warping against its plain twin, each shape by its name, and the table of
pairs.
"""

import numpy as np
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.methods.srinivasan import (
    CYCLE_POINTS,
    SHAPES,
    cycles,
    label_shares,
    templates,
)
from simbench.detectors.record import LoopRecord

T = np.arange(3000) / 40  # cycles


def wave(shape, shift=0.0):
    t = (T + shift) % 1.0
    if shape == "square":
        return np.where(t < 0.5, 1.0, -1.0)
    if shape == "triangle":
        return np.interp(t, [0, 0.25, 0.75, 1], [0, 1, -1, 0])
    if shape == "sawtooth":
        return np.interp(t, [0, 0.03, 0.97, 1], [0, 1, -1, 0])
    return np.sin(2 * np.pi * t)


def naive_dtw(a, b, window):
    n = len(a)
    cost = np.full((n + 1, n + 1), np.inf)
    cost[0, 0] = 0.0
    for i in range(n):
        for j in range(max(0, i - window + 1), min(n, i + window)):
            least = min(cost[i, j], cost[i, j + 1], cost[i + 1, j])
            cost[i + 1, j + 1] = (a[i] - b[j]) ** 2 + least
    return np.sqrt(cost[n, n])


def test_labels_are_those_of_plain_time_warping():
    rng = np.random.default_rng(0)
    pieces = np.vstack(
        [cycles(wave(s) + 0.15 * rng.standard_normal(T.size), 40.0)[:6] for s in SHAPES]
    )
    shapes, label = templates()
    slow = [label[np.argmin([naive_dtw(c, s, CYCLE_POINTS // 10) for s in shapes])] for c in pieces]
    assert np.array_equal(label_shares(pieces), np.bincount(slow, minlength=4) / len(slow))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_each_shape_is_known_by_its_name(shape, turn):
    x = turn * wave(shape) + 0.05 * np.random.default_rng(1).standard_normal(T.size)
    shares = label_shares(cycles(x, 40.0))
    assert SHAPES[int(np.argmax(shares))] == shape
    assert shares.max() > 0.8


@pytest.mark.parametrize(
    ("process", "op", "pv", "expected"),
    [
        ("self-regulating", "triangle", "square", "stiction"),
        ("self-regulating", "sine", "sine", "no_stiction"),
        ("self-regulating", "triangle", "triangle", "no_decision"),
        ("integrating", "triangle", "triangle", "stiction"),
    ],
)
def test_pair_of_shapes_decides(process, op, pv, expected):
    rng = np.random.default_rng(2)
    op, pv = (
        wave(s, shift) + 0.02 * rng.standard_normal(T.size) for s, shift in ((op, 0.0), (pv, 0.3))
    )
    verdict = judge(LoopRecord(50 + op, pv, 1.0, process=process), ["srinivasan"])[0]
    assert verdict.verdict == expected, verdict


@pytest.mark.parametrize(
    ("kind", "expected"), [("temperature", "stiction"), ("flow", "no_decision"), (None, "stiction")]
)
def test_as_published_a_known_kind_of_loop_has_its_column_of_the_table(kind, expected):
    rng = np.random.default_rng(2)
    op, pv = (
        wave(s, shift) + 0.02 * rng.standard_normal(T.size)
        for s, shift in (("triangle", 0.0), ("sine", 0.3))
    )
    record = LoopRecord(50 + op, pv, 1.0, process="self-regulating", kind=kind)
    assert judge(record, ["srinivasan@published"])[0].verdict == expected
    assert judge(record, ["srinivasan"])[0].verdict == "stiction"
