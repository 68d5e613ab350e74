"""A cause is named on its own evidence: a line from outside is not tuning, a loop at rest has none,
what is open stays open.
"""

from dataclasses import replace

import numpy as np
import pytest
from recorded import LOADED_FAST

from simbench.detectors.errors import Refusal
from simbench.detectors.prepared import Prepared
from simbench.gap.stiction import causes
from simbench.gap.stiction.candidate_loops import candidate_loops
from simbench.gap.stiction.causes import find_causes
from simbench.gap.stiction.conclusion import judged
from simbench.gap.stiction.margins import margins
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from simbench.verbs import detect

LOOP = LOADED_FAST
SINE = {"type": "sine", "amplitude": 2.0, "period": 200.0, "at": "output"}


def causes_of(**more):
    record = simulate(
        Loop.from_table(LOOP | more), 3, kick=5.0 if "valve" in more else 0.0
    ).record.without_mv()
    return find_causes(Prepared(record), candidate_loops(record))


def test_a_sine_from_outside_is_a_disturbance_and_not_tuning():
    result = causes_of(disturbance=[*LOOP["disturbance"], SINE])
    assert result.named.name == causes.FROM_OUTSIDE
    against = next(c for c in result.weighed if c.name == causes.TIGHT).against
    assert "phase coherence" in against[0]


def test_a_sticky_valve_is_stiction_with_its_size():
    result = causes_of(valve={"model": "choudhury", "S": 6.0, "J": 4.0})
    assert result.named.name == causes.STICKING
    assert "S = " in result.named.speaks_for[0]


def test_tuning_is_named_where_the_margin_is_small():
    result = causes_of(controller={"type": "PI", "Kc": 6.4, "Ti": 30.0})
    assert result.named.name == causes.TIGHT
    assert "gain margin" in result.named.speaks_for[0]


TIGHT_LOOP = {
    "plant": {"type": "foptd", "K": 1.0, "T": 12.0, "Td": 4.0},
    "sampling": {"Ts": 1.0, "n": 4000},
    "noise": {"std": 0.03},
    "setpoint": {"value": 50, "steps": [[800, 52], [2600, 50]]},
}


def concluded(Kc, **more):
    loop = TIGHT_LOOP | {"controller": {"type": "PI", "Kc": Kc, "Ti": 12.0}} | more
    return judged(simulate(Loop.from_table(loop), 4).record.without_mv())


def test_a_loop_that_rings_after_steps_of_its_set_point_is_tuned_too_tightly():
    conclusion, weighed = concluded(3.3)
    assert conclusion.cause == causes.TIGHT
    assert "rings after every step of its set point" in conclusion.reason
    assert conclusion.next == "retune the controller"
    rest = next(c for c in weighed.weighed if c.name == causes.NO_CAUSE)
    assert rest.confidence == 0.0


def test_a_loop_at_rest_has_no_cause():
    assert causes_of().named.name == causes.NO_CAUSE


def test_a_record_without_a_loop_is_open_with_its_reason():
    record = simulate(Loop.from_table(LOOP), 3).record.without_mv()
    result = find_causes(Prepared(record), Refusal("no plant can be identified")).named
    assert (result.name, result.against) == (causes.NOT_TOLD, ("no plant can be identified",))


def test_margins_are_those_of_the_frequency_response():
    loop = Loop.from_table(LOOP | {"controller": {"type": "P", "Kc": 2.0}})
    known = margins(loop)
    w = np.linspace(0.01, 1.0, 200_000)
    response = 2.0 / (1 + 30j * w) * np.exp(-7j * w)
    k = int(np.argmax(np.diff(np.sign(np.unwrap(np.angle(response)) + np.pi)) != 0))
    assert known is not None
    assert known.gain == pytest.approx(1 / abs(response[k]), rel=0.02)
    assert known.sensitivity == pytest.approx(1 / np.abs(1 + response).min(), rel=0.02)


@pytest.mark.parametrize(
    ("scale", "offset", "span", "unit", "size"),
    [
        (1.0, 0.0, None, "% of travel", 1.0),
        (0.16, 4.0, (4.0, 20.0), "% of travel", 1.0),
        (16.0, 400.0, None, "OP units", 16.0),
    ],
)
def test_every_verb_gives_the_band_in_the_unit_that_its_table_names(
    scale, offset, span, unit, size
):
    loop = Loop.from_table(LOOP | {"valve": {"model": "choudhury", "S": 6.0, "J": 4.0}})
    percent = simulate(loop, 3, kick=5.0).record.without_mv()
    S = candidate_loops(percent).fitted[0]
    record = replace(percent, op=offset + scale * percent.op, op_span=span)
    loops = candidate_loops(record)
    reason = find_causes(Prepared(record), loops).named.speaks_for[0]
    verdict = detect(record, ["likelihood"])["likelihood"]
    assert f"S = {verdict.S:.3g} (" in reason
    assert reason.endswith(unit)
    assert verdict.S == pytest.approx(size * S, rel=1e-3)
    assert verdict.S_unit == unit
