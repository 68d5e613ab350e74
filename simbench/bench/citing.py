"""Cite what a run used: BibTeX of its methods, valve models and benchmark, from the sources that
their files state.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from importlib.metadata import metadata
from pathlib import Path
from string import ascii_lowercase

from simbench import __version__
from simbench.bench.publications import details
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.score.shipped import with_shipped
from simbench.bench.store.benchmark import BENCHMARK
from simbench.bench.store.reading import read_book
from simbench.detectors.errors import UnknownName
from simbench.detectors.plugins.registry import PluginFolder
from simbench.detectors.plugins.registry import methods as registry
from simbench.loop.parameters import VALVES

# M.A.A.S. Choudhury, S.L. Shah (2004), Automatica 40, 1719-1728
_NAME = r"(?:(?:[A-Z]\.[- ]?)+)?[A-Z][\w'-]+(?: de [A-Z]\w+)?"
_STANDARD = r"[A-Z]{2,}-[\d.]+\d"
_AND = r", and |, | and | & "
_NAMED = re.compile(rf"({_STANDARD}|{_NAME}(?:(?:{_AND}){_NAME})*(?: et al\.)?) \((\d{{4}})\)")
_IN_JOURNAL = re.compile(r"([A-Z].*?) (\d+), (\d+)-(\d+)")
_DEFINITION = "definition"  # begins the SOURCE of what nobody has published
_BOOK = "jelali2013"
_YEAR = "2026"  # of the version; CITATION.cff states the same
_ALWAYS = {
    "simbench": (
        "software",
        {
            "author": "{The simbench authors}",
            "title": "simbench: a closed-loop simulation testbench for valve-stiction detectors",
            "version": __version__,
            "year": _YEAR,
        },
    ),
    # of Table 11.3, whose labels every run carries, and of the methods' description
    _BOOK: (
        "book",
        {
            "author": "M. Jelali",
            "title": "Control Performance Management in Industrial Automation",
            "publisher": "Springer",
            "address": "London",
            "year": "2013",
            "note": "Chapter 11: Diagnosis of Stiction-Related Actuator Problems",
        },
    ),
}
_OF_GRID = {"author": "author", "date": "date"}
_Entry = tuple[str, dict[str, str]]


def cite(folder: str | Path) -> str:
    """Return BibTeX of the methods, valve models and benchmark that a run used.

    Parameters
    ----------
    folder : str or Path
        Folder of a run or a baseline.

    Returns
    -------
    str
        One entry per publication; its note says what of the run stands on it. A plug-in
        is cited by its name and the source that its file states; a run `--with-reference` cites
        the methods beside which it is ranked, too.

    Raises
    ------
    RunError
        When the folder holds no run, or a damaged one.

    Notes
    -----
    Entries hold what the source line of a method or a valve model states; an article of the package
    has a title, and a DOI where one is known. Not a list of references to paste unread.

    Examples
    --------
    >>> from simbench.bench.citing import entries_in
    >>> entries_in("A. Horch (1999), Control Engineering Practice 7, 1221-1231; own bounds")
    [('article', {'author': 'A. Horch', 'year': '1999', 'journal': 'Control Engineering Practice', \
'volume': '7', 'pages': '1221--1231'})]
    """
    book = with_shipped(read_book(folder))
    found: dict[str, _Entry] = dict(_ALWAYS)
    if url := _url():
        found["simbench"] = "software", found["simbench"][1] | {"url": url}
    benchmark = book.manifest[BENCHMARK]
    # what the grid file of a user states of itself
    stated = book.manifest.get("grid_content", {})
    whose = {name: stated[key] for name, key in _OF_GRID.items() if stated.get(key)}
    named = {"title": f"simbench benchmark {benchmark['name']}", "note": benchmark["hash"]}
    found[benchmark["name"]] = "misc", {**whose, **named}
    users: dict[str, list[str]] = {}
    for what, source in _sources(book.manifest, sorted(set(book.axes["valve"].tolist()))):
        plain = [("misc", {"title": what, "howpublished": " ".join(source.split()).strip(".")})]
        for entry in entries_in(source) or plain:
            users.setdefault(_key_of(entry, found), []).append(what)
    for key, names in users.items():
        kind, fields = found[key]
        fields = _with_details(fields)
        said = [fields["note"]] if "note" in fields else []
        used = f"used by {', '.join(dict.fromkeys(names))}"
        found[key] = kind, fields | {"note": "; ".join([*said, used])}
    return "\n".join(_text(key, *entry) for key, entry in found.items())


def _url() -> str:
    """Return the address of the package's home, where its metadata have one."""
    about = metadata("stiction-simbench")
    stated = [line.partition(", ")[2] for line in about.get_all("Project-URL") or []]
    return (about.get("Home-page") or "").strip() or next(iter(stated), "")


def _with_details(fields: dict[str, str]) -> dict[str, str]:
    """Return an entry with its title and DOI, where they are known."""
    surnames, year, pages = _mark(("", fields))
    known = details(surnames[0], year, pages.partition("--")[0])
    first = {name: fields[name] for name in ("author",) if name in fields}
    return {**first, **known, **fields}


def entries_in(source: str) -> list[_Entry]:
    """Return the publications that a source line names, in its order."""
    text = " ".join(source.split())
    named = [*_NAMED.finditer(text)]
    begins = [found.start() for found in named]
    return [
        _entry(found[1], found[2], text[found.end() : end].partition(";")[0])
        for found, end in zip(named, [*begins[1:], len(text)])
    ]


def _entry(authors: str, year: str, after: str) -> _Entry:
    where = after[2:].strip(", .") if after.startswith(", ") else ""
    if re.fullmatch(_STANDARD, authors):
        whose = {"title": authors}
    else:
        names = re.sub(r" et al\.$", " and others", authors)
        whose = {"author": " and ".join(re.split(_AND, names))}
    if printed := _IN_JOURNAL.match(where):
        journal, volume, first, last = printed.groups()
        printed_in = {"journal": journal, "volume": volume, "pages": f"{first}--{last}"}
        return "article", {**whose, "year": year, **printed_in}
    at = where.partition(". ")[0]
    return "misc", {**whose, "year": year, **({"howpublished": at} if at else {})}


def _sources(manifest: Mapping, valves: list[str]) -> Iterator[tuple[str, str]]:
    """Yield what a run used, in words, with the source that its file states."""
    for name, about in manifest["methods"].items():
        if name in registry.every_name():
            yield f"method {name}", _source_in_file(registry, name)
        elif name != ORACLE:  # of a plug-in the run keeps what its file states
            yield f"method {name}", about.get("source") or "plug-in, file not given"
    for name in valves:
        source = _source_in_file(VALVES, name)
        if not source.startswith(_DEFINITION):
            yield f"valve {name}", source


def _source_in_file(folder: PluginFolder, name: str) -> str:
    """Return the source that a plug-in's file states: of a detector the last paragraph that begins
    with it, which is longer than the line that tables show.
    """
    try:
        module = folder.load(name)
    except UnknownName:
        return "plug-in, file not given"
    if hasattr(module, "SOURCE"):
        return module.SOURCE
    told = re.search(r"^Source: (.*?)(?:\n\n|\Z)", module.__doc__ or "", re.DOTALL | re.MULTILINE)
    return told[1] if told else module.METHOD.source


def _key_of(entry: _Entry, found: dict[str, _Entry]) -> str:
    """Return the key of an entry, which joins those that are there where none is the same."""
    surnames, year, _ = mark = _mark(entry)
    if (surnames, year) == (("Jelali",), "2013"):
        return _BOOK
    first = re.sub(r"\W", "", surnames[0]).lower() + year
    keys = (first, *(first + letter for letter in ascii_lowercase[1:]))
    return next(key for key in keys if _mark(found.setdefault(key, entry)) == mark)


def _mark(entry: _Entry) -> tuple[tuple[str, ...], str, str]:
    """Return what tells a publication from others, however its authors' first names are written."""
    fields = entry[1]
    authors = re.split(" and ", fields.get("author", fields.get("title", "")))
    surnames = tuple(name.split()[-1] for name in authors)
    return surnames, fields.get("year", ""), fields.get("pages", "")


def _text(key: str, kind: str, fields: Mapping[str, str]) -> str:
    lines = (f"  {name} = {{{_escape_latex(value)}}}" for name, value in fields.items())
    return f"@{kind}{{{key},\n" + ",\n".join(lines) + "\n}\n"


def _escape_latex(text: str) -> str:
    return re.sub(r"([&%#_$])", r"\\\1", text)
