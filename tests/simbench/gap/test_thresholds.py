"""Every threshold of an answer is stated in one place, and printed with its unit and its source."""

import copy
import json
import pickle

from typer.testing import CliRunner

from simbench.cli import app
from simbench.gap.thresholds import THRESHOLDS, AnswerThreshold


def test_all_thresholds_are_listed_with_their_unit_and_their_source():
    shown = CliRunner().invoke(app, ["list", "thresholds", "--json"])
    rows = {row["name"]: row for row in json.loads(shown.output)}
    assert rows.keys() == THRESHOLDS.keys()
    assert all(x.unit and x.says and x.source for x in THRESHOLDS.values())
    assert rows["CLAIMED_FROM"]["says"].startswith("0.8 probability")
    assert rows["DENIED_BELOW"]["says"].startswith("0.2 probability")


def test_a_threshold_is_a_number_like_any_other():
    one = AnswerThreshold(0.5, "-", "what it decides", "where it is from")
    assert one == 0.5
    assert one * 2 == 1.0
    assert f"{one:.2f}" == "0.50"
    assert type(copy.copy(one)) is type(pickle.loads(pickle.dumps(one))) is float
