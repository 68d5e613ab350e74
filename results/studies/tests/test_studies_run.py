"""Every study that is not run by a test of its own runs at its smallest size, and prints: a renamed
function of the product is seen here, not when results are printed again.
"""

import runpy
import sys

import pytest

# {} is an empty folder
SMALLEST = {
    "coupled_loops": "--pairs 1",
    "plant.causes": "-n 1 --worlds refinery --blind 1 --archived 1",
    "learned": "--grid ci --learn 40 --ask 20",
    "plant.archives": "-n 1 {}",
    "plant.gain_pairs": "-n 1",
    "preprocessing": "-n 40",
    "plant.stiction_probability": "{} -n 4 --simulators own plant",
}
LARGER = {
    "admission": "--seed 1 -n 1 --rule exact -j 1",
    "healthy": "-n 0 --none 1 -j 1",
    "nuisances": "-n 2 -j 1",
    "plant.calibration": "-n 2 --seed 1 -j 1 {}",
    "plant.denials": "-n 1 --sound 1 -j 1",
    "prediction": "-n 1 {}",
    "transfer": "-n 12 --slow 4 {}",
}


# of so few loops correlations are of constants, and another test may have imported a study
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("study", "words"),
    [
        *SMALLEST.items(),
        *(pytest.param(*study, marks=pytest.mark.slow) for study in LARGER.items()),
    ],
)
def test_a_study_runs(study, words, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [study, *words.format(tmp_path / "kept").split()])
    with pytest.raises(SystemExit) as end:
        runpy.run_module(f"results.studies.{study}", run_name="__main__")
    said = capsys.readouterr()
    assert not end.value.code, said.err
    assert said.out.strip()
