"""A grid small enough to run in a second, one finished run of it, and runs made up in memory."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.bench.execute.run import run_grid
from simbench.bench.store.reading import RunArrays
from simbench.bench.store.tables import WORD_COLUMNS
from simbench.scenarios.grid import make_grid

SMALL = {
    "title": "small",
    "seed": 3,
    "disturbances": {"sine": {"type": "sine", "amplitude": [0.7, 2.0], "period": [0.4, 2.5]}},
    "draw": {
        "K": [0.5, 2],
        "T": [5, 50],
        "S": [2, 5],
        "samples_per_period": [20, 40],
        "periods": [18, 25],
        "step": 0.8,
    },
    "block": [
        {
            "name": "a",
            "axes": {
                "Td_over_T": [0.3, 1.0],
                "S_over_2J": [0.5],
                "noise_ratio": [0.1],
                "disturbance": ["none", "sine"],
            },
            "member": [
                {"name": "sticky", "valve": "choudhury"},
                {"name": "healthy", "valve": "ideal"},
            ],
        },
        {
            "name": "b",
            "process": "integrating",
            "axes": {
                "Td_over_Ti": [0.05],
                "S_over_2J": [0.5, 2.0],
                "noise_ratio": [0.1],
                "disturbance": ["none", "sine"],
            },
            "member": [
                {"name": "sticky", "valve": "choudhury"},
                {"name": "healthy", "valve": "ideal"},
            ],
        },
    ],
}


@pytest.fixture
def small():
    return make_grid(SMALL, "small", {"repeats": 2})


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """One run of the small grid with two methods, never to be changed."""
    return run_grid(
        make_grid(SMALL, "small", {"repeats": 2}),
        tmp_path_factory.mktemp("runs") / "done",
        ["he", "yamashita"],
    )


def raise_after(patch, owner, name, calls, error):
    """Let a function raise an error from the call after so many."""
    function, left = getattr(owner, name), iter(range(calls))

    def limited(*given):
        if next(left, None) is None:
            raise error
        return function(*given)

    patch.setattr(owner, name, limited)


def make_book(verdict, truth, score=None, methods=None, ids=None, hashes=None, **more):
    """Return a run: verdict (m, n) of 0, 1, 2; truth (n,) of 1, 0, -1.

    `more` may hold digests, axes, grid and grid_hash.
    """
    toy = {"digests": None, "axes": None, "grid": "toy", "grid_hash": "g"}
    assert set(more) <= set(toy), f"{set(more) - set(toy)}"
    digests, axes, grid, grid_hash = (toy | more).values()
    verdict = np.atleast_2d(np.asarray(verdict, dtype=np.int8))
    m, n = verdict.shape
    methods = tuple(methods or (f"m{i}" for i in range(m)))
    ids = np.array([f"{i:016d}" for i in range(n)] if ids is None else ids, dtype="S16")
    truth = np.asarray(truth, dtype=np.int8)
    words = {w: np.full(n, "w") for w in WORD_COLUMNS}
    empty = {
        a: np.full(n, np.nan)
        for a in (
            "Td_over_T",
            "Td_over_Ti",
            "S_over_2J",
            "cell_S_over_2J",
            "noise_ratio",
            "samples_per_period",
            "cut",
            "ranked",
        )
    }
    score = (
        verdict.astype(np.float32)
        if score is None
        else np.atleast_2d(np.asarray(score, dtype=np.float32))
    )
    about = {"front_end": True, "needs_mv": False, "role": "stiction", "budget": "fast"}
    return RunArrays(
        manifest={
            "grid": grid,
            "grid_hash": grid_hash,
            "methods": dict.fromkeys(methods, about),
            "benchmark": {
                "name": f"{grid}-1",
                "hash": "h",
                "parts": {"scenarios": "s", "evaluator": "e"},
            },
        },
        ids=ids,
        hashes=ids if hashes is None else np.asarray(hashes, dtype="S16"),
        digests=ids if digests is None else np.asarray(digests, dtype="S16"),
        axes={**words, **empty, **(axes or {})},
        truth={
            **dict.fromkeys(("sticky", "predicted", "cycled"), truth),
            "cycled_word": np.array(["unclear", "no", "yes"])[truth + 1],
        },
        oscillating=np.ones(n, dtype=bool),
        groups=np.arange(n),
        design=np.ones((n, 6)),
        methods=methods,
        verdict=verdict,
        score=score,
        applicable=np.ones((m, n), dtype=np.int8),
        failed=np.zeros((m, n), dtype=bool),
        runtime=np.zeros((m, n), dtype=np.float32),
    )


def change_answers(run, method, verdict, score=None):
    """Return the run with other answers of one method."""
    i = run.methods.index(method)
    verdicts, scores = run.verdict.copy(), run.score.copy()
    verdicts[i] = verdict
    scores[i] = verdict if score is None else score
    return replace(run, verdict=verdicts, score=scores)


def answer_noisily(rng, truth, accuracy, methods=3):
    """Return verdicts (methods, n) right with a probability, and scores that agree with them."""
    right = rng.random((methods, truth.size)) < accuracy
    verdict = np.where(right, truth == 1, truth == 0).astype(np.int8)
    return verdict, verdict + rng.normal(0, 0.4, verdict.shape)


@pytest.fixture
def book():
    return make_book


@pytest.fixture
def with_answers():
    return change_answers


@pytest.fixture
def noisy():
    return answer_noisily


# a detector in a file of its own, whose source is a publication
NEVER = '''"""Always says no: a plug-in."""
from simbench.detectors.method import Method
from simbench.detectors.verdict import NO_STICTION, Verdict

METHOD = Method(title="never", source="A. Nobody (2020), Journal of Nothing 1, 2-3",
                process=("self-regulating", "integrating"))


def detect(prepared):
    """Say no."""
    return Verdict("never", NO_STICTION, 0.0, reason="always")
'''

BROKEN = '''"""A detector that fails on every third record."""
from simbench.detectors.method import Method
from simbench.detectors.verdict import Verdict

METHOD = Method(title="fails", source="a test")


def detect(prepared):
    """Raise, or say no."""
    if prepared.record.n % 3 == 0:
        raise ZeroDivisionError("on purpose <b>bold</b>")
    return Verdict("broken", "no_stiction", score=0.0, reason="never <i>sure</i>")
'''
