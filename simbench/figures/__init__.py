"""The chapter's figures and tables, one file each: `data()` returns the numbers drawn, `draw(data)` the picture.

A file here is a figure: its name with hyphens for underscores is the id. `SOURCE` says where the original stands. The name of
`data`'s parameter says what the figure needs: none, `isdb` (ISDB file or folder of real records) or `run` (folder of a run).
Files that begin with an underscore are shared by the figures and are no figures themselves.
"""

from simbench.figures._make import Drawn, make_figures

__all__ = ["Drawn", "make_figures"]
