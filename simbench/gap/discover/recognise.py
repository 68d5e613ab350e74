"""Make the diagnosis fit effects from plug-in files; an effect that states a known model form is
fitted like that model.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

from simbench.gap.closed_loop.gap import held_out
from simbench.gap.discover.families import families, fitted
from simbench.gap.discover.search import FINDERS
from simbench.gap.effects import Parameters, Recogniser, lent
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation, load_memory
from simbench.loop.effects import EFFECTS, PLUGINS
from simbench.loop.laws import LAW_FORMS


@contextmanager
def effects_known(files: Iterable[str | Path]) -> Iterator[list[str]]:
    """Make the diagnosis fit the effects in these files while the block lasts; yield their ids.
    They run in this process, as the user asked.
    """
    with ExitStack() as stack:
        names = []
        for file in files:
            name = PLUGINS.add_file(file)
            stack.callback(EFFECTS.forget_all)
            stack.callback(PLUGINS.forget, name)
            form = getattr(PLUGINS.load(name), "FORM", "")
            if form in LAW_FORMS:
                stack.enter_context(lent(name, Recogniser(by_innovations=partial(_seen, form))))
            names.append(name)
        EFFECTS.forget_all()
        yield names


def _seen(form: str, base: Fit, s: Situation) -> tuple[float, Parameters] | None:
    """Return nats and numbers of a form of law in a whole record; None where it shows nothing of
    it.
    """
    first = held_out(s)
    for find in FINDERS:
        law = find(s, first)
        if law is not None and law.form == form:
            return law.nats, dict(law.numbers)
    engine = Engine(s.data, load_memory(s))
    tried = [fitted(family, engine, base) for family in families(s, first) if family.form == form]
    best = max(tried, key=lambda law: law.gain, default=None)
    return None if best is None else (best.gain, dict(best.family.numbers(best.fit)))
