import pickle

import pytest

from simbench.detectors.errors import ParameterError, UnknownName
from simbench.loop.parameters import VALVES, Choice, Number, resolve, valve_parameters
from simbench.loop.physical.mapping import complete_band

SCHEMA = {
    "S": Number("% of travel", low=0.0, high=100.0, says="band"),
    "T": Number("s", low=0.0, positive=True, default=1.0),
}


@pytest.mark.parametrize(
    ("table", "error", "words"),
    [
        ({"S": 1, "TT": 2}, UnknownName, "unknown parameter 'TT' in valve 'x'"),
        ({}, ParameterError, "valve 'x' needs S (% of travel): band"),
        ({"S": -1}, ParameterError, "S = -1 is out of range, it must be in 0..100 (% of travel)"),
        ({"S": 101.0}, ParameterError, "S = 101 is out of range"),
        ({"S": float("nan")}, ParameterError, "S = nan is not finite"),
        ({"S": float("inf")}, ParameterError, "S = inf is not finite"),
        ({"S": "5"}, ParameterError, "S = '5' is no number"),
        ({"S": True}, ParameterError, "S = True is no number"),
        ({"S": [1.0]}, ParameterError, "S = [1.0] is no number"),
        ({"S": 1, "T": 0}, ParameterError, "T = 0 is out of range, it must be > 0 (s)"),
    ],
)
def test_a_bad_number_is_refused_in_one_sentence(table, error, words):
    with pytest.raises(error) as caught:
        resolve(SCHEMA, table, "valve 'x'")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_nearest_key_is_named():
    with pytest.raises(UnknownName, match="did you mean 'period'"):
        valve_parameters(VALVES.load("intermittent"), {"S": 1, "J": 1, "perod": 3, "on": 1}, 1.0)
    with pytest.raises(UnknownName, match=r"unknown parameter 's'.*did you mean 'S'"):
        valve_parameters(VALVES.load("choudhury"), {"s": 1, "J": 1}, 1.0)


def test_a_choice_arrives_as_its_index_and_a_wrong_word_names_the_nearest():
    kind = Choice(("linear", "equal_percentage"))
    assert kind.read("equal_percentage", "type", "valve") == 1.0
    with pytest.raises(ParameterError, match="did you mean 'linear'"):
        kind.read("linaer", "type", "valve")


def test_resolved_parameters_survive_a_trip_to_another_process():
    p = resolve(SCHEMA, {"S": 5}, "valve", Ts=2.0)
    again = pickle.loads(pickle.dumps(p))
    assert again == p
    assert type(again) is type(p)
    assert p._fields == ("S", "T", "Ts")


@pytest.mark.parametrize(
    ("digits", "message"), [(400, "S = 1000000"), (5000, "S = a number of thousands of digits")]
)
def test_a_whole_number_too_large_for_a_float_is_refused(digits, message):
    with pytest.raises(
        ParameterError, match=rf"{message}.* is not finite, it must be within .* \(%\)"
    ):
        Number("%").read(10**digits, "S", "valve 'choudhury'")


def test_a_band_follows_from_the_forces_and_back():
    nan = float("nan")
    whole = {"S": 5.0, "J": 2.0, "fs": 3.5, "fd": 1.5}
    for given in (
        {"S": 5.0, "J": 2.0, "fs": nan, "fd": nan},
        {"S": nan, "J": nan, "fs": 3.5, "fd": 1.5},
    ):
        assert complete_band(given, "valve 'he'", ("fs", "fd"), 1.0) == whole
