"""A second answer of the same detector about the same record is the same answer."""

from dataclasses import replace

import numpy as np
from bench_fixtures import SMALL

from simbench.bench.execute.again import check_and_ask_again
from simbench.bench.execute.run import run_grid
from simbench.detectors.methods import he
from simbench.scenarios.grid import make_grid


def test_a_detector_that_answers_otherwise_the_second_time_is_reported(tmp_path, monkeypatch):
    rng, honest = np.random.default_rng(0), he.detect

    def moody(prepared, **thresholds):
        verdict = honest(prepared, **thresholds)
        return replace(verdict, score=verdict.score + (rng.random() < 0.1))

    monkeypatch.setattr(he, "detect", moody)
    run = run_grid(make_grid(SMALL, "small"), tmp_path / "run", ["he", "horch"])
    problems = check_and_ask_again(run, run).problems
    assert len(problems) == 1
    assert problems[0].startswith("method he differs from itself on ")


def test_an_honest_detector_is_the_same_twice(finished):
    assert check_and_ask_again(finished, finished).answer == "passed"
