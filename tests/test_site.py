"""The site builds, its tutorials run, every public name has a page, and it asks nothing outside."""

from __future__ import annotations

import fcntl
import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import simbench

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
