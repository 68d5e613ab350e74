"""The picture of ranks shows the numbers of the comparison."""

import numpy as np
import pytest

from simbench.bench.execute.run import run_grid
from simbench.bench.score.compare import compare
from simbench.detectors.errors import UserError
from simbench.figures import make_figures
from simbench.figures.critical_difference import data, draw


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    methods = ["he", "yamashita", "rossi_scali", "ellipse", "horch", "bicoherence"]
    return run_grid("smoke", tmp_path_factory.mktemp("figure") / "run", methods, progress=False)


def test_the_numbers_are_the_comparisons(run):
    numbers, comparison = data(run), compare(run)
    # a nonlinearity test, one that sees MV, one made for self-regulating processes
    assert not {"bicoherence", "yamashita", "horch"} & set(numbers["method"])
    assert numbers["mean_rank"].is_monotonic_increasing
    assert np.allclose(2 * numbers["half_width"], comparison.critical_difference)
    assert numbers["mean_rank"].sum() == pytest.approx(1 + 2 + 3)


def test_every_method_is_drawn(run, tmp_path):
    numbers = data(run)
    names = [t.get_text() for t in draw(numbers).axes[0].get_yticklabels()]
    assert names == list(numbers["method"])
    (drawn,) = make_figures(["critical-difference"], tmp_path, run=run)
    assert [f.suffix for f in drawn.files] == [".svg", ".png", ".csv"]


def test_two_methods_make_no_ranking(tmp_path):
    folder = run_grid(
        "smoke", tmp_path / "run", ["he", "horch"], sets={"disturbance": "none"}, progress=False
    )
    with pytest.raises(UserError, match="3 stiction detectors"):
        data(folder)
