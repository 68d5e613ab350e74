"""Friction asked for alone is the friction that the whole diagnosis finds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from left_out import left_out
from recorded import LOADED, RESTING, STICKY, recorded

from simbench.detectors.errors import RecordError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import STICTION
from simbench.gap import diagnose
from simbench.gap.likelihood.kernels import SKIP
from simbench.gap.likelihood.valve_map import Regressed
from simbench.gap.stiction import friction as module
from simbench.gap.stiction import position as spectrum
from simbench.gap.stiction.conclusion import judged
from simbench.gap.stiction.friction import FRICTION, friction, without_last_bits
from simbench.scenarios.spec import Loop


@pytest.mark.slow
def test_friction_that_was_taken_out_of_the_library_is_no_fault():
    with left_out(FRICTION):
        report = diagnose(recorded(LOADED).window(0, 300), Loop.from_table(LOADED))
    assert report.probability_of_stiction < 0.5
    assert FRICTION not in report.behind.found.candidates


def view(base, sticky, integrating=False, price=4.0, n=400):
    """Return an assessment whose samples have these log-likelihoods (n,) without and with
    friction.
    """

    def fit(nats):
        nats = np.concatenate([np.zeros(SKIP), nats])
        residual = np.sqrt(2.0 * (nats.max() - nats))
        return SimpleNamespace(loglik=float(nats.sum()), residual=residual, theta={"S": 4.0})

    none, one = fit(base), fit(sticky)
    gain = one.loglik - none.loglik - price
    op = np.linspace(40.0, 60.0, n)
    situation = SimpleNamespace(
        integrating=integrating,
        data=SimpleNamespace(n=n, u=op, y=op),
        op=op,
        record=SimpleNamespace(process=None),
    )
    stuck = SimpleNamespace(fit=one, log_likelihood_gain=gain, used=True)
    return SimpleNamespace(
        base=none,
        situation=situation,
        candidates={FRICTION: stuck},
    )


NOTHING = np.full(400 - SKIP, -1.0)


def drifting(rise, digits=6):
    """Return OP (400,) that rises by so much and falls back by 4 %, and an assessment with a band
    of 4 %.
    """
    op = np.round(
        np.concatenate([np.linspace(40, 40 + rise, 200), np.linspace(rise, rise - 4, 200) + 40]),
        digits,
    )
    one = view(NOTHING, NOTHING + 0.5)
    one.situation.op = one.situation.data.u = op
    return module._why_unclaimed(one, 100.0)


@pytest.mark.parametrize(("rise", "digits"), [(20, 6), (3.9, 6), (20, 0)])
def test_a_band_that_op_never_passed_both_ways_is_not_claimed(rise, digits):
    assert "never passed both ways" in drifting(rise, digits)


def rings_at_low_load(Ti, late, sticks=False):
    """A healthy valve whose flow saturates (quick opening): its loop has three times the gain at
    low load, where a step of the load takes it.
    """
    rng, n = np.random.default_rng(1), 1500

    def flow(u):
        return 100.0 * (1.0 - np.exp(-u / 28.0)) / (1.0 - np.exp(-100.0 / 28.0))

    op, pv = np.zeros(n), np.zeros(n)
    waiting, integral, state, position = [60.0] * (late + 1), 60.0, 0.0, 60.0
    for k in range(n):
        measured = 50.0 + state + 0.05 * rng.standard_normal()
        error = 50.0 - measured
        integral += error / Ti
        op[k], pv[k] = np.clip(integral + error, 0.0, 100.0), measured
        if not sticks or abs(op[k] - position) > 3.0:
            position = op[k]
        waiting.append(position)
        load = flow(60.0) - flow(25.0) if k > 700 else 0.0
        state += (flow(waiting.pop(0)) - flow(60.0) + load - state) / 10.0
    return LoopRecord(op, pv, 1.0, np.full(n, 50.0))


@pytest.mark.parametrize(("Ti", "late"), [(12.0, 3), (20.0, 2)])
def test_a_gain_that_changes_with_load_is_not_called_stiction(Ti, late):
    assert judged(rings_at_low_load(Ti, late))[0].verdict != STICTION


def test_the_same_loop_with_a_sticking_valve_is():
    assert judged(rings_at_low_load(20.0, 1, sticks=True))[0].verdict == STICTION


@pytest.fixture
def archived():
    """Return a record of which an archive kept every eighth sample and drew lines between them."""
    rng, t = np.random.default_rng(0), np.arange(900.0)
    pv = np.sin(t / 60.0) + 0.002 * rng.standard_normal(900)
    kept = np.arange(0, 900, 8)
    drawn = np.interp(t, t[kept], pv[kept])
    return LoopRecord(op=50.0 + np.cos(t / 60.0), pv=drawn, Ts=1.0, op_span=(0.0, 100.0))


def test_an_archive_that_draws_most_samples_leaves_nothing_to_tell(archived):
    with pytest.raises(RecordError, match="samples of PV were measured"):
        friction(archived)
    assert "were measured" in judge(archived, ["likelihood"])[0].reason


@pytest.mark.slow
def test_nor_does_it_in_any_other_verb(archived):
    report = diagnose(archived)
    assert report.probability_of_stiction is None
    assert any(
        n.startswith(f"{FRICTION}: cannot tell") and "were measured" in n for n in report.notes
    )
    assert report.effect not in (FRICTION, "deadband")


def test_what_another_unit_rounds_differently_decides_nothing():
    case = recorded(RESTING | STICKY)
    rng = np.random.default_rng(0)
    plain = replace(case, pv=np.round(case.pv, 3), op=np.round(case.op, 3), mv=None)
    moved = replace(
        plain,
        pv=plain.pv + 1e-9 * plain.pv.std() * rng.standard_normal(plain.n),
        op=(plain.op + 1e6) - 1e6,
    )
    assert not np.array_equal(moved.op, plain.op)
    a, b = without_last_bits(plain), without_last_bits(moved)
    assert np.array_equal(a.pv, b.pv)
    assert np.array_equal(a.op, b.op)
    assert np.abs(a.pv - plain.pv).max() < 1e-7 * np.ptp(plain.pv)


@pytest.fixture
def as_made_up(monkeypatch):
    """Leave the likelihood of made-up views as it is: no spectrum, no regression."""
    silent = Regressed(0.0, np.empty((0, 3)), 10.0, 0.0)
    monkeypatch.setattr(module, "friction_regressed", lambda op, pv: silent)
    monkeypatch.setattr(spectrum, "any_spectrum", lambda left: -0.5 * left**2)


@pytest.mark.usefixtures("as_made_up")
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_no_sample_is_worth_more_than_a_nat(sign):
    one = NOTHING.copy()
    one[100:103] += sign * 50.0
    weighed = module._likeliest_view([view(NOTHING, one, price=0.0)])
    assert weighed.evidence.gain == pytest.approx(3.0 * sign)
