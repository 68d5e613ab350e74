"""The order of methods from home to home, and yardsticks trained on one and judged on the
others.
"""

import numpy as np
import pytest

from results.studies import transfer
from results.studies.transfer import LENGTH, Home, kept, methods, order, slow

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


def test_the_interval_of_a_correlation_holds_its_value_and_narrows_with_more_loops():
    def width(n):
        homes = {"a": home(1, n=n), "b": home(2, n=n)}
        row = next(row for row in order(homes, list(QUALITY)) if row["first"] != row["second"])
        assert -1.0 < row["lo"] <= row["spearman"] <= row["hi"] <= 1.0
        return row["hi"] - row["lo"]

    assert width(800) <= width(60)


def test_slow_methods_are_asked_about_the_first_loops_alone(tmp_path, monkeypatch):
    assert "likelihood" in slow(methods())
    assert not {"he", "horch", "procedure"} & set(slow(methods()))
    asked = []

    def answer(name, number, names):
        asked.append((name, number, tuple(names)))
        about = {
            "sticky": number % 2 == 1,
            "group": number,
            "features": [0.0],
            "trace": np.zeros((2, LENGTH)).tolist(),
        }
        return {**about, "said": dict.fromkeys(names, number % 2)}

    monkeypatch.setattr(transfer, "asked", answer)
    homes = kept(tmp_path / "kept", 6, 2, tmp_path / "no real records")
    dear = tuple(slow(methods()))
    assert sum(names == dear for *_, names in asked) == 2 * len(homes)
    chapter = homes["chapter"]
    assert np.isnan(chapter.costs["likelihood"]).sum() == 4
    assert not np.isnan(chapter.costs["he"]).any()
    assert chapter.mean(["likelihood", "he"]).tolist() == [0.0, 0.0]
    asked.clear()
    kept(tmp_path / "kept", 6, 2, tmp_path / "no real records")
    assert not asked
