"""The study of rules: what it changes, and that it leaves everything as it was."""

import re

import pytest

from results.studies import rules
from simbench.gap.decide import assess, classify


def test_a_change_holds_in_every_module_that_has_the_constant_and_only_while_it_lasts():
    change = next(c for c in rules.changes("assess.LEAST_NATS") if c[1] == "doubled")
    name, _, old, new = change
    with rules.changed(name, old, new):
        assert assess.LEAST_NATS == classify.LEAST_NATS == 2 * old
    assert assess.LEAST_NATS == classify.LEAST_NATS == old


def test_every_rule_of_the_table_is_found_and_compiled_constants_are_left_alone():
    done = {(name, what) for name, what, _, _ in rules.changes()}
    assert {name for name, what in done if what == "removed"} == set(rules.REMOVED)
    assert ("decide.classify.TEMPERATURE", "halved") in done
    assert not any("kernels" in name for name, _ in done)


@pytest.mark.slow
def test_three_records_are_judged_anew_with_one_constant_changed(capsys, monkeypatch):
    asked = []
    again = rules.again
    monkeypatch.setattr(rules, "again", lambda *a: asked.append(a[2]) or again(*a))
    rules.main(["-n", "3", "--only", "pi_law.RETUNED", "classify._SHARPNESS"])
    text = capsys.readouterr().out
    assert "3 records" in text
    assert len(asked) == 4 * 3
    listed = re.findall(r"pi_law\.RETUNED|classify\._SHARPNESS", text)
    assert len(listed) == 4
