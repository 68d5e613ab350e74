"""Modes are read from the words and numbers of control systems; what is not understood is neither
automatic nor manual.
"""

import pytest

from simbench.detectors.records.mode import mode


@pytest.mark.parametrize(
    ("cells", "modes"),
    [
        (
            ["AUTO", "man", "Cas", "RCAS", "Hand", "Automatik", "自动", "手动"],
            "AUTO MAN CAS CAS MAN AUTO AUTO MAN",
        ),
        ([0, 1, 2], "MAN AUTO CAS"),
        (["16", "8.0", "4"], "MAN AUTO CAS"),
        (["AUT", "IMAN", "P-AUTO"], "AUTO MAN AUTO"),
        (["TRUE", "FALSE"], "AUTO MAN"),
    ],
)
def test_words_and_numbers_of_control_systems_are_understood(cells, modes):
    assert mode(cells).tolist() == modes.split()
