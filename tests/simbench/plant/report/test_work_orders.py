"""Work orders are one row a loop that somebody must see to; what was named last week returns as
such.
"""

import pandas as pd
import pytest
from recorded import STICKY, resting

from simbench.cli import main
from simbench.files import write_record


@pytest.fixture(scope="module")
def weeks(tmp_path_factory):
    place = tmp_path_factory.mktemp("weeks")
    (place / "week").mkdir()
    for name, more, seed in (("FIC101", STICKY, 1), ("LIC7", {}, 3)):
        write_record(resting(seed, 1200, **more), place / "week" / f"{name}.csv")
    for name in ("one", "two"):
        (place / name).mkdir()
    asked = ["report", str(place / "week"), "-j", "1", "-o"]
    assert (
        main([*asked, str(place / "one" / "page.html"), "--orders", str(place / "orders.xlsx")])
        == 0
    )
    again = ["--previous", str(place / "one"), "--orders", str(place / "orders.csv")]
    assert main([*asked, str(place / "two" / "page.html"), *again]) == 0
    return place


def test_only_what_somebody_must_see_to_is_an_order(weeks):
    orders = pd.read_excel(weeks / "orders.xlsx")
    assert orders["loop"].tolist() == ["FIC101"]
    assert orders["who"].tolist() == ["valve"]
    assert orders["cause"].tolist() == ["stiction"]
    assert "PV variance" in orders["best action"][0]


def test_a_cause_that_returns_is_marked(weeks):
    assert pd.read_csv(weeks / "one" / "page.csv")["status"][0] == "new, watch"
    assert pd.read_csv(weeks / "two" / "page.csv")["status"][0] == "again"
    assert pd.read_csv(weeks / "orders.csv")["status"][0] == "again"


def test_the_first_section_lists_who_must_do_what(weeks):
    text = (weeks / "one" / "page.html").read_text(encoding="utf-8")
    assert text.index("Who must do what") < text.index("Where to go first")
    assert "Maintenance, at the valve: FIC101 (stiction, new, watch)." in text
    assert "nats" not in text


def test_a_folder_without_an_earlier_report_is_refused(weeks, capsys):
    assert (
        main(
            [
                "report",
                str(weeks / "week"),
                "-o",
                str(weeks / "x.html"),
                "--previous",
                str(weeks / "week"),
            ]
        )
        == 2
    )
    assert "no table of an earlier report" in capsys.readouterr().err
