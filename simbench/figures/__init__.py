"""The chapter's figures and tables, one file each: `data()` returns the numbers drawn, `draw(data)`
the picture.

A file here is a figure: its name with hyphens for underscores is the id. `SOURCE` names the
original. The name of `data`'s parameter is what the figure needs: none, `isdb` (ISDB file
or folder of real records) or `run` (folder of a run). Files that begin with an underscore are
shared by the figures and are no figures themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from simbench.figures._make import Drawn, make_figures, where_from

if TYPE_CHECKING:
    from simbench.bench.map.making import GridMap
    from simbench.bench.score.history import History
    from simbench.detectors.procedure import Diagnosis

__all__ = ["Drawn", "draw_history", "draw_map", "draw_path", "make_figures", "where_from"]


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


def draw_history(history: History, path) -> None:
    """Write a picture of accuracy over the baselines kept; see `simbench.figures._history`.

    Parameters
    ----------
    history : History
        Scores of the baselines kept.
    path : str or Path
        File to write; its ending says the format.
    """
    from simbench.figures._history import draw
    from simbench.figures._style import write_picture

    write_picture(draw(history.table), path)


def draw_map(grid_map: GridMap) -> None:
    """Write a picture per method of a map, METHOD.svg in its folder; see
    `simbench.figures._map`.

    Parameters
    ----------
    grid_map : GridMap
        Accuracy of each method over the axes of a grid.
    """
    from simbench.figures._map import draw
    from simbench.figures._style import write_picture

    for method, part in grid_map.table.groupby("method", sort=False):
        write_picture(
            draw(part, str(method), grid_map.axes, grid_map.values),
            grid_map.folder / f"{method}.svg",
        )
