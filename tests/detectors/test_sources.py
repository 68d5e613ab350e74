"""Arrays, tables and runs as records; functions and objects as detectors."""

import numpy as np
import pandas as pd
import pytest

import simbench as sb
from simbench.detectors.errors import AnswerError, ParameterError, RecordError
from simbench.detectors.sources import as_record
from simbench.detectors.verdict import Verdict

t = np.arange(600.0)
OP, PV = 50.0 + np.sin(t / 8), 20.0 - np.sin(t / 8)
FRAME = pd.DataFrame({"t": 2.0 * t, "OP": OP, "PV": PV})


class Level:
    """Says stiction where PV moves by more than a level; remembers what it saw."""

    def __init__(self, level=0.5):
        self.level = level
        self.seen = 0

    def detect(self, record):
        self.seen += 1
        return Verdict(
            "level",
            "stiction" if record.pv.std() > self.level else "no_stiction",
            float(self.seen),
            reason="std",
        )


class Cloned(Level):
    """The same with scikit-learn's way of being copied."""

    def get_params(self, deep=True):
        return {"level": self.level}


@pytest.mark.parametrize("detector", [Level(), Cloned()])
def test_a_detector_keeps_no_state_between_records(detector):
    for _ in range(2):
        assert sb.detect(FRAME, detector)[type(detector).__name__.lower()].score == 1.0
    assert detector.seen == 0


def test_what_a_function_does_wrong_is_its_answer():
    def wrong(record):
        raise ValueError("perhaps")

    report = sb.detect(FRAME, [wrong, "horch"])
    assert "perhaps" in report["wrong"].reason
    assert report["horch"].verdict == "no_stiction"


def two(op, pv):
    return True


def number(record):
    return 0.7


def word(record):
    return "perhaps"


class Two:
    """Takes what no detector is given."""

    def detect(self, op, pv):
        return True


FORMS = [
    (
        two,
        r"two\(op, pv\) cannot be called with one record; the right form is: def detect\(record\)",
    ),
    (Two(), r"detect\(op, pv\) cannot be called with one record"),
    (
        number,
        (
            r"detector 'number': answers 0\.7; a Verdict, one of .* for example: return"
            r" record\.pv\.std\(\) > 0\.5"
        ),
    ),
    (word, "detector 'word': answers 'perhaps'; a Verdict, one of"),
]


@pytest.mark.parametrize(("detector", "words"), FORMS)
@pytest.mark.parametrize("verb", ["detect", "run"])
def test_a_detector_of_the_wrong_form_is_one_sentence_before_any_record_is_judged(
    detector, words, verb, tmp_path
):
    calls = {
        "detect": lambda: sb.detect(FRAME, [detector, "horch"]),
        "run": lambda: sb.run("smoke", [detector, "horch"], out=tmp_path / "run"),
    }
    with pytest.raises(AnswerError, match=words):
        calls[verb]()
    assert not (tmp_path / "run").exists()


def horch(record):
    return True


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: sb.detect(op=OP, pv=PV), r"no Ts given.*Ts=1\.0"),
        (lambda: sb.detect(FRAME, op=OP), "one of both"),
        (lambda: sb.detect({"op": OP}), "no PV column"),
        (lambda: sb.detect({"op": OP, "pv": PV}), "no sampling period"),
        (lambda: sb.detect({"op": OP, "pv": ["x"] * 600}, Ts=1.0), "row 0: pv is"),
    ],
)
def test_what_is_no_record_is_shown_one(call, words):
    with pytest.raises(RecordError, match=words):
        call()


@pytest.mark.parametrize(
    ("methods", "words"),
    [
        ([lambda r: True], "no lambda"),
        ([3], "no detector"),
        ([Level], "no detector"),
        ([Level(), Level()], "two"),
        (horch, "taken"),
    ],
)
def test_what_is_no_detector_is_refused(methods, words):
    with pytest.raises(ParameterError, match=words):
        sb.detect(FRAME, methods)


def test_gap_and_confirm_take_the_same():
    t = np.arange(2000.0)
    one, two = (
        {"t": t, "op": 50 + np.sin(2 * np.pi * t / P), "pv": np.cos(2 * np.pi * t / P)}
        for P in (90, 150)
    )
    assert sb.confirm(one, two, ratio=0.6).shift == pytest.approx(2 / 3, rel=0.01)
    with pytest.raises(RecordError, match="no Ts"):
        sb.gap.diagnose(op=OP, pv=PV)


def test_files_frames_and_arrays_are_read_alike(tmp_path):
    t = np.arange(400.0)
    frame = pd.DataFrame({"t": t, "SP": np.nan, "op": 50 + np.sin(t / 8), "pv": 20 + np.cos(t / 8)})
    frame.loc[[5, 90], "pv"] = np.nan
    frame.to_csv(tmp_path / "rec.csv", index=False)
    file = as_record(tmp_path / "rec.csv")
    arrays = {name: frame[name].to_numpy() for name in ("op", "pv")}
    tables = (frame, frame.set_index("t"), {name: frame[name].to_numpy() for name in frame})
    for record in (*map(as_record, tables), as_record(**arrays, Ts=1.0)):
        assert record.sp is None
        assert record.Ts == file.Ts
        assert np.allclose(record.pv, file.pv)
        assert record.notes == file.notes
    answers = [sb.detect(source, "he").as_json() for source in (frame, tmp_path / "rec.csv")]
    assert answers[0] == answers[1]
    stamped = frame.assign(t=pd.Timestamp("2026-01-01") + pd.to_timedelta(t, "s"))
    assert as_record(stamped).Ts == 1.0
    with pytest.raises(RecordError, match="one length"):
        as_record({"op": [1.0, 2.0], "pv": [1.0], "t": [0.0, 1.0]})
