"""Which rules of the gap diagnosis earn their place: one constant doubled or halved, or one rule
removed, at a time.

`python -m results.studies.rules -n 90` prints of each change that changes an answer in how many
records of three development worlds it changes the effect named first and its block, and how many
are right with it. `--only TEXT ...` takes those whose name holds one of the texts.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

import simbench.gap
from results.studies.mixture import THREE, Mixture
from results.studies.worlds import WORLDS
from simbench.blind.making import write_item
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.gap.decide.assess import Assessment, assess
from simbench.gap.decide.classify import classify
from simbench.gap.diagnosis import named_by
from simbench.gap.intake.check import check
from simbench.gap.situation import Situation
from simbench.loop.effects import NONE, UNKNOWN
from simbench.progress import Progress
from simbench.scenarios.spec import Loop, load_loop

SEED = 460201  # of the first world, named before anything was answered; the next ones' follow
PACKAGE = "simbench.gap."
# what is left of a rule that is removed
REMOVED: dict[str, Callable[..., Any]] = {
    "candidates._brought": lambda engine, base, fit: fit.loglik - base.loglik,
    "candidates.with_ordinary_load": lambda engine, base, found, stated=(): (base, found),
    "candidates.with_higher_order": lambda engine, base, found: (base, found),
    "closed_loop.gap.as_archived": lambda situation, op, pv: (op, pv),
    "controller.pi_law.rest_of_mean": lambda *signals: np.inf,
    "controller.pi_law.skips_scans": lambda *signals: False,
    "controller.pi_law.with_derivative": lambda *signals: np.inf,
}
# modules whose constants change no fit, so that the assessment is judged as it was made ...
_JUDGING = ("decide.classify",)
# ... and those that work before any fit: a record is assessed anew where its check differs
_CHECKING = ("controller", "sensor", "intake")
_COMPILED = "kernels"  # constants in compiled code cannot be changed


class Case(NamedTuple):
    """A record, its baseline, the effects that are right, and their block."""

    record: LoopRecord
    baseline: Loop
    effects: tuple[str, ...]
    block: str


class Answer(NamedTuple):
    """The effect named first, its block, and what was concluded from; no more where refused."""

    effect: str
    block: str = ""
    assessment: Assessment | None = None
    check: str = ""


def drawn(n: int) -> Iterator[Case]:
    """Yield the first `n` records, of each world in turn."""
    for i in range(n):
        seed, w = SEED + i % len(THREE), WORLDS.load(THREE[i % len(THREE)])
        entries = Mixture(seed, single=58, none=22, two=8, foreign=12).entries(list(w.FOREIGN))
        k = int(np.random.default_rng(seed).permutation(len(entries))[i // len(THREE)])
        item = w.draw(seed, i // len(THREE), entries[k])
        truth, foreign = item.answer, entries[k]["kind"] == "foreign"
        with TemporaryDirectory() as place:
            record, loop = write_item(item, Path(place), "record")
            right = (UNKNOWN,) if foreign else (truth["effect"], truth["effect2"])
            yield Case(read_record(record), load_loop(loop), right, truth["block"])


def answered(case: Case, before: Answer | None = None) -> Answer:
    """Diagnose a record, or return the last answer where its check finds what it found then."""
    try:
        situation = check(case.record, case.baseline)
        checked = _text(situation)
        if before is not None and checked == before.check:
            return before
        assessment = assess(situation)
        return judged(assessment, checked)
    except UserError as why:
        return Answer(f"refused: {why}")


def judged(assessment: Assessment, checked: str) -> Answer:
    """Return the answer that an assessment leads to."""
    weights = classify(assessment)
    first = named_by(weights, assessment)[0]
    return Answer(first, weights.block(first), assessment, checked)


def _text(s: Situation) -> str:
    known = (s.law, s.samples, s.archive, s.plant_pv, s.data, s.frozen, s.unexplained_law)
    with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
        return "\n".join(map(str, (*known, s.proven, s.notes)))


def again(case: Case, before: Answer, name: str) -> Answer:
    """Return the answer under a change, from as much of the last one as that leaves as it was."""
    if name.startswith(_JUDGING) and before.assessment is not None:
        return judged(before.assessment, before.check)
    return answered(case, before if name.startswith(_CHECKING) else None)


def _modules() -> dict[str, ModuleType]:
    names = [m.name for m in pkgutil.walk_packages(simbench.gap.__path__, PACKAGE) if not m.ispkg]
    return {name.removeprefix(PACKAGE): importlib.import_module(name) for name in names}


def changes(*only: str) -> Iterator[tuple[str, str, Any, Any]]:
    """Yield name, what is done, old and new value of each change."""
    for where, module in _modules().items():
        source = Path(str(module.__file__)).read_text(encoding="utf-8")
        for name, value in vars(module).items():
            full, number = f"{where}.{name}", type(value) in (int, float) and name.isupper()
            own = re.search(rf"^[A-Z_, ]*\b{name}\b[A-Z_, ]* = ", source, re.MULTILINE)
            if only and not any(text in full for text in only):
                continue
            if full in REMOVED:
                yield full, "removed", value, REMOVED[full]
            elif number and own and not where.endswith(_COMPILED):
                yield full, "doubled", value, 2 * value
                yield full, "halved", value, type(value)(0.5 * value)


@contextmanager
def changed(name: str, old: Any, new: Any) -> Iterator[None]:
    """Give a name another value in every module that has it with the old one."""
    name = name.rpartition(".")[2]
    holders = [m for m in _modules().values() if vars(m).get(name) is old]
    for m in holders:
        setattr(m, name, new)
    try:
        yield
    finally:
        for m in holders:
            setattr(m, name, old)


def line(cases: Sequence[Case], before: Sequence[Answer], after: Sequence[Answer]) -> str:
    """Return how many effects and blocks a change changes; then right ones, none and unknown."""
    pairs, told = list(zip(before, after, strict=True)), list(zip(cases, after, strict=True))
    effects = sum(a.effect != b.effect for a, b in pairs)
    blocks = sum(a.block != b.block for a, b in pairs)
    first = sum(a.effect in c.effects for c, a in told)
    block = sum(a.effect in c.effects or a.block == c.block for c, a in told)
    none, unknown = (sum(a.effect == name for a in after) for name in (NONE, UNKNOWN))
    return f"{effects:7d} {blocks:6d}   {first:5d} {block:5d} {none:4d} {unknown:7d}"


def main(argv: Sequence[str] | None = None) -> None:
    """Print what each change changes; those that change nothing are named at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=90, help="Records.")
    parser.add_argument("--only", nargs="*", default=[], help="Texts in the names of changes.")
    asked = parser.parse_args(argv)
    cases = list(drawn(asked.n))
    before = [answered(case) for case in Progress(cases, delay=1.0)]
    print(f"{asked.n} records, seeds {SEED} to {SEED + 2}; changed effects and blocks, then right")
    print(f"              effect  block   first block none unknown\n{'':12s} ", end="")
    print(f"{line(cases, before, before)}  as it is")
    idle = []
    for name, what, old, new in changes(*asked.only):
        with changed(name, old, new):
            after = [again(case, one, name) for case, one in zip(cases, before, strict=True)]
        if [a[:2] for a in after] == [b[:2] for b in before]:
            idle.append(f"{name} {what}")
        else:
            print(f"{what:12s} {line(cases, before, after)}  {name}", flush=True)
    print(textwrap.fill("no answer changes: " + (", ".join(idle) or "-"), 100))


if __name__ == "__main__":
    main()
