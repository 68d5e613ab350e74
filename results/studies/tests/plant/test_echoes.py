"""The study of echoes: what a pair is, and what is counted."""

from itertools import islice

import pytest

from results.studies.plant.echoes import STICKY, Asked, as_lines, pairs
from simbench.detectors.signal.oscillation import find_oscillation


def test_a_pair_is_a_sticky_loop_and_an_echo_that_both_oscillate_and_show_no_valve():
    members = list(islice(pairs("ci", 2, 5), 4))
    assert [m.kind == STICKY for m in members] == [True, False, True, False]
    assert all(m.record.mv is None and not m.record.meta for m in members)
    assert all(find_oscillation(m.record.op, m.record.pv, m.record.Ts).sustained for m in members)


def test_a_loop_that_cannot_be_judged_has_even_odds_and_kinds_are_counted_apart():
    answers = [Asked(STICKY, 0.9), Asked(STICKY, None)]
    answers += [Asked("smooth", 0.1), Asked("harmonics", 0.95)]
    head, scored, *kinds = as_lines("ci", answers)
    assert head == "ci: 2 pairs; loops that cannot be judged, with even odds: 1"
    # of four comparisons with an echo two are right
    assert "AUC 0.500" in scored
    assert [line.split(" (")[0].strip() for line in kinds] == [
        "stiction claimed, sticky: 1 of 2",
        "stiction claimed, echo, harmonics: 1 of 1",
        "stiction claimed, echo, smooth: 0 of 1",
    ]


@pytest.mark.parametrize(("p", "error"), [((0.95, 0.05), "0.050"), ((0.05, 0.95), "0.950")])
def test_the_calibration_error_is_how_far_probabilities_are_from_what_is_true(p, error):
    lines = as_lines("ci", [Asked(STICKY, p[0]), Asked("smooth", p[1])])
    assert f"calibration error {error}" in lines[1]
