"""A cascade on a plant's page: one oscillation, of which the inner loop, whose valve sticks, is
named first.
"""

import pytest

from simbench.files import write_record
from simbench.loop.simulate import simulate
from simbench.plant.report import fleet
from simbench.scenarios.spec import Loop

PAIR = {
    "plant": {"type": "foptd", "K": 1.0, "T": 5.0, "Td": 1.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 5.0},
    "valve": {"model": "choudhury", "S": 5.0, "J": 2.0},
    "noise": {"std": 0.05},
    "sampling": {"Ts": 1.0, "n": 1500},
    "outer": {
        "plant": {"type": "foptd", "K": 0.8, "T": 30.0, "Td": 4.0},
        "controller": {"type": "PI", "Kc": 1.5, "Ti": 30.0},
        "setpoint": {"value": 60.0},
    },
}


@pytest.mark.slow
@pytest.mark.usefixtures("two_methods")
def test_inner_loop_leads_its_oscillation_though_the_outer_one_looks_as_sticky(
    tmp_path, monkeypatch
):
    run = simulate(Loop.from_table(PAIR), seed=1, kick=6.0)
    write_record(run.record, tmp_path / "FIC1.csv")
    write_record(run.outer, tmp_path / "TIC1.csv")
    monkeypatch.setattr(fleet, "likely_root", lambda group, *_: sorted(group, reverse=True))
    surveyed = fleet.survey(tmp_path, jobs=1)
    assert surveyed.cascades == (("TIC1", "FIC1"),)
    assert surveyed.events == (("FIC1", "TIC1"),)
    assert surveyed.members[0].name == "FIC1"
    assert surveyed.to_test() == ["FIC1"]
