from pathlib import Path

import pytest

from detectors.contract.detector import Contract
from simbench.contract import check_file


@pytest.fixture
def contract_of(tmp_path):
    """A function from a plug-in's text to its contract."""

    def check(text: str, name: str = "own.py") -> Contract:
        path: Path = tmp_path / name
        path.write_text(text)
        return check_file(path)

    return check
