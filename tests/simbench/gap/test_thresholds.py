"""Every threshold of an answer is stated in one place, and printed with its unit and its source."""

import ast
import copy
import json
import pickle
from pathlib import Path

import pytest
from typer.testing import CliRunner

import simbench.gap
from simbench.cli import app
from simbench.gap.thresholds import THRESHOLDS, AnswerThreshold

GAP = Path(simbench.gap.__file__).parent
# where an answer follows from evidence
DECIDING = ("stiction/probability.py", "stiction/causes.py", "stiction/conclusion.py", "decide")


def numbers_of(path: Path) -> list[str]:
    """Return the module's own numeric constants."""
    out = []
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign) and isinstance(node.value, (ast.Constant, ast.Tuple)):
            values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
            if all(isinstance(getattr(v, "value", None), (int, float)) for v in values):
                out.append(ast.unparse(node.targets[0]))
    return out


def test_all_thresholds_are_listed_with_their_unit_and_their_source():
    shown = CliRunner().invoke(app, ["list", "thresholds", "--json"])
    rows = {row["name"]: row for row in json.loads(shown.output)}
    assert rows.keys() == THRESHOLDS.keys()
    assert all(x.unit and x.says and x.source for x in THRESHOLDS.values())
    assert rows["CLAIMED_FROM"]["says"].startswith("0.8 probability")
    assert rows["DENIED_BELOW"]["says"].startswith("0.2 probability")


@pytest.mark.parametrize("where", DECIDING)
def test_no_module_that_decides_has_a_threshold_of_its_own(where):
    files = sorted((GAP / where).glob("*.py")) if (GAP / where).is_dir() else [GAP / where]
    # of what MV's digits tell, and of a search
    own = {"_RUNS", "_EARLY", "_DIGITS", "_LEFT", "_LEFT_OF_OP", "_STEPS", "_NORMAL", "_SMALLEST"}
    assert {n for f in files for n in numbers_of(f)} <= own


def test_a_threshold_is_a_number_like_any_other():
    one = AnswerThreshold(0.5, "-", "what it decides", "where it is from")
    assert one == 0.5
    assert one * 2 == 1.0
    assert f"{one:.2f}" == "0.50"
    assert type(copy.copy(one)) is type(pickle.loads(pickle.dumps(one))) is float
