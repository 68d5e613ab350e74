"""A folder of loops: a source and its victim are one event, the source is ranked first, and the
page asks for nothing.
"""

import csv
import json
from pathlib import Path

import chromium
import numpy as np
import pytest
from recorded import STICKY, resting
from scipy.signal import lfilter

from simbench.bench.store.checksums import with_checksum
from simbench.cli import main
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.files import write_record
from simbench.plant.report import fleet
from simbench.plant.report.events import likely_root, shared_oscillations
from simbench.plant.resumed import resumed
from simbench.plant.trust.result import likely


def victim(source):
    """Return a sound loop that the source's PV disturbs through a lag."""
    rng, heard = np.random.default_rng(9), lfilter([0.1], [1.0, -0.9], source.pv - source.pv.mean())
    pv, op = np.zeros(source.n), np.zeros(source.n)
    y = integral = 0.0
    for k in range(source.n):
        y = 0.9 * y + 0.1 * (op[max(k - 1, 0)] + 3.0 * heard[k])
        pv[k] = y + 0.02 * rng.standard_normal()
        integral -= 0.02 * pv[k]
        op[k] = integral - 0.3 * pv[k]
    return LoopRecord(op=op + 50.0, pv=pv + 20.0, Ts=source.Ts, process="self-regulating")


@pytest.fixture(scope="module")
def records():
    source = resting(1, **STICKY)
    slower = {"controller": {"type": "PI", "Kc": 1.2, "Ti": 23.0}}
    return {
        "other": resting(5, **STICKY, **slower),
        "quiet": resting(3),
        "source": source,
        "victim": victim(source),
    }


def test_a_source_and_its_victim_are_one_event_and_an_independent_cycle_is_not(records):
    assert shared_oscillations({n: Prepared(r) for n, r in records.items()}) == [
        ["source", "victim"]
    ]


def test_records_of_different_lengths_share_nothing(records):
    cut = {
        "source": Prepared(records["source"]),
        "victim": Prepared(records["victim"].window(0, 1400)),
    }
    assert shared_oscillations(cut) == []


def test_the_root_is_the_stickiest_then_the_least_like_a_sine():
    assert likely_root(["a", "b"], {"a": 0.2, "b": 0.9}, {"a": 5.0, "b": 0.0}) == ["b", "a"]
    assert likely_root(["a", "b"], {"a": 0.31, "b": 0.29}, {"a": 1.0, "b": 3.0}) == ["b", "a"]


@pytest.mark.usefixtures("two_methods")
def test_the_page_ranks_the_loops_and_is_self_contained(records, tmp_path, capsys):
    folder, page = tmp_path / "plant", tmp_path / "page.html"
    folder.mkdir()
    for name in ("quiet", "source", "victim"):
        write_record(records[name], folder / f"{name}.csv")
    (folder / "notes.csv").write_text("a,b\n1,2\n")
    assert main(["report", str(folder), "-o", str(page), "-j", "1"]) == 0
    assert "likely root source" in capsys.readouterr().out
    with open(tmp_path / "page.csv", newline="") as f:
        rows = {row["loop"]: row for row in csv.DictReader(f)}
    assert rows["source"]["rank"] == "1"
    assert rows["source"]["job"] == "valve"
    assert rows["quiet"]["job"] not in ("valve", "upstream")
    assert rows["victim"]["oscillation"] == rows["source"]["oscillation"] == "1"
    text = page.read_text(encoding="utf-8")
    assert "notes: " in text
    assert text.count("<article") == 3
    assert "src=" not in text
    assert "http" not in text.replace("http://www.w3.org", "")
    assert sorted(f.name for f in tmp_path.iterdir()) == [
        "page.csv",
        "page.html",
        "page.html.judged",
        "plant",
    ]
    if chromium.executable() is not None:
        with chromium.opened(page, 390) as shown:
            assert (
                shown.evaluate(
                    "document.documentElement.scrollWidth - document.documentElement.clientWidth"
                )
                <= 0
            )
            assert shown.errors == []
            assert len(shown.requests) == 1
        assert chromium.lost_on_paper(page) == 0


@pytest.mark.usefixtures("two_methods")
def test_loops_judged_before_a_kill_are_not_judged_again(
    records, trust_once, tmp_path, monkeypatch
):
    folder = tmp_path / "plant"
    folder.mkdir()
    for name in ("quiet", "victim"):
        write_record(records[name], folder / f"{name}.csv")
    count = []

    def dies_at_the_second(record, **more):
        count.append(1)
        if len(count) == 2:
            raise KeyboardInterrupt
        return trust_once(record, **more)

    monkeypatch.setattr(fleet, "trust", dies_at_the_second)
    with pytest.raises(KeyboardInterrupt):
        fleet.survey(folder, jobs=1, keep=tmp_path / "kept")
    again = fleet.survey(folder, jobs=1, keep=tmp_path / "kept")
    assert len(count) == 3
    monkeypatch.setattr(fleet, "trust", trust_once)
    assert fleet.survey(folder, jobs=1).as_text() == again.as_text()


@pytest.mark.usefixtures("two_methods")
def test_a_second_week_judges_only_what_changed(records, trust_once, tmp_path, monkeypatch):
    for week, source in (("week1", "source"), ("week2", "other")):
        (tmp_path / week).mkdir()
        for loop, name in (("FIC101", source), ("LIC7", "quiet")):
            write_record(records[name], tmp_path / week / f"{loop}.csv")
    asked = []
    monkeypatch.setattr(
        fleet,
        "trust",
        lambda record, **more: asked.append(record.tag) or trust_once(record, **more),
    )

    def week(name, *more):
        asked.clear()
        place = tmp_path / f"report {len(list(tmp_path.iterdir()))}"
        place.mkdir()
        assert (
            main(["report", str(tmp_path / name), "-j", "1", "-o", str(place / "page.html"), *more])
            == 0
        )
        return place, sorted(asked)

    first, judged = week("week1")
    assert judged == ["FIC101", "LIC7"]
    same, judged = week("week1", "--previous", str(first))
    assert judged == []
    tables = [(place / "page.csv").read_text(encoding="utf-8") for place in (first, same)]
    assert tables[0].replace("new, watch", "again").replace('"', "") == tables[1].replace('"', "")
    second, judged = week("week2", "--previous", str(first))
    assert judged == ["FIC101"]
    kept = sorted(file.name.split("-")[0] for file in (second / "page.html.judged").iterdir())
    assert kept == [
        "_drawn",
        "_drawn",
        "_one",
        "_one",
    ]  # pictures are drawn anew of a new record only
    assert week("week2", "--previous", str(second), "--process", "integrating")[1] == [
        "FIC101",
        "LIC7",
    ]


@pytest.mark.usefixtures("two_methods")
def test_a_kept_picture_that_would_run_in_the_page_is_drawn_again(records, tmp_path):
    (tmp_path / "plant").mkdir()
    write_record(records["quiet"], tmp_path / "plant" / "LIC7.csv")
    words = ["report", str(tmp_path / "plant"), "-j", "1", "-o", str(tmp_path / "page.html")]
    assert main(words) == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    (kept,) = (tmp_path / "page.html.judged").glob("_drawn-*.json")
    content = json.loads(kept.read_text(encoding="utf-8"))
    content["answer"]["with"][0] = "<svg><script>alert(1)</script></svg>"
    kept.write_text(json.dumps(with_checksum(content)), encoding="utf-8")
    assert main(words) == 0
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page


def test_answers_are_kept_in_the_folder_of_the_call_though_its_processes_began_elsewhere(
    tmp_path, monkeypatch
):
    for name in ("before", "now"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        kept = Path("kept") if name == "now" else None
        assert resumed(likely, [(0.2,), (0.8,)], jobs=2, keep=kept, what="numbers") == [
            "no_stiction",
            "stiction",
        ]
    assert not any((tmp_path / "before").iterdir())
    assert len(list((tmp_path / "now" / "kept").rglob("*.json"))) == 2


def test_a_page_that_cannot_be_written_is_reported_before_anything_is_judged(tmp_path, capsys):
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "no" / "page.html")]) == 2
    assert "cannot be written" in capsys.readouterr().err
