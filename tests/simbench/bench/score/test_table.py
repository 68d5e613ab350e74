"""What `run` and `score` print by default: one table on one screen."""

import json

from bench_fixtures import BROKEN
from typer.testing import CliRunner

from simbench.bench.execute.run import run_grid
from simbench.cli import app

HEAD = ["rank", "method", "cost", "accuracy", "sensitivity", "false positives", "no decision"]


def called(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def one_screen(text):
    lines = text.splitlines()
    heads = [x for x in lines if x.startswith("rank")]
    return (
        len(lines) <= 40
        and max(map(len, lines)) <= 100
        and len(heads) == 1
        and all(cell in heads[0] for cell in HEAD)
    )


def test_run_and_score_of_smoke_print_one_table_on_one_screen(tmp_path):
    run = tmp_path / "run"
    made = called("run", "smoke", "-o", run, "--method", "he,horch,yamashita,oracle")
    assert made.exit_code == 0, made.output
    assert one_screen(made.stdout), made.stdout
    report = called("score", run, "--truth", "predicted", "--report", tmp_path / "report.html")
    assert one_screen(report.stdout)
    assert "Table 11.3 predicts a limit cycle" in report.stdout
    text = (tmp_path / "report.html").read_text()
    assert "no_waveform" in text
    assert "Table 11.3 predicts a limit cycle" in text


def test_a_plug_in_that_fails_more_often_than_allowed_is_not_ranked_and_ends_with_1(tmp_path):
    (tmp_path / "broken.py").write_text(BROKEN)
    asked = ("run", "smoke", "--method", "he,broken", "--plugin", tmp_path / "broken.py")
    result = called(*asked, "-o", tmp_path / "run")
    assert result.exit_code == 1
    assert "Not ranked, too many errors: broken failed on" in result.stdout
    (row,) = [
        line
        for line in result.stdout.splitlines()
        if " broken " in line and line[0] in "-0123456789"
    ]
    assert row.startswith("- ")
    rows = json.loads(called("score", tmp_path / "run", "--json", "--allow-failed", "0.9").stdout)[
        "rows"
    ]
    ranks = {
        r["rank"]
        for r in rows
        if (r["method"], r["population"], r["process"]) == ("broken", "oscillating", "all")
    }
    assert ranks <= {1, 2}


def test_a_run_of_few_loops_prints_why_there_is_no_ranking(tmp_path):
    folder = run_grid(
        "smoke", tmp_path / "run", ["he", "horch"], sets={"disturbance": "none"}, progress=False
    )
    result = called("score", folder)
    assert result.exit_code == 0
    assert "There is no ranking: " in result.stdout
    assert "oscillating loops have a clear label, and 30 are needed." in result.stdout
