"""The table of what healthy records are worth counts what was asked."""

from results.studies import healthy


def test_right_answers_of_an_effect_and_names_of_a_healthy_loop_are_counted_by_records():
    answers = [
        ("noise", ["none", "noise", "noise"]),
        ("noise", ["noise", "noise", "unknown"]),
        ("none", ["drift", "unknown", "none"]),
    ]
    rows = [
        {"world": "own", "true": true, "n": n, "said": said}
        for true, every in answers
        for n, said in enumerate(every)
    ]
    counted = healthy.table(rows).loc["own"]
    assert counted.loc["noise, right"].tolist() == [1, 2, 1, 2]
    assert counted.loc["healthy, but named"].tolist() == [1, 0, 0, 1]
    every = healthy.table(rows).dropna().astype(int)
    assert healthy.total(every) == (
        "of 2 records with an effect 1, 2 and 1 are named rightly;"
        " of 1 without 1, 0 and 0 are named"
    )


def test_a_record_is_drawn_with_its_history_and_asked_with_each_length_of_it():
    (entry,) = [one for one in healthy.entries(1, 0) if one["effect"] == "noise"][2:]
    rows = healthy.asked("own", 0, entry)
    assert [row["n"] for row in rows] == [0, 1, 2]
    assert {row["true"] for row in rows} == {"noise"}
    assert not any(row["said"].startswith("refused") for row in rows)
