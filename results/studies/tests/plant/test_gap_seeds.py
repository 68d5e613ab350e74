"""A plain case has one answer with every seed of the simulations."""

from recorded import STICKY, resting

from results.studies.plant import gap_seeds as study
from simbench.files import write_record


def test_a_plain_case_has_one_answer_with_every_seed(tmp_path, capsys):
    write_record(resting(1, **STICKY), tmp_path / "FIC1.csv")
    (tmp_path / "notes.csv").write_text("no,record\n1,2\n")
    assert study.main([str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "1 records, seed 919" in said
    assert "another effect: 0" in said
