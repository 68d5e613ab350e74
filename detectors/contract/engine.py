"""Check a plug-in of any kind against the table of rules for its kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from simbench.detectors.contract.watch import call_guarded
from simbench.detectors.plugins.registry import PluginFolder


class Fault(NamedTuple):
    """What a plug-in does wrong in one case."""

    what: str
    where: str


Found = Iterable[str | Fault]
# of a plug-in, by its name; and of it in a case
Description = Callable[[str, ModuleType], Found]
Behaviour = Callable[[str, ModuleType, Any], Found]


@dataclass(frozen=True)
class Contract:
    """Whether a plug-in keeps its contract."""

    kind: str  # "detector", "valve", "effect", "plant", "controller" or "grid"
    name: str
    broken: tuple[str, ...]  # one sentence for every point that does not hold
    notes: tuple[str, ...] = ()  # what is no breach and still good to know

    @property
    def kept(self) -> bool:
        """Whether no point is broken."""
        return not self.broken

    def as_json(self) -> dict[str, Any]:
        """Return the findings as JSON types."""
        return {
            "kind": self.kind,
            "name": self.name,
            "kept": self.kept,
            "broken": list(self.broken),
            "notes": list(self.notes),
        }

    def as_text(self) -> str:
        """Return the findings, one line each."""
        summary = (
            "keeps its contract"
            if self.kept
            else f"breaks its contract in {len(self.broken)} places"
        )
        lines = [f"{self.kind} {self.name}: {summary}".replace("in 1 places", "in one place")]
        return "\n".join(
            [
                *lines,
                *(f"  broken: {b}" for b in self.broken),
                *(f"  note: {n}" for n in self.notes),
            ]
        )


@dataclass(frozen=True)
class ContractRules:
    """What plug-ins of one kind must keep.

    `description`: rules on what a file says of itself; each is asked only where those before hold,
    and the others only where all do. `behaviour`: rules on what it does in each of the `cases`;
    with `first_alone` none is asked after one that does not hold. `where` says in words which case
    it was.
    """

    kind: str
    folder: PluginFolder
    description: tuple[Description, ...]
    behaviour: tuple[Behaviour, ...]
    cases: Callable[[ModuleType], Iterable[Any]] = lambda module: [None]
    where: Callable[[Any], str] = lambda case: ""
    first_alone: bool = False
    notes: Callable[[str, ModuleType], Iterable[str]] = lambda name, module: ()

    def check(self, name: str) -> Contract:
        """Check an installed plug-in by its name."""
        module = self.folder.load(name)
        for rule in self.description:
            if broken := each_once(rule(name, module)):
                return Contract(self.kind, name, broken)
        broken = each_once(self._behaves(name, module))
        return Contract(self.kind, name, broken, tuple(self.notes(name, module)))

    def check_added(self, path: str | Path) -> Contract:
        """Import a file as a plug-in and check it; what it does besides is broken too."""
        name = Path(path).stem
        added = call_guarded(lambda: self.folder.add_file(path))
        if added.refusal is not None:
            raise added.refusal
        try:
            contract = self.check(name)
        finally:
            self.folder.forget(name)
        besides = (f"{fault}, when imported" for fault in added.faults)
        return replace(contract, broken=(*besides, *contract.broken))

    def _behaves(self, name: str, module: ModuleType) -> Iterator[str | Fault]:
        for case in self.cases(module):
            where = self.where(case)
            held = True
            for rule in self.behaviour:
                for found in rule(name, module, case):
                    held = False
                    yield Fault(found, where) if isinstance(found, str) else found
                if self.first_alone and not held:
                    return


def each_once(found: Found) -> tuple[str, ...]:
    """Return each sentence once, and a fault of several cases with the first of them and their
    number.
    """
    places: dict[str, list[str]] = {}
    for one in found:
        what, where = (one, "") if isinstance(one, str) else one
        places.setdefault(what, []).append(where)
    out = []
    for what, where in places.items():
        more = len(set(where)) - 1
        others = f", and in {more} other case{'s' * (more > 1)}" if more else ""
        out.append(f"{what}, {where[0]}{others}" if where[0] else what)
    return tuple(out)
