"""Check whether the file of a detector keeps its contract."""

from __future__ import annotations

import traceback
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError, UserError
from simbench.detectors.example_loop import example_record
from simbench.detectors.plugins.registry import methods
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import RECORDED_SIGNALS, LoopRecord
from simbench.detectors.verdict import Verdict, wrong_types

_UNIT = (-30.0, 2000.0)  # factor and offset of PV in another unit


@dataclass(frozen=True)
class Contract:
    """Whether a detector keeps its contract."""

    name: str
    broken: tuple[str, ...]  # one sentence, with its line, for every point that does not hold

    @property
    def kept(self) -> bool:
        """Whether no point is broken."""
        return not self.broken

    def as_json(self) -> dict[str, Any]:
        """Return the findings as JSON types."""
        found = {"name": self.name, "kept": self.kept, "broken": list(self.broken)}
        return {"kind": "detector", **found}

    def as_text(self) -> str:
        """Return the findings, one line each."""
        summary = "keeps its contract" if self.kept else "breaks its contract"
        return "\n".join([f"detector {self.name}: {summary}"] + [f"  {b}" for b in self.broken])


def check_detector(path: str | Path) -> Contract:
    """Check the file of a detector; parameters, errors and example as in `simbench.contract`."""
    path = Path(path)
    name = path.stem

    # a file of the package is known already
    if methods.own_file(path):
        return Contract(name, _list_faults(methods.load(name), path))

    # one that is not there is no detector; one that does not load breaks its contract
    if not path.is_file():
        raise ParameterError(f"{path} does not exist; the Python file of a detector is needed")
    if path.suffix != ".py":
        raise ParameterError(f"{path} is no Python file; one that ends in .py is needed")
    try:
        with methods.added([path]):
            return Contract(name, _list_faults(methods.load(name), path))
    except UserError as why:
        cause = why.__cause__
        if cause is None:
            line = _line_of(path, "METHOD")
        else:
            line = _line_in(path, cause)
        return Contract(name, (f"{line}: {why}",))


def _list_faults(module: ModuleType, path: Path) -> tuple[str, ...]:
    """Return what a detector does wrong on plain records, once each."""
    line = _line_of(path, "def detect")
    found: dict[str, None] = {}
    for process in module.METHOD.process:
        sticky = example_record("stiction", process)
        rescaled = replace(sticky, pv=_UNIT[0] * sticky.pv + _UNIT[1])
        healthy = example_record("healthy", process)
        records = {"sticky": sticky, "healthy": healthy, "rescaled": rescaled}
        records["dead"] = example_record("constant", process)

        # what it answers to each, twice
        words = {}
        for case, record in records.items():
            try:
                first, other = (_ask_detector(module, record) for _ in range(2))
            except UserError as refusal:
                if case != "dead":  # of which it may refuse to say anything
                    found[f"{line}: detect refuses a {case} record ({refusal})"] = None
                continue
            except (Exception, SystemExit) as error:
                what = f"detect raises {type(error).__name__} on a {case} record ({error})"
                found[f"{_line_in(path, error)}: {what}"] = None
                continue
            found |= dict.fromkeys(f"{line}: detect {wrong}" for wrong in wrong_types(first))
            if isinstance(first, Verdict):
                words[case] = first.verdict
                if repr(first) != repr(other):
                    found[f"{line}: detect answers otherwise when asked twice ({case})"] = None

        # what it says must not follow PV's unit
        if words.get("sticky") != words.get("rescaled"):
            found[f"{line}: detect follows PV's unit: another verdict on a rescaled record"] = None
    return tuple(found)


def _ask_detector(module: ModuleType, record: LoopRecord) -> Any:
    """Return what a detector answers; ValueError where it writes into the record."""
    # The record as the method may see it, and a copy of its signals
    if module.METHOD.needs_mv:
        seen = record
    else:
        seen = record.without_mv()
    before = {}
    for name in RECORDED_SIGNALS:
        signal = getattr(seen, name)
        if signal is not None:
            before[name] = np.array(signal)

    # The answer, and whether the record is as it was
    answer = module.detect(Prepared(seen), **module.METHOD.defaults())
    for signal, values in before.items():
        if not np.array_equal(values, getattr(seen, signal), equal_nan=True):
            raise ValueError(f"it writes into {signal} of its input")
    return answer


def _line_of(path: Path, start: str) -> str:
    """Return in words the line of a file that begins with some words."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    return f"line {next((k for k, x in enumerate(lines, 1) if x.startswith(start)), 1)}"


def _line_in(path: Path, error: BaseException) -> str:
    """Return in words the last line of a file that an error passed."""
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    inside = []
    for f in frames:
        if Path(f.filename).resolve() == path.resolve():
            inside.append(f.lineno)
    return f"line {inside[-1] if inside else 1}"
