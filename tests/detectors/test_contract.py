"""The contract every detector keeps; the registry finds them, so a new one is tested as soon as its file exists."""

import inspect
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from detectors.judge import judge
from detectors.record import LoopRecord
from detectors.registry import methods

NAMES = methods.names()
CASES = ("stiction", "healthy", "sine", "noise", "constant", "short")
STICKY = {
    # OP a triangle, PV a rounded square, the two together close to an ellipse
    "self-regulating": {"T": 6.0, "Td": 6.0, "Kc": 0.25, "Ti": 5.0, "noise": 0.1, "n": 2500, "kind": "flow"},
    # a level: PV a triangle
    "integrating": {"process": "integrating", "K": 0.1, "Td": 1.0, "Kc": 1.5, "Ti": 30.0, "noise": 0.05, "n": 2000},
}


@pytest.fixture(scope="module")
def records(loop):
    """A function from (case, process) to a record, each built once."""
    rng = np.random.default_rng(3)
    built = {}

    def build(case, process):
        t = np.arange(2000.0)
        about = {"process": process, "kind": "flow" if process == "self-regulating" else "level", "Ts": 1.0}
        if case == "stiction":
            return loop(**STICKY[process])
        if case == "healthy":
            load = np.cumsum(rng.standard_normal(2500)) * 0.2
            return loop(**{**STICKY[process], "S": 0.0, "J": 0.0, "load": load})
        if case == "sine":
            op = 50.0 + 5.0 * np.sin(2 * np.pi * t / 50.3)
            return LoopRecord(op=op, pv=100.0 - op, mv=op, **about)
        if case == "noise":
            op, pv, mv = 50.0 + rng.standard_normal((3, 2000))
            return LoopRecord(op=op, pv=pv, mv=mv, **about)
        if case == "constant":
            return LoopRecord(op=np.full(2000, 50.0), pv=np.full(2000, 3.0), mv=np.full(2000, 50.0), **about)
        return loop(**STICKY[process]).window(0, 20)

    def get(case, process):
        if (case, process) not in built:
            built[case, process] = build(case, process)
        return built[case, process]

    return get


def pairs():
    """Every method with every process type it was made for."""
    return [(name, process) for name in NAMES for process in methods.load(name).METHOD.process]


@pytest.mark.parametrize(("name", "process"), pairs())
@pytest.mark.parametrize("case", CASES)
def test_verdict_on_the_six_plain_cases(name, process, case, records):
    exempt = methods.load(name).METHOD.exempt
    if case in exempt:
        pytest.skip(exempt[case])
    verdict = judge(records(case, process), [name])[0]
    if case == "stiction":
        assert verdict.verdict == "stiction", verdict
    else:
        assert verdict.verdict != "stiction", verdict
    if case in ("constant", "short"):
        assert verdict.verdict == "no_decision", verdict


@pytest.mark.parametrize("name", NAMES)
def test_exempt_cases_are_cases_of_this_contract_and_have_a_reason(name):
    for case, reason in methods.load(name).METHOD.exempt.items():
        assert case in CASES
        assert len(reason) > 20


@pytest.mark.parametrize(("name", "process"), pairs())
def test_input_is_unchanged_and_the_answer_repeats_itself(name, process, records):
    record = records("stiction", process)
    before = {s: getattr(record, s).copy() for s in ("op", "pv", "mv")}
    first, second = (judge(record, [name])[0].as_json() for _ in range(2))
    assert first == second
    for signal, values in before.items():
        assert np.array_equal(getattr(record, signal), values)


@pytest.mark.parametrize(("name", "process"), pairs())
def test_obvious_stiction_scores_higher_than_every_case_without(name, process, records):
    if "stiction" in methods.load(name).METHOD.exempt:
        pytest.skip(methods.load(name).METHOD.exempt["stiction"])
    top = judge(records("stiction", process), [name])[0].score
    for case in ("healthy", "sine", "noise"):
        verdict = judge(records(case, process), [name])[0]
        assert np.isnan(verdict.score) or verdict.score < top, (case, verdict)


@pytest.mark.parametrize("name", NAMES)
def test_thresholds_are_the_keywords_of_detect_and_lie_inside_their_range(name):
    module = methods.load(name)
    keywords = [p.name for p in inspect.signature(module.detect).parameters.values() if p.kind is p.KEYWORD_ONLY]
    assert sorted(keywords) == sorted(module.METHOD.thresholds)
    for rule in module.METHOD.thresholds.values():
        assert rule.low <= rule.default <= rule.high
        assert rule.unit
        assert rule.source
        assert rule.says


@pytest.mark.parametrize("name", NAMES)
def test_docstring_says_needs_rule_limits_and_source(name):
    module = methods.load(name)
    text = (module.__doc__ or "") + (module.detect.__doc__ or "")
    for word in ("Needs", "Parameters", "Indices", "Rule", "Not for", "Source", ">>>"):
        assert word in text, word


@pytest.mark.parametrize(("name", "process"), pairs())
def test_verdict_does_not_change_when_pv_is_scaled_and_shifted(name, process, records):
    fast = methods.load(name).METHOD.budget == "fast"
    kept = [replace(records(case, process), mv=None) for case in ("stiction", "healthy", "sine")]
    if methods.load(name).METHOD.needs_mv and process == "integrating":
        kept = [replace(records(case, process)) for case in ("stiction", "healthy")]
    expected = [judge(record, [name])[0].verdict for record in kept]

    @settings(max_examples=8 if fast else 2, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(st.floats(0.01, 100.0), st.sampled_from([1.0, -1.0]), st.floats(-1e4, 1e4))
    def holds(scale, sign, shift):
        for record, verdict in zip(kept, expected, strict=True):
            moved = replace(record, pv=sign * scale * record.pv + shift)
            assert judge(moved, [name])[0].verdict == verdict

    holds()


@pytest.mark.parametrize(("name", "process"), pairs())
def test_verdict_does_not_change_when_op_and_its_span_are_scaled_and_shifted(name, process, records):
    fast = methods.load(name).METHOD.budget == "fast"
    kept = [records(case, process) for case in ("stiction", "healthy", "sine")]
    kept = [replace(record, op_span=(0.0, 100.0)) for record in kept]
    expected = [judge(record, [name])[0].verdict for record in kept]

    @settings(max_examples=6 if fast else 2, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(st.floats(0.01, 100.0), st.floats(-1e3, 1e3))
    def holds(scale, shift):
        for record, verdict in zip(kept, expected, strict=True):
            moved = replace(record, op=scale * record.op + shift, op_span=(shift, 100.0 * scale + shift))
            assert judge(moved, [name])[0].verdict == verdict

    holds()
