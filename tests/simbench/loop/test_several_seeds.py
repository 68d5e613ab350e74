"""A loop under several seeds: its numbers by hand, and what a change of its settings does."""

import json

import numpy as np
import pytest

from simbench.cli import main
from simbench.detectors.record import LoopRecord
from simbench.loop.several_seeds import measure, simulate_seeds
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0},
        "valve": {"model": "choudhury", "S": 5.0, "J": 2.0},
        "noise": {"std": 0.1},
        "setpoint": {"steps": [[10, 55]]},
        "sampling": {"Ts": 1.0, "n": 800},
    }
)


def test_a_triangle_has_the_numbers_of_a_triangle():
    t = np.arange(1000)
    op = 50.0 + 4.0 * (np.abs(t % 100 - 50) / 25 - 1)  # 46 to 54 and back in 100 s
    numbers = measure(LoopRecord(op, np.sin(2 * np.pi * t / 100), 1.0))
    assert numbers["op_std"] == pytest.approx(8 / np.sqrt(12), rel=0.01)
    assert numbers["pv_std"] == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert numbers["period_s"] == pytest.approx(100, rel=0.02)
    assert numbers["op_travel_per_hour"] == pytest.approx(16 * 36, rel=0.01)


def test_a_loop_that_does_not_oscillate_has_no_period():
    healthy = LOOP.with_all({"valve": {"model": "ideal"}, "controller.Kc": 0.3})
    spread = simulate_seeds(healthy, 5)
    assert (spread.period_s, spread.oscillates) == (None, 0.0)
    assert "0 of 5 records oscillate" in spread.as_text()


def test_the_command_line_changes_settings(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop.toml").write_text(
        """
        plant = { type = "foptd", K = 1.0, T = 10.0, Td = 2.0 }
        controller = { type = "PI", Kc = 1.0, Ti = 10.0 }
        sampling = { Ts = 1.0, n = 600 }
        noise = { std = 0.1 }
        setpoint = { steps = [[10, 55]] }
        """
    )
    travel = []
    for Kc in ("0.5", "1.0"):
        words = ["simulate", "loop.toml", "--seeds", "5", "--set", f"controller.Kc={Kc}", "--json"]
        assert main(words) == 0
        travel.append(json.loads(capsys.readouterr().out)["op_travel_per_hour"]["value"])
    assert travel[0] < 0.7 * travel[1]
    assert main(["simulate", "loop.toml", "--seeds", "5"]) == 0
    assert "OP travel (% per hour)" in capsys.readouterr().out
    assert main(["simulate", "loop.toml", "-o", "a.csv", "--set", "controller.Kc=1.0"]) == 0
    assert main(["simulate", "loop.toml", "-o", "b.csv"]) == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    capsys.readouterr()
    for wrong, word in (
        (["--seeds", "1"], "--seeds"),
        (["--seeds", "5", "-o", "r.csv"], "--seeds"),
        (["--seeds", "5", "--set", "controller.Kx=1"], "Kx"),
        (["--seeds", "5", "--set", "controller.Kc=-1"], "Kc"),
    ):
        assert main(["simulate", "loop.toml", *wrong]) == 2
        assert word in capsys.readouterr().err
