"""Worlds: plant simulators that share no code with the product and judge its diagnosis.

`own` and `refinery` are two plants, `recipes` twenty sites, `nuisances` twenty more, which have
what the diagnosis stumbled over elsewhere. It has been calibrated on the first two, so they no
longer count as unseen data.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

from simbench.detectors.errors import ParameterError, nearest

NAMES = ("own", "refinery")
_INTERFACE = ("TITLE", "FOREIGN", "Item", "draw", "simulate")


def load_world(name: str) -> ModuleType:
    """Return the world of a name: one of this folder, or any module by its dotted name.

    Raises
    ------
    simbench.detectors.errors.ParameterError
        Where there is none, or it lacks a part of a world.
    """
    here = sorted(
        p.stem for p in Path(__file__).parent.iterdir() if not p.name.startswith(("_", "."))
    )
    if name not in here and "." not in name:
        raise ParameterError(f"world {name!r}: {nearest(name, here)}")
    try:
        module = importlib.import_module(name if "." in name else f"{__name__}.{name}")
    except ImportError as error:
        raise ParameterError(f"world {name!r} cannot be imported: {error}") from None
    lacking = [part for part in _INTERFACE if not hasattr(module, part)]
    if lacking:
        raise ParameterError(
            f"world {name!r} has no {lacking[0]}; a world has {', '.join(_INTERFACE)}"
        )
    return module
