"""Draw figures by id and write each as SVG, PNG and CSV."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simbench.detectors.errors import ParameterError, RecordError, UnknownName
from simbench.detectors.records.folder import RECORD_FILES
from simbench.figures._loops import Loops, numbers_line
from simbench.figures._records import NeedsRecord
from simbench.files import folder, remove_stale_temporaries, write_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

NEEDS = {"isdb": "ISDB"}
_LETTERS = 15  # of the line of numbers in an inch
# where what a figure needs comes from
SOURCES = {
    "isdb": "give isdb10.mat, or a folder of its loops, with --isdb; the International Stiction"
    " Data Base belongs to Jelali and Huang (eds.), Detection and Diagnosis of Stiction in Control"
    " Loops, Springer 2010",
}


@dataclass(frozen=True)
class Drawn:
    """What became of one figure.

    Parameters
    ----------
    id : str
        Public id.
    files : tuple of Path
        SVG, PNG and CSV; empty when it was left out.
    left_out : str
        Why it was not drawn; "" when it was.
    caption : str
        What it shows, with the numbers that were changed, and its source.
    """

    id: str
    files: tuple[Path, ...] = ()
    left_out: str = ""
    caption: str = ""


def figure_ids() -> list[str]:
    """Return the ids of all figures, in the order of the chapter."""
    from simbench.figures._folder import FIGURES

    def place(name: str) -> tuple:
        parts = name.split("-")
        return (
            parts[0] not in ("fig", "table"),
            parts[0],
            [int(p) if p.isdigit() else 0 for p in parts[1:3]],
            name,
        )

    return sorted((n.replace("_", "-") for n in FIGURES.names()), key=place)


def make_figures(
    ids: Iterable[str],
    out: str | Path,
    isdb: str | Path | None = None,
    numbers: Mapping[str, float] | None = None,
) -> list[Drawn]:
    """Draw figures and write ID.svg, ID.png and ID.csv for each; with other numbers these stand in
    the name, so that the original stays.

    Parameters
    ----------
    ids : iterable of str
        Ids of figures, or "all".
    out : str or Path
        Folder to write to; it is made where it does not exist.
    isdb : str or Path, optional
        ISDB .mat file or folder of real records, which some figures show.
    numbers : mapping of str to float, optional
        Numbers of the loops drawn, in place of the figures' own: K, T, Td, Kc, Ti, Ts, S, J, or the
        ratios Td_over_T, Td_over_Ti, S_over_2J.

    Returns
    -------
    list of Drawn
        Files of each figure, or why it was left out.

    Raises
    ------
    UnknownName
        For an id that no figure has.
    RecordError
        When `isdb` holds no records.
    ParameterError
        For a number that a figure's loops do not have.

    Examples
    --------
    >>> import tempfile
    >>> [f.suffix for f in make_figures(["table-11-4"], tempfile.mkdtemp())[0].files]
    ['.svg', '.png', '.csv']
    >>> make_figures(["fig-11-12"], tempfile.mkdtemp())[0].left_out
    'needs ISDB'
    """
    # The ids, each once
    known = figure_ids()
    wanted: list[str] = []
    for name in ids:
        name = _figure_id(name)
        if name != "all" and name not in known:
            raise UnknownName("figure", name, known + ["all"])
        wanted += [n for n in (known if name == "all" else [name]) if n not in wanted]

    # What is there to draw from
    if isdb is None:
        fault = ""
    else:
        fault = _no_records(Path(isdb))
    if fault:
        raise RecordError(f"{isdb} {fault}; an ISDB .mat file or a folder of records is needed")

    # Wrong numbers are refused before anything is drawn
    given = {"isdb": isdb}
    if numbers:
        for name in wanted:
            refuse_numbers(name, numbers)
    if not all(_missing_need(name, given) for name in wanted):
        remove_stale_temporaries(folder(out))

    # Figure by figure
    return [_make_one(name, Path(out), given, numbers) for name in wanted]


def figure(
    id: str,
    *,
    isdb: str | Path | None = None,
    **numbers: float,
) -> Figure:
    """Draw one figure or table of the chapter.

    Parameters
    ----------
    id : str
        Id of the figure, as "fig-11-8" or "11.8".
    isdb : str or Path, optional
        ISDB .mat file or folder of real records, which some figures show.
    **numbers : float
        Numbers of the loops drawn, in place of the figure's own: K, T, Td, Kc, Ti, Ts, S, J, or the
        ratios Td_over_T, Td_over_Ti, S_over_2J.

    Returns
    -------
    matplotlib.figure.Figure
        The picture.

    Raises
    ------
    UserError
        For an unknown figure, one whose data are not given, or a number that it does not have.

    Examples
    --------
    >>> figure("11.8", S=4, Td_over_T=0.3).axes[0].get_xlabel()
    'real part (-)'
    """
    name = _figure_id(id)
    known = figure_ids()
    if name not in known:
        raise UnknownName("figure", name, known)
    given = {"isdb": isdb}
    if lacking := _missing_need(name, given):
        raise ParameterError(where_from(Drawn(name, left_out=lacking)))
    refuse_numbers(name, numbers)
    return _draw_figure(name, given, numbers)[1]


def refuse_numbers(name: str, numbers: Mapping[str, float]) -> None:
    """Refuse numbers for a figure that shows no loop; the loops themselves refuse others."""
    from simbench.figures._folder import FIGURES

    data = FIGURES.load(name.replace("-", "_")).data
    if numbers and "loops" not in inspect.signature(data).parameters:
        told = ", ".join(numbers)
        raise ParameterError(f"figure {name} shows no simulated loop, whose {told} could be set")
    Loops(numbers)


def caption(name: str, changed: str = "") -> str:
    """Return what a figure shows, where it differs from the book, and its source.

    Parameters
    ----------
    name : str
        Id of the figure.
    changed : str
        What was changed in it, in sentences: they stand in place of what is true of the original
        alone.

    Returns
    -------
    str
        The text below it in the gallery.

    Examples
    --------
    >>> caption("fig-11-1").split(":")[0]
    'Figure 11.1'
    """
    from simbench.figures._folder import FIGURES

    module = FIGURES.load(name.replace("-", "_"))
    title, _, rest = (module.__doc__ or "").partition("\n\n")
    text = " ".join(f"{title} {changed or rest}".split())
    return f"{text} Source: {'after ' if changed else ''}{module.SOURCE}."


def where_from(drawn: Drawn) -> str:
    """Return what a figure that was left out needs, and where that comes from.

    Parameters
    ----------
    drawn : Drawn
        A figure that was left out.

    Returns
    -------
    str
        One sentence without a full stop.

    Examples
    --------
    >>> where_from(Drawn("fig-11-12", left_out="needs ISDB")).split(",")[0]
    'figure fig-11-12 needs ISDB: give isdb10.mat'
    """
    for key, word in NEEDS.items():
        if drawn.left_out == f"needs {word}":
            return f"figure {drawn.id} {drawn.left_out}: {SOURCES[key]}"
    return f"figure {drawn.id} {drawn.left_out}"


def _figure_id(name: str) -> str:
    """Return a figure's id for how books and people write it.

    >>> [_figure_id(name) for name in ("11.16", "Figure 11.9", "table_11_3")]
    ['fig-11-16', 'fig-11-9', 'table-11-3']
    """
    words = re.sub(r"[\s._-]+", "-", name.strip().lower())
    words = re.sub(r"^fig(ure)?-?(?=\d)", "fig-", words)
    if re.fullmatch(r"\d+-\d+", words):
        return f"fig-{words}"
    return words


def _missing_need(name: str, given: Mapping[str, str | Path | None]) -> str:
    """Return what a figure needs that is not given; "" where nothing is missing."""
    return next((f"needs {NEEDS[need]}" for need in _needs_of(name) if given[need] is None), "")


def _needs_of(name: str) -> list[str]:
    from simbench.figures._folder import FIGURES

    figure = FIGURES.load(name.replace("-", "_"))
    return [p for p in inspect.signature(figure.data).parameters if p in NEEDS]


def _no_records(isdb: Path) -> str:
    """Return why a place holds no records; "" where it may."""
    if not isdb.exists():
        return "does not exist"
    readable = isdb.is_dir() or isdb.suffix.lower() in ((".mat",) + RECORD_FILES)
    return "" if readable else "holds no records"


def _make_one(
    name: str,
    target: Path,
    given: Mapping[str, str | Path | None],
    numbers: Mapping[str, float] | None,
) -> Drawn:
    from simbench.page.style import write_picture

    if lacking := _missing_need(name, given):
        return Drawn(name, left_out=lacking)
    try:
        table, picture, told = _draw_figure(name, given, numbers)
    except NeedsRecord as error:
        return Drawn(name, left_out=str(error))
    stem = "-".join([name] + [f"{key}-{value:g}" for key, value in (numbers or {}).items()])
    files = tuple(target / f"{stem}{suffix}" for suffix in (".svg", ".png", ".csv"))
    for file in files[:2]:
        write_picture(picture, file, simplified=0.3)
    write_table(table, files[2], float_format="%.6g")
    return Drawn(name, files, caption=caption(name, told))


def _draw_figure(
    name: str, given: Mapping[str, str | Path | None], numbers: Mapping[str, float] | None
) -> tuple[pd.DataFrame, Figure, str]:
    """Return a figure's table, its picture, on which the loops' numbers stand, and what was changed
    in it.
    """
    from simbench.figures._folder import FIGURES
    from simbench.page.style import GREY

    module = FIGURES.load(name.replace("-", "_"))
    loops = Loops(numbers)
    wanted: dict[str, Any] = {}
    for need in _needs_of(name):
        wanted[need] = given[need]
    if "loops" in inspect.signature(module.data).parameters:
        wanted["loops"] = loops
    table = module.data(**wanted)
    loops.refuse_unused(name)
    picture = module.draw(table)
    if "loops" in wanted:
        wide = int(_LETTERS * picture.get_size_inches()[0])
        line = textwrap.fill(numbers_line(table), wide)
        picture.suptitle(line, x=0.01, ha="left", fontsize=7.5, color=GREY)
    return table, picture, loops.told()
