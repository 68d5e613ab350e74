"""The contract every detector keeps: all built-ins keep it, and each way of breaking it is caught
with one sentence.
"""

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from simbench.detectors.contract.detector import DETECTOR_RULES
from simbench.detectors.contract.engine import Contract
from simbench.detectors.contract.watch import call_guarded
from simbench.detectors.errors import RecordError
from simbench.detectors.example_loop import CASES, example_record
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods
from simbench.detectors.prepared import Prepared

NAMES = methods.names()
SOUND = '''"""Fullness of PV over that of OP."""

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="PV fuller than OP", source="a test", process=("self-regulating",), front_end=False,
    min_samples=3,
    thresholds={"least": Threshold(0.02, "-", 0.0, 0.2, "a test", "above it: stiction")},
)
CALLS = []


def fullness(x):
    return float(np.abs(x).mean() / np.sqrt((x**2).mean()))


def detect(prepared, *, least):
    CALLS.append(None)
    if not prepared.oscillation.sustained:
        return Verdict("own", NO_DECISION, reason="no oscillation")
    op, pv = prepared.clean("op"), prepared.clean("pv")
    more = fullness(pv) - fullness(op)
    answer = STICTION if more > least else NO_STICTION
    return Verdict("own", answer, more, {"fuller": more}, reason=f"by {more:.3f}")
'''
BROKEN = [
    # what is exchanged, for what, and the words of the sentence
    ('reason="no oscillation"', 'reason=" "', "gives no reason for 'no_decision'"),
    ('reason="no oscillation"', 'reason=""', "a verdict without a reason"),
    (
        'return Verdict("own", NO_DECISION, reason="no oscillation")',
        'return "no stiction"',
        "answers 'no stiction'",
    ),
    (
        "more > least",
        "more > least and prepared.record.pv.std() > 0.5",
        "follows PV's unit: 'stiction' becomes 'no_stiction'",
    ),
    (
        "more > least",
        "more > least and prepared.record.op.std() < 20",
        "follows OP's unit: 'stiction' becomes 'no_stiction'",
    ),
    (
        "if not prepared.oscillation.sustained:",
        "if 1 / np.ptp(prepared.record.pv) < 0:",
        "about a dead record (constant",
    ),
    (
        "if not prepared.oscillation.sustained:",
        "if 1 / prepared.record.pv[50] < 0:",
        "raises IndexError",
    ),
    (
        "if not prepared.oscillation.sustained:",
        "if int(prepared.oscillation.period_s) < 0:",
        "raises ValueError (cannot convert float NaN to integer)",
    ),
    (
        "more > least",
        "more > least and prepared.record.Ts > 0.01",
        "follows the unit of time: 'stiction' becomes",
    ),
    (
        "more > least",
        "more > least and prepared.record.pv.max() > 0",
        "follows the sign of OP and PV: 'stiction' becomes",
    ),
    ("more > least", "more > least or prepared.step < 3", "follows the sampling: "),
    (
        "more = ",
        "op = prepared.record.op; op.flags.writeable = True; op += 1.0; more = ",
        "'op' is another after detect",
    ),
    ("more = ", "pv *= 1.1; more = ", "'clean pv' is another after detect"),
    (
        "more = ",
        "prepared.record.pv[0] = 0.0; more = ",
        "writes into what it was given (assignment destination is read-only)",
    ),
    (
        'reason=f"by {more:.3f}"',
        'reason=f"by {more:.3f}, call {len(CALLS)}"',
        "is not deterministic",
    ),
    ("more = ", 'print("more"); more = ', "prints 'more'"),
    ("more = ", "np.float64(0.0) / np.float64(0.0); more = ", "warns: RuntimeWarning"),
    ('{"fuller": more}', '{"fuller": "much"}', "gives the indices {'fuller': 'much'}"),
    ("answer, more,", "answer, str(more),", "a finite number is needed"),
    ("answer, more,", "answer, np.nan,", "gives the score nan with 'no_stiction'"),
    ('{"fuller": more}', '{"fuller": np.inf}', "gives the index fuller = inf"),
    (
        '0.02, "-", 0.0, 0.2',
        '0.5, "-", 0.0, 0.2',
        "its default 0.5 lies outside its range 0.0 to 0.2",
    ),
    (
        "*, least)",
        "*, most=1.0)",
        "must take the prepared record and, by keyword, the thresholds of METHOD: least",
    ),
    (
        'process=("self-regulating",)',
        'process=("flow",)',
        "METHOD.process = ('flow',), allowed: self-regulating, integrating",
    ),
    ('title="PV fuller than OP"', 'title=""', "METHOD.title is empty"),
]


@pytest.fixture
def contract_of(tmp_path):
    def check(text: str) -> Contract:
        (tmp_path / "own.py").write_text(text)
        name = methods.add_file(tmp_path / "own.py")
        return DETECTOR_RULES.check(name)

    yield check
    methods.forget("own")


@pytest.mark.parametrize("name", NAMES)
def test_every_detector_keeps_its_contract(name):
    contract = DETECTOR_RULES.check(name)
    assert (contract.broken, contract.notes) == ((), ())


@pytest.mark.parametrize("name", NAMES)
def test_docstring_states_needs_rule_limits_and_source(name):
    module = methods.load(name)
    # whichever words a line ends between
    text = " ".join(((module.__doc__ or "") + (module.detect.__doc__ or "")).split())
    for word in ("Needs", "Parameters", "Indices", "Rule", "Not for", "Source", ">>>"):
        assert word in text, word


def test_a_sound_detector_of_a_stranger_keeps_it(contract_of):
    assert contract_of(SOUND) == Contract("detector", "own", ())


@pytest.mark.parametrize(("old", "new", "words"), BROKEN, ids=[words for *_, words in BROKEN])
def test_each_way_of_breaking_it_is_one_sentence(contract_of, old, new, words):
    assert SOUND.count(old) == 1
    contract = contract_of(SOUND.replace(old, new))
    assert any(words in sentence for sentence in contract.broken), contract.broken
    assert not any("\n" in sentence for sentence in contract.broken)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("answer, more,", "answer, -more,", "should mean stickier"),
        ("more > least", "more < least", "says 'no_stiction' on the record 'stiction'"),
        ("more > least", "more > -1.0", "says 'stiction' on the record 'sine'"),
    ],
)
def test_a_poor_detector_keeps_the_contract_with_a_remark(contract_of, old, new, words):
    contract = contract_of(SOUND.replace(old, new))
    assert contract.kept
    assert any(note.startswith("quality: ") and words in note for note in contract.notes)


def test_a_fault_on_every_record_is_one_sentence_with_their_number(contract_of):
    contract = contract_of(SOUND.replace("more = ", "prepared.record.flow; more = "))
    text = "raises AttributeError ('LoopRecord' object has no attribute 'flow'), on the record "
    assert len(contract.broken) == 1, contract.broken
    assert contract.broken[0].startswith(f"{text}'stiction' (")
    assert contract.broken[0].endswith(", and in 1 other case")


def test_a_memory_of_the_last_set_point_is_detected(contract_of):
    remembers = """
    CALLS.append(None if prepared.record.sp is None else float(prepared.record.sp[0]))
    if CALLS[-1] is not None and CALLS[-2:-1] == CALLS[-1:]:
        return Verdict("own", NO_STICTION, -9.0, reason="a sibling")
"""
    contract = contract_of(SOUND.replace("    CALLS.append(None)\n", remembers))
    assert any("depends on what was asked before" in sentence for sentence in contract.broken), (
        contract.broken
    )


def test_a_verdict_that_knows_a_record_by_its_last_digits_is_detected(contract_of):
    text = SOUND.replace("CALLS = []", "CALLS, MORE = [], []")
    contract = contract_of(
        text.replace("more > least", "(MORE.append(more) or abs(more - MORE[0]) < 1e-12)")
    )
    assert any(
        "hangs on the last digits: 'stiction' becomes" in sentence for sentence in contract.broken
    ), contract.broken


def test_the_direction_of_time_counts_only_for_a_method_that_claims_to_be_free_of_it(contract_of):
    directed = SOUND.replace("more > least", "more > least and pv.argmax() < pv.size // 2")
    claims = directed.replace("front_end=False", "front_end=False, reversible=True")
    assert not any("direction of time" in sentence for sentence in contract_of(directed).broken)
    assert any(
        "follows the direction of time" in sentence for sentence in contract_of(claims).broken
    )
    assert contract_of(SOUND.replace("front_end=False", "front_end=False, reversible=True")).kept


def test_an_exempt_case_needs_its_reason(contract_of):
    named = SOUND.replace("more > least", "more < least").replace(
        "min_samples=3", 'min_samples=3, exempt={"stiction": "R"}'
    )
    assert contract_of(named).broken == ("METHOD.exempt: 'stiction' is left out without a reason",)


def test_a_detector_asked_directly_refuses_a_dead_record_in_one_sentence():
    dead = Prepared(example_record("constant", "self-regulating"))
    with pytest.raises(RecordError, match="no period found in OP or PV"):
        methods.load("ellipse").detect(dead, **methods.load("ellipse").METHOD.defaults())


def test_watching_lets_nobody_else_hear_it(capsys):
    guarded = call_guarded(lambda: print("aloud") or 7)
    assert (guarded.value, guarded.faults, capsys.readouterr().out) == (7, ["prints 'aloud'"], "")


def pairs():
    """Every method with every process type it was made for."""
    return [(name, process) for name in NAMES for process in methods.load(name).METHOD.process]


@pytest.mark.slow  # the contract itself asks in two other units of each
@pytest.mark.parametrize("signal", ["pv", "op"])
@pytest.mark.parametrize(("name", "process"), pairs())
def test_no_unit_of_pv_or_op_changes_a_verdict(name, process, signal):
    method = methods.load(name).METHOD
    cases = [example_record(case, process) for case in ("stiction", "healthy", "sine")]
    if signal == "op":
        cases = [replace(record, op_span=(0.0, 100.0)) for record in cases]
    elif method.needs_mv and process == "integrating":
        cases = cases[:2]
    else:
        cases = [replace(record, mv=None) for record in cases]
    expected = [judge(record, [name])[0].verdict for record in cases]

    @settings(
        max_examples=6 if method.budget == "fast" else 2,
        deadline=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    @given(
        st.floats(0.01, 100.0),
        st.sampled_from([1.0, -1.0] if signal == "pv" else [1.0]),
        st.floats(-1e4, 1e4) if signal == "pv" else st.floats(-1e3, 1e3),
    )
    def holds(scale, sign, shift):
        span = {"op_span": (shift, 100.0 * scale + shift)} if signal == "op" else {}
        for record, verdict in zip(cases, expected, strict=True):
            moved = sign * scale * getattr(record, signal) + shift
            assert judge(replace(record, **{signal: moved}, **span), [name])[0].verdict == verdict

    holds()


@pytest.mark.parametrize("case", CASES)
def test_example_records_are_what_they_are_called(case):
    record = example_record(case, "self-regulating")
    assert record.n == (
        20 if case == "short" else 2500 if case in ("stiction", "healthy") else 2000
    )
    assert (record.op.std() == 0.0) == (case == "constant")
