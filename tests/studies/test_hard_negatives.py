"""Hard negatives read back from their files, and the committed ones replayed."""

import math
from importlib import import_module
from pathlib import Path

import pytest

from results.studies.hard_negatives import HARD_NEGATIVES, read_case, recorded
from simbench.detectors.plugins.registry import methods
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop


def test_every_method_has_its_case():
    # the files of the folder: another test may have registered another detector
    folder = Path(import_module(methods.package).__path__[0])
    names = sorted(p.stem for p in folder.glob("*.py") if not p.stem.startswith("_"))
    assert sorted(p.stem for p in HARD_NEGATIVES.glob("*.toml")) == names


@pytest.mark.parametrize("path", sorted(HARD_NEGATIVES.glob("*.toml")), ids=lambda p: p.stem)
def test_committed_cases_replay(path):
    committed, case = recorded(path), read_case(path)
    assert isinstance(case.loop, Loop)
    assert not simulate(case.loop, case.seed).sticky
    hint = (
        f"the method changed: python -m results.studies.hard_negatives {case.method} (or --rejudge)"
    )
    assert (case.method, case.verdict.verdict) == (path.stem, committed["verdict"]), hint
    if math.isfinite(committed["score"]):
        # another library may round otherwise; verdicts are not that close to their thresholds
        assert case.score == pytest.approx(committed["score"], rel=1e-3, abs=1e-6), hint
