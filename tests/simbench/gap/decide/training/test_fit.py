"""How the probabilities are learned: the plan covers everything, the set can be resumed, the trees learn a rule and doubt."""

import json
from collections import Counter

import numpy as np
import pytest
from joblib import parallel_config

from simbench.gap.decide import classify as classify
from simbench.gap.decide.training import fit as training
from simbench.gap.decide.training import make as making
from simbench.gap.decide.training.foreign import FOREIGN
from simbench.gap.decide.training.make import MIX, example, load, make, plan
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN, block_of

WHOLE = [plan(i) for i in range(len(MIX) * 22)]


def kind(effects, foreign):
    return "foreign" if foreign else ("none", "single", "two")[len(effects)]


def test_every_twenty_cases_hold_the_mix():
    for first in range(0, len(WHOLE), len(MIX)):
        assert tuple(kind(*p) for p in WHOLE[first : first + len(MIX)]) == MIX


def test_the_plan_covers_all_effects_and_foreign_kinds_evenly():
    single = Counter(effects[0] for effects, foreign in WHOLE if len(effects) == 1)
    alien = Counter(foreign for _, foreign in WHOLE if foreign)
    assert set(single) == set(EFFECTS)
    assert set(alien) == set(FOREIGN)
    for count in (single, alien):
        assert max(count.values()) - min(count.values()) <= 1


def test_two_effects_are_of_different_blocks_and_many_pairs():
    pairs = {effects for effects, _ in WHOLE if len(effects) == 2}
    assert all(block_of(a) != block_of(b) for a, b in pairs)
    assert len(pairs) > 35


def numbered(index, seed=0):
    return None if index == 3 else {"index": index, "seed": seed}


def test_a_set_can_be_resumed(tmp_path, monkeypatch):
    monkeypatch.setattr(making, "example", numbered)
    monkeypatch.setattr(making, "PIECE", 4)
    assert make(tmp_path, 10, seed=7) == 3
    assert [e["index"] for e in load(tmp_path)] == [0, 1, 2, 4, 5, 6, 7, 8, 9]  # 3 was refused
    assert {e["seed"] for e in load(tmp_path)} == {7}
    first, second, _ = sorted(tmp_path.glob("*.jsonl"))
    first.write_text('{"index": -1}\n')
    second.unlink()
    (tmp_path / ".00001.tmp").write_text("half a li")  # what a killed run leaves
    assert make(tmp_path, 10) == 1
    assert [e["index"] for e in load(tmp_path)] == [-1, 4, 5, 6, 7, 8, 9]
    assert make(tmp_path, 10) == 0


def test_one_and_two_jobs_give_the_same_bits(tmp_path, monkeypatch):
    monkeypatch.setattr(making, "PIECE", 1)
    make(tmp_path / "one", 3)
    with parallel_config("threading"):  # other processes would not know the smaller pieces
        make(tmp_path / "two", 3, jobs=2)
    one, two = ({p.name: p.read_text() for p in (tmp_path / f).glob("*.jsonl")} for f in ("one", "two"))
    assert one == two
    found = load(tmp_path / "one")
    assert [e["effects"] for e in found] == [[e] for e in list(EFFECTS)[:3]]
    for e in found:
        assert set(e["evidence"]) == {"record", *EFFECTS}
        assert all(np.isfinite(v) for row in e["evidence"].values() for v in row.values())


def test_an_example_says_what_is_true():
    found = example(MIX.index("foreign"))
    assert found is not None
    assert (found["foreign"], found["effects"]) == (next(iter(FOREIGN)), [])
    assert found["block"] == FOREIGN[found["foreign"]].block
    assert training.truth(found) == (UNKNOWN,)
    assert training.truth({"foreign": "", "effects": []}) == (NONE,)
    assert training.truth({"foreign": "", "effects": ["noise", "drift"]}) == ("noise", "drift")
    assert json.loads(json.dumps(found)) == found


def synthetic(n, lies, seed=0):
    """Return examples in which the right effect has the gain, `odd` marks the unknown, and a share of single labels lies."""
    rng = np.random.default_rng(seed)
    out = []
    for i in range(n):
        effects, foreign = plan(i)
        rows = {name: {"gain": float(rng.normal()), "vuong": float(rng.normal())} for name in EFFECTS}
        rows["record"] = {"n": float(rng.normal()), "odd": float(rng.normal() + (4.0 if foreign else 0.0))}
        for effect in effects:
            rows[effect]["gain"] += 9.0
        if len(effects) == 1 and rng.random() < lies:
            effects = (list(EFFECTS)[int(rng.integers(len(EFFECTS)))],)
        out.append({"effects": list(effects), "foreign": foreign, "strength": "medium", "evidence": rows})
    return out


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("learned")
    (folder / "00000.jsonl").write_text("".join(json.dumps(e) + "\n" for e in synthetic(600, lies=0.3)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "ROUNDS", {"known": 60, "unknown": 40})
        assert training.main([str(folder), "-o", str(folder / "out")]) == 0
        patch.setattr(classify, "LEARNED", folder / "out")
        classify._models.cache_clear()
        yield json.loads((folder / "out" / "calibration.json").read_text())
    classify._models.cache_clear()


def test_trees_learn_the_rule(learned):
    fresh = synthetic(400, lies=0.0, seed=1)
    p = classify.probabilities([e["evidence"] for e in fresh])
    said = [training.ANSWERS[i] for i in p.argmax(axis=1)]
    right = np.array([a in training.truth(e) for a, e in zip(said, fresh)])
    for what in ("single", "none", "two", "foreign"):
        assert right[[kind(e["effects"], e["foreign"]) == what for e in fresh]].mean() > 0.9, what
    assert learned["effect"] == ["gain", "vuong"]
    assert learned["record"] == ["n", "odd"]


def test_probabilities_are_as_sure_as_the_labels_are_true(learned):
    fresh = synthetic(2000, lies=0.3, seed=2)
    single = [e for e in fresh if len(e["effects"]) == 1]
    p = classify.probabilities([e["evidence"] for e in single])
    said = [training.ANSWERS[i] for i in p.argmax(axis=1)]
    right = np.mean([a in training.truth(e) for a, e in zip(said, single)])
    assert 0.65 < right < 0.8
    assert p.max(axis=1).mean() == pytest.approx(right, abs=0.06)
    assert learned["found"]["foreign: called unknown"] > 0.85


def test_listwise_gradient_is_that_of_the_softmaxs_cross_entropy():
    rng = np.random.default_rng(0)
    Y = np.eye(5)[rng.integers(0, 5, 6)]
    Y[0, :2] = 1.0  # two right answers share their weight
    scores, h = 2 * rng.standard_normal(30), 1e-5

    def loss(s):
        z = s.reshape(6, 5)
        return -float(np.sum(Y / Y.sum(axis=1, keepdims=True) * (z - np.log(np.exp(z).sum(axis=1, keepdims=True)))))

    gradient, curvature = training.listwise(Y)(scores, None)
    for i in range(30):
        step = h * np.eye(30)[i]
        up, down = loss(scores + step), loss(scores - step)
        assert gradient[i] == pytest.approx((up - down) / (2 * h), abs=1e-8)
        bend = (loss(scores + 100 * step) - 2 * loss(scores) + loss(scores - 100 * step)) / (100 * h) ** 2
        assert curvature[i] == pytest.approx(max(bend, 1e-3), rel=1e-3, abs=1e-5)
