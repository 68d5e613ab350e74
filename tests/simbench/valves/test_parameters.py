import pickle

from simbench.loop.parameters import Number, resolve
from simbench.loop.physical.actuator import complete_band

SCHEMA = {
    "S": Number("% of travel", low=0.0, high=100.0, says="band"),
    "T": Number("s", low=0.0, positive=True, default=1.0),
}


def test_resolved_parameters_survive_a_trip_to_another_process():
    p = resolve(SCHEMA, {"S": 5}, "valve", Ts=2.0)
    again = pickle.loads(pickle.dumps(p))
    assert again == p
    assert type(again) is type(p)
    assert p._fields == ("S", "T", "Ts")


def test_a_band_follows_from_the_forces_and_back():
    nan = float("nan")
    whole = {"S": 5.0, "J": 2.0, "fs": 3.5, "fd": 1.5}
    for given in (
        {"S": 5.0, "J": 2.0, "fs": nan, "fd": nan},
        {"S": nan, "J": nan, "fs": 3.5, "fd": 1.5},
    ):
        assert complete_band(given, "valve 'he'", ("fs", "fd"), 1.0) == whole
