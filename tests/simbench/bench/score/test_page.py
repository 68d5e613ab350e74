"""The report of a run: one file that asks for nothing, and whose pictures are seen."""

import re

import chromium
import pytest
from bench_fixtures import BROKEN
from chromium import needs_browser

from simbench.bench.execute.failures import read_failures
from simbench.bench.execute.run import run_grid
from simbench.bench.score.page import write_page
from simbench.bench.score.scoring import score_run
from simbench.detectors.plugins.registry import methods


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    (folder / "broken.py").write_text(BROKEN)
    return run_grid(
        "smoke",
        folder / "smoke",
        ("he", "horch", "yamashita"),
        plugins=[folder / "broken.py"],
        progress=False,
    )


@pytest.fixture(scope="module")
def report(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_page(score_run(run), run, path, failed=str(read_failures(run)))
    return path


def test_a_plug_in_of_a_run_is_no_detector_of_the_next(run):
    assert (run / "manifest.json").is_file()
    assert "broken" not in methods.names()


def test_it_is_one_file_without_a_link_to_anywhere(report):
    assert [p.name for p in report.parent.iterdir()] == ["report.html"]
    chromium.assert_alone(report)


def test_no_text_of_a_detector_becomes_markup(report):
    text = report.read_text(encoding="utf-8")
    assert "on purpose &lt;b&gt;bold&lt;/b&gt;" in text
    assert "<b>bold</b>" not in text


def test_numbers_in_the_summary_are_those_of_score(run, report):
    scores = score_run(run)
    text = report.read_text(encoding="utf-8")
    for row in scores.rows().itertuples():
        value, shown = (
            re.escape(repr(float(row.accuracy))),
            f"{row.accuracy:.2f}",
        )
        assert re.search(rf'<td class="name">{row.method}</td>.*?data-v="{value}">{shown}', text)


@needs_browser
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1200, 400])
def test_in_a_browser_nothing_fails_nothing_is_asked_for_and_every_picture_is_seen(
    report, width, dark
):
    # answers by label, costs, the maps of self-regulating and of integrating loops, ROC curves
    assert chromium.seen_pictures(report, width, dark) == 1 + 1 + 2 + 1


@needs_browser
def test_on_paper_no_column_and_no_row_is_lost(report):
    assert chromium.lost_on_paper(report) == 0
    with chromium.opened(report, chromium.PAPER) as page:
        assert page.evaluate(chromium.OUTSIDE) > 0, "on a screen of that width tables are scrolled"
