"""The order of methods from home to home: the same one correlates, the reverse does not."""

import numpy as np
import pytest

from results.studies import transfer
from results.studies.transfer import LENGTH, Home, order

QUALITY = {"he": 0.95, "horch": 0.8, "ellipse": 0.65, "stenman": 0.5}


def home(seed: int, quality: dict[str, float] = QUALITY, n: int = 120) -> Home:
    """Return loops on which every method is right with another probability, and whose first feature
    is the label with noise.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(n):
        sticky = bool(k % 2)
        verdicts = {m: int(sticky) if rng.random() < q else -1 for m, q in quality.items()}
        shape = np.sign(np.sin(np.arange(LENGTH) / 5)) if sticky else np.sin(np.arange(LENGTH) / 5)
        noise = rng.normal(0, 0.2, (2, LENGTH))
        about = {
            "features": [sticky + rng.normal(0, 0.1), rng.normal()],
            "trace": (shape + noise).tolist(),
        }
        rows.append({"sticky": sticky, "group": k, "said": verdicts, **about})
    return Home(rows)


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    monkeypatch.setattr(transfer, "DRAWS", 50)


def test_the_same_order_correlates_and_the_reverse_does_not():
    same, turned = home(1), home(2, dict(zip(QUALITY, reversed(QUALITY.values()), strict=True)))
    correlations = {
        (r["first"], r["second"]): r
        for r in order({"a": home(0), "b": same, "c": turned}, list(QUALITY))
    }
    assert correlations["a", "b"]["spearman"] == pytest.approx(1.0)
    assert correlations["a", "c"]["spearman"] == pytest.approx(-1.0)
    assert correlations["a", "b"]["lo"] > 0.5
    assert correlations["a", "a"]["spearman"] > 0.7
