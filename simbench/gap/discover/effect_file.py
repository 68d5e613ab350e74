"""Write an empirical model as an effect plug-in: a Python file that the simulator runs and the
diagnosis can fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from simbench.detectors.errors import ParameterError
from simbench.files import whole_file
from simbench.gap.law import FoundLaw
from simbench.loop.effects import PLUGINS
from simbench.loop.laws import LAW_FORMS

_TEXT = '''"""{name}: {says}.

{evidence}
"""

from simbench.loop.laws import apply_law, law_parameters

SOURCE = "{source}"
BLOCK, ACTS = "{block}", "loop"
FORM = "{form}"
PARAMETERS = law_parameters(FORM, {numbers})


def apply(setup, p, rng):
    """Do what the law says, with its numbers or those of the loop file."""
    apply_law(FORM, setup, p, rng)
'''


def refuse_effect_file(path: str | Path) -> None:
    """Refuse, before any work, a file whose name can be no effect's."""
    stem = Path(path).stem
    if Path(path).suffix != ".py" or not stem.isidentifier() or stem != stem.lower():
        raise ParameterError(
            f"--write-effect {path}: a Python file of small letters, digits and _ is needed, like"
            " my_law.py"
        )
    if stem in PLUGINS.names() or stem in PLUGINS.reserved:
        raise ParameterError(
            f"--write-effect {path}: the effect {stem!r} is known already; another name is needed"
        )


def write_effect(law: FoundLaw, path: str | Path, evidence: str, source: str) -> None:
    """Write a law as an effect's file."""
    form, name = LAW_FORMS[law.form], Path(path).stem.replace("_", " ").capitalize()
    text = _TEXT.format(
        name=name, says=form.says, evidence=evidence, source=source.replace('"', "'"),
        block=form.block, form=law.form,
        numbers=", ".join(f"{k}={float(v)!r}" for k, v in law.numbers.items()),
    )  # fmt: skip
    with whole_file(path) as f:
        f.write(text)


@contextmanager
def lent_effect(law: FoundLaw) -> Iterator[str]:
    """Make a law known as an effect while the block lasts, by the very file that would be written;
    yield its id.
    """
    name = "law_of_this_record"
    with TemporaryDirectory() as place:
        file = Path(place) / f"{name}.py"
        write_effect(law, file, "", "fitted")
        PLUGINS.add_file(file)
        try:
            yield name
        finally:
            PLUGINS.forget(name)
