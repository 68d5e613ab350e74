"""Hostile names and texts on every page: in a browser no script runs and no request leaves the
page.
"""

import shutil

import chromium
import numpy as np
import pytest

from tests.simbench.boundary.conftest import run_verb, sampled
from tests.simbench.boundary.test_hostile import write

IMAGE = '"><img src=x onerror=window.hit=1>'
TAG = "<img src=x onerror=window.hit=1>"
SCRIPT = "<script>window.hit=1</script>"
TEXTS = [SCRIPT, IMAGE, "javascript:window.hit=1", "http://192.0.2.1/a.png", "\u202egnp.exe\u2066"]
PLUGIN = f'''"""Says what a page must not run."""
from simbench.detectors.method import Method
from simbench.detectors.verdict import STICTION, Verdict

METHOD = Method(title={SCRIPT + IMAGE!r}, source={TEXTS[2]!r},
                process=("self-regulating", "integrating"), front_end=False)


def detect(prepared):
    """Answer, or raise, with hostile words."""
    if prepared.record.op[0] > 50.0:
        raise ValueError({" ".join(TEXTS)!r})
    return Verdict("hostile", STICTION, 1.0, reason={" ".join(TEXTS)!r})
'''
# whatever would run or load: an event handler, a script that is not of the page, a link that is
# no place on the page
FOREIGN = """[...document.querySelectorAll("*")].filter(e =>
  [...e.attributes].some(a => a.name.startsWith("on") ||
    (["href", "src", "xlink:href", "action"].includes(a.name)
      && !a.value.startsWith("#") && !a.value.startsWith("data:"))))
  .map(e => e.outerHTML.slice(0, 100))"""


@pytest.fixture
def hostile(here):
    """A folder of records whose names, columns and tags are hostile, and a plug-in."""
    plant = here / "plant"
    plant.mkdir()
    for k, name in enumerate([IMAGE, *TEXTS[2::2], "<svg onload=window.hit=1>", "a'b&amp;<b>"]):
        write(plant / f"{name}.csv", np.arange(400 + 20 * k), head=f"t,{TAG}.OP,{TAG}.PV")
    shutil.copy(plant / f"{IMAGE}.csv", here)
    (here / "hostile.py").write_text(PLUGIN)
    return here


def assert_harmless(page):
    # the text is there: it is shown, not dropped
    assert "window.hit=1" in page.read_text(encoding="utf-8")
    if chromium.executable() is None:
        pytest.skip("no browser here")
    with chromium.opened(page) as shown:
        assert shown.evaluate("window.hit") is None
        assert shown.evaluate(FOREIGN) == []
        loads = "document.querySelectorAll('img, iframe, object, embed, base, form').length"
        assert shown.evaluate(loads) == 0
        assert shown.errors == []
        assert len(shown.requests) == 1, shown.requests


VERBS = [
    "detect plant --method horch_histogram,hostile --plugin hostile.py --html page.html",
    "detect IMAGE --method horch --html page.html",
    "gap diagnose IMAGE --identify --html page.html",
]


@pytest.mark.parametrize("words", sampled(VERBS, 0, VERBS[:1]))
def test_a_page_about_hostile_names_runs_nothing(hostile, words):
    named = [f"{IMAGE}.csv" if word == "IMAGE" else word for word in words.split()]
    assert run_verb(named)[0] in (0, 1)
    assert_harmless(hostile / "page.html")


@pytest.mark.slow
def test_a_score_report_of_hostile_answers_runs_nothing(hostile):
    words = "run smoke -o run --method horch_histogram,hostile --plugin hostile.py"
    assert run_verb(f"{words} --set disturbance=none")[0] in (0, 1)
    assert run_verb("score run --report page.html")[0] in (0, 1)
    assert_harmless(hostile / "page.html")
