"""What `run` and `score` print by default: one table on one screen."""

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


def test_a_run_of_few_loops_prints_why_there_is_no_ranking(tmp_path):
    folder = run_grid(
        "smoke", tmp_path / "run", ["he", "horch"], sets={"disturbance": "none"}, progress=False
    )
    result = called("score", folder)
    assert result.exit_code == 0
    assert "There is no ranking: " in result.stdout
    assert "oscillating loops have a clear label, and 30 are needed." in result.stdout
