"""What to try: loops and scenarios as numbers and names, and grids of them in TOML."""

from scenarios.errors import SpecError
from scenarios.spec import Loop, Scenario, load_loop

__all__ = ["Loop", "Scenario", "SpecError", "load_loop"]
