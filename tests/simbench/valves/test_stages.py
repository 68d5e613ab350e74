import numpy as np
import pytest

from simbench.loop.response import valve_response


def test_lag_without_a_rate_is_first_order():
    mv = valve_response("lag", [20.0, *[80.0] * 50], {"T": 4}, Ts=0.5)
    t = 0.5 * np.arange(51)
    np.testing.assert_allclose(mv, 80 - 60 * np.exp(-t / 4), rtol=1e-12)


def test_rate_limit_without_a_lag_is_a_ramp_that_arrives_exactly():
    mv = valve_response("lag", [20.0, *[50.0] * 10], {"rate": 8}, Ts=0.5)
    np.testing.assert_allclose(mv, np.minimum(20 + 8 * 0.5 * np.arange(11), 50))


@pytest.mark.parametrize("kind", ["linear", "equal_percentage", "quick_opening"])
@pytest.mark.parametrize("authority", [1.0, 0.3])
def test_characteristics_rise_to_full_flow(kind, authority):
    flow = valve_response(
        "characteristic", np.linspace(0, 100, 101), {"type": kind, "authority": authority}
    )
    assert (np.diff(flow) > 0).all()
    assert flow[-1] == pytest.approx(100)


def test_equal_percentage_multiplies_flow_by_the_same_factor_per_percent():
    flow = valve_response(
        "characteristic", np.linspace(0, 100, 11), {"type": "equal_percentage", "R": 50}
    )
    np.testing.assert_allclose(flow[1:] / flow[:-1], 50**0.1)


def test_a_line_that_takes_most_pressure_turns_linear_into_quick_opening():
    op = np.linspace(1, 99, 99)
    pressure = {"type": "linear", "authority": 0.2}
    flow = valve_response("characteristic", op, pressure) / 100
    # the line takes (1 - N) flow^2 of the pressure, the valve passes f sqrt(rest / N)
    np.testing.assert_allclose(flow, op / 100 * np.sqrt((1 - 0.8 * flow**2) / 0.2))


def test_travel_stops_hold():
    np.testing.assert_array_equal(
        valve_response("limits", [50, 5, 95], {"low": 20, "high": 80}), [50, 20, 80]
    )
