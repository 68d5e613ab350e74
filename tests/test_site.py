"""The site builds without a warning, its tutorials run; every public name, key and method is there;
it asks nothing outside.
"""

from __future__ import annotations

import fcntl
import importlib
import os
import re
import subprocess
import sys
from html import unescape
from pathlib import Path

import nbformat
import pytest

import simbench
from simbench.detectors.plugins.registry import methods
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import VALVES
from simbench.scenarios.cell import SETTINGS
from simbench.scenarios.grid_file import GridFile
from simbench.scenarios.spec import Loop

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "docs" / "site"
TUTORIALS = sorted(p.stem for p in SOURCE.glob("tutorials/*.md"))
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(1800),
]  # the tutorials run: about a minute of CPU, more on a busy machine


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    base = tmp_path_factory.getbasetemp()
    out = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "the-site"
    out.mkdir(exist_ok=True)
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "--keep-going",
        "-q",
        "-d",
        str(out / "doctrees"),
    ]
    with open(out / "lock", "w") as lock:
        # two workers may hold tests of this file: the first builds, the other waits
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (out / "built").exists():
            done = subprocess.run(
                [*command, str(SOURCE), str(out / "html")],
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stderr
            (out / "built").touch()
    return out / "html"


def text_of(page: Path) -> str:
    """Return what a reader reads of a page: its main part without tags."""
    main = page.read_text(encoding="utf-8").split("<article", 1)[1].split("</article>", 1)[0]
    return unescape(re.sub(r"<[^>]+>", "", main))


def test_every_public_name_has_a_page(site):
    missing = []
    for package in ("simbench", "simbench.gap", "simbench.detectors", "simbench.scenarios"):
        module = importlib.import_module(package)
        for name in set(module.__all__) - {"gap"}:
            thing = getattr(module, name)
            pages = [
                site / f"generated/api/{p}.{name}.html"
                for p in ("simbench", "simbench.gap", "simbench.detectors", "simbench.scenarios")
            ]
            if not any(
                p.exists() and re.search(rf'id="[\w.]*\b{name}"', p.read_text(encoding="utf-8"))
                for p in pages
            ):
                missing.append(f"{package}.{name} ({thing!r})")
    assert missing == []


def test_every_detector_has_its_needs_and_measurements(site):
    page = site / "generated/methods.html"
    text, shown = page.read_text(encoding="utf-8"), text_of(page)
    for name in methods.names():
        assert f'id="method-{name.replace("_", "-")}"' in text, name
    assert text.count("<dt") >= 3 * len(methods.names())
    lines = (ROOT / "results/real_records.txt").read_text(encoding="utf-8").splitlines()
    (row,) = [line for line in lines if line.startswith("horch_histogram  ")]
    (head,) = [line for line in lines if line.startswith("method ") and "positives" in line]
    known = dict(zip(head.split(), row.split(), strict=True))
    near = shown[shown.index("horch_histogram") :][:300]
    assert known["sensitivity"] in near
    assert known["false_positives"] in near


def test_every_key_of_loop_and_grid_file_is_explained(site):
    loop, grid = text_of(site / "reference/loop.html"), text_of(site / "reference/grid.html")
    sections = [
        f.annotation for f in Loop.model_fields.values() if hasattr(f.annotation, "model_fields")
    ]
    keys = {key for section in sections for key in section.model_fields} - {"parameters"}
    keys |= {
        p
        for folder in (VALVES, EFFECTS)
        for name in folder.names()
        for p in folder.load(name).PARAMETERS
    }
    assert [key for key in keys if not re.search(rf"\b{key}\b", loop)] == []
    assert [
        name for folder in (VALVES, EFFECTS) for name in folder.names() if name not in loop
    ] == []
    assert [
        key for key in (*SETTINGS, *GridFile.model_fields) if not re.search(rf"\b{key}\b", grid)
    ] == []


def test_every_command_is_there_with_its_help(site):
    text = text_of(site / "generated/commands.html")
    for words in ("detect", "gap diagnose", "confirm travel", "score"):
        assert f"Usage: simbench {words} [OPTIONS]" in text


@pytest.mark.parametrize("name", TUTORIALS)
def test_every_cell_of_a_tutorial_ran(site, name):
    cells = len(
        re.findall(
            r"^```\{code-cell\}",
            (SOURCE / f"tutorials/{name}.md").read_text(encoding="utf-8"),
            re.MULTILINE,
        )
    )
    page = (site / f"tutorials/{name}.html").read_text(encoding="utf-8")
    assert cells >= 2
    assert len(re.findall(r'class="cell [^"]*docutils', page)) == cells
    assert page.count("cell_output docutils") >= cells // 3, "a cell printed something"
    assert "Traceback" not in page


@pytest.mark.parametrize("name", TUTORIALS)
def test_a_tutorial_can_be_downloaded_as_the_notebook_that_ran(site, name):
    page = site / f"tutorials/{name}.html"
    (link,) = re.findall(rf'href="(\S+/{name}\.ipynb)"', page.read_text(encoding="utf-8"))
    notebook = nbformat.read(page.parent / link, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    text = (SOURCE / f"tutorials/{name}.md").read_text(encoding="utf-8")
    assert len(code) == len(re.findall(r"^```\{code-cell\}", text, re.MULTILINE))
    assert all(line in text for cell in code for line in cell.source.splitlines())
    assert any(cell.outputs for cell in code)
    assert notebook.metadata.kernelspec.name == "python3"


def test_the_tutorials_say_what_their_outputs_show(site):
    """Where a text claims what a cell printed, it printed that."""
    gap, detector, cluster = (
        text_of(site / f"tutorials/{name}.html") for name in ("gap", "own_detector", "cluster")
    )
    assert "The simulation lacks stiction" in gap
    assert "No unmodelled effect is needed" in gap
    assert detector.count("detector one_speed: keeps its contract") == 1
    assert "scenario_id" in cluster, "the line before it asserts that both runs are equal"


def test_no_page_loads_anything_from_outside(site):
    for page in site.rglob("*.html"):
        loaded = re.findall(
            r'(?:src|<link[^>]*href)="(https?://[^"]+)', page.read_text(encoding="utf-8")
        )
        assert loaded == [], page.name
    for sheet in site.rglob("*.css"):
        assert (
            re.findall(r"(?:@import|url\()\s*[\"']?https?:", sheet.read_text(encoding="utf-8"))
            == []
        ), sheet.name


def test_the_code_on_the_front_page_runs(tmp_path, monkeypatch, capsys):
    code = re.search(
        r"```python\n(.*?)```", (SOURCE / "index.md").read_text(encoding="utf-8"), re.DOTALL
    )
    assert code is not None
    loop = {
        "plant": {"type": "integrating", "K": 0.1},
        "controller": {"type": "P", "Kc": 1},
        "sampling": {"Ts": 1, "n": 300},
    }
    simbench.Loop(**loop).simulate(0).to_frame().to_csv(tmp_path / "rec.csv", index=False)
    monkeypatch.chdir(tmp_path)
    exec(code.group(1), {})
    assert capsys.readouterr().out.startswith(("Stiction", "No stiction", "Cannot tell"))
