"""The order of methods from home to home, and yardsticks trained on one and judged on the
others.
"""

import numpy as np
import pytest

from detectors.example_loop import example_loop
from results.studies import transfer
from results.studies.transfer import (
    LEARNED,
    LENGTH,
    Home,
    agreement,
    convolved,
    draw,
    features,
    kept,
    methods,
    order,
    reliability,
    slow,
    table,
    trace,
)

QUALITY = {"he": 0.95, "horch": 0.8, "ellipse": 0.65, "stenman": 0.5}


def home(seed: int, quality: dict[str, float] = QUALITY, n: int = 120) -> Home:
    """Return loops on which every method is right with its own probability, and whose first feature
    tells the label.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(n):
        sticky = bool(k % 2)
        said = {m: int(sticky) if rng.random() < q else -1 for m, q in quality.items()}
        shape = np.sign(np.sin(np.arange(LENGTH) / 5)) if sticky else np.sin(np.arange(LENGTH) / 5)
        noise = rng.normal(0, 0.2, (2, LENGTH))
        about = {
            "features": [sticky + rng.normal(0, 0.1), rng.normal()],
            "trace": (shape + noise).tolist(),
        }
        rows.append({"sticky": sticky, "group": k, "said": said, **about})
    return Home(rows)


def test_the_same_order_correlates_and_the_reverse_does_not():
    same, turned = home(1), home(2, dict(zip(QUALITY, reversed(QUALITY.values()), strict=True)))
    found = {
        (r["first"], r["second"]): r
        for r in order({"a": home(0), "b": same, "c": turned}, list(QUALITY))
    }
    assert found["a", "b"]["spearman"] == pytest.approx(1.0)
    assert found["a", "c"]["spearman"] == pytest.approx(-1.0)
    assert found["a", "b"]["lo"] > 0.5
    assert found["a", "a"]["spearman"] > 0.7


def test_costs_count_no_decision_as_half_an_error_and_both_labels_the_same():
    one = home(0)
    one.costs["he"] = np.where(one.sticky, 0.5, 1.0)
    assert one.mean(["he"])[0] == pytest.approx(0.75)


def test_yardsticks_learn_at_home_and_are_judged_by_folds_there():
    homes = {"a": home(0), "b": home(1)}
    for name in LEARNED:
        homes["a"].learn(name, homes, "a")
        assert homes["a"].mean([f"{name}, a"])[0] < 0.1
        assert homes["b"].mean([f"{name}, a"])[0] < 0.1
    chance = home(3)
    chance.sticky = np.random.default_rng(0).permutation(chance.sticky)
    chance.learn("boosting", {"c": chance}, "c")
    assert chance.mean(["boosting, c"])[0] > 0.35
    lines = table(homes, list(QUALITY))
    assert any(line.startswith("boosting, a") and "*" in line for line in lines)


def test_features_and_traces_do_not_change_with_units():
    record = example_loop(n=800)
    scaled = type(record)(3.0 * record.op + 1.0, 0.2 * record.pv - 4.0, record.Ts)
    plain = type(record)(record.op, record.pv, record.Ts)
    assert features(scaled) == pytest.approx(features(plain), rel=1e-6, abs=1e-6)
    assert np.allclose(trace(scaled), trace(plain), atol=2e-4)
    assert np.shape(trace(plain)) == (2, LENGTH)


def test_convolutions_are_shares_of_time():
    found = convolved(np.random.default_rng(0).normal(size=(3, 2, LENGTH)))
    assert found.shape == (3, 84 * 5 * 3 * 3)
    assert ((found >= 0) & (found <= 1)).all()


def test_the_likelihood_is_ranked_and_what_sees_mv_is_not():
    assert "likelihood" in methods()
    assert not {"kano_a", "yamashita", "bicoherence"} & set(methods())


def test_the_picture_and_its_numbers_are_written(tmp_path):
    homes = {"a": home(0), "b": home(1)}
    draw(list(order(homes, list(QUALITY))), homes, list(QUALITY), tmp_path / "transfer.svg")
    assert {f.name for f in tmp_path.iterdir()} == {"transfer.svg", "transfer.csv"}


def test_twice_the_loops_agree_as_spearman_and_brown_say():
    rng = np.random.default_rng(0)
    quality = rng.normal(size=200)

    def measured(loops):
        return quality + rng.normal(0, 4.0 / np.sqrt(loops), 200)

    halves = np.mean([np.corrcoef(measured(50), measured(50))[0, 1] for _ in range(200)])
    whole, loops = reliability(float(halves), 100)
    assert whole == pytest.approx(
        np.mean([np.corrcoef(measured(100), measured(100))[0, 1] for _ in range(200)]), abs=0.02
    )
    assert 0.9 == pytest.approx(
        np.mean([np.corrcoef(measured(loops), measured(loops))[0, 1] for _ in range(200)]), abs=0.02
    )
    assert np.isnan(reliability(-0.1, 100)).all()
    lines = agreement(list(order({"a": home(0), "b": home(1)}, list(QUALITY))))
    assert sum(line.startswith(("a ", "b ")) for line in lines) == 3


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
