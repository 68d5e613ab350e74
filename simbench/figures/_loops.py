"""Simulate the loops that several figures show."""

from typing import Any

from simbench.scenarios.spec import Loop


def pi_loop(
    *,
    K: float = 1.0,
    T: float | None = None,
    Td: float,
    Kc: float,
    Ti: float | None,
    Ts: float,
    n: int | None = None,
    **more: Any,
) -> Loop:
    """Return a PI loop around a first-order plant with dead time, for `n` samples, and what else it
    has; without T the plant integrates, without Ti the controller is P.
    """
    plant = {"type": "integrating"} if T is None else {"type": "foptd", "T": T}
    controller = {"type": "P"} if Ti is None else {"type": "PI", "Ti": Ti}
    return Loop.from_table(
        {
            "plant": {**plant, "K": K, "Td": Td},
            "controller": {**controller, "Kc": Kc},
            "sampling": {"Ts": Ts} if n is None else {"Ts": Ts, "n": n},
            **more,
        }
    )


def choudhury(S: float, J: float) -> dict[str, Any]:
    """Return the table of a valve with stick band `S` and slip jump `J` (% of travel)."""
    return {"model": "choudhury", "S": S, "J": J}


def sine(amplitude: float, period: float) -> list[dict[str, Any]]:
    """Return the table of a sine (s) at the plant's output."""
    return [{"type": "sine", "amplitude": amplitude, "period": period, "at": "output"}]
