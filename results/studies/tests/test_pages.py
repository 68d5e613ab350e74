"""The pages written from the code: every number that does not reproduce has its reason."""

from __future__ import annotations

import functools
import re
from pathlib import Path

import pytest

from results.studies.chapter import confirmation, methods, page, rows
from simbench.figures._make import figure_ids

ROOT = Path(__file__).parents[3]
REAL = ROOT.parent / "shared" / "data" / "real"


EVERY = functools.cache(rows)
WHOLE = pytest.param(EVERY, marks=pytest.mark.slow, id="every row")
QUICK = pytest.param(lambda: [*methods.rows(None), *confirmation.rows(None)], id="quick rows")


@pytest.fixture(scope="module", params=[QUICK, WHOLE])
def without_records(request):
    return request.param()


def test_a_row_that_does_not_reproduce_has_a_reason_and_the_committed_page_is_current(
    without_records,
):
    text = (ROOT / "docs" / "chapter_against_code.md").read_text(encoding="utf-8")
    committed = dict(re.findall(r"^\| ([^|]* \| [^|]*) \| [^|]* \| ([^|]*?) \|", text, flags=re.M))
    for row in without_records:
        assert row.agrees is not False or len(row.why) > 20, row
        if row.ours:  # the committed page has the numbers of the real loops too
            ours = committed[f"{row.place} | {row.what}"]
            assert re.search(r"\d", row.ours) or ours == row.ours


@pytest.mark.slow
def test_the_known_errata_are_among_what_does_not_reproduce():
    every = EVERY()
    assert {re.split(r"[ :]", row.what)[0] for row in every if row.ours == ""} == {
        "PAP2", "CHEM1", "PAP4", "PAP3", "CHEM30", "POW2",
    }  # fmt: skip
    assert sum(row.ours != "" for row in every) > 35
    assert {"| 0.43 |", "| 93.5 |", "| 1.2 |"} <= set(re.findall(r"\| [\d.]+ \|", page(every)))
    wrong = {(row.place, row.what) for row in every if row.agrees is False}
    assert ("Sect. 11.4.1", "rho1 of random signals") in wrong
    assert ("Table 11.3", "self-regulating, P, stick-slip") in wrong
    assert sum(place == "Example 11.3" for place, _ in wrong) == 2
    assert (
        "Sects. 11.7, 11.9",
        "sticky loops of Fig. 11.9 that the bicoherence calls nonlinear",
    ) in wrong


@pytest.mark.skipif(
    not REAL.is_dir(), reason="the folder of real records ../shared/data/real is absent"
)
def test_real_loops_reproduce_what_is_known_to_reproduce():
    agrees = {row.what: row.agrees for row in methods.rows(REAL)}
    for what in ("PAP2 rho1", "PAP2 rho3", "CHEM1 verdict", "PAP4 drho", "PAP4 verdict"):
        assert agrees[what]
    # CHEM1: 0.84 over every half cycle; printed 0.83
    for what in ("CHEM1 eta", "CHEM1 dtau", "PAP4 dtau"):
        assert agrees[what] is False


def test_every_link_of_the_committed_gallery_hits():
    text = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"^## `(.*)`$", text, flags=re.M))
    assert (
        {name for name in figure_ids() if name.startswith(("fig-11", "table-11"))}
        <= shown
        <= set(figure_ids())
    )
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert sum(link.endswith(".svg") for link in links) > 20
    for link in links:
        assert (ROOT / "docs" / link).is_file(), link
