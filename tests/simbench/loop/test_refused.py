"""Loops that cannot be, whoever reads them: a change of a good loop, and what its one sentence
names.
"""

import pytest

from simbench.detectors.errors import UserError
from simbench.loop.simulate import simulate
from simbench.scenarios.errors import SpecError
from simbench.scenarios.spec import Loop

OUTER = {
    "plant": {"type": "foptd", "K": 1, "T": 60},
    "controller": {"type": "PI", "Kc": 1, "Ti": 60},
}
GOOD = {
    "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    "valve": {"model": "choudhury", "S": 5, "J": 2},
    "sampling": {"Ts": 1},
}
STICTION = {"name": "stiction", "S": 1.0, "J": 1.0}
SINE = {"type": "sine", "amplitude": 1, "period": 9}
ECHO = {"type": "echo", "valve": "choudhury", "S": 5.0, "J": 2.0}
LAG = {"name": "time_constant_mismatch", "factor": 1.2}
GAIN = {"name": "gain_mismatch", "factor": 2.0}


def plant(kind="foptd", **keys):
    return {"plant": {"type": kind, **keys}}


def in_z(**keys):
    return plant("tf", **{"num": [1], "den": [1, -0.2], "dt": 1} | keys)


def controller(kind="PI", **keys):
    return {"controller": {"type": kind, **keys}}


def outer(**changes):
    return {"outer": {**OUTER, **changes}}


WRONG = [
    ({"plnt": {}}, "unknown key 'plnt': did you mean 'plant'"),
    (plant("fopdt", K=1), "did you mean 'foptd'"),
    (plant("tnk", K=1, T=2), "tank"),
    (plant(K=1), "T is missing"),
    (plant(K=1, k=1, T=2), "'plant.k': did you mean 'K'"),
    (plant(K=-1, T=2), "positive feedback"),
    (plant(K=1, T=2, num=[1]), "belongs to"),
    (plant(K=1, T=5e-324), "T = 4.94066e-324 s is too small"),
    (plant("integrating", K=1, T=2), "no time constant"),
    (plant("tf", num=[1], den=[1, -1]), "unstable"),
    (plant("tf", num=[1, 0], den=[1, 2, 1]), "constant term"),
    (plant("tf", num=[1, 1], den=[1, 2]), "strictly proper"),
    (plant("tf", num=[1]), "den is missing"),
    (plant("tf", K=1, num=[1], den=[2, 1]), "K = 1"),
    (plant("tf", num=[-1], den=[2, 1]), "positive feedback"),
    (plant("tf", num=[1], den=[5e-324, 1]), "den begins with 4.94066e-324"),
    (plant("integrating", K=0.05, Td=2) | {"effect": [LAG]}, "no time constant"),
    (plant("tank", K=1.5, T=10) | {"effect": [GAIN]}, "tank"),
    (in_z(den=[1, -1.2]), "pole at z = 1.2; poles inside the unit circle"),
    (in_z(num=[1, 1]), "at most 1 are needed: PV answers after a sample"),
    (in_z(dt=2), "plant.dt = 2 s; the sampling period, Ts = 1 s, is needed"),
    (in_z(Td=0.5), "Td = 0.5 s is no whole number of samples"),
    (in_z() | {"effect": [GAIN]}, "stated in powers of z"),
    (controller("tf", num=[1, 0, 0], den=[1, -1], dt=1), "no OP answers to an error to come"),
    (controller("tf", num=[1], den=[1, -1]), "dt is missing"),
    (controller("tf", num=[1], den=[1, -1], dt=1, Kc=2), "Kc: a controller of type 'tf' has num"),
    (controller(Kc=1, Ti=2, num=[1]), "num belongs to a controller of type 'tf'"),
    (controller("PIDD", Kc=1), "PID"),
    (controller(Kc=1), "Ti is missing"),
    (controller(Kc=-1, Ti=2), "Kc"),
    (controller(Kc=1, Ti=2, Kp=1), "'controller.Kp': did you mean 'Kc'"),
    (controller(Kc=1, Ti=2, direction="direct"), "positive feedback"),
    (controller("P", Kc=1, Ti=2), "has none"),
    (controller("PID", Kc=1), "Ti is missing"),
    (controller(Kc=1, Ti=2, Td=1), "'PID' is needed"),
    (controller("PID", Kc=1, Ti=2, schedule=[[2, 1], [1, 2]]), "rising"),
    ({"valve": {"S": 1}}, "model"),
    ({"valve": {"modle": "kano"}}, "lacks the key 'model'"),
    ({"valve": {"model": "chodhury"}}, "choudhury"),
    ({"valve": {"model": "choudhury", "S": -1, "J": 0}}, "S = -1"),
    ({"valve": {"model": "choudhury", "S": 1, "J": -2}}, "J = -2"),
    ({"valve": {"model": "choudhury", "s": 1, "J": 1}}, "did you mean 'S'"),
    ({"valve": {"model": "deadband"}}, "needs S"),
    ({"noise": {"stdev": 1.0}}, "did you mean 'mv_std' or 'std'"),
    ({"setpoint": {"vale": 1.0}}, "did you mean 'value'"),
    ({"setpoint": {"steps": [[1]]}}, "setpoint.steps"),
    ({"operating_point": {"op": 1.0}}, "did you mean 'op0'"),
    ({"operating_point": {"op0": 120}}, "op0"),
    ({"sampling": {"Ts": 1, "warm_up": -1}}, "warm_up"),
    ({"sampling": {"Ts": 1, "warm_up": 1.5}}, "warm_up"),
    ({"sampling": {"Ts": 1, "warm_up": 10**9}}, "warm_up"),
    ({"disturbance": [SINE | {"type": "sinus"}]}, "did you mean 'sine'"),
    ({"disturbance": [SINE | {"period": 0}]}, "period"),
    ({"disturbance": [SINE | {"at": "inlet"}]}, "input"),
    ({"disturbance": [{"type": "echo", "S": 5.0, "J": 2.0}]}, "valve = None; the model of the"),
    ({"disturbance": [ECHO | {"S": 0.01, "J": 0.001}]}, "does not cycle"),
    ({"disturbance": [ECHO | {"kind": "flat"}]}, "flat"),
    ({"disturbance": [ECHO | {"cut": 0.0}]}, "cut = 0"),
    ({"disturbance": [ECHO | {"amplitude": 3.0}]},
     "disturbance 'echo': unknown parameter 'amplitude' in valve 'choudhury'"),
    ({"disturbance": [ECHO | {"valve": "chouhdury"}]}, "choudhury"),
    ({"disturbance": [ECHO, ECHO]}, "must be the last, and the only echo"),
    ({"disturbance": [ECHO, SINE]}, "must be the last, and the only echo"),
    ({"effect": [STICTION | {"name": "stictoin"}]}, "did you mean 'stiction'"),
    ({"effect": [STICTION]}, "'choudhury', which has friction already"),
    (outer() | {"setpoint": {"value": 50, "steps": [[1, 2]]}}, "outer.setpoint"),
    (outer() | {"setpoint": {"value": 150}}, "sp_span"),
    (outer(plant={"type": "foptd", "K": -1, "T": 2}), "positive feedback"),
    (outer(plant={"type": "tank", "K": 1, "T": 2}), "no plug-in"),
    (outer(sp_span=[5, 5]), "rising"),
    ({"outer": {"plant": OUTER["plant"]}}, "outer.controller"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), WRONG)
def test_a_loop_that_cannot_be_is_one_sentence(change, words):
    with pytest.raises((UserError, SpecError)) as error:
        simulate(Loop.from_table({**GOOD, **change}, "loop.toml"))
    assert words in str(error.value)
    assert "\n" not in str(error.value)
