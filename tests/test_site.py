"""The site builds without a warning, has an entry for every public name and detector, and asks nothing of the outside."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import simbench
from detectors.registry import methods

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", str(out / "doctrees")]
    done = subprocess.run([*command, str(ROOT / "docs/site"), str(out / "html")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out / "html"


def test_every_public_name_has_an_entry(site):
    text = (site / "generated/api.html").read_text(encoding="utf-8")
    missing = [name for name in simbench.__all__ if name != "gap" and not re.search(rf'id="[\w.]*\b{name}"', text)]
    assert missing == []


def test_every_detector_says_what_it_needs_and_when_not_to_use_it(site):
    text = (site / "generated/detectors.html").read_text(encoding="utf-8")
    for name in methods.names():
        assert f">{name}<" in text
    assert text.count("<dt") >= 3 * len(methods.names())


def test_no_page_loads_anything_from_outside(site):
    for page in site.rglob("*.html"):
        loaded = re.findall(r'(?:src|<link[^>]*href)="(https?://[^"]+)', page.read_text(encoding="utf-8"))
        assert loaded == [], page.name


def test_the_code_on_the_front_page_runs(tmp_path, monkeypatch, capsys):
    text = (ROOT / "docs/site/index.rst").read_text(encoding="utf-8")
    code = re.search(r"code-block:: python\n\n((?:   .*\n|\n)+)", text)
    assert code is not None
    loop = {"plant": {"type": "integrating", "K": 0.1}, "controller": {"type": "P", "Kc": 1}, "sampling": {"Ts": 1, "n": 300}}
    simbench.Loop(**loop).simulate(0).to_frame().to_csv(tmp_path / "rec.csv", index=False)
    monkeypatch.chdir(tmp_path)
    exec(re.sub(r"^   ", "", code.group(1), flags=re.MULTILINE), {})
    assert "procedure" in capsys.readouterr().out
