"""Effects left out: the library is whole again, the table counts the answers, a run goes on where
it stopped.
"""

import json

import pandas as pd
import pytest
from typer.testing import CliRunner

from simbench.blind import leave_out as module
from simbench.blind.leave_out import LEAVE_OUT_COLUMNS, leave_out, summary
from simbench.blind.world import WORLD_EFFECTS
from simbench.cli import app
from simbench.detectors.errors import ParameterError
from simbench.gap.effects import PLUGINS, left_out, recogniser
from simbench.loop.effects import EFFECTS


def row(effect, answer, block, left=1.9, resolvable=True):
    return {
        "effect": effect,
        "said": answer,
        "right": answer == "unknown",
        "block": block,
        "nearest": "noise",
        "before": 2.0,
        "left": left,
        "floor": 0.0,
        "resolvable": resolvable,
        "back": effect,
        "after": 0.5,
    }


def test_an_effect_is_back_once_the_block_has_ended_even_by_an_error():
    def fail():
        with left_out("stiction", "drift"):
            assert recogniser("stiction").fit is None
            with left_out("noise"):
                assert recogniser("noise").fit is None
            assert recogniser("noise").fit is not None
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert all(recogniser(e).fit is PLUGINS.load(e).RECOGNISER.fit for e in EFFECTS)


def test_the_table_counts_resolvable_records_and_those_that_failed():
    rows = [
        row("stiction", "unknown", "valve"),
        row("stiction", "deadband", "valve", left=1.0),
        row("drift", "none", "none"),
        row("drift", "noise", "sensor", resolvable=False),
        {"effect": "noise", "error": "PV is constant"},
    ]
    rows = [dict.fromkeys(LEAVE_OUT_COLUMNS, "") | given for given in rows]
    table = summary(pd.DataFrame(rows)).set_index("effect")
    assert list(table.index) == [*WORLD_EFFECTS, "all"]
    stiction = table.loc["stiction", ["n", "unknown", "block_right", "right", "left", "back"]]
    assert list(stiction) == pytest.approx([2, 0.5, 1.0, 0.5, 0.725, 0.25])
    assert (table.n["drift"], table.failed["noise"]) == (1, 1)
    assert table.unknown["all"] == pytest.approx(1 / 3)
    assert table.unknown_lo["all"] < 1 / 3 < table.unknown_hi["all"]


def test_leaving_out_goes_on_where_it_stopped_and_refuses_another_worlds_rows(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(module, "WORLD_EFFECTS", {"detuning": WORLD_EFFECTS["detuning"]})
    first = leave_out(tmp_path, "own", n=1, seed=10)
    monkeypatch.setattr(module, "_one", None)  # nothing is left to do
    pd.testing.assert_frame_equal(leave_out(tmp_path, "own", n=1, seed=10), first)
    (result,) = first.to_dict("records")
    names = [result[k] for k in ("said", "block", "back")]
    assert names == ["unknown", "controller", "detuning"]
    # the law that describes it closes the gap as the effect does
    assert bool(result["right"])
    assert float(result["left"]) < float(result["before"])
    with pytest.raises(ParameterError, match="choose a new folder"):
        leave_out(tmp_path, "own", n=1, seed=11)
    words = ["gap", "leave-out", str(tmp_path), "-n", "1", "--seed", "10", "--json"]
    out = CliRunner().invoke(app, words)
    assert out.exit_code == 0
    assert json.loads(out.stdout)[-1]["effect"] == "all"


@pytest.mark.slow
def test_tests_that_the_diagnosis_asks_for_are_run_and_named(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "WORLD_EFFECTS", {"gain_mismatch": WORLD_EFFECTS["gain_mismatch"]})
    (result,) = leave_out(tmp_path, "own", n=1, seed=5, tests=1).to_dict("records")
    assert result["error"] == ""
    asked = result["asked"].split()
    assert len(asked) <= 1
    names = [result["record"], *(f"{result['record']}-{a}" for a in asked)]
    assert sorted(f.stem for f in (tmp_path / "records").glob("*.csv")) == sorted(names)
    with pytest.raises(ParameterError, match="choose a new folder"):
        leave_out(tmp_path, "own", n=1, seed=5)
