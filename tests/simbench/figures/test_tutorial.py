"""The tutorial holds what it promises, block by block."""

import re
from pathlib import Path

import numpy as np
import pytest

from simbench.detectors.signal.half_cycles import split

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


def test_pv_turns_from_square_to_triangle_as_the_page_says(after):
    alike = []
    for record in after[0]["records"]:
        humps = split(record.pv - record.pv.mean(), 172.0)  # period of the exact cycle, in samples
        alike.append(
            np.mean(humps.sum(axis=1) / np.linalg.norm(humps, axis=1)) / np.sqrt(humps.shape[1])
        )
    assert alike[0] > 0.98, "nearly a square"
    assert alike[0] > alike[1] > alike[2]
    assert alike[2] == pytest.approx(np.sqrt(3) / 2, abs=0.01), "a triangle's likeness to a square"
