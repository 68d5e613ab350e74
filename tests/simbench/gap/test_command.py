"""`simbench gap diagnose` end to end: the contract's JSON, a loop file that simulates like the
plant, one-sentence refusals.
"""

from __future__ import annotations

import contextlib
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import welch

from simbench.cli import main
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.files import write_record
from simbench.gap import command
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop, load_loop

HEALTHY = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1000},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[200.0, 55.0], [750.0, 50.0]]},
}
STICKY = {**HEALTHY, "valve": {"model": "choudhury", "S": 6.0, "J": 2.0}}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A record of a sticky loop, with MV and without, and the loop file that knows nothing of the
    friction.
    """
    place = tmp_path_factory.mktemp("gap")
    record = simulate(Loop.from_table(STICKY), seed=3, kick=6.0).record
    write_record(record, place / "FIC101.csv")
    write_record(replace(record, mv=None), place / "no_mv.csv")
    (place / "loop.toml").write_text(Loop.from_table(HEALTHY).to_toml())
    return place


def diagnosed(place, *words):
    """Return the JSON that the verb prints."""
    files = [str(place / w) if w.endswith((".csv", ".toml")) else w for w in words]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(["gap", "diagnose", *files, "--no-bootstrap", "--json"]) == 0
    return json.loads(out.getvalue())


@pytest.fixture(scope="module")
def answer(place):
    """The verb's JSON for the sticky loop without MV, and the loop file it wrote."""
    return diagnosed(place, "no_mv.csv", "--baseline", "loop.toml", "--write-loop", "fixed.toml")


def test_missing_stiction_is_named_in_the_valve_and_closes_the_gap(answer):
    assert (answer["block"], answer["effect"]) == ("valve", "stiction")
    assert answer["ranking"][0]["effect"] == "stiction"
    assert answer["effects"][0]["parameters"]["S"] == pytest.approx(6.0, rel=0.1)
    assert max(answer["blocks"], key=answer["blocks"].__getitem__) == "valve"
    assert answer["gap"]["resolvable"]
    assert answer["shrinkage"]["value"] > 0.7


def likeness(record):
    """Logarithms of the sizes of PV, OP and OP's changes and of OP's mean frequency, between two
    set-point changes.
    """
    settled = slice(300, 750)
    pv, op = record.pv[settled], record.op[settled]
    f, power = welch(op, nperseg=op.size)
    centre = np.sum(f[1:] * power[1:]) / np.sum(power[1:])
    return np.log([np.std(pv), np.std(op), np.std(np.diff(op)), centre])


def test_the_loop_file_it_writes_simulates_like_the_record(answer, place):
    loop = load_loop(place / "fixed.toml")
    assert [part.name for part in loop.effect] == ["stiction"]
    assert loop.sampling.n == 1000
    assert [list(step) for step in loop.setpoint.steps] == HEALTHY["setpoint"]["steps"]
    real = likeness(read_record(place / "no_mv.csv"))
    # single runs of the true loop itself, too, differ by up to half in their mean frequency
    runs = [likeness(simulate(loop, seed=s).record) for s in range(5, 12)]
    assert np.abs(np.median(runs, axis=0) - real).max() < np.log(1.5)
    bare = likeness(simulate(Loop.from_table(HEALTHY), seed=5).record)
    assert np.abs(bare - real).max() > np.log(3.0)


def with_part(place, true, *sections):
    """Return the answer to a record of a loop without MV, beside these sections of the healthy
    loop's file.
    """
    parts = Loop.from_table(HEALTHY).to_toml().split("\n\n")
    kept = [p for p in parts if p.strip("[ \n").split("]")[0] in sections]
    (place / "part.toml").write_text("\n\n".join(kept))
    write_record(replace(simulate(Loop.from_table(true), seed=3).record, mv=None), place / "r.csv")
    return diagnosed(place, "r.csv", "--baseline", "part.toml")


def test_without_a_plant_the_tuning_is_still_judged_and_what_is_left_open_is_noted(place):
    retuned = HEALTHY | {"controller": {"type": "PI", "Kc": 0.75, "Ti": 12.0}}
    answer = with_part(place, retuned, "controller", "noise")
    assert answer["effect"] == "detuning"
    assert answer["effects"][0]["parameters"] == pytest.approx(
        {"Kc_factor": 0.5, "Ti_factor": 0.6}, rel=0.05
    )
    notes = " ".join(answer["notes"])
    assert "no [plant] given, identified from the record: foptd, K = " in notes
    assert "gain_mismatch" in notes
    assert "no [sampling] given, identified from the record: Ts = 1" in notes
    assert "[controller]" not in notes


@pytest.mark.parametrize(
    ("window", "length"), [(None, 200), ((0, 200), 200), ((0, 3), 3), ((50, 60), 10)]
)
def test_a_window_is_cut_out_of_the_record(window, length):
    record = LoopRecord(op=np.arange(200.0), pv=np.arange(200.0), Ts=1.0)
    assert command._cut_window(record, window, "loop.csv").n == length


def test_healthy_records_are_read_noted_and_repeated_on_the_page(place, tmp_path):
    write_record(simulate(Loop.from_table(HEALTHY), seed=8).record, place / "healthy.csv")
    given = ["no_mv.csv", "--baseline", "loop.toml", "--healthy", "healthy.csv"]
    found = diagnosed(place, *given, "--html", str(tmp_path / "gap.html"))
    assert found["effect"] == "stiction"
    assert any(note.startswith("healthy: 1 record shows noise 0.1") for note in found["notes"])
    assert f"--healthy {place / 'healthy.csv'}" in (tmp_path / "gap.html").read_text()
