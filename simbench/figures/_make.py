"""Draw figures by id and write each as SVG, PNG and CSV."""

import inspect
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from simbench.bench.store.manifest import read_manifest
from simbench.detectors.errors import RecordError, UnknownName
from simbench.detectors.records.io import RECORD_FILES
from simbench.figures._records import NeedsRecord
from simbench.files import folder, remove_stale_temporaries, write_table

NEEDS = {"isdb": "ISDB", "run": "--run"}
# where what a figure needs comes from
SOURCES = {
    "isdb": "give isdb10.mat, or a folder of its loops, with --isdb; the International Stiction"
    " Data Base belongs to Jelali and Huang (eds.), Detection and Diagnosis of Stiction in Control"
    " Loops, Springer 2010",
    "run": "give the folder of `simbench run chapter -o RUN` with --run",
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
    """

    id: str
    files: tuple[Path, ...] = ()
    left_out: str = ""


def figure_ids() -> list[str]:
    """Return the ids of all figures, in the order of the chapter."""
    from simbench.catalogue import FIGURES

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
    run: str | Path | None = None,
    isdb: str | Path | None = None,
) -> list[Drawn]:
    """Draw figures and write ID.svg, ID.png and ID.csv for each.

    Parameters
    ----------
    ids : iterable of str
        Ids of figures, or "all".
    out : str or Path
        Folder to write to; it is made where it does not exist.
    run : str or Path, optional
        Folder of a run, which some figures show.
    isdb : str or Path, optional
        ISDB .mat file or folder of real records, which some figures show.

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

    Examples
    --------
    >>> import tempfile
    >>> [f.suffix for f in make_figures(["table-11-4"], tempfile.mkdtemp())[0].files]
    ['.svg', '.png', '.csv']
    >>> make_figures(["fig-11-12"], tempfile.mkdtemp())[0].left_out
    'needs ISDB'
    """
    known = figure_ids()
    wanted: list[str] = []
    for name in ids:
        name = _id(name)
        if name != "all" and name not in known:
            raise UnknownName("figure", name, [*known, "all"])
        wanted += [n for n in (known if name == "all" else [name]) if n not in wanted]
    fault = "" if isdb is None else _no_records(Path(isdb))
    if fault:
        raise RecordError(f"{isdb} {fault}; an ISDB .mat file or a folder of records is needed")
    if run is not None:  # before a folder is made
        read_manifest(run)
    given = {"run": run, "isdb": isdb}
    if not all(_lacking(name, given) for name in wanted):
        remove_stale_temporaries(folder(out))
    return [_one(name, Path(out), given) for name in wanted]


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
    >>> where_from(Drawn("score-map", left_out="needs --run"))
    'figure score-map needs --run: give the folder of `simbench run chapter -o RUN` with --run'
    """
    need = next(key for key, word in NEEDS.items() if f"needs {word}" in drawn.left_out)
    return f"figure {drawn.id} {drawn.left_out}: {SOURCES[need]}"


def _id(name: str) -> str:
    """Return a figure's id for how books and people write it.

    >>> [_id(name) for name in ("11.16", "Figure 11.9", "table_11_3", "score-map")]
    ['fig-11-16', 'fig-11-9', 'table-11-3', 'score-map']
    """
    words = re.sub(r"[\s._-]+", "-", name.strip().lower())
    words = re.sub(r"^fig(ure)?-?(?=\d)", "fig-", words)
    return f"fig-{words}" if re.fullmatch(r"\d+-\d+", words) else words


def _lacking(name: str, given: Mapping[str, str | Path | None]) -> str:
    """Return what a figure needs that is not given; "" where nothing is missing."""
    return next((f"needs {NEEDS[need]}" for need in _wants(name) if given[need] is None), "")


def _wants(name: str) -> list[str]:
    from simbench.catalogue import FIGURES

    figure = FIGURES.load(name.replace("-", "_"))
    return [p for p in inspect.signature(figure.data).parameters if p in NEEDS]


def _no_records(isdb: Path) -> str:
    """Return why a place holds no records; "" where it may."""
    if not isdb.exists():
        return "does not exist"
    readable = isdb.is_dir() or isdb.suffix.lower() in (".mat", *RECORD_FILES)
    return "" if readable else "holds no records"


def _one(name: str, target: Path, given: Mapping[str, str | Path | None]) -> Drawn:
    from simbench.catalogue import FIGURES
    from simbench.figures._style import write_picture

    figure = FIGURES.load(name.replace("-", "_"))
    if lacking := _lacking(name, given):
        return Drawn(name, left_out=lacking)
    try:
        numbers = figure.data(**{need: given[need] for need in _wants(name)})
    except NeedsRecord as error:
        return Drawn(name, left_out=str(error))
    files = tuple(target / f"{name}{suffix}" for suffix in (".svg", ".png", ".csv"))
    picture = figure.draw(numbers)
    for file in files[:2]:
        write_picture(picture, file, simplified=0.3)
    write_table(numbers, files[2], float_format="%.6g")
    return Drawn(name, files)
