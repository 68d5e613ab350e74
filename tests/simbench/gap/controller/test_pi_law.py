"""The controller's law: exact where it holds, and what lies between error and OP where it does
not.
"""

from dataclasses import replace

import numpy as np
import pytest
from recorded import LOADED, recorded

from simbench.gap.controller.pi_law import examine_law
from simbench.gap.controller.pid_law import Stated


def record(*effects, **changes):
    return recorded(LOADED, *effects, **changes)


def law(r, Ti=18.0):
    return examine_law(r.op, r.pv, r.sp, Stated(0.6, Ti, r.Ts))


def between(result):
    """Name what lies between error and OP."""
    return {name for name in ("limits", "gap", "step", "tuning") if getattr(result, name)}


def test_the_law_of_an_untouched_controller_is_exact():
    result = law(record())
    assert result.known
    assert not between(result)
    assert result.residual < 1e-9


def test_detuning_is_measured_to_the_digit():
    result = law(record(("detuning", {"Kc_factor": 1.7, "Ti_factor": 0.6})))
    assert result.tuning == pytest.approx((1.7, 0.6), rel=1e-6)


@pytest.mark.parametrize(
    ("effect", "parameters", "name", "value", "tolerance"),
    [
        ("error_deadband", {"width": 0.3}, "gap", 0.3, 0.03),
        ("op_quantisation", {"step": 0.4}, "step", 0.4, 1e-6),
        ("saturation", {"lo": 0.0, "hi": 52.0}, "limits", (0.0, 52.0), 1e-6),
    ],
)
def test_controller_effects_are_recognised_with_their_size(
    effect, parameters, name, value, tolerance
):
    result = law(record((effect, parameters)))
    assert between(result) == {name}
    assert getattr(result, name) == pytest.approx(value, abs=tolerance)


def test_a_late_archive_is_no_new_tuning():
    r = record()
    result = examine_law(r.op[1:], r.pv[:-1], r.sp[:-1], Stated(0.6, 18.0, r.Ts))
    early = examine_law(r.op[:-1], r.pv[1:], r.sp[1:], Stated(0.6, 18.0, r.Ts))
    assert {result.late, early.late} <= {0, 1}
    assert early.known is False or not between(early)
    late = examine_law(np.append(r.op[0], r.op[:-1]), r.pv, r.sp, Stated(0.6, 18.0, r.Ts))
    assert late.known
    assert late.late == 1
    assert not between(late)


def test_a_set_point_logged_a_sample_off_is_no_other_controller():
    r = record()
    for sp in (np.append(r.sp[0], r.sp[:-1]), np.append(r.sp[1:], r.sp[-1])):
        result = law(replace(r, sp=sp))
        assert result.known
        assert not between(result)


@pytest.mark.parametrize("form", ["trapezoid", "forward"])
def test_how_the_integral_is_taken_is_no_new_tuning(form):
    r = record()
    e = r.sp - r.pv
    old = np.append(e[0], e[:-1])
    op = 50 + np.cumsum(
        0.6 * (e - old) + 0.6 / 6.0 * (0.5 * (e + old) if form == "trapezoid" else old)
    )
    result = law(replace(r, op=op), Ti=6.0)
    assert result.known
    assert not between(result)
    assert result.residual < 1e-6


@pytest.mark.parametrize("share", [0.1, 0.75])
def test_missed_scans_are_recognised_by_the_law_between_the_moves(share):
    r = record()
    e, op = r.sp - r.pv, np.full(r.n, 50.0)
    skip, last = np.random.default_rng(4).random(r.n) < share, 0
    for k in range(1, r.n):
        op[k] = op[k - 1]
        if not skip[k]:
            op[k] += 0.6 * (e[k] - e[last]) + 0.6 / 18 * e[k]
            last = k
    assert "skips scans" in law(replace(r, op=op)).foreign


@pytest.mark.parametrize(
    ("archive", "tuning"),
    [
        (("compression", {"band": 0.6}), {}),
        (("quantisation", {"step": 0.5, "at": "record"}), {"Kc_factor": 0.5, "Ti_factor": 1.8}),
    ],
)
def test_tuning_is_read_through_a_poor_archive(archive, tuning):
    effects = [("detuning", tuning)] if tuning else []
    clean = record(*effects)
    result = law(record(*effects, archive))
    assert result.recovered_pv is not None
    assert np.abs(result.recovered_pv - clean.pv)[100:].max() < 0.1 * archive[1].get("band", 0.5)
    if tuning:
        assert result.tuning == pytest.approx((0.5, 1.8), rel=0.03)
    else:
        assert not between(result)


def of_means(r):
    return replace(r, pv=0.5 * (r.pv + np.append(r.pv[0], r.pv[:-1])))


def test_a_dead_band_of_the_error_is_seen_through_an_archive_that_takes_means():
    result = law(of_means(record(("error_deadband", {"width": 0.3}))))
    assert result.gap == pytest.approx(0.3, abs=0.1)
    assert law(of_means(record())).gap == 0.0


@pytest.mark.parametrize(
    ("name", "factor", "another"),
    [
        ("Kc_factor", 1.11, False),
        ("Kc_factor", 1.17, True),
        ("Kc_factor", 0.9, False),
        ("Kc_factor", 0.78, True),
        ("Ti_factor", 1.11, False),
        ("Ti_factor", 1.17, True),
        ("Ti_factor", 0.75, True),
    ],
)
def test_a_tuning_a_few_percent_off_is_the_same(name, factor, another):
    # downwards another form of the integral makes up for some of it
    result = law(record(("detuning", {name: factor})))
    assert result.known
    assert (result.tuning is not None) == another


@pytest.mark.parametrize("step", [0.01, 0.0244140625, 0.05])
def test_an_output_card_hides_nothing_of_the_law_whatever_the_archive_wrote_of_it(step):
    r = record()
    written = np.round(np.round(r.op / step) * step, 2)
    result = law(replace(r, op=written))
    assert result.known
    assert not result.averaged
    assert result.tuning is None
