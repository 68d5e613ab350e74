"""Dense loops judged at other densities and backwards: two that once changed their verdicts."""

from itertools import islice

import pytest

from results.studies.invariance import dense_records
from simbench.detectors.contract.detector import THINNED, backwards
from simbench.detectors.judge import judge
from simbench.detectors.prepared import thinned


@pytest.fixture(scope="module")
def records():
    """Loops of chapter whose whole does not oscillate: a half does, at some densities more plainly
    than at others.
    """
    dense = list(islice(dense_records({"chapter": 20}), 12))
    return [dense[9].without_mv(), dense[11].without_mv()]


def test_verdicts_do_not_hang_on_the_density(records):
    for record in records:
        verdicts = [
            [v.verdict for v in judge(thinned(record, k), ["horch_histogram", "ellipse"])]
            for k in (1, *THINNED[:2])
        ]
        assert verdicts[0] == verdicts[1] == verdicts[2]


def test_a_method_that_reads_both_ways_answers_the_same_backwards(records):
    how = {"raw": True, "halves": False}
    for record in records:
        one, other = (
            judge(r, ["horch", "ellipse", "horch_histogram"], **how)
            for r in (record, backwards(record))
        )
        assert [v.verdict for v in one] == [v.verdict for v in other]
