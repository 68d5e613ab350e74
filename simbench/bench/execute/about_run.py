"""What a manifest says of a run: its code, its methods, and their thresholds."""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from simbench.bench.execute.run_options import RunOptions
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.score.shipped import REFERENCE
from simbench.bench.store.benchmark import grid_settings
from simbench.bench.store.folder import file_digest
from simbench.bench.store.manifest import describe
from simbench.detectors.errors import masked, printable
from simbench.detectors.method import Method
from simbench.detectors.plugins.registry import methods as registry
from simbench.scenarios.expansion import Grid
from simbench.scenarios.sample import Sample


def describe_run(
    plan: Grid, names: Sequence[str], digests: Mapping[str, str], options: RunOptions
) -> dict[str, Any]:
    """Return the manifest: everything that decides the numbers of the run."""
    asked = {**(options.get("sets") or {}), **(options.get("axes") or {})}
    return describe(
        {
            **grid_settings(plan, asked),
            "scenarios": len(plan),
            "methods": {n: about_method(n) for n in names},
            "plugins": digests,
            "command": printable(masked(" ".join(sys.argv))),
            **({"points": plan.points} if isinstance(plan, Sample) else {}),
            **({REFERENCE: True} if options.get("with_reference") else {}),
        }
    )


def digests_of(*kinds: tuple[str, Iterable[str]]) -> dict[str, str]:
    """Return each file's digest; one that is not there is refused by name when it is hosted."""
    digests = {}
    for kind, files in kinds:
        for f in files:
            if Path(f).is_file():
                digests[f"{kind}{Path(f).stem}"] = file_digest(Path(f))
    return digests


def digests_of_own(own: Mapping[str, Any]) -> dict[str, str]:
    """Return a digest of each of the caller's detectors, by its name."""
    return {f"own {name}": _source_digest(detector) for name, detector in own.items()}


def _source_digest(detector: Any) -> str:
    """Return a digest of a caller's detector: of its source, and of its parameters where it has
    any.
    """
    if hasattr(detector, "get_params"):
        parameters = detector.get_params(deep=False)
    else:
        parameters = getattr(detector, "__dict__", {})
    try:
        source = inspect.getsource(detector if inspect.isfunction(detector) else type(detector))
    except (OSError, TypeError):  # typed into a shell
        source = repr(getattr(getattr(detector, "__code__", None), "co_code", detector))
    return hashlib.sha256(f"{source}{parameters}".encode()).hexdigest()


def about_method(name: str) -> dict[str, Any]:
    """Return what a run's manifest keeps of a method."""
    # The oracle is no plug-in: what it is stands here
    oracle: dict[str, Any] = {
        "front_end": False,
        "needs_mv": False,
        "role": ORACLE,
        "budget": "full",
        "fitted_on": [],
        "stated": [],
        "division": "reference",
    }
    if name == ORACLE:
        return oracle

    # A detector by its declaration
    method = registry.load(name).METHOD
    about = {}
    for key in oracle:
        about[key] = getattr(method, key)
    about = {key: list(v) if oracle[key] == [] else v for key, v in about.items()}
    return about | {"changed": _thresholds_of_variant(name, method), "source": method.source}


def _thresholds_of_variant(name: str, method: Method) -> dict[str, float]:
    """Return the thresholds in which a variant, such as NAME@published, differs from NAME."""
    base = name.partition("@")[0]
    if base == name or base not in registry.names():
        return {}
    before = registry.load(base).METHOD.defaults()
    changed = {}
    for k, v in method.defaults().items():
        if before.get(k) != v:
            changed[k] = v
    return changed
