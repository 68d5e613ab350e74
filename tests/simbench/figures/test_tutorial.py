"""Every block of the tutorial on pictures runs."""

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # as the site is
PAGE = Path(__file__).parents[3] / "docs" / "site" / "tutorials" / "chapter_figure.md"
BLOCKS = re.findall(
    r"```{code-cell} ipython3\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.S
)


@pytest.fixture(scope="module")
def after(tmp_path_factory):
    """Run every block in one namespace, in a new folder."""
    folder = tmp_path_factory.mktemp("tutorial")
    space: dict = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for i, block in enumerate(BLOCKS):
            exec(compile(block, f"tutorial block {i + 1}", "exec"), space)
    return space, folder


def test_every_block_runs_and_leaves_the_picture(after):
    _, folder = after
    assert (folder / "fig-11-9.svg").read_text(encoding="utf-8").rstrip().endswith("</svg>")
    assert {p.suffix for p in (folder / "figures").iterdir()} == {".svg", ".png", ".csv"}
