"""The concepts page tells the exceptions to Table 11.3 that the figure finds."""

import re
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).parents[3]


def test_the_page_on_stiction_tells_both_exceptions_to_the_table():
    rows = pd.read_csv(ROOT / "results" / "figures" / "table-11-3.csv")
    off = rows[rows.disagreements.notna()]
    page = (ROOT / "docs" / "site" / "concepts" / "stiction.md").read_text(encoding="utf-8")
    page = re.sub(r"<!--.*?-->", "", page)
    told = {(int(a), int(b)) for a, b in re.findall(r"(\d+) of (\d+)", page)}
    # of cells that the table says do not cycle, how many of how many simulated loops do
    assert {(int(r.cycled), int(r.simulated)) for r in off.itertuples()} <= told
