"""Write the reference pages that stand in the repository: the keys of a loop file and of a grid
file, and what a detector is given. `python docs/site/written/reference.py`; a test compares.
"""

from __future__ import annotations

from pathlib import Path

from formats import grid_page, loop_page
from prepared import prepared_page

FOLDER = Path(__file__).parents[1] / "reference"


def pages() -> dict[str, str]:
    """Return the text of every page by the name of its file."""
    texts = {"loop": loop_page(), "grid": grid_page(), "prepared": prepared_page()}
    return {f"{name}.rst": text.rstrip() + "\n" for name, text in texts.items()}


if __name__ == "__main__":
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
