"""A page is made of parts: each is drawn as what it is, escaped, and an empty section is left
out.
"""

import math

import pandas as pd
import pytest
from matplotlib.figure import Figure

from simbench.page.document import (
    Commands,
    Details,
    Pictures,
    Points,
    Section,
    Table,
    Text,
    as_html,
    texts,
    two_digits,
    write,
)

ODD = "S < 5 & J"


@pytest.mark.parametrize(
    ("part", "drawn"),
    [
        (Text(ODD), "<p>S &lt; 5 &amp; J</p>"),
        (Text(ODD, "strong"), "<p><b>S &lt; 5 &amp; J</b></p>"),
        (Text(ODD, "bad"), '<p class="bad">S &lt; 5 &amp; J</p>'),
        (Text(ODD, "heading"), "<h3>S &lt; 5 &amp; J</h3>"),
        (Points(iter([ODD])), "<li>S &lt; 5 &amp; J</li>"),
        (Commands(["simbench run a<b", "again"]), "<pre>simbench run a&lt;b\nagain\n</pre>"),
        (Details(ODD, [Text("in it")]), "<summary>S &lt; 5 &amp; J</summary>\n<p>in it</p>"),
    ],
)
def test_a_part_is_drawn_as_what_it_is(part, drawn):
    assert drawn in as_html([part], "here")


def test_a_table_writes_its_columns_as_asked():
    frame = pd.DataFrame({"name": ["<a>"], "share": [0.1234], "cost": [0.5]})
    table = Table(frame, two_digits("share"), beside={"cost": ["0.4-0.6"]})
    html = as_html([table], "t")
    assert '<td class="n" data-v="0.1234">0.12</td>' in html
    assert "0.5 <small>0.4-0.6</small>" in html
    assert "&lt;a&gt;" in html


def test_missing_values_are_empty_cells():
    table = Table(pd.DataFrame({"a": [1.5, math.nan], "b": ["x", None]}))
    html = as_html([table], "t")
    assert '<td class="n" data-v="1.5">1.5</td><td class="name">x</td>' in html
    assert '<td class="n" data-v=""></td><td class="name"></td>' in html


def test_pictures_of_one_page_share_no_id(tmp_path):
    drawn = [(_figure(), "one"), (_figure(), "two")]
    html = as_html([Pictures(drawn), Pictures([(_figure(), "wide")], wide=True)], "p")
    ids = [word.split('"')[1] for word in html.split() if word.startswith('id="')]
    assert len(ids) == len(set(ids)) > 3
    assert [html.count(f"<figcaption>{c}.</figcaption>") for c in ("one", "two", "wide")] == [1] * 3
    assert html.count('<figure class="wide">') == 1


def test_sections_without_parts_are_left_out(tmp_path):
    page = tmp_path / "page.html"
    write(page, "Title", "below", [Section("a", "First", texts(["x"])), Section("b", "Empty", [])])
    html = page.read_text(encoding="utf-8")
    assert '<section id="a">' in html
    assert "Empty" not in html


def _figure():
    figure = Figure()
    figure.subplots().plot([0, 1], [0, 1])
    return figure
