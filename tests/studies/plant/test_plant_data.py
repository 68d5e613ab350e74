"""Without a baseline: what MV, samples and set point show is reported, the likelier plant is taken;
plant records are counted.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from results.studies.plant.plant_data import by_unit_group, diagnose_folder
from simbench.detectors.records.io import read_record
from simbench.detectors.signal.lattice import lattice, root_lattice, written_unit
from simbench.gap.decide.assess import assess
from simbench.gap.decide.identified import plausible, remarks
from simbench.gap.diagnosis import diagnose
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import identify
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

REAL = Path(__file__).parents[4] / "shared" / "data" / "real"
on_plant_data = pytest.mark.skipif(not REAL.is_dir(), reason=f"{REAL}: no plant records here")

FLOW = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 800},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[200.0, 55.0], [500.0, 50.0]]},
    "disturbance": [{"type": "coloured", "amplitude": 0.5, "period": 30.0}],
}
LEVEL = {
    "plant": {"type": "integrating", "K": 0.02, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 4.0, "Ti": 80.0},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.05},
    "disturbance": [{"type": "coloured", "amplitude": 0.5, "period": 30.0}],
}
SHORT = FLOW | {"sampling": {"Ts": 1.0, "n": 500}}
STICKY = {"valve": {"model": "choudhury", "S": 6.0, "J": 2.0}}


def record_of(table, process=None, mv=False, kick=0.0):
    record = simulate(Loop.from_table(table), seed=3, kick=kick).record
    return replace(record, mv=record.mv if mv else None, process=process)


def without_baseline(record):
    return plausible(assess(check(record, identify(record), trusted=False)))


def remarks_on(record):
    return remarks(check(record, identify(record), trusted=False))


def notes_on(record):
    return check(record, identify(record), trusted=False).notes


@pytest.mark.slow
def test_friction_that_mv_shows_is_named_without_a_baseline():
    report = diagnose(record_of(FLOW | STICKY, "self-regulating", mv=True, kick=6.0), None)
    assert report.block == "valve"
    assert report.effect == "stiction"


def test_no_effect_of_a_valve_that_mv_shows_healthy_is_named():
    assessed = without_baseline(record_of(SHORT, "self-regulating", mv=True))
    assert not {"stiction", "deadband", "deadzone", "valve_lag", "valve_characteristic"} & set(
        assessed.chosen
    )
    assert not assessed.unexplained


@pytest.mark.slow
def test_a_valve_no_map_explains_is_strange_without_a_baseline_too():
    record = record_of(SHORT, "self-regulating", mv=True)
    assert record.mv is not None
    wandering = record.mv + 3.0 * np.sin(np.arange(record.n) / 7.0)
    assert list(without_baseline(replace(record, mv=wandering)).unexplained) == ["valve"]


def test_a_sticky_level_loop_of_unknown_process_names_friction_and_the_assumed_process():
    assessed = without_baseline(record_of(LEVEL | STICKY, kick=6.0))
    assert {"stiction", "deadband"} & set(assessed.chosen)
    assert (
        "process: not given; judged as integrating, the likelier of the two"
        in assessed.situation.notes
    )


def test_a_quantised_healthy_record_lacks_nothing_and_its_lattice_and_set_point_steps_are_noted():
    table = FLOW | {"effect": [{"name": "quantisation", "step": 0.37, "at": "loop"}]}
    report = diagnose(record_of(table, "self-regulating"), None)
    assert report.effect == "none"
    assert any(n.startswith("quantisation: ") and ", 0.37 apart" in n for n in report.notes)
    assert "set-point steps: SP moves in 2 steps, the largest 5" in report.notes


@pytest.mark.slow
def test_a_healthy_record_without_a_baseline_is_none_also_where_luck_is_kind():
    report = diagnose(
        record_of(FLOW | {"sampling": {"Ts": 1.0, "n": 400}}, "self-regulating"), None
    )
    assert report.effect == "none"


def test_unit_groups_count_alike_and_doubtful_labels_do_not_count():
    frame = pd.DataFrame({
        "unit_group": ["A", "A", "A", "B", "C"],
        "label": ["stiction"] * 4 + ["no_stiction"],
        "credible": [True, True, True, True, False],
        "friction": [True, True, False, False, True],
    })  # fmt: skip
    row = by_unit_group(frame).set_index("label")
    assert list(row.index) == ["stiction"]
    assert row.loc["stiction", "groups"] == 2
    assert row.loc["stiction", "share"] == pytest.approx((2 / 3 + 0) / 2)
    assert row.loc["stiction", "majority"] == 0.5


@pytest.fixture
def folder(tmp_path):
    """A folder laid out like the plant data, with a quantised record, one that is too short, and
    one not to be used.
    """
    record = record_of(FLOW | {"effect": [{"name": "quantisation", "step": 0.37, "at": "loop"}]})
    frame = pd.DataFrame({"t_s": record.t, "sp": record.sp, "pv": record.pv, "op": record.op})
    frame.to_csv(tmp_path / "FIC1.csv", index=False)
    frame[:50].to_csv(tmp_path / "FIC2.csv", index=False)
    columns = {
        "label": "no_stiction",
        "label_doubt": [np.nan, "short", "dead"],
        "dynamics": "self_regulating",
        "primary": 1,
    }
    flags = {
        "pv_quantised": [1, 0, 0],
        "compressed": 0,
        "spikes": 0,
        "sp_kind": ["steps", "constant", "constant"],
    }
    ids = {
        "id": ["FIC1", "FIC2", "FIC3"],
        "unit_group": ["FIC1", "FIC2", "FIC3"],
        "usable": [1, 1, 0],
    }
    pd.DataFrame(ids | columns | flags).to_csv(tmp_path / "records.csv", index=False)
    return tmp_path


def test_a_folder_gives_a_row_per_usable_record_and_the_reason_of_a_refusal(folder):
    frame = diagnose_folder(folder, blind=True).set_index("id")
    assert list(frame.index) == ["FIC1", "FIC2"]
    assert frame.named_pv_quantised.to_dict() == {"FIC1": True, "FIC2": False}
    assert frame.named_sp_steps.to_dict() == {"FIC1": True, "FIC2": False}
    assert frame.credible.to_dict() == {"FIC1": True, "FIC2": False}
    assert "at least 100" in frame.error["FIC2"]
    assert frame.type["FIC1"] == "foptd"


@on_plant_data
@pytest.mark.parametrize(
    "name", ["ISDB_PAP2", "ISDB_PAP4", "SGPT_2-CDU-7040-311-FIC31102_0628-0002"]
)
def test_pv_of_plants_that_repeats_its_values_is_on_a_lattice(name):
    record = read_record(REAL / f"{name}.csv")
    assert lattice(record.pv, written_unit(record.pv, record.op)) or root_lattice(record.pv)


@on_plant_data
def test_set_point_steps_of_a_plant_record_are_reported():
    record = read_record(REAL / "SGPT_2411FIC20102_1107-0006.csv", process="self-regulating")
    assert any(n.startswith("set-point steps: SP moves in 2 steps") for n in notes_on(record))
