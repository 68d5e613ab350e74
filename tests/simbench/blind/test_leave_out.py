"""Effects left out: the library is whole again, the table counts what was said, a run goes on where
it stopped.
"""

import json

import pandas as pd
import pytest
from typer.testing import CliRunner

from detectors.errors import ParameterError
from simbench.blind import leave_out as module
from simbench.blind.leave_out import LEAVE_OUT_COLUMNS, leave_out, summary
from simbench.blind.world import WORLD_EFFECTS
from simbench.cli import app
from simbench.gap.effects import PLUGINS, left_out, recogniser
from simbench.loop.effects import EFFECTS


def rows(*told):
    return pd.DataFrame(
        [dict.fromkeys(LEAVE_OUT_COLUMNS, "") | row for row in told], columns=LEAVE_OUT_COLUMNS
    )


def row(effect, said, block, before=2.0, left=1.9, after=0.5, resolvable=True, **more):
    return {
        "effect": effect,
        "said": said,
        "right": said == "unknown",
        "block": block,
        "nearest": "noise",
        "before": before,
        "left": left,
        "floor": 0.0,
        "resolvable": resolvable,
        "back": effect,
        "after": after,
        **more,
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


def test_the_table_counts_resolvable_records_and_says_how_many_failed():
    found = rows(
        row("stiction", "unknown", "valve"),
        row("stiction", "deadband", "valve", left=1.0),
        row("drift", "none", "none"),
        row("drift", "noise", "sensor", resolvable=False),
        {"effect": "noise", "error": "PV is constant"},
    )
    table = summary(found).set_index("effect")
    assert list(table.index) == [*WORLD_EFFECTS, "all"]
    assert table.n["stiction"] == 2
    assert table.unknown["stiction"] == 0.5
    assert table.block_right["stiction"] == 1.0
    assert table.right["stiction"] == 0.5
    assert table.left["stiction"] == pytest.approx(0.725)
    assert table.back["stiction"] == 0.25
    assert table.n["drift"] == 1
    assert table.failed["noise"] == 1
    assert table.unknown["all"] == pytest.approx(1 / 3)
    assert table.unknown_lo["all"] < 1 / 3 < table.unknown_hi["all"]


def test_leaving_out_goes_on_where_it_stopped_and_refuses_another_worlds_rows(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(
        module, "WORLD_EFFECTS", {e: WORLD_EFFECTS[e] for e in ("detuning", "saturation")}
    )
    first = leave_out(tmp_path, "own", n=1, seed=5)
    monkeypatch.setattr(module, "_one", None)  # nothing is left to do
    pd.testing.assert_frame_equal(leave_out(tmp_path, "own", n=1, seed=5), first)
    told = first.set_index("effect")
    assert told.said["detuning"] == "unknown"
    assert told.block["detuning"] == "controller"
    # the law that describes it closes the gap as the effect does
    assert bool(told.right["detuning"])
    assert float(told.left["detuning"]) < float(told.before["detuning"])
    assert told.back["detuning"] == "detuning"
    with pytest.raises(ParameterError, match="choose a new folder"):
        leave_out(tmp_path, "own", n=1, seed=6)
    out = CliRunner().invoke(
        app, ["gap", "leave-out", str(tmp_path), "-n", "1", "--seed", "5", "--json"]
    )
    assert out.exit_code == 0
    assert json.loads(out.stdout)[-1]["effect"] == "all"


@pytest.mark.slow
def test_tests_that_the_diagnosis_asks_for_are_run_and_named(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "WORLD_EFFECTS", {"gain_mismatch": WORLD_EFFECTS["gain_mismatch"]})
    (found,) = leave_out(tmp_path, "own", n=1, seed=5, tests=1).to_dict("records")
    assert found["error"] == ""
    asked = found["asked"].split()
    assert len(asked) <= 1
    assert sorted(f.stem for f in (tmp_path / "records").glob("*.csv")) == sorted(
        [found["record"], *(f"{found['record']}-{a}" for a in asked)]
    )
    with pytest.raises(ParameterError, match="choose a new folder"):
        leave_out(tmp_path, "own", n=1, seed=5)
