"""The tables of the loops that the figures simulate."""

from __future__ import annotations

from typing import Any


def pi_table(
    *,
    T: float,
    Td: float,
    Kc: float,
    Ti: float,
    Ts: float,
    K: float = 1.0,
    n: int | None = None,
    **more: Any,
) -> dict[str, Any]:
    """Return the table of a PI loop around a first-order plant with dead time, for `n` samples, and
    what else it has.
    """
    return {
        "plant": {"type": "foptd", "K": K, "T": T, "Td": Td},
        "controller": {"type": "PI", "Kc": Kc, "Ti": Ti},
        "sampling": {"Ts": Ts} if n is None else {"Ts": Ts, "n": n},
        **more,
    }


def choudhury(S: float, J: float) -> dict[str, Any]:
    """Return the table of a valve with stick band `S` and slip jump `J` (% of travel)."""
    return {"model": "choudhury", "S": S, "J": J}


def sine(amplitude: float, period: float) -> list[dict[str, Any]]:
    """Return the table of a sine (s) at the plant's output."""
    return [{"type": "sine", "amplitude": amplitude, "period": period, "at": "output"}]
