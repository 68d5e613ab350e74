"""What tests of detectors share: a plain control loop with a sticky valve, slow and obvious, one sample at a time."""

import math
from pathlib import Path

import numpy as np
import pytest

from detectors.record import LoopRecord

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "real"


def plain_loop(
    S=5.0,
    J=2.0,
    process="self-regulating",
    K=1.0,
    T=10.0,
    Td=2.0,
    Kc=1.0,
    Ti=10.0,
    Ts=1.0,
    n=1500,
    noise=0.0,
    load=None,
    kick=4.0,
    seed=0,
    kind=None,
):
    """One run of a PI loop about OP = PV = 50 with the (S, J) valve of Choudhury 2005; S = J = 0 is an ideal valve."""
    random = np.random.default_rng(seed).standard_normal(n) * noise
    load = np.zeros(n) if load is None else load
    pole = math.exp(-Ts / T) if process == "self-regulating" else 1.0
    gain = K * (1.0 - pole) if process == "self-regulating" else K * Ts
    delay = round(Td / Ts)
    fs, fd = (S + J) / 2.0, (S - J) / 2.0
    x, valve, way, moving, before, integral = 0.0, 50.0, 0, False, 50.0, kick
    op, pv, mv = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        pv[k] = 50.0 + x + random[k]
        error = 50.0 - pv[k]
        integral += Kc * Ts / Ti * error
        wanted = 50.0 + Kc * error + integral
        u = min(max(wanted, 0.0), 100.0)
        integral += u - wanted
        if moving and (u - before) * way <= 0:
            moving = False
        if not moving and abs(u - valve) > fs:
            way, moving = (1, True) if u > valve else (-1, True)
        if moving:
            valve = u - way * fd
        before = u
        op[k], mv[k] = u, valve
        late = k - delay
        x = pole * x + (gain * (mv[late] - 50.0 + load[late]) if late >= 0 else 0.0)
    return LoopRecord(op=op, pv=pv, mv=mv, Ts=Ts, process=process, kind=kind, op_span=(0.0, 100.0), tag="plain loop")


@pytest.fixture(scope="session")
def loop():
    """The plain control loop as a function."""
    return plain_loop


@pytest.fixture(scope="session")
def real_folder():
    """Folder of the real records; tests on them are skipped where it is absent."""
    if not REAL.is_dir():
        pytest.skip(f"real records are not here ({REAL})")
    return REAL
