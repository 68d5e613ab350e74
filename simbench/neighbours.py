"""Say in one sentence that a folder of the user hides a package that simbench needs."""

from importlib.util import find_spec
from pathlib import Path

_NEEDED = ("detectors", "scenarios")  # installed next to simbench, under names that others use too


def refuse_hidden_packages() -> None:
    """Raise ImportError where another package stands in the place of one that simbench needs."""
    place = Path(__file__).resolve().parents[1]
    for name in _NEEDED:
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue
        there = Path(spec.origin).resolve()
        if there.parents[1] != place:
            raise ImportError(
                f"simbench needs its own package {name!r}, which {there.parent} hides; rename that"
                " folder, or start the script from another one"
            )
