"""What a detector's file must keep, and what is said of one that does not."""

import pytest

from simbench.cli import main
from simbench.detectors.contract import check_detector
from simbench.detectors.errors import ParameterError

FILE = """\"\"\"A detector.\"\"\"
from simbench.detectors.method import Method
from simbench.detectors.verdict import Verdict

METHOD = Method(title="mine", source="own", front_end=False)
seen = []


def detect(prepared):
    record = prepared.record
    {body}
    return Verdict("mine", "{word}", score=1.0, reason="why")
"""


def broken(folder, body="pass", word="stiction", file=FILE):
    """Return what is said of a detector with this body."""
    path = folder / "mine.py"
    path.write_text(file.format(body=body, word=word))
    return check_detector(path).broken


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"body": "1 / 0"}, "line 11: detect raises ZeroDivisionError on a sticky record"),
        ({"body": "return 3"}, "line 9: detect answers 3, a simbench.detectors.verdict.Verdict"),
        (
            {"word": "sticky"},
            "line 12: detect raises ValueError on a sticky record (mine: verdict 'sticky'",
        ),
        ({"body": "record.op.flags.writeable = True; record.op[0] = 9"}, "writes into op"),
        (
            {"body": "seen.append(1); return Verdict('m', 'stiction', len(seen), reason='r')"},
            "line 9: detect answers otherwise when asked twice (sticky)",
        ),
        (
            {
                "body": "\n    if record.pv.mean() > 99: return"
                " Verdict('m', 'no_stiction', 1.0, reason='r')"
            },
            "line 9: detect follows PV's unit: another verdict on a rescaled record",
        ),
        ({"file": "import nothing_of_that_name"}, "line 1: detector file"),
        ({"file": "x = 1\ndef ("}, "line 2: detector file"),
        (
            {"file": FILE.replace('title="mine"', "title=3")},
            "METHOD.title = 3; a str is needed",
        ),
        ({"file": FILE.replace("(prepared)", "()")}, "line 5: detector 'mine': detect() cannot"),
    ],
)
def test_what_is_broken_is_said_in_a_sentence_with_its_line(tmp_path, more, said):
    sentences = broken(tmp_path, **more)
    assert any(said in sentence for sentence in sentences), sentences


def test_a_dead_record_may_be_refused_and_no_other(tmp_path):
    refuse = "\n    if record.pv.std() {} 0: raise ValueError('no')"
    assert "on a dead record (no)" in broken(tmp_path, refuse.format("=="))[0]
    refuse = refuse.replace("ValueError", "prepared.__class__.__mro__[0] and UserError")
    file = FILE.replace("METHOD =", "from simbench.detectors.errors import UserError\nMETHOD =")
    assert broken(tmp_path, refuse.format("=="), file=file) == ()
    assert "refuses a sticky record (no)" in broken(tmp_path, refuse.format(">"), file=file)[0]


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="does not exist"):
        check_detector(tmp_path / "mine.py")
    assert main(["contract", str(tmp_path / "mine.py")]) == 2


def test_the_verb_ends_with_1_where_something_is_broken(tmp_path, capsys):
    broken(tmp_path, "1 / 0")
    assert main(["contract", str(tmp_path / "mine.py")]) == 1
    assert capsys.readouterr().out.startswith("detector mine: breaks its contract\n  line 11: ")
