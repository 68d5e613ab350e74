"""The sizes of the gap in words."""

from simbench.gap.closed_loop.gap_text import gap_sentences


def test_a_refit_that_brings_nothing_is_no_smaller_number():
    far, near = (" ".join(gap_sentences(4.35, refitted, None, 1.0)) for refitted in (4.37, 3.1))
    assert "It is 4.35 with the model as given, no less with K, T, Td refitted." in far
    assert "3.10 with K, T, Td refitted" in near
