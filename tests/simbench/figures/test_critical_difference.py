"""The picture of ranks shows the numbers of the comparison."""

import numpy as np
import pytest

from simbench.bench.execute.run import run_grid
from simbench.bench.score.scoring import score_run
from simbench.cli import main
from simbench.detectors.errors import UserError
from simbench.figures._critical_difference import draw, ranks_of


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    methods = ["he", "yamashita", "rossi_scali", "ellipse", "horch", "bicoherence"]
    return run_grid("smoke", tmp_path_factory.mktemp("figure") / "run", methods, progress=False)


def data(run):
    return ranks_of(score_run(run).compare())


def test_the_numbers_are_the_comparisons(run):
    numbers, comparison = data(run), score_run(run).compare()
    # a nonlinearity test, one that sees MV, one made for self-regulating processes
    assert not {"bicoherence", "yamashita", "horch"} & set(numbers["method"])
    assert numbers["mean_rank"].is_monotonic_increasing
    assert np.allclose(2 * numbers["half_width"], comparison.critical_difference)
    assert numbers["mean_rank"].sum() == pytest.approx(1 + 2 + 3)


def test_every_method_is_drawn(run, tmp_path):
    numbers = data(run)
    names = [t.get_text() for t in draw(numbers).axes[0].get_yticklabels()]
    assert names == list(numbers["method"])
    assert main(["score", str(run), "--paired", "--to", str(tmp_path / "cd.svg")]) == 0
    assert (tmp_path / "cd.svg").stat().st_size > 10_000


def test_two_methods_make_no_ranking(tmp_path):
    folder = run_grid(
        "smoke", tmp_path / "run", ["he", "horch"], sets={"disturbance": "none"}, progress=False
    )
    with pytest.raises(UserError, match="3 stiction detectors"):
        data(folder)
