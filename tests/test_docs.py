"""The pages of the documentation as they stand in a checkout: links hit, the reference is what the
code says, the ranking is the one in results.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SITE = ROOT / "docs" / "site"
PAGES = sorted(
    p for p in (ROOT / "docs").rglob("*.md") if not {"generated", "_static"} & set(p.parts)
)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT / "docs").as_posix())
def test_every_link_of_a_page_hits_and_has_a_text(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = re.findall(r"\[([^\]]*)\]\(([^)\s]+)\)", text)
    assert [target for words, target in links if not words.strip()] == []
    near = [t.split("#")[0] for _, t in links if not re.match(r"https?:|mailto:|#", t)]
    assert [target for target in near if target and not (page.parent / target).exists()] == []


def test_the_reference_pages_are_what_the_code_says():
    code = "import reference; print(repr(reference.pages()))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=SITE / "written",
        capture_output=True,
        text=True,
        check=True,
    )
    written = eval(done.stdout)  # a table of texts, of our own
    assert sorted(written) == sorted(p.name for p in (SITE / "reference").glob("*.rst"))
    for name, text in written.items():
        kept = (SITE / "reference" / name).read_text(encoding="utf-8")
        assert kept == text, f"{name}: run `python docs/site/written/reference.py`"
