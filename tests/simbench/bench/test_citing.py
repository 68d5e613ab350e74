"""BibTeX of a run names every publication that its methods and valves state, once."""

import json
import re
from pathlib import Path

import pytest
import yaml
from bench_fixtures import NEVER

from simbench.bench import citing
from simbench.bench.citing import cite, entries_in
from simbench.bench.execute.run import run_grid
from simbench.bench.score.scoring import score_run
from simbench.bench.score.shipped import shipped
from simbench.cli import main
from simbench.detectors.plugins.registry import methods
from simbench.loop.parameters import VALVES
from simbench.scenarios import grid as grids
from simbench.scenarios.grid import load_grid

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A small run by two methods and a plug-in whose file is not given afterwards."""
    place = tmp_path_factory.mktemp("cite")
    (place / "never.py").write_text(NEVER)
    return run_grid(
        "smoke", place / "run", ["horch", "hammerstein", "never"], plugins=[place / "never.py"], n=8
    )


def entries_of(text):
    """Return the fields of BibTeX entries by key."""
    found = re.findall(r"@(\w+)\{([\w-]+),\n(.*?)\n\}\n", text, re.DOTALL)
    assert len(found) == text.count("@")
    return {
        key: dict(re.findall(r"  (\w+) = \{(.*)\},?(?:\n|$)", fields)) for _, key, fields in found
    }


@pytest.mark.parametrize(
    ("source", "found"),
    [
        (
            "M. Rossi, C. Scali (2005), Journal of Process Control 15, 505-514; Eq 11.14",
            ["M. Rossi and C. Scali | 2005 | Journal of Process Control | 15 | 505--514"],
        ),
        (
            "Karnopp (1985), J. Dynamic Systems, Measurement and Control 107, 100-103; actuator:"
            " Table 1, after Kayihan and Doyle (2000), Control Engineering Practice 8, 799-812",
            [
                "Karnopp | 1985 | J. Dynamic Systems, Measurement and Control | 107 | 100--103",
                "Kayihan and Doyle | 2000 | Control Engineering Practice | 8 | 799--812",
            ],
        ),
        ("Table 11.2 after Forsman (2000). Warping is own", ["Forsman | 2000"]),
        ("ISA-51.1 (1979), dead band", ["ISA-51.1 | 1979 | dead band"]),
        ("Choudhury et al. (2008), Springer", ["Choudhury and others | 2008 | Springer"]),
        ("definition: MV = OP", []),
    ],
)
def test_publications_are_read_from_the_words_of_a_source(source, found):
    assert [" | ".join(fields.values()) for _, fields in entries_in(source)] == found


@pytest.mark.parametrize("folder", [methods, VALVES], ids=["methods", "valves"])
def test_every_source_of_the_package_names_a_publication_a_standard_or_a_definition(folder):
    for name in folder.every_name():
        source = citing._source_in_file(folder, name)
        assert entries_in(source) or re.match("definition|IEC |GB/T ", source), name


def test_a_run_is_cited_by_what_it_used(run, capsys):
    assert main(["cite", str(run)]) == 0
    entries = entries_of(capsys.readouterr().out)
    assert entries["horch1999"]["pages"] == "1221--1231"
    assert entries["jelali2008"]["note"] == "used by method hammerstein"
    assert entries["jelali2013"]["note"].endswith("; used by method horch")
    assert entries["choudhury2005"]["doi"] == "10.1016/j.conengprac.2004.05.005"
    # what no text of others confirms is left out
    assert "doi" not in entries["horch1999"]
    released = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert entries["simbench"]["year"] == str(released["date-released"])[:4]
    assert entries["simbench"]["version"] == released["version"]
    assert "stiction" in entries["horch1999"]["title"]
    # of a plug-in the run keeps what its file states
    assert entries["nobody2020"]["note"] == "used by method never"
    assert "used by valve choudhury" in entries["choudhury2005"]["note"]
    hash_of = json.loads((run / "manifest.json").read_text())["benchmark"]["hash"]
    assert entries["smoke-2"]["note"] == hash_of
    assert "yamashita2006" not in entries


def test_shipped_verdicts_are_cited_and_so_are_the_methods_beside_which_a_run_is_ranked(tmp_path):
    package = entries_of(cite(shipped("ci")))
    assert {"simbench", "jelali2013", "ci-4", "he2007", "horch1999"} <= set(package)
    alone, beside = tmp_path / "alone", tmp_path / "beside"
    run_grid("ci", alone, ["horch"], n=4)
    run_grid("ci", beside, ["horch"], n=4, with_reference=True)
    assert "he2007" not in entries_of(cite(alone))
    of_methods = {key for key, e in package.items() if "used by method" in e.get("note", "")}
    assert of_methods <= set(entries_of(cite(beside)))


def test_a_grid_of_ones_own_is_cited_by_whom_it_states(tmp_path):
    grid = Path(grids.__file__).with_name("grids") / "smoke.toml"
    text = grid.read_text(encoding="utf-8")
    mine = tmp_path / "mine.toml"
    mine.write_text(f'author = "A. Person"\ndate = "2026-11"\n{text}')
    folder = run_grid(str(mine), tmp_path / "run", ["he"], n=2)
    entry = next(e for e in entries_of(cite(folder)).values() if "benchmark" in e.get("title", ""))
    assert (entry["author"], entry["date"]) == ("A. Person", "2026-11")
    assert load_grid(str(mine)).hash == load_grid("smoke").hash


def test_every_article_of_the_package_has_a_title():
    for folder in (methods, VALVES):
        for name in folder.every_name():
            for kind, fields in entries_in(citing._source_in_file(folder, name)):
                if kind == "article":
                    assert citing._with_details(fields).get("title"), (name, fields)


def test_the_address_of_the_package_is_cited_where_there_is_one(run, monkeypatch):
    assert "url" not in entries_of(cite(run))["simbench"]
    monkeypatch.setattr(citing, "_url", lambda: "https://example.org/simbench")
    assert entries_of(cite(run))["simbench"]["url"] == "https://example.org/simbench"


def test_a_plug_in_is_no_method_of_the_package(run):
    rows = score_run(run).table.drop_duplicates("method").set_index("method")
    assert (rows.own["never"], rows.own["horch"]) == (True, False)
    assert (rows.answered == "package").all()
    assert rows.division.isna()["never"]
    assert rows.division["horch"] == "published"


def test_two_publications_of_one_year_have_two_keys_and_one_has_one(run, monkeypatch):
    sources = [
        "A. One (2001), J. Odd 1, 2-3; B. One (2001), J. Odd 1, 4-5",
        "One (2001), Odd 1, 2-3",
    ]
    monkeypatch.setattr(citing, "_sources", lambda manifest, valves: [(s[:5], s) for s in sources])
    entries = entries_of(cite(run))
    assert [entries[key]["pages"] for key in ("one2001", "one2001b")] == ["2--3", "4--5"]
    assert "one2001c" not in entries
