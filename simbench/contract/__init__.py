"""Check a plug-in against the contract for its kind: detector, valve, effect, plant, controller or
grid.
"""

import ast
from collections.abc import Callable
from pathlib import Path

from simbench.contract.effect import check_effect
from simbench.contract.grid import check_grid
from simbench.contract.law import check_controller, check_plant
from simbench.contract.valve import check_valve
from simbench.detectors.contract.detector import Contract, check_added, check_detector
from simbench.detectors.errors import ParameterError
from simbench.detectors.plugins.host import Host, PluginError
from simbench.detectors.plugins.registry import PluginFolder, methods
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import CONTROLLER_PLUGINS, PLANT_PLUGINS, VALVES

CONTRACT_SECONDS = 600.0  # for all that is asked of one plug-in
# an effect may hold a valve's steps too: the kind of which most is there, the first of equals
CONTRACTS: dict[str, tuple[PluginFolder, Callable[[str], Contract]]] = {
    "detector": (methods, check_detector),
    "effect": (EFFECTS, check_effect),
    "valve": (VALVES, check_valve),
    "plant": (PLANT_PLUGINS, check_plant),
    "controller": (CONTROLLER_PLUGINS, check_controller),
}


def check_file(path: str | Path) -> Contract:
    """Check one file against the contract of its kind.

    Examples
    --------
    >>> from simbench.loop.valves import deadband
    >>> check_file(deadband.__file__).kept
    True
    """
    path, kind = Path(path), kind_of(path)
    if kind == "grid":
        return check_grid(path)
    (folder, check), defined = CONTRACTS[kind], _defined(path)
    missing = [name for name in folder.required if name not in defined]
    if missing:
        return Contract(
            kind,
            path.stem,
            (f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not defined",),
        )
    return check(path.stem) if folder.own_file(path) else check_added(folder, check, path)


def check_in_subprocess(path: str | Path, seconds: float = CONTRACT_SECONDS) -> Contract:
    """Check one file as `check_file` does, in a worker process: a file that ends it or never
    answers breaks its contract.
    """
    kind = kind_of(path)
    if kind == "grid":
        return check_file(path)
    path = Path(path).resolve()
    host = Host(None, [(kind, str(path))])
    try:
        return host.call(check_file, str(path), seconds=seconds)
    except PluginError as error:
        return Contract(kind, path.stem, (str(error),))
    finally:
        host.close()


def kind_of(path: str | Path) -> str:
    """Return of which kind a plug-in is by what it defines; nothing of it is run."""
    path = Path(path)
    if path.suffix == ".toml":
        return "grid"
    defined = _defined(path)
    kind = max(CONTRACTS, key=lambda k: _share(CONTRACTS[k][0], defined))
    if _share(CONTRACTS[kind][0], defined) < 0.5:
        needs = "; ".join(f"a {k} {', '.join(f.required)}" for k, (f, _) in CONTRACTS.items())
        raise ParameterError(f"{path} is no plug-in by what it defines; needed are for {needs}")
    return kind


def _share(folder: PluginFolder, defined: set[str]) -> float:
    return sum(name in defined for name in folder.required) / len(folder.required)


def _defined(path: Path) -> set[str]:
    """Return the names a Python file defines at its top, without importing it."""
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise ParameterError(
            f"{path} cannot be read: {why}; a Python file, or the TOML file of a grid, is needed"
        ) from None
    except (SyntaxError, ValueError) as error:
        raise ParameterError(f"{path} is no Python file: {error}") from None
    names: set[str] = set()
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {a.asname or a.name for a in node.names}
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {
                t.id for target in targets for t in ast.walk(target) if isinstance(t, ast.Name)
            }
    return names
