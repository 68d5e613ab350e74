"""The story of a diagnosis that asked, and the page of a plan: every sentence and number is the
report's or the plan's.
"""

from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap.planning.order import PlannedTests
from simbench.gap.report.plan_page import write_plan_page
from simbench.gap.report.story import story
from simbench.html.document import as_html


def report(sentence, asked=None, notes=(), **p):
    ranking = [SimpleNamespace(effect=e, probability=x) for e, x in p.items()]
    assessment = SimpleNamespace(situation=SimpleNamespace(record=SimpleNamespace(tag="FIC <1>")))
    return SimpleNamespace(
        ranking=ranking,
        next_test=asked,
        notes=notes,
        sentence=lambda: sentence,
        behind=SimpleNamespace(found=assessment),
    )


@pytest.fixture(scope="module")
def bump():
    rng = np.random.default_rng(0)
    record = LoopRecord(
        op=50 + rng.standard_normal(80), pv=rng.standard_normal(80), Ts=1.0, sp=np.zeros(80)
    )
    return SimpleNamespace(name="bump.csv", id="bump", record=record, manual=np.arange(80) > 30)


def test_the_story_shows_what_was_believed_asked_run_and_changed(bump):
    asked = {"says": "bump OP by 2 %"}
    before = report("It may be drift.", asked, drift=0.4, valve_lag=0.35)
    notes = ("test: bump.csv is said", "other")
    after = report("It is valve lag.", notes=notes, drift=0.02, valve_lag=0.95, noise=0.001)
    text = unescape(as_html(story(after, before, [bump]), "story"))
    for words in (
        "It may be drift.",
        "bump OP by 2 %",
        "bump.csv (bump)",
        "It is valve lag.",
        "0.950",
        "0.350",
    ):
        assert words in text
    assert "test: bump.csv is said" in text
    assert "0.001" not in text
    assert text.count("<svg") == 1


def test_the_page_of_a_plan_shows_every_test_and_what_was_left_out(tmp_path):
    trial = SimpleNamespace(
        says="move OP by 2 %",
        minutes=12.0,
        op_travel=2.0,
        id="bump",
        size=2.0,
        hold_s=9.0,
        settings={},
        pv_excursion=3.125,
    )
    made = PlannedTests((trial,), "", ("stairs: too long",))
    write_plan_page(made, report("It may be drift."), tmp_path / "plan.html")
    html = (tmp_path / "plan.html").read_text(encoding="utf-8")
    for words in (
        "It may be drift.",
        "move OP by 2 %",
        "3.12",
        "stairs: too long",
        "FIC &lt;1&gt;",
    ):
        assert words in html
