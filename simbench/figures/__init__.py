"""The chapter's figures and tables, one file each: `data()` returns the numbers drawn, `draw(data)`
the picture.

A file here is a figure: its name with hyphens for underscores is the id. `SOURCE` names the
original. The name of `data`'s parameter is what the figure needs: none, `isdb` (ISDB file
or folder of real records) or `run` (folder of a run); one with `loops` can be drawn with other
numbers, which stand below the picture and in the table. Files that begin with an underscore are
shared by the figures and are no figures themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from simbench.figures._make import Drawn, caption, figure, make_figures, where_from

if TYPE_CHECKING:
    from simbench.detectors.procedure import Diagnosis

__all__ = ["Drawn", "caption", "draw_path", "figure", "make_figures", "where_from"]


def draw_path(diagnosis: Diagnosis, path) -> None:
    """Write a picture of the diagnosis procedure with the path one diagnosis took; see
    `simbench.figures._chart`.

    Parameters
    ----------
    diagnosis : Diagnosis
        Answer of `simbench.diagnose`.
    path : str or Path
        File to write; its ending says the format.
    """
    from simbench.figures._chart import draw_path as write

    write(diagnosis, path)
