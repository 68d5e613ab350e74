"""Only friction that is as visible as it was meant to be counts, and only a denial of it is one."""

from results.studies.plant.trust_extremes import summary_lines


def row(seen, answer, S=1.0, visible=None, fitted=0.0):
    return {
        "S": S,
        "J": S,
        "seen": seen,
        "fitted": fitted,
        "said": answer,
        "probability": 0.5,
        "smallest_visible": visible,
    }


def test_an_answer_counts_where_it_is_right():
    rows = [
        {"buried": row(0.1, "no_stiction", visible=2.0), "plainly visible": row(0.9, "stiction")},
        {
            "buried": row(0.1, "no_stiction", visible=0.5),
            "plainly visible": row(1.0, "no_stiction"),
        },
        {"buried": row(0.0, "cannot tell"), "plainly visible": row(0.5, "no_stiction")},
        {"buried": row(0.1, "no_stiction", fitted=1.0), "plainly visible": row(0.9, "stiction")},
        {
            "buried": row(0.4, "no_stiction", fitted=None),
            "plainly visible": row(0.9, "no_stiction", S=4.0, visible=2.0),
        },
    ]
    _, buried, plain = summary_lines(rows)
    assert "unseen 1 of 3 " in buried
    assert "unseen 1 of 4 " in plain
    assert plain.endswith("no_stiction 2, stiction 2")
