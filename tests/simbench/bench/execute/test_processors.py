"""The same benchmark on every machine: ids, records, verdicts and `check` under the choices that
numpy and BLAS make on other processors.
"""

import json

import pandas as pd
import pytest

from tests.common import processors

# the two that differ most; single loops are simulated on all of them
PROCESSORS = {name: processors.PROCESSORS[name] for name in ("as it is", "without AVX-512")}
OWN = """
title = "own"
seed = 8
repeats = 2
[draw]
K = [0.5, 2.0]
T = [20.0, 100.0]
S = [2.0, 6.0]
step = 1.0
samples_per_period = [25.0, 40.0]
periods = 20.0
noise_ratio = 0.1
[disturbances.sine]
type = "sine"
amplitude = [0.7, 1.0]
period = [1.3, 2.0]
[[block]]
name = "own"
axes = { Td_over_T = [0.3], S_over_2J = [0.5, 1.5], disturbance = ["none", "sine"] }
[[block.member]]
name = "sticky"
valve = "choudhury"
[[block.member]]
name = "healthy"
valve = "ideal"
echo = "harmonics"
"""


@pytest.fixture(scope="module", params=["smoke", pytest.param("own.toml", marks=pytest.mark.slow)])
def runs(request, tmp_path_factory):
    """One run of a grid for each processor: one of the package, and a user's own, which is settled
    anew by each.
    """
    place = tmp_path_factory.mktemp("processors")
    (place / "own.toml").write_text(OWN)
    grid = str(place / "own.toml") if request.param == "own.toml" else request.param
    for name, processor in PROCESSORS.items():
        methods = "fast" if request.param == "smoke" else "horch,he,hammerstein"
        said = simbench(processor, "run", grid, "-o", place / name, "--method", methods)
        assert said.returncode == 0, said.stderr
    return place


def simbench(processor, *words):
    return processors.on(processor, "-m", "simbench.cli", *map(str, words))


def tables(run):
    scenarios = pd.read_parquet(run / "scenarios.parquet").set_index("scenario_id")
    verdicts = pd.read_parquet(run / "verdicts.parquet")
    return scenarios, verdicts.set_index(["scenario_id", "method"]).verdict


def test_ids_loops_records_and_verdicts_are_the_same(runs):
    here, said = tables(runs / "as it is")
    assert len(here) > 12
    for name in PROCESSORS:
        there, answers = tables(runs / name)
        assert list(there.index) == list(here.index)
        for column in ("loop_digest", "record_hash", "cycled"):
            assert there[column].tolist() == here[column].tolist()
        assert answers.equals(said)


@pytest.mark.parametrize("runs", ["smoke"], indirect=True)
def test_a_baseline_of_one_passes_a_run_of_another(runs):
    one, other = PROCESSORS["as it is"], PROCESSORS["without AVX-512"]
    baseline = runs / "baseline"
    assert simbench(one, "check", runs / "as it is", "--against", baseline, "--update").stdout
    run = runs / "without AVX-512"
    said = simbench(other, "check", run, "--against", baseline, "--json")
    assert said.returncode == 0, said.stdout
    n = len(tables(run)[0])
    bits = {"equal": n, "other_bits": 0, "other_verdict": 0}
    assert (json.loads(said.stdout)["result"], json.loads(said.stdout)["bits"]) == ("same", bits)
