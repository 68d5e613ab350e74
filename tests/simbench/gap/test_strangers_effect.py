"""A stranger's effect: two files in a package of its own, and it is simulated, listed, fitted,
ranked and found.
"""

import json
import os
import subprocess
import sys
from textwrap import dedent

import pytest

DOES = '''
"""Slew limit: the valve moves no faster than its actuator can drive it."""

import sys

from simbench.loop.parameters import Number

SOURCE = "a stranger's two files"
BLOCK = "valve"
PARAMETERS = {"rate": Number("%/s", low=0.0, identity=1e6, says="largest speed", positive=True)}
ACTS = "loop"


def apply(setup, p, rng):
    setup.add_valve(sys.modules[__name__], {"rate": p.rate})


def start(u0, p):
    return (u0,)


def step(u, state, p):
    most = p.rate * p.Ts
    return (max(min(u, state[0] + most), state[0] - most),)
'''

RECOGNISED = '''
"""Slew limit recognised: MV that runs behind OP at one speed."""

import numpy as np

from simbench.gap.effects import Recogniser
from simbench.gap.likelihood.model import Free, Moves, Spec


def slewed(u, theta):
    v, most = u[0], theta["slew"]
    out = []
    for x in u.tolist():
        v = max(min(x, v + most), v - most)
        out.append(v)
    return np.array(out)


def fastest(d):
    return float(np.abs(np.diff(d.u)).max()) + 1e-6


SLEW = Free("slew", lambda d: 1e-4 * fastest(d), fastest, log=True)


def fit(engine, base):
    spec = base.spec.join(Spec(moves=Moves(slewed, (SLEW,))))
    points = [{"slew": fastest(engine.data) * share} for share in np.geomspace(0.005, 0.4, 10)]
    return engine.fit(spec, engine.grid(spec, base.theta, points)[0].theta), 1.0


def by_mv(search):
    rates = np.geomspace(0.001, 1.0, 60) * np.abs(np.diff(search.op)).max()
    for _ in range(4):
        level, best = min((search.level(slewed(search.op, {"slew": r})), r) for r in rates)
        step = rates[1] / rates[0]
        rates = best * np.geomspace(1 / step, step, 21)
    return search.priced(level, {"rate": float(best / search.Ts)}, 1.0)


RECOGNISER = Recogniser(
    fit=fit,
    numbers=lambda fit, s: {"rate": fit.theta["slew"] / s.record.Ts},
    by_mv=by_mv,
)
'''

WORK = """
import json, sys

from simbench.scenarios.spec import Loop
from simbench.cli.catalogue import catalogue
from simbench.gap import diagnose
from simbench.loop.simulate import simulate

table = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 700},
    "noise": {"std": 0.1},
    "setpoint": {
        "value": 50.0,
        "steps": [[t, 50.0 + 5.0 * (i % 2)] for i, t in enumerate(range(70, 700, 90))],
    },
    "disturbance": [{"type": "coloured", "amplitude": 0.5, "period": 30.0}],
}
limited = Loop.from_table({**table, "effect": [{"name": "stroke_limit", "rate": 0.1}]})
record, free = simulate(limited, seed=1).record, simulate(Loop.from_table(table), seed=1).record
baseline = Loop.from_table({**table, "disturbance": []})
out = {"listed": [row["name"] for row in catalogue("effects")]}
out["moved"] = float(abs(record.mv - free.mv).max())
out["fastest"] = float(abs(record.mv[1:] - record.mv[:-1]).max())
records = {"blind": record.without_mv(), "with mv": record, "clean": free.without_mv()}
for name in sys.argv[1:]:
    report = diagnose(records[name], baseline)
    out[name] = {**report.as_json(), "text": report.as_text()}
print(json.dumps(out))
"""


@pytest.fixture(scope="module")
def ask(tmp_path_factory):
    """A function that diagnoses records in a process which knows the stranger's package."""
    place = tmp_path_factory.mktemp("site")
    package, about = place / "stranger", place / "stranger-1.0.dist-info"
    for folder in (package, about):
        folder.mkdir()
    (package / "__init__.py").write_text("")
    (package / "stroke_limit.py").write_text(DOES.lstrip())
    (package / "stroke_limit_recognised.py").write_text(RECOGNISED.lstrip())
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(
        dedent("""
            [simbench.effects]
            stroke_limit = stranger.stroke_limit
            [simbench.recognised]
            stroke_limit = stranger.stroke_limit_recognised
        """)
    )
    single = {"PYTHONPATH": str(place), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}

    def diagnosed(*names):
        words = [sys.executable, "-c", WORK, *names]
        done = subprocess.run(
            words, capture_output=True, text=True, timeout=300, env=os.environ | single
        )
        assert done.returncode == 0, done.stderr[-3000:]
        return json.loads(done.stdout)

    return diagnosed


@pytest.fixture(scope="module")
def answer(ask):
    return ask("with mv")


def test_it_is_listed_and_simulated(answer):
    assert "stroke_limit" in answer["listed"]
    assert answer["moved"] > 1.0
    assert answer["fastest"] == pytest.approx(0.1)


def named_with_its_size(report):
    assert (report["effect"], report["block"]) == ("stroke_limit", "valve")
    assert report["effects"][0]["parameters"]["rate"] == pytest.approx(0.1, rel=0.1)
    assert report["ranking"][0]["effect"] == "stroke_limit"
    assert len(report["ranking"]) == 29
    assert sum(r["probability"] for r in report["ranking"]) == pytest.approx(1.0)
    assert report["shrinkage"]["value"] > 0.5
    assert "stroke limit" in report["text"]
    return True


def test_with_mv_it_is_fitted_ranked_and_named_with_its_size(answer):
    assert named_with_its_size(answer["with mv"])


@pytest.mark.slow
def test_without_mv_it_is_named_too_and_never_where_it_is_absent(ask):
    answer = ask("blind", "clean")
    assert named_with_its_size(answer["blind"])
    assert answer["clean"]["effect"] == "none"
