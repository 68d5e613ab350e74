"""The table of names: every word of it is recognised as what its row says."""

import pytest

from simbench.detectors.records.dialects import words
from simbench.detectors.records.roles import is_quality, is_time, parse


@pytest.mark.parametrize("role", ["pv", "op", "sp", "mv", "mode"])
def test_every_word_for_a_signal_is_that_signal_of_the_loop_before_it(role):
    for word in words(role):
        name = parse(f"FIC101.{word}")
        assert (name.role, name.loop, name.word) == (role, ("fic101",), word)


def test_every_word_for_a_time_or_a_quality_is_one():
    assert all(map(is_time, words("time")))
    assert all(map(is_quality, words("quality")))
