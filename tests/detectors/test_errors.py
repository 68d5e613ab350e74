"""What is printed holds no password, whatever it stands in."""

import pytest

from simbench.detectors.errors import ParameterError, masked, naming, nearest
from simbench.usage import complain, exit_code


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("s3://key:secret@host/run", "s3://***@host/run"),
        ("'ftp://me:p@ss:secret@host:21/a' is gone", "'ftp://***@host:21/a' is gone"),
        ("github://secret@host/a", "github://***@host/a"),
        ("https:/me:secret@host/a", "https:/***@host/a"),
        ("invalid address 'me:secret@127.0.0.1:1'", "invalid address '***@127.0.0.1:1'"),
        ("https://host/a?sv=1&sig=secret&x=2", "https://host/a?sv=1&sig=***&x=2"),
        ("https://host/a?X-Amz-Credential=secret", "https://host/a?X-Amz-Credential=***"),
        ("a@b.c wrote 3:4 to s3://bucket/run", "a@b.c wrote 3:4 to s3://bucket/run"),
    ],
)
def test_users_and_passwords_are_masked_and_nothing_else(text, seen):
    assert masked(text) == seen


def test_a_long_sentence_keeps_its_beginning_and_its_end_and_no_secret(capsys):
    complain("bad s3://k:secret@h/run " + "x" * 3_000 + " a number is needed")
    printed = capsys.readouterr().err
    assert len(printed) < 1000
    assert printed.startswith("error: bad s3://***@h/run x")
    assert printed.endswith("x a number is needed\n")


def test_a_faults_log_holds_no_secret(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("SIMBENCH_RAISE")
    import tempfile

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr("sys.argv", ["simbench", "run", "s3://k:secret@h/run"])

    def fault():
        raise ArithmeticError("s3://k:secret@h/run")

    assert exit_code(fault) == 2
    (log,) = tmp_path.iterdir()
    assert "ArithmeticError" in log.read_text()
    assert "secret" not in log.read_text() + capsys.readouterr().err


def test_a_sentence_names_its_file_once():
    with (
        pytest.raises(ParameterError, match=r"^loop\.toml: S = -1$"),
        naming("loop.toml"),
        naming("loop.toml"),
    ):
        raise ParameterError("S = -1")


def test_of_many_known_names_the_nearest_three_are_named():
    ids = [f"{k:08x}" for k in range(3000)]
    sentence = nearest("zz", ids)
    assert sentence.startswith("the nearest of 3000 known: ")
    assert len(sentence.rpartition(": ")[2].split(", ")) == 3
    assert nearest("zz", ["he", "horch"]) == "known: he, horch"
