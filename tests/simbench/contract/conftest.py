from pathlib import Path

import pytest

from simbench.contract import check_file


@pytest.fixture
def contract_of(tmp_path):
    """A function from a plug-in's text to its contract."""

    def check(text: str, name: str = "mine.py"):
        path: Path = tmp_path / name
        path.write_text(text)
        return check_file(path)

    return check


@pytest.fixture
def broken_by(contract_of):
    """A function that changes a plug-in's text: a sentence of its contract must hold the words."""

    def check(text: str, old: str, new: str, words: str, name: str = "mine.py") -> None:
        assert old in text
        broken = contract_of(text.replace(old, new), name).broken
        assert any(words in sentence for sentence in broken), broken

    return check
