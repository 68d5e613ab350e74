"""Rates over two axes as text, JSON and CSV."""

import json

import numpy as np
import pandas as pd
import pytest

from simbench.bench.score.page import draw_maps
from simbench.bench.score.scoring import score_run
from simbench.cli import main
from simbench.detectors.errors import ParameterError


@pytest.fixture(scope="module")
def counted(finished):
    """Return scores, and the verdicts of one method beside the axes."""
    scenarios, verdicts = (
        pd.read_parquet(finished / f"{t}.parquet") for t in ("scenarios", "verdicts")
    )
    he = verdicts[verdicts.method == "he"].merge(scenarios, on="scenario_id")
    return score_run(finished), he[he.cycled.isin(["yes", "no"])]


def test_two_axes_as_text_json_and_csv(finished, tmp_path, capsys):
    command = ["score", str(finished), "--by", "disturbance", "--by", "tuning"]
    assert main([*command, "--to", str(tmp_path / "two.csv")]) == 0
    said = capsys.readouterr().out
    assert "disturbance down and tuning across" in said
    assert "rank  method" not in said
    two = pd.read_csv(tmp_path / "two.csv")
    assert {"disturbance", "tuning", "accuracy", "accuracy_lo", "n"} <= set(two)
    assert main([*command, "--json"]) == 0
    by = json.loads(capsys.readouterr().out)["by"]
    assert by["axis"] == ["disturbance", "tuning"]
    assert len(by["rows"]) == len(two)


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        (["disturbance", "tunin"], "did you mean 'tuning'"),
        (["disturbance", "disturbance"], "two different"),
        (["disturbance", "tuning", "noise_ratio"], "two different"),
        ([], "one axis"),
    ],
)
def test_other_axes_are_refused_in_one_sentence(counted, axes, words):
    with pytest.raises(ParameterError, match=words):
        counted[0].along(axes)


def test_cells_of_few_loops_are_marked_with_their_number():
    cells = {"S_over_2J": ["0.5", "0.5"], "Td_over_T": ["0.1", "0.5"]}
    rates = pd.DataFrame({"method": "m0", **cells, "accuracy": 1.0, "n": [8, 32]})
    figure = draw_maps(rates, "Td_over_T")
    first = figure.axes[0]
    shown = [text.get_text() for text in first.texts]
    assert shown == ["1.00\n8", "1.00\n32"]
    (mesh,) = first.collections
    pale, full = np.ravel(mesh.get_alpha())
    assert pale < full == 1.0
