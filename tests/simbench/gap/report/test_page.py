"""The page of a diagnosis: one file that asks for nothing, every picture seen, the answer in
words.
"""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import chromium
import numpy as np
import pytest
from chromium import needs_browser

from simbench.gap.closed_loop.remaining import Remaining
from simbench.gap.diagnosis import diagnose
from simbench.gap.report.view import (
    BASELINE,
    FIXED,
    NEAREST,
    RECORD,
    TUNED,
    compared,
    draw_sheet,
    write_page,
)
from simbench.loop.effects import EFFECTS
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

HEALTHY = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[600.0, 55.0], [1100.0, 50.0]]},
}
STICKY = {**HEALTHY, "valve": {"model": "choudhury", "S": 6.0, "J": 4.0}}
TAG = "FIC <101> & co"
COMMAND = ["simbench gap diagnose a.csv --baseline b.toml"]


@pytest.fixture(scope="module")
def sticky():
    """Report on a sticky loop with MV, whose simulation has a healthy valve."""
    record = simulate(Loop.from_table(STICKY), seed=3, kick=6.0).record
    return diagnose(replace(record, op_span=(0.0, 100.0), tag=TAG), Loop.from_table(HEALTHY))


@pytest.fixture(scope="module")
def clean():
    """Report on a record to which nothing is missing."""
    loop = Loop.from_table(HEALTHY)
    return diagnose(simulate(loop, seed=4).record, loop)


@pytest.fixture(scope="module")
def pages(sticky, clean, tmp_path_factory):
    place = tmp_path_factory.mktemp("pages")
    for name, report in (("sticky", sticky), ("clean", clean)):
        write_page(report, place / f"{name}.html", COMMAND)
    return place


def text_of(page: Path) -> str:
    """What a reader sees of it."""
    html = re.sub(r"<(script|style).*?</\1>", "", page.read_text(encoding="utf-8"), flags=re.S)
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", html)).split())


@pytest.mark.parametrize("name", ["sticky", "clean"])
def test_it_is_one_file_without_a_link_to_anywhere(name, pages):
    chromium.assert_alone(pages / f"{name}.html")


def test_for_an_unknown_effect_the_nearest_known_one_is_drawn_under_its_name(sticky, tmp_path):
    answer = {"block": "valve", "effect": "unknown", "parameters": {}, "probability": 0.9}
    unknown = replace(sticky, effect="unknown", effects=(answer,), shrinkage=None)
    assert list(compared(unknown)) == [RECORD, BASELINE, TUNED, NEAREST]
    write_page(unknown, tmp_path / "page.html")
    text = text_of(tmp_path / "page.html")
    assert unknown.sentence() in text
    assert "with the nearest effect added" in text


SORTED = """(t => [1, 2].map(() => {
  t.tHead.rows[0].cells[2].querySelector("button").click();
  return [...t.tBodies[0].rows].map(r => Number(r.cells[2].dataset.v));
}))(document.querySelector("#which table.sortable"))"""


def rare(*case):
    return pytest.param(*case, marks=pytest.mark.slow)


@needs_browser
@pytest.mark.parametrize(
    ("name", "width", "dark"),
    [("sticky", 400, True), rare("sticky", 1100, False), rare("clean", 400, True),
     rare("clean", 1100, False)],
)  # fmt: skip
def test_in_a_browser_nothing_fails_nothing_is_asked_for_and_every_picture_is_seen(
    name, width, dark, pages
):
    file = pages / f"{name}.html"
    # gap, PV, PV over OP, probabilities; MV over OP where it was recorded, and what remains
    remains = 'id="remaining"' in file.read_text(encoding="utf-8")
    assert chromium.seen_pictures(file, width, dark) == 4 + (name == "sticky") + remains
    with chromium.opened(file) as page:
        down, up = page.evaluate(SORTED)
    assert len(down) == len(EFFECTS) + 2
    assert down == up[::-1] == sorted(down, reverse=True)


@needs_browser
@pytest.mark.parametrize("name", ["sticky", rare("clean")])
def test_on_paper_nothing_is_lost(name, pages):
    assert chromium.lost_on_paper(pages / f"{name}.html") == 0


def test_the_table_of_what_remains_shows_ranges_and_no_lists(sticky, tmp_path):
    one = Remaining("kurtosis of PV", "sensor", 9.123456, (2.123456, 3.123456), 7.0)
    write_page(replace(sticky, remaining=(one,)), tmp_path / "page.html")
    text = text_of(tmp_path / "page.html")
    assert "2.12 to 3.12" in text
    assert "123456" not in text


def test_the_sheet_shows_record_and_simulations_the_answer_and_how_far_it_helps(sticky, clean):
    figure = draw_sheet(sticky)
    by_title = {axes.get_title(loc="left"): axes for axes in figure.axes}
    traces = [title for title in by_title if title in ("record", BASELINE, TUNED, FIXED)]
    assert traces == ["record", BASELINE, TUNED, FIXED]
    sp, pv = ([np.asarray(by_title[t].lines[k].get_ydata()) for t in traces] for k in (0, 1))
    wide = [np.std((y - r)[100:]) for r, y in zip(sp, pv)]  # SP steps at the window's first sample
    assert wide[0] > 2 * wide[1], "the healthy baseline does not cycle"
    assert 0.5 < wide[3] / wide[0] < 2.0, "with stiction it does"
    assert by_title["what is missing"].get_yticklabels()[0].get_text() == "stiction"
    bars = by_title["gap between simulation and record"]
    gap = {
        name.get_text(): bar.get_width() for name, bar in zip(bars.get_yticklabels(), bars.patches)
    }
    assert gap["after"] < 0.5 * gap["before"]
    assert FIXED not in {axes.get_title(loc="left") for axes in draw_sheet(clean).axes}, (
        "nothing was added"
    )
