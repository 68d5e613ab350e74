"""Hagglund's front end: what it counts, what it takes for the integral time, and that it can be
chosen.
"""

import json

import numpy as np
import pytest

from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.load_disturbances import integral_time, oscillation_by_loads
from simbench.detectors.signal.oscillation import iae_loads

T = np.arange(4000.0)


def controlled(e, Kc=0.5, Ti=20.0):
    """OP of a PI controller that saw e."""
    return 50 + np.cumsum(Kc * (np.diff(e, prepend=0.0) + e / Ti))


@pytest.mark.parametrize("Kc", [0.5, -2.0])
@pytest.mark.parametrize("Ti", [5.0, 80.0])
def test_the_integral_time_is_the_controllers(Kc, Ti):
    e = np.sin(T / 8) + 0.3 * np.random.default_rng(0).standard_normal(T.size)
    op = controlled(e, Kc, Ti)
    assert integral_time(op, e, 1.0) == pytest.approx(Ti, rel=1e-6)
    # rounded by the archive, in other units and at another pace
    assert integral_time(3 * np.round(op, 2) + 7, 4 * e, 2.0) == pytest.approx(2 * Ti, rel=0.1)


def test_where_no_pi_controller_moved_op_there_is_no_integral_time():
    rng = np.random.default_rng(1)
    e = np.sin(T / 8)
    assert integral_time(np.cumsum(rng.standard_normal(T.size)), e, 1.0) is None
    assert integral_time(controlled(e, Ti=-20.0), e, 1.0) is None
    assert integral_time(2.0 * e, e, 1.0) is None or integral_time(2.0 * e, e, 1.0) > 1e9


def half_cycles_counted(e, smallest, Ti):
    """Load by load, forgotten with exp(-t / (50 Ti)): the slow twin."""
    e = e - e.mean()
    held = top = area = 0.0
    for k in range(e.size):
        held *= np.exp(-1.0 / (50.0 * Ti))
        area += abs(e[k])
        if k == e.size - 1 or (e[k] > 0) != (e[k + 1] > 0):
            held += area > smallest * Ti / np.pi
            top, area = max(top, held), 0.0
    return top


@pytest.mark.parametrize("period", [20.0, 100.0, 400.0, 900.0])
@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
def test_an_oscillation_is_more_than_ten_loads_in_fifty_integral_times(period, size):
    e = size * np.sin(2 * np.pi * T / period)
    oscillation = oscillation_by_loads(controlled(e), -e, e, 1.0, span=100.0)
    assert oscillation.loads == pytest.approx(half_cycles_counted(e, 1.0, 20.0), rel=0.02, abs=1e-9)
    assert oscillation.sustained == (oscillation.loads > 10)
    # half cycles of 20 s and less hold too little; those of 450 s come too seldom
    assert oscillation.sustained == (size * period > 20.0 and period < 200.0 * 1.2)


def test_without_a_span_the_range_of_pv_is_used():
    e = np.sin(2 * np.pi * T / 100)
    for pv in (-e, -1e-3 * e + 4.0):
        assert oscillation_by_loads(controlled(e), pv, np.ptp(pv) / 2 * e, 1.0).sustained
    noise = np.random.default_rng(0).standard_normal(T.size)
    assert not oscillation_by_loads(controlled(noise, Ti=100.0), -noise, noise, 1.0).sustained
    still = np.zeros(T.size)
    assert oscillation_by_loads(still, still, still, 1.0).loads == 0.0


def test_it_can_be_chosen(loop):
    slow = loop(J=2.5, kick=6.0, n=2000, noise=0.02)
    first, second = (judge(slow, ["ellipse"], front_end=name)[0] for name in ("acf", "hagglund"))
    assert first.verdict != "no_stiction" or "no sustained" not in first.reason
    loads = Prepared(slow.without_mv(), "hagglund").oscillation.loads
    assert ("no sustained oscillation" in second.reason) == (loads <= 10)
    quiet = loop(S=0.0, J=0.0, noise=0.1, n=2000)
    assert judge(quiet, ["ellipse"], front_end="hagglund")[0].reason.startswith(
        "no sustained oscillation ("
    )
    assert "of more than 10 loads" in judge(quiet, ["procedure"], front_end="hagglund")[0].reason
    with pytest.raises(UserError, match="did you mean 'hagglund'"):
        judge(quiet, ["ellipse"], front_end="haglund")


def test_both_commands_know_it(loop, tmp_path, capsys):
    from simbench.detectors.__main__ import main

    record = loop(J=2.5, kick=6.0, n=1500, noise=0.02)
    path = tmp_path / "loop.csv"
    rows = np.column_stack([np.arange(record.n) * record.Ts, record.op, record.pv])
    np.savetxt(path, rows, delimiter=",", header="t,op,pv", comments="")
    for name in ("acf", "hagglund"):
        assert main([str(path), "--method", "ellipse", "--front-end", name, "--json"]) == 0
        verdict = json.loads(capsys.readouterr().out)[0]["verdict"]
        assert verdict == judge(record, ["ellipse"], front_end=name)[0].verdict
    assert main([str(path), "--front-end", "fft"]) == 2
    assert "unknown front end 'fft'" in capsys.readouterr().err


def test_memory_is_that_of_the_recursion():
    e = np.sin(2 * np.pi * T / 40)
    assert iae_loads(e, 1.0, 1e-6, 40.0, np.exp(-1 / 1000)) == pytest.approx(
        half_cycles_counted(e, 1e-6, 20.0), rel=0.02
    )
