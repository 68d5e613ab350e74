"""Check a plug-in against the contract for its kind: detector, valve, effect, plant, controller or
grid.
"""

import ast
from pathlib import Path

from simbench.contract.grid import check_grid
from simbench.contract.part import PART_RULES
from simbench.detectors.contract.detector import DETECTOR_RULES
from simbench.detectors.contract.engine import Contract
from simbench.detectors.errors import ParameterError, nearest
from simbench.detectors.plugins.host import Host, PluginError
from simbench.detectors.plugins.registry import PluginFolder
from simbench.lazy import called_as

called_as(__name__, "simbench.verbs")

CONTRACT_SECONDS = 600.0  # for all that is asked of one plug-in
CONTRACTS = {rules.kind: rules for rules in (DETECTOR_RULES, *PART_RULES)}


def check(kind: str, name: str) -> Contract:
    """Check an installed plug-in against the contract of its kind.

    Parameters
    ----------
    kind : str
        "detector", "effect", "valve", "plant" or "controller".
    name : str
        Id of the plug-in, as `simbench list` shows it.

    Returns
    -------
    Contract
        kept, broken (one sentence for every point that does not hold) and notes.

    Raises
    ------
    simbench.detectors.errors.UserError
        When the kind or the name is unknown.

    Examples
    --------
    >>> check("valve", "kano").broken
    ()
    """
    if kind not in CONTRACTS:
        raise ParameterError(f"contract: kind {kind!r}; {nearest(kind, CONTRACTS)}")
    return CONTRACTS[kind].check(name)


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
    rules = CONTRACTS[kind]
    defined = _top_names(path)
    missing = [name for name in rules.folder.required if name not in defined]
    if missing:
        return Contract(
            kind,
            path.stem,
            (f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not defined",),
        )
    return rules.check(path.stem) if rules.folder.own_file(path) else rules.check_added(path)


def check_in_subprocess(path: str | Path, seconds: float = CONTRACT_SECONDS) -> Contract:
    """Check one file as `check_file` does, a detector in a worker process: one that ends it or
    never answers breaks its contract.
    """
    kind = kind_of(path)
    if kind != "detector":
        return check_file(path)
    path = Path(path).resolve()
    host = Host(None, str(path))
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
    defined = _top_names(path)
    kind = max(CONTRACTS, key=lambda k: _share(CONTRACTS[k].folder, defined))
    if _share(CONTRACTS[kind].folder, defined) < 0.5:
        needs = "; ".join(f"a {k} {', '.join(r.folder.required)}" for k, r in CONTRACTS.items())
        raise ParameterError(f"{path} is no plug-in by what it defines; needed are for {needs}")
    return kind


def _share(folder: PluginFolder, defined: set[str]) -> float:
    return sum(name in defined for name in folder.required) / len(folder.required)


def _top_names(path: Path) -> set[str]:
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
