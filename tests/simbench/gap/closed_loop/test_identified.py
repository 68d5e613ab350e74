"""A loop that is identified from its record: what copies it, what is chosen, what is written."""

import numpy as np
import pandas as pd
import pytest

import simbench as sb
from simbench.cli import main
from simbench.detectors.records.io import read_record
from simbench.files import write_record
from simbench.gap import diagnose
from simbench.gap.closed_loop.copies import copies
from simbench.gap.closed_loop.described import described, gain_margin
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.intake.identify import identify
from simbench.gap.report.view import write_page
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop, load_loop

# a PID with a filter on its derivative, a plant of second order, a load that moves seldom
RNG = np.random.default_rng(7)
SELDOM = np.where(RNG.random(3000) < 0.01, 2.0, 0.02) * RNG.standard_normal(3000)
TRUE = {
    "plant": {"type": "tf", "num": [1.5], "den": [200.0, 30.0, 1.0], "Td": 3.0},
    "controller": {"type": "PID", "Kc": 1.2, "Ti": 25.0, "Td": 5.0, "N": 5.0},
    "sampling": {"Ts": 1.0, "n": 2000, "warm_up": 500},
    "noise": {"std": 0.02},
    "disturbance": [
        {"type": "resampled", "piece": 10.0, "output": SELDOM.tolist(), "filter": [1, -0.98]}
    ],
}


def record_of(table, **archive):
    loop = Loop.from_table(table | ({"archive": archive} if archive else {}))
    return simulate(loop, 5).record.without_mv()


@pytest.fixture(scope="module")
def healthy():
    return record_of(TRUE)


@pytest.fixture(scope="module")
def report(healthy):
    return diagnose(healthy, identify=True)


def test_the_copy_of_a_loop_that_no_pi_law_describes_is_near_it(report):
    assert report.gap.near
    assert report.gap.recalibrated == report.gap.before
    loop = report.fixed_loop()
    assert loop.controller.type == "tf"
    assert {part.name for part in loop.disturbance} == {"resampled"}
    words = " ".join(report.identified())
    assert "acts like PID: Kc = 1." in words
    assert "drawn again from what the record left, in pieces of" in words
    assert words in " ".join(report.as_text().split())


def test_a_page_shows_the_identified_loop_once_and_says_what_it_is(report, tmp_path):
    write_page(report, tmp_path / "gap.html", [])
    text = (tmp_path / "gap.html").read_text(encoding="utf-8")
    assert " ".join(report.identified()) in text
    assert "under its set point: the loop that was identified from the record. Same axes" in text
    assert "recalibrated" not in text


def test_nothing_of_the_last_third_is_in_the_load(report, healthy):
    s = report.behind.found.situation
    for copy in copies(s, identified_loop(healthy), []):
        for part in copy.loop.disturbance:
            assert len(part.parameters.get("output", [])) in (0, held_out(s) - 20)


def identified_loop(record):
    return identify(record)


def test_an_op_of_unknown_unit_is_simulated_about_the_middle_of_its_travel(healthy):
    moved = sb.gap.diagnose(
        op=healthy.op - 60.0, pv=healthy.pv, sp=healthy.sp, Ts=healthy.Ts, identify=True
    )
    assert 30.0 < simulate(moved.fixed_loop(), 1).record.op.mean() < 70.0


def test_what_is_written_is_what_was_judged(healthy, report, tmp_path, capsys):
    write_record(healthy, tmp_path / "rec.csv")
    words = ["gap", "diagnose", tmp_path / "rec.csv", "--identify"]
    assert main([*map(str, words), "--write-loop", str(tmp_path / "fixed.toml")]) == 0
    capsys.readouterr()
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "fixed.columns.csv",
        "fixed.toml",
        "rec.csv",
    ]
    written, judged = load_loop(tmp_path / "fixed.toml"), report.fixed_loop()
    # of the record as read back from its digits
    again = diagnose(read_record(tmp_path / "rec.csv"), identify=True).fixed_loop()
    assert written.to_table() == again.to_table()
    assert written.sampling == judged.sampling
    assert sb.load_loop(tmp_path / "fixed.toml").to_table() == written.to_table()
    text = (tmp_path / "fixed.toml").read_text()
    assert "# The controller is of order" in text
    assert "--kick" not in text
    assert pd.read_csv(tmp_path / "fixed.columns.csv").columns[:2].tolist() == ["op", "output"]


def test_a_loop_of_high_order_is_described_in_the_numbers_that_people_know():
    law = {"type": "tf", "num": [0.88, -0.8], "den": [1.0, -1.0], "dt": 1.0}
    in_z = Loop.from_table(
        {
            "plant": {"type": "tf", "num": [0.1], "den": [1.0, -0.9], "dt": 1.0, "Td": 2.0},
            "controller": law,
            "sampling": {"Ts": 1.0},
        }
    )
    in_s = Loop.from_table(
        {
            "plant": {"type": "foptd", "K": 1.0, "T": -1.0 / np.log(0.9), "Td": 2.0},
            "controller": {"type": "PI", "Kc": 0.8, "Ti": 10.0},
            "sampling": {"Ts": 1.0},
        }
    )
    assert gain_margin(in_z) == pytest.approx(gain_margin(in_s), rel=1e-6)
    plant, controller, margin = described(in_z)
    assert plant == "The plant is of first order: K = 1, T = 9.49 s, Td = 2.01 s."
    assert controller.startswith("The controller is of order 1 and acts like PI: Kc = 0.8")
    assert margin == described(in_s)[2]
