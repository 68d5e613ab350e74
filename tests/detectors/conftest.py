"""What tests of detectors share: the plain control loop and the real records."""

from pathlib import Path

import pytest

from simbench.detectors.example_loop import example_loop

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "real"


@pytest.fixture(scope="session")
def loop():
    """The plain control loop as a function."""
    return example_loop


@pytest.fixture(scope="session")
def real_folder():
    """Folder of the real records; tests on them are skipped where it is absent."""
    if not REAL.is_dir():
        pytest.skip(f"real records are not here ({REAL})")
    return REAL
