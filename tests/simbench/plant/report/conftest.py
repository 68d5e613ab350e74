"""A survey with two methods in place of eighteen."""

import pytest

from simbench.plant.report import fleet
from simbench.plant.trust.trust import trust


@pytest.fixture(scope="session")
def trust_once():
    """Judge a record once with one method, whichever file holds it."""
    known = {}

    def ask(record, **more):
        key = record.op.tobytes(), record.pv.tobytes(), record.process
        if key not in known:
            known[key] = trust(record, **more | {"methods": ["he"]})
        return known[key]

    return ask


@pytest.fixture
def two_methods(monkeypatch, trust_once):
    monkeypatch.setattr(fleet, "choose_methods", lambda names: ["he", "procedure"])
    monkeypatch.setattr(fleet, "trust", trust_once)
