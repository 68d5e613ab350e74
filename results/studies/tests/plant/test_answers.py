"""A study that was killed asks nothing twice."""

from results.studies.plant.answers import answered


def test_an_answer_is_asked_for_once(tmp_path):
    file = tmp_path / "answer.json"
    assert answered(file, lambda: [1, 2]) == [1, 2]
    assert answered(file, lambda: [3]) == [1, 2]
