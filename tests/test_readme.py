"""What the README shows works as written: every command, the Python blocks, the plug-ins, the CI
recipe, the table.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from simbench.cli import main
from simbench.detectors.plugins.registry import methods
from simbench.scenarios.spec import Loop

ROOT = Path(__file__).parents[1]
README, EXAMPLE = (ROOT / "README.md").read_text(encoding="utf-8"), ROOT / "docs" / "example"


def block(language: str, containing: str) -> str:
    """Return the README's code block of a language that contains some text."""
    blocks = re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)
    (match,) = [b for b in blocks if containing in b]
    return match


@pytest.fixture
def own_detector(tmp_path):
    """Write the README's detector to its file."""
    path = tmp_path / "fullness.py"
    path.write_text(block("python", "METHOD = Method("), encoding="utf-8")
    yield path
    methods._files.pop("fullness", None)


def test_the_loop_file_is_the_tutorials_and_its_model_lacks_the_stiction_alone():
    text = (EXAMPLE / "loop.toml").read_text(encoding="utf-8")
    assert f"%%writefile loop.toml\n{text}```" in (
        ROOT / "docs/site/tutorials/simulate.md"
    ).read_text(encoding="utf-8")
    sticky = tomllib.loads(text)
    assert Loop.from_table(sticky).valve.name == "choudhury"
    healthy = tomllib.loads((EXAMPLE / "model.toml").read_text(encoding="utf-8"))
    assert healthy == {**sticky, "valve": {"model": "ideal"}}


def test_the_first_example_prints_the_ranking_that_stands_below_it(place, capsys):
    guide = README[README.index("## Benchmark a detector") :]
    words = re.findall(r"^simbench (run ci .*)$", guide, re.MULTILINE)[0].split()
    assert main(words) == 0
    said = capsys.readouterr().out.splitlines()
    shown = block("text", "fullness").splitlines()
    assert [line for line in shown if line not in said] == []
    assert any(re.match(r"\d+ +fullness ", line) for line in shown)


def test_the_users_detector_keeps_its_contract(own_detector, capsys):
    assert main(["contract", str(own_detector)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "detector fullness: keeps its contract"


def test_every_link_of_the_readme_hits():
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", README) if not link.startswith("http")]
    assert len(links) > 10
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_table_of_contents_counts_what_can_be_listed(capsys):
    counts = re.findall(r"^\| (\d+) [^|]*`(?:simbench )?list (\w+)`", README, re.MULTILINE)
    assert [kind for _, kind in counts] == ["valves", "detectors", "grids", "effects"]
    for count, kind in counts:
        assert main(["list", kind]) == 0
        # a line each; grids under a head, as they have a column
        lines = capsys.readouterr().out.splitlines()[kind == "grids" :]
        assert len(lines) == int(count), kind


@pytest.fixture
def place(tmp_path, monkeypatch, own_detector):
    shutil.copytree(EXAMPLE, tmp_path / "docs" / "example")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def steps(text):
    """Yield what a reader does with each block of the page in its order: a file to write, or a
    program with its words.
    """
    for language, body in re.findall(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        plugin = re.match(r'"""(\w+)', body)
        if language == "python" and plugin:
            yield f"{plugin[1].lower()}.py", body
        elif language == "python":
            yield None, [sys.executable, "-c", body]
        elif not language:
            for line in body.splitlines():
                yield (
                    None,
                    ["bash", "-c", line]
                    if not line.startswith("make ")
                    else line.split("#")[0].split(),
                )


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_readme_runs_from_top_to_bottom_in_a_folder_that_holds_the_examples_alone(tmp_path):
    shutil.copytree(EXAMPLE, tmp_path / "docs" / "example")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    path = {
        **os.environ,
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
    }
    done = []
    for name, what in steps(README):
        if name:
            (tmp_path / name).write_text(what, encoding="utf-8")
        elif what[0] == "make":
            assert f"\n{what[1]}:" in makefile
        else:
            run = subprocess.run(what, cwd=tmp_path, env=path, capture_output=True, text=True)
            assert run.returncode == 0, (what, run.stderr)
            done.append(what)
            if "gap diagnose" in what[-1]:
                named = re.search(r"here `(stiction \([^`]+)`", README)
                assert named is not None
                assert f"The simulation lacks {named[1]}." in run.stdout
    assert len(done) >= 10
    written = {
        "verdict.html",
        "plant.html",
        "fixed.toml",
        "again.csv",
    }
    assert written <= {p.name for p in tmp_path.iterdir()}


def test_the_python_block_gives_tables_and_pictures(place):
    assert main(["simulate", "docs/example/loop.toml", "-o", "rec.csv", "--seed", "1"]) == 0
    scope: dict = {}
    exec(block("python", "sb.detect"), scope)
    assert scope["answer"] == "stiction"
    assert scope["table"].method.tolist() == ["horch", "he"]
    assert len(scope["axes"]) == 2


def test_every_make_target_named_exists():
    makefile = (Path(__file__).parents[1] / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"`make\s(\w+)`", README))
    assert named >= {"check", "docs", "site"}
    assert [t for t in named if f"\n{t}:" not in makefile] == []
