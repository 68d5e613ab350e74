"""Cases that people published: what everybody in the field knows is not answered wrongly with
confidence.
"""

from pathlib import Path

import pytest

from simbench.detectors.records.io import read_record
from simbench.detectors.verdict import NO_STICTION, STICTION
from simbench.gap import conclude, diagnose
from simbench.gap.stiction import causes
from simbench.gap.stiction.conclusion import judged
from simbench.loop.simulate import simulate
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import load_loop

PUBLISHED = Path(__file__).parents[3] / "data" / "published"


def concluded(name):
    return judged(read_record(PUBLISHED / f"{name}.csv"))[0]


@pytest.mark.parametrize("name", ["idv14_3s", "idv14_3s_mv"])
def test_a_limit_cycle_that_keeps_its_phase_is_stiction(name):
    found = concluded(name)
    assert (found.verdict, found.cause) == (STICTION, causes.STICKING)
    assert found.probability > 0.8


@pytest.mark.parametrize("name", [f"idv{k}_{pace}" for k in (0, 11) for pace in ("3s", "15s")])
def test_a_sound_valve_of_the_same_process_is_never_stiction(name):
    assert concluded(name).verdict != STICTION


@pytest.mark.parametrize("name", ["idv14_15s", "idv14_60s", "d14_te", "d00_te"])
def test_what_is_recorded_too_seldom_is_not_denied(name):
    found = concluded(name)
    assert found.verdict not in (STICTION, NO_STICTION)
    assert "samples per period are too few" in found.reason
    assert found.next.startswith("record OP and PV every")


@pytest.mark.parametrize("name", ["quiet_sticky_2", "quiet_sticky_9"])
def test_a_sticking_valve_that_hardly_moves_is_not_denied(name):
    found = concluded(name)
    assert found.verdict != NO_STICTION
    assert "nothing to do" not in found.next
    assert "watch the period" not in found.next


def test_tuning_is_no_cause_of_a_swing_of_another_period_than_the_resonance():
    found = concluded("d14_te")
    assert found.cause != causes.TIGHT


@pytest.mark.parametrize("path", sorted(PUBLISHED.glob("*.csv")), ids=lambda p: p.stem)
def test_verdict_and_probability_agree(path):
    found = concluded(path.stem)
    if found.probability is not None and found.verdict not in (STICTION, NO_STICTION):
        assert 0.2 <= found.probability <= 0.8


@pytest.mark.parametrize("part", [0, 400, 800])
def test_a_large_band_is_found_in_three_cycles_and_said_alike_with_its_interval(part):
    record = read_record(PUBLISHED / f"solvent_{part}.csv")
    found = judged(record)[0]
    assert found.verdict == STICTION
    assert found.S.value == pytest.approx(14.0, rel=0.25)
    assert found.S.lo <= found.S.value <= found.S.hi
    assert found.S.sentence("S") in found.reason
    whole = diagnose(record, identify=True)
    assert whole.conclusion == found
    bands = [row.parameters["S"] for row in whole.ranking[:2] if "S" in row.parameters]
    assert bands == [pytest.approx(14.0, rel=0.25)] * len(bands)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_band_in_a_level_loop_is_not_denied_beside_its_loop_file(seed):
    healthy = load_loop(PUBLISHED / "backlash.toml")
    valve = {"name": "deadband", "parameters": {"S": 2.0}}
    loop = healthy.model_copy(update={"valve": Part(**valve)})
    found = conclude(simulate(loop, seed).record.without_mv(), healthy)
    assert found.verdict != NO_STICTION
