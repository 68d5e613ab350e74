"""The black box beside the diagnosis."""

from results.studies.black_box import Box, black_box, compared
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.5, "T": 20.0, "Td": 3.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
        "sampling": {"Ts": 1.0, "n": 1500, "warm_up": 300},
        "noise": {"std": 0.1},
        "disturbance": [{"type": "coloured", "amplitude": 1.0, "period": 30.0}],
    }
)


def test_the_black_box_of_a_linear_loop_is_near_it():
    box = black_box(simulate(LOOP, 3).record.without_mv())
    assert box.distance < 1.5 * box.plant_floor


def test_a_record_without_a_box_is_not_near():
    gaps = {n: {"before": 2.0, "after": 1.0, "plant_floor": 1.0} for n in ("a", "b", "c", "d")}
    boxes = {"a": Box(1.4, 1.0), "b": Box(1.6, 1.0), "c": None, "d": Box(0.9, 1.0)}
    lines = compared(gaps, boxes)
    near = ["  the plain loop 0.00", "  the diagnosis  1.00", "  the black box  0.50"]
    assert lines[:4] == ["Near of 4 records:", *near]
    assert lines[6].split() == ["a", "1.00", "1.00", "1.40", "1.00"]
