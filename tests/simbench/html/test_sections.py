"""A page is written part by part: that of a thousand loops has a hundred megabytes."""

import tracemalloc

from markupsafe import Markup

from simbench.html.sections import section, write


def test_a_page_of_a_large_plant_is_never_held_whole(tmp_path):
    parts = (Markup(f"<p>{k}{'x' * 1_000_000}</p>") for k in range(60))
    large = {"id": "loops", "title": "Loops", "parts": parts}
    tracemalloc.start()
    write(tmp_path / "page.html", "A plant", "60 loops", [section("a", "A", ["\u25cf"]), large])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert len(text) > 60e6
    assert text.rstrip().endswith("</html>")
